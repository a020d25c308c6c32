//! The memory of a gate: denial and recovery.

use super::{Decision, GateInput, Mode};
use crate::time::Time;
use smallvec::SmallVec;

/// Residuals that must agree before a denied sensor is re-acquired.
const WITNESSES: usize = 5;

/// When a gate denies its sensor, and when it re-acquires it.
#[derive(Clone, Copy, Debug)]
pub struct Recovery {
    /// Consecutive rejections after which the sensor counts as denied.
    pub deny_after: u32,
    /// Consecutive acceptable measurements after which a denied sensor is used again.
    pub resume_after: u32,
    /// Time in denial \[s\] after which five mutually consistent measurements are accepted against
    /// the estimate; infinite: never.
    pub reacquire_after: f64,
    /// A pause of the sensor \[s\] after which consistent measurements are accepted immediately.
    pub gap: f64,
    /// How far the witnesses may lie from the straight line through them, in units of √R_ii.
    pub agreement: f64,
}

impl Default for Recovery {
    fn default() -> Self {
        // 3√2 σ: three sigma of the difference of two fixes.
        Self {
            deny_after: 5,
            resume_after: 3,
            reacquire_after: 30.0,
            gap: 10.0,
            agreement: 3.0 * core::f64::consts::SQRT_2,
        }
    }
}

/// The memory of a gate: tracking, denial and recovery.
///
/// The gate is never widened because it has been rejecting: a sustained false track would then be
/// believed. A denied sensor returns by passing the test again, or by witnesses that agree with
/// each other after a long denial or after a gap. They agree if their residuals lie on a straight
/// line in time: a wrong estimate may also drift at a constant speed.
#[derive(Clone, Debug, Default)]
pub struct Lockout {
    recovery: Recovery,
    mode: Mode,
    rejected: u32,
    passed: u32,
    since: Time,
    last: Option<Time>,
    resumed: bool,
    /// Residuals, the latest last; up to eight rows they need no memory of their own.
    witnesses: [SmallVec<[f64; 8]>; WITNESSES],
    times: [Time; WITNESSES],
    count: usize,
}

impl Lockout {
    /// A gate memory in TRACK.
    #[must_use]
    pub fn new(recovery: Recovery) -> Self {
        Self {
            recovery,
            ..Self::default()
        }
    }

    /// The mode now.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Turns the outcome of a test into a decision.
    pub fn decide(&mut self, passes: bool, input: &GateInput<'_>) -> Decision {
        self.decide_within(passes, input, 0.0)
    }

    /// The same, with witnesses that may differ by `floor` however small their noise.
    pub fn decide_within(&mut self, passes: bool, input: &GateInput<'_>, floor: f64) -> Decision {
        let pause = self.last.map_or(0.0, |last| input.time.seconds_since(last));
        self.last = Some(input.time);
        if pause >= self.recovery.gap {
            self.resumed = true;
            self.count = 0;
        }
        if passes {
            self.passed += 1;
            self.rejected = 0;
            self.count = 0;
            if self.mode == Mode::Denied {
                if self.passed < self.recovery.resume_after {
                    return Decision::Reject;
                }
                self.mode = Mode::Track;
            }
            self.resumed = false;
            return Decision::Accept;
        }
        self.passed = 0;
        self.rejected += 1;
        if self.rejected == 1 {
            self.since = input.time;
        }
        if self.mode == Mode::Track && self.rejected >= self.recovery.deny_after {
            self.mode = Mode::Denied;
        }
        self.remember(input);
        let waited = input.time.seconds_since(self.since) >= self.recovery.reacquire_after;
        if (waited || self.resumed) && self.witnesses_agree(input, floor) {
            *self = Self {
                last: self.last,
                ..Self::new(self.recovery)
            };
            return Decision::Reacquire;
        }
        Decision::Reject
    }

    fn remember(&mut self, input: &GateInput<'_>) {
        self.witnesses.rotate_left(1);
        let latest = &mut self.witnesses[WITNESSES - 1];
        latest.clear();
        latest.extend_from_slice(input.residual);
        self.times.rotate_left(1);
        self.times[WITNESSES - 1] = input.time;
        self.count = (self.count + 1).min(WITNESSES);
    }

    fn witnesses_agree(&self, input: &GateInput<'_>, floor: f64) -> bool {
        let m = input.residual.len();
        if self.count < WITNESSES || self.witnesses.iter().any(|w| w.len() != m) {
            return false;
        }
        let mean = |values: [f64; WITNESSES]| values.iter().sum::<f64>() / WITNESSES as f64;
        let times = self.times.map(|t| t.seconds_since(input.time));
        let middle = mean(times);
        let spread = mean(times.map(|t| (t - middle).powi(2)));
        (0..m).all(|i| {
            let limit = (self.recovery.agreement * input.noise[i * m + i].sqrt()).max(floor);
            let values = core::array::from_fn(|k| self.witnesses[k][i]);
            let centre = mean(values);
            let moment = mean(core::array::from_fn(|k| (times[k] - middle) * (values[k] - centre)));
            let slope = if spread > 0.0 { moment / spread } else { 0.0 };
            let on_the_line = |(t, v): (&f64, &f64)| (v - centre - slope * (t - middle)).abs() <= limit;
            times.iter().zip(&values).all(on_the_line)
        })
    }
}
