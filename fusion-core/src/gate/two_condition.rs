//! The two-condition test for position fixes.
//!
//! C1  the fix is outside the confidence ellipse of the *estimate*: eᵀP_h⁻¹e > γ
//! C2  it is also far away: |e| > max(3√2 σ, d_min)
//! A fix is an outlier if both hold. C1 alone discards good fixes as soon as the estimate is
//! better than the sensor; C2 alone discards good fixes after an outage. e is the residual's horizontal part,
//! P_h the horizontal part of HPHᵀ, γ a χ² quantile with two degrees of freedom.
//!
//! Height is judged separately, by the same two conditions with its own P_dd, its own σ and a
//! quantile with one degree of freedom. A fix is also an outlier if its height is an outlier. A test of
//! all three axes together would weigh a height against the horizontal σ.
//! Source  after Ko et al. 2016; the formulas are a reconstruction, height is not in it

use super::{Answer, Decision, Gate, GateInput, Lockout, Recovery};
use crate::consistency::chi_square_quantile;
use crate::math;
use crate::model::Literal;
use crate::time::Time;
use core::f64::consts::SQRT_2;

/// How C1 measures a residual against the estimate.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq)]
#[literal(at = "fusion_core::gate")]
pub enum Ellipse {
    /// Against the covariance of the estimate, HPHᵀ.
    #[default]
    Estimate,
    /// Against the covariance of the innovation, HPHᵀ + R.
    Innovation,
    /// Per axis: any |e_i| > k √(HPHᵀ)_ii, k being the square root of γ.
    PerAxis,
}

/// How C2 decides that a fix is far away.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq)]
#[literal(at = "fusion_core::gate")]
pub enum Magnitude {
    /// By the distance from the estimate.
    #[default]
    Distance,
    /// By the step since the latest used fix, minus the estimate's own step:
    /// |e − e₋| > v Δt + 3√2 σ. Both residuals are taken before their updates.
    Step {
        /// The speed v \[m/s\] by which fix and estimate may move apart.
        speed: f64,
    },
    /// By the 1σ that the receiver itself reports: √(R_nn + R_ee) above this \[m\].
    Reported {
        /// The largest good 1σ \[m\].
        limit: f64,
    },
    /// By the quality number in the row, e.g. HDOP: above this limit, or missing.
    Quality {
        /// The largest good number.
        limit: f64,
    },
}

/// The parameters of the two conditions.
#[derive(Clone, Copy, Debug, Literal)]
#[literal(at = "fusion_core::gate")]
pub struct TwoConditions {
    /// C1: the probability of the ellipse.
    pub probability: f64,
    /// C1: which covariance the ellipse belongs to.
    pub ellipse: Ellipse,
    /// C2: the criterion for far away.
    pub magnitude: Magnitude,
    /// 1σ of a good fix per horizontal axis \[m\]; if `None`, the 1σ of R.
    pub sigma: Option<f64>,
    /// 1σ of a good height \[m\]; if `None`, the 1σ of R.
    pub vertical_sigma: Option<f64>,
    /// A fix nearer than this is never far away \[m\].
    pub least: f64,
    /// Whether a third row, down, is judged as well.
    pub height: bool,
}

impl Default for TwoConditions {
    fn default() -> Self {
        Self {
            probability: 0.99,
            ellipse: Ellipse::Estimate,
            magnitude: Magnitude::Distance,
            sigma: None,
            vertical_sigma: None,
            least: 3.0,
            height: true,
        }
    }
}

/// The test, with the memory that prevents a lockout.
#[derive(Clone, Debug, Literal)]
#[literal(at = "fusion_core::gate")]
pub struct TwoCondition {
    conditions: TwoConditions,
    /// Quantiles of two and of one degree of freedom.
    gamma: f64,
    gamma_down: f64,
    lockout: Lockout,
    /// The latest fix that was used: its time, its residual \[m\] north, east, down.
    used: Option<(Time, [f64; 3])>,
    /// The latest fix, whose outcome is not known yet.
    offered: (Time, [f64; 3]),
}
crate::memory!(TwoCondition { lockout, used, offered; conditions, gamma, gamma_down });

