//! Simulated rows with their faults.

use super::*;
use crate::assembly::{assemble, declared_streams};
use crate::config::Document;
use crate::design::Design;
use crate::rows::{Nobody, ProvidedChannel, Row};
use fusion_core::time::Time;
use fusion_models::block::imu_channels;
use fusion_models::fault::RowOutcome;
use fusion_models::fault::{FaultContext, derive_seed};

/// Ten seconds at rest; `imu` is added to the fields of the IMU.
fn design(process: &str, imu: &str) -> Design {
    let text = format!(
        "[run]
        origin = {{ latitude = '47 deg', longitude = '8 deg' }}
        seed = 3
        [process]
        source = 'unit'
        {process}
        [sensor.north]
        type = 'heading'
        source = 'compass'
        noise = {{ sigma = '1 deg' }}
        [initial.start]
        type = 'explicit'
        position_sigma = 1
        velocity = [0, 0, 0]
        velocity_sigma = 1
        attitude = [0, 0, 0]
        attitude_sigma = '1 deg'
        [simulation]
        trajectory = [{{ type = 'rest', duration = 10 }}]
        imu = {{ rate = '10 Hz', preset = 'hg1700', {imu} }}
        sensor.north = {{ rate = '1 Hz', white = '1 deg', fault.hum = {{ type = 'noise', sigma = '1 deg' }} }}"
    );
    Design::read(Document::parse("design.toml", &text).0).unwrap_or_else(|d| panic!("{d}"))
}

const STRAPDOWN: &str = "type = 'strapdown'\ngyro.noise = 1e-5\naccelerometer.noise = 1e-4";

/// The rows of a stream, each as wide as the assembly expects.
fn rows(design: &Design, stream: &str) -> Vec<(Time, Vec<f64>)> {
    let assembly = assemble(design, declared_streams(design).unwrap()).unwrap_or_else(|d| panic!("{d}"));
    let simulation = design.simulation.as_ref().unwrap();
    let mut world = SimulatedRows::new(design, simulation, &assembly, None).unwrap_or_else(|d| panic!("{d}"));
    let mut found = Vec::new();
    while let Some(Row {
        stream: id, time, values, ..
    }) = world.next(&mut Nobody)
    {
        assert_eq!(values.len(), assembly.streams[id].width(), "{}", assembly.streams[id].name);
        if assembly.streams[id].name == stream {
            found.push((time, values.to_vec()));
        }
    }
    found
}

#[test]
fn a_fault_of_the_unit_disturbs_its_window_of_the_unit_alone() {
    let jump = "fault.jump = { type = 'spike', channel = 'specific_force', value = ['0.5 m/s^2', 0, 0], window = { from = 4, to = 6 } }";
    let (sound, faulty) = (design(STRAPDOWN, ""), design(STRAPDOWN, jump));
    assert_eq!(rows(&sound, "north"), rows(&faulty, "north"));
    assert_eq!(rows(&sound, REFERENCE), rows(&faulty, REFERENCE));
    let (sound, faulty) = (rows(&sound, "unit"), rows(&faulty, "unit"));
    assert_eq!((sound.len(), faulty.len()), (101, 101));
    let mut disturbed = 0;
    for ((time, sound), (_, faulty)) in sound.iter().zip(&faulty) {
        let mut expected = sound.clone();
        if (4.0..6.0).contains(&time.seconds()) {
            expected[3] += 0.5;
            disturbed += 1;
        }
        assert_eq!(*faulty, expected, "{time}");
    }
    assert_eq!(disturbed, 20);
}

#[test]
fn a_random_fault_of_the_unit_has_a_seed_of_its_own() {
    let hum = "fault.hum = { type = 'noise', channel = 'angular_rate', sigma = '1 deg/s' }";
    let (sound, faulty) = (design(STRAPDOWN, ""), design(STRAPDOWN, hum));
    let channels = [ProvidedChannel {
        channel: imu_channels()[0].clone(),
        offset: 0,
        delay_ns: 0,
    }];
    let context = FaultContext {
        channels: &channels,
        seed: derive_seed(3, &["imu", "hum"]),
    };
    let mut fault = faulty.simulation.as_ref().unwrap().block.faults[0].1[0].1.build(&context).unwrap();
    let mut expected = rows(&sound, "unit");
    for (time, row) in &mut expected {
        assert_eq!(fault.apply(*time, row), RowOutcome::Disturbed);
    }
    assert_eq!(rows(&faulty, "unit"), expected);
    assert_ne!(rows(&sound, "unit"), expected);
}

#[test]
fn a_process_that_reads_only_the_gyros_is_simulated() {
    let design = design("type = 'attitude_only'\ngyro_noise = 1e-5", "");
    assert_eq!(rows(&design, "unit").len(), 101);
}

#[test]
fn a_stage_between_unit_and_process_reads_the_unit_as_imu() {
    let process = "type = 'strapdown_external_attitude'\nattitude_noise = 1e-5\naccelerometer_noise = 1e-4
        [stage.unit]\ntype = 'filter'\nprocess = { type = 'attitude_only', source = 'imu', gyro_noise = 1e-5 }\n\
        initial.level = { type = 'levelling', source = 'imu', duration = 1, tilt_sigma = 0.01 }";
    assert_eq!(rows(&design(process, ""), "imu").len(), 101);
}

#[test]
fn simulated_rows_arrive_late_and_twice_as_recorded_ones_do() {
    let slow = "fault.slow = { type = 'late', by = '0.25 s', window = { from = 4, duration = '1 ms' } }";
    let (sound, faulty) = (rows(&design(STRAPDOWN, ""), "unit"), rows(&design(STRAPDOWN, slow), "unit"));
    let mut expected = sound.clone();
    // 4.0 s, due at 4.25 s, comes between 4.2 s and 4.3 s.
    expected[40..43].rotate_left(1);
    assert_eq!(faulty, expected);
    let twice = "fault.twice = { type = 'duplicate', window = { from = 10 } }";
    let faulty = rows(&design(STRAPDOWN, twice), "unit");
    assert_eq!((faulty.len(), &faulty[101]), (102, &sound[100]));
}
