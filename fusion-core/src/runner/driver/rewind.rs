//! Going back for rows that come late.
//!
//! A design that rewinds is run by two runners. The *settled* runner holds rows back by the horizon: its reports are
//! final, each event once. The *live* runner uses rows as they arrive. If a row is valid before the rows that it has
//! used, it is restored to a snapshot from before that row, and is served everything since then again, in order. It
//! reports only its newest estimate. After the last row both have the same belief, bit for bit.
//!
//! ```text
//! rows ─┬─▶ settled: held back by the horizon ────────────────▶ events
//!       └─▶ log, by first validity ──▶ live ──▶ Event::Current
//!             ▲ back to              │ every `spacing`
//!             └────── snapshots ◀────┘
//! ```
//!
//! Rows stay in the log, and snapshots in their ring, until the settled runner has passed them: until then a row may
//! still come that is valid there. Their memory is used again.

use super::Runner;
use crate::math;
use crate::memory::{Memory, Tape, recall, save};
use crate::runner::queue::{Admission, Quarantine};
use crate::runner::rows::Copied;
use crate::runner::{Event, Halt, Observer, Row};
use crate::time::{Time, nanos};
use alloc::collections::VecDeque;
use alloc::vec::Vec;

/// How often a runner went back, and the data that it keeps for this.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rewinds {
    /// The number of times.
    pub count: u64,
    /// Rows that were used again, in all.
    pub rows: u64,
    /// The most rows that were used again at once.
    pub most: u64,
    /// Snapshots kept now, and the bytes of all.
    pub snapshots: usize,
    /// Bytes of the snapshots and rows kept now.
    pub bytes: usize,
}

/// The most resources that going back needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RewindNeeds {
    /// The longest time \[s\] from the newest row back to one that is still used.
    pub deepest: f64,
    /// The longest stretch of data \[s\] that is used again for one row.
    pub replay: f64,
    /// Snapshots kept.
    pub snapshots: usize,
    /// Bytes of one snapshot before the first row; each waiting row takes some more.
    pub snapshot_bytes: usize,
}

/// The part of a runner that uses rows as they arrive.
#[derive(Debug)]
pub(super) struct Rewind {
    live: Runner,
    /// Time between two snapshots \[ns\].
    spacing: i64,
    quarantine: Quarantine,
    log: Log,
    ring: Ring,
    /// The epoch of the estimate that was reported last.
    told: Time,
    tally: Tally,
}
crate::memory!(Rewind { live, quarantine, log, ring, told, tally; spacing });

#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    count: u64,
    rows: u64,
    most: u64,
}
crate::memory!(Tally { count, rows, most });

/// A row that may have to be used again.
#[derive(Debug, Default)]
struct Logged {
    /// The time at which the first of its consumers finds it valid.
    first: Time,
    /// The latest stamp of all streams when it came.
    arrival: Time,
    /// The row came too late for consumers for which it is valid earlier than this.
    from: Time,
    row: Copied,
}
crate::memory!(Logged { first, arrival, from, row });

impl Logged {
    /// Gives the row to the live runner.
    fn give(&self, live: &mut Runner) -> Result<(), Halt> {
        live.give(&self.row.row(), self.arrival, self.from, &mut nobody)
    }
}

/// Rows by their first validity; rows of one time in order of arrival. They are numbered from the first row of the
/// run.
#[derive(Debug, Default)]
struct Log {
    rows: VecDeque<Logged>,
    spare: Vec<Logged>,
    /// The number of the first row kept.
    start: u64,
    /// The number of the first row that the live runner has not been given.
    fed: u64,
}

impl Memory for Log {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.pooled(&mut self.rows, &mut self.spare);
        self.start.remember(tape);
        self.fed.remember(tape);
        if self.fed < self.start || self.fed - self.start > self.rows.len() as u64 {
            tape.refuse("rows are missing");
        }
    }
}

