//! Gates: whether a measurement may touch the estimate.
//!
//! A gate is a policy with a memory. It sees the whitened, unweighted residual, answers with its
//! statistic, notices when it has been rejecting for long, and says how it recovers. A rejected
//! measurement is an outcome, never an error.

use crate::consistency::chi_square_quantile;
use crate::time::Time;
use core::fmt::Debug;

/// What a gate judges by. Matrices are m×m, row by row.
#[derive(Clone, Copy, Debug)]
pub struct GateInput<'a> {
    /// Time of validity.
    pub time: Time,
    /// r = z ⊟ h(x̂).
    pub residual: &'a [f64],
    /// HPHᵀ: the estimate's own covariance seen through the sensor.
    pub predicted: &'a [f64],
    /// R.
    pub noise: &'a [f64],
    /// S = HPHᵀ + R.
    pub innovation: &'a [f64],
    /// rᵀS⁻¹r.
    pub nis: f64,
}

/// What a gate decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Use it.
    Accept,
    /// Leave the estimate alone.
    Reject,
    /// Believe the sensor again: P first grows by rrᵀ + R as the sensor sees it, then update.
    Readopt,
}

/// Whether a gate trusts its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Mode {
    /// The sensor is followed.
    #[default]
    Track,
    /// The gate has been rejecting: interference, or an estimate gone wrong.
    Denied,
}

/// A gate's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// The decision.
    pub decision: Decision,
    /// The statistic it was based on.
    pub statistic: f64,
    /// What the statistic was compared with.
    pub threshold: f64,
    /// The gate's mode after the decision.
    pub mode: Mode,
}

/// A gate policy.
pub trait Gate: Debug + Send {
    /// Judges one measurement.
    fn judge(&mut self, input: &GateInput<'_>) -> Answer;

    /// Copies the gate with its memory, for snapshots.
    fn boxed_clone(&self) -> Box<dyn Gate>;
}

/// Accepts everything and still reports the NIS.
#[derive(Clone, Copy, Debug, Default)]
pub struct Open;

impl Gate for Open {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        Answer { decision: Decision::Accept, statistic: input.nis, threshold: f64::INFINITY, mode: Mode::Track }
    }

    fn boxed_clone(&self) -> Box<dyn Gate> {
        Box::new(*self)
    }
}

/// Numbers of the largest residual the gates remember.
const MAX_DIM: usize = 8;
/// Residuals that must agree before a denied sensor is believed again.
const WITNESSES: usize = 5;

/// When a gate that rejects goes into denial, and how it comes out.
#[derive(Clone, Copy, Debug)]
pub struct Recovery {
    /// Consecutive rejections after which the sensor counts as denied.
    pub deny_after: u32,
    /// Consecutive acceptable measurements that bring a denied sensor back.
    pub resume_after: u32,
    /// Time in denial [s] after which [`WITNESSES`] mutually consistent measurements are
    /// believed against the estimate; infinite never.
    pub readopt_after: f64,
    /// A pause of the sensor [s] after which consistent measurements are believed at once.
    pub gap: f64,
    /// How far the witnesses may differ from their mean, in units of √R_ii.
    pub agreement: f64,
}

impl Default for Recovery {
    fn default() -> Self {
        // 3√2 σ: three sigma of the difference of two fixes.
        Self { deny_after: 5, resume_after: 3, readopt_after: 30.0, gap: 10.0, agreement: 3.0 * core::f64::consts::SQRT_2 }
    }
}

/// The memory of a gate: TRACK, DENIED, and the way back.
///
/// The gate is never widened because it has been rejecting: a sustained false track would then
/// be believed. A denied sensor returns by passing the test again, or by witnesses that agree
/// with each other after a long denial or after a gap.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lockout {
    recovery: Recovery,
    mode: Mode,
    rejected: u32,
    passed: u32,
    since: Time,
    last: Option<Time>,
    resumed: bool,
    witnesses: [[f64; MAX_DIM]; WITNESSES],
    count: usize,
}

impl Lockout {
    /// A gate memory in TRACK.
    #[must_use]
    pub fn new(recovery: Recovery) -> Self {
        Self { recovery, ..Self::default() }
    }

    /// The mode now.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Turns the outcome of a test into a decision.
    pub fn decide(&mut self, passes: bool, input: &GateInput<'_>) -> Decision {
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
        self.remember(input.residual);
        let waited = input.time.seconds_since(self.since) >= self.recovery.readopt_after;
        if (waited || self.resumed) && self.witnesses_agree(input) {
            *self = Self { last: self.last, ..Self::new(self.recovery) };
            return Decision::Readopt;
        }
        Decision::Reject
    }

