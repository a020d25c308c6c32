//! The maximum a posteriori of a log: by the iterated smoother, and by sparse Cholesky factorisation.

use super::real::real_design;
use crate::support::{Workspace, has};
use fusion::config::Document;
use fusion::core::belief::Belief;
use fusion::core::runner::Halt;
use fusion::core::state::Layout;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Keep, Options, Run, Smoothing, Summary};
use std::path::Path;

/// The smoothed estimates.
#[derive(Default)]
struct Smoothed(Vec<Belief>);

impl RunObserver for Smoothed {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Estimate { belief, .. } = event {
            self.0.push((*belief).clone());
        }
        Ok(())
    }
}

fn smoothed(design: &Design, options: Options, smooth: Smoothing) -> (Summary, Vec<Belief>) {
    let (options, mut smoothed) = (Options { smooth, ..options }, Smoothed::default());
    let run = Run::open(design, &options).unwrap_or_else(|d| panic!("{d}"));
    let finished = run.go_and_smooth(&mut [], &mut [&mut smoothed], &mut |_| {});
    (finished.unwrap_or_else(|d| panic!("{d}")).summary, smoothed.0)
}

fn shipped(name: &str) -> Design {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("configs/{name}.toml"));
    let document = Document::load(&file).unwrap_or_else(|d| panic!("{d}"));
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

/// The largest difference of two lists of estimates, in the σ of the first.
fn distance(layout: &Layout, a: &[Belief], b: &[Belief]) -> f64 {
    assert!(a.len() == b.len() && !a.is_empty(), "{} {}", a.len(), b.len());
    let mut difference = vec![0.0; layout.dim()];
    let pairs = a.iter().zip(b).map(|(a, b)| {
        assert_eq!(a.time, b.time);
        layout.minus(&b.x, &a.x, &mut difference);
        let sigmas = layout.blocks().iter().flat_map(|block| a.covariance.sigmas(block));
        let known = difference.iter().zip(sigmas).filter(|(_, sigma)| *sigma > 0.0);
        known.map(|(d, sigma)| d.abs() / sigma).fold(0.0, f64::max)
    });
    pairs.fold(0.0, f64::max)
}

#[test]
fn the_iterated_smoother_and_cholesky_factorisation_end_at_the_same_estimates() {
    for name in [
        "backends/range-only",
        "backends/large-heading",
        "published/localisation-2d",
        "published/inertial-landmarks",
    ] {
        let design = shipped(name);
        let [(one, iterated), (other, batch)] =
            [Smoothing::Iterated(Keep::Memory), Smoothing::Batch].map(|smooth| smoothed(&design, Options::default(), smooth));
        for summary in [one, other] {
            let how = summary.smoothed().unwrap().iteration.unwrap();
            assert!(how.is_converged, "{name}: {how:?}");
        }
        let options = Options::default();
        let run = Run::open(&design, &options).unwrap();
        let distance = distance(&run.assembly().layout, &iterated, &batch);
        // Each is within 1e-6 σ of the optimum.
        assert!(distance < 2e-6, "{name}: {distance}");
    }
}

#[test]
fn a_start_that_misleads_the_smoother_does_not_mislead_the_iteration() {
    let design = shipped("backends/range-only");
    let [(once, _), (again, _)] =
        [Smoothing::Whole(Keep::Memory), Smoothing::Iterated(Keep::Memory)].map(|smooth| smoothed(&design, Options::default(), smooth));
    let [once, again] = [&once, &again].map(|summary| summary.smoothed().unwrap().score.as_ref().unwrap().horizontal_rms);
    // Measured 1.2 m and 0.014 m; a range has a σ of 5 cm.
    assert!(once > 0.5 && again < 0.05, "{once} {again}");
}

#[test]
fn the_iteration_ends_on_recorded_logs() {
    for name in ["rtklib-drive", "broad"] {
        let Some((design, options)) = real_design(name, &[], &[]) else {
            return;
        };
        let (summary, _) = smoothed(&design, options, Smoothing::Iterated(Keep::Memory));
        let how = summary.smoothed().unwrap().iteration.unwrap();
        // Measured four and three.
        assert!(how.is_converged && how.iterations <= 6, "{name}: {how:?}");
    }
}

#[test]
fn a_run_without_a_reference_says_how_the_iteration_ended() {
    let w = Workspace::new("optimum-unscored");
    let design = format!("{}/configs/series/nile.toml", env!("CARGO_MANIFEST_DIR"));
    // A linear model: the first linearisation is exact.
    w.fusion(&["run", &design, "--smooth=iterate", "--verbose"]).success().stdout(has(
        "Linearised once at the smoothed states: no state is further than 1e-6 σ from the optimum.",
    ));
}
