//! The start of a run.

use super::{Entry, Heard, Keyed, RunEnd, RunEvent, RunObserver, Section, SectionObserver, Shared, Summary, Wait};
use fusion_core::belief::Belief;
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};
use fusion_core::state::StateRole;
use schemars::JsonSchema;
use serde::Serialize;

/// The smallest share of the log before the start that is reported. With uniform errors, one twentieth changes an RMS
/// by 2.5 % at most.
const LATE: f64 = 0.05;
/// A wait too short to report: levelling takes about one second of any log \[s\].
const BRIEF: f64 = 2.0;

/// The start of the outermost filter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Start {
    /// When the filter started \[s\]; `None` if it never did.
    pub started: Option<f64>,
    /// The part of the log before the first start, and the causes of the wait; `None` if the filter never started.
    pub waited: Option<Wait>,
    /// The attitude or angle with the largest 1σ at the start, and this 1σ \[rad\].
    pub start_angle: Option<(String, f64)>,
    /// The inputs that the filter was still waiting for at the end.
    pub waiting: Vec<(String, String)>,
}

impl Section for Start {
    const NAME: &'static str = "start";

    fn keys(&self) -> Vec<Keyed<'_>> {
        vec![
            ("started", &self.started),
            ("waited", &self.waited),
            ("start_angle", &self.start_angle),
            ("waiting", &self.waiting),
        ]
    }
}

impl Summary {
    /// The start of the filter.
    #[must_use]
    pub fn start(&self) -> &Start {
        static NONE: Start = Start {
            started: None,
            waited: None,
            start_angle: None,
            waiting: Vec::new(),
        };
        self.get().unwrap_or(&NONE)
    }

    /// The wait for the start, if it takes so large a share of the log that the figures do not describe the whole log.
    #[must_use]
    pub fn late_start(&self) -> Option<&Wait> {
        let waited = self.start().waited.as_ref();
        waited.filter(|wait| wait.share() > LATE && wait.seconds > BRIEF)
    }
}

/// Observes the starts of the outermost filter; the last one counts.
#[derive(Clone, Debug, Default)]
pub struct Starts {
    started: Option<f64>,
    start_angle: Option<(String, f64)>,
}

fusion_core::memory!(Starts { started, start_angle });

impl RunObserver for Starts {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Filter {
            filter,
            event: Event::Started { belief, .. },
        } = event
            && filter.is_outermost()
        {
            self.started = Some(belief.time.seconds());
            self.start_angle = least_known(filter, belief);
        }
        Ok(())
    }
}

impl SectionObserver for Starts {
    fn share(&self, shared: &mut Shared) {
        shared.started = self.started;
    }

    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt> {
        let runner = &end.assembly.runner;
        let start = Start {
            started: self.started,
            waited: end.waited.clone(),
            start_angle: self.start_angle,
            waiting: if runner.started() { Vec::new() } else { runner.waits_for() },
        };
        Ok(start.into())
    }
}

/// The attitude or angle with the largest 1σ.
fn least_known(filter: &Heard, belief: &Belief) -> Option<(String, f64)> {
    let angles = filter
        .layout
        .blocks()
        .iter()
        // The pose of a ship is unknown until its own sensor measures it; that sensor then measures all of it at once.
        .filter(|b| b.role != StateRole::Nuisance)
        .filter(|b| b.kind.is_orientation() || b.unit == "rad");
    let known = angles.map(|b| (b.name.clone(), belief.covariance.sigmas(b).fold(0.0, f64::max)));
    known.max_by(|a, b| a.1.total_cmp(&b.1))
}
