//! Decodes one row: checks it, then makes its channels from its cells.

use super::ahead::Ahead;
use super::channel::{ChannelPlan, Wrong};
use super::clock::Clock;
use super::condition::Test;
use super::jump::{self, After, Jumps};
use super::plan::Plan;
use super::raw::RawRows;
use super::spec::{Interval, Keep, Policy, Ties};
use crate::rows::DAMAGED;
use core::ops::Range;
use fusion_core::time::Time;

/// An interval longer than this many nominal intervals is a gap.
const GAP: f64 = 1.5;
/// Characters of a cell that messages show.
const LONGEST_SHOWN: usize = 40;

/// Marks the cells of a channel that is not valid; numbers that are read are always finite.
const NOT_VALID: f64 = f64::INFINITY;

const SKIP_BAD: &str = "to leave such rows out and have them counted, write `bad_rows = \"skip\"`";

/// Why a row is not used.
pub(super) enum Unused {
    /// Left out as declared.
    Left(&'static str),
    /// Left out, or the end, by a policy.
    Wrong(Refusal),
    /// The declared end.
    End,
}

/// The mistake of a row, and how to correct it.
pub(super) struct Refusal {
    pub(super) policy: Policy,
    pub(super) reason: &'static str,
    pub(super) message: String,
    pub(super) help: String,
}

/// How the rows of a file are decoded, and the state kept from row to row.
#[derive(Debug)]
pub(super) struct Judge {
    clock: Clock,
    jumps: Jumps,
    bad_rows: Policy,
    backwards: Policy,
    ties: Ties,
    keep: Option<Keep>,
    valid: Vec<Test>,
    /// The conditions of each channel.
    valid_channels: Vec<Vec<Test>>,
    /// The cells of each channel.
    terms: Vec<Vec<Term>>,
    channels: Vec<Placed>,
    needs_interval: bool,
    /// Rows are decoded while they arrive, without those after them.
    is_live: bool,
    /// The nominal interval \[s\].
    nominal: Option<f64>,
    /// Whether increments always cover the nominal interval.
    is_even: bool,
    drops_repeats: bool,
    /// The sum of the cells of the current row, for each number that a channel reads.
    numbers: Vec<f64>,
    /// The numbers of the last row that did not repeat the row before.
    last_numbers: Option<Vec<f64>>,
    /// The last stamp in order, of a row that is valid.
    stamp: Option<i64>,
    /// The latest two different stamps of the file, of valid rows or not.
    seen: [Option<i64>; 2],
    /// Whether all stamps since then were readable.
    is_interval_known: bool,
}

/// A cell that a channel reads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    pub(super) column: usize,
    pub(super) sign: f64,
    /// The number of the channel to which it is added.
    pub(super) number: usize,
}

/// A channel with its input range in the numbers of the row, and its output range in the values.
#[derive(Debug)]
struct Placed {
    read: Range<usize>,
    made: Range<usize>,
    plan: ChannelPlan,
}

/// Where the inputs of the checks are in a row.
#[derive(Debug)]
pub(super) struct Places {
    /// The columns of the stamp.
    pub(super) stamp: Vec<usize>,
    /// The cells of each channel.
    pub(super) terms: Vec<Vec<Term>>,
    /// The conditions of the row and of each channel.
    pub(super) valid: Vec<Test>,
    pub(super) valid_channels: Vec<Vec<Test>>,
}

