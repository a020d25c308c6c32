//! Noises of a design from its innovations, without a truth.
//!
//! ```text
//! parameters θ (logarithms of factors) ──▶ d + 1 runs ──▶ innovations r, L of each row, S = L Lᵀ
//!        ▲                                                        │ how each changes with θ; slope, information
//!        └── a step of Fisher scoring, one run, Broyden's update ◀┘
//! ```
//!
//! Which rows count, and with which density, is as for the [likelihood](crate::likelihood) of a result, with two
//! exceptions: the time from which they count is that of the declared noises, at each θ, and a filter that never aligns has
//! no rows that count. Rows of two runs are matched by their number.
//!
//! The likelihood assumes that innovations are independent. So the rows of a sensor are thinned until their neighbours
//! are white. If they are then too few, nothing is tuned. The result is judged on parts of the log that it was not found
//! on.
//!
//! A parameter with a 1σ of its logarithm above one is not identifiable by the log. Its declared value is a prior, and
//! its uncertainty widens the intervals of the others. It keeps its declared value, unless the log refutes this value.
//!
//! Source     Gupta, Mehra 1974 (IEEE TAC 19(6), 774): maximum likelihood by Fisher scoring over the innovations
//! Not here   errors against a reference: the runs of the result show them

mod climb;
mod hidden;
mod keep;
mod outage;
mod parameter;
mod record;
mod sensitivity;
mod slow;
mod structure;
#[cfg(test)]
mod tests;
mod trials;
mod white;

use fusion_core::math;
pub use hidden::{Hidden, Share, Unobserved, hidden};
pub use outage::{Coasting, Outage};
pub use parameter::Parameter;
pub use slow::SlowError;
pub use structure::{Advise, Proposal, structure};
pub use white::Independence;

use self::climb::{Point, Start, climb};
use self::keep::{DOUBT, keep};
use self::trials::{Part, Score, Trials};
use crate::likelihood::{densities, densities_of_stages};
use core::ops::Range;
use fusion::config::{Diagnostic, Diagnostics, Document, Edit};
use fusion::design::Design;
use fusion::run::Options;
use fusion_core::consistency::chi_square_quantile;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

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
    /// No iteration of a search begins after this number of its runs.
    pub most_runs: u64,
    /// Innovations are called dependent at this probability of doing so wrongly, for each sensor.
    pub false_refusal: f64,
    /// The 1σ of the logarithm of each declared value, by its data sheet: the declared values are a prior. Without it, a
    /// wide prior applies to the parameters that the log does not identify, and to no other.
    pub prior: Option<f64>,
    /// Outages over which the tuned filter has to predict: their rows are part of the likelihood, and of the judges.
    pub outage: Option<Outage>,
    /// The share of parts of a log in which σ of a found noise has to hold, if the noise of a sensor changes along the log
    /// more than chance allows. Without it, the noise is that of the whole.
    pub cover: Option<f64>,
    /// Designs with values of the parameters from which the search starts too. The best end counts.
    pub starts: Vec<Document>,
    /// The ends of the searches from all starts, if [`searches`] found them before, perhaps in several processes.
    pub searched: Vec<Searched>,
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
            outage: None,
            cover: None,
            starts: Vec::new(),
            searched: Vec::new(),
            stop: None,
        }
    }
}

/// The end of a search from one start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Searched {
    /// The logarithms of the factors on the declared values.
    pub theta: Vec<f64>,
    /// Runs made.
    pub runs: u64,
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
    /// Whether the log contradicts the declared value of a parameter that is not identifiable. The factor is then a limit:
    /// the log refutes all values between it and the declared one, and none beyond it.
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
    /// The prediction over outages, by sensor; empty without outages.
    pub coasting: Vec<Coasting>,
    /// The sensors that lose more likelihood than chance does, on parts that were not seen.
    pub losing: Vec<String>,
    /// Whether the prediction over outages loses more likelihood than chance does.
    pub is_worse_after_outages: bool,
    /// Runs made.
    pub runs: u64,
    /// Whether the search ended at a maximum, not at the limit of runs.
    pub has_converged: bool,
    /// The independence of the innovations of each sensor that counted.
    pub independence: Vec<Independence>,
}

