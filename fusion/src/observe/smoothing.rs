//! Smoothing of the outermost filter of a run, for separate observers.
//!
//! ```text
//! run ─▶ Smoother: steps, estimates that are asked for ─▶ FixedInterval, IteratedInterval or FixedLag
//!                                                              │ smoothed, in order of time
//!            smoothed.csv, score ◀─ Hub of its own ◀───────────┘
//! ```
//!
//! The estimates asked for are those with a row in the file, and those on both sides of an epoch of the reference.

use super::{Entry, Hub, RunEnd, RunEvent, RunObserver, Section, SectionObserver, Summary, Thinning};
use crate::score::Score;
use fusion_core::belief::Belief;
use fusion_core::filter::Step;
use fusion_core::memory::{self, Memory};
use fusion_core::runner::{Event, Halt, Observer};
use fusion_core::smoother::{FixedInterval, FixedLag, IteratedInterval, Iteration, Link, Replayed, Tape};
use fusion_core::time::Time;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::VecDeque;

/// The estimates smoothed with later data.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Smoothed {
    /// Lag: data up to this time after an estimate were used \[s\]; `None` for the whole log.
    pub lag: Option<f64>,
    /// Number of smoothed estimates: those with a row in smoothed.csv, and those around an epoch of the
    /// reference.
    pub estimates: u64,
    /// How the iteration ended; `None` if the models were linearised at the filter's estimates alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<IterationEntries>")]
    pub iteration: Option<Iteration>,
    /// Their score against the reference.
    pub score: Option<Score>,
}

/// The entries of [`Iteration`], for the schema.
#[derive(JsonSchema)]
#[schemars(rename = "Iteration")]
#[expect(dead_code, reason = "the fields serve the schema alone")]
struct IterationEntries {
    /// Linearisations of the whole log.
    iterations: u32,
    /// Steps that were shortened because they did not lower the merit.
    shortened: u32,
    /// The largest distance of a state from the optimum, in its smoothed σ.
    distance: f64,
    /// The sum of the squares of residuals, noise and initial error.
    cost: f64,
    /// Whether that distance is below a millionth of σ.
    is_converged: bool,
}

impl Section for Smoothed {
    const NAME: &'static str = "smoothed";
}

impl Summary {
    /// The smoothed estimates, if they were requested.
    #[must_use]
    pub fn smoothed(&self) -> Option<&Smoothed> {
        self.get()
    }
}

/// The data by which estimates are smoothed.
#[derive(Debug)]
pub enum By {
    /// All of the log; the tape is for smoothed estimates.
    All(Box<FixedInterval>, Tape),
    /// All of the log, linearised at the smoothed states; the tape is for the way back.
    Iterated(Box<IteratedInterval>, Tape),
    /// The data up to a lag after the estimate \[s\].
    Lag(Box<FixedLag>, f64),
}

/// Smooths the outermost filter and reports to separate observers, as a [`Hub`] does.
#[derive(Debug)]
pub(crate) struct Smoother<'a> {
    by: By,
    hub: Hub<'a>,
    /// Which estimates have a row; `None` without a file.
    rows: Option<Thinning>,
    /// The estimate before the latest, if it may still be asked for, and the steps after it.
    previous: Option<Asked>,
    between: Vec<Taken>,
    /// The latest estimate, until the next step.
    latest: Option<Asked>,
    /// Starts of the filter after which no smoothed estimate was reported yet.
    starts: VecDeque<Time>,
    smoothed: u64,
    /// An example of the filter's belief.
    blank: Belief,
}

/// A step as the smoother takes it.
#[derive(Debug)]
enum Taken {
    Link(Link),
    Replayed(Box<Replayed>),
}

impl Default for Taken {
    fn default() -> Self {
        Self::Link(Link::default())
    }
}

/// Only links are saved, because only smoothing with a lag is.
impl Memory for Taken {
    fn remember(&mut self, tape: &mut memory::Tape<'_>) {
        match self {
            Self::Link(link) => link.remember(tape),
            Self::Replayed(_) => tape.refuse("smoothing by the whole log cannot be saved"),
        }
    }
}

/// An estimate, and whether it is asked for.
#[derive(Debug)]
struct Asked {
    belief: Belief,
    is_wanted: bool,
}

impl<'a> Smoother<'a> {
    /// Reports to the observers of `hub`, which observe no other run. The file needs the estimates selected by `rows`.
    /// The filter's beliefs have the form of `blank`.
    #[must_use]
    pub const fn new(by: By, hub: Hub<'a>, rows: Option<Thinning>, blank: Belief) -> Self {
        Self {
            by,
            hub,
            rows,
            previous: None,
            between: Vec::new(),
            latest: None,
            starts: VecDeque::new(),
            smoothed: 0,
            blank,
        }
    }

    fn step(&mut self, step: &Step) -> Result<(), Halt> {
        let taken = match &self.by {
            By::Iterated(..) => Taken::Replayed(Box::new(Replayed::of(step))),
            By::All(..) | By::Lag(..) => match Link::of(step) {
                Some(link) => Taken::Link(link),
                None => return Ok(()),
            },
        };
        if self.latest.is_some() {
            self.settle()?;
        }
        if self.previous.is_some() {
            self.between.push(taken);
            return Ok(());
        }
        self.hand_on(taken)
    }

    fn estimate(&mut self, belief: &Belief) -> Result<(), Halt> {
        if self.latest.is_some() {
            self.settle()?;
        }
        let is_wanted = self.rows.as_mut().is_some_and(|rows| rows.takes(belief.time));
        self.latest = Some(Asked {
            belief: belief.clone(),
            is_wanted,
        });
        Ok(())
    }

