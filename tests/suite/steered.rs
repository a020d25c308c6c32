//! Vehicles that are steered by the estimate of their own filter.

use fusion::assembly::{Assembly, assemble, declared_streams};
use fusion::config::Document;
use fusion::design::Design;
use fusion::models::sim::{Leg, Record};
use fusion::rows::Nobody;
use fusion::run::{Options, Summary, run};
use fusion::world::SimulatedRows;
use fusion::{Navigator, core::runner::Event, core::time::Time};
use std::path::Path;

/// A shipped design with these assignments.
pub fn design(file: &str, variants: &[&str], sets: &[&str]) -> Design {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
    let mut document = Document::load(&path).unwrap_or_else(|d| panic!("{d}"));
    for variant in variants {
        document.overlay(&format!("variant.{variant}")).unwrap();
    }
    sets.iter().for_each(|set| document.set(set).unwrap());
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

fn summary(design: &Design, seed: u64) -> Summary {
    let options = Options {
        seed: Some(seed),
        ..Options::default()
    };
    run(design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"))
}

fn record(design: &Design, seed: u64) -> Record {
    summary(design, seed).control.unwrap()
}

/// What is asked of the square: the final error of the heading below 1° on each leg, overshoot at most 4°,
/// and an end within 0.3 m of the start.
pub fn check_square(record: &Record) {
    assert!(record.is_done && record.legs.len() == 8, "{record:?}");
    let is_turn = |leg: &&Leg| leg.name.starts_with("turn");
    for leg in &record.legs[1..] {
        let heading = leg.heading.unwrap();
        assert!(heading.errors.last.to_degrees().abs() < 1.0, "{leg:?}");
        // Only corners show a larger error than 4°.
        assert!(is_turn(&leg) || heading.errors.max.to_degrees() < 4.0, "{leg:?}");
    }
    for turn in record.legs.iter().filter(is_turn) {
        let heading = turn.heading.unwrap();
        assert!(
            heading.errors.max.to_degrees() > 80.0 && heading.overshoot.to_degrees() <= 4.0,
            "{turn:?}"
        );
    }
    let [north, east, _] = record.closure;
    assert!(north.hypot(east) <= 0.3, "{:?}", record.closure);
}

#[test]
fn the_square_is_driven_by_the_vehicle_s_own_estimate() {
    let design = design("utv-square.toml", &[], &[]);
    for seed in 1..=4 {
        check_square(&record(&design, seed));
    }
}

#[test]
fn a_run_under_control_is_a_function_of_its_seed() {
    let design = design("utv-square.toml", &[], &["run.stop=60"]);
    let (a, b, c) = (record(&design, 1), record(&design, 1), record(&design, 2));
    assert_eq!(a, b);
    assert_ne!(a.way, c.way);
}

#[test]
fn the_controller_sees_the_estimate_and_not_the_truth() {
    let wrong = "simulation.sensor.attitude.bias_sigma=[0, 0, \"8 deg\"]";
    let design = design("utv-square.toml", &[], &[wrong, "sensor.attitude.mounting=[0, 0, 0]"]);
    let summary = summary(&design, 3);
    let yaw = summary.score.as_ref().unwrap().attitude_deg.unwrap();
    let record = summary.control.unwrap();
    assert!(record.is_done && yaw.rms[2] > 3.0, "{yaw:?}");
    for leg in &record.legs[1..] {
        // The estimate is wrong by the bias, and the heading as wrong the other way: the vehicle takes
        // itself to be within 1° of what is wanted, and it is known to 1°.
        let wrong = leg.heading.unwrap().errors.last.to_degrees() + yaw.mean[2];
        assert!(wrong.abs() < 2.0, "{leg:?} {yaw:?}");
    }
}

/// The stamps and numbers of the truth, the vehicle being steered by a filter that is fed like in a program.
fn path(design: &Design) -> Vec<(Time, Vec<f64>)> {
    let assembled = || -> Assembly { assemble(design, declared_streams(design).unwrap()).unwrap_or_else(|d| panic!("{d}")) };
    let simulation = design.simulation.as_ref().unwrap();
    let mut world = SimulatedRows::new(design, simulation, &assembled(), None).unwrap_or_else(|d| panic!("{d}"));
    let mut aboard = Navigator::from_assembly(assembled());
    let truth = aboard.stream("reference").unwrap();
    let mut path = Vec::new();
    while let Some(row) = world.next(&mut aboard) {
        if row.stream == truth {
            path.push((row.time, row.values.to_vec()));
        } else {
            aboard.feed_row(&row, &mut |_: &Event<'_>| {}).unwrap();
        }
    }
    path
}

#[test]
fn a_late_row_comes_late_to_the_controller_too() {
    // Where the start is not drawn, no initialiser is missing in a program that feeds rows.
    let base = ["simulation.draw_start=false", "run.reorder=12", "simulation.longest=60"];
    let fault = |what: &str| {
        let fault = format!("simulation.sensor.attitude.fault.x={{ {what}, window = {{ from = 20, to = 22 }} }}");
        path(&design("utv-square.toml", &[], &[&base[..], &[fault.as_str()]].concat()))
    };
    let (late, never) = (fault("type = \"late\", by = 10"), fault("type = \"outage\""));
    let first_difference = late.iter().zip(&never).find(|(a, b)| a != b).unwrap().0.0.seconds();
    // The first of them comes at 30 s; a command acts a tenth of a second and a step later at most.
    assert!((30.0..30.3).contains(&first_difference), "{first_difference}");
}

#[test]
fn a_vehicle_without_an_estimate_stands() {
    let design = design("utv-square.toml", &[], &["simulation.longest=20"]);
    let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap();
    let mut world = SimulatedRows::new(&design, design.simulation.as_ref().unwrap(), &assembly, None).unwrap();
    let mut places = Vec::new();
    while let Some(row) = world.next(&mut Nobody) {
        if assembly.streams[row.stream].name == "reference" {
            places.push(row.values[..3].to_vec());
        }
    }
    assert!(places.len() == 201 && places.iter().all(|place| *place == places[0]));
}
