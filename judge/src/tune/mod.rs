//! Noises of a design from its innovations, without a truth.
//!
//! ```text
//! parameters θ (logarithms of factors) ──▶ d + 1 runs ──▶ innovations r, L of each row, S = L Lᵀ
//!        ▲                                                        │ ln p(r | S), its slope, its information
//!        └──────────── Fisher scoring, with a damped step ◀───────┘
//! ```
//!
//! The likelihood of a run is Σ ln p(rₖ | Sₖ) over the rows of sensors with an instrument, from alignment on. The rows of
//! a gated sensor count with a density that has a tail, the rejected rows as well. Rows of two runs are
//! matched by their number.
//!
//! The likelihood assumes that innovations are independent. So the rows of a sensor are thinned until their neighbours
//! are white. If they are then too few, nothing is tuned. A parameter with a 1σ of its logarithm above one is not
//! identifiable by the log, and keeps its declared value. The result is judged on parts of the log that it was not
//! found on.
//!
//! Source     Gupta, Mehra 1974 (IEEE TAC 19(6), 774): maximum likelihood by Fisher scoring over the innovations
//! Not here   drift in outages, and errors against a reference: the runs of the result show them

mod density;
mod fisher;
mod parameter;
mod record;
mod white;

pub use parameter::Parameter;
pub use white::Independence;

use self::density::Density;
use self::fisher::Point;
use fusion::config::{Diagnostic, Diagnostics, Document, Edit};
use fusion::design::{Design, Named, SensorDesign};
use fusion::run::Options;
use std::sync::atomic::{AtomicU64, Ordering};

/// A recorded log, or a simulated world, with its design.
#[derive(Debug)]
pub struct Log {
    /// The design, with its variants and values.
    pub document: Document,
    /// Where its data are.
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
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            settle: 0.0,
            folds: 4,
            most_runs: 400,
            false_refusal: 1e-3,
        }
    }
}

/// The result for a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The parameter.
    pub parameter: Parameter,
    /// Its value over the declared value; 1 if it is not identifiable.
    pub factor: f64,
    /// The 1σ of the logarithm of the factor.
    pub sigma: f64,
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
        let width = (NORMAL_95 * self.sigma).exp();
        (self.factor / width, self.factor * width)
    }

    /// The edit of the design, with as many digits as its σ supports; `None` if it is not identifiable.
    #[must_use]
    pub fn edit(&self) -> Option<Edit> {
        self.is_identifiable().then(|| self.parameter.times(self.factor, Some(3)))
    }
}

/// The quantile of the normal distribution for 95 % around the mean.
const NORMAL_95: f64 = 1.959_964;

/// The result of a tuning.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// The parameters, in their order.
    pub found: Vec<Found>,
    /// The gain of the likelihood over the declared design, on the rows that it was found on.
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
        parameters: parameters.clone(),
        densities: densities(&design),
        thinning: vec![Vec::new(); logs.len()],
        settings,
        runs: &runs,
    };
    let End {
        point,
        mut independence,
        unknown,
    } = search(&mut trials, &design, progress)?;
    let (nats, unseen) = gains(&trials, &point)?;
    let known: Vec<(&Parameter, (f64, f64))> = trials
        .parameters
        .iter()
        .zip(point.theta.iter().copied().zip(point.sigmas()))
        .collect();
    let found = parameters.iter().map(|parameter| {
        let known = known.iter().find(|(p, _)| *p == parameter).map(|(_, known)| *known);
        let lost = unknown.iter().find(|(p, _)| p == parameter);
        let (theta, sigma) = known.unwrap_or((0.0, lost.map_or(f64::INFINITY, |(_, sigma)| *sigma)));
        Found {
            parameter: parameter.clone(),
            factor: if sigma <= 1.0 { theta.exp() } else { 1.0 },
            sigma,
        }
    });
    let found: Vec<Found> = found.collect();
    trials.thinning = vec![Vec::new(); logs.len()];
    let whole = Point::of(point.theta.clone(), trials.at(&point.theta)?);
    for (own, whole) in independence.iter_mut().zip(white::judge(&design, &trials, &whole)) {
        own.overweighted = whole.overweighted;
    }
    Ok(Tuned {
        found,
        nats,
        unseen,
        runs: runs.load(Ordering::Relaxed),
        has_converged: point.has_converged,
        independence,
    })
}

