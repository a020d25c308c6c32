//! How each innovation changes with each parameter.
//!
//! ```text
//! w = L⁻¹ r,  S = L Lᵀ;   bⱼ = L⁻¹ ∂r/∂θⱼ,  Aⱼ = L⁻¹ ∂S/∂θⱼ L⁻ᵀ
//! slope        ∂ln p/∂θⱼ = −½ tr Aⱼ + g′(q) (2 wᵀbⱼ − wᵀAⱼw),  q = wᵀw,  g = ln p as a function of q
//! information  Iⱼₖ = Σ bⱼᵀbₖ + ½ tr AⱼAₖ
//! ```
//!
//! One more run for each parameter gives b and A. At the next θ, one run is enough: Broyden's update gives b and A the
//! smallest change with which they explain the step. An inexact b or A biases no estimate: at the true θ, w has mean 0
//! and covariance I for every past, so the mean of each slope is 0.
//!
//! Source     Gupta, Mehra 1974 (IEEE TAC 19(6), 774): slope and information; Broyden 1965 (Mathematics of Computation
//!            19, 577): the update; Godambe 1960, White 1982 (Econometrica 50, 1): the sandwich

use super::trials::{Part, Score, Trials};
use crate::likelihood::{BLOCKS, between, block, product, whitened};
use fusion::config::Diagnostics;
use fusion_core::math;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The difference of a logarithm for a slope if gates decide: a gate that decides otherwise makes a jump, which a
/// smaller difference would magnify.
const ROUGH: f64 = 0.1;
/// The same without gates: the root of what rounding changes in an innovation, 1e-10, is far below it.
const SMOOTH: f64 = 1e-3;

/// A row, and how it changes.
struct Row {
    run: usize,
    log: usize,
    sensor: usize,
    number: u32,
    time: f64,
    /// For each parameter that is free: b, then A row by row.
    changes: Vec<Vec<f64>>,
    /// ∂ ln p for each of them.
    slope: Vec<f64>,
}

/// The information of a row about a parameter.
pub(super) struct Said {
    pub(super) sensor: usize,
    pub(super) time: f64,
    /// The share of the variance of the innovation that the noise adds.
    pub(super) share: f64,
    /// The information about the logarithm of the parameter.
    pub(super) information: f64,
}

/// Slope and information of the likelihood, row by row.
pub(super) struct Sensitivity {
    /// The parameters that are free, by their places.
    pub(super) free: Vec<usize>,
    rows: Vec<Row>,
    /// The time of each log in which rows count.
    spans: Vec<(f64, f64)>,
    efficiency: Vec<f64>,
}

impl Sensitivity {
    /// By one more run for each parameter that is free.
    pub(super) fn new(trials: &Trials<'_>, theta: &[f64], free: &[usize], base: &Score) -> Result<Self, Diagnostics> {
        let step = if trials.is_smooth() { SMOOTH } else { ROUGH };
        let beside = free.par_iter().map(|j| {
            let mut other = theta.to_vec();
            other[*j] += step;
            trials.at(&other)
        });
        let beside = beside.collect::<Result<Vec<Score>, Diagnostics>>()?;
        let mut rows = Vec::new();
        for (run, (sensors, from)) in base.runs.iter().enumerate() {
            let log = trials.log_of(run);
            for (sensor, own) in sensors.iter().enumerate() {
                let Some(own) = own else { continue };
                for k in (0..own.len()).filter(|k| own.times[*k] >= *from) {
                    let number = own.numbers[k];
                    let changes = beside.iter().map(|score| {
                        let other = score.runs[run].0[sensor].as_ref()?;
                        let mut change = change(own.innovation(k), other.innovation(other.at(number)?));
                        change.iter_mut().for_each(|c| *c /= step);
                        Some(change)
                    });
                    if let Some(changes) = changes.collect() {
                        rows.push(Row {
                            run,
                            log,
                            sensor,
                            number,
                            time: own.times[k],
                            changes,
                            slope: Vec::new(),
                        });
                    }
                }
            }
        }
        let mut made = Self {
            free: free.to_vec(),
            rows,
            spans: (0..base.logs().len()).map(|log| base.span(log)).collect(),
            efficiency: trials.densities.iter().map(|d| d.map_or(0.0, |d| d.efficiency())).collect(),
        };
        made.slopes(trials, base);
        Ok(made)
    }

