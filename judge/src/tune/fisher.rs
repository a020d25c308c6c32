//! Fisher scoring: slope and information of the likelihood by one more run for each parameter.

use super::density::{between, product, whitened};
use super::record::{Recorder, Rows};
use super::{Part, Trials};
use fusion::config::Diagnostics;
use fusion::design::Design;
use fusion::run::run_sharing;
use fusion_models::sim::SharedCourse;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// The difference of a logarithm for a slope. A gate that decides otherwise makes a jump, which a smaller difference
/// would magnify; the curvature is subtracted, so the error of the slope is of second order.
const STEP: f64 = 0.1;
/// No step changes a parameter by more than e² times.
const LONGEST: f64 = 2.0;
/// The 1σ of the logarithm of a parameter before the log is seen: a factor of e³ = 20 either way. It only decides where
/// the log does not.
const PRIOR: f64 = 3.0;
/// The search ends if the next step is expected to gain less: a hundredth of what one parameter gains by chance.
const ENOUGH: f64 = 0.005;

/// The innovations of all logs at one θ.
pub(super) struct Score {
    /// For each log its rows by sensor, and from when they count \[s\].
    pub(super) logs: Vec<(Vec<Option<Rows>>, f64)>,
}

/// Slope and information of one part.
#[derive(Clone, Debug)]
pub(super) struct Slope {
    pub(super) part: Part,
    slope: DVector<f64>,
    information: DMatrix<f64>,
}

/// The end of a search.
pub(super) struct Point {
    pub(super) theta: Vec<f64>,
    pub(super) score: Score,
    slopes: Vec<Slope>,
    /// Whether it is a maximum; the search may end before, at the limit of runs.
    pub(super) has_converged: bool,
}

impl Point {
    /// A point without slopes.
    pub(super) fn of(theta: Vec<f64>, score: Score) -> Self {
        Self {
            theta,
            score,
            slopes: Vec::new(),
            has_converged: true,
        }
    }

    /// The 1σ of the logarithm of each parameter.
    pub(super) fn sigmas(&self) -> Vec<f64> {
        let d = self.theta.len();
        let all = self.slopes.iter().fold(DMatrix::zeros(d, d), |sum, s| sum + &s.information);
        sigmas(&all)
    }

    /// The parameters that the other parts give: one step of Fisher scoring from the maximum of all.
    pub(super) fn without(&self, part: &Part) -> Vec<f64> {
        let d = self.theta.len();
        let (mut slope, mut information) = (DVector::zeros(d), DMatrix::zeros(d, d));
        for other in self.slopes.iter().filter(|s| s.part != *part) {
            slope += &other.slope;
            information += &other.information;
        }
        let step = damped(&slope, &information, &self.theta, 0.0);
        self.theta.iter().zip(step.iter()).map(|(theta, step)| theta + step).collect()
    }
}

/// The 1σ of each parameter; infinite without information.
fn sigmas(information: &DMatrix<f64>) -> Vec<f64> {
    let d = information.nrows();
    // The prior bounds what the log does not tell, and leaves the rest: 1/9 against 1/0.3² = 11.
    let with = information + DMatrix::identity(d, d) / (PRIOR * PRIOR);
    let inverse = with.try_inverse().unwrap_or_else(|| DMatrix::from_element(d, d, f64::INFINITY));
    (0..d).map(|j| inverse[(j, j)].sqrt()).collect()
}

/// The step of Fisher scoring, with the prior and `damping` times the diagonal.
fn damped(slope: &DVector<f64>, information: &DMatrix<f64>, theta: &[f64], damping: f64) -> DVector<f64> {
    let d = theta.len();
    let weight = 1.0 / (PRIOR * PRIOR);
    let mut matrix = information.clone();
    for j in 0..d {
        matrix[(j, j)] += weight + damping * information[(j, j)];
    }
    let right = slope - DVector::from_column_slice(theta) * weight;
    let step = matrix.cholesky().map_or_else(|| DVector::zeros(d), |c| c.solve(&right));
    step.map(|s| s.clamp(-LONGEST, LONGEST))
}

