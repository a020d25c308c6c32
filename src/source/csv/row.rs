//! What becomes of one row: judged, then converted.

use super::clock::Clock;
use super::declaration::{Cell, Condition, Keep, Policy, Ties};
use super::plan::Plan;
use ::csv::ByteRecord;
use fusion_core::time::Time;

/// A gap longer than this many nominal intervals is one.
const GAP: f64 = 1.5;
/// Characters of a cell that messages show.
const LONGEST_SHOWN: usize = 40;

/// What becomes of a row.
pub(super) enum Verdict {
    Used(Time),
    /// Left out as declared.
    Left(&'static str),
    /// Left out, or the end, by a policy; what is wrong, what to do.
    Wrong {
        policy: Policy,
        reason: &'static str,
        message: String,
        help: String,
    },
    /// The declared end.
    End,
}

/// How rows are read.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) file: String,
    pub(super) header: Vec<String>,
    pub(super) time_column: usize,
    pub(super) clock: Clock,
    pub(super) bad_rows: Policy,
    pub(super) backwards: Policy,
    pub(super) ties: Ties,
    pub(super) drops_repeats: bool,
    pub(super) needs_interval: bool,
    /// The nominal interval \[s\].
    pub(super) nominal: Option<f64>,
    /// Whether increments always cover the nominal interval.
    pub(super) evenly: bool,
    pub(super) keep: Option<Keep>,
    pub(super) valid: Vec<Test>,
    /// Column and sign of every cell that a channel reads.
    pub(super) cells: Vec<(usize, f64)>,
    pub(super) raw: Vec<f64>,
    pub(super) last_raw: Option<Vec<f64>>,
    pub(super) channels: Vec<(core::ops::Range<usize>, Plan)>,
    /// The last stamp in order.
    pub(super) stamp: Option<i64>,
    /// Whether no row since had an unreadable stamp.
    pub(super) is_interval_known: bool,
}

const SKIP_BAD: &str = "to leave such rows out and have them counted, write `bad_rows = \"skip\"`";

impl Row {
    /// Judges and converts row `number` of the file, from 0.
    pub(super) fn read(&mut self, number: u64, record: &ByteRecord, row: &mut [f64]) -> Verdict {
        if self.keep.is_some_and(|keep| !keep.keeps(number)) {
            return Verdict::Left("not among the rows to keep");
        }
        let (fields, named) = (record.len(), self.header.len());
        let is_trailing = fields == named + 1 && record.get(named).is_some_and(<[u8]>::is_empty);
        if fields != named && !is_trailing {
            self.is_interval_known = false;
            let few = if fields < named {
                "is it cut off?"
            } else {
                "is there a delimiter, or a decimal comma, within a field?"
            };
            return self.bad(
                format!("this row has {fields} field{}, not {named}", if fields == 1 { "" } else { "s" }),
                Some(few),
            );
        }
        let stamp = match text(record, self.time_column).map_or(Err("is not text"), |text| self.clock.read(text)) {
            Ok(stamp) => stamp,
            Err(what) => {
                self.is_interval_known = false;
                return self.bad(self.complaint(record, self.time_column, what), None);
            }
        };
        if let Some(verdict) = self.out_of_order(stamp) {
            return verdict;
        }
        let was_known = core::mem::replace(&mut self.is_interval_known, true);
        let previous = self.stamp.replace(stamp).filter(|_| was_known);
        if stamp < self.clock.start {
            return Verdict::Left("before the declared start");
        }
        if stamp >= self.clock.stop {
            return Verdict::End;
        }
        for test in &self.valid {
            match text(record, test.column).and_then(|text| test.holds(text)) {
                Some(true) => {}
                Some(false) => return Verdict::Left("not valid as declared"),
                None => return self.bad(self.complaint(record, test.column, "is not a number"), None),
            }
        }
        for (&(column, sign), raw) in self.cells.iter().zip(&mut self.raw) {
            let number = text(record, column).and_then(|text| text.parse::<f64>().ok());
            match number.filter(|number| number.is_finite()) {
                Some(number) => *raw = sign * number,
                None => {
                    let what = if number.is_some() { "is not finite" } else { "is not a number" };
                    return self.bad(self.complaint(record, column, what), None);
                }
            }
        }
        if self.drops_repeats {
            if self.last_raw.as_ref() == Some(&self.raw) {
                return Verdict::Left("repeats the values before");
            }
            self.last_raw.get_or_insert_default().clone_from(&self.raw);
        }
        let Some(interval) = self.interval(previous, stamp) else {
            return Verdict::Left("first of its increments, over an unknown interval (declare `rate`)");
        };
        // A channel makes as many numbers as it reads cells, so that both lie alike.
        for (at, plan) in &mut self.channels {
            if let Err(wrong) = plan.convert(&self.raw[at.clone()], interval, &mut row[at.clone()]) {
                return self.bad(wrong.message, wrong.help);
            }
        }
        Verdict::Used(Time::from_nanos(stamp))
    }

