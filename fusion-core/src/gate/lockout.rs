//! The memory of a gate: denial and recovery.

use super::{Decision, GateInput, Mode};
use crate::math;
use crate::model::Literal;
use crate::model::literal::call;
use crate::time::Time;
use alloc::string::String;
use smallvec::SmallVec;

/// Residuals that must agree before a denied sensor is re-acquired.
const WITNESSES: usize = 5;

/// A pause is at least this many periods of the sensor. It equals the number of witnesses, so that they
/// span the same time as a pause that would empty them.
const PERIODS: f64 = WITNESSES as f64;

/// A sensor must have been rejected for this many times the span of its witnesses. Only then does the distance
/// that the estimate has moved give its speed: over a shorter time, scattered measurements look like a speed.
const SPANS: f64 = 6.0;

/// How far the witnesses may be from their line when the estimate runs away, as a share of the distance that it
/// runs within their span. A velocity error of constant size that turns by a right angle within the span bends
/// the line by about this share.
const BEND: f64 = 0.25;

/// When a gate denies its sensor, and when it re-acquires it.
#[derive(Clone, Copy, Debug, Literal)]
#[literal(at = "fusion_core::gate")]
pub struct Recovery {
    /// Consecutive rejections after which the sensor counts as denied.
    pub deny_after: u32,
    /// Consecutive acceptable measurements after which a denied sensor is used again.
    pub resume_after: u32,
    /// Time in denial \[s\] after which five mutually consistent measurements are accepted against
    /// the estimate; infinite: never.
    pub reacquire_after: f64,
    /// A pause of the sensor \[s\] after which consistent measurements are accepted immediately. For
    /// a slow sensor, five of its periods if they are longer.
    pub gap: f64,
    /// Minimum time \[s\] between two witnesses: five successive samples of a fast sensor are no evidence.
    pub spacing: f64,
    /// How far the witnesses may be from the straight line through them, in units of √R_ii.
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
            // Fixes of 1 Hz all count, with stamps that jitter.
            spacing: 0.8,
            agreement: 3.0 * core::f64::consts::SQRT_2,
        }
    }
}

/// The memory of a gate: tracking, denial and recovery.
///
/// Rejections never widen the gate: otherwise it would accept a sustained false track.
/// A denied sensor returns by passing the test again, or by witnesses that agree with
/// each other after a long denial or after a gap. They agree if their residuals are on a straight
/// line in time, up to their noise: a wrong estimate may also drift at a constant speed.
///
/// An estimate with a wrong attitude does not drift at a constant speed: its acceleration is wrong, and
/// turns with the vehicle. Let the residual have grown by d in the time T since the first rejection.
/// Witnesses that span the time w may then also be off their line by a quarter of d w/T. False measurements that
/// keep their distance, or that scatter, gain nothing by this rule: their d does not grow with T.
#[derive(Clone, Debug, Default)]
pub struct Lockout {
    recovery: Recovery,
    mode: Mode,
    rejected: u32,
    passed: u32,
    since: Time,
    last: Option<Time>,
    /// The latest intervals between measurements \[s\].
    intervals: SmallVec<[f64; WITNESSES]>,
    resumed: bool,
    /// Whether the latest decision was to re-acquire, and its outcome is not known yet.
    reacquiring: bool,
    /// Residuals, the latest last; up to eight rows are stored inline.
    witnesses: [SmallVec<[f64; 8]>; WITNESSES],
    times: [Time; WITNESSES],
    count: usize,
    /// The residual of the first rejection of the streak.
    first: SmallVec<[f64; 8]>,
}
crate::memory!(Lockout {
    mode, rejected, passed, since, last, intervals, resumed, reacquiring, witnesses, times, count, first;
    recovery
});

