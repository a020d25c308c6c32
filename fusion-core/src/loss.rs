//! Robust losses: how much an accepted residual still counts.
//!
//! A loss sees the norm of the whitened residual, |S^{-1/2} r| = √NIS, *after* the gate has judged
//! it unweighted, and returns a weight w in (0, 1]; the update then runs with R/w.
//!
//! The constants of Huber and Cauchy are known for one row, where they leave 95 % of the efficiency
//! of least squares. The norm of m rows is larger: |r|² is χ² of m degrees of freedom. A constant k
//! then becomes the norm k(m) that the same share of good residuals stays below,
//!
//! ```text
//! P(χ²_m ≤ k(m)²) = P(χ²_1 ≤ k²)
//! ```
//!
//! so that as many good measurements keep their weight; the efficiency is 95 % or more for every m.
//! The k that makes it 95 % exactly does not serve: from ten rows on it is zero, because the
//! direction of a residual alone is as efficient, and every good measurement would lose its weight,
//! which a filter, other than a mean, takes for noise.

use crate::Printed;
use crate::consistency::chi_square_quantile;
use crate::math;
use crate::model::Literal;
use crate::printed::role;
use core::fmt::Debug;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A robust loss.
pub trait Loss: Printed + Send + Sync {
    /// Weight in (0, 1] for a whitened residual of that norm and dimension.
    fn weight(&self, norm: f64, dim: usize) -> f64;

    /// The loss as a Rust expression, by [`literal!`](crate::literal!); `None` if it cannot write itself.
    fn literal(&self) -> Option<&dyn Literal> {
        None
    }
}

role!(Loss);

/// w = 1: least squares.
#[derive(Clone, Copy, Debug, Default, Literal)]
pub struct Quadratic;

impl Loss for Quadratic {
    fn weight(&self, _: f64, _: usize) -> f64 {
        1.0
    }

    crate::literal!();
}

/// Rows for which the constants are computed beforehand.
const USUAL_ROWS: usize = 8;

/// A constant for residuals of any number of rows.
#[derive(Clone, Copy, Debug, Literal)]
#[doc(hidden)]
pub struct Constant {
    of_one_row: f64,
    /// By rows less one.
    of_rows: [f64; USUAL_ROWS],
}

impl Constant {
    fn new(of_one_row: f64) -> Self {
        Self {
            of_one_row,
            of_rows: core::array::from_fn(|i| norm_of_rows(of_one_row, i + 1)),
        }
    }

    fn of(&self, rows: usize) -> f64 {
        let usual = rows.checked_sub(1).and_then(|i| self.of_rows.get(i));
        usual.copied().unwrap_or_else(|| norm_of_rows(self.of_one_row, rows))
    }
}

/// The norm that as large a share of good residuals of `rows` rows stays below as of one row below
/// `k`; k itself at least, where the share is 1 to rounding.
fn norm_of_rows(k: f64, rows: usize) -> f64 {
    if rows <= 1 {
        return k;
    }
    let share = ChiSquared::new(1.0).map_or(1.0, |one| one.cdf(k * k));
    math::sqrt(chi_square_quantile(share, rows as f64)).max(k)
}

/// Huber: w = min(1, k/|r|). Source: Huber 1964; k = 1.345 gives 95 % efficiency of one row.
#[derive(Clone, Copy, Debug, Literal)]
pub struct Huber(Constant);

impl Huber {
    /// Linear from `k` standard deviations of a residual of one row, and from as rare a norm of more.
    #[must_use]
    pub fn new(k: f64) -> Self {
        Self(Constant::new(k))
    }
}

impl Loss for Huber {
    fn weight(&self, norm: f64, dim: usize) -> f64 {
        let k = self.0.of(dim);
        if norm <= k { 1.0 } else { k / norm }
    }

    crate::literal!();
}

/// Cauchy: w = 1/(1 + (|r|/c)²); c = 2.385 gives 95 % efficiency of one row.
#[derive(Clone, Copy, Debug, Literal)]
pub struct Cauchy(Constant);

impl Cauchy {
    /// Half weight at `c` standard deviations of a residual of one row, and at as rare a norm of more.
    #[must_use]
    pub fn new(c: f64) -> Self {
        Self(Constant::new(c))
    }
}

impl Loss for Cauchy {
    fn weight(&self, norm: f64, dim: usize) -> f64 {
        1.0 / (1.0 + math::powi(norm / self.0.of(dim), 2))
    }

    crate::literal!();
}

