//! Finds the fixed parameters that explain the data best, one after the other.

use super::course::{Course, Estimate, Gain, Limits, Trial};
use super::parameter::{Other, SHORTEST, Start, Tried, of_design};
use super::told::{self, Verdict};
use crate::frames::declared::{Declaration, others};
use crate::frames::judge::{Comparison, Judged, Step};
use crate::frames::mistake::declared_offset;
use fusion::config::{Diagnostics, Document, Node};
use fusion::design::{Design, Named, SensorDesign};
use fusion::observe::RunObserver;
use fusion::run::{Options, Smoothing, examine, run_sharing};
use fusion_models::sim::SharedCourse;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The largest number of parameters to report. Each search round first corrects the parameters found before.
const ROUNDS: usize = 4;
/// The gain that a parameter alone needs, in −2 ln of the density of all innovations; 36 would be 6σ.
const LEAST: f64 = 40.0;
/// The gain that a start far away needs.
const FAR: f64 = 200.0;
/// The least share of the parts of the log that must improve.
const SHARE: f64 = 0.6;
/// A latency that moved further than this is linearised again \[s\], at most `TIMES` times.
const AGAIN: f64 = 0.05;
const TIMES: usize = 4;

/// A latency is linearised at its start, so its loss is known only at the end.
const SHARED: Limits = Limits {
    share: SHARE,
    loss: f64::INFINITY,
};
/// A trial stops when it has lost as much as it has to gain.
const SOON: Limits = Limits { share: SHARE, loss: FAR };

/// A mistake, and the gain from its correction.
pub(super) struct Cause<'a> {
    pub(super) what: What<'a>,
    gain: Gain,
    /// The assignments that correct it.
    sets: Vec<String>,
}

/// The kind of mistake.
pub(super) enum What<'a> {
    Parameter(Box<Tried<'a>>, Start, Estimate),
    Columns(Written),
    /// The stamps of the process are wrong by this number of seconds; `than` is the sensor that would otherwise be
    /// early.
    Clock {
        source: usize,
        by: f64,
        than: String,
    },
}

/// A channel that should be declared differently.
#[derive(Clone)]
pub(super) struct Written {
    pub(super) source: usize,
    pub(super) channel: String,
    pub(super) other: Declaration,
}

/// All parameters as states at once.
#[derive(Default)]
struct Joint {
    /// The index of each parameter with its estimate.
    estimates: Vec<(usize, Estimate)>,
    is_astray: bool,
}

/// The estimates of parameters tried alone; they explain why a parameter is not reported.
type Alone = HashMap<String, Estimate>;

struct Search<'a> {
    design: &'a Design,
    options: Options,
    /// The design, with all corrections so far.
    document: Document,
    tried: Vec<Tried<'a>>,
    alone: Alone,
    progress: &'a (dyn Fn(Step<'_>) + Sync),
}

