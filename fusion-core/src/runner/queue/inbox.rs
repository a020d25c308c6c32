//! The queue itself.

use super::ahead::Ahead;
use super::order::{Entry, Order};
use super::pool::Rows;
use super::quarantine::{Admission, Quarantine};
use super::release::Release;
use crate::memory::{Memory, Tape};
use crate::runner::consumer::{Consumer, Delays, Refused, Route};
use crate::runner::rows::{Copied, Stored};
use crate::runner::{Discard, Row, RowId, StreamId, WrongWidth};
use crate::time::{Time, nanos};
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

#[derive(Clone, Debug)]
struct Stream {
    name: String,
    width: usize,
}

/// Rows in order of their time of validity.
#[derive(Debug)]
pub(crate) struct Queue {
    streams: Vec<Stream>,
    /// The consumers, in the order in which they are informed of a row that they do not get.
    routes: Vec<Route>,
    release: Release,
    quarantine: Quarantine,
    /// How far the input is, compared with the other rows.
    ahead: Ahead,
    order: Order,
    rows: Rows,
    /// The latest stamp of all streams.
    watermark: Time,
    /// The time up to which rows have been served.
    released: Time,
    /// The consumer that was served last, at that time.
    serving: Consumer,
    /// The time up to which rows have been looked at.
    seen: Time,
}

impl Memory for Queue {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.watermark.remember(tape);
        self.released.remember(tape);
        self.serving.remember(tape);
        self.seen.remember(tape);
        self.quarantine.remember(tape);
        self.ahead.remember(tape);
        self.rows.remember(tape);
        self.order.remember(tape);
    }
}

/// Declarations, before the first row.
impl Queue {
    /// A queue whose rows may arrive up to `buffer` \[ns\] out of order.
    pub(crate) fn new(buffer: i64) -> Self {
        Self {
            streams: Vec::new(),
            routes: Vec::new(),
            release: Release {
                buffer,
                is_live: false,
                delays: Delays::default(),
            },
            quarantine: Quarantine::new(f64::INFINITY),
            ahead: Ahead::default(),
            order: Order::new(),
            rows: Rows::default(),
            watermark: Time::MIN,
            released: Time::MIN,
            serving: Consumer::Input,
            seen: Time::MIN,
        }
    }

    /// Adds a stream of rows of `width` numbers and returns its number.
    pub(crate) fn add_stream(&mut self, name: &str, width: usize) -> StreamId {
        self.streams.push(Stream {
            name: name.to_owned(),
            width,
        });
        self.streams.len() - 1
    }

    /// Name and width of the streams, in order of their numbers.
    pub(crate) fn streams(&self) -> impl Iterator<Item = (&str, usize)> {
        self.streams.iter().map(|s| (s.name.as_str(), s.width))
    }

    /// The width of a stream; 0 if there is no such stream.
    pub(crate) fn width(&self, stream: StreamId) -> usize {
        self.streams.get(stream).map_or(0, |s| s.width)
    }

    /// Sets the consumers, and the delays that they declare.
    pub(crate) fn connect(&mut self, routes: Vec<Route>, delays: Delays) {
        self.routes = routes;
        self.release.delays = delays;
    }

    /// Rows whose stamps are more than `seconds` ahead of all others wait for confirmation.
    pub(crate) fn limit_jumps(&mut self, seconds: f64) {
        self.quarantine = Quarantine::new(seconds);
    }

    /// A quarantine with the same limit and the same memory.
    pub(crate) fn quarantine(&self) -> Quarantine {
        self.quarantine.clone()
    }

    /// Rows are used as they arrive from now on.
    pub(crate) const fn use_at_once(&mut self) {
        self.release.is_live = true;
    }

    /// Rows may arrive `horizon` seconds later than before.
    pub(crate) fn hold_longer(&mut self, horizon: f64) {
        self.release.buffer += nanos(horizon);
    }
}

/// How far it is.
impl Queue {
    /// How long rows are held back \[ns\].
    pub(crate) fn lag(&self) -> i64 {
        self.release.lag()
    }

    /// How far ahead of the served time rows may be looked at \[ns\].
    pub(crate) fn foresight(&self) -> i64 {
        self.release.foresight()
    }

