//! Robust losses: how much an accepted residual still counts.
//!
//! A loss sees the norm of the whitened residual, |S^{-1/2} r| = √NIS, *after* the gate has judged
//! it unweighted, and returns a weight w in (0, 1]; the update then runs with R/w.

use core::fmt::Debug;

/// A robust loss.
pub trait Loss: Debug + Send + Sync {
    /// Weight in (0, 1] for a whitened residual of that norm and dimension.
    fn weight(&self, norm: f64, dim: usize) -> f64;
}

/// w = 1: least squares.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quadratic;

impl Loss for Quadratic {
    fn weight(&self, _: f64, _: usize) -> f64 {
        1.0
    }
}

/// Huber: w = min(1, k/|r|). Source: Huber 1964; k = 1.345 gives 95 % efficiency.
#[derive(Clone, Copy, Debug)]
pub struct Huber {
    /// Where the loss turns linear, in standard deviations.
    pub k: f64,
}

impl Loss for Huber {
    fn weight(&self, norm: f64, _: usize) -> f64 {
        if norm <= self.k { 1.0 } else { self.k / norm }
    }
}

/// Cauchy: w = 1/(1 + (|r|/c)²); c = 2.385 gives 95 % efficiency.
#[derive(Clone, Copy, Debug)]
pub struct Cauchy {
    /// Scale in standard deviations.
    pub c: f64,
}

impl Loss for Cauchy {
    fn weight(&self, norm: f64, _: usize) -> f64 {
        1.0 / (1.0 + (norm / self.c).powi(2))
    }
}

/// Student-t with ν degrees of freedom: w = (ν + m)/(ν + |r|²), at most 1.
/// Source: the E-step of Lange, Little, Taylor 1989.
#[derive(Clone, Copy, Debug)]
pub struct StudentT {
    /// Degrees of freedom; about 4 for moderate tails.
    pub nu: f64,
}

impl Loss for StudentT {
    fn weight(&self, norm: f64, dim: usize) -> f64 {
        ((self.nu + dim as f64) / (self.nu + norm * norm)).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_loss;

    #[test]
    fn every_loss_obeys_the_laws_of_losses() {
        let losses: [&dyn Loss; 4] = [&Quadratic, &Huber { k: 1.345 }, &Cauchy { c: 2.385 }, &StudentT { nu: 4.0 }];
        for loss in losses {
            check_loss(loss).unwrap_or_else(|e| panic!("{loss:?}: {e}"));
        }
    }

    #[test]
    fn weights_match_their_formulas() {
        assert_eq!(Huber { k: 1.5 }.weight(3.0, 1), 0.5);
        assert_eq!(Cauchy { c: 2.0 }.weight(2.0, 3), 0.5);
        assert_eq!(StudentT { nu: 4.0 }.weight(4.0, 2), 0.3);
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
