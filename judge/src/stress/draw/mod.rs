//! A campaign of drawn faults: which, how large, when and how many at once, by a seed and the number of the case.
//!
//! ```text
//! survey ──▶ lot: the faults of case K ──▶ watch: the disturbed run ──▶ judge ──▶ counts
//!                                          watch: the undisturbed run ──▶ baseline ─┘
//! ```
//!
//! | a case is | if |
//! |---|---|
//! | recovered | at the end the error is within 3σ and within twice the undisturbed RMS |
//! | a false good | the health was *good* while the error was beyond 10σ, for 3 s on end |
//! | a false alarm | the health was *degraded* or *lost*, and the error was never large |
//! | late to be good | so it was for long after the error had returned |

mod counts;
mod judge;
mod lot;

pub use counts::{Count, Counts, wilson};
pub use judge::Judged;

use super::catalogue::Catalogue;
use super::{Case, Work, surveyed, watched};
use crate::part::{Kind, Parts, Subject, Unreadable};
use fusion::config::{Diagnostic, Diagnostics, Node};
use fusion::design::Design;
use fusion::provenance::Provenance;
use fusion::run::{Options, Run};
use fusion_models::fault::derive_seed;
use fusion_models::units::{NonNegative, Positive, Probability, dim};
use judge::Baseline;
use lot::Lot;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io::Write;

/// How `fusion stress --draw` draws faults and judges cases.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DrawSpec {
    /// The shortest fault; 1 s by default.
    shortest: Option<Positive<dim::Duration>>,
    /// The longest fault; 60 s by default.
    longest: Option<Positive<dim::Duration>>,
    /// Good data after the last fault; 120 s by default. A log that is too short leaves less.
    left: Option<NonNegative<dim::Duration>>,
    /// How many faults there are at once, at most; 3 by default.
    together: Option<core::num::NonZeroU32>,
    /// Sizes of steps, ramps at their end, and noise: from, to, in multiples of the scale of a sensor's channel;
    /// 3 to 300 by default.
    size: Option<[f64; 2]>,
    /// The same for the input of the process, whose scale is its standard deviation over the run; 0.03 to 3 by default.
    input: Option<[f64; 2]>,
    /// Factors of a wrong scale: from, to; 0.2 to 5 by default.
    factor: Option<[f64; 2]>,
    /// Delays and wrong stamps: from, to; 0.02 s to 5 s by default.
    delay: Option<[Positive<dim::Duration>; 2]>,
    /// The error at the end is the root mean square over so long; 10 s by default.
    over: Option<Positive<dim::Duration>>,
    /// A health that is not good for longer than this, after the error has returned, is late; 60 s by default.
    late: Option<NonNegative<dim::Duration>>,
    /// The errors that are judged: `position`, `velocity`, `attitude`. By default the first of them that the design has.
    of: Vec<String>,
    /// A smaller share of recovered cases is a failure; 95 % by default.
    recovered: Option<Probability>,
    /// A larger share of false goods is a failure; 3 % by default.
    false_good: Option<Probability>,
}

/// The limits of the draw and of the verdicts.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    /// From, to \[s\].
    pub(super) lasts: [f64; 2],
    /// Seconds.
    pub(super) left: f64,
    pub(super) together: usize,
    /// In multiples of the scale.
    pub(super) size: [f64; 2],
    pub(super) input: [f64; 2],
    pub(super) factor: [f64; 2],
    /// From, to \[s\].
    pub(super) delay: [f64; 2],
    /// Seconds.
    pub(super) over: f64,
    pub(super) late: f64,
    /// Numbers of [`GROUPS`](super::errors::GROUPS); empty for the first that there is.
    pub(super) of: Vec<usize>,
    /// Shares.
    pub(super) recovered: f64,
    pub(super) false_good: f64,
    /// Kinds that are drawn; none for all.
    pub(super) only: Vec<lot::Kind>,
}