    /// The latest stamp of all streams.
    pub(crate) const fn watermark(&self) -> Time {
        self.watermark
    }

    /// Notes a stamp.
    pub(crate) fn note(&mut self, stamp: Time) {
        self.watermark = self.watermark.max(stamp);
    }

    /// The time up to which rows have been served.
    pub(crate) const fn released(&self) -> Time {
        self.released
    }

    /// The time up to which rows have been served, or looked at.
    pub(crate) fn reached(&self) -> Time {
        self.released.max(self.seen)
    }

    /// Rows up to `time` have been looked at.
    pub(crate) fn see(&mut self, time: Time) {
        self.seen = self.seen.max(time);
    }

    /// Every row that is valid at `time` or earlier comes too late from now on.
    pub(crate) fn pass(&mut self, time: Time) {
        if self.released <= time {
            (self.released, self.serving) = (time, Consumer::LAST);
        }
    }

    /// Whether anything that comes after `row` has been served or looked at, for a consumer that finds it valid at
    /// `from` or later.
    pub(crate) fn has_passed(&self, row: &Row<'_>, from: Time) -> bool {
        self.validity(row).any(|(time, consumer)| {
            let is_behind = (time, consumer) < (self.released, self.serving) || time <= self.seen;
            time >= from && is_behind
        })
    }

    /// The earliest time at which a consumer finds `row` valid, not before `from`; `None` if there is no such
    /// consumer.
    pub(crate) fn first_validity(&self, row: &Row<'_>, from: Time) -> Option<Time> {
        self.validity(row).map(|(time, _)| time).filter(|time| *time >= from).min()
    }

    /// When `row` is valid for each of its consumers.
    fn validity(&self, row: &Row<'_>) -> impl Iterator<Item = (Time, Consumer)> {
        let (stream, stamp) = (row.stream, row.time);
        let routes = self.routes.iter().filter(move |route| route.port.stream == stream);
        routes.map(move |route| (stamp.shifted(-route.port.delay), route.consumer))
    }
}

/// Rows come in.
impl Queue {
    /// Whether the stamp of a row is far ahead of all others.
    pub(crate) fn doubts(&self, row: &Row<'_>) -> bool {
        self.quarantine.doubts(row, self.watermark)
    }

    /// Judges the stamp of a row. A row that has to wait for others is copied.
    ///
    /// # Errors
    /// The row has another width than its stream; nothing has changed.
    pub(crate) fn admit(&mut self, row: &Row<'_>) -> Result<Admission, WrongWidth> {
        let (wanted, found) = (self.width(row.stream), row.values.len());
        if found != wanted {
            return Err(WrongWidth { wanted, found });
        }
        Ok(self.quarantine.admit(row, self.watermark))
    }

    /// A row waits for others to confirm its stamp.
    pub(crate) fn suspend(&mut self, row: &Row<'_>) {
        self.quarantine.hold(row);
    }

    /// The first row that waits for others to confirm its stamp, lent until it is [given back](Queue::give_back).
    pub(crate) fn suspended(&mut self) -> Option<Copied> {
        self.quarantine.release()
    }

    /// Takes the memory of a row that waited.
    pub(crate) fn give_back(&mut self, row: Copied) {
        self.quarantine.give_back(row);
    }

    /// No consumer gets a row whose stamp no other row has confirmed; each is passed to `refuse`.
    pub(crate) fn refuse<E>(&self, row: &Row<'_>, refuse: impl FnMut(Refused) -> Result<(), E>) -> Result<(), E> {
        let why = Discard::TimeJump { now: self.watermark };
        let routes = self.routes.iter().filter(|route| route.port.stream == row.stream);
        let mut refused = routes.map(|route| Refused {
            consumer: route.consumer,
            time: row.time.shifted(-route.port.delay),
            row: RowId::of(row, self.watermark, &route.port.columns),
            why,
        });
        refused.try_for_each(refuse)
    }

