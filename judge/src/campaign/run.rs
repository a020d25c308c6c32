//! Runs in parallel, and their rows in order.

use super::figures::{RunSpread, Tally};
use super::{Campaign, FANS, FailedRun, History, Outcome, RunRow, Table};
use crate::part::{Effort, Head, Parts, Subject, Unreadable, Writer};
use core::borrow::Borrow;
use core::ops::Range;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion::observe::RunObserver;
use fusion::run::{Options, Smoothing, run_sharing};
use fusion_models::sim::SharedCourse;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::convert::Infallible;
use std::io::{self, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Runs in memory at a time: enough to keep many threads busy, and a few megabytes.
const BLOCK: u64 = 1024;

/// The seed of run number `run`: it depends only on `seed` and `run`.
#[must_use]
pub fn seed_of(seed: u64, run: u64) -> u64 {
    fusion_models::fault::derive_seed(seed, &["run", &run.to_string()])
}

/// The runs of a campaign in memory.
#[derive(Clone, Debug)]
pub struct Runs {
    /// One row per run, in order of their numbers; all of them have the same sensors and blocks.
    pub rows: Vec<RunRow>,
    /// Their statistics.
    pub campaign: Campaign,
}

impl Runs {
    /// The spread over the runs of any figure; `None` without finite figures.
    #[must_use]
    pub fn spread(&self, figure: impl Fn(&RunRow) -> f64) -> Option<RunSpread> {
        let mut tally = Tally::default();
        self.rows.iter().for_each(|row| tally.add(figure(row)));
        tally.spread()
    }

    /// Writes runs.csv.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn write(&self, out: impl Write) -> io::Result<()> {
        let mut table = Table::begin(out, self.rows.first())?;
        self.rows.iter().try_for_each(|row| table.add(row))?;
        table.finish()
    }
}

/// Runs the design once for each number of `runs`, each time with its own seed, on `threads` threads (0: one per core).
/// A row depends on the seed and the number of its run only: not on the number of threads, nor on the other runs. All
/// rows are kept; [`Runner::write`] keeps none.
///
/// # Errors
/// The diagnostics of the first failing run.
pub fn monte_carlo(
    design: &Design,
    options: &Options,
    runs: Range<u64>,
    seed: u64,
    threads: usize,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Runs, Diagnostics> {
    let begun = Instant::now();
    let runner = Runner::new(seed, threads, false, progress)?;
    let rows = runner.run(design, options, runs, &SharedCourse::default());
    let rows: Vec<RunRow> = rows.into_iter().collect::<Result<_, _>>()?;
    let mut campaign = Campaign::new(Subject::new("", design, seed));
    rows.iter().for_each(|row| campaign.add(row));
    let again = |run| Ok::<_, Infallible>(rows.iter().find(|row| row.run == run).cloned());
    let Ok(()) = campaign.finish(runner.effort(begun), again);
    Ok(Runs { rows, campaign })
}

/// Runs designs over seeds.
pub struct Runner<'a> {
    seed: u64,
    pool: ThreadPool,
    /// Whether the rows have their errors over time.
    over_time: bool,
    done: AtomicUsize,
    progress: &'a (dyn Fn(usize) + Sync),
}

impl core::fmt::Debug for Runner<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Runner").field("seed", &self.seed).finish_non_exhaustive()
    }
}