    /// Moves it from the innovations `from` to those of a step away, by Broyden's update.
    pub(super) fn follow(&mut self, trials: &Trials<'_>, step: &DVector<f64>, from: &Score, to: &Score) {
        let square = step.norm_squared();
        self.rows.retain_mut(|row| {
            let sensors = (&from.runs[row.run].0[row.sensor], &to.runs[row.run].0[row.sensor]);
            let (Some(one), Some(other)) = sensors else { return false };
            let (Some(k), Some(at)) = (one.at(row.number), other.at(row.number)) else {
                return false;
            };
            let mut missing = change(one.innovation(k), other.innovation(at));
            for (own, step) in row.changes.iter().zip(step.iter()) {
                missing.iter_mut().zip(own).for_each(|(missing, own)| *missing -= own * step);
            }
            let ((r, l), (_, l_new)) = (one.innovation(k), other.innovation(at));
            for (own, step) in row.changes.iter_mut().zip(step.iter()) {
                own.iter_mut()
                    .zip(&missing)
                    .for_each(|(own, missing)| *own += missing * step / square);
                // ∂r stays, so b has the new L; ∂S grows with S, so A stays.
                let b = whitened(&times(l, &own[..r.len()]), l_new);
                own[..r.len()].copy_from_slice(&b);
            }
            true
        });
        self.slopes(trials, to);
    }

    /// The slopes of the rows at a score.
    fn slopes(&mut self, trials: &Trials<'_>, at: &Score) {
        for row in &mut self.rows {
            let found = at.runs[row.run].0[row.sensor]
                .as_ref()
                .and_then(|own| Some((own, own.at(row.number)?)));
            let (Some((own, k)), Some(density)) = (found, trials.densities[row.sensor]) else {
                row.slope = vec![0.0; self.free.len()];
                continue;
            };
            let (r, l) = own.innovation(k);
            let (m, w) = (r.len(), whitened(r, l));
            let by_square = density.slope(m, dot(&w, &w));
            let of = |change: &Vec<f64>| {
                let (b, a) = change.split_at(m);
                let trace: f64 = (0..m).map(|i| a[i * m + i]).sum();
                let quadratic: f64 = (0..m).map(|i| w[i] * dot(&a[i * m..(i + 1) * m], &w)).sum();
                -0.5 * trace + by_square * (2.0 * dot(&w, b) - quadratic)
            };
            row.slope = row.changes.iter().map(of).collect();
        }
    }

    /// Slope and information over the parameters that are free, of the rows that `counts` selects by log and time.
    pub(super) fn sum(&self, counts: &dyn Fn(usize, f64) -> bool) -> (DVector<f64>, DMatrix<f64>) {
        let d = self.free.len();
        let (mut slope, mut information) = (DVector::zeros(d), DMatrix::zeros(d, d));
        for row in self.rows.iter().filter(|row| counts(row.log, row.time)) {
            let efficiency = self.efficiency[row.sensor];
            let m = rank(row.changes.first().map_or(0, Vec::len));
            for j in 0..d {
                slope[j] += row.slope[j];
                for k in 0..=j {
                    let (one, other) = (&row.changes[j], &row.changes[k]);
                    let own = efficiency * (dot(&one[..m], &other[..m]) + 0.5 * dot(&one[m..], &other[m..]));
                    information[(j, k)] += own;
                    if j != k {
                        information[(k, j)] += own;
                    }
                }
            }
        }
        (slope, information)
    }

    /// Slope and information of all rows.
    pub(super) fn all(&self) -> (DVector<f64>, DMatrix<f64>) {
        self.sum(&|_, _| true)
    }

