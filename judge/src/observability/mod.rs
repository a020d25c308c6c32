//! Which states a motion determines, and which part of the motion does so.
//!
//! ```text
//! run ─ steps (Φ, Q, H, R) ─▶ parts of a second ─▶ at most 16 segments ─▶ σ left of each state; effect of a segment
//!                          └▶ stacked matrix ───────────────────────────▶ exact rank
//! ```
//!
//! Each part of the log is an [`Element`]: the errors that it carries on, the noise that it adds, and the information of
//! its measurements. Elements are joined as the log goes on, so memory does not grow with it. The run is not disturbed:
//! its estimates are where everything is linearised.
//!
//! *Information* is in units of the initial σ: a direction with information 1 has half of its initial variance left.
//! The practical rank counts directions above that, with the process noise in them. The exact rank counts every singular
//! value of the [stacked matrix](Stacked) above rounding, without process noise, as the theory of observability does.
//!
//! A segment is *left out* by forgetting: none of its data exist, the motion starts again after it with the initial σ,
//! and only parameters continue. Leaving out its measurements alone would credit the segment after a turn, whose
//! measurements show what the turn has separated.
//!
//! Not here   states without an initial σ; filters inside stages; errors of the models

mod element;
mod motion;
mod recorder;
mod result;
mod sensors;
mod stacked;

pub(crate) use element::apply;
pub use element::{Change, Element};
pub use result::{Cause, DECISIVE, Direction, MotionKind, Observability, Segment, SensorUse, State, Without};
pub use stacked::Stacked;

use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion::run::{Options, Progress, Run};
use recorder::Recorder;
use sensors::{Sensor, numbers};

/// The observability of `design` along its data, or its simulated world. For each list of sensors in `without`, also
/// the σ without them: their updates are left out of the information, and the run is the same.
///
/// # Errors
/// Mistakes of the design or its data; a sensor that does not exist; a filter that never started, or that has no
/// covariance.
pub fn observability(
    design: &Design,
    options: &Options,
    without: &[Vec<String>],
    progress: &mut dyn FnMut(Progress),
) -> Result<Observability, Diagnostics> {
    let run = Run::open(design, options)?;
    let sensors: Vec<Sensor> = run.assembly().sensors.iter().map(|info| Sensor::of(info, design)).collect();
    let left_out = without.iter().map(|names| numbers(&sensors, names));
    let left_out = left_out.collect::<Result<_, Diagnostic>>()?;
    let mut recorder = Recorder::new(sensors.len(), left_out);
    run.go(&mut [&mut recorder], progress)?;
    recorder.finish().map_err(|why| Diagnostic::error(why.to_string()))?;
    let found = Observability::of(&mut recorder, &sensors, without);
    let found = found.ok_or_else(|| {
        Diagnostic::error("the filter never started: there is no motion to judge").help("`fusion run` says what it waits for")
    })?;
    if found.singular_values.iter().all(|s| *s == 0.0) {
        let none = Diagnostic::error("no measurement was linearised: there is no information to judge");
        return Err(none
            .help("a backend without a covariance has no Jacobians; `fusion run` shows which rows were used")
            .into());
    }
    Ok(found)
}
