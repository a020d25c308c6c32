//! The density of an innovation, given S, and its information about parameters.
//!
//! A sensor without a gate has the normal density. A gate expects outliers, and takes part of the evidence away, so all
//! rows of a gated sensor count, the rejected rows as well, with a density that has a tail: the normal one, mixed with a
//! wide Cauchy density. Its scale is c S, where c makes the maximum right if the innovations are normal after all.
//!
//! Source   Tukey 1960, *A survey of sampling from contaminated distributions*: the mixture. Student's density with four
//!          degrees of freedom, which is often used in its place, finds a σ that is 1.5 times too large where a tenth of
//!          the rows are outliers of 50σ; this one finds 1.1 times

use fusion_core::consistency::chi_square_quantile;
use fusion_core::filter::Update;
use fusion_core::math;
use std::sync::OnceLock;

/// The share of outliers that a gated sensor is believed to have, as Tukey's example has it.
const SHARE: f64 = 0.05;
/// The width of the tail over that of the normal part: an error of five σ does not occur by chance.
const WIDE: f64 = 5.0;

/// The density of the innovations of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Density {
    Normal,
    /// A mixture with outliers.
    WithOutliers,
}

impl Density {
    /// Its name for readers.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::WithOutliers => "with outliers",
        }
    }

    /// ln p of the innovation of an update; `None` if S was not computed.
    pub(crate) fn of_update(&self, update: &Update<'_>) -> Option<f64> {
        let m = update.residual.len();
        let diagonal = update.innovation_factor.iter().step_by(m + 1);
        let log_det = 2.0 * diagonal.map(|l| math::ln(*l)).sum::<f64>();
        let log = self.log_of(m, log_det, update.nis);
        (m > 0 && log.is_finite()).then_some(log)
    }

    /// ln p(r), for r and the factor L of S.
    pub(crate) fn log(&self, r: &[f64], l: &[f64]) -> f64 {
        let m = r.len();
        let log_det: f64 = (0..m).map(|i| 2.0 * math::ln(l[i * m + i])).sum();
        self.log_of(m, log_det, whitened(r, l).iter().map(|w| w * w).sum())
    }

    /// ln p of `m` rows, for ln |S| and rᵀ S⁻¹ r.
    fn log_of(&self, m: usize, log_det: f64, square: f64) -> f64 {
        match *self {
            Self::Normal => normal(m, square) - 0.5 * log_det,
            Self::WithOutliers => {
                let scale = scale(m);
                let (normal, tail) = parts(m, square / scale);
                let most = normal.max(tail);
                most + math::ln(math::exp(normal - most) + math::exp(tail - most)) - 0.5 * (log_det + m as f64 * math::ln(scale))
            }
        }
    }

    /// ∂ ln p / ∂(rᵀ S⁻¹ r): −½ for the normal density, and towards 0 for an outlier.
    pub(crate) fn slope(&self, m: usize, square: f64) -> f64 {
        match *self {
            Self::Normal => -0.5,
            Self::WithOutliers => {
                let scale = scale(m);
                let (normal, tail) = parts(m, square / scale);
                let share = 1.0 / (1.0 + math::exp(tail - normal));
                let of_tail = (1.0 + m as f64) / (WIDE * WIDE + square / scale);
                -0.5 * (share + (1.0 - share) * of_tail) / scale
            }
        }
    }

    /// The part of the normal density's information that this one has.
    pub(crate) fn efficiency(&self) -> f64 {
        match self {
            Self::Normal => 1.0,
            // The rows that may be outliers say hardly anything.
            Self::WithOutliers => 1.0 - SHARE,
        }
    }
}

/// The factor c of S for `m` rows.
fn scale(m: usize) -> f64 {
    // Every row asks for the scales of the same few sizes, and each takes milliseconds.
    static KNOWN: [OnceLock<f64>; 64] = [const { OnceLock::new() }; 64];
    match KNOWN.get(m) {
        Some(known) => *known.get_or_init(|| found_scale(m)),
        None => found_scale(m),
    }
}

fn found_scale(m: usize) -> f64 {
    // The slope of the mean of ln p over the scale is zero at c: the mean over equally probable values of χ²(m).
    const PARTS: usize = 2000;
    let dof = m as f64;
    let values: Vec<f64> = (0..PARTS)
        .map(|k| chi_square_quantile((k as f64 + 0.5) / PARTS as f64, dof))
        .collect();
    let slope = |c: f64| -> f64 {
        let each = values.iter().map(|x| {
            let (normal, tail) = parts(m, x / c);
            let wide = x / c / (WIDE * WIDE);
            let of_normal = x / c - dof;
            let of_tail = (1.0 + dof) * wide / (1.0 + wide) - dof;
            (math::exp(normal) * of_normal + math::exp(tail) * of_tail) / (math::exp(normal) + math::exp(tail))
        });
        each.sum()
    };
    let (mut low, mut high) = (0.1, 10.0);
    // 50 halvings reach the last digit.
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if slope(middle) > 0.0 { low = middle } else { high = middle }
    }
    low
}

/// ln of the normal density of a vector with this square and S = I.
fn normal(m: usize, square: f64) -> f64 {
    -0.5 * (m as f64 * math::ln(core::f64::consts::TAU) + square)
}

