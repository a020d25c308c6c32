//! Noises of a design from its innovations, without a truth.
//!
//! ```text
//! parameters θ (logarithms of factors) ──▶ d + 1 runs ──▶ innovations r, L of each row, S = L Lᵀ
//!        ▲                                                        │ how each changes with θ; slope, information
//!        └── a step of Fisher scoring, one run, Broyden's update ◀┘
//! ```
//!
//! Which rows count, and with which density, is as for the [likelihood](crate::likelihood) of a result. Rows of two runs
//! are matched by their number.
//!
//! The likelihood assumes that innovations are independent. So the rows of a sensor are thinned until their neighbours
//! are white. If they are then too few, nothing is tuned. The result is judged on parts of the log that it was not found
//! on.
//!
//! A parameter with a 1σ of its logarithm above one is not identifiable by the log. Its declared value is a prior, and
//! its uncertainty widens the intervals of the others. It keeps its declared value, unless the log refutes this value.
//!
//! Source     Gupta, Mehra 1974 (IEEE TAC 19(6), 774): maximum likelihood by Fisher scoring over the innovations
//! Not here   drift in outages, and errors against a reference: the runs of the result show them

mod climb;
mod parameter;
mod record;
mod sensitivity;
mod trials;
mod white;

use fusion_core::math;
pub use parameter::Parameter;
pub use white::Independence;

use self::climb::{Point, Start, climb};
use self::trials::{Part, Score, Trials};
use crate::likelihood::{densities, difference};
use fusion::config::{Diagnostic, Diagnostics, Document, Edit};
use fusion::design::Design;
use fusion::run::Options;
use fusion_core::consistency::chi_square_quantile;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A recorded log, or a simulated world, with its design.
#[derive(Debug)]
pub struct Log {
    /// The design, with its variants and values.
    pub document: Document,
    /// Where its data are. With `kept`, all runs share the rows that the first one decodes.
    pub options: Options,
}

/// How to tune.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Rows count from this time after the alignment on \[s\].
    pub settle: f64,
    /// The number of parts of the log, each judged by what the others give.
    pub folds: usize,
    /// No iteration begins after this number of runs.
    pub most_runs: u64,
    /// Innovations are called dependent at this probability of doing so wrongly, for each sensor.
    pub false_refusal: f64,
    /// The 1σ of the logarithm of each declared value, by its data sheet: the declared values are a prior. Without it, a
    /// wide prior applies to the parameters that the log does not identify, and to no other.
    pub prior: Option<f64>,
    /// When it becomes true, the search ends with the best that it has found.
    pub stop: Option<Arc<AtomicBool>>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            settle: 0.0,
            folds: 4,
            most_runs: 1000,
            false_refusal: 1e-3,
            prior: None,
            stop: None,
        }
    }
}

/// The result for a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The parameter.
    pub parameter: Parameter,
    /// Its value over the declared value; 1 if it keeps that.
    pub factor: f64,
    /// The 1σ of the logarithm of the factor.
    pub sigma: f64,
    /// Whether the log contradicts the declared value of a parameter that is not identifiable: it is likely too large, or
    /// too small, but no value is much better than others.
    pub is_refuted: bool,
}

impl Found {
    /// Whether the log determines it: the 1σ of its logarithm is at most one.
    #[must_use]
    pub fn is_identifiable(&self) -> bool {
        self.sigma <= 1.0
    }

    /// The 95 % interval of the factor.
    #[must_use]
    pub fn interval(&self) -> (f64, f64) {
        let width = math::exp(STUDENT_95 * self.sigma);
        (self.factor / width, self.factor * width)
    }

    /// The edit of the design, with as many digits as its σ supports; `None` if it keeps its declared value.
    #[must_use]
    pub fn edit(&self) -> Option<Edit> {
        let is_new = self.factor != 1.0;
        (is_new && (self.is_identifiable() || self.is_refuted)).then(|| self.parameter.times(self.factor, Some(3)))
    }
}

/// The quantile of Student's distribution for 95 % around the mean: σ comes from 20 blocks of time.
const STUDENT_95: f64 = 2.093;

