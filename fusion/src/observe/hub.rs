//! Turns the events of a runner into those of a run.

use super::wait::Waiting;
use super::{Filters, RunEnd, RunEvent, RunObserver, SectionObserver, Summary};
use crate::rows::Row;
use crate::score::{Comparison, ReferenceEpoch};
use crate::solution::{SolutionReader, Solved, Turning};
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::{Event, Halt, Observer};
use fusion_core::time::Time;
use std::collections::VecDeque;

/// Hears a runner and passes its events to the observers of a run in turn. The solution of an estimate is computed once
/// for all of them, if an observer uses it. Its error is computed once, if there is a reference.
pub struct Hub<'a> {
    filters: &'a Filters,
    /// By filter.
    readers: Vec<SolutionReader>,
    /// By filter; empty without a reference.
    comparisons: Box<[Comparison]>,
    turnings: Box<[Turning]>,
    /// True states of the outermost filter that its estimates have not reached yet.
    truths: VecDeque<(Time, Vec<f64>)>,
    observers: Observers<'a>,
    waiting: Waiting,
    /// Hears the current estimates, before later rows come.
    current: Option<Box<Self>>,
}

/// The observers of a hub: first those that make a section, in the order of their sections.
#[derive(Default)]
struct Observers<'a> {
    of_sections: Vec<Box<dyn SectionObserver + 'a>>,
    others: Vec<&'a mut dyn RunObserver>,
}

impl<'a> Observers<'a> {
    fn iter(&self) -> impl Iterator<Item = &(dyn RunObserver + 'a)> {
        let of_sections = self.of_sections.iter().map(|observer| &**observer as &(dyn RunObserver + 'a));
        of_sections.chain(self.others.iter().map(|observer| &**observer))
    }

    fn iter_mut(&mut self) -> impl Iterator<Item = &mut (dyn RunObserver + 'a)> {
        let of_sections = self
            .of_sections
            .iter_mut()
            .map(|observer| &mut **observer as &mut (dyn RunObserver + 'a));
        of_sections.chain(self.others.iter_mut().map(|observer| &mut **observer))
    }

    /// Passes an event to each observer in turn; the first error stops.
    fn tell(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        self.iter_mut().try_for_each(|observer| observer.on(event))
    }
}

impl core::fmt::Debug for Hub<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} observers of {} filters", self.observers.iter().count(), self.readers.len())
    }
}

impl<'a> Hub<'a> {
    /// Without observers. If there is a reference, every filter is compared with it, as `comparison` does.
    #[must_use]
    pub fn new(filters: &'a Filters, comparison: Option<&Comparison>) -> Self {
        let readers = filters.iter().map(|f| SolutionReader::new(&f.layout, f.process.clone()));
        Self {
            filters,
            readers: readers.collect(),
            comparisons: filters.iter().filter_map(|_| comparison.cloned()).collect(),
            turnings: filters.iter().map(|f| Turning::new(&f.layout, f.process.clone())).collect(),
            truths: VecDeque::new(),
            observers: Observers::default(),
            waiting: Waiting::default(),
            current: None,
        }
    }

    /// Adds an observer.
    pub fn add(&mut self, observer: &'a mut dyn RunObserver) {
        self.observers.others.push(observer);
    }

    /// Adds an observer that makes a section.
    pub(crate) fn add_section(&mut self, observer: Box<dyn SectionObserver + 'a>) {
        self.observers.of_sections.push(observer);
    }

    /// Adds a hub that hears current estimates: those of the filter just after its newest row was used. It hears no
    /// other events. It is compared with the same reference.
    pub(crate) fn add_current(&mut self, hub: Self) {
        self.current = Some(Box::new(hub));
    }

    /// Returns true if all observers can resume from their memory.
    pub(crate) fn has_memory(&mut self) -> bool {
        self.observers.iter_mut().all(|o| o.memory().is_some()) && self.current.as_mut().is_none_or(|c| c.has_memory())
    }

    /// Writes all output so far to where it survives the end of the process.
    ///
    /// # Errors
    /// The first error of an observer.
    pub fn flush(&mut self) -> Result<(), Halt> {
        self.observers.iter_mut().try_for_each(|o| o.flush())?;
        self.current.as_mut().map_or(Ok(()), |current| current.flush())
    }

    /// After a restore, removes all output that was written later.
    ///
    /// # Errors
    /// The first error of an observer.
    pub fn resume(&mut self) -> Result<(), Halt> {
        self.observers.iter_mut().try_for_each(|o| o.resume())?;
        self.current.as_mut().map_or(Ok(()), |current| current.resume())
    }

    /// The sections of all observers at the end of a run.
    ///
    /// # Errors
    /// The first error of an observer, or two sections with the same key.
    pub(crate) fn sections(mut self, end: &RunEnd<'_>) -> Result<Summary, Halt> {
        let observers = core::mem::take(&mut self.observers.of_sections);
        let mut summary = Summary::default();
        for observer in observers {
            let section = observer.finish(end)?;
            if let Some(key) = summary.has_key_of(&section) {
                return Err(format!("two observers make the section `{key}`").into());
            }
            summary.put(section);
        }
        Ok(summary)
    }

