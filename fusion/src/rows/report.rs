//! The rows that a source delivered, and the rows that it left out, with the reasons.

use core::fmt;
use fusion_core::memory;
use fusion_core::memory::{Memory, Tape};
use fusion_core::time::Time;
use std::borrow::Cow;

/// Examples kept per reason.
const EXAMPLES: usize = 3;

/// The reason of a row that reports damage of its file. Its example is the damage in words.
pub(crate) const DAMAGED: &str = "the file is damaged";

/// A row that was left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Example {
    /// Its number in the file, from 1.
    pub number: usize,
    /// The unit of the number: `line`, or `message`.
    pub counted: Cow<'static, str>,
    /// The text found there.
    pub what: String,
}

impl Memory for Example {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.number.remember(tape);
        self.counted.to_mut().remember(tape);
        self.what.remember(tape);
    }
}

/// Rows that were left out for one reason.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Skipped {
    /// The reason.
    pub reason: String,
    /// How many.
    pub count: u64,
    /// The first such rows; empty if the reason says everything.
    pub examples: Vec<Example>,
}

memory!(Skipped { reason, count, examples });

/// The result of reading a source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceReport {
    /// Rows read.
    pub rows: u64,
    /// Rows delivered.
    pub used: u64,
    /// Rows left out, by reason, in the order in which the reasons came up.
    pub skipped: Vec<Skipped>,
    /// Rows delivered but disturbed, by fault.
    pub disturbed: Vec<(String, u64)>,
    /// Stamp of the first row delivered.
    pub first: Option<Time>,
    /// Stamp of the last row delivered.
    pub last: Option<Time>,
    /// The longest stretch between two rows delivered: where it begins, and its seconds.
    pub longest_gap: Option<(Time, f64)>,
    /// Columns of its file that no channel reads.
    pub unread: Vec<String>,
}

/// Without the columns, which the next reader finds again.
impl Memory for SourceReport {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.rows.remember(tape);
        self.used.remember(tape);
        self.skipped.remember(tape);
        self.disturbed.remember(tape);
        self.first.remember(tape);
        self.last.remember(tape);
        self.longest_gap.remember(tape);
    }
}

impl SourceReport {
    /// Seconds from the first row delivered to the last.
    #[must_use]
    pub fn span(&self) -> f64 {
        self.first.zip(self.last).map_or(0.0, |(first, last)| last.seconds_since(first))
    }

    /// Rows delivered per second; `None` where there are no two stamps.
    #[must_use]
    pub fn mean_rate(&self) -> Option<f64> {
        let span = self.span();
        (span > 0.0).then(|| (self.used.saturating_sub(1)) as f64 / span)
    }

    /// Adds the report of the rows that came after these, by another reader of the source.
    pub fn join(&mut self, later: Self) {
        self.rows += later.rows;
        self.used += later.used;
        for skipped in later.skipped {
            match self.skipped.iter_mut().find(|known| known.reason == skipped.reason) {
                Some(known) => {
                    known.count += skipped.count;
                    known.examples.extend(skipped.examples);
                    known.examples.truncate(EXAMPLES);
                }
                None => self.skipped.push(skipped),
            }
        }
        for (fault, count) in later.disturbed {
            match self.disturbed.iter_mut().find(|(known, _)| *known == fault) {
                Some((_, known)) => *known += count,
                None => self.disturbed.push((fault, count)),
            }
        }
        let between = self.last.zip(later.first).map(|(last, first)| (last, first.seconds_since(last)));
        let gaps = [self.longest_gap, between, later.longest_gap].into_iter().flatten();
        self.longest_gap = gaps.max_by(|a, b| a.1.total_cmp(&b.1));
        self.first = self.first.or(later.first);
        self.last = later.last.or(self.last);
        self.unread = later.unread;
    }

    /// Adds a row that is delivered.
    pub fn deliver(&mut self, time: Time) {
        self.used += 1;
        self.first.get_or_insert(time);
        if let Some(last) = self.last.replace(time) {
            let gap = time.seconds_since(last);
            if self.longest_gap.is_none_or(|(_, longest)| gap > longest) {
                self.longest_gap = Some((last, gap));
            }
        }
    }

    /// Takes away the rows read, left out and disturbed that an earlier report of the same reader has.
    pub fn subtract(&mut self, earlier: &Self) {
        self.rows = self.rows.saturating_sub(earlier.rows);
        for skipped in &mut self.skipped {
            if let Some(known) = earlier.skipped.iter().find(|known| known.reason == skipped.reason) {
                skipped.count = skipped.count.saturating_sub(known.count);
                skipped.examples.drain(..known.examples.len().min(skipped.examples.len()));
            }
        }
        self.skipped.retain(|skipped| skipped.count > 0);
        for (fault, count) in &mut self.disturbed {
            let known = earlier.disturbed.iter().find(|(known, _)| known == fault);
            *count = count.saturating_sub(known.map_or(0, |(_, known)| *known));
        }
        self.disturbed.retain(|(_, count)| *count > 0);
    }