    fn remember(&mut self, residual: &[f64]) {
        self.witnesses.rotate_left(1);
        for (slot, r) in self.witnesses[WITNESSES - 1].iter_mut().zip(residual) {
            *slot = *r;
        }
        self.count = (self.count + 1).min(WITNESSES);
    }

    fn witnesses_agree(&self, input: &GateInput<'_>) -> bool {
        let m = input.residual.len();
        if self.count < WITNESSES || m > MAX_DIM {
            return false;
        }
        (0..m).all(|i| {
            let limit = self.recovery.agreement * input.noise[i * m + i].sqrt();
            let mean = self.witnesses.iter().map(|w| w[i]).sum::<f64>() / WITNESSES as f64;
            self.witnesses.iter().all(|w| (w[i] - mean).abs() <= limit)
        })
    }
}

/// Normalised innovation squared against a χ² quantile.
#[derive(Clone, Copy, Debug)]
pub struct Nis {
    thresholds: [f64; MAX_DIM + 1],
    lockout: Lockout,
}

impl Nis {
    /// Passes what a consistent filter would see with `probability`.
    #[must_use]
    pub fn new(probability: f64, recovery: Recovery) -> Self {
        let thresholds = core::array::from_fn(|m| chi_square_quantile(probability, m as f64));
        Self { thresholds, lockout: Lockout::new(recovery) }
    }
}

impl Gate for Nis {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        let threshold = self.thresholds[input.residual.len().min(MAX_DIM)];
        let decision = self.lockout.decide(input.nis <= threshold, input);
        Answer { decision, statistic: input.nis, threshold, mode: self.lockout.mode() }
    }

    fn boxed_clone(&self) -> Box<dyn Gate> {
        Box::new(*self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_gate;

    #[test]
    fn every_gate_obeys_the_laws_of_gates() {
        let gates: [Box<dyn Gate>; 2] = [Box::new(Open), Box::new(Nis::new(0.99, Recovery::default()))];
        for gate in gates {
            check_gate(gate.as_ref()).unwrap_or_else(|e| panic!("{gate:?}: {e}"));
        }
    }

    #[test]
    fn the_law_sees_a_gate_that_locks_out() {
        let never = Recovery { readopt_after: f64::INFINITY, gap: f64::INFINITY, ..Recovery::default() };
        assert!(check_gate(&Nis::new(0.99, never)).unwrap_err().contains("locked out"));
    }

    #[test]
    fn the_law_sees_a_gate_that_believes_what_contradicts_itself() {
        let credulous = Recovery { agreement: f64::INFINITY, ..Recovery::default() };
        assert!(check_gate(&Nis::new(0.99, credulous)).unwrap_err().contains("contradictory"));
    }

    fn judge(gate: &mut Nis, time: f64, residual: f64) -> Answer {
        let nis = residual * residual / 2.0;
        let time = Time::from_seconds(time);
        gate.judge(&GateInput { time, residual: &[residual], predicted: &[1.0], noise: &[1.0], innovation: &[2.0], nis })
    }

    #[test]
    fn thresholds_are_the_chi_square_quantiles() {
        let mut gate = Nis::new(0.99, Recovery::default());
        assert!((judge(&mut gate, 0.0, 0.0).threshold - 6.635).abs() < 6e-4); // printed to three decimals
    }

    #[test]
    fn five_rejections_deny_and_three_passes_resume() {
        let mut gate = Nis::new(0.99, Recovery::default());
        let modes: Vec<_> = (0..5).map(|k| judge(&mut gate, f64::from(k), 100.0 * f64::from(k % 2 * 2 - 1)).mode).collect();
        assert_eq!(modes, [Mode::Track, Mode::Track, Mode::Track, Mode::Track, Mode::Denied]);
        let decisions: Vec<_> = (5..8).map(|k| judge(&mut gate, f64::from(k), 0.0).decision).collect();
        assert_eq!(decisions, [Decision::Reject, Decision::Reject, Decision::Accept]);
    }

    #[test]
    fn five_agreeing_fixes_are_believed_after_thirty_seconds_of_denial_or_at_once_after_a_gap() {
        let mut gate = Nis::new(0.99, Recovery::default());
        let first = (0..100).find(|&k| judge(&mut gate, f64::from(k), 50.0).decision == Decision::Readopt);
        assert_eq!(first, Some(30));
        let mut gate = Nis::new(0.99, Recovery::default());
        judge(&mut gate, 0.0, 0.0);
        let first = (0..100).find(|&k| judge(&mut gate, 20.0 + f64::from(k), 50.0).decision == Decision::Readopt);
        assert_eq!(first, Some(4));
    }
}
