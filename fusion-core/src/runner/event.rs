//! The runner's reports: typed events, to observers that are independent of each other.

use crate::belief::Belief;
use crate::filter::{FilterError, Rivals, Step, Update};
use crate::health::{Health, State};
use crate::runner::StreamId;
use crate::time::Time;
use alloc::boxed::Box;
use alloc::vec::Vec;

/// Why an observer cannot continue; it stops the run.
pub type Halt = Box<dyn core::error::Error + Send + Sync>;

/// The row that a measurement came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RowId {
    /// The stream.
    pub stream: StreamId,
    /// Its number within the stream's source, from [`Row::number`](super::Row::number). Rows that a stage emits are
    /// counted from 0.
    pub number: u64,
    /// Its stamp.
    pub stamp: Time,
    /// The latest stamp of all streams when the row was fed, including its own stamp: the instant of the log at which
    /// the row was present.
    pub arrival: Time,
    /// Whether a declared fault changed a number that the consumer reads. For a row that a stage emitted: whether a
    /// fault changed any number of the row that caused it.
    pub disturbed: bool,
}
crate::memory!(RowId {
    stream,
    number,
    stamp,
    arrival,
    disturbed
});

/// Why a row was not used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Discard {
    /// It came too late for the buffer.
    Late {
        /// The time up to which rows had been processed.
        now: Time,
    },
    /// It held a number that is not finite.
    NotFinite,
    /// It is not later than the row that started the filter, or the filter has not started.
    BeforeStart,
    /// A number lies outside what its instrument can measure.
    OutOfRange {
        /// Which of the consumer's numbers.
        column: usize,
    },
    /// The instrument has repeated one sample for longer than ever before.
    Frozen,
    /// A number differs from its neighbours by more than the vehicle can change.
    Spike {
        /// Which of the consumer's numbers.
        column: usize,
    },
    /// Its sensor was switched off.
    SwitchedOff,
    /// Its stamp is far ahead of all others, and too few rows have confirmed it.
    TimeJump {
        /// The latest stamp of the others.
        now: Time,
    },
}

/// An event that the runner reports to its observers.
#[derive(Debug)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The filter starts from this belief.
    Started {
        /// The initial belief.
        belief: &'a Belief,
        /// See [`Estimator::rivals`](crate::filter::Estimator::rivals).
        rivals: Rivals,
    },
    /// The estimate of an epoch: after every measurement that is valid at that time was used.
    ///
    /// An epoch is the end of an input sample; for a process driven by time alone, a time at which
    /// measurements are valid. The event comes as soon as a later row is processed, or the log ends.
    Estimate {
        /// The belief, valid at the epoch.
        belief: &'a Belief,
    },
    /// The newest estimate, after every row that is present by now: the vehicle's estimate at this moment. It is only
    /// reported if rows are used as they arrive ([`Runner::rewind`](super::Runner::rewind)). Later rows may still
    /// change it; [`Event::Estimate`] then reports the final estimate. Once per epoch.
    Current {
        /// The belief, valid at the epoch.
        belief: &'a Belief,
    },
    /// A sensor's measurement has been offered to the estimator.
    Updated {
        /// The sensor's number.
        sensor: usize,
        /// The measurement, and its outcome.
        update: Update<'a>,
        /// Time of validity.
        time: Time,
        /// Where it came from.
        row: RowId,
    },
    /// A step of the estimator, for smoothers and ledgers; reported only if an observer
    /// [wants](Observer::wants_steps) steps.
    Step(&'a Step),
    /// An initialiser has taken a row before the start. A filter that runs shows it rows only after a gap has lost the
    /// attitude, without this event.
    Taken {
        /// The initialiser's name.
        initialiser: &'a str,
        /// Which of its inputs the row was read at.
        input: usize,
    },
    /// A row was not used by one of its consumers. There is no event for a row that the process or a stage uses.
    Discarded {
        /// The consumer's name.
        consumer: &'a str,
        /// Which of its inputs the row was read at; the process and a sensor have one.
        input: usize,
        /// Its time of validity.
        time: Time,
        /// Which row it was.
        row: RowId,
        /// Why.
        why: Discard,
    },
    /// An earlier row is stamped ahead of the input, which has arrived by now: its clock is wrong, or the input's
    /// clock. The row waited, and is used when the input reaches its time.
    Ahead {
        /// The stream of the row.
        stream: StreamId,
        /// How far it is ahead \[s\].
        by: f64,
        /// The newest stamp of the input.
        time: Time,
    },
    /// There has been no usable input since `since`: the belief was moved to `time` without it, with
    /// the agility of the vehicle as process noise.
    Coasting {
        /// Where the latest input ends.
        since: Time,
        /// The belief's time.
        time: Time,
    },
    /// The input is back.
    Resumed {
        /// Where the input before the gap ends.
        since: Time,
        /// Where the first sample after it begins.
        time: Time,
    },
    /// The input has been missing for longer than the process can coast: the filter has stopped and
    /// waits for its initialisers. A new [`Event::Started`] follows when they are ready.
    Stopped {
        /// Where the latest input ends.
        since: Time,
        /// When the filter stopped.
        time: Time,
    },
    /// The filter has been lost for longer than is declared: it has given up and waits for its initialisers. A new
    /// [`Event::Started`] follows when they are ready.
    GaveUp {
        /// Since when it was lost.
        since: Time,
        /// When it gave up.
        time: Time,
    },
    /// The estimator could not continue; the belief is the last sound one.
    Failed {
        /// Why.
        error: FilterError,
    },
    /// The filter's health has changed: its state, or the reasons for it.
    Health {
        /// The present health.
        health: &'a Health,
    },
    /// An event of a filter inside a stage.
    Nested {
        /// The stage's name.
        stage: &'a str,
        /// The event of the filter inside. Its sensors and streams are numbered separately.
        event: &'a Event<'a>,
    },
}

/// Receives events. It cannot change the filter.
pub trait Observer {
    /// Called for every event, in order.
    ///
    /// # Errors
    /// If it cannot continue: the runner stops immediately and returns the error.
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt>;

    /// Whether it receives [`Event::Step`]; steps are kept only if an observer does.
    fn wants_steps(&self) -> bool {
        false
    }

    /// The state of the filter's health, if it is known: a runner asks its own watch.
    fn health(&self) -> Option<State> {
        None
    }
}

impl<F: FnMut(&Event<'_>)> Observer for F {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        self(event);
        Ok(())
    }
}

/// A list of independent observers, called one after the other.
#[derive(Default)]
pub struct Observers<'a>(Vec<&'a mut dyn Observer>);

impl<'a> Observers<'a> {
    /// Adds an observer.
    pub fn add(&mut self, observer: &'a mut dyn Observer) {
        self.0.push(observer);
    }
}

impl core::fmt::Debug for Observers<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} observers", self.0.len())
    }
}

impl Observer for Observers<'_> {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        self.0.iter_mut().try_for_each(|o| o.on(event))
    }

    fn wants_steps(&self) -> bool {
        self.0.iter().any(|o| o.wants_steps())
    }
}
