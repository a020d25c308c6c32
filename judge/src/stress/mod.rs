//! Stress: a design under a declared catalogue of faults, one at a time and in random pairs.
//!
//! ```text
//! catalogue.toml ◀─ [stress] of the design
//!        │
//!        ▼                  survey: the undisturbed run ─┐
//!    catalogue ──▶ cases: what `--set` adds to the design │ in parallel
//!                          └──▶ watch: the disturbed run ◀┘──▶ outcome
//! ```
//!
//! A filter fails a case if it is wrong beyond 3σ or gives no estimate, with good health, for longer than its recovery
//! time. A filter that is wrong and reports it does not fail.

mod cases;
mod catalogue;
pub mod draw;
mod errors;
mod survey;
mod table;
mod watch;

pub use cases::Case;
pub(crate) use catalogue::TABLE;
pub use catalogue::{Catalogue, CatalogueSpec};
pub use watch::{CaseOutcome, Said};

use crate::part::{Effort, Head, Kind, Parts, Subject, Unreadable, Writer};
use core::ops::Range;
use fusion::assembly::Assembly;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion::health::Names;
use fusion::observe::Filters;
use fusion::provenance::Provenance;
use fusion::run::examine::build;
use fusion::run::{Finished, Options, Run, Smoothing};
use fusion_core::time::Time;
use fusion_models::fault::derive_seed;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use survey::Survey;
use watch::{Record, Watch};

/// A case and its outcome.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CaseResult {
    /// The case.
    pub case: Case,
    /// The outcome for the filter.
    pub outcome: CaseOutcome,
}

/// The verdict on a case, if it needs one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaseVerdict {
    /// The filter was wrong for too long with good health.
    Failed,
    /// The filter failed, and the design declares it.
    Known,
    /// The design declares a failure, but the filter passed.
    Passed,
    /// The filter failed, but no stream had a row from which it could notice this.
    NoClock,
}

impl CaseVerdict {
    /// The verdict as it is shown.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Failed => "FAILED",
            Self::Known => "known",
            Self::Passed => "passes now",
            Self::NoClock => "no clock",
        }
    }
}

impl CaseResult {
    /// Whether the filter failed, or was declared to fail; `None` if all is well.
    #[must_use]
    pub fn verdict(&self) -> Option<CaseVerdict> {
        let is_wrong = self.outcome.stopped.is_some() || self.outcome.unsaid > self.case.recovery;
        match (is_wrong, self.case.is_known) {
            // A filter without any row cannot know that time passes.
            (true, _) if self.outcome.hears_nothing && self.outcome.stopped.is_none() => Some(CaseVerdict::NoClock),
            (true, true) => Some(CaseVerdict::Known),
            (true, false) => Some(CaseVerdict::Failed),
            (false, true) if self.case.sets.len() == 1 => Some(CaseVerdict::Passed),
            (false, _) => None,
        }
    }
}

/// The result.
#[derive(Clone, Debug)]
pub struct Stress {
    /// The line with which the design describes itself.
    pub description: String,
    /// The inputs of the run.
    pub provenance: Provenance,
    /// The undisturbed run, judged like the others.
    pub undisturbed: CaseResult,
    /// One row per case.
    pub rows: Vec<CaseResult>,
    /// The moment of the faults.
    pub at: Time,
    /// Whether this moment is apart from declared faults, with enough time to recover before the log ends.
    pub is_free: bool,
    /// Whether there is a reference; otherwise the undisturbed run replaces it.
    pub has_reference: bool,
    /// Faults of the catalogue that fit no stream of the design.
    pub unfit: Vec<String>,
}

impl Stress {
    /// The number of failed cases.
    #[must_use]
    pub fn failures(&self) -> usize {
        self.rows.iter().filter(|r| r.verdict() == Some(CaseVerdict::Failed)).count()
    }
}

/// Reports to `d` the mistakes of the table `[stress]`, if there is one.
fn check(document: &fusion::config::Document, d: &mut Diagnostics) {
    if document.root().get(TABLE).is_some()
        && let Err(mistakes) = Catalogue::read(Catalogue::built_in(), document)
    {
        d.extend(mistakes.iter().cloned());
    }
}

fusion::inventory::submit! {
    fusion::design::FurtherTable {
        name: TABLE,
        schema: Some(|| schemars::schema_for!(CatalogueSpec)),
        check,
    }
}