impl Tuned {
    /// Nothing is tuned, because no rows are independent.
    fn refused(independence: Vec<Independence>, runs: u64) -> Self {
        Self {
            found: Vec::new(),
            log_likelihood: 0.0,
            nats: 0.0,
            unseen: Vec::new(),
            coasting: Vec::new(),
            losing: Vec::new(),
            is_worse_after_outages: false,
            runs,
            has_converged: true,
            independence,
        }
    }

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

    /// Whether the result is better where it was not asked, for no sensor worse, and not worse after outages.
    #[must_use]
    pub fn is_better(&self) -> bool {
        self.is_sound() && self.gain() > 0.0 && self.losing.is_empty() && !self.is_worse_after_outages
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
    let (design, mut trials) = prepare(logs, patterns, settings)?;
    if trials.densities.iter().all(Option::is_none) {
        trials.densities = densities_of_stages(&design);
        return Ok(Tuned::refused(white::of_stages(&design, &trials)?, trials.runs()));
    }
    trials.fix_rows_and_outages(&design)?;
    let End {
        point,
        mut independence,
        sigmas,
        refuted,
        mut unseen,
    } = search(&mut trials, &design, progress)?;
    let declared = trials.at(&vec![0.0; point.theta.len()])?;
    let nats = trials.gain(&declared, &point.score, &all_rows);
    let wider = wider(&trials.parameters, &point, settings, &independence);
    if wider.iter().any(|wider| *wider > 0.0) {
        for (part, score) in &mut unseen {
            let theta = point.without(part).into_iter().zip(&wider).map(|(theta, wider)| theta + wider);
            *score = trials.at(&theta.collect::<Vec<f64>>())?;
        }
    }
    let coasting = outage::coasting(&design, &trials, &declared, &unseen);
    let gains = keep::gains(&trials, std::iter::repeat(&declared), &unseen);
    let is_worse_after_outages = outage::is_worse(&gains, trials.outage());
    let losing = keep::losing(trials.densities.len(), &gains)
        .into_iter()
        .map(|sensor| design.sensors[sensor].name.clone())
        .collect();
    let of_part = |(part, score): &(Part, Score)| trials.gain(&declared, score, &|log, time| part.holds(log, time));
    let unseen: Vec<f64> = unseen.iter().map(of_part).collect();
    let log_likelihood = trials.log_likelihood(&point.score, &all_rows);
    let found = trials.parameters.iter().enumerate().map(|(j, parameter)| Found {
        parameter: parameter.clone(),
        factor: math::exp(point.theta[j] + wider[j]),
        sigma: sigmas[j],
        is_refuted: refuted.contains(&j),
    });
    let found: Vec<Found> = found.collect();
    overweigh_all(&mut trials, &design, &point, &mut independence)?;
    Ok(Tuned {
        found,
        log_likelihood,
        nats,
        unseen,
        coasting,
        losing,
        is_worse_after_outages,
        runs: trials.runs(),
        has_converged: point.has_converged,
        independence,
    })
}

/// The searches of these numbers: number 0 begins at the common factor of all noises, and each further one at the next of
/// [`Settings::starts`]. With all of them in [`Settings::searched`], [`tune`] has the result of one process.
///
/// # Errors
/// As [`tune`]; no rows to search with.
pub fn searches(
    logs: &[Log],
    patterns: &[String],
    settings: &Settings,
    numbers: Range<u64>,
    progress: &(dyn Fn(u64, f64) + Sync),
) -> Result<Vec<Searched>, Diagnostics> {
    let (design, mut trials) = prepare(logs, patterns, settings)?;
    if trials.densities.iter().all(Option::is_none) {
        return Err(Diagnostic::error("no sensor has a noise that can be tuned, so there is nothing to search").into());
    }
    trials.fix_rows_and_outages(&design)?;
    numbers.map(|number| searched(&trials, &design, number, progress)).collect()
}

/// The design, and trials of it.
fn prepare<'a>(logs: &'a [Log], patterns: &[String], settings: &'a Settings) -> Result<(Design, Trials<'a>), Diagnostics> {
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
    check_starts(&design, &parameters, &settings.starts)?;
    let trials = Trials::new(logs, parameters, densities(&design), settings);
    Ok((design, trials))
}

