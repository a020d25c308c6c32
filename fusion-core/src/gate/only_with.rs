//! A measurement is used only with that of another sensor.

use super::{Answer, Decision, Gate, GateInput, Odds, Outcome};
use crate::model::Literal;
use crate::model::literal::{Boxed, call};
use alloc::boxed::Box;
use alloc::string::String;

/// Rejects a measurement where the latest one of another sensor was not used; otherwise the
/// sensor's own gate judges it.
///
/// While it rejects, the own gate is not called, so that its memory does not count measurements
/// that may be good. The answer then holds the NIS, an infinite threshold and the mode of the
/// other's gate.
#[derive(Debug)]
pub struct OnlyWith {
    leader: usize,
    memory: f64,
    own: Box<dyn Gate>,
    /// Whether the own gate judged the latest measurement.
    is_asked: bool,
}
crate::memory!(OnlyWith { own, is_asked; leader, memory });

impl OnlyWith {
    /// A follower of sensor number `leader`, whose outcome counts for `memory` seconds; otherwise
    /// `own` judges.
    #[must_use]
    pub fn new(leader: usize, memory: f64, own: Box<dyn Gate>) -> Self {
        Self {
            leader,
            memory,
            own,
            is_asked: false,
        }
    }

    /// The leader's outcome where it counts and was a refusal.
    fn refused(&self, input: &GateInput<'_>) -> Option<Outcome> {
        let latest = input.others.get(self.leader).copied().flatten();
        let is_recent = |time| input.time.seconds_since(time) < self.memory;
        latest.filter(|outcome| !outcome.is_used && is_recent(outcome.time))
    }
}

impl Literal for OnlyWith {
    /// Before its first measurement.
    fn expression(&self, out: &mut String) {
        if let Some(own) = self.own.literal() {
            call(
                out,
                "::fusion_core::gate::OnlyWith::new",
                &[&self.leader, &self.memory, &Boxed(own)],
            );
        }
    }
}

impl Gate for OnlyWith {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        let refused = self.refused(input);
        self.is_asked = refused.is_none();
        match refused {
            Some(outcome) => Answer {
                decision: Decision::Reject,
                statistic: input.nis,
                threshold: f64::INFINITY,
                mode: outcome.mode,
            },
            None => self.own.judge(input),
        }
    }

    fn odds(&self, input: &GateInput<'_>) -> Option<Odds> {
        self.refused(input).is_none().then(|| self.own.odds(input)).flatten()
    }

    fn settle(&mut self, is_used: bool) {
        if self.is_asked {
            self.own.settle(is_used);
        }
    }

    fn power(&self, input: &GateInput<'_>, smallest: &mut [f64]) {
        self.own.power(input, smallest);
    }

    fn leader(&self) -> Option<usize> {
        Some(self.leader)
    }

    crate::literal!(own);
}
