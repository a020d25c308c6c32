//! Smoothing the outermost filter of a run, for observers of its own.
//!
//! ```text
//! run ─▶ Smoother: steps, estimates that are asked for ─▶ FixedInterval or FixedLag
//!                                                              │ smoothed, in order of time
//!            smoothed.csv, score ◀─ Hub of its own ◀───────────┘
//! ```
//!
//! Asked for are the estimates that have a row in the file, and those about an epoch of the reference.

use super::{Hub, RunEvent, RunObserver, Thinning};
use fusion_core::filter::Step;
use fusion_core::memory::{self, Memory};
use fusion_core::runner::{Event, Halt, Observer};
use fusion_core::smoother::{FixedInterval, FixedLag, Link, Tape};
use fusion_core::state::Belief;
use fusion_core::time::Time;
use std::collections::VecDeque;

/// By which data estimates are smoothed.
#[derive(Debug)]
pub enum By {
    /// All of the log; the tape is for smoothed estimates.
    All(Box<FixedInterval>, Tape),
    /// Those up to a time after the estimate.
    Lag(Box<FixedLag>),
}

/// Smooths the outermost filter and tells observers of its own as a [`Hub`] does.
#[derive(Debug)]
pub struct Smoother<'a> {
    by: By,
    hub: Hub<'a>,
    /// Which estimates have a row; none where there is no file.
    rows: Option<Thinning>,
    /// The estimate before the latest, if it may still be asked for, and the steps after it.
    previous: Option<Asked>,
    between: Vec<Link>,
    /// The latest estimate, until the next step.
    latest: Option<Asked>,
    /// Where the filter started and nothing smoothed was told yet.
    starts: VecDeque<Time>,
    smoothed: u64,
    /// A belief as the filter has them.
    blank: Belief,
}

/// An estimate, and whether it is asked for.
#[derive(Debug)]
struct Asked {
    belief: Belief,
    is_wanted: bool,
}

impl<'a> Smoother<'a> {
    /// For the observers of `hub`, which hear of no other run; `rows` of the estimates are wanted for a file.
    /// The filter's beliefs are like `blank`.
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

    /// The end of the log: tells all that is left, and how many estimates were smoothed in all.
    ///
    /// # Errors
    /// The first of an observer, or what was kept that cannot be read back.
    pub fn finish(mut self) -> Result<u64, Halt> {
        self.settle_all()?;
        let mut tell = told(&mut self.hub, &mut self.starts, &mut self.smoothed);
        match self.by {
            By::Lag(mut lag) => lag.finish(&mut tell)?,
            By::All(interval, turned) => {
                let mut smoothed = interval.smooth(turned)?;
                while let Some(belief) = smoothed.read()? {
                    tell(belief)?;
                }
            }
        }
        drop(tell);
        self.hub.finish()?;
        Ok(self.smoothed)
    }

    fn step(&mut self, step: &Step) -> Result<(), Halt> {
        let Some(link) = Link::of(step) else { return Ok(()) };
        if self.latest.is_some() {
            self.settle()?;
        }
        if self.previous.is_some() {
            self.between.push(link);
            return Ok(());
        }
        self.hand_on(link)
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

    /// The latest two estimates are about an epoch of the reference.
    fn want(&mut self) {
        let both = self.previous.iter_mut().chain(&mut self.latest);
        both.for_each(|asked| asked.is_wanted = true);
    }

    /// Hands on what nobody can ask for any more: all before the latest estimate.
    fn settle(&mut self) -> Result<(), Halt> {
        if let Some(asked) = self.previous.take()
            && asked.is_wanted
        {
            match &mut self.by {
                By::All(interval, _) => interval.estimate(&asked.belief)?,
                By::Lag(lag) => lag.estimate(&asked.belief),
            }
        }
        let mut between = core::mem::take(&mut self.between);
        between.drain(..).try_for_each(|link| self.hand_on(link))?;
        self.between = between;
        self.previous = self.latest.take();
        Ok(())
    }

    fn hand_on(&mut self, link: Link) -> Result<(), Halt> {
        match &mut self.by {
            By::All(interval, _) => interval.step(&link),
            By::Lag(lag) => lag.step(link, &mut told(&mut self.hub, &mut self.starts, &mut self.smoothed)),
        }
    }

    fn start(&mut self, belief: &Belief) -> Result<(), Halt> {
        self.settle_all()?;
        self.starts.push_back(belief.time);
        match &mut self.by {
            By::All(interval, _) => interval.start(belief),
            By::Lag(lag) => lag.start(belief, &mut told(&mut self.hub, &mut self.starts, &mut self.smoothed)),
        }
    }

    /// Hands on all there is.
    fn settle_all(&mut self) -> Result<(), Halt> {
        // The latest estimate becomes the one before, and is then handed on.
        self.settle()?;
        self.settle()
    }
}

/// Counts what it tells `hub`, and tells it where another piece begins.
fn told<'h>(hub: &'h mut Hub<'_>, starts: &'h mut VecDeque<Time>, smoothed: &'h mut u64) -> impl FnMut(&Belief) -> Result<(), Halt> {
    |belief| {
        while starts.pop_front_if(|start| *start <= belief.time).is_some() {
            hub.begin_outermost();
        }
        *smoothed += 1;
        hub.on(&Event::Estimate { belief })
    }
}

/// Only with a lag: what smoothing by all of the log keeps is as long as the log.
impl Memory for Smoother<'_> {
    fn remember(&mut self, tape: &mut memory::Tape<'_>) {
        if let By::Lag(lag) = &mut self.by {
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
        let has_memory = matches!(self.by, By::Lag(_)) && self.hub.has_memory();
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
                // The score of outages asks what was used.
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
