//! The law of time: any order of arrival within the buffer gives bit for bit the result of time
//! order.

use fusion::Navigator;
use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::core::belief::Belief;
use fusion::core::runner::{Discard, Event};
use fusion::core::time::{Time, nanos};
use fusion::design::Design;
use fusion::rows::Nobody;
use fusion::world::SimulatedRows;

/// A minute of the built-in design, started by levelling and the first fixes, with a GNSS that is
/// stamped late by times that are not known.
pub const DESIGN: &str = r#"
[run]
origin = { latitude = "36.1 deg", longitude = "129.4 deg" }
reorder = "0.5 s"
[process]
type = "strapdown"
source = "imu"
gyro = { noise = "0.125 deg/sqrt(h)", bias = { estimate = true, initial = [0, 0, 0], sigma = "1 deg/h" } }
accelerometer = { noise = "0.33 mm/s/sqrt(s)", bias = { estimate = true, initial = [0, 0, 0], sigma = "1 mg" } }
[sensor.position]
type = "gnss_position"
source = "gnss"
time_offset = { estimate = true, initial = "0.1 s", sigma = "50 ms" }
lever_arm = [0.3, 0, "-1 m"]
noise = { sigma = "1 m" }
gate = { type = "nis", probability = 0.99 }
[sensor.velocity]
type = "gnss_velocity"
source = "gnss"
only_with = "position"
time_offset = { estimate = true, initial = "0.3 s", sigma = "50 ms" }
noise = { sigma = "0.05 m/s" }
[stage.wheels]
type = "periodic"
source = "imu"
rate = "10 Hz"
min_speed = "1 m/s"
[sensor.wheels]
type = "nonholonomic"
source = "wheels"
only_with = "position"
mounting = { estimate = true, initial = [0, 0, 0], sigma = [0, "1 deg", "1 deg"] }
noise = { sigma = "0.1 m/s" }
[initial.level]
type = "levelling"
source = "imu"
duration = "3 s"
tilt_sigma = "0.1 deg"
still = { accel_std = "0.05 m/s^2", gyro_std = "0.1 deg/s" }
[initial.fix]
type = "first_fix"
source = "gnss"
position_sigma = "2 m"
velocity_sigma = "0.3 m/s"
[initial.heading]
type = "course"
source = "gnss"
min_speed = "2 m/s"
sigma = "5 deg"
[simulation]
draw_parameters = true
imu = { rate = "100 Hz", preset = "hg1700" }
trajectory = [
    { type = "rest", duration = "6 s" },
    { type = "straight", distance = "60 m", speed = "8 m/s", acceleration = "1 m/s^2" },
    { type = "turn", angle = "90 deg", radius = "30 m" },
    { type = "straight", distance = "200 m" },
]
[simulation.sensor.position]
rate = "5 Hz"
white = "1 m"
[simulation.sensor.velocity]
rate = "5 Hz"
white = "0.05 m/s"
"#;

fn design() -> Design {
    let (document, mistakes) = Document::parse("order.toml", DESIGN);
    assert!(mistakes.is_empty());
    Design::read(document).unwrap_or_else(|e| panic!("{e}"))
}

fn navigator() -> Navigator {
    let design = design();
    Navigator::from_assembly(assemble(&design, declared_streams(&design).unwrap()).unwrap_or_else(|e| panic!("{e}")))
}

/// All rows of the simulated minute, in order of their stamps.
fn rows() -> Vec<(usize, Time, Vec<f64>)> {
    let design = design();
    let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap();
    let mut world = SimulatedRows::new(&design, design.simulation.as_ref().unwrap(), &assembly, Some(7)).unwrap();
    let mut rows = Vec::new();
    while let Some(row) = world.next(&mut Nobody) {
        rows.push((row.stream, row.time, row.values.to_vec()));
    }
    rows
}

/// The belief after all rows, with the number of updates and of rows that came too late.
fn fed(rows: &[(usize, Time, Vec<f64>)]) -> (Belief, usize, usize) {
    let mut nav = navigator();
    let (mut updates, mut late) = (0, 0);
    let mut count = |event: &Event<'_>| match event {
        Event::Updated { .. } => updates += 1,
        Event::Discarded {
            why: Discard::Late { .. }, ..
        } => late += 1,
        _ => {}
    };
    for (stream, time, row) in rows {
        nav.feed_stream(*stream, *time, row, &mut count).unwrap();
    }
    nav.finish(&mut count).unwrap();
    (nav.belief().unwrap().clone(), updates, late)
}

#[test]
fn any_order_of_arrival_within_the_buffer_gives_the_same_bits() {
    let rows = rows();
    let (wanted, updates, late) = fed(&rows);
    assert!(updates > 300 && late == 0, "{updates} {late}");
    for shuffle in 1..6_i64 {
        // Each row arrives up to 0.49 s late, by a fixed law of its number: no two shuffles alike.
        let mut arrivals: Vec<_> = rows.iter().enumerate().collect();
        arrivals.sort_by_key(|(k, (_, time, _))| time.shifted((*k as i64 * 7919 * shuffle).rem_euclid(49) * nanos(0.01)));
        let shuffled: Vec<_> = arrivals.into_iter().map(|(_, row)| row.clone()).collect();
        assert_ne!(
            shuffled.iter().map(|r| r.1).collect::<Vec<_>>(),
            rows.iter().map(|r| r.1).collect::<Vec<_>>()
        );
        let (belief, n, late) = fed(&shuffled);
        assert_eq!((n, late), (updates, 0));
        assert_eq!(belief.x, wanted.x, "shuffle {shuffle}");
        assert_eq!(belief.covariance, wanted.covariance, "shuffle {shuffle}");
    }
}

#[test]
fn a_row_later_than_the_buffer_is_told_and_changes_nothing() {
    let mut rows = rows();
    let (wanted, ..) = fed(&rows);
    let mut stray = rows.iter().find(|(stream, ..)| *stream == 1).unwrap().clone();
    stray.2[2] += 1000.0;
    // By then the filter runs, and the initialisers no longer listen.
    rows.insert(3000, stray);
    let (belief, _, late) = fed(&rows);
    assert_eq!(late, 1, "the sensor that reads it says so");
    assert_eq!(belief.x, wanted.x);
}

#[test]
fn the_same_rows_give_the_same_bits_twice() {
    let rows = rows();
    assert_eq!(fed(&rows).0.x, fed(&rows).0.x);
}