/// The end of a search.
struct End {
    point: Point,
    independence: Vec<Independence>,
    /// The parameters that are not identifiable, with the 1σ of their logarithm.
    unknown: Vec<(Parameter, f64)>,
}

/// Finds the maximum with rows so thin that innovations are white, over the parameters that are then identifiable.
fn search(trials: &mut Trials<'_>, design: &Design, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<End, Diagnostics> {
    let mut unknown: Vec<(Parameter, f64)> = Vec::new();
    let mut theta = vec![0.0; trials.parameters.len()];
    let mut has_returned = false;
    loop {
        let point = fisher::climb(trials, theta.clone(), progress)?;
        let independence = white::judge(design, trials, &point);
        theta.clone_from(&point.theta);
        if white::thin(trials, design, &independence, &point)? {
            continue;
        }
        // From far off, innovations may have been dependent only because of the start.
        if !has_returned && trials.is_thinned() {
            has_returned = true;
            trials.thinning = vec![Vec::new(); trials.logs.len()];
            continue;
        }
        // A parameter that is not identifiable has its declared value. The others are found anew with that value.
        let sigma = point.sigmas();
        let is_known = |j: &usize| sigma[*j] <= 1.0;
        let known: Vec<usize> = (0..theta.len()).filter(is_known).collect();
        if known.len() == theta.len() || known.is_empty() {
            return Ok(End {
                point,
                independence,
                unknown,
            });
        }
        let lost = (0..theta.len()).filter(|j| !is_known(j));
        unknown.extend(lost.map(|j| (trials.parameters[j].clone(), sigma[j])));
        trials.parameters = known.iter().map(|j| trials.parameters[*j].clone()).collect();
        theta = known.iter().map(|j| theta[*j]).collect();
    }
}

/// The gain over the declared values on all rows, and on each part with what the other parts give.
fn gains(trials: &Trials<'_>, point: &Point) -> Result<(f64, Vec<f64>), Diagnostics> {
    let base = trials.at(&vec![0.0; point.theta.len()])?;
    let all = trials.gain(&base, &point.score, &|_, _| true);
    let each = trials.parts(&base).into_iter().map(|part| {
        let other = trials.at(&point.without(&part))?;
        Ok(trials.gain(&base, &other, &|log, time| part.holds(log, time)))
    });
    Ok((all, each.collect::<Result<_, Diagnostics>>()?))
}

/// The densities of the sensors of a design, in their order; `None` for a sensor that is not judged.
fn densities(design: &Design) -> Vec<Option<Density>> {
    let of = |sensor: &Named<SensorDesign>| {
        let rows = sensor.block.model.noise().len();
        parameter::is_real(design, sensor).then(|| match (&sensor.block.gate, &sensor.block.loss) {
            (None, None) => Density::Normal,
            _ => Density::with_outliers(rows),
        })
    };
    design.sensors.iter().map(of).collect()
}

/// A part of a log in time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Part {
    log: usize,
    from: f64,
    to: f64,
}

impl Part {
    fn holds(&self, log: usize, time: f64) -> bool {
        log == self.log && (self.from..self.to).contains(&time)
    }
}

/// Runs of the logs with other values.
struct Trials<'a> {
    logs: &'a [Log],
    parameters: Vec<Parameter>,
    densities: Vec<Option<Density>>,
    /// For each log: the streams of which one row in so many is used.
    thinning: Vec<Vec<white::Thinned>>,
    settings: &'a Settings,
    runs: &'a AtomicU64,
}

impl Trials<'_> {
    fn is_thinned(&self) -> bool {
        self.thinning.iter().any(|log| !log.is_empty())
    }
}
