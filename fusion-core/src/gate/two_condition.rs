//! The two-condition test for position fixes.
//!
//! C1  the fix lies outside the confidence ellipse of the *estimate*: eᵀP_h⁻¹e > γ
//! C2  it is also far away: |e| > max(3√2 σ, d_min)
//! A fix is an outlier where both hold. C1 alone discards good fixes as soon as the estimate is
//! better than the sensor; C2 alone discards good fixes after an outage. e is the horizontal part
//! of the residual, P_h that of HPHᵀ.
//! Source  after Ko et al. 2016; the formulas are a reconstruction

use super::{Answer, Gate, GateInput, Lockout, Recovery};
use crate::consistency::chi_square_quantile;
use core::f64::consts::SQRT_2;

/// How C1 measures a residual against the estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Ellipse {
    /// Against the covariance of the estimate, HPHᵀ.
    #[default]
    Estimate,
    /// Against that of the innovation, HPHᵀ + R.
    Innovation,
    /// Per axis: any |e_i| > k √(HPHᵀ)_ii, k being the square root of γ.
    PerAxis,
}

/// How C2 tells that a fix is far away.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Magnitude {
    /// By the horizontal distance from the estimate.
    #[default]
    Distance,
    /// By the step since the fix before, less the estimate's own: |e − e₋| > v Δt + 3√2 σ.
    Step {
        /// The speed v \[m/s\] by which fix and estimate may move apart.
        speed: f64,
    },
    /// By the 1σ that the receiver itself reports: √(R_nn + R_ee) above this \[m\].
    Reported {
        /// The largest good 1σ \[m\].
        limit: f64,
    },
}

/// The test, with the memory that keeps it from locking out.
#[derive(Clone, Debug)]
pub struct TwoCondition {
    gamma: f64,
    ellipse: Ellipse,
    magnitude: Magnitude,
    sigma: Option<f64>,
    least: f64,
    lockout: Lockout,
    before: Option<(crate::time::Time, [f64; 2])>,
}

impl TwoCondition {
    /// C1 at `probability` of χ² with two degrees of freedom, C2 at 3√2 σ but at least `least` \[m\].
    /// Without `sigma` \[m\] it is that of R.
    #[must_use]
    pub fn new(probability: f64, ellipse: Ellipse, magnitude: Magnitude, sigma: Option<f64>, least: f64, recovery: Recovery) -> Self {
        let gamma = chi_square_quantile(probability, 2.0);
        Self {
            gamma,
            ellipse,
            magnitude,
            sigma,
            least,
            lockout: Lockout::new(recovery),
            before: None,
        }
    }

    /// C1: the statistic, to be held against γ.
    fn distance_squared(&self, input: &GateInput<'_>) -> f64 {
        let (n, e) = horizontal(input);
        let p = if self.ellipse == Ellipse::Innovation {
            input.innovation
        } else {
            input.predicted
        };
        let [nn, ne, ee] = horizontal_block(p, input.residual.len());
        if self.ellipse == Ellipse::PerAxis {
            // Not `f64::max`, which would lose what is no number.
            let (north, east) = (n * n / nn, e * e / ee);
            return if north > east || north.is_nan() { north } else { east };
        }
        // The inverse of a 2×2 matrix, written out.
        (ee * n * n - 2.0 * ne * n * e + nn * e * e) / (nn * ee - ne * ne)
    }

    /// 3√2 σ, but at least `least`.
    fn limit(&self, input: &GateInput<'_>) -> f64 {
        let [nn, _, ee] = horizontal_block(input.noise, input.residual.len());
        (3.0 * SQRT_2 * self.sigma.unwrap_or_else(|| (0.5 * (nn + ee)).sqrt())).max(self.least)
    }

    fn is_far(&self, input: &GateInput<'_>, limit: f64) -> bool {
        let (n, e) = horizontal(input);
        match self.magnitude {
            Magnitude::Distance => exceeds(n.hypot(e), limit),
            Magnitude::Step { speed } => self
                .before
                .is_some_and(|(time, [pn, pe])| exceeds((n - pn).hypot(e - pe), speed * input.time.seconds_since(time) + limit)),
            Magnitude::Reported { limit } => {
                let [nn, _, ee] = horizontal_block(input.noise, input.residual.len());
                (nn + ee).sqrt() > limit
            }
        }
    }
}

/// Whether `value` is above `limit`; what is no number is.
fn exceeds(value: f64, limit: f64) -> bool {
    value > limit || value.is_nan()
}

/// The first two rows of the residual; a single row stands alone.
fn horizontal(input: &GateInput<'_>) -> (f64, f64) {
    (input.residual[0], input.residual.get(1).copied().unwrap_or(0.0))
}

/// The elements nn, ne, ee of an m×m matrix; a single row is paired with an independent unit.
fn horizontal_block(matrix: &[f64], m: usize) -> [f64; 3] {
    if m < 2 {
        [matrix[0], 0.0, 1.0]
    } else {
        [matrix[0], matrix[1], matrix[m + 1]]
    }
}