/// The entries that all parts of a stress share.
#[derive(Serialize, Deserialize)]
struct Shared {
    undisturbed: CaseResult,
    #[serde(with = "nanos")]
    at: Time,
    is_free: bool,
    has_reference: bool,
    unfit: Vec<String>,
    /// A number made of all cases.
    cases: u64,
}

/// Which cases run, and on how many threads.
pub struct Work<'a> {
    /// Draws directions, pairs and cases.
    pub seed: u64,
    /// The numbers of the cases from 1; `None` for all.
    pub numbers: Option<Range<u64>>,
    /// 0 for one per core. The rows do not depend on it.
    pub threads: usize,
    /// The command of the work, without its numbers and files.
    pub again: String,
    /// Receives the number of finished cases and of all cases.
    pub progress: &'a (dyn Fn(usize, usize) + Sync),
}

impl core::fmt::Debug for Work<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Work")
            .field("seed", &self.seed)
            .field("numbers", &self.numbers)
            .finish_non_exhaustive()
    }
}

impl Work<'_> {
    /// Runs the wanted ones of `count` cases in parallel, and writes a part.
    fn write<W: Write, T: Send + Serialize>(
        &self,
        (kind, design, count): (Kind, &Design, u64),
        shared: &impl Serialize,
        one: impl Fn(u64) -> Result<T, Diagnostics> + Sync,
        out: W,
    ) -> Result<(), Diagnostics> {
        let begun = Instant::now();
        let end = count.saturating_add(1);
        let numbers = self.numbers.clone().unwrap_or(1..end);
        if numbers.start < 1 || numbers.end > end {
            let message = format!(
                "there are {count} cases, with the numbers 1..{end}: {}..{} are not among them",
                numbers.start, numbers.end
            );
            return Err(Diagnostic::error(message).into());
        }
        let unwritable = |e: io::Error| Diagnostics::from(Diagnostic::error(format!("the part cannot be written: {e}")));
        let head = Head {
            again: self.again.clone(),
            ..Head::new(kind, vec![Subject::new("", design, self.seed)], numbers.clone(), Some(end))
        };
        let mut part = Writer::begin(out, &head.sharing(shared).map_err(unwritable)?).map_err(unwritable)?;
        let pool = pool(self.threads)?;
        let (done, total) = (AtomicUsize::new(0), numbers.clone().count());
        let told = |number: u64| -> Result<T, Diagnostics> {
            let row = one(number)?;
            (self.progress)(done.fetch_add(1, Ordering::Relaxed) + 1, total);
            Ok(row)
        };
        let rows: Result<Vec<T>, Diagnostics> = pool.install(|| numbers.into_par_iter().map(told).collect());
        rows?.iter().try_for_each(|row| part.put(row)).map_err(unwritable)?;
        let effort = Effort {
            seconds: begun.elapsed().as_secs_f64(),
            threads: pool.current_num_threads(),
        };
        part.end(effort).map_err(unwritable)
    }
}

/// Runs `design` undisturbed, then cases of `catalogue`, and writes them as a part.
///
/// # Errors
/// Mistakes of the design, of the catalogue or of the data; numbers without a case; a part that cannot be written.
pub fn stress<W: Write>(design: &Design, catalogue: &Catalogue, options: &Options, work: &Work<'_>, out: W) -> Result<(), Diagnostics> {
    let survey = surveyed(design, options)?;
    let at = survey.moment(
        catalogue,
        design
            .reference
            .as_ref()
            .and_then(|r| r.block.from)
            .map(|t| Time::from_seconds(t.si())),
    );
    let run = Run::open(design, options)?;
    let cases::Cases { cases, unfit } = cases::cases(design, run.assembly(), catalogue, &survey, at, work.seed)?;
    drop(run);
    let one = |case: &Case| -> Result<CaseResult, Diagnostics> {
        Ok(CaseResult {
            outcome: outcome(design, case, catalogue.watch, options, &survey)?,
            case: case.clone(),
        })
    };
    let shared = Shared {
        undisturbed: one(&Case::undisturbed(at))?,
        at,
        is_free: survey.is_free(catalogue, at),
        has_reference: !survey.errors.is_empty(),
        unfit,
        cases: derive_seed(0, &[&format!("{cases:?}")]),
    };
    let numbered = |number: u64| one(&cases[(number - 1) as usize]);
    work.write((Kind::Stress, design, cases.len() as u64), &shared, numbered, out)
}