impl<'a> Runner<'a> {
    /// On `threads` threads, 0 for one per core. With `over_time`, the first [`FANS`] runs have their errors over time.
    /// `progress` receives the number of finished runs.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn new(seed: u64, threads: usize, over_time: bool, progress: &'a (dyn Fn(usize) + Sync)) -> Result<Self, Diagnostics> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        Ok(Self {
            seed,
            pool: pool.map_err(|e| Diagnostics::from(Diagnostic::error(format!("no threads to run on: {e}"))))?,
            over_time,
            done: AtomicUsize::new(0),
            progress,
        })
    }

    /// Runs every design once for each number of the head, and writes a row for each number: the [outcomes](Outcome) of
    /// all designs. If all runs of a design have failed, it returns why the first one did.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write<W: Write>(
        &self,
        designs: &[(impl Borrow<Design>, Options)],
        head: &Head,
        out: W,
    ) -> Result<Option<Diagnostics>, Diagnostics> {
        let begun = Instant::now();
        let unwritable = |e: io::Error| Diagnostics::from(Diagnostic::error(format!("the part cannot be written: {e}")));
        let courses: Vec<SharedCourse> = designs.iter().map(|_| SharedCourse::default()).collect();
        let mut part = Writer::begin(out, head).map_err(unwritable)?;
        let mut numbers = head.numbers.clone();
        let mut ended = vec![false; designs.len()];
        let mut first: Vec<Option<Diagnostics>> = vec![None; designs.len()];
        while !numbers.is_empty() {
            let end = numbers.end.min(numbers.start.saturating_add(BLOCK));
            let block = designs.iter().zip(&courses);
            let block = block.map(|((design, options), course)| self.run(design.borrow(), options, numbers.start..end, course));
            let mut block: Vec<_> = block.map(Vec::into_iter).collect();
            for number in numbers.start..end {
                let ran = block.iter_mut().filter_map(Iterator::next);
                let row = ran.zip(ended.iter_mut().zip(&mut first)).map(|(ran, (ended, first))| match ran {
                    Ok(row) => {
                        *ended = true;
                        Outcome::Ended(Box::new(row))
                    }
                    Err(mistakes) => {
                        let failed = FailedRun::new(number, seed_of(self.seed, number), &mistakes);
                        first.get_or_insert(mistakes);
                        Outcome::Failed(failed)
                    }
                });
                part.put(&row.collect::<Vec<Outcome>>()).map_err(unwritable)?;
            }
            numbers.start = end;
        }
        part.end(self.effort(begun)).map_err(unwritable)?;
        let failed = ended.into_iter().zip(first).filter(|(ended, _)| !ended);
        Ok(failed.filter_map(|(_, mistakes)| mistakes).next())
    }

    /// The runs of a design, in order.
    fn run(&self, design: &Design, options: &Options, numbers: Range<u64>, course: &SharedCourse) -> Vec<Result<RunRow, Diagnostics>> {
        let one = |number: u64| -> Result<RunRow, Diagnostics> {
            let seed = seed_of(self.seed, number);
            let options = Options {
                seed: Some(seed),
                data: options.data.clone(),
                base: options.base.clone(),
                // No row of a campaign uses it.
                smooth: Smoothing::Never,
                ..Options::default()
            };
            let mut history = (self.over_time && number < FANS).then(|| History::new(design));
            let mut observers: Vec<&mut dyn RunObserver> = Vec::new();
            observers.extend(history.as_mut().map(|h| h as &mut dyn RunObserver));
            let summary = run_sharing(design, &options, course, &mut observers);
            (self.progress)(self.done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(RunRow::new(number, seed, &summary?, history))
        };
        self.pool.install(|| numbers.into_par_iter().map(one).collect())
    }

    fn effort(&self, begun: Instant) -> Effort {
        Effort {
            seconds: begun.elapsed().as_secs_f64(),
            threads: self.pool.current_num_threads(),
        }
    }
}

/// The statistics of all runs of the parts, for each of their designs.
///
/// # Errors
/// [`Unreadable`], if a part is damaged.
pub fn read(parts: &Parts) -> Result<Vec<Campaign>, Unreadable> {
    let mut campaigns: Vec<Campaign> = parts.head().subjects.iter().cloned().map(Campaign::new).collect();
    let effort = parts.rows(&mut |rows: Vec<Outcome>| {
        campaigns.iter_mut().zip(rows).for_each(|(campaign, row)| match row {
            Outcome::Ended(row) => campaign.add(&row),
            Outcome::Failed(run) => campaign.add_failed(run),
        });
        Ok(())
    })?;
    for (k, campaign) in campaigns.iter_mut().enumerate() {
        campaign.finish(effort, |run| {
            let rows: Option<Vec<Outcome>> = parts.row(run)?;
            Ok::<_, Unreadable>(rows.and_then(|rows| rows.into_iter().nth(k)?.ended()))
        })?;
    }
    Ok(campaigns)
}
