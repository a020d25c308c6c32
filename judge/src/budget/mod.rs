//! The error budget of a design: which share of each error comes from which source.
//!
//! A nominal run of the simulated design gives gains and linearisation. The errors of the simulated world are then
//! carried through its steps as covariances, without drawing them:
//!
//! ```text
//! predict   e⁺ = Φ e + G δu          Φ of the step, G = ∂f/∂u, δu the error of the input sample
//! update    e⁺ = J [(I − K H) e + K (v − D δu)]        D = ∂h/∂u: the sample in force is in h
//! ```
//!
//! Sources    the errors of the simulated inertial unit or odometry, of the simulated sensors, of the parameters that the
//!            world draws, and of the start. A slow error is a state of the truth model, whether the filter estimates
//!            it or not
//! Gains      those of the nominal run, so mistuned noises of the filter stay as they are; the σ that the filter reports
//!            is next to the σ of its error. The gain of a rejected measurement is 0: gates are outside of the budget
//! Declared   where the world has no instrument, the filter's own declaration is the truth, and the name of the source
//!            says so: sensors that read stages or ships, the noise of a process that time alone drives, a gap of the
//!            input
//! Not here   what is not linear: faults that change numbers, resolution; each is named in [`Budget::outside`]
//! Cost       about two runs in addition to the run itself: the steps between two corrections are taken as one, for all
//!            sources together
//! Source     Brown and Hwang 2012, §5.6 (suboptimal error analysis); Maybeck 1979, §6.8 (truth model, error budget)
//!
//! ```
//! use fusion::Selection;
//! use fusion_judge::budget::{Settings, budget};
//!
//! let design = Selection::default().load("../configs/published/localisation-2d.toml")?;
//! let found = budget(&design, &Settings::default())?;
//! let shares: f64 = (0..found.sources.len()).map(|source| found.states[0].end.share(source)).sum();
//! assert!((shares - 1.0).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axes;
mod chart;
mod follower;
mod input;
mod result;
mod segment;
mod spread;
#[cfg(test)]
mod tests;
mod world;

pub use chart::svg;
pub use result::{Budget, Course, SensorRows, Split, StateBudget};

use follower::Follower;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion::provenance::Provenance;
use fusion::run::{Options, Run};
use world::{World, simulated};

/// How a budget is made.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// The seed of the nominal run, instead of the design's.
    pub seed: Option<u64>,
    /// Times at which the shares are also taken \[s\].
    pub at: Vec<f64>,
}

/// The error budget of a simulated `design`.
///
/// # Errors
/// Mistakes of the design; a design without a simulated world, with a bank of hypotheses, or with a process whose input no
/// simulated instrument measures; a time after the last estimate.
pub fn budget(design: &Design, settings: &Settings) -> Result<Budget, Diagnostics> {
    // A recorded log is not opened in vain.
    simulated(design)?;
    let options = Options {
        seed: settings.seed,
        ..Options::default()
    };
    let run = Run::open(design, &options)?;
    let mut at = settings.at.clone();
    at.sort_by(f64::total_cmp);
    let world = World::of(design, run.assembly())?;
    let mut follower = Follower::new(design, world, run.assembly(), &at);
    run.go(&mut [&mut follower], &mut |_| {})?.keep()?;
    let (sources, states, course, rows, outside) = follower.finish();
    if let Some(first) = states.first()
        && let Some(missing) = at.get(first.at.len())
    {
        let error = Diagnostic::error(format!("no shares at {missing} s: the last estimate is at {} s", first.end.time));
        return Err(error.help("ask for earlier times").into());
    }
    let budget = Budget {
        description: design.run.description.clone(),
        provenance: Provenance::of(design, settings.seed),
        sources,
        states,
        course,
        rows,
        outside,
    };
    Ok(budget.without_idle_sources())
}
