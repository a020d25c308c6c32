//! A file with what was found in it.

use super::clock::Clock;
use super::numbers::{Vec3, median};
use super::signal::{Kind, Signal, is_derived, signals};
use crate::source::table::Table;

/// A file with what was found in it.
#[derive(Clone, Debug)]
pub struct Log {
    /// The rows.
    pub table: Table,
    /// The stamps; `None` where no column looks like time.
    pub clock: Option<Clock>,
    /// The quantities.
    pub signals: Vec<Signal>,
}

/// Rows in which a quantity does not change.
#[derive(Clone, Copy, Debug, Default)]
pub struct Repeats {
    /// The share of rows that repeat the one before.
    pub share: f64,
    /// The longest time without a change \[s\].
    pub longest: f64,
}

impl Log {
    /// Looks at a table.
    #[must_use]
    pub fn of(table: Table) -> Self {
        let clock = Clock::of(&table);
        let rate = clock.as_ref().map_or(f64::NAN, |c| c.rate);
        let signals = signals(&table, rate);
        Self { table, clock, signals }
    }

    /// The name of its file.
    #[must_use]
    pub fn name(&self) -> String {
        self.table.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The signal of a kind.
    #[must_use]
    pub fn signal(&self, kind: Kind) -> Option<&Signal> {
        self.signals.iter().find(|s| s.kind == kind)
    }

    /// Whether it has one.
    #[must_use]
    pub fn has(&self, kind: Kind) -> bool {
        self.signal(kind).is_some()
    }

    /// The stamps \[s\].
    pub(super) fn stamps(&self) -> &[f64] {
        self.clock.as_ref().map_or(&[], |c| c.stamps.as_slice())
    }

    /// Rows a second; NaN without time.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.clock.as_ref().map_or(f64::NAN, |c| c.rate)
    }

    /// How long it is \[s\].
    pub(super) fn duration(&self) -> f64 {
        self.clock.as_ref().map_or(0.0, |c| c.span().1 - c.span().0)
    }

    /// The values of a kind in SI, increments as rates.
    pub(super) fn values(&self, kind: Kind) -> Option<Vec<Vec3>> {
        let signal = self.signal(kind)?;
        let mut values = signal.values(&self.table);
        if signal.increment {
            values.iter_mut().for_each(|v| *v = v.map(|x| x * self.rate()));
        }
        Some(values)
    }

    /// Rows in which all columns of a signal repeat the row before.
    #[must_use]
    pub fn repeats(&self, signal: &Signal) -> Repeats {
        let (mut same, mut all, mut longest, mut since) = (0.0, 0.0_f64, 0.0_f64, 0);
        let t = self.stamps();
        for row in 1..self.table.rows() {
            let is_same = signal.columns.iter().all(|(k, _)| {
                let v = &self.table.columns[*k].values;
                v[row] == v[row - 1]
            });
            all += 1.0;
            if is_same {
                same += 1.0;
                if let (Some(a), Some(b)) = (t.get(since), t.get(row)) {
                    longest = longest.max(b - a);
                }
            } else {
                since = row;
            }
        }
        Repeats {
            share: same / all.max(1.0),
            longest,
        }
    }

    /// The share of rows in which a column of a signal is no number.
    pub(super) fn missing(&self, signal: &Signal) -> f64 {
        let rows = self.table.rows();
        let lost = (0..rows).filter(|row| !signal.raw(&self.table, *row).iter().all(|v| v.is_finite()));
        lost.count() as f64 / rows.max(1) as f64
    }

    /// The share of rows in which all but one column of a position are exactly zero: what some loggers
    /// write where they have none.
    pub(super) fn zeros(&self, signal: &Signal) -> f64 {
        let rows = self.table.rows();
        let is_zero = |row: &usize| signal.raw(&self.table, *row)[..2].iter().all(|v| *v == 0.0);
        (0..rows).filter(is_zero).count() as f64 / rows.max(1) as f64
    }

    /// Why a column is not read by a design; `None` of a quantity where there is no design.
    pub(super) fn why_unused(&self, column: usize, is_designed: bool) -> Option<String> {
        let signal = self.signals.iter().find(|s| s.columns.iter().any(|c| c.0 == column));
        if let Some(signal) = signal {
            return is_designed.then(|| format!("{}: {}", signal.kind.name(), signal.kind.why_unused()));
        }
        let values = || self.table.columns[column].values.iter().copied().filter(|v| v.is_finite());
        let first = values().next();
        Some(match first {
            None => "no numbers".to_owned(),
            Some(first) if values().all(|v| v == first) => format!("always {first}"),
            Some(_) if is_derived(&self.table.columns[column].name) => "what another filter made of other columns".to_owned(),
            Some(_) => "no quantity is known by this name".to_owned(),
        })
    }

    /// The median of a column.
    pub(super) fn typical(&self, column: usize) -> f64 {
        median(self.table.columns[column].values.iter().copied())
    }
}