    /// The result of a run that has come to its `end`. Before any section is made, observers share their figures.
    ///
    /// # Errors
    /// The first error of an observer, or two sections with the same key.
    pub(crate) fn result(mut self, mut end: RunEnd<'_>) -> Result<Summary, Halt> {
        end.waited = core::mem::take(&mut self.waiting).finish();
        self.observers
            .of_sections
            .iter()
            .for_each(|observer| observer.share(&mut end.shared));
        if let Some(current) = self.current.take() {
            end.current = Some(current.sections(&end)?);
        }
        self.sections(&end)
    }

    /// Hears a row that is about to be fed, and what the filter waits for if it has not started.
    ///
    /// # Errors
    /// The first error of an observer.
    pub fn row(&mut self, row: &Row<'_>, waits_for: impl FnOnce() -> Vec<(String, String)>) -> Result<(), Halt> {
        self.waiting.row(row.time, waits_for);
        self.observers.tell(&RunEvent::Row(row))
    }

    /// Hears a row that is not fed, because it is before or after the run.
    ///
    /// # Errors
    /// The first error of an observer.
    pub fn outside(&mut self, row: &Row<'_>, is_after: bool) -> Result<(), Halt> {
        self.observers.tell(&RunEvent::Outside { row, is_after })
    }

    /// An epoch of a reference that comes along with the data.
    pub fn reference(&mut self, epoch: ReferenceEpoch) {
        self.comparisons.iter_mut().for_each(|c| c.push(epoch));
        if let Some(current) = &mut self.current {
            current.reference(epoch);
        }
    }

    /// The true state of the outermost filter at `time`, in its layout.
    pub fn truth(&mut self, time: Time, state: &[f64]) {
        self.truths.push_back((time, state.to_vec()));
        if let Some(current) = &mut self.current {
            current.truth(time, state);
        }
    }

    /// The outermost filter starts again.
    pub(super) fn begin_outermost(&mut self) {
        let outermost = self.filters.iter().find(|filter| filter.is_outermost());
        if let Some(number) = outermost.map(|filter| filter.number) {
            self.begin(number);
        }
    }

    /// The filter with this number starts again.
    fn begin(&mut self, filter: usize) {
        if let Some(comparison) = self.comparisons.get_mut(filter) {
            comparison.begin();
        }
        if let Some(turning) = self.turnings.get_mut(filter) {
            turning.begin();
        }
        if let Some(current) = &mut self.current {
            current.begin(filter);
        }
    }

    /// Reports the epochs of the reference that no estimate has reached.
    ///
    /// # Errors
    /// The first error of an observer.
    pub fn finish(&mut self) -> Result<(), Halt> {
        for (filter, comparison) in self.filters.iter().zip(&mut self.comparisons) {
            for epoch in comparison.rest() {
                let event = RunEvent::Reference {
                    filter,
                    epoch: &epoch,
                    error: None,
                };
                self.observers.tell(&event)?;
            }
        }
        self.current.as_mut().map_or(Ok(()), |current| current.finish())
    }
}

impl Memory for Hub<'_> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.comparisons.remember(tape);
        self.turnings.remember(tape);
        self.truths.remember(tape);
        self.waiting.remember(tape);
        let memories = self.observers.iter_mut().filter_map(|o| o.memory());
        memories.for_each(|memory| memory.remember(tape));
        if let Some(current) = &mut self.current {
            current.remember(tape);
        }
    }
}

impl Observer for Hub<'_> {
    fn wants_steps(&self) -> bool {
        self.observers.iter().any(|o| o.wants_steps())
    }

    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        let Some((filter, event)) = self.filters.source(event) else {
            return Ok(());
        };
        if let (Event::Current { belief }, Some(current)) = (event, &mut self.current) {
            current.on(&Event::Estimate { belief })?;
        }
        if let Event::Started { belief, .. } = event {
            if filter.is_outermost() {
                self.waiting.started(belief.time);
            }
            self.begin(filter.number);
        }
        let Event::Estimate { belief } = event else {
            return self.observers.tell(&RunEvent::Filter { filter, event });
        };
        let (reader, mut comparison) = (&mut self.readers[filter.number], self.comparisons.get_mut(filter.number));
        // A comparison needs every solution.
        let solution = &match comparison {
            Some(_) => reader.read(belief).into(),
            None => Solved::new(reader, belief),
        };
        let estimate = RunEvent::Estimate { filter, solution, belief };
        self.observers.tell(&estimate)?;
        if filter.is_outermost() {
            // Between two estimates a state is not estimated: a truth is compared only with an estimate of the same
            // time.
            while let Some((time, truth)) = self.truths.pop_front_if(|(time, _)| *time <= belief.time) {
                if time == belief.time {
                    let known = RunEvent::Truth {
                        filter,
                        belief,
                        truth: &truth,
                    };
                    self.observers.tell(&known)?;
                }
            }
        }
        let observers = &mut self.observers;
        let Some(comparison) = &mut comparison else { return Ok(()) };
        let turning = self.turnings.get_mut(filter.number).filter(|_| comparison.wants_rate());
        let rate = turning.and_then(|turning| turning.rate(belief));
        comparison.reach(solution, rate, |epoch, error| {
            observers.tell(&RunEvent::Reference { filter, epoch, error })
        })
    }
}