impl Log {
    /// Puts a row in its place, and returns the number of that place.
    fn put(&mut self, row: &Row<'_>, first: Time, arrival: Time, from: Time) -> u64 {
        let at = self.rows.partition_point(|logged| logged.first <= first);
        let mut logged = self.spare.pop().unwrap_or_default();
        (logged.first, logged.arrival, logged.from) = (first, arrival, from);
        logged.row.take(row);
        self.rows.insert(at, logged);
        self.start + at as u64
    }

    fn get(&self, number: u64) -> Option<&Logged> {
        self.rows.get(usize::try_from(number.checked_sub(self.start)?).ok()?)
    }

    /// The first validity of the latest row that was given.
    fn reach(&self) -> Time {
        self.fed
            .checked_sub(1)
            .and_then(|last| self.get(last))
            .map_or(Time::MIN, |logged| logged.first)
    }

    /// Forgets the rows before `number`.
    fn forget(&mut self, number: u64) {
        while self.start < number
            && let Some(row) = self.rows.pop_front()
        {
            self.spare.push(row);
            self.start += 1;
        }
    }
}

/// The memory of the live runner at one time.
#[derive(Debug, Default)]
struct Snapshot {
    bytes: Vec<u8>,
    /// The number of the first row that it had not been given.
    fed: u64,
    /// The time up to which it had been given rows; it had not used or looked at any later row.
    reach: Time,
    /// The time up to which it had used rows.
    released: Time,
}
crate::memory!(Snapshot {
    bytes,
    fed,
    reach,
    released
});

/// Snapshots in order of time, in memory that is used again.
#[derive(Debug, Default)]
struct Ring {
    snapshots: VecDeque<Snapshot>,
    spare: Vec<Snapshot>,
}

impl Memory for Ring {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.pooled(&mut self.snapshots, &mut self.spare);
    }
}

impl Ring {
    fn take(&mut self, live: &mut Runner, log: &Log) {
        let mut snapshot = self.spare.pop().unwrap_or_default();
        snapshot.bytes.clear();
        save(live, &mut snapshot.bytes);
        snapshot.fed = log.fed;
        snapshot.released = live.queue().released();
        snapshot.reach = log.reach().max(live.queue().reached());
        self.snapshots.push_back(snapshot);
    }

    /// Drops the newest snapshots while they are `unfit`, but never the oldest.
    fn drop_newest(&mut self, unfit: impl Fn(&Snapshot) -> bool) {
        while self.snapshots.len() > 1 && self.snapshots.back().is_some_and(&unfit) {
            self.spare.extend(self.snapshots.pop_back());
        }
    }
}

impl Rewind {
    /// Lets `live` use rows as they arrive, with a snapshot every `spacing` seconds.
    pub(super) fn new(live: Runner, spacing: f64, quarantine: Quarantine) -> Self {
        Self {
            live,
            spacing: nanos(spacing),
            quarantine,
            log: Log::default(),
            ring: Ring::default(),
            told: Time::MIN,
            tally: Tally::default(),
        }
    }

    pub(super) const fn live(&self) -> &Runner {
        &self.live
    }

    pub(super) const fn live_mut(&mut self) -> &mut Runner {
        &mut self.live
    }

    /// The most resources that it needs, if the settled runner holds rows back by `deepest` seconds.
    pub(super) fn needs(&mut self, deepest: f64) -> RewindNeeds {
        let mut bytes = Vec::new();
        save(&mut self.live, &mut bytes);
        let spacing = self.spacing as f64 * 1e-9;
        RewindNeeds {
            deepest,
            replay: deepest + spacing,
            // One snapshot before the oldest row that may come, and the snapshot being taken.
            snapshots: math::ceil(deepest / spacing) as usize + 2,
            snapshot_bytes: bytes.len(),
        }
    }

    /// How often it went back.
    pub(super) fn count(&self) -> Rewinds {
        let row = |r: &Logged| size_of::<Logged>() + 8 * r.row.row().values.len();
        let snapshots = &self.ring.snapshots;
        Rewinds {
            count: self.tally.count,
            rows: self.tally.rows,
            most: self.tally.most,
            snapshots: snapshots.len(),
            bytes: snapshots.iter().map(|s| s.bytes.len()).sum::<usize>() + self.log.rows.iter().map(row).sum::<usize>(),
        }
    }

