//! The budget against runs of many seeds, each axis on its own.

use super::super::axes::Axis;
use super::super::world::World;
use super::super::{Budget, Settings, budget};
use fusion::Selection;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run, run_sharing};
use fusion_core::consistency::chi_square_quantile;
use fusion_core::runner::Halt;
use fusion_models::sim::SharedCourse;
use rayon::prelude::*;

const SEEDS: u64 = 200;

fn design(file: &str, set: &[&str]) -> Design {
    let selection = Selection {
        set: set.iter().map(|set| (*set).to_owned()).collect(),
        ..Selection::default()
    };
    selection.load(format!("../{file}")).unwrap_or_else(|d| panic!("{d}"))
}

/// The squared errors of one run: at the end, and their mean.
struct Squares<'a> {
    axes: &'a [Axis],
    layout: &'a fusion_core::state::Layout,
    from: f64,
    end: Vec<f64>,
    sum: Vec<f64>,
    count: f64,
}

impl RunObserver for Squares<'_> {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Truth { belief, truth, .. } = event else { return Ok(()) };
        let mut error = vec![0.0; self.layout.dim()];
        self.layout.minus(&belief.x, truth, &mut error);
        let along = |axis: &Axis| axis.along(&belief.x).iter().map(|(i, by)| by * error[*i]).sum::<f64>();
        self.end = self.axes.iter().map(|axis| along(axis).powi(2)).collect();
        if belief.time.seconds() >= self.from {
            self.sum.iter_mut().zip(&self.end).for_each(|(sum, square)| *sum += square);
            self.count += 1.0;
        }
        Ok(())
    }
}

/// For each axis: its name, then Σ e²/σ² over the seeds at the end, and the RMS over all runs over its σ.
fn against_seeds(design: &Design, found: &Budget) -> Vec<(String, f64, f64)> {
    let options = Options::default();
    let run = Run::open(design, &options).unwrap();
    let (layout, course) = (run.assembly().layout.clone(), SharedCourse::default());
    let axes = Axis::all(&layout, &World::of(design, run.assembly()).unwrap());
    let from = design.reference.as_ref().and_then(|r| r.block.from).map_or(0.0, |from| from.si());
    let runs: Vec<(Vec<f64>, Vec<f64>)> = (0..SEEDS)
        .into_par_iter()
        .map(|seed| {
            let options = Options {
                seed: Some(1000 + seed),
                ..Options::default()
            };
            let mut squares = Squares {
                axes: &axes,
                layout: &layout,
                from,
                end: Vec::new(),
                sum: vec![0.0; axes.len()],
                count: 0.0,
            };
            run_sharing(design, &options, &course, &mut [&mut squares]).unwrap();
            let mean = squares.sum.iter().map(|sum| sum / squares.count).collect();
            (squares.end, mean)
        })
        .collect();
    let states = found.states.iter().enumerate();
    let each = states.map(|(k, state)| {
        let end: f64 = runs.iter().map(|(end, _)| end[k] / state.end.total()).sum();
        let mean: f64 = runs.iter().map(|(_, mean)| mean[k]).sum::<f64>() / SEEDS as f64;
        let name = state.name();
        println!(
            "{name:26} σ {:.4e} filter {:.4e} seeds/σ: end {:.3}, run {:.3}",
            state.rms.sigma(),
            state.rms.filter.sqrt(),
            (end / SEEDS as f64).sqrt(),
            (mean / state.rms.total()).sqrt()
        );
        (name, end, (mean / state.rms.total()).sqrt())
    });
    each.collect()
}

/// Every error at the end is a normal number of its σ, so the sum of the squares over the seeds is χ². Of all axes
/// together, one in a thousand sets of seeds is outside.
fn check(file: &str, set: &[&str]) {
    let design = design(file, set);
    let found = budget(&design, &Settings::default()).unwrap_or_else(|d| panic!("{d}"));
    let each = against_seeds(&design, &found);
    let tail = 0.001 / (2.0 * each.len() as f64);
    let band = (
        chi_square_quantile(tail, SEEDS as f64),
        chi_square_quantile(1.0 - tail, SEEDS as f64),
    );
    for (name, end, run) in &each {
        assert!((band.0..band.1).contains(end), "{name} at the end: {end}, band {band:?}");
        let _ = run;
    }
}

#[test]
fn the_design_as_it_is_agrees_with_its_seeds() {
    check("configs/ins-gps.toml", &[]);
}

#[test]
fn every_kind_of_error_agrees_with_its_seeds() {
    check("configs/ins-gps.toml", &EVERY_KIND);
}

/// Errors that the filter estimates, and many that it does not know of.
const EVERY_KIND: [&str; 8] = [
    "simulation.draw_start=true",
    "simulation.imu.gyro.markov={ sigma = '20 deg/h', correlation_time = '100 s' }",
    "simulation.imu.gyro.scale_factor='0.3 %'",
    "simulation.imu.gyro.misalignment='2 mrad'",
    "simulation.imu.accelerometer.bias_random_walk='0.2 mm/s^2/sqrt(s)'",
    "simulation.imu.accelerometer.scale_factor='0.1 %'",
    "simulation.sensor.position.markov={ sigma = '1.5 m', correlation_time = '40 s' }",
    "simulation.sensor.velocity.bias_sigma='2 cm/s'",
];