impl Draw {
    /// Reads the table `draw` of a catalogue.
    pub(super) fn read(spec: &DrawSpec, node: Option<&Node>, d: &mut Diagnostics) -> Self {
        let mut wrong = |key: &str, message: String| {
            let mistake = Diagnostic::error(message);
            d.push(node.map_or_else(|| mistake.clone(), |node| mistake.clone().at(node.place_of(key))));
        };
        let mut of = Vec::new();
        for name in &spec.of {
            match super::errors::GROUPS.iter().position(|group| group == name) {
                Some(group) => of.push(group),
                None => wrong(
                    "of",
                    format!("an error called `{name}` is unknown: `position`, `velocity` or `attitude`"),
                ),
            }
        }
        let delay = spec.delay.map(|delay| delay.map(|d| d.si()));
        for (key, size) in [
            ("size", spec.size),
            ("input", spec.input),
            ("factor", spec.factor),
            ("delay", delay),
        ] {
            if size.is_some_and(|[from, to]| !(from > 0.0 && to >= from && to.is_finite())) {
                wrong(
                    key,
                    "a range goes from a value above zero to one that is as large at least".to_owned(),
                );
            }
        }
        let longest = spec.longest.map_or(60.0, |l| l.si());
        let shortest = spec.shortest.map_or(1.0_f64.min(longest), |s| s.si());
        if shortest > longest {
            wrong(
                "shortest",
                format!("the shortest fault, {shortest} s, is longer than the longest, {longest} s"),
            );
        }
        Self {
            lasts: [shortest, longest],
            left: spec.left.map_or(120.0, |l| l.si()),
            together: spec.together.map_or(3, |n| n.get() as usize),
            size: spec.size.unwrap_or([3.0, 300.0]),
            input: spec.input.unwrap_or([0.03, 3.0]),
            factor: spec.factor.unwrap_or([0.2, 5.0]),
            delay: delay.unwrap_or([0.02, 5.0]),
            over: spec.over.map_or(10.0, |o| o.si()),
            late: spec.late.map_or(60.0, |l| l.si()),
            of,
            recovered: spec.recovered.map_or(0.95, |r| r.si()),
            false_good: spec.false_good.map_or(0.03, |f| f.si()),
            only: Vec::new(),
        }
    }

    /// Draws faults of these kinds only; no names keep all.
    ///
    /// # Errors
    /// A name that no kind has.
    pub(super) fn only(&mut self, names: &[String]) -> Result<(), Diagnostics> {
        let mut d = Diagnostics::new();
        let known: Vec<&str> = lot::Kind::ALL.iter().map(|k| k.word()).collect();
        for name in names {
            match lot::Kind::ALL.into_iter().find(|k| k.word() == name) {
                Some(kind) => self.only.push(kind),
                None => {
                    let unknown = Diagnostic::error(format!("no fault is drawn that is called `{name}`"));
                    d.push(unknown.suggest(name, &known, "the kinds"));
                }
            }
        }
        d.unless_errors(())
    }
}

/// A case with what became of the filter.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DrawnResult {
    /// The number by which it is drawn.
    pub number: u64,
    /// The kinds of its faults.
    pub kinds: Vec<String>,
    /// The case.
    pub case: Case,
    /// The verdicts.
    pub judged: Judged,
}

/// The result of a campaign of drawn faults.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The design's own line about itself.
    pub description: String,
    /// The design that was put under stress.
    pub provenance: Provenance,
    /// A row for each case.
    pub rows: Vec<DrawnResult>,
    /// The judged errors: `position`, `velocity`, `attitude`.
    pub of: Vec<String>,
    /// Root mean square of each of them in the undisturbed run, in SI units.
    pub undisturbed: Vec<f64>,
    /// Whether there is a reference; else the undisturbed run is one, and its own 1σ takes the place of its errors.
    pub has_reference: bool,
    /// Good data after the last fault \[s\].
    pub left: f64,
    /// Whether this is what was asked for; else the log is too short.
    pub is_whole: bool,
    /// The share of recovered cases that is asked for, and the share of false goods that is allowed.
    pub limits: [f64; 2],
}