/// A part of a fix that is judged separately: the horizontal part, or height.
#[derive(Clone, Copy, Debug)]
struct Part {
    /// C1: its statistic, and the quantile that is its threshold.
    statistic: f64,
    gamma: f64,
    /// Its size and its step since the latest fix that was used \[m\].
    size: f64,
    step: f64,
    /// 3√2 σ, but at least the least \[m\].
    limit: f64,
}

impl TwoCondition {
    /// The gate.
    #[must_use]
    pub fn new(conditions: TwoConditions, recovery: Recovery) -> Self {
        Self {
            conditions,
            gamma: chi_square_quantile(conditions.probability, 2.0),
            gamma_down: chi_square_quantile(conditions.probability, 1.0),
            lockout: Lockout::new(recovery),
            used: None,
            offered: (Time::default(), [0.0; 3]),
        }
    }

    /// The covariance that C1 is about.
    fn covariance<'a>(&self, input: &GateInput<'a>) -> &'a [f64] {
        if self.conditions.ellipse == Ellipse::Innovation {
            input.innovation
        } else {
            input.predicted
        }
    }

    fn judges_height(&self, input: &GateInput<'_>) -> bool {
        self.conditions.height && input.residual.len() >= 3
    }

    /// 3√2 `sigma`, but at least the least.
    fn limit(&self, sigma: f64) -> f64 {
        (3.0 * SQRT_2 * sigma).max(self.conditions.least)
    }

    fn horizontal_limit(&self, input: &GateInput<'_>) -> f64 {
        let [nn, _, ee] = horizontal_block(input.noise, input.residual.len());
        self.limit(self.conditions.sigma.unwrap_or_else(|| math::sqrt(0.5 * (nn + ee))))
    }

    fn vertical_limit(&self, input: &GateInput<'_>) -> f64 {
        let m = input.residual.len();
        self.limit(self.conditions.vertical_sigma.unwrap_or_else(|| math::sqrt(input.noise[2 * m + 2])))
    }

    fn horizontal(&self, input: &GateInput<'_>) -> Part {
        let [n, e, _] = axes(input);
        let [nn, ne, ee] = horizontal_block(self.covariance(input), input.residual.len());
        let statistic = if self.conditions.ellipse == Ellipse::PerAxis {
            larger(n * n / nn, e * e / ee)
        } else {
            // The inverse of a 2×2 matrix, written out.
            (ee * n * n - 2.0 * ne * n * e + nn * e * e) / (nn * ee - ne * ne)
        };
        let [pn, pe, _] = self.used.map_or([f64::NAN; 3], |(_, residual)| residual);
        Part {
            statistic,
            gamma: self.gamma,
            size: math::hypot(n, e),
            step: math::hypot(n - pn, e - pe),
            limit: self.horizontal_limit(input),
        }
    }

    fn vertical(&self, input: &GateInput<'_>) -> Part {
        let (m, d) = (input.residual.len(), input.residual[2]);
        let before = self.used.map_or(f64::NAN, |(_, residual)| residual[2]);
        Part {
            statistic: d * d / self.covariance(input)[2 * m + 2],
            gamma: self.gamma_down,
            size: d.abs(),
            step: (d - before).abs(),
            limit: self.vertical_limit(input),
        }
    }

    /// C2.
    fn is_far(&self, part: &Part, input: &GateInput<'_>) -> bool {
        match self.conditions.magnitude {
            Magnitude::Distance => exceeds(part.size, part.limit),
            Magnitude::Step { .. } => self.drift(input).is_some_and(|drift| exceeds(part.step, drift + part.limit)),
            Magnitude::Reported { .. } | Magnitude::Quality { .. } => self.is_poor(input),
        }
    }

    /// How far fix and estimate may have moved apart since the latest used fix; `None` before the first.
    fn drift(&self, input: &GateInput<'_>) -> Option<f64> {
        let Magnitude::Step { speed } = self.conditions.magnitude else {
            return Some(0.0);
        };
        self.used.map(|(time, _)| speed * input.time.seconds_since(time))
    }

    /// Whether the fix itself reports that it is poor.
    fn is_poor(&self, input: &GateInput<'_>) -> bool {
        match self.conditions.magnitude {
            Magnitude::Reported { limit } => {
                let [nn, _, ee] = horizontal_block(input.noise, input.residual.len());
                exceeds(math::sqrt(nn + ee), limit)
            }
            Magnitude::Quality { limit } => input.quality.is_none_or(|quality| exceeds(quality, limit)),
            Magnitude::Distance | Magnitude::Step { .. } => false,
        }
    }

    /// The smallest error of one axis that both conditions refuse: C1 from `inside` on, C2 beyond
    /// `limit`.
    fn smallest(&self, inside: f64, limit: f64, input: &GateInput<'_>) -> f64 {
        match self.conditions.magnitude {
            Magnitude::Distance | Magnitude::Step { .. } => self.drift(input).map_or(f64::INFINITY, |drift| inside.max(drift + limit)),
            Magnitude::Reported { .. } | Magnitude::Quality { .. } if self.is_poor(input) => inside,
            Magnitude::Reported { .. } | Magnitude::Quality { .. } => f64::INFINITY,
        }
    }
}