impl Gate for TwoCondition {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        let limit = self.limit(input);
        let statistic = self.distance_squared(input);
        let outlier = exceeds(statistic, self.gamma) && self.is_far(input, limit);
        let decision = self.lockout.decide_within(!outlier, input, limit);
        self.before = Some((input.time, horizontal(input).into()));
        Answer {
            decision,
            statistic,
            threshold: self.gamma,
            mode: self.lockout.mode(),
        }
    }

    fn boxed_clone(&self) -> Box<dyn Gate> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Decision, Mode};
    use super::*;
    use crate::time::Time;

    fn gate() -> TwoCondition {
        TwoCondition::new(0.99, Ellipse::Estimate, Magnitude::Distance, Some(1.28), 3.0, Recovery::default())
    }

    /// A fix at `time` that is `n`, `e` metres off an estimate of variance `p` \[m²\].
    fn fix(gate: &mut TwoCondition, time: f64, n: f64, e: f64, p: f64) -> (Decision, Mode) {
        let input = GateInput {
            time: Time::from_seconds(time),
            residual: &[n, e, 0.0],
            predicted: &[p, 0.0, 0.0, 0.0, p, 0.0, 0.0, 0.0, p],
            noise: &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0],
            innovation: &[p + 1.0, 0.0, 0.0, 0.0, p + 1.0, 0.0, 0.0, 0.0, p + 2.0],
            nis: (n * n + e * e) / (p + 1.0),
            others: &[],
        };
        let answer = gate.judge(&input);
        (answer.decision, answer.mode)
    }

    #[test]
    fn both_conditions_together_make_an_outlier() {
        // C1 at γ = 9.21: 1.72 m with P = 0.32 m²; C2 at 3√2·1.28 = 5.43 m.
        assert_eq!(
            fix(&mut gate(), 0.0, 3.0, 0.0, 0.32).0,
            Decision::Accept,
            "outside the ellipse, but near"
        );
        assert_eq!(
            fix(&mut gate(), 0.0, 20.0, 0.0, 100.0).0,
            Decision::Accept,
            "far, but the estimate is poor"
        );
        assert_eq!(fix(&mut gate(), 0.0, 5.5, 0.0, 0.32).0, Decision::Reject);
        assert_eq!(fix(&mut gate(), 0.0, 5.4, 0.0, 0.32).0, Decision::Accept);
    }

    #[test]
    fn a_spike_denies_and_three_good_fixes_resume() {
        let mut g = gate();
        for k in 0..8 {
            assert_eq!(fix(&mut g, f64::from(k), 60.0, 0.0, 0.5).0, Decision::Reject, "{k}");
        }
        assert_eq!(fix(&mut g, 8.0, 0.5, 0.0, 1.0), (Decision::Reject, Mode::Denied));
        assert_eq!(fix(&mut g, 9.0, 0.5, 0.0, 1.0).0, Decision::Reject);
        assert_eq!(fix(&mut g, 10.0, 0.5, 0.0, 1.0), (Decision::Accept, Mode::Track));
    }

    #[test]
    fn a_gap_lets_five_fixes_that_agree_be_believed() {
        let mut g = gate();
        fix(&mut g, 0.0, 0.0, 0.0, 0.3);
        let decisions: Vec<_> = (0..5)
            .map(|k| fix(&mut g, 60.0 + f64::from(k), 25.0 + 0.3 * f64::from(k), 0.0, 0.5).0)
            .collect();
        assert_eq!(decisions[..4], [Decision::Reject; 4]);
        assert_eq!(decisions[4], Decision::Reacquire);
    }

    #[test]
    fn a_constant_disagreement_is_believed_after_thirty_seconds_and_not_before() {
        let mut g = gate();
        fix(&mut g, 0.0, 0.0, 0.0, 0.3);
        let first = (1..60).find(|k| fix(&mut g, f64::from(*k), 30.0, 1.0, 0.5).0 == Decision::Reacquire);
        assert_eq!(first, Some(31));
    }

    #[test]
    fn an_estimate_that_runs_away_is_told_from_fixes_that_scatter() {
        let reacquired = |off: fn(i32) -> f64| {
            let mut g = gate();
            fix(&mut g, 0.0, 0.0, 0.0, 0.3);
            (1..60).find(|&k| fix(&mut g, f64::from(k), off(k), 1.0, 0.5).0 == Decision::Reacquire)
        };
        // 10 m/s of velocity error, fixes good to 1 m.
        assert_eq!(reacquired(|k| 20.0 + 10.0 * f64::from(k) + f64::from(k % 3 - 1)), Some(31));
        // 3√2 σ is 4.2 m; every other fix 20 m to the other side.
        assert_eq!(reacquired(|k| 40.0 + f64::from(20 * (k % 2))), None);
    }

    #[test]
    fn a_jump_is_a_step_and_a_drift_is_none() {
        let step = || {
            TwoCondition::new(
                0.99,
                Ellipse::Estimate,
                Magnitude::Step { speed: 1.0 },
                Some(1.28),
                3.0,
                Recovery::default(),
            )
        };
        let mut g = step();
        fix(&mut g, 0.0, 0.0, 0.0, 0.3);
        assert_eq!(fix(&mut g, 1.0, 12.0, 0.0, 0.3).0, Decision::Reject);
        let mut g = step();
        let drift: Vec<_> = (0..10).map(|k| fix(&mut g, f64::from(k), 2.0 * f64::from(k), 0.0, 0.3).0).collect();
        assert_eq!(drift, [Decision::Accept; 10]);
    }

    #[test]
    fn every_variant_obeys_the_laws_of_gates() {
        for ellipse in [Ellipse::Estimate, Ellipse::Innovation, Ellipse::PerAxis] {
            let g = TwoCondition::new(0.99, ellipse, Magnitude::Distance, None, 3.0, Recovery::default());
            crate::testing::check_gate(&g).unwrap_or_else(|e| panic!("{ellipse:?}: {e}"));
        }
    }
}