/// The result of a tuning.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// The parameters, in their order.
    pub found: Vec<Found>,
    /// ln L of the result, of the rows that it was found on.
    pub log_likelihood: f64,
    /// Its gain over the declared design.
    pub nats: f64,
    /// The gain on each part of the logs, with what the other parts give.
    pub unseen: Vec<f64>,
    /// Runs made.
    pub runs: u64,
    /// Whether the search ended at a maximum, not at the limit of runs.
    pub has_converged: bool,
    /// The independence of the innovations of each sensor that counted.
    pub independence: Vec<Independence>,
}

impl Tuned {
    /// Whether the innovations of all sensors are independent, so far as their number can tell.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.independence.iter().all(|sensor| sensor.is_white)
    }

    /// The gain on the parts that were not seen.
    #[must_use]
    pub fn gain(&self) -> f64 {
        self.unseen.iter().sum()
    }

    /// The edits of the design; empty if the innovations are not independent.
    #[must_use]
    pub fn edits(&self) -> Vec<Edit> {
        if self.is_sound() {
            self.found.iter().filter_map(Found::edit).collect()
        } else {
            Vec::new()
        }
    }
}

/// Tunes the noises that `patterns` select, or without a pattern those of the process and of instruments. The result
/// does not depend on the number of threads. `progress` hears the number of runs and the gain so far.
///
/// # Errors
/// A pattern that selects nothing; mistakes of the designs or their data; a log without innovations.
pub fn tune(logs: &[Log], patterns: &[String], settings: &Settings, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<Tuned, Diagnostics> {
    let first = logs.first().ok_or_else(|| Diagnostic::error("there is no log to tune on"))?;
    let design = Design::read(first.document.clone())?;
    let parameters = if patterns.is_empty() {
        Parameter::of_instruments(&design)
    } else {
        Parameter::select(&first.document, patterns)?
    };
    if parameters.is_empty() {
        return Err(Diagnostic::error("the design declares no noise that can be tuned").into());
    }
    let runs = AtomicU64::new(0);
    let mut trials = Trials {
        logs,
        parameters,
        densities: densities(&design),
        thinning: vec![Vec::new(); logs.len()],
        settings,
        runs: &runs,
    };
    let End {
        point,
        mut independence,
        sigmas,
        refuted,
        unseen,
    } = search(&mut trials, &design, progress)?;
    let declared = trials.at(&vec![0.0; point.theta.len()])?;
    let nats = trials.gain(&declared, &point.score, &all_rows);
    let of_part = |(part, score): &(Part, Score)| trials.gain(&declared, score, &|log, time| part.holds(log, time));
    let unseen: Vec<f64> = unseen.iter().map(of_part).collect();
    let log_likelihood = trials.log_likelihood(&point.score, &all_rows);
    let found = trials.parameters.iter().enumerate().map(|(j, parameter)| Found {
        parameter: parameter.clone(),
        factor: math::exp(point.theta[j]),
        sigma: sigmas[j],
        is_refuted: refuted.contains(&j),
    });
    let found: Vec<Found> = found.collect();
    if trials.is_thinned() {
        trials.thinning = vec![Vec::new(); logs.len()];
        let whole = trials.at(&point.theta)?;
        for (own, whole) in independence.iter_mut().zip(white::judge(&design, &trials, &whole)) {
            own.overweighted = whole.overweighted;
        }
    }
    Ok(Tuned {
        found,
        log_likelihood,
        nats,
        unseen,
        runs: runs.load(Ordering::Relaxed),
        has_converged: point.has_converged,
        independence,
    })
}

/// The 1σ of the logarithm of a parameter before the log is seen: a factor of e³ = 20 either way.
const PRIOR: f64 = 3.0;
/// A variance v has the 1σ 2σv, if σ is the 1σ of the logarithm of its root. Above this σ, 0 lies within 1.96 of them.
const DOUBT: f64 = 0.255;
/// A declared value is refuted if keeping it costs a likelihood that chance alone costs with this probability.
const CHANCE: f64 = 0.05;

/// The end of a search.
struct End {
    point: Point,
    independence: Vec<Independence>,
    /// The 1σ of the logarithm of each parameter.
    sigmas: Vec<f64>,
    /// The parameters that are not identifiable, and do not keep their declared value.
    refuted: Vec<usize>,
    /// Each part of the logs, with the innovations that the noises of the other parts give.
    unseen: Vec<(Part, Score)>,
}

/// Finds the maximum with rows so thin that innovations are white, and that fewer rows give the same noises.
fn search(trials: &mut Trials<'_>, design: &Design, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<End, Diagnostics> {
    let mut theta = vec![nearest(trials)?; trials.parameters.len()];
    let mut has_returned = false;
    let mut point = loop {
        let point = highest(trials, theta, progress)?;
        let independence = white::judge(design, trials, &point.score);
        theta = point.theta.clone();
        if white::thin(trials, design, &independence, &point.score)? {
            continue;
        }
        // From far off, innovations may have been dependent only because of the start.
        if !has_returned && trials.is_thinned() {
            has_returned = true;
            trials.thinning = vec![Vec::new(); trials.logs.len()];
            continue;
        }
        break point;
    };
    loop {
        let before = trials.thinning.clone();
        if trials.is_at_its_end() || !white::thin_all(trials, design, &point.score) {
            break;
        }
        let other = highest(trials, point.theta.clone(), progress)?;
        if agree(&point, &other, trials.settings.false_refusal) {
            trials.thinning = before;
            break;
        }
        point = other;
    }
    keep(trials, design, point, progress)
}

/// The maximum near `theta`, with a prior for the parameters that need one.
fn highest(trials: &Trials<'_>, theta: Vec<f64>, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<Point, Diagnostics> {
    let d = trials.parameters.len();
    let weight = math::powi(trials.settings.prior.unwrap_or(PRIOR), -2);
    let start = Start {
        theta,
        free: (0..d).collect(),
        prior: vec![weight; d],
        known: None,
    };
    let point = climb(trials, start, progress)?;
    if trials.settings.prior.is_some() {
        return Ok(point);
    }
    // The wide prior only serves parameters that the log does not identify.
    let sigmas = point.sigmas().into_iter();
    let prior: Vec<f64> = sigmas.map(|sigma| if sigma > 1.0 { weight } else { 0.0 }).collect();
    climb(trials, point.again((0..d).collect(), prior), progress)
}

/// Whether the noises that half of the rows give are those of all rows, up to chance. If an error of a sensor lasts, its
/// innovations may be white, because the estimate follows the error. Over a longer time it shows, and the noise that is
/// found grows with the time between rows.
///
/// Source     Hausman 1978 (Econometrica 46, 1251): σ² of the difference is that of the half less that of the whole
fn agree(all: &Point, half: &Point, probability: f64) -> bool {
    let each = all.theta.iter().zip(all.sigmas()).zip(half.theta.iter().zip(half.sigmas()));
    let known: Vec<f64> = each
        .filter(|((_, sigma), (_, sigma_half))| *sigma <= DOUBT && *sigma_half <= DOUBT)
        // Blocks of time determine a variance to a third. Half of the rows have twice the variance of all.
        .map(|((theta, sigma), (half, sigma_half))| {
            let variance = sigma_half * sigma_half;
            math::powi(half - theta, 2) / (variance - sigma * sigma).max(0.5 * variance)
        })
        .collect();
    let limit = chi_square_quantile(1.0 - probability / known.len().max(1) as f64, 1.0);
    known.iter().all(|square| *square <= limit)
}

/// The common factor of all noises, in steps of three, that explains the innovations best. If all noises are far too
/// small, gates reject good rows, and slopes lead nowhere.
fn nearest(trials: &Trials<'_>) -> Result<f64, Diagnostics> {
    const STEP: f64 = 1.1;
    let at = |common: f64| trials.at(&vec![common; trials.parameters.len()]);
    let (declared, below, above) = (at(0.0)?, at(-STEP)?, at(STEP)?);
    let (down, up) = (trials.gain(&declared, &below, &all_rows), trials.gain(&declared, &above, &all_rows));
    if down <= 0.0 && up <= 0.0 {
        return Ok(0.0);
    }
    let (mut best, mut score, step) = if up > down { (STEP, above, STEP) } else { (-STEP, below, -STEP) };
    loop {
        let next = at(best + step)?;
        if trials.gain(&score, &next, &all_rows) <= 0.0 || trials.is_at_its_end() {
            return Ok(best);
        }
        (best, score) = (best + step, next);
    }
}

fn all_rows(_: usize, _: f64) -> bool {
    true
}

/// Gives parameters that are not identifiable their declared value, and finds the others anew. If that costs more
/// likelihood than chance does, the parameter that is farthest from its declared value does not keep it.
fn keep(trials: &Trials<'_>, design: &Design, mut point: Point, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<End, Diagnostics> {
    let d = trials.parameters.len();
    let mut sigmas = point.sigmas();
    for (j, sigma) in sigmas.iter_mut().enumerate() {
        if *sigma > DOUBT && *sigma <= 1.0 && !is_needed(trials, &point, j, progress)? {
            *sigma = f64::INFINITY;
        }
    }
    let best = trials.log_likelihood(&point.score, &all_rows);
    let mut refuted = Vec::new();
    loop {
        let kept: Vec<usize> = (0..d).filter(|j| sigmas[*j] > 1.0 && !refuted.contains(j)).collect();
        if kept.is_empty() {
            break;
        }
        let pinned: Vec<(usize, f64)> = kept.iter().map(|j| (*j, 0.0)).collect();
        let other = climb(trials, point.pinned(&pinned), progress)?;
        let cost = best - trials.log_likelihood(&other.score, &all_rows);
        if cost <= 0.5 * chi_square_quantile(1.0 - CHANCE, kept.len() as f64) {
            point = other;
            break;
        }
        let far = |j: &usize| point.theta[*j].abs();
        refuted.extend(kept.iter().copied().max_by(|a, b| far(a).total_cmp(&far(b))));
    }
    let (point, unseen) = simplest(trials, point, &sigmas, progress)?;
    Ok(End {
        independence: white::judge(design, trials, &point.score),
        point,
        sigmas,
        refuted,
        unseen,
    })
}

/// The innovations of each part with the noises that the other parts give.
fn unseen(trials: &Trials<'_>, point: &Point) -> Result<Vec<(Part, Score)>, Diagnostics> {
    let parts = point.score.parts(trials.settings.folds).into_iter();
    parts.map(|part| Ok((part, trials.at(&point.without(&part))?))).collect()
}

/// Gives a noise its declared value back, unless the value that was found gains more likelihood on unseen parts than the
/// 1σ of this gain, by blocks of time.
///
/// Source     Breiman, Friedman, Olshen, Stone 1984, §3.4.3: of models within one standard error, the simplest
fn simplest(
    trials: &Trials<'_>,
    mut point: Point,
    sigmas: &[f64],
    progress: &(dyn Fn(u64, f64) + Sync),
) -> Result<(Point, Vec<(Part, Score)>), Diagnostics> {
    /// So many 1σ from its declared value a noise gains 50 nats, on any part.
    const CLEAR: f64 = 10.0;
    let mut best = unseen(trials, &point)?;
    let far = |j: &usize| (point.theta[*j] / sigmas[*j]).abs();
    let mut doubtful: Vec<usize> = point
        .free()
        .iter()
        .copied()
        .filter(|j| sigmas[*j] <= 1.0 && far(j) < CLEAR)
        .collect();
    doubtful.sort_by(|a, b| far(a).total_cmp(&far(b)));
    for j in doubtful {
        let other = climb(trials, point.pinned(&[(j, 0.0)]), progress)?;
        let theirs = unseen(trials, &other)?;
        let pairs = theirs.iter().zip(&best);
        let mut rows: Vec<(f64, f64)> = pairs
            .flat_map(|((part, declared), (_, found))| trials.gains(declared, found, &|log, time| part.holds(log, time)))
            .collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let gain = difference(None, &rows);
        if gain.nats <= if gain.sigma.is_nan() { 0.0 } else { gain.sigma } {
            (point, best) = (other, theirs);
        }
    }
    Ok((point, best))
}

/// Whether the log refutes that a noise is absent: a twentieth of it, with the others found anew, costs more likelihood
/// than chance does. The information at a maximum does not say this of a noise that is small.
fn is_needed(trials: &Trials<'_>, point: &Point, j: usize, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<bool, Diagnostics> {
    let without = climb(trials, point.pinned(&[(j, point.theta[j] - PRIOR)]), progress)?;
    let cost = trials.log_likelihood(&point.score, &all_rows) - trials.log_likelihood(&without.score, &all_rows);
    Ok(cost > 0.5 * chi_square_quantile(1.0 - CHANCE, 1.0))
}