    fn out_of_order(&self, stamp: i64) -> Option<Verdict> {
        let last = self.stamp.filter(|last| stamp <= *last)?;
        let (now, before) = (Time::from_nanos(stamp), Time::from_nanos(last));
        if stamp < last {
            let message = format!("time runs backwards: {now} comes after {before}");
            let help = "sort the file, or leave such rows out: `time.backwards = \"skip\"`".to_owned();
            return Some(Verdict::Wrong {
                policy: self.backwards,
                reason: "time runs backwards",
                message,
                help,
            });
        }
        let policy = match self.ties {
            Ties::Keep => return None,
            Ties::Skip => Policy::Skip,
            Ties::Stop => Policy::Stop,
        };
        let message = format!("the stamp {now} is that of the row before");
        let help = "leave such rows out by `time.ties = \"skip\"`, or use them by `time.ties = \"keep\"`".to_owned();
        Some(Verdict::Wrong {
            policy,
            reason: "the stamp of the row before",
            message,
            help,
        })
    }

    /// Seconds that an increment covers; `None` where increments are wanted and it is unknown.
    fn interval(&self, previous: Option<i64>, stamp: i64) -> Option<f64> {
        if !self.needs_interval {
            return Some(1.0);
        }
        let since = previous.map(|previous| Time::from_nanos(stamp).seconds_since(Time::from_nanos(previous)));
        match (since, self.nominal) {
            (Some(since), Some(nominal)) if self.evenly || since > GAP * nominal => Some(nominal),
            (Some(since), _) => Some(since),
            (None, nominal) => nominal,
        }
    }

    fn bad(&self, message: String, help: Option<&str>) -> Verdict {
        let help = help.map_or_else(
            || SKIP_BAD.to_owned(),
            |help| format!("{help} {SKIP_BAD}").replacen("? to", "? To", 1),
        );
        Verdict::Wrong {
            policy: self.bad_rows,
            reason: "bad rows",
            message,
            help,
        }
    }

    /// What is wrong with a cell.
    fn complaint(&self, record: &ByteRecord, column: usize, what: &str) -> String {
        let content = String::from_utf8_lossy(record.get(column).unwrap_or_default());
        let shown: String = content.chars().take(LONGEST_SHOWN).collect();
        let name = self.header.get(column).map_or("", String::as_str);
        if shown.is_empty() {
            format!("column `{name}` is empty")
        } else {
            format!("`{shown}` in column `{name}` {what}")
        }
    }
}

impl Keep {
    const fn keeps(&self, number: u64) -> bool {
        match (self.every, self.except_every) {
            (Some(every), _) => number >= self.offset && (number - self.offset).is_multiple_of(every.get()),
            (None, Some(every)) => !(number >= self.offset && (number - self.offset).is_multiple_of(every.get())),
            (None, None) => true,
        }
    }
}

/// A condition whose column is known.
#[derive(Debug)]
pub(super) struct Test {
    column: usize,
    equals: Option<Vec<Cell>>,
    at_least: Option<f64>,
    at_most: Option<f64>,
}

impl Test {
    pub(super) fn new(condition: &Condition, column: usize) -> Self {
        let equals = condition.equals.as_ref().map(|cells| cells.0.clone());
        Self {
            column,
            equals,
            at_least: condition.at_least,
            at_most: condition.at_most,
        }
    }

    /// Whether the cell meets it; `None` where a number is wanted and the cell holds none.
    fn holds(&self, cell: &str) -> Option<bool> {
        let number = cell.parse::<f64>().ok();
        let is_equal = self.equals.as_ref().map_or(Some(true), |wanted| {
            let texts = wanted.iter().any(|w| matches!(w, Cell::Text(text) if text == cell));
            let numbers = wanted.iter().any(|w| matches!((w, number), (Cell::Number(w), Some(n)) if *w == n));
            let wants_text = wanted.iter().any(|w| matches!(w, Cell::Text(_)));
            (texts || numbers || wants_text || number.is_some()).then_some(texts || numbers)
        });
        let is_within = match (self.at_least, self.at_most) {
            (None, None) => Some(true),
            (least, most) => number.map(|n| least.is_none_or(|least| n >= least) && most.is_none_or(|most| n <= most)),
        };
        Some(is_equal? && is_within?)
    }
}

fn text(record: &ByteRecord, column: usize) -> Option<&str> {
    core::str::from_utf8(record.get(column)?).ok()
}