    /// Takes a row that came at `arrival`, once for each of its consumers. It is late for a consumer for which it is
    /// valid before the last served time, or before `from`; this is passed to `refuse`.
    pub(crate) fn put<E>(
        &mut self,
        row: &Row<'_>,
        arrival: Time,
        from: Time,
        mut refuse: impl FnMut(Refused) -> Result<(), E>,
    ) -> Result<(), E> {
        let at = self.rows.put(row, arrival);
        let now = self.released.max(from);
        let mut done = Ok(());
        for route in self.routes.iter().filter(|route| route.port.stream == row.stream) {
            let mut time = row.time.shifted(-route.port.delay);
            if route.takes_late {
                time = time.max(now);
            }
            let consumer = route.consumer;
            if time >= now {
                self.rows.hold(at);
                self.order.put(Entry { time, consumer, row: at });
                continue;
            }
            let (row, why) = (self.rows.get(at).id(&route.port.columns), Discard::Late { now });
            done = refuse(Refused { consumer, time, row, why });
            if done.is_err() {
                break;
            }
        }
        self.rows.free_unused(at);
        done
    }

    /// The time up to which rows are released, `row` being the newest, because later rows wait for the input. Its
    /// samples each cover at most `longest` \[ns\]. If `row` is of the input and shows that an earlier row was further
    /// ahead than that: the stream of that row, and the difference \[s\].
    pub(crate) fn due(&mut self, row: &Row<'_>, longest: i64) -> (Time, Option<(StreamId, f64)>) {
        let mut was_ahead = None;
        let mut reach = self.watermark;
        let input = self.routes.first().filter(|route| route.consumer == Consumer::Input);
        if let Some(input) = input {
            if row.stream == input.port.stream {
                was_ahead = self.ahead.input(row, longest);
            } else {
                self.ahead.other(row);
            }
            reach = reach.min(self.ahead.reach(longest));
        }
        (reach.shifted(-self.lag()), was_ahead)
    }
}

/// Rows go out.
impl Queue {
    /// When the next row is valid, if not after `until`.
    pub(crate) fn next(&self, until: Time) -> Option<Time> {
        self.order.first().map(|entry| entry.time).filter(|time| *time <= until)
    }

    /// Takes the next row for one of its consumers, which has to [release](Queue::release) it.
    pub(crate) fn take(&mut self) -> Option<Entry> {
        let entry = self.order.take()?;
        (self.released, self.serving) = (entry.time, entry.consumer);
        Some(entry)
    }

    /// Puts a row that was taken into the queue again, for another consumer or time.
    pub(crate) fn put_again(&mut self, entry: Entry) {
        self.order.put(entry);
    }

    /// Row number `at`.
    pub(crate) fn row(&self, at: usize) -> &Stored {
        self.rows.get(at)
    }

    /// A consumer has used row number `at`.
    pub(crate) fn release(&mut self, at: usize) {
        self.rows.release(at);
    }

    /// When row number `at` is valid for sensor number `sensor`, if it is in the queue.
    pub(crate) fn waits_for(&self, sensor: usize, at: usize) -> Option<Time> {
        let mut entries = self.order.iter();
        entries.find(|e| e.consumer.is_sensor(sensor) && e.row == at).map(|e| e.time)
    }

    /// The rows in the queue for the input that are valid up to `certain`.
    pub(crate) fn coming(&self, certain: Time) -> impl Iterator<Item = (Time, &[f64])> + Clone {
        let rows = self.order.iter().take_while(move |e| e.time <= certain);
        let rows = rows.filter(|e| e.consumer == Consumer::Input);
        rows.map(|e| (e.time, self.rows.get(e.row).values()))
    }

    /// The time up to which all rows of the input are present, for any order of arrival, once rows up to `time` have
    /// been served.
    pub(crate) fn certain(&self, time: Time) -> Time {
        time.shifted(self.release.foreknown())
    }

    /// Whether row number `at` is kept and has the width of its stream.
    pub(crate) fn holds(&self, at: usize) -> bool {
        self.rows.holds(at, |stream| self.streams.get(stream).map(|s| s.width))
    }

    /// Whether every row in the queue is kept, for a consumer that `exists`.
    pub(crate) fn is_consistent(&self, exists: impl Fn(Consumer) -> bool) -> bool {
        self.order.iter().all(|entry| self.holds(entry.row) && exists(entry.consumer))
    }
}