impl Trials<'_> {
    /// The innovations of all logs at `theta`.
    pub(super) fn at(&self, theta: &[f64]) -> Result<Score, Diagnostics> {
        let each: Result<Vec<_>, Diagnostics> = (0..self.logs.len()).into_par_iter().map(|log| self.run(log, theta)).collect();
        Ok(Score { logs: each? })
    }

    /// The innovations of one log, and when they begin to count.
    fn run(&self, log: usize, theta: &[f64]) -> Result<(Vec<Option<Rows>>, f64), Diagnostics> {
        let own = &self.logs[log];
        let mut document = own.document.clone();
        for (parameter, theta) in self.parameters.iter().zip(theta) {
            document.apply(&parameter.times(theta.exp(), None))?;
        }
        for thinned in &self.thinning[log] {
            document.apply(&thinned.edit())?;
        }
        let design = Design::read(document)?;
        let mut recorder = Recorder::new(&self.densities);
        let summary = run_sharing(&design, &own.options, &SharedCourse::default(), &mut [&mut recorder])?;
        self.runs.fetch_add(1, Ordering::Relaxed);
        let health = summary.health().iter().find(|h| h.filter.is_empty());
        let aligned = health.and_then(|h| h.aligned).or(summary.start().started).unwrap_or(f64::INFINITY);
        Ok((recorder.sensors, aligned + self.settings.settle))
    }

    /// The logs, each cut into parts of equal length.
    pub(super) fn parts(&self, score: &Score) -> Vec<Part> {
        let folds = self.settings.folds.max(1);
        let of = |(log, (sensors, from)): (usize, &(Vec<Option<Rows>>, f64))| {
            let ends = sensors.iter().flatten().filter_map(|rows| rows.times.last().copied());
            let to = ends.fold(*from, f64::max);
            let edge = {
                let from = *from;
                move |k: usize| {
                    if k == folds {
                        f64::INFINITY
                    } else {
                        from + (to - from) * k as f64 / folds as f64
                    }
                }
            };
            (0..folds).map(move |k| Part {
                log,
                from: if k == 0 { f64::NEG_INFINITY } else { edge(k) },
                to: edge(k + 1),
            })
        };
        score.logs.iter().enumerate().flat_map(of).collect()
    }

    /// The rows that count in both scores: log, sensor, and their places in each.
    fn matched<'s>(&'s self, a: &'s Score, b: &'s Score) -> impl Iterator<Item = (usize, usize, (&'s Rows, usize), (&'s Rows, usize))> {
        a.logs.iter().zip(&b.logs).enumerate().flat_map(|(log, ((one, from), (other, _)))| {
            let sensors = one.iter().zip(other).enumerate();
            let both = sensors.filter_map(|(sensor, (one, other))| Some((sensor, one.as_ref()?, other.as_ref()?)));
            both.flat_map(move |(sensor, one, other)| {
                let counted = (0..one.len()).filter(move |k| one.times[*k] >= *from);
                counted.filter_map(move |k| {
                    let at = other.numbers.binary_search(&one.numbers[k]).ok()?;
                    Some((log, sensor, (one, k), (other, at)))
                })
            })
        })
    }

    /// The gain in nats from `a` to `b`, over the rows of `a` that `counts` selects by log and time.
    pub(super) fn gain(&self, a: &Score, b: &Score, counts: &dyn Fn(usize, f64) -> bool) -> f64 {
        let mut sum = 0.0;
        for (log, sensor, (one, k), (other, at)) in self.matched(a, b) {
            let Some(density) = self.densities[sensor].filter(|_| counts(log, one.times[k])) else {
                continue;
            };
            let ((r, l), (r_b, l_b)) = (one.innovation(k), other.innovation(at));
            sum += density.log(r_b, l_b) - density.log(r, l);
        }
        sum
    }

    /// Slope and information at `theta` for each part, from one more run for each parameter.
    fn slopes(&self, theta: &[f64], base: &Score) -> Result<Vec<Slope>, Diagnostics> {
        let d = theta.len();
        let beside: Result<Vec<Score>, Diagnostics> = (0..d)
            .into_par_iter()
            .map(|j| {
                let mut other = theta.to_vec();
                other[j] += STEP;
                self.at(&other)
            })
            .collect();
        let beside = beside?;
        let mut slopes: Vec<Slope> = self
            .parts(base)
            .into_iter()
            .map(|part| Slope {
                part,
                slope: DVector::zeros(d),
                information: DMatrix::zeros(d, d),
            })
            .collect();
        for (log, (sensors, from)) in base.logs.iter().enumerate() {
            for (sensor, rows) in sensors.iter().enumerate() {
                let (Some(rows), Some(density)) = (rows, self.densities[sensor]) else {
                    continue;
                };
                for k in (0..rows.len()).filter(|k| rows.times[*k] >= *from) {
                    let others: Option<Vec<(&Rows, usize)>> = beside
                        .iter()
                        .map(|score| {
                            let other = score.logs[log].0[sensor].as_ref()?;
                            Some((other, other.numbers.binary_search(&rows.numbers[k]).ok()?))
                        })
                        .collect();
                    let Some(others) = others else { continue };
                    let Some(slope) = slopes.iter_mut().find(|s| s.part.holds(log, rows.times[k])) else {
                        continue;
                    };
                    add(slope, density, rows.innovation(k), &others);
                }
            }
        }
        // ln p(θ + h) − ln p(θ) = h slope − h² information / 2.
        for s in &mut slopes {
            for j in 0..d {
                s.slope[j] = s.slope[j] / STEP + 0.5 * STEP * s.information[(j, j)];
            }
        }
        Ok(slopes)
    }
}