/// Estimates the parameters that a design declares as fixed, and compares them with the declaration.
pub(in super::super) fn judge(
    design: &Design,
    options: &Options,
    progress: &(dyn Fn(Step<'_>) + Sync),
    found: &mut Judged,
) -> Result<(), Diagnostics> {
    let mut search = Search {
        design,
        options: Options {
            data: options.data.clone(),
            base: options.base.clone(),
            seed: options.seed,
            smooth: Smoothing::Never,
            ..Options::default()
        },
        document: design.document.clone(),
        tried: of_design(design),
        alone: Alone::new(),
        progress,
    };
    if search.tried.is_empty() {
        return Ok(());
    }
    let (mut joint, mut last, mut causes) = (Joint::default(), None, Vec::new());
    for round in 0..=ROUNDS {
        search.begun("the filter as declared, and with all fixed parameters as states", 0, 1);
        let (base, states) = rayon::join(|| search.course(&[]), || search.joint());
        let Some(base) = base? else { break };
        joint = states?;
        let cause = search.best(&base, &joint).filter(|_| round < ROUNDS);
        last = Some(base);
        let Some(cause) = cause else { break };
        if cause.sets.iter().any(|set| search.document.set(set).is_err()) {
            break;
        }
        if let What::Parameter(told, ..) = &cause.what {
            let name = told.name();
            search.tried.retain(|tried| tried.name() != name && !told.is_shared_by(tried));
        }
        causes.push(cause);
    }
    let base = last.unwrap_or_default();
    // Takes each estimate from the last run, which corrects all of them. The estimate alone also absorbed what later
    // ones explain.
    for cause in &mut causes {
        cause.refine(&base);
        told::tell(design, &cause.what, found);
    }
    search.list(&joint, &base, found);
    Ok(())
}

/// The comparison if no parameter was tried.
pub(in super::super) fn untried(why: &str) -> Comparison {
    told::listed("fixed parameters".to_owned(), 0.0, why.to_owned())
}

impl<'a> Search<'a> {
    /// A run with these changes; `None` if they do not make a valid design.
    fn course(&self, sets: &[String]) -> Result<Option<Course>, Diagnostics> {
        let mut course = Course::default();
        let is_whole = self.run(sets, &mut course)?;
        Ok(is_whole.then_some(course))
    }

    /// The same for a trial that stops early if it can no longer reach the limits; then it also returns `None`.
    fn trial(&self, base: &Course, limits: Limits, sets: &[String]) -> Option<Course> {
        let mut trial = Trial::new(base, limits);
        let ran = self.run(sets, &mut trial);
        (ran == Ok(true)).then_some(trial.course)
    }

    /// Returns true if the changes make a valid design.
    fn run(&self, sets: &[String], observer: &mut dyn RunObserver) -> Result<bool, Diagnostics> {
        let mut document = self.document.clone();
        if sets.iter().try_for_each(|set| document.set(set)).is_err() {
            return Ok(false);
        }
        let Ok(mut design) = examine::build(document) else {
            return Ok(false);
        };
        // The runs are not scored.
        design.reference = None;
        run_sharing(&design, &self.options, &SharedCourse::default(), &mut [observer])?;
        Ok(true)
    }

    fn begun(&self, what: &str, done: usize, all: usize) {
        (self.progress)(Step { what, done, all });
    }

    /// Runs independent jobs on all cores; the results keep the order of the jobs.
    fn each<J: Sync, T: Send>(&self, jobs: &[J], what: impl Fn(&J) -> String + Sync, one: impl Fn(&J) -> T + Sync) -> Vec<T> {
        let done = AtomicUsize::new(0);
        let one = |job: &J| {
            self.begun(&what(job), done.load(Ordering::Relaxed), jobs.len());
            let out = one(job);
            self.begun(&what(job), done.fetch_add(1, Ordering::Relaxed) + 1, jobs.len());
            out
        };
        jobs.par_iter().map(one).collect()
    }

    /// All parameters as states at once. If they do not make a valid design, or lead the filter astray, the arms alone.
    fn joint(&self) -> Result<Joint, Diagnostics> {
        let numbered = || self.tried.iter().enumerate().filter(|(_, tried)| tried.is_joint());
        let all: Vec<(usize, &Tried<'_>)> = numbered().collect();
        let arms: Vec<(usize, &Tried<'_>)> = numbered().filter(|(_, tried)| tried.is_arm()).collect();
        let mut is_astray = false;
        for tried in [all, arms].into_iter().filter(|tried| !tried.is_empty()) {
            let sets: Vec<String> = tried.iter().flat_map(|(_, t)| t.assignments(&t.start())).collect();
            let Some(course) = self.course(&sets)? else { continue };
            let estimates = tried.iter().filter_map(|(i, t)| Some((*i, course.estimate(&t.name(), None)?)));
            let estimates: Vec<(usize, Estimate)> = estimates.collect();
            if !estimates.iter().any(|(_, e)| e.is_astray()) {
                return Ok(Joint {
                    estimates,
                    is_astray: false,
                });
            }
            is_astray = true;
        }
        Ok(Joint {
            estimates: Vec::new(),
            is_astray,
        })
    }

    /// The suspect that explains the data best; `None` if no suspect does.
    fn best(&mut self, base: &Course, joint: &Joint) -> Option<Cause<'a>> {
        if let Some(cause) = self.unit(base) {
            return Some(cause);
        }
        let is_astray = |tried: &Tried<'_>| base.estimate(&tried.name(), None).is_some_and(|e| e.is_astray());
        let is_gross = base.is_any_gross();
        let is_suspect = |i: usize, tried: &Tried<'_>| {
            let estimate = joint.estimates.iter().find(|(j, _)| *j == i).map(|(_, e)| e);
            estimate.map_or(joint.is_astray, |e| tried.differs(e) || tried.is_early(e))
        };
        // The design's own states that went astray are tried from far away. If the filter does not follow a sensor, all
        // are.
        let each = self.tried.iter().enumerate();
        let tried: Vec<(Tried<'a>, bool, bool)> = each.map(|(i, t)| (t.clone(), is_suspect(i, t), is_gross || is_astray(t))).collect();
        let mut best: Option<Cause<'a>> = None;
        let mut keep = |cause: Option<Cause<'a>>, more: f64| {
            if let Some(cause) = cause
                && best.as_ref().is_none_or(|best| cause.gain.total > best.gain.total + more)
            {
                best = Some(cause);
            }
        };
        let (mut far, mut earlier) = (Vec::new(), Vec::new());
        let asked: Vec<&(Tried<'a>, bool, bool)> = tried.iter().filter(|(_, is_suspect, is_far)| *is_suspect || *is_far).collect();
        let near = self.each(
            &asked,
            |(tried, ..)| tried.told(),
            |(tried, ..)| tried.is_joint().then(|| self.alone(base, tried, tried.start(), None)).flatten(),
        );
        for ((tried, _, is_far), near) in asked.into_iter().zip(near) {
            if let Some((start, estimate, gain)) = near {
                if *is_far {
                    let declared: Vec<f64> = (0..estimate.value.len()).map(|k| estimate.declared(k)).collect();
                    far.extend(
                        tried
                            .far_starts(declared[0])
                            .into_iter()
                            .map(|start| (tried, start, declared.clone())),
                    );
                }
                if tried.is_earlier(&estimate) {
                    earlier.push((tried, estimate.clone()));
                }
                // A parameter that is already a state of the design gains little: the design's own filter estimates it
                // too.
                if tried.differs(&estimate) && (tried.is_state || gain.total >= LEAST && gain.share >= SHARE) {
                    keep(Some(Cause::of(tried, start, estimate, gain)), 0.0);
                } else {
                    self.alone.insert(tried.name(), estimate);
                }
            } else if *is_far && !tried.is_joint() {
                far.extend(tried.far_starts(0.0).into_iter().map(|start| (tried, start, Vec::new())));
            }
        }
        for cause in self.of_receivers(base, &tried) {
            keep(Some(cause), 0.0);
        }
        // If one sensor would be early, the clock of the process is late. Tries the delay that each sensor gives.
        if let Some((early, _)) = earlier.iter().find(|(tried, estimate)| tried.is_early(estimate)) {
            let clocks = self.each(
                &earlier,
                |_| "the clock of the process".to_owned(),
                |(_, e)| self.clock(base, early, e.difference[0]),
            );
            clocks.into_iter().for_each(|clock| keep(clock, -LEAST));
        }
        for cause in self.of_far_starts(base, far) {
            keep(Some(cause), LEAST);
        }
        if is_gross {
            let columns = self.columns();
            let told = |what: &Written| format!("{} in `{}`", what.other.wrong, what.channel);
            let causes = self.each(&columns, told, |what| self.column(base, what));
            causes.into_iter().for_each(|cause| keep(cause, LEAST));
        }
        best
    }

    /// The causes that are found from starts far away: a parameter, the start, and the declared values.
    fn of_far_starts(&self, base: &Course, far: Vec<(&Tried<'a>, Start, Vec<f64>)>) -> Vec<Cause<'a>> {
        let trials = self.each(
            &far,
            |(tried, ..)| tried.told(),
            |(tried, start, declared)| self.alone(base, tried, start.clone(), Some(declared)),
        );
        let causes = far.into_iter().zip(trials).filter_map(|((tried, Start { is, .. }, _), trial)| {
            let (start, estimate, gain) = trial?;
            let is_other = is != Other::Value || tried.differs(&estimate);
            let is_told = is_other && estimate.is_near() && gain.total >= FAR && gain.share >= SHARE;
            is_told.then(|| Cause::of(tried, Start { is, ..start }, estimate, gain))
        });
        causes.collect()
    }

    /// Sensors of one receiver share a delay. Each sensor alone would contradict the others.
    fn of_receivers(&self, base: &Course, tried: &[(Tried<'a>, bool, bool)]) -> Vec<Cause<'a>> {
        let suspects: Vec<&Tried<'a>> = tried.iter().filter(|(_, is_suspect, _)| *is_suspect).map(|(t, ..)| t).collect();
        let receivers: Vec<Tried<'a>> = suspects.iter().filter_map(|first| first.receiver(&suspects)).collect();
        let late = self.each(&receivers, Tried::told, |tried| self.alone(base, tried, tried.start(), None));
        let causes = receivers.iter().zip(late).filter_map(|(tried, late)| {
            let (start, estimate, gain) = late?;
            let is_told = tried.differs(&estimate) && gain.total >= LEAST && gain.share >= SHARE;
            is_told.then(|| Cause::of(tried, start, estimate, gain))
        });
        causes.collect()
    }

    /// A scale that is a state and moved to another unit or sign by itself.
    fn unit(&self, base: &Course) -> Option<Cause<'a>> {
        self.tried.iter().filter(|tried| tried.is_state).find_map(|tried| {
            let estimate = base.estimate(&tried.name(), None)?;
            let factor = tried.unit(*estimate.value.first()?)?;
            let start = Start {
                is: Other::Factor(factor),
                ..tried.from(factor - 1.0)
            };
            let gain = Gain { total: 0.0, share: 0.0 };
            (estimate.is_astray() && estimate.is_learnt[0]).then(|| Cause::of(tried, start, estimate, gain))
        })
    }

    /// Adds one parameter as a state, from a start. A latency is linearised again at its estimate. If `declared` is
    /// given, the start differs from it and the run has to gain.
    fn alone(&self, base: &Course, tried: &Tried<'_>, mut start: Start, declared: Option<&[f64]>) -> Option<(Start, Estimate, Gain)> {
        let declared_before = declared;
        let mut declared = declared.filter(|d| !d.is_empty()).map(<[f64]>::to_vec);
        for time in 1.. {
            let set = &tried.assignments(&start)[..];
            let course = match declared_before {
                None => self.course(set).ok()??,
                Some(_) if tried.sort.unit == "s" => self.trial(base, SHARED, set)?,
                Some(_) => self.trial(base, SOON, set)?,
            };
            let estimate = course.estimate(&tried.name(), declared.as_deref())?;
            declared.get_or_insert_with(|| (0..estimate.value.len()).map(|k| estimate.declared(k)).collect());
            let is_far = tried.sort.unit == "s" && estimate.away * tried.sort.sigma > AGAIN;
            if !is_far || time == TIMES || estimate.is_astray() {
                return Some((start, estimate, course.gain(base)));
            }
            start = tried.from(estimate.value[0]);
        }
        None
    }

    /// The stamps of the process, shifted by the amount that a sensor would be early.
    fn clock(&self, base: &Course, tried: &Tried<'_>, by: f64) -> Option<Cause<'a>> {
        let name = self.document.root().get("process")?.get("source").and_then(Node::as_str)?;
        let source = self.design.sources.iter().position(|s| s.name == name)?;
        let offset = declared_offset(self.document.root().at(&format!("source.{name}"))?) + by;
        let set = format!("source.{name}.time.offset=\"{offset:.4} s\"");
        let gain = self.trial(base, SOON, std::slice::from_ref(&set))?.gain(base);
        let than = tried.sensor.name.clone();
        (gain.total >= LEAST && gain.share >= SHARE).then_some(Cause {
            what: What::Clock { source, by, than },
            gain,
            sets: vec![set],
        })
    }

    /// Other declarations of the channels that sensors read.
    fn columns(&self) -> Vec<Written> {
        let of = |sensor: &Named<SensorDesign>| {
            // The search for a scale also tries its sign.
            let is_scaled = self.tried.iter().any(|t| t.sensor.name == sensor.name && t.key == "scale");
            let name = sensor.node.get("source").and_then(Node::as_str)?;
            let source = self.design.sources.iter().position(|s| s.name == name)?;
            let channel = sensor.block.model.reading().channels().first()?.name.to_string();
            let table = self.document.root().at(&format!("source.{name}.channels.{channel}"))?;
            let others = others(&channel, table)
                .into_iter()
                .filter(|_| !is_scaled || table.get("column").is_none());
            let written = |other| Written {
                source,
                channel: channel.clone(),
                other,
            };
            Some(others.map(written).collect::<Vec<_>>())
        };
        self.design.sensors.iter().filter_map(of).flatten().collect()
    }

    /// The gain if a channel is declared this way.
    fn column(&self, base: &Course, what: &Written) -> Option<Cause<'a>> {
        let table = format!("source.{}.channels.{}", self.design.sources[what.source].name, what.channel);
        let sets: Vec<String> = what
            .other
            .writes
            .iter()
            .map(|(key, value)| format!("{table}.{key}={value}"))
            .collect();
        let gain = self.trial(base, SOON, &sets)?.gain(base);
        (gain.total >= FAR && gain.share >= SHARE).then(|| Cause {
            what: What::Columns(what.clone()),
            gain,
            sets,
        })
    }

    /// Lists the parameters without a warning.
    fn list(&self, joint: &Joint, base: &Course, found: &mut Judged) {
        if joint.is_astray && joint.estimates.is_empty() && found.mistakes.is_empty() {
            found.comparisons.push(untried(
                "not decided: as states they lead the filter astray, so something else is wrong",
            ));
        }
        let estimates = joint.estimates.iter().map(|(i, e)| (&self.tried[*i], e));
        // Parameters that the data do not determine are only named. Declared arms are always listed.
        let is_listed = |(tried, e): &(&Tried<'_>, &Estimate)| {
            let is_declared_arm = tried.is_arm() && (0..3).any(|k| e.declared(k).abs() >= SHORTEST);
            is_declared_arm || e.is_learnt.contains(&true)
        };
        let (listed, unknown): (Vec<_>, Vec<_>) = estimates.partition(is_listed);
        for (tried, estimate) in listed {
            found
                .comparisons
                .push(tried.unsuspected(estimate, self.alone.get(&tried.name()), base));
        }
        let mut unweighed: Vec<String> = unknown.iter().filter_map(|(tried, _)| tried.unweighed(base)).collect();
        unweighed.dedup();
        let unknown: Vec<String> = unknown.into_iter().map(|(tried, _)| tried.name()).collect();
        if !unknown.is_empty() {
            found.comparisons.push(untried(
                &[vec![format!("these data say too little about {}", unknown.join(", "))], unweighed]
                    .concat()
                    .join("; "),
            ));
        }
    }
}

impl<'a> Cause<'a> {
    /// Takes the estimate of another run, if the start was the declared value or a value from another estimate.
    fn refine(&mut self, base: &Course) {
        if let What::Parameter(tried, start, estimate) = &mut self.what
            && matches!(start.is, Other::Nothing | Other::Value)
        {
            let declared: Vec<f64> = (0..estimate.value.len()).map(|k| estimate.declared(k)).collect();
            if let Some(refined) = base.estimate(&tried.name(), Some(&declared)) {
                *estimate = refined;
            }
        }
    }

    fn of(tried: &Tried<'a>, start: Start, estimate: Estimate, gain: Gain) -> Self {
        Self {
            sets: tried.assignments(&start),
            what: What::Parameter(Box::new(tried.clone()), start, estimate),
            gain,
        }
    }
}

impl Tried<'_> {
    /// The name of the parameter, for messages.
    fn told(&self) -> String {
        format!("`{}` of `{}`", self.key, self.sensor.name)
    }

    /// Returns true if the parameter is tried together with all others, not only from far away.
    fn is_joint(&self) -> bool {
        self.is_judged() || self.is_arm()
    }

    /// Returns true if another value or sign is reported for any axis.
    fn differs(&self, e: &Estimate) -> bool {
        (0..e.difference.len()).any(|k| self.verdict(e, k) != Verdict::Fits)
    }
}
