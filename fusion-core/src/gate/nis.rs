//! The classical gate.

use super::{Answer, Gate, GateInput, Lockout, Recovery};
use crate::consistency::chi_square_quantile;
use crate::math;
use crate::model::Literal;
use alloc::vec::Vec;

/// Normalised innovation squared against a χ² quantile.
#[derive(Clone, Debug, Literal)]
#[literal(at = "fusion_core::gate")]
pub struct Nis {
    probability: f64,
    /// By the number of rows; extended when a residual with more rows arrives.
    thresholds: Vec<f64>,
    lockout: Lockout,
}
crate::memory!(Nis { lockout; probability, thresholds });

impl Nis {
    /// A gate that passes the residuals of a consistent filter with this `probability`.
    #[must_use]
    pub fn new(probability: f64, recovery: Recovery) -> Self {
        let mut gate = Self {
            probability,
            thresholds: Vec::new(),
            lockout: Lockout::new(recovery),
        };
        gate.threshold(8);
        gate
    }

    /// The quantile for `rows`.
    fn threshold(&mut self, rows: usize) -> f64 {
        for m in self.thresholds.len()..=rows {
            self.thresholds.push(chi_square_quantile(self.probability, m as f64));
        }
        self.thresholds[rows]
    }
}

impl Gate for Nis {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        let threshold = self.threshold(input.residual.len());
        let decision = self.lockout.decide(input.nis <= threshold, input);
        Answer {
            decision,
            statistic: input.nis,
            threshold,
            mode: self.lockout.mode(),
        }
    }

    fn settle(&mut self, is_used: bool) {
        self.lockout.settle(is_used);
    }

    fn power(&self, input: &GateInput<'_>, smallest: &mut [f64]) {
        let m = input.residual.len();
        let quantile = || chi_square_quantile(self.probability, m as f64);
        let threshold = self.thresholds.get(m).copied().unwrap_or_else(quantile);
        for (smallest, unit) in smallest.iter_mut().zip(input.unit_nis) {
            *smallest = math::sqrt(threshold / unit);
        }
    }

    crate::literal!();
}

#[cfg(test)]
mod tests {
    use super::super::{Decision, Mode, Open};
    use super::*;
    use crate::testing::check_gate;
    use crate::time::Time;

    #[test]
    fn every_gate_obeys_the_laws_of_gates() {
        check_gate(&|| Box::new(Open)).unwrap_or_else(|e| panic!("open: {e}"));
        check_gate(&|| Box::new(Nis::new(0.99, Recovery::default()))).unwrap_or_else(|e| panic!("nis: {e}"));
    }

    #[test]
    fn the_law_sees_a_gate_that_locks_out() {
        let never = Recovery {
            reacquire_after: f64::INFINITY,
            gap: f64::INFINITY,
            ..Recovery::default()
        };
        assert!(check_gate(&|| Box::new(Nis::new(0.99, never))).unwrap_err().contains("locked out"));
    }

    #[test]
    fn the_law_sees_a_gate_that_believes_what_contradicts_itself() {
        let credulous = Recovery {
            agreement: f64::INFINITY,
            ..Recovery::default()
        };
        assert!(
            check_gate(&|| Box::new(Nis::new(0.99, credulous)))
                .unwrap_err()
                .contains("contradictory")
        );
    }

    fn judge(gate: &mut Nis, time: f64, residual: f64) -> Answer {
        let nis = residual * residual / 2.0;
        let time = Time::from_seconds(time);
        gate.judge(&GateInput {
            time,
            residual: &[residual],
            predicted: &[1.0],
            noise: &[1.0],
            innovation: &[2.0],
            nis,
            unit_nis: &[0.5],
            quality: None,
            others: &[],
        })
    }

    #[test]
    fn thresholds_are_the_chi_square_quantiles() {
        let mut gate = Nis::new(0.99, Recovery::default());
        assert!((judge(&mut gate, 0.0, 0.0).threshold - 6.635).abs() < 6e-4); // printed to three decimals
    }

    #[test]
    fn five_rejections_deny_and_three_passes_resume() {
        let mut gate = Nis::new(0.99, Recovery::default());
        let modes: Vec<_> = (0..5)
            .map(|k| judge(&mut gate, f64::from(k), 100.0 * f64::from(k % 2 * 2 - 1)).mode)
            .collect();
        assert_eq!(modes, [Mode::Track, Mode::Track, Mode::Track, Mode::Track, Mode::Denied]);
        let decisions: Vec<_> = (5..8).map(|k| judge(&mut gate, f64::from(k), 0.0).decision).collect();
        assert_eq!(decisions, [Decision::Reject, Decision::Reject, Decision::Accept]);
    }

    #[test]
    fn five_agreeing_fixes_are_believed_after_thirty_seconds_of_denial_or_at_once_after_a_gap() {
        let mut gate = Nis::new(0.99, Recovery::default());
        let first = (0..100).find(|&k| judge(&mut gate, f64::from(k), 50.0).decision == Decision::Reacquire);
        assert_eq!(first, Some(30));
        let mut gate = Nis::new(0.99, Recovery::default());
        judge(&mut gate, 0.0, 0.0);
        let first = (0..100).find(|&k| judge(&mut gate, 20.0 + f64::from(k), 50.0).decision == Decision::Reacquire);
        assert_eq!(first, Some(4));
    }

    /// The first time [s] at which a 5 Hz sensor with R = 1, refused from the beginning, is re-acquired.
    fn reacquired(residual: impl Fn(f64) -> f64) -> Option<f64> {
        let mut gate = Nis::new(0.99, Recovery::default());
        (0..1000)
            .map(|k| 0.2 * f64::from(k))
            .find(|&t| judge(&mut gate, t, residual(t)).decision == Decision::Reacquire)
    }

    #[test]
    fn an_estimate_that_runs_away_with_a_wrong_attitude_does_not_lock_out_good_fixes() {
        // Its velocity is wrong by 20 m/s, in a direction that turns back and forth: five fixes lie up
        // to 9 m off a straight line of residuals, and never all within 4.4 m.
        let believed = reacquired(|t| 50.0 + 20.0 * t + 9.5 * (1.5 * t).sin());
        assert!(believed.is_some_and(|t| (30.0..32.0).contains(&t)), "{believed:?}");
        // Measurements that keep their distance but are as far off a line, or that scatter over the whole
        // distance, are not accepted.
        assert_eq!(reacquired(|t| 50.0 + 9.5 * (1.5 * t).sin()), None);
        let mut random = crate::testing::Lcg::new(1);
        let scattered: Vec<f64> = (0..1000).map(|_| 100.0 * random.signed()).collect();
        assert_eq!(reacquired(|t| 300.0 + scattered[(5.0 * t).round() as usize]), None);
        // A false track that moves away steadily is not accepted more easily: its noise counts.
        assert_eq!(reacquired(|t| 10.0 + t + 9.5 * (1.5 * t).sin()), None);
    }
}
