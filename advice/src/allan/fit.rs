//! Fits white noise, flicker noise and random walk to a curve.

use super::Point;
use core::f64::consts::{LN_2, PI};
use fusion_core::math;
use nalgebra::{DMatrix, DVector};

/// σ² of flicker noise of size 1.
const FLICKER: f64 = 2.0 * LN_2 / PI;
/// 1σ of the relative part of σ² that the three noises do not explain in a real instrument, for example quantisation.
/// Without it the shortest times would dominate the fit: a long log has millions of clusters for them.
const MISFIT: f64 = 0.1;
/// Rounds in which the weights follow the model; they settle within three or four.
const ROUNDS: usize = 10;

/// The sizes of the three noises, in the unit u of the samples; zero if a noise is not visible.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noises {
    /// White noise N \[u/√Hz\]: σ at 1 s on the slope −1/2.
    pub white: f64,
    /// Bias instability B \[u\]: σ of the flat part is 0.664 B.
    pub flicker: f64,
    /// Random walk K of the bias \[u/√s\]: σ at 3 s on the slope +1/2.
    pub walk: f64,
}

impl Noises {
    /// Fits σ²(τ) = N²/τ + (2 ln 2/π) B² + K² τ/3 by least squares with coefficients of at least zero.
    /// The weight of a point is the inverse of the variance of its σ², (2/freedom + 0.1²) σ⁴, with σ of the fit.
    ///
    /// `None` for fewer than three points, or if the samples do not vary.
    #[must_use]
    pub fn fit(points: &[Point]) -> Option<Self> {
        let is_sound = |p: &Point| p.sigma > 0.0 && p.sigma.is_finite() && p.freedom > 0.0;
        if points.len() < 3 || !points.iter().all(is_sound) {
            return None;
        }
        let mut model: Vec<f64> = points.iter().map(|p| p.sigma * p.sigma).collect();
        let mut squares = [0.0; 3];
        for _ in 0..ROUNDS {
            squares = weighted(points, &model)?;
            let noises = Self::of(squares);
            model = points.iter().map(|p| math::powi(noises.deviation(p.tau), 2)).collect();
        }
        Some(Self::of(squares))
    }

    fn of([white, flicker, walk]: [f64; 3]) -> Self {
        Self {
            white: math::sqrt(white),
            flicker: math::sqrt(flicker),
            walk: math::sqrt(walk),
        }
    }

    /// The deviation of the three together at the cluster time τ.
    #[must_use]
    pub fn deviation(&self, tau: f64) -> f64 {
        let squares = [self.white, self.flicker, self.walk].map(|size| size * size);
        math::sqrt(terms(tau).iter().zip(squares).map(|(term, square)| term * square).sum::<f64>())
    }
}

/// σ² of each noise of size 1.
fn terms(tau: f64) -> [f64; 3] {
    [1.0 / tau, FLICKER, tau / 3.0]
}

/// The best N², B², K², with `model` as the previous σ². The three unknowns are at least zero: the function tries
/// each choice of the unknowns that are not zero.
fn weighted(points: &[Point], model: &[f64]) -> Option<[f64; 3]> {
    let rows = points.len();
    // Divided by the standard deviation of each σ².
    let scale = |row: usize| math::sqrt(2.0 / points[row].freedom + MISFIT * MISFIT).recip() / model[row];
    let target = DVector::from_fn(rows, |row, _| math::powi(points[row].sigma, 2) * scale(row));
    let mut best: Option<(f64, [f64; 3])> = None;
    for chosen in 1_usize..8 {
        let free: Vec<usize> = (0..3).filter(|k| chosen & (1 << k) != 0).collect();
        let matrix = DMatrix::from_fn(rows, free.len(), |row, k| terms(points[row].tau)[free[k]] * scale(row));
        // The columns differ by powers of ten.
        let norms: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
        let even = DMatrix::from_fn(rows, free.len(), |row, k| matrix[(row, k)] / norms[k]);
        let Ok(found) = even.clone().svd(true, true).solve(&target, 0.0) else {
            continue;
        };
        if found.iter().any(|x| !x.is_finite() || *x < 0.0) {
            continue;
        }
        let misfit = (even * &found - &target).norm_squared();
        if best.is_none_or(|(least, _)| misfit < least) {
            let mut squares = [0.0; 3];
            free.iter().enumerate().for_each(|(k, of)| squares[*of] = found[k] / norms[k]);
            best = Some((misfit, squares));
        }
    }
    best.map(|(_, squares)| squares)
}