/// ln of the two parts of the mixture for a vector with this square and S = I, each with its share.
fn parts(m: usize, square: f64) -> (f64, f64) {
    let dof = m as f64;
    let constant = log_gamma(1.0 + dof) - log_gamma(1.0) - 0.5 * dof * math::ln(core::f64::consts::PI) - dof * math::ln(WIDE);
    let tail = constant - 0.5 * (1.0 + dof) * math::ln_1p(square / (WIDE * WIDE));
    (math::ln(1.0 - SHARE) + normal(m, square), math::ln(SHARE) + tail)
}

/// ln Γ(x / 2) for whole x.
fn log_gamma(x: f64) -> f64 {
    let (mut sum, mut half) = (0.0, 0.5 * x);
    while half > 1.0 {
        half -= 1.0;
        sum += math::ln(half);
    }
    // Γ(1) = 1, Γ(1/2) = √π.
    if half < 0.75 {
        sum + 0.5 * math::ln(core::f64::consts::PI)
    } else {
        sum
    }
}

/// L⁻¹ r.
pub(crate) fn whitened(r: &[f64], l: &[f64]) -> Vec<f64> {
    let m = r.len();
    let mut w = r.to_vec();
    for i in 0..m {
        let known: f64 = (0..i).map(|k| l[i * m + k] * w[k]).sum();
        w[i] = (w[i] - known) / l[i * m + i];
    }
    w
}

/// L⁻¹ A L⁻ᵀ of a symmetric A, m×m.
pub(crate) fn between(a: &[f64], l: &[f64], m: usize) -> Vec<f64> {
    let mut half = vec![0.0; m * m];
    for j in 0..m {
        let column: Vec<f64> = (0..m).map(|i| a[i * m + j]).collect();
        let solved = whitened(&column, l);
        (0..m).for_each(|i| half[j * m + i] = solved[i]);
    }
    // `half` holds (L⁻¹A)ᵀ = A L⁻ᵀ; its columns are whitened as well.
    let mut whole = vec![0.0; m * m];
    for j in 0..m {
        let column: Vec<f64> = (0..m).map(|i| half[i * m + j]).collect();
        let solved = whitened(&column, l);
        (0..m).for_each(|i| whole[i * m + j] = solved[i]);
    }
    whole
}

/// L Lᵀ.
pub(crate) fn product(l: &[f64], m: usize) -> Vec<f64> {
    let element = |i: usize, j: usize| (0..=i.min(j)).map(|k| l[i * m + k] * l[j * m + k]).sum();
    (0..m * m).map(|at| element(at / m, at % m)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_density_is_that_of_the_textbook() {
        // S = [4 2; 2 5], L = [2 0; 1 2]; r = (2, 3): rᵀS⁻¹r = 2, |S| = 16.
        let log = Density::Normal.log(&[2.0, 3.0], &[2.0, 0.0, 1.0, 2.0]);
        let expected = -(core::f64::consts::TAU.ln()) - 0.5 * 16_f64.ln() - 1.0;
        assert!((log - expected).abs() < 1e-14);
    }

    #[test]
    fn the_mixture_is_one_over_the_line() {
        let density = Density::WithOutliers;
        let step = 1e-3;
        let sum: f64 = (-200_000..200_000)
            .map(|k| density.log(&[f64::from(k) * step], &[1.5]).exp() * step)
            .sum();
        // A share of 2/π · 7.5 / 200 of the tail is beyond 200.
        assert!((sum - 1.0 + SHARE * 0.0239).abs() < 1e-4, "{sum}");
    }

    /// The maximum over the scale of S is at one for normal innovations, and with a tenth of outliers it is near it.
    #[test]
    fn the_mixture_finds_the_scale_of_normal_innovations_and_bears_outliers() {
        for m in [1, 2, 3] {
            let density = Density::WithOutliers;
            let values: Vec<f64> = (0..4000)
                .map(|k| chi_square_quantile((f64::from(k) + 0.5) / 4000.0, m as f64).sqrt())
                .collect();
            let best = |outliers: usize| {
                let sum = |scale: f64| -> f64 {
                    let l: Vec<f64> = (0..m * m).map(|k| if k % (m + 1) == 0 { scale } else { 0.0 }).collect();
                    let row = |size: f64| (0..m).map(|k| if k == 0 { size } else { 0.0 }).collect::<Vec<f64>>();
                    let normal: f64 = values.iter().map(|size| density.log(&row(*size), &l)).sum();
                    normal + outliers as f64 * density.log(&row(50.0), &l)
                };
                let scales = (500..2000).map(|k| f64::from(k) * 1e-3);
                scales.max_by(|a, b| sum(*a).total_cmp(&sum(*b))).unwrap()
            };
            assert!((best(0) - 1.0).abs() < 2e-3, "{m}: {}", best(0));
            let spoilt = best(440);
            assert!((1.0..1.15).contains(&spoilt), "{m}: a tenth of outliers of 50σ: {spoilt}");
        }
    }

    #[test]
    fn a_matrix_is_whitened_from_both_sides() {
        let l = [2.0, 0.0, 1.0, 2.0];
        let unit = between(&product(&l, 2), &l, 2);
        let expected = [1.0, 0.0, 0.0, 1.0];
        assert!(unit.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-14), "{unit:?}");
    }
}