impl Literal for Lockout {
    /// Before its first measurement.
    fn expression(&self, out: &mut String) {
        call(out, "::fusion_core::gate::Lockout::new", &[&self.recovery]);
    }
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
        if self.reacquiring { Mode::Track } else { self.mode }
    }

    /// Receives whether the measurement decided on last was used. Where the filter could not re-acquire
    /// the sensor, the witnesses are kept, and the next measurement that agrees is offered at once.
    pub fn settle(&mut self, is_used: bool) {
        if core::mem::take(&mut self.reacquiring) && is_used {
            *self = Self {
                last: self.last,
                intervals: core::mem::take(&mut self.intervals),
                ..Self::new(self.recovery)
            };
        }
    }

    /// Whether the sensor has paused before a measurement at `time`. Its period is the median of its
    /// latest intervals, this one not included.
    fn has_paused(&mut self, time: Time) -> bool {
        let Some(last) = self.last.replace(time) else { return false };
        let interval = time.seconds_since(last);
        let period = math::middle(&self.intervals, f64::total_cmp).unwrap_or_default();
        if self.intervals.len() == WITNESSES {
            self.intervals.remove(0);
        }
        self.intervals.push(interval);
        interval >= self.recovery.gap && interval >= PERIODS * period
    }

    /// Turns the outcome of a test into a decision.
    pub fn decide(&mut self, passes: bool, input: &GateInput<'_>) -> Decision {
        self.decide_within(passes, input, 0.0)
    }

    /// The same, with witnesses that may differ by `floor` however small their noise.
    pub fn decide_within(&mut self, passes: bool, input: &GateInput<'_>, floor: f64) -> Decision {
        self.reacquiring = false;
        if self.has_paused(input.time) {
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
            self.first.clear();
            self.first.extend_from_slice(input.residual);
        }
        if self.mode == Mode::Track && self.rejected >= self.recovery.deny_after {
            self.mode = Mode::Denied;
        }
        let is_witness = self.remember(input);
        let waited = input.time.seconds_since(self.since) >= self.recovery.reacquire_after;
        if is_witness && (waited || self.resumed) && self.witnesses_agree(input, floor) {
            self.reacquiring = true;
            return Decision::Reacquire;
        }
        Decision::Reject
    }

    /// Takes a residual as a witness, unless the one before is too near in time.
    fn remember(&mut self, input: &GateInput<'_>) -> bool {
        if self.count > 0 && input.time.seconds_since(self.times[WITNESSES - 1]) < self.recovery.spacing {
            return false;
        }
        self.witnesses.rotate_left(1);
        let latest = &mut self.witnesses[WITNESSES - 1];
        latest.clear();
        latest.extend_from_slice(input.residual);
        self.times.rotate_left(1);
        self.times[WITNESSES - 1] = input.time;
        self.count = (self.count + 1).min(WITNESSES);
        true
    }

    fn witnesses_agree(&self, input: &GateInput<'_>, floor: f64) -> bool {
        let m = input.residual.len();
        if self.count < WITNESSES || self.witnesses.iter().any(|w| w.len() != m) {
            return false;
        }
        let mean = |values: [f64; WITNESSES]| values.iter().sum::<f64>() / WITNESSES as f64;
        let times = self.times.map(|t| t.seconds_since(input.time));
        let middle = mean(times);
        let spread = mean(times.map(|t| math::powi(t - middle, 2)));
        let agreement = self.recovery.agreement.max(self.bend(input));
        (0..m).all(|i| {
            let limit = (agreement * math::sqrt(input.noise[i * m + i])).max(floor);
            let values = core::array::from_fn(|k| self.witnesses[k][i]);
            let centre = mean(values);
            let moment = mean(core::array::from_fn(|k| (times[k] - middle) * (values[k] - centre)));
            let slope = if spread > 0.0 { moment / spread } else { 0.0 };
            let on_the_line = |(t, v): (&f64, &f64)| (v - centre - slope * (t - middle)).abs() <= limit;
            times.iter().zip(&values).all(on_the_line)
        })
    }

    /// How far the witnesses may lie from their line because the estimate runs away, in units of
    /// √R_ii.
    fn bend(&self, input: &GateInput<'_>) -> f64 {
        let m = input.residual.len();
        let span = input.time.seconds_since(self.times[0]);
        let refused = input.time.seconds_since(self.since);
        if self.first.len() != m || refused < SPANS * span {
            return 0.0;
        }
        let apart = |i: usize| math::powi(input.residual[i] - self.first[i], 2) / input.noise[i * m + i];
        let bend = BEND * math::sqrt((0..m).map(apart).sum::<f64>()) * span / refused;
        if bend.is_finite() { bend } else { 0.0 }
    }
}