/// Whether `value` is above `limit`; NaN counts as above.
fn exceeds(value: f64, limit: f64) -> bool {
    value > limit || value.is_nan()
}

/// Not `f64::max`, which would lose a NaN.
fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

/// North, east and down of the residual; rows that it lacks are zero.
fn axes(input: &GateInput<'_>) -> [f64; 3] {
    core::array::from_fn(|i| input.residual.get(i).copied().unwrap_or(0.0))
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
        let level = self.horizontal(input);
        let is_outlier = |part: &Part| exceeds(part.statistic, part.gamma) && self.is_far(part, input);
        let (mut outlier, mut statistic) = (is_outlier(&level), level.statistic);
        if self.judges_height(input) {
            let height = self.vertical(input);
            outlier |= is_outlier(&height);
            // Against the same threshold.
            statistic = larger(statistic, height.statistic * level.gamma / height.gamma);
        }
        let decision = self.lockout.decide_within(!outlier, input, level.limit);
        // A sensor that is re-acquired agrees with the estimate from then on.
        let residual = if decision == Decision::Reacquire { [0.0; 3] } else { axes(input) };
        self.offered = (input.time, residual);
        Answer {
            decision,
            statistic,
            threshold: level.gamma,
            mode: self.lockout.mode(),
        }
    }

    fn settle(&mut self, is_used: bool) {
        self.lockout.settle(is_used);
        if is_used {
            self.used = Some(self.offered);
        }
    }

    fn power(&self, input: &GateInput<'_>, smallest: &mut [f64]) {
        smallest.fill(f64::INFINITY);
        let (p, m) = (self.covariance(input), input.residual.len());
        let [nn, ne, ee] = horizontal_block(p, m);
        let limit = self.horizontal_limit(input);
        // By C1 alone: e² (P_h⁻¹)_ii = γ.
        let correlated = if self.conditions.ellipse == Ellipse::PerAxis {
            0.0
        } else {
            ne * ne
        };
        let inside = [nn - correlated / ee, ee - correlated / nn].map(|v| math::sqrt(self.gamma * v));
        for (smallest, inside) in smallest.iter_mut().zip(inside) {
            *smallest = self.smallest(inside, limit, input);
        }
        if self.judges_height(input) {
            let inside = math::sqrt(self.gamma_down * p[2 * m + 2]);
            smallest[2] = self.smallest(inside, self.vertical_limit(input), input);
        }
    }

    crate::literal!();
}