/// Adds a row to slope and information: the difference of its density for each parameter, and
/// ∂rᵀ S⁻¹ ∂r + tr(S⁻¹ ∂S S⁻¹ ∂S) / 2.
fn add(to: &mut Slope, density: super::Density, (r, l): (&[f64], &[f64]), others: &[(&Rows, usize)]) {
    let (m, d) = (r.len(), others.len());
    let (log, s) = (density.log(r, l), product(l, m));
    let changes: Vec<(Vec<f64>, Vec<f64>)> = others
        .iter()
        .enumerate()
        .map(|(j, (rows, at))| {
            let (r_j, l_j) = rows.innovation(*at);
            to.slope[j] += density.log(r_j, l_j) - log;
            let by_r: Vec<f64> = r_j.iter().zip(r).map(|(a, b)| (a - b) / STEP).collect();
            let by_s: Vec<f64> = product(l_j, m).iter().zip(&s).map(|(a, b)| (a - b) / STEP).collect();
            (whitened(&by_r, l), between(&by_s, l, m))
        })
        .collect();
    let efficiency = density.efficiency();
    for j in 0..d {
        for k in 0..=j {
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let own = dot(&changes[j].0, &changes[k].0) + 0.5 * dot(&changes[j].1, &changes[k].1);
            to.information[(j, k)] += efficiency * own;
            if j != k {
                to.information[(k, j)] += efficiency * own;
            }
        }
    }
}

/// Climbs to the maximum of likelihood and prior from `theta`.
pub(super) fn climb(trials: &Trials<'_>, mut theta: Vec<f64>, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<Point, Diagnostics> {
    let mut score = trials.at(&theta)?;
    let (mut damping, mut gained) = (0.0, 0.0);
    let prior = |theta: &[f64]| -0.5 * theta.iter().map(|t| t * t).sum::<f64>() / (PRIOR * PRIOR);
    loop {
        let slopes = trials.slopes(&theta, &score)?;
        let d = theta.len();
        let (mut slope, mut information) = (DVector::zeros(d), DMatrix::zeros(d, d));
        for s in &slopes {
            slope += &s.slope;
            information += &s.information;
        }
        loop {
            let step = damped(&slope, &information, &theta, damping);
            let right = &slope - DVector::from_column_slice(&theta) / (PRIOR * PRIOR);
            let expected = 0.5 * step.dot(&right);
            let has_converged = expected < ENOUGH;
            if has_converged || trials.runs.load(Ordering::Relaxed) >= trials.settings.most_runs {
                return Ok(Point {
                    theta,
                    score,
                    slopes,
                    has_converged,
                });
            }
            let next: Vec<f64> = theta.iter().zip(step.iter()).map(|(t, s)| t + s).collect();
            let moved = trials.at(&next)?;
            let gain = trials.gain(&score, &moved, &|_, _| true) + prior(&next) - prior(&theta);
            if gain > 0.0 {
                gained += gain;
                progress(trials.runs.load(Ordering::Relaxed), gained);
                (theta, score) = (next, moved);
                damping = if damping < 1e-2 { 0.0 } else { damping / 10.0 };
                break;
            }
            damping = if damping == 0.0 { 0.1 } else { damping * 10.0 };
            // Steps so short change less than the limit of gain.
            if damping > 1e6 {
                return Ok(Point {
                    theta,
                    score,
                    slopes,
                    has_converged: true,
                });
            }
        }
    }
}
