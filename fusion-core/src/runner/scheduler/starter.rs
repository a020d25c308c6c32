//! The start of the filter: when it runs, and from which belief.
//!
//! ```text
//!            the initialisers are ready            a gap has lost the attitude
//! Starting ──────────────────────────────▶ Running ──────────────────────────▶ Aligning
//!    ▲                                      │   ▲                               │    │
//!    └────── gap too long, lost, silent ────┘   └─── the attitude is found ─────┘    │
//!    └───────────────────────────────────────────────────────────────────────────────┘
//! ```

use super::calibration::Calibration;
use super::realign::{LOST, agree, is_same};
use super::restart::Restart;
use crate::belief::Belief;
use crate::covariance::Form;
use crate::health::State;
use crate::memory::{Memory, Tape, recall, save};
use crate::model::Input;
use crate::runner::consumer::{Consumer, Refused};
use crate::runner::rows::Stored;
use crate::runner::{Discard, InitialiserUnit};
use crate::state::{ALIGNED, Layout};
use crate::time::Time;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Whether the filter runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// The initialisers look for the first belief.
    Starting,
    /// The filter runs, and the initialisers rest.
    Running,
    /// The filter runs, and the initialisers look for its attitude.
    Aligning,
}

/// The knowledge of the initialisers about the attitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Alignment {
    /// They have not found it.
    Sought,
    /// It agrees with that of the filter.
    Agrees,
    /// It replaces that of the filter: the attitude of [`Starter::trial`].
    Replaces,
}

/// The initialisers, and what the filter keeps for another start.
#[derive(Debug)]
pub(super) struct Starter {
    units: Vec<InitialiserUnit>,
    /// The memory of the initialisers when they were added, for another start.
    pristine: Vec<u8>,
    phase: Phase,
    /// When the filter started.
    start: Time,
    /// The calibration before the filter stopped.
    last: Option<Calibration>,
    restart: Restart,
    /// Lent to the initialisers that look for the attitude.
    trial: Option<Belief>,
    value: Vec<f64>,
}

impl Default for Starter {
    fn default() -> Self {
        Self {
            units: Vec::new(),
            pristine: Vec::new(),
            phase: Phase::Starting,
            start: Time::MIN,
            last: None,
            restart: Restart::default(),
            trial: None,
            value: Vec::new(),
        }
    }
}

impl Starter {
    /// Its memory, without that of the health.
    pub(super) fn remember(&mut self, layout: &Layout, tape: &mut Tape<'_>) {
        let (mut is_running, mut is_aligning) = (self.is_running(), self.phase == Phase::Aligning);
        is_running.remember(tape);
        is_aligning.remember(tape);
        self.phase = match (is_running, is_aligning) {
            (false, _) => Phase::Starting,
            (true, false) => Phase::Running,
            (true, true) => Phase::Aligning,
        };
        self.start.remember(tape);
        // A running filter does not need the initialisers; before another start they begin anew.
        if self.takes_rows() {
            self.units.iter_mut().for_each(|unit| unit.initialiser.remember(tape));
        }
        let mut is_some = self.last.is_some();
        is_some.remember(tape);
        if is_some {
            self.last.get_or_insert_with(|| Calibration::of(layout)).remember(tape);
        } else {
            self.last = None;
        }
    }

    /// Its memory of the health.
    pub(super) fn remember_health(&mut self, tape: &mut Tape<'_>) {
        self.restart.remember(tape);
    }

    /// Adds an initialiser; without any, the filter starts at its first row.
    pub(super) fn add(&mut self, mut unit: InitialiserUnit) {
        save(&mut unit.initialiser, &mut self.pristine);
        // The buffer is empty: room for the first row.
        let widest = unit.inputs.iter().map(|port| port.columns.len()).max();
        self.value.reserve(widest.unwrap_or_default());
        self.units.push(unit);
    }

    pub(super) fn units(&self) -> &[InitialiserUnit] {
        &self.units
    }

    /// A filter that has been lost for `seconds` gives up.
    pub(super) fn restart_lost(&mut self, seconds: f64, layout: &Layout) {
        self.restart.declare(seconds, layout);
    }

    pub(super) fn is_running(&self) -> bool {
        self.phase != Phase::Starting
    }

    /// Whether the initialisers take rows.
    pub(super) fn takes_rows(&self) -> bool {
        self.phase != Phase::Running
    }

    /// When the filter started last.
    pub(super) const fn start_time(&self) -> Time {
        self.start
    }

    /// Shows an initialiser a row of its `input`.
    ///
    /// # Errors
    /// A number is not finite.
    pub(super) fn row(&mut self, (unit, input): (usize, usize), time: Time, row: &Stored) -> Result<(), Refused> {
        let u = &mut self.units[unit];
        u.inputs[input].gather(row.values(), &mut self.value);
        if !self.value.iter().all(|v| v.is_finite()) {
            return Err(Refused {
                consumer: Consumer::Initialiser(unit, input),
                time,
                row: row.id(&u.inputs[input].columns),
                why: Discard::NotFinite,
            });
        }
        u.initialiser.row(input, time, &self.value);
        Ok(())
    }