    /// The latest two estimates enclose an epoch of the reference.
    fn want(&mut self) {
        let both = self.previous.iter_mut().chain(&mut self.latest);
        both.for_each(|asked| asked.is_wanted = true);
    }

    /// Hands on all data before the latest estimate: no observer can ask for them any more.
    fn settle(&mut self) -> Result<(), Halt> {
        if let Some(asked) = self.previous.take()
            && asked.is_wanted
        {
            match &mut self.by {
                By::All(interval, _) => interval.estimate(&asked.belief)?,
                By::Iterated(interval, _) => interval.estimate(&asked.belief)?,
                By::Lag(lag, _) => lag.estimate(&asked.belief),
            }
        }
        let mut between = core::mem::take(&mut self.between);
        between.drain(..).try_for_each(|taken| self.hand_on(taken))?;
        self.between = between;
        self.previous = self.latest.take();
        Ok(())
    }

    fn hand_on(&mut self, taken: Taken) -> Result<(), Halt> {
        match (&mut self.by, taken) {
            (By::All(interval, _), Taken::Link(link)) => interval.step(&link),
            (By::Lag(lag, _), Taken::Link(link)) => lag.step(link, &mut told(&mut self.hub, &mut self.starts, &mut self.smoothed)),
            (By::Iterated(interval, _), Taken::Replayed(step)) => interval.step(*step),
            _ => Ok(()),
        }
    }

    fn start(&mut self, belief: &Belief) -> Result<(), Halt> {
        self.settle_all()?;
        self.starts.push_back(belief.time);
        match &mut self.by {
            By::All(interval, _) => interval.start(belief),
            By::Iterated(interval, _) => interval.start(belief),
            By::Lag(lag, _) => lag.start(belief, &mut told(&mut self.hub, &mut self.starts, &mut self.smoothed)),
        }
    }

    /// Hands on all data.
    fn settle_all(&mut self) -> Result<(), Halt> {
        // The latest estimate becomes the one before, and is then handed on.
        self.settle()?;
        self.settle()
    }
}

/// Counts what it reports to `hub`, and starts the hub again where another piece begins.
fn told<'h>(hub: &'h mut Hub<'_>, starts: &'h mut VecDeque<Time>, smoothed: &'h mut u64) -> impl FnMut(&Belief) -> Result<(), Halt> {
    |belief| {
        while starts.pop_front_if(|start| *start <= belief.time).is_some() {
            hub.begin_outermost();
        }
        *smoothed += 1;
        hub.on(&Event::Estimate { belief })
    }
}

/// Only with a lag: the data for smoothing by the whole log are as long as the log.
impl Memory for Smoother<'_> {
    fn remember(&mut self, tape: &mut memory::Tape<'_>) {
        if let By::Lag(lag, _) = &mut self.by {
            lag.remember(tape);
        }
        self.hub.remember(tape);
        if let Some(rows) = &mut self.rows {
            rows.remember(tape);
        }
        for asked in [&mut self.previous, &mut self.latest] {
            let mut is_some = asked.is_some();
            is_some.remember(tape);
            if is_some {
                let asked = asked.get_or_insert_with(|| Asked {
                    belief: self.blank.clone(),
                    is_wanted: false,
                });
                asked.belief.remember(tape);
                asked.is_wanted.remember(tape);
            } else {
                *asked = None;
            }
        }
        self.between.remember(tape);
        self.starts.remember(tape);
        self.smoothed.remember(tape);
    }
}

impl RunObserver for Smoother<'_> {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        let has_memory = matches!(self.by, By::Lag(..)) && self.hub.has_memory();
        has_memory.then_some(self)
    }

    fn flush(&mut self) -> Result<(), Halt> {
        self.hub.flush()
    }

    fn resume(&mut self) -> Result<(), Halt> {
        self.hub.resume()
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Filter { filter, event } if filter.is_outermost() => match event {
                Event::Started { belief, .. } => self.start(belief)?,
                Event::Step(step) => self.step(step)?,
                // The score of outages needs the used measurements.
                Event::Updated { .. } => self.hub.on(event)?,
                _ => {}
            },
            RunEvent::Estimate { filter, belief, .. } if filter.is_outermost() => self.estimate(belief)?,
            RunEvent::Reference { filter, epoch, error } if filter.is_outermost() => {
                self.hub.reference(**epoch);
                if error.is_some() {
                    self.want();
                }
            }
            RunEvent::Truth { filter, belief, truth } if filter.is_outermost() => {
                self.hub.truth(belief.time, truth);
                self.want();
            }
            _ => {}
        }
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        true
    }
}

impl SectionObserver for Smoother<'_> {
    /// The end of the log: reports all remaining estimates. Stored data that cannot be read back are an error.
    fn finish(mut self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt> {
        self.settle_all()?;
        let Self {
            by,
            mut hub,
            mut starts,
            mut smoothed,
            ..
        } = *self;
        let mut tell = told(&mut hub, &mut starts, &mut smoothed);
        let (mut lag, mut iteration) = (None, None);
        match by {
            By::Lag(mut smoother, by) => {
                smoother.finish(&mut tell)?;
                lag = Some(by);
            }
            By::All(interval, turned) => {
                let mut beliefs = interval.smooth(turned)?;
                while let Some(belief) = beliefs.read()? {
                    tell(belief)?;
                }
            }
            By::Iterated(interval, back) => {
                let (mut beliefs, found) = interval.smooth(back)?;
                iteration = Some(found);
                while let Some(belief) = beliefs.read()? {
                    tell(belief)?;
                }
            }
        }
        drop(tell);
        hub.finish()?;
        let section = Smoothed {
            lag,
            estimates: smoothed,
            iteration,
            score: hub.sections(end)?.score().cloned(),
        };
        Ok(section.into())
    }
}