    /// Takes a row. The settled runner had reached the time `from` before it, and has reached `settled` now.
    pub(super) fn feed(&mut self, row: &Row<'_>, from: Time, settled: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let admission = self.quarantine.admit(row, self.live.queue().watermark());
        if admission != Admission::Wait {
            while let Some(held) = self.quarantine.release() {
                if admission == Admission::Confirms {
                    self.arrive(&held.row(), from)?;
                }
                self.quarantine.give_back(held);
            }
        }
        if matches!(admission, Admission::Wait | Admission::Replaces) {
            self.quarantine.hold(row);
            return Ok(());
        }
        self.arrive(row, from)?;
        self.age(settled);
        self.tell(observer)
    }

    /// Uses the remaining rows: the end of the log.
    pub(super) fn finish(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        self.live.take_end(&mut nobody)?;
        self.tell(observer)
    }

    /// Reports the newest estimate, once.
    fn tell(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        let belief = self.live.belief();
        if belief.time <= self.told || !self.live.scheduler().has_started_before(belief.time) {
            return Ok(());
        }
        self.told = belief.time;
        observer.on(&Event::Current { belief })
    }

    fn arrive(&mut self, row: &Row<'_>, from: Time) -> Result<(), Halt> {
        if self.ring.snapshots.is_empty() {
            self.ring.take(&mut self.live, &self.log);
        }
        self.live.note(row.time);
        let queue = self.live.queue();
        let Some(first) = queue.first_validity(row, from) else {
            return self.go_on();
        };
        let number = self.log.put(row, first, queue.watermark(), from);
        if queue.has_passed(row, from) {
            self.ring.drop_newest(|snapshot| snapshot.reach >= first);
            self.go_back();
        } else {
            // A snapshot with rows that are later in the log does not contain this row.
            self.ring.drop_newest(|snapshot| snapshot.fed > number);
            if number < self.log.fed {
                self.log.fed += 1;
                let Self { live, log, .. } = self;
                if let Some(logged) = log.get(number) {
                    logged.give(live)?;
                }
            }
        }
        self.go_on()
    }

    /// Back to the newest snapshot.
    fn go_back(&mut self) {
        let Some(snapshot) = self.ring.snapshots.back() else { return };
        let watermark = self.live.queue().watermark();
        // The live runner wrote these bytes itself.
        let _ = recall(&mut self.live, &snapshot.bytes);
        self.live.note(watermark);
        let again = self.log.fed.saturating_sub(snapshot.fed);
        self.log.fed = snapshot.fed;
        self.tally.count += 1;
        self.tally.rows += again;
        self.tally.most = self.tally.most.max(again);
    }

    /// Serves the live runner all present rows, in order. A row is given before anything is served that might look at
    /// it.
    fn go_on(&mut self) -> Result<(), Halt> {
        let Self {
            live, log, ring, spacing, ..
        } = self;
        let end = live.queue().watermark().shifted(-live.queue().lag());
        loop {
            let next = log.get(log.fed);
            let before = next.map_or(Time::MAX, |row| row.first.shifted(-live.queue().foresight() - 1));
            live.serve(before.min(end), &mut nobody)?;
            let is_due = |last: &Snapshot| live.queue().released() > last.released.shifted(*spacing);
            if ring.snapshots.back().is_some_and(is_due) {
                ring.take(live, log);
            }
            let Some(next) = next else { return Ok(()) };
            next.give(live)?;
            log.fed += 1;
        }
    }

    /// Forgets the data that no future row can need. The settled runner is at `settled`.
    fn age(&mut self, settled: Time) {
        let ring = &mut self.ring;
        while ring.snapshots.get(1).is_some_and(|second| second.reach < settled) {
            ring.spare.extend(ring.snapshots.pop_front());
        }
        if let Some(oldest) = ring.snapshots.front() {
            // The last of these rows shows how far the live runner had come.
            self.log.forget(oldest.fed.saturating_sub(1));
        }
    }
}

/// Ignores all events: the settled runner reports them, once.
fn nobody(_: &Event<'_>) {}