    /// Whether every initialiser can write its part of the first belief.
    pub(super) fn is_ready(&self) -> bool {
        !self.is_running() && self.units.iter().all(|u| u.initialiser.waits_for().is_none())
    }

    /// The first belief, at `time`, with the calibration that is known. `latest` is the latest row of the input. `None`
    /// if the initialisers have written something else than a belief; the calibration is then forgotten.
    pub(super) fn first_belief(&mut self, layout: &Layout, form: &Arc<dyn Form>, time: Time, latest: Option<&[f64]>) -> Option<Belief> {
        let mut belief = Belief::initial(layout, form, time);
        if let Some(last) = self.last.take() {
            last.give(layout, &mut belief);
        }
        if let Some(latest) = latest {
            belief.input.take(&Input::held(latest));
        }
        for u in &self.units {
            u.initialiser.write(time, layout, &mut belief);
        }
        (layout.is_sane(&belief.x) && belief.is_sound()).then_some(belief)
    }

    /// The filter starts at `time`.
    pub(super) const fn start(&mut self, time: Time) {
        self.phase = Phase::Running;
        self.start = time;
    }

    /// The filter stops, and its initialisers begin anew. The next start keeps the calibration of `last`.
    pub(super) fn stop(&mut self, layout: &Layout, last: &Belief) {
        let mut calibration = Calibration::of(layout);
        calibration.take(layout, last);
        self.begin_again(Some(calibration));
    }

    /// The filter gives up. The next start keeps the calibration of the last good health.
    pub(super) fn give_up(&mut self) {
        let last = self.restart.take();
        self.begin_again(last);
    }

    fn begin_again(&mut self, last: Option<Calibration>) {
        self.phase = Phase::Starting;
        self.last = last;
        self.begin_anew();
    }

    /// The initialisers forget everything.
    fn begin_anew(&mut self) {
        let mut all = Initialisers(&mut self.units);
        // The initialisers wrote these bytes when they were added.
        let _ = recall(&mut all, &self.pristine);
    }

    /// Whether a filter that runs may give up at all, so that its health has to be followed.
    pub(super) fn follows_health(&self) -> bool {
        self.restart.is_declared() && self.is_running()
    }

    /// Follows the health of a filter that runs. Returns since when it has been lost, if it is to give up.
    pub(super) fn follow_health(&mut self, state: State, layout: &Layout, belief: &Belief) -> Option<Time> {
        let can_start = !self.units.is_empty() && self.units.iter().all(|u| !u.inputs.is_empty());
        self.restart.follow(state, layout, belief).filter(|_| can_start)
    }

    /// If the attitude of a running filter is not aligned any more, has the initialisers look for it.
    pub(super) fn watch_attitude(&mut self, layout: &Layout, belief: &Belief) {
        let can_align = self.units.iter().any(|u| !u.inputs.is_empty());
        if self.phase == Phase::Running && can_align && !belief.is_aligned(layout, LOST) {
            self.begin_anew();
            self.phase = Phase::Aligning;
        }
    }

    /// Compares the attitude of the initialisers with that of `belief`. Once they have found it, they rest.
    pub(super) fn align(&mut self, layout: &Layout, belief: &Belief, time: Time) -> Alignment {
        let trial = self.trial.get_or_insert_with(|| belief.clone());
        trial.time = belief.time;
        trial.x.copy_from_slice(&belief.x);
        trial.covariance.copy_from(&belief.covariance);
        let units = self.units.iter().filter(|u| !u.inputs.is_empty());
        let ready = units.filter(|u| u.initialiser.waits_for().is_none());
        ready.for_each(|u| u.initialiser.write(time, layout, trial));
        let is_written = layout.orientations().any(|block| !is_same(block, belief, trial));
        if !(is_written && trial.is_aligned(layout, LOST) && layout.is_sane(&trial.x)) {
            return Alignment::Sought;
        }
        self.phase = Phase::Running;
        let is_known = belief.is_aligned(layout, ALIGNED) && layout.orientations().all(|block| agree(block, belief, trial));
        if is_known { Alignment::Agrees } else { Alignment::Replaces }
    }

    /// The belief with the attitude that was found last.
    pub(super) const fn trial(&self) -> Option<&Belief> {
        self.trial.as_ref()
    }
}

/// The memory of several initialisers.
struct Initialisers<'a>(&'a mut [InitialiserUnit]);

impl Memory for Initialisers<'_> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.iter_mut().for_each(|unit| unit.initialiser.remember(tape));
    }
}