impl Stress {
    /// The stress that parts make. All its rows are in memory.
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
            undisturbed: shared.undisturbed,
            rows,
            at: shared.at,
            is_free: shared.is_free,
            has_reference: shared.has_reference,
            unfit: shared.unfit,
        })
    }
}

/// A time as its nanoseconds.
mod nanos {
    use fusion_core::time::Time;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(time: &Time, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_i64(time.nanos())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Time, D::Error> {
        i64::deserialize(d).map(Time::from_nanos)
    }
}

/// The undisturbed run.
fn surveyed(design: &Design, options: &Options) -> Result<Survey, Diagnostics> {
    let run = Run::open(design, options)?;
    let mut survey = Survey::new(run.assembly().streams.clone());
    let Finished { summary, .. } = run.go(&mut [&mut survey], &mut |_| {})?;
    survey.finish(&summary);
    if survey.started.is_none() {
        let message = "the undisturbed filter never starts: there is nothing to disturb";
        return Err(Diagnostic::error(message).help("`fusion run` says what it waits for").into());
    }
    Ok(survey)
}

/// A pool with this number of threads, 0 for one per core.
fn pool(threads: usize) -> Result<rayon::ThreadPool, Diagnostics> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Diagnostic::error(format!("no threads to run on: {e}")).into())
}

/// Runs the design with the faults of a case and watches it for `watch` seconds after them. Returns the record, and the
/// reason if the run stopped before its end.
fn watched(design: &Design, case: &Case, watch: f64, options: &Options, survey: &Survey) -> Result<(Record, Option<String>), Diagnostics> {
    let (watch, _, stopped) = disturbed(design, case, watch, options, survey)?;
    Ok((watch.record(), stopped))
}

/// Runs the design with the faults of a case, and judges the filter.
fn outcome(design: &Design, case: &Case, watch: f64, options: &Options, survey: &Survey) -> Result<CaseOutcome, Diagnostics> {
    let (watch, names, stopped) = disturbed(design, case, watch, options, survey)?;
    Ok(CaseOutcome {
        stopped,
        ..watch.finish(case.to, &names)
    })
}

/// Runs the design with the faults of a case, to the end of the watch. Returns the watch, the names in the filter, and
/// the reason if it stopped early.
fn disturbed<'a>(
    design: &Design,
    case: &Case,
    watch: f64,
    options: &Options,
    survey: &'a Survey,
) -> Result<(Watch<'a>, Names, Option<String>), Diagnostics> {
    let mut document = design.document.clone();
    case.sets.iter().try_for_each(|set| document.set(set))?;
    let disturbed = build(document)?;
    let options = Options {
        data: options.data.clone(),
        base: options.base.clone(),
        seed: options.seed,
        smooth: Smoothing::Never,
        ..Options::default()
    };
    let run = Run::open(&disturbed, &options)?;
    let mut watch = Watch::new(survey, case, watch, run.assembly().runner.lag());
    let names = names(run.assembly());
    let ran = run.go(&mut [&mut watch], &mut |_| {});
    let stopped = ran.err().filter(|_| !watch.is_over).map(|d| d.to_string());
    Ok((watch, names, stopped))
}

/// The names of the filter's sensors, blocks and streams.
fn names(assembly: &Assembly) -> Names {
    let filters = Filters::of(assembly);
    filters
        .outermost()
        .map_or_else(Names::default, |filter| Names::new(filter, assembly))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_hears_nothing_any_more_has_no_clock_and_did_not_fail() {
        let row = |hears_nothing, unsaid| CaseResult {
            case: Case {
                recovery: 30.0,
                ..Case::undisturbed(Time::default())
            },
            outcome: CaseOutcome {
                hears_nothing,
                unsaid,
                ..CaseOutcome::default()
            },
        };
        assert_eq!(row(true, 37.5).verdict(), Some(CaseVerdict::NoClock));
        assert_eq!(row(false, 37.5).verdict(), Some(CaseVerdict::Failed));
        // A fault at the end of the log, with no rows after it.
        assert_eq!(row(true, 0.0).verdict(), None);
    }
}