    /// The damage of its file, in words.
    #[must_use]
    pub fn damage(&self) -> Option<&str> {
        let damage = self.skipped.iter().find(|skipped| skipped.reason == DAMAGED)?;
        damage.examples.first().map(|example| example.what.as_str())
    }

    /// Rows left out.
    #[must_use]
    pub fn left_out(&self) -> u64 {
        self.skipped.iter().map(|s| s.count).sum()
    }
}

/// `2602 of 2610 rows, 2601.2 s at 1.000 Hz, longest gap 4.0 s at 17.3 s`, then a line per reason.
impl fmt::Display for SourceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} rows, {:.1} s", self.used, self.rows, self.span())?;
        if let Some(rate) = self.mean_rate() {
            write!(f, " at {rate:.3} Hz")?;
        }
        if let Some((at, seconds)) = self.longest_gap {
            write!(f, ", longest gap {seconds:.3} s at {:.3} s", at.seconds())?;
        }
        for skipped in &self.skipped {
            write!(f, "\n  left out {}: {}", skipped.count, skipped.reason)?;
            for example in &skipped.examples {
                write!(f, "\n    {} {}: {}", example.counted, example.number, example.what)?;
            }
        }
        self.disturbed
            .iter()
            .try_for_each(|(fault, count)| write!(f, "\n  disturbed {count}: fault {fault}"))
    }
}

/// Counts towards a report.
#[derive(Clone, Debug, Default)]
pub(crate) struct RowCounts(SourceReport);

impl RowCounts {
    /// A row was read.
    pub(crate) fn row(&mut self) {
        self.0.rows += 1;
    }

    /// Rows read so far.
    pub(crate) fn rows(&self) -> u64 {
        self.0.rows
    }

    /// A row is delivered.
    pub(crate) fn used(&mut self, time: Time) {
        self.0.deliver(time);
    }

    /// A row is left out.
    pub(crate) fn skipped(&mut self, reason: &str, example: Option<Example>) {
        let entries = &mut self.0.skipped;
        let at = entries.iter().position(|s| s.reason == reason).unwrap_or_else(|| {
            entries.push(Skipped {
                reason: reason.to_owned(),
                count: 0,
                examples: Vec::new(),
            });
            entries.len() - 1
        });
        let entry = &mut entries[at];
        entry.count += 1;
        if let Some(example) = example.filter(|_| entry.examples.len() < EXAMPLES) {
            entry.examples.push(example);
        }
    }

    /// A row is delivered, but disturbed.
    pub(crate) fn disturbed(&mut self, fault: &str) {
        match self.0.disturbed.iter_mut().find(|(name, _)| name == fault) {
            Some((_, count)) => *count += 1,
            None => self.0.disturbed.push((fault.to_owned(), 1)),
        }
    }

    pub(crate) fn report(&self) -> SourceReport {
        self.0.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::LINE;

    #[test]
    fn a_report_counts_everything_and_shows_the_first_examples() {
        let mut counts = RowCounts::default();
        for (k, t) in [1.0, 2.0, 5.0, 6.0].into_iter().enumerate() {
            counts.row();
            counts.used(Time::from_seconds(t));
            counts.row();
            counts.skipped(
                "bad rows",
                Some(Example {
                    number: k + 1,
                    counted: LINE.into(),
                    what: format!("reason {k}"),
                }),
            );
        }
        counts.disturbed("noise");
        let expected = "\
4 of 8 rows, 5.0 s at 0.600 Hz, longest gap 3.000 s at 2.000 s
  left out 4: bad rows
    line 1: reason 0
    line 2: reason 1
    line 3: reason 2
  disturbed 1: fault noise";
        assert_eq!(counts.report().to_string(), expected);
    }

    #[test]
    fn a_report_without_an_earlier_one_has_the_rows_after_it() {
        let mut counts = RowCounts::default();
        let add = |counts: &mut RowCounts, number| {
            counts.row();
            let example = Example {
                number,
                counted: LINE.into(),
                what: "bad".to_owned(),
            };
            counts.skipped("bad rows", Some(example));
            counts.disturbed("noise");
        };
        add(&mut counts, 1);
        let earlier = counts.report();
        add(&mut counts, 2);
        counts.row();
        counts.skipped("other", None);
        let (mut later, mut none) = (counts.report(), counts.report());
        later.subtract(&earlier);
        let skipped: Vec<(&str, u64, Vec<usize>)> = later
            .skipped
            .iter()
            .map(|s| (&*s.reason, s.count, s.examples.iter().map(|e| e.number).collect()))
            .collect();
        assert_eq!((later.rows, skipped), (2, vec![("bad rows", 1, vec![2]), ("other", 1, vec![])]));
        assert_eq!(later.disturbed, [("noise".to_owned(), 1)]);
        let all = none.clone();
        none.subtract(&all);
        assert_eq!((none.rows, none.skipped.len(), none.disturbed.len()), (0, 0, 0));
    }
}