impl Drawn {
    /// The counts of all cases.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.rows.iter().map(|row| &row.judged).collect()
    }

    /// The counts of the cases with a fault of each kind, by name.
    #[must_use]
    pub fn by_kind(&self) -> Vec<(&'static str, Counts)> {
        let of = |kind: lot::Kind| {
            let those = self.rows.iter().filter(|row| row.kinds.iter().any(|k| k == kind.word()));
            (kind.word(), those.map(|row| &row.judged).collect::<Counts>())
        };
        lot::Kind::ALL.into_iter().map(of).filter(|(_, counts)| counts.cases > 0).collect()
    }

    /// The counts of the cases with so many faults at once.
    #[must_use]
    pub fn by_number(&self) -> Vec<(usize, Counts)> {
        let most = self.rows.iter().map(|row| row.kinds.len()).max().unwrap_or(0);
        let of = |n: usize| {
            let those = self.rows.iter().filter(|row| row.kinds.len() == n);
            (n, those.map(|row| &row.judged).collect::<Counts>())
        };
        (1..=most).map(of).filter(|(_, counts)| counts.cases > 0).collect()
    }

    /// Whether fewer cases have recovered than is asked for, or more are false goods than are allowed.
    #[must_use]
    pub fn fails(&self) -> bool {
        let counts = self.counts();
        let [recovered, false_good] = self.limits;
        counts.recovered.share() < recovered || counts.false_good.share() > false_good
    }
}

/// The entries that all parts of a draw share.
#[derive(Serialize, Deserialize)]
struct Shared {
    of: Vec<String>,
    undisturbed: Vec<f64>,
    has_reference: bool,
    left: f64,
    is_whole: bool,
    limits: [f64; 2],
    /// A number made of the limits of the draw and of the first case.
    cases: u64,
}

/// Runs `design` undisturbed, then drawn cases of `count`, and writes them as a part; only those of the numbers `alone`,
/// if there are any. A case is a function of the seed and of its number: neither the others nor the number of threads
/// matter.
///
/// # Errors
/// Mistakes of the design, what is wrong with the data, a design to which no drawn fault fits; a part that cannot be
/// written.
pub fn draw<W: Write>(
    design: &Design,
    catalogue: &Catalogue,
    options: &Options,
    (count, alone): (u64, &[u64]),
    work: &Work<'_>,
    out: W,
) -> Result<(), Diagnostics> {
    let survey = surveyed(design, options)?;
    let limits = &catalogue.draw;
    let run = Run::open(design, options)?;
    let lot = Lot::new(design, run.assembly(), catalogue, &survey, work.seed)?;
    drop(run);
    // Before the first possible fault the filter converges: its errors there do not count.
    let quiet = Case::quiet(lot.from, lot.to);
    let (record, _) = watched(design, &quiet, lot.seconds_left(&quiet), options, &survey)?;
    let baseline = Baseline::new(&record, &survey, limits);
    if baseline.groups.is_empty() {
        let message = "the undisturbed filter has no error that could be judged";
        return Err(Diagnostic::error(message)
            .help("another is named by `of` under [stress.draw]")
            .into());
    }
    let one = |place: u64| -> Result<DrawnResult, Diagnostics> {
        let number = alone.get((place - 1) as usize).copied().unwrap_or(place);
        let (kinds, case) = lot.case(number);
        let (record, stopped) = watched(design, &case, lot.seconds_left(&case), options, &survey)?;
        let judged = baseline.judge(&record, &case, stopped);
        Ok(DrawnResult {
            number,
            kinds: kinds.into_iter().map(str::to_owned).collect(),
            case,
            judged,
        })
    };
    let shared = Shared {
        of: baseline
            .groups
            .iter()
            .map(|(group, _)| super::errors::GROUPS[*group].to_owned())
            .collect(),
        undisturbed: baseline.groups.iter().map(|(_, rms)| *rms).collect(),
        has_reference: !survey.errors.is_empty(),
        left: lot.left,
        is_whole: lot.is_whole,
        limits: [limits.recovered, limits.false_good],
        cases: derive_seed(0, &[&format!("{limits:?} {:?}", lot.case(1))]),
    };
    let count = if alone.is_empty() { count } else { alone.len() as u64 };
    work.write((Kind::Draw, design, count), &shared, one, out)
}

impl Drawn {
    /// The draw that parts make. All its rows are in memory.
    ///
    /// # Errors
    /// [`Unreadable`], if a part is damaged.
    pub fn read(parts: &Parts) -> Result<Self, Unreadable> {
        let (subject, shared, rows) = parts.read::<Shared, _>()?;
        let Subject {
            description, provenance, ..
        } = subject;
        Ok(Self {
            description,
            provenance,
            rows,
            of: shared.of,
            undisturbed: shared.undisturbed,
            has_reference: shared.has_reference,
            left: shared.left,
            is_whole: shared.is_whole,
            limits: shared.limits,
        })
    }
}