/// Judges by all rows how much the noises overweight them, if the search used a part of them.
fn overweigh_all(trials: &mut Trials<'_>, design: &Design, point: &Point, independence: &mut [Independence]) -> Result<(), Diagnostics> {
    if trials.is_thinned() {
        trials.thinning = vec![Vec::new(); trials.logs.len()];
        let whole = trials.at(&point.theta)?;
        for (own, whole) in independence.iter_mut().zip(white::judge(design, trials, &whole)) {
            own.overweighted = whole.overweighted;
        }
    }
    Ok(())
}

/// By how much the logarithm of each parameter grows, so that the found noise of a sensor holds in a declared share of parts.
fn wider(parameters: &[Parameter], point: &Point, settings: &Settings, independence: &[Independence]) -> Vec<f64> {
    let of = |(parameter, theta): (&Parameter, &f64)| {
        let is_of =
            |own: &&Independence| parameter.path.starts_with(&format!("sensor.{}.", own.sensor)) && parameter.path.ends_with("noise");
        let varies = independence.iter().find(is_of).map_or(1.0, |own| own.varies);
        if settings.cover.is_some() && *theta != 0.0 {
            math::ln(varies)
        } else {
            0.0
        }
    };
    parameters.iter().zip(&point.theta).map(of).collect()
}

/// The 1σ of the logarithm of a parameter before the log is seen: a factor of e³ = 20 either way.
const PRIOR: f64 = 3.0;

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
    let mut theta = start(trials, design, progress)?;
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

/// Refuses a start with a mistake, and one that is the declared design.
fn check_starts(design: &Design, parameters: &[Parameter], starts: &[Document]) -> Result<(), Diagnostics> {
    for other in starts {
        Design::read(other.clone())?;
        let is_other = |parameter: &Parameter| parameter.over_declared(&design.document, other).is_some_and(|theta| theta != 0.0);
        if !parameters.iter().any(is_other) {
            let paths: Vec<&str> = parameters.iter().map(|parameter| &*parameter.path).collect();
            let error = Diagnostic::error("a start has the declared value of every noise that is tuned");
            return Err(error.help(format!("change one of `{}`", paths.join("`, `"))).into());
        }
    }
    Ok(())
}

/// The best of the starts: the common factor of all noises, or the end of a search from declared starts.
fn start(trials: &Trials<'_>, design: &Design, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<Vec<f64>, Diagnostics> {
    let Settings {
        starts, searched: known, ..
    } = trials.settings;
    let ends = if starts.is_empty() {
        return Ok(vec![nearest(trials)?; trials.parameters.len()]);
    } else if known.is_empty() {
        let numbers = 0..=starts.len() as u64;
        numbers
            .map(|number| searched(trials, design, number, progress))
            .collect::<Result<_, _>>()?
    } else {
        trials.count(known.iter().map(|end| end.runs).sum());
        known.clone()
    };
    let mut best: Option<(Score, Vec<f64>)> = None;
    for Searched { theta, .. } in ends {
        let score = trials.at(&theta)?;
        if best.as_ref().is_none_or(|(best, _)| trials.gain(best, &score, &all_rows) > 0.0) {
            best = Some((score, theta));
        }
    }
    trials.begin();
    Ok(best.map(|(_, theta)| theta).unwrap_or_default())
}

/// The search from the start of this number.
fn searched(trials: &Trials<'_>, design: &Design, number: u64, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<Searched, Diagnostics> {
    let before = trials.runs();
    trials.begin();
    let other = number
        .checked_sub(1)
        .and_then(|k| trials.settings.starts.get(usize::try_from(k).ok()?));
    let theta = match other {
        None => vec![nearest(trials)?; trials.parameters.len()],
        Some(other) => {
            let of = |parameter: &Parameter| parameter.over_declared(&design.document, other).unwrap_or(0.0);
            trials.parameters.iter().map(of).collect()
        }
    };
    let theta = highest(trials, theta, progress)?.theta;
    let runs = trials.runs() - before;
    Ok(Searched { theta, runs })
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