impl Places {
    /// All columns that are read, in order.
    pub(super) fn columns(&self) -> Vec<usize> {
        let terms = self.terms.iter().flatten().map(|term| term.column);
        let tests = self.valid.iter().chain(self.valid_channels.iter().flatten());
        let tests = tests.map(|test| test.column);
        let mut all: Vec<usize> = self.stamp.iter().copied().chain(terms).chain(tests).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

impl Judge {
    pub(super) fn new(plan: Plan<'_>, places: Places, is_live: bool) -> Self {
        let Plan { spec, mut clock, channels } = plan;
        let Places {
            stamp,
            terms,
            valid,
            valid_channels,
        } = places;
        clock.place(stamp);
        let (mut read, mut made) = (0, 0);
        let place = |plan: ChannelPlan| {
            let (from, to) = (read, made);
            (read, made) = (from + plan.inputs.len(), to + plan.channel.width);
            Placed {
                read: from..read,
                made: to..made,
                plan,
            }
        };
        let width = channels.iter().map(|channel| channel.inputs.len()).sum();
        let nominal = spec.rate.map(|rate| 1.0 / rate.si());
        Self {
            clock,
            jumps: Jumps::new(spec.timing.max_jump.map(|d| d.si()), nominal),
            bad_rows: if is_live { Policy::Skip } else { spec.bad_rows },
            is_live,
            backwards: spec.timing.backwards,
            ties: spec.timing.ties,
            keep: spec.keep,
            valid,
            valid_channels,
            numbers: vec![0.0; width],
            terms,
            needs_interval: channels.iter().any(|channel| channel.increment),
            channels: channels.into_iter().map(place).collect(),
            nominal,
            is_even: spec.interval == Interval::Nominal,
            drops_repeats: spec.drops_repeats(),
            last_numbers: None,
            stamp: None,
            seen: [None; 2],
            is_interval_known: false,
        }
    }

    /// Whether any row had a stamp in order.
    pub(super) const fn has_seen_a_stamp(&self) -> bool {
        self.stamp.is_some()
    }

    /// Checks the current row, number `number` of the file from 0, and writes its numbers.
    pub(super) fn decode(&mut self, number: u64, raw: &mut Ahead<impl RawRows>, values: &mut [f64]) -> Result<Time, Unused> {
        if self.keep.is_some_and(|keep| !keep.keeps(number)) {
            return Err(Unused::Left("not among the rows to keep"));
        }
        if !self.is_valid(&*raw)? {
            self.pass(&*raw, number);
            return Err(Unused::Left("not valid as declared"));
        }
        let stamp = self.stamp(&*raw, number)?;
        self.check_order(stamp)?;
        self.check_jump(stamp, raw, number)?;
        let raw = &*raw;
        self.clock.took();
        let was_known = core::mem::replace(&mut self.is_interval_known, true);
        let last = self.stamp.replace(stamp);
        if let Some(last) = last {
            self.jumps.took(stamp.saturating_sub(last));
        }
        let before = self.before(stamp);
        // A nominal interval makes rows that are left out, and rows of another instrument, harmless.
        let previous = if self.nominal.is_some() { last } else { before }.filter(|_| was_known);
        if stamp < self.clock.start {
            return Err(Unused::Left("before the declared start"));
        }
        if stamp >= self.clock.stop {
            return Err(Unused::End);
        }
        self.read_cells(raw)?;
        if self.drops_repeats {
            if self.last_numbers.as_ref() == Some(&self.numbers) {
                return Err(Unused::Left("repeats the values before"));
            }
            self.last_numbers.get_or_insert_default().clone_from(&self.numbers);
        }
        let Some(interval) = self.interval(previous, stamp) else {
            let reason = "first of its increments, over an unknown interval (declare `rate`)";
            return Err(Unused::Left(reason));
        };
        for Placed { read, made, plan } in &mut self.channels {
            let (numbers, out) = (&self.numbers[read.clone()], &mut values[made.clone()]);
            if numbers.contains(&NOT_VALID) {
                out.fill(f64::NAN);
            } else if let Err(Wrong { message, help }) = plan.convert(numbers, interval, out) {
                return Err(self.bad(message, help));
            }
        }
        Ok(Time::from_nanos(stamp))
    }

    /// Returns true if a well-formed row meets the conditions of its source.
    fn is_valid(&mut self, raw: &impl RawRows) -> Result<bool, Unused> {
        if let Some(malformed) = raw.malformed() {
            self.is_interval_known = false;
            if !malformed.is_last {
                return Err(self.bad(malformed.message, Some(malformed.help)));
            }
            return Err(Unused::Wrong(Refusal {
                policy: Policy::Skip,
                reason: DAMAGED,
                message: malformed.message,
                help: String::new(),
            }));
        }
        self.meets(&self.valid, raw)
    }

    /// Passes over a row that is not valid, perhaps of another instrument. Its stamp still ends an interval.
    fn pass(&mut self, raw: &impl RawRows, number: u64) {
        let stamp = self.clock.read(raw, number);
        if self.stamp.is_none() {
            self.clock.forget_first();
        }
        match stamp {
            Ok(stamp) if self.seen[1].is_none_or(|latest| latest < stamp) => self.seen = [self.seen[1], Some(stamp)],
            Ok(_) => {}
            Err(_) => self.is_interval_known = false,
        }
    }

    /// The latest stamp of the file before `stamp`, which is of a valid row.
    fn before(&mut self, stamp: i64) -> Option<i64> {
        let before = self.seen.into_iter().flatten().filter(|seen| *seen < stamp).max();
        self.seen = [before, Some(stamp)];
        before
    }

    /// The stamp of a row; after a row with an unreadable stamp the interval is unknown.
    fn stamp(&mut self, raw: &impl RawRows, number: u64) -> Result<i64, Unused> {
        self.clock.read(raw, number).map_err(|(column, what)| {
            self.is_interval_known = false;
            self.bad_cell(raw, column, what)
        })
    }

    fn check_order(&self, stamp: i64) -> Result<(), Unused> {
        let Some(last) = self.stamp.filter(|last| stamp <= *last && !self.is_live) else {
            return Ok(());
        };
        let (now, before) = (Time::from_nanos(stamp), Time::from_nanos(last));
        if stamp < last {
            return Err(Unused::Wrong(Refusal {
                policy: self.backwards,
                reason: "time runs backwards",
                message: format!("time runs backwards: {now} comes after {before}"),
                help: "sort the file, or leave such rows out: `time.backwards = \"skip\"`".to_owned(),
            }));
        }
        let policy = match self.ties {
            Ties::Keep => return Ok(()),
            Ties::Skip => Policy::Skip,
            Ties::Stop => Policy::Stop,
        };
        Err(Unused::Wrong(Refusal {
            policy,
            reason: "the stamp of the row before",
            message: format!("the stamp {now} is equal to that of the row before"),
            help: "leave such rows out by `time.ties = \"skip\"`, or use them by `time.ties = \"keep\"`".to_owned(),
        }))
    }

    /// Accepts a stamp that jumps ahead if none of the following stamps goes back.
    fn check_jump(&mut self, stamp: i64, raw: &mut Ahead<impl RawRows>, number: u64) -> Result<(), Unused> {
        if self.is_live || !self.jumps.is_in_doubt(self.stamp, stamp) {
            return Ok(());
        }
        let (mut after, mut before) = (After::Nothing, None);
        for later in 1..=jump::LONGEST_RUN {
            if !raw.look(later) {
                break;
            }
            if raw.malformed().is_none()
                && let Ok(next) = self.clock.read_after(&*raw, number + later as u64, &mut before)
            {
                after = After::Stamp(next, later);
                if self.jumps.goes_back(self.stamp, stamp, next) {
                    break;
                }
            }
        }
        raw.look(0);
        let Some(message) = self.jumps.refute(self.stamp, stamp, after) else {
            return Ok(());
        };
        self.is_interval_known = false;
        if self.stamp.is_none() {
            self.clock.forget_first();
        }
        Err(Unused::Wrong(Refusal {
            policy: Policy::Skip,
            reason: "time jumps ahead",
            message,
            help: String::new(),
        }))
    }

    /// Whether a row meets these conditions.
    fn meets(&self, conditions: &[Test], raw: &impl RawRows) -> Result<bool, Unused> {
        for test in conditions {
            match test.holds(raw.cell(test.column)) {
                Some(true) => {}
                Some(false) => return Ok(false),
                None => return Err(self.bad_cell(raw, test.column, "is not a number")),
            }
        }
        Ok(true)
    }

    fn read_cells(&mut self, raw: &impl RawRows) -> Result<(), Unused> {
        for channel in 0..self.channels.len() {
            let at = self.channels[channel].read.clone();
            if !self.meets(&self.valid_channels[channel], raw)? {
                self.numbers[at].fill(NOT_VALID);
                continue;
            }
            let numbers = &mut self.numbers[at];
            // Starts at −0, so that the sum of one cell is exactly the cell, even for a zero of either sign.
            numbers.fill(-0.0);
            for term in &self.terms[channel] {
                match raw.cell(term.column).number() {
                    Some(number) if number.is_finite() => numbers[term.number] += term.sign * number,
                    Some(_) => return Err(self.bad_cell(raw, term.column, "is not finite")),
                    None => return Err(self.bad_cell(raw, term.column, "is not a number")),
                }
            }
        }
        Ok(())
    }

    /// Seconds that an increment covers; `None` if increments need the interval and it is unknown.
    fn interval(&self, previous: Option<i64>, stamp: i64) -> Option<f64> {
        if !self.needs_interval {
            return Some(1.0);
        }
        let since = previous.map(|previous| Time::from_nanos(stamp).seconds_since(Time::from_nanos(previous)));
        match (since, self.nominal) {
            (Some(since), Some(nominal)) if self.is_even || since > GAP * nominal => Some(nominal),
            (Some(since), _) => Some(since),
            (None, nominal) => nominal,
        }
    }

    fn bad(&self, message: String, help: Option<&str>) -> Unused {
        let help = match help {
            Some(question) if question.ends_with('?') => format!("{question} T{}", &SKIP_BAD[1..]),
            Some(help) => format!("{help}; {SKIP_BAD}"),
            None => SKIP_BAD.to_owned(),
        };
        Unused::Wrong(Refusal {
            policy: self.bad_rows,
            reason: "bad rows",
            message,
            help,
        })
    }

    /// Reports a wrong cell.
    fn bad_cell(&self, raw: &impl RawRows, column: usize, what: &str) -> Unused {
        let shown: String = raw.cell(column).shown().chars().take(LONGEST_SHOWN).collect();
        let name = raw.columns().get(column).map_or("", String::as_str);
        let message = if shown.is_empty() {
            format!("column `{name}` is empty")
        } else {
            format!("`{shown}` in column `{name}` {what}")
        };
        self.bad(message, None)
    }
}
