//! The budget against runs of many seeds, each axis on its own.

use super::super::axes::Axis;
use super::super::follower::Follower;
use super::super::world::World;
use super::super::{Budget, Settings, StateBudget, budget};
use fusion::Selection;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run, run_sharing};
use fusion_core::consistency::chi_square_quantile;
use fusion_core::runner::Halt;
use fusion_models::sim::SharedCourse;
use rayon::prelude::*;

const SEEDS: u64 = 200;

pub(super) fn design(file: &str, set: &[&str]) -> Design {
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
        let RunEvent::Truth { belief, truth, .. } = event else {
            return Ok(());
        };
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
    // An axis that is declared without error has none.
    let states = found.states.iter().enumerate().filter(|(_, state)| state.rms.total() > 0.0);
    let each = states.map(|(k, state)| {
        let end: f64 = runs.iter().map(|(end, _)| end[k] / state.end.total()).sum();
        let mean: f64 = runs.iter().map(|(_, mean)| mean[k]).sum::<f64>() / SEEDS as f64;
        let name = state.name();
        let (end_ratio, run_ratio) = ((end / SEEDS as f64).sqrt(), (mean / state.rms.total()).sqrt());
        println!("{name:20} errors of the seeds over σ: {end_ratio:.3} at the end, {run_ratio:.3} over the run");
        (name, end, run_ratio)
    });
    each.collect()
}

/// Every error at the end is a normal number of its σ, so the sum of the squares over the seeds is χ² with as many degrees
/// of freedom. The mean over a run scatters less. Of all axes together, two in a thousand sets of seeds are outside.
fn check(file: &str, set: &[&str]) {
    let design = design(file, set);
    let found = budget(&design, &Settings::default()).unwrap_or_else(|d| panic!("{d}"));
    let each = against_seeds(&design, &found);
    let (seeds, tail) = (SEEDS as f64, 0.001 / (2.0 * each.len() as f64));
    let band = [tail, 1.0 - tail].map(|p| chi_square_quantile(p, seeds));
    for (name, end, run) in &each {
        for squares in [*end, seeds * run * run] {
            assert!((band[0]..band[1]).contains(&squares), "{name}: {squares}, band {band:?}");
        }
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

/// The path of each seed is another one, which changes its errors to second order only. The tracks have the errors that
/// the filter declares: their slip does not change. The ground is level, because
/// it is another for each seed. The simulated vehicle obeys the constraint exactly, so it is left out.
#[test]
fn a_vehicle_that_steers_by_its_estimate_agrees_with_its_seeds() {
    let declared = [
        "sensor.usbl.enabled=true",
        "sensor.depth.enabled=true",
        "sensor.sideways.enabled=false",
        "sensor.tracks.noise.sigma='2 cm/s'",
        "simulation.vehicle.slip.sigma=0",
        "simulation.vehicle.terrain.sigma=0",
        "simulation.longest='70 s'",
    ];
    check("configs/utv-square.toml", &declared);
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

/// The same errors as two sources: all that are drawn once, and all others in one covariance.
fn united(mut world: World) -> World {
    for error in &mut world.errors {
        error.source = usize::from(world.sources[error.source].block.is_some());
    }
    world.moved.iter_mut().for_each(|moved| moved.block = 0);
    world.found = world.found.map(|(_, names)| (0, names));
    world.gaps = world.gaps.map(|_| 0);
    world.process.iter_mut().for_each(|own| *own = own.map(|_| 0));
    world.sources.truncate(2);
    (world.sources[0].block, world.sources[1].block, world.blocks) = (None, Some(0), 1);
    world
}

/// The largest relative difference between the sum of all sources and all errors together.
fn off_total(set: &[&str]) -> f64 {
    let design = design("configs/ins-gps.toml", set);
    let options = Options::default();
    let total = |unite: fn(World) -> World| {
        let run = Run::open(&design, &options).unwrap();
        let world = unite(World::of(&design, run.assembly()).unwrap());
        let mut follower = Follower::new(&design, world, run.assembly(), &[]);
        run.go(&mut [&mut follower], &mut |_| {}).unwrap();
        follower.finish().1
    };
    let splits = |states: Vec<StateBudget>| states.into_iter().flat_map(|s| [s.end.total(), s.rms.total()]);
    let pairs = splits(total(|world| world)).zip(splits(total(united)));
    pairs.map(|(apart, together)| (apart / together - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn the_sources_of_a_run_add_up_to_all_errors_together() {
    for set in [&[][..], &EVERY_KIND] {
        let off = off_total(set);
        println!("{off:e}");
        // Rounding of 14,000 steps, √14,000 ε = 3e-14, in covariances whose parts cancel: 2e-14 were found.
        assert!(off < 1e-12, "{off:e}");
    }
}