/// Student-t with ν degrees of freedom: w = (ν + m)/(ν + |r|²), at most 1.
/// Source: the E-step of Lange, Little, Taylor 1989.
#[derive(Clone, Copy, Debug, Literal)]
pub struct StudentT {
    /// Degrees of freedom; about 4 for moderate tails.
    pub nu: f64,
}

impl Loss for StudentT {
    fn weight(&self, norm: f64, dim: usize) -> f64 {
        ((self.nu + dim as f64) / (self.nu + norm * norm)).min(1.0)
    }

    crate::literal!();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_loss;

    #[test]
    fn every_loss_obeys_the_laws_of_losses() {
        let losses: [&dyn Loss; 4] = [&Quadratic, &Huber::new(1.345), &Cauchy::new(2.385), &StudentT { nu: 4.0 }];
        for loss in losses {
            check_loss(loss).unwrap_or_else(|e| panic!("{loss:?}: {e}"));
        }
    }

    #[test]
    fn weights_match_their_formulas() {
        assert_eq!(Huber::new(1.5).weight(3.0, 1), 0.5);
        assert_eq!(Cauchy::new(2.0).weight(2.0, 1), 0.5);
        assert_eq!(StudentT { nu: 4.0 }.weight(4.0, 2), 0.3);
    }

    #[test]
    fn the_constant_of_two_rows_is_that_of_rayleigh_and_of_any_number_keeps_the_share() {
        // Two rows: P(|r| ≤ k) = 1 − exp(−k²/2). P(χ²_1 ≤ 1.345²) = erf(1.345/√2) = 0.821375.
        let wanted = (-2.0 * (1.0 - 0.821_375_f64).ln()).sqrt();
        assert!((norm_of_rows(1.345, 2) - wanted).abs() < 1e-5, "{wanted}"); // six digits of erf
        for m in [3, 8, 9, 20] {
            let k = norm_of_rows(1.345, m);
            // The Wilson-Hilferty quantile, good to a percent here: z = 0.9206 of the share.
            let h = 2.0 / (9.0 * m as f64);
            let approximate = (m as f64).sqrt() * (1.0 - h + 0.9206 * h.sqrt()).powf(1.5);
            assert!((k / approximate - 1.0).abs() < 0.01, "{m}: {k} {approximate}");
            assert_eq!(Huber::new(1.345).weight(k, m), 1.0);
            assert!((Cauchy::new(1.345).weight(k, m) - 0.5).abs() < 1e-15); // rounding
        }
    }

    /// Efficiency of the location estimated from residuals of `m` rows, whose norm has a χ
    /// distribution: A²/B with A = E[w + w′|r|/m] and B = E[w²|r|²]/m, by the trapezoidal rule.
    fn efficiency(loss: &dyn Loss, m: usize) -> f64 {
        let (step, dim) = (1e-3, m as f64);
        let (mut total, mut a, mut b) = (0.0, 0.0, 0.0);
        for i in 1..20_000 {
            let r = f64::from(i) * step;
            let density = ((dim - 1.0) * r.ln() - 0.5 * r * r).exp();
            let (w, above) = (loss.weight(r, m), loss.weight(r + 0.5 * step, m));
            let slope = (above - loss.weight(r - 0.5 * step, m)) / step;
            total += density;
            a += density * (w + slope * r / dim);
            b += density * (w * r).powi(2) / dim;
        }
        (a / total).powi(2) / (b / total)
    }

    #[test]
    fn the_usual_constants_leave_95_percent_of_the_efficiency_of_one_row_and_no_less_of_more() {
        let losses: [&dyn Loss; 2] = [&Huber::new(1.345), &Cauchy::new(2.385)];
        for loss in losses {
            // 2e-3: the first half step of the integral, where a single row is densest.
            assert!((efficiency(loss, 1) - 0.95).abs() < 2e-3, "{loss:?} {}", efficiency(loss, 1));
            for m in 2..=20 {
                let found = efficiency(loss, m);
                assert!((0.95..1.0).contains(&found), "{loss:?} of {m} rows: {found}");
            }
        }
    }

    #[test]
    fn the_law_sees_a_weight_that_grows_and_one_that_vanishes() {
        #[derive(Debug)]
        struct Wrong(fn(f64) -> f64);
        impl Loss for Wrong {
            fn weight(&self, norm: f64, _: usize) -> f64 {
                (self.0)(norm)
            }
        }
        assert!(
            check_loss(&Wrong(|r| if r > 5.0 { 0.0 } else { 1.0 }))
                .unwrap_err()
                .contains("outside")
        );
        assert!(
            check_loss(&Wrong(|r| if r > 5.0 { 1.0 } else { 1.0 / (1.0 + r) }))
                .unwrap_err()
                .contains("grows")
        );
    }
}