#[cfg(test)]
mod tests {
    use super::super::{Decision, Mode};
    use super::*;
    use crate::time::Time;

    fn gate() -> TwoCondition {
        with(Magnitude::Distance)
    }

    fn with(magnitude: Magnitude) -> TwoCondition {
        let conditions = TwoConditions {
            sigma: Some(1.28),
            magnitude,
            ..TwoConditions::default()
        };
        TwoCondition::new(conditions, Recovery::default())
    }

    /// A fix at `time` that is `n`, `e` metres off an estimate of variance `p` \[m²\].
    fn fix(gate: &mut TwoCondition, time: f64, n: f64, e: f64, p: f64) -> (Decision, Mode) {
        let answer = offer(gate, time, [n, e, 0.0], p, None);
        (answer.decision, answer.mode)
    }

    /// The gate's answer to a residual \[m\] against an estimate of variance `p`. The measurement is used if accepted.
    fn offer(gate: &mut TwoCondition, time: f64, residual: [f64; 3], p: f64, quality: Option<f64>) -> Answer {
        leaning(gate, time, residual, (p, 0.0), quality)
    }

    /// The same against variances `p` whose errors north and east have the covariance `ne`.
    fn leaning(gate: &mut TwoCondition, time: f64, residual: [f64; 3], (p, ne): (f64, f64), quality: Option<f64>) -> Answer {
        let squares = residual.map(|r| r * r);
        let input = GateInput {
            time: Time::from_seconds(time),
            residual: &residual,
            predicted: &[p, ne, 0.0, ne, p, 0.0, 0.0, 0.0, p],
            noise: &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0],
            innovation: &[p + 1.0, ne, 0.0, ne, p + 1.0, 0.0, 0.0, 0.0, p + 2.0],
            nis: (squares[0] + squares[1]) / (p + 1.0) + squares[2] / (p + 2.0),
            unit_nis: &[1.0 / (p + 1.0), 1.0 / (p + 1.0), 1.0 / (p + 2.0)],
            quality,
            others: &[],
        };
        let answer = gate.judge(&input);
        gate.settle(answer.decision != Decision::Reject);
        answer
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
        let step = || with(Magnitude::Step { speed: 1.0 });
        let mut g = step();
        fix(&mut g, 0.0, 0.0, 0.0, 0.3);
        assert_eq!(fix(&mut g, 1.0, 12.0, 0.0, 0.3).0, Decision::Reject);
        let mut g = step();
        let drift: Vec<_> = (0..10).map(|k| fix(&mut g, f64::from(k), 2.0 * f64::from(k), 0.0, 0.3).0).collect();
        assert_eq!(drift, [Decision::Accept; 10]);
    }

    #[test]
    fn a_step_is_measured_from_the_latest_fix_that_was_used() {
        let mut g = with(Magnitude::Step { speed: 1.0 });
        fix(&mut g, 0.0, 0.0, 0.0, 0.3);
        // A second wrong fix near the first one is no step from it, but it is still wrong.
        for k in 1..9 {
            assert_eq!(fix(&mut g, f64::from(k), 60.0, 0.0, 0.3).0, Decision::Reject, "{k}");
        }
    }

    #[test]
    fn a_wrong_height_is_an_outlier_by_its_own_sigma_and_one_degree_of_freedom() {
        let decide = |g: &mut TwoCondition, down: f64, p: f64| offer(g, 0.0, [0.0, 0.0, down], p, None).decision;
        assert_eq!(decide(&mut gate(), 100.0, 0.32), Decision::Reject);
        // C2 at 3√2·√2 = 6 m; C1 at √(6.635 P): 6.18 m with P = 5.75, where two degrees of freedom
        // would give 7.28 m.
        assert_eq!(decide(&mut gate(), 6.1, 0.32), Decision::Reject);
        assert_eq!(decide(&mut gate(), 5.9, 0.32), Decision::Accept);
        assert_eq!(decide(&mut gate(), 6.3, 5.75), Decision::Reject);
        assert_eq!(decide(&mut gate(), 6.1, 5.75), Decision::Accept);
        let level = TwoConditions {
            height: false,
            ..TwoConditions::default()
        };
        assert_eq!(
            decide(&mut TwoCondition::new(level, Recovery::default()), 100.0, 0.32),
            Decision::Accept
        );
    }

    #[test]
    fn the_ellipse_has_two_degrees_of_freedom() {
        // γ = 9.210 at P = 4 m² is 6.07 m, beyond C2; three degrees of freedom would give 6.74 m.
        assert_eq!(fix(&mut gate(), 0.0, 6.06, 0.0, 4.0).0, Decision::Accept);
        assert_eq!(fix(&mut gate(), 0.0, 6.08, 0.0, 4.0).0, Decision::Reject);
        let answer = offer(&mut gate(), 0.0, [6.0, 0.0, 0.0], 4.0, None);
        assert!((answer.threshold - 9.210).abs() < 6e-4); // printed to three decimals
        assert!((answer.statistic - 9.0).abs() < 1e-12); // rounding
    }

    #[test]
    fn the_ellipse_leans_as_the_errors_of_the_estimate_do() {
        let decide = |n: f64, e: f64| leaning(&mut gate(), 0.0, [n, e, 0.0], (4.0, 3.6), None).decision;
        // Along the north-east P is 7.6 m², and γ = 9.210 is 5.916 m per axis; across it is 0.4 m². All of
        // them are beyond the 5.43 m of C2.
        assert_eq!(decide(5.9, 5.9), Decision::Accept);
        assert_eq!(decide(6.0, 6.0), Decision::Reject);
        assert_eq!(decide(4.0, -4.0), Decision::Reject);
    }

    #[test]
    fn a_fix_outside_the_ellipse_is_an_outlier_where_it_reports_a_larger_sigma_than_is_good() {
        let decide = |north: f64, limit: f64| offer(&mut with(Magnitude::Reported { limit }), 0.0, [north, 0.0, 0.0], 0.32, None).decision;
        // It reports √2 m, and lies outside at 1.72 m.
        assert_eq!(decide(3.0, 1.4), Decision::Reject);
        assert_eq!(decide(3.0, 1.5), Decision::Accept);
        assert_eq!(decide(1.7, 1.4), Decision::Accept);
    }

    #[test]
    fn a_fix_of_poor_quality_outside_the_ellipse_is_an_outlier_and_so_is_one_that_says_nothing() {
        let decide = |north: f64, quality| offer(&mut with(Magnitude::Quality { limit: 4.0 }), 0.0, [north, 0.0, 0.0], 0.32, quality);
        let outside = 3.0; // 1.72 m is the edge
        for (quality, wanted) in [
            (Some(1.2), Decision::Accept),
            (Some(9.0), Decision::Reject),
            (Some(f64::NAN), Decision::Reject),
            (None, Decision::Reject),
        ] {
            assert_eq!(decide(outside, quality).decision, wanted, "{quality:?}");
            assert_eq!(decide(1.0, quality).decision, Decision::Accept, "{quality:?}");
        }
    }

    #[test]
    fn every_variant_obeys_the_laws_of_gates() {
        for ellipse in [Ellipse::Estimate, Ellipse::Innovation, Ellipse::PerAxis] {
            for magnitude in [
                Magnitude::Distance,
                Magnitude::Step { speed: 1.0 },
                Magnitude::Quality { limit: 4.0 },
            ] {
                let conditions = TwoConditions {
                    ellipse,
                    magnitude,
                    ..TwoConditions::default()
                };
                let make = || Box::new(TwoCondition::new(conditions, Recovery::default())) as Box<dyn crate::gate::Gate>;
                crate::testing::check_gate(&make).unwrap_or_else(|e| panic!("{ellipse:?} {magnitude:?}: {e}"));
            }
        }
    }
}