    /// Slope and information without the rows of a part.
    pub(super) fn without(&self, part: &Part) -> (DVector<f64>, DMatrix<f64>) {
        self.sum(&|log, time| !part.holds(log, time))
    }

    /// For the `k`-th parameter that is free, each row with what it says of the parameter.
    pub(super) fn said(&self, k: usize) -> impl Iterator<Item = Said> {
        self.rows.iter().map(move |row| {
            let change = &row.changes[k];
            let m = rank(change.len());
            let (b, a) = change.split_at(m);
            let trace: f64 = (0..m).map(|i| a[i * m + i]).sum();
            Said {
                sensor: row.sensor,
                time: row.time,
                // A variance grows as the square of its noise.
                share: 0.5 * trace / m as f64,
                information: self.efficiency[row.sensor] * (dot(b, b) + 0.5 * dot(a, a)),
            }
        })
    }

    /// The covariance of the estimate with the prior of weights `prior`: H⁻¹ (J + W) H⁻¹, H = I + W. J is the variance
    /// of the slope, from blocks of time, so correlated innovations do not make it wrong.
    pub(super) fn covariance(&self, prior: &DVector<f64>) -> Option<DMatrix<f64>> {
        let d = self.free.len();
        let weight = DMatrix::from_diagonal(prior);
        let (total, information) = self.all();
        let mut blocks = vec![DVector::<f64>::zeros(d); BLOCKS * self.spans.len()];
        for row in &self.rows {
            let own = &mut blocks[row.log * BLOCKS + block(self.spans[row.log], row.time)];
            (0..d).for_each(|j| own[j] += row.slope[j]);
        }
        let count = blocks.len() as f64;
        let mean = total / count;
        let mut variance = weight.clone();
        for own in &blocks {
            let off = own - &mean;
            variance += &off * off.transpose() * (count / (count - 1.0));
        }
        let inverse = (information + weight).try_inverse()?;
        Some(&inverse * variance * &inverse)
    }
}

/// From one innovation to another: L⁻¹ (r′ − r), then ln(L⁻¹ S′ L⁻ᵀ). The logarithm makes it exact for an S that grows
/// as a power of the noise.
fn change((r, l): (&[f64], &[f64]), (r_new, l_new): (&[f64], &[f64])) -> Vec<f64> {
    let m = r.len();
    let off: Vec<f64> = r_new.iter().zip(r).map(|(a, b)| a - b).collect();
    let mut change = whitened(&off, l);
    let ratio = between(&product(l_new, m), l, m);
    if m == 1 {
        change.push(math::ln(ratio[0]));
    } else {
        let eigen = DMatrix::from_row_slice(m, m, &ratio).symmetric_eigen();
        let logs = DMatrix::from_diagonal(&eigen.eigenvalues.map(math::ln));
        // Symmetric, so its columns are its rows.
        change.extend((&eigen.eigenvectors * logs * eigen.eigenvectors.transpose()).iter());
    }
    change
}

/// The rows m of a residual, of m + m² numbers.
fn rank(size: usize) -> usize {
    (0..).find(|m| m + m * m >= size).unwrap_or(0)
}

/// L b, of a lower L.
fn times(l: &[f64], b: &[f64]) -> Vec<f64> {
    let m = b.len();
    (0..m).map(|i| dot(&l[i * m..=i * m + i], &b[..=i])).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_in_units_of_the_innovation_and_exact_for_a_power() {
        let (l, l_new) = ([2.0, 0.0, 1.0, 2.0], [4.0, 0.0, 2.0, 4.0]);
        let found = change((&[2.0, 3.0], &l), (&[4.0, 3.0], &l_new));
        // S′ = 4 S; L⁻¹ (2, 0) = (1, −½).
        let wanted = [1.0, -0.5, 4_f64.ln(), 0.0, 0.0, 4_f64.ln()];
        // 10 ε of numbers near one.
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 2e-15), "{found:?}");
        assert_eq!((rank(2), rank(6), rank(12)), (1, 2, 3));
        assert_eq!(times(&l, &[1.0, -0.5]), [2.0, 0.0]);
    }
}
