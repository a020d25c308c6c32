//! The stamps of a file: which column, which unit, how regular.

use super::numbers::{median, quantile};
use super::signal::factor;
use super::words::Words;
use crate::source::table::Table;

/// An interval longer than so many usual ones is a gap.
const GAP: f64 = 3.5;

/// The stamps of a file.
#[derive(Clone, Debug)]
pub struct Clock {
    /// Its column.
    pub column: usize,
    /// Its unit as designs write it.
    pub unit: &'static str,
    /// Why this column and this unit.
    pub why: String,
    /// The stamps in seconds, as they are written.
    pub stamps: Vec<f64>,
    /// Rows a second, by the median interval.
    pub rate: f64,
    /// Half of the intervals differ from the median by more than this share of it.
    pub jitter: f64,
    /// Intervals of more than 3.5 usual ones.
    pub gaps: usize,
    /// The longest interval \[s\], and where it begins.
    pub longest: (f64, f64),
    /// Rows with the stamp of the row before.
    pub ties: usize,
    /// Rows with an earlier stamp than the row before.
    pub backwards: usize,
    /// Of these, those that go back by more than a second: the clock began anew.
    pub resets: usize,
    /// What was added to the stamps, to bring them to the clock of the positions \[s\].
    pub shift: f64,
}

impl Clock {
    /// That of a table; `None` where no column looks like time.
    pub(super) fn of(table: &Table) -> Option<Self> {
        let (column, words) = named(table).or_else(|| rising(table))?;
        Some(Self::at(table, column, &words))
    }

    /// That of a column which is called time.
    pub(crate) fn named(table: &Table) -> Option<Self> {
        let (column, words) = named(table)?;
        Some(Self::at(table, column, &words))
    }

    fn at(table: &Table, column: usize, words: &Words) -> Self {
        let values = &table.columns[column].values;
        let step = median(values.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0));
        let (unit, why) = unit(words, values, step);
        let scale = factor(unit);
        let stamps: Vec<f64> = values.iter().map(|v| v * scale).collect();
        Self {
            column,
            unit,
            why,
            ..Self::measured(stamps)
        }
    }

    fn measured(stamps: Vec<f64>) -> Self {
        let intervals = || stamps.windows(2).map(|w| w[1] - w[0]);
        let usual = median(intervals().filter(|d| *d > 0.0));
        let mut longest = (0.0, 0.0);
        for w in stamps.windows(2) {
            if w[1] - w[0] > longest.0 {
                longest = (w[1] - w[0], w[0]);
            }
        }
        Self {
            column: 0,
            unit: "s",
            why: String::new(),
            rate: 1.0 / usual,
            jitter: median(intervals().filter(|d| *d > 0.0).map(|d| (d / usual - 1.0).abs())),
            gaps: intervals().filter(|d| *d > GAP * usual).count(),
            longest,
            ties: intervals().filter(|d| *d == 0.0).count(),
            backwards: intervals().filter(|d| *d < 0.0).count(),
            resets: intervals().filter(|d| *d < -1.0).count(),
            shift: 0.0,
            stamps,
        }
    }

    /// Moves the stamps.
    pub(super) fn shift(&mut self, by: f64) {
        self.shift += by;
        self.longest.1 += by;
        self.stamps.iter_mut().for_each(|t| *t += by);
    }

    /// The earliest and the latest stamp \[s\].
    #[must_use]
    pub fn span(&self) -> (f64, f64) {
        let all = || self.stamps.iter().copied();
        (quantile(all(), 0.0), quantile(all(), 1.0))
    }
}

/// The column that is called time.
fn named(table: &Table) -> Option<(usize, Words)> {
    let words = table.columns.iter().map(|c| Words::of(&c.name)).enumerate();
    let is_time = |w: &Words| w.ends_with(&["t", "time", "timestamp", "stamp", "tow", "gpst", "utc"]);
    let is_number = |k: &usize| table.columns[*k].values.iter().filter(|v| v.is_finite()).count() * 2 > table.rows();
    words.filter(|(k, w)| is_time(w) && is_number(k)).min_by_key(|(_, w)| w.stem.len())
}

/// The column that rises from row to row, all but a hundredth of them.
fn rising(table: &Table) -> Option<(usize, Words)> {
    let rises = |k: &usize| {
        let values = &table.columns[*k].values;
        let up = values.windows(2).filter(|w| w[1] > w[0]).count();
        values.len() > 10 && up * 100 >= (values.len() - 1) * 99
    };
    (0..table.columns.len()).find(rises).map(|k| (k, Words::default()))
}

/// The unit of stamps, by the name or by their size.
fn unit(words: &Words, values: &[f64], step: f64) -> (&'static str, String) {
    if let Some(unit) = words.unit.filter(|u| matches!(*u, "s" | "ms" | "us" | "ns")) {
        return (unit, "by its name".to_owned());
    }
    // A date of this century in each unit, or the interval of a counter since power-up.
    let first = values.iter().copied().find(|v| v.is_finite()).unwrap_or_default().abs();
    let unit = match (first, step) {
        (f, _) if f > 1e17 => "ns",
        (f, _) if f > 1e14 => "us",
        (f, _) if f > 1e11 => "ms",
        (f, _) if f > 1e9 => "s",
        (_, s) if s >= 1e6 => "ns",
        (_, s) if s >= 1e3 => "us",
        (f, s) if s >= 4.0 && f.fract() == 0.0 => "ms",
        _ => "s",
    };
    (unit, format!("first {first}, usual interval {step}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::table::Column;

    fn of(name: &str, values: Vec<f64>) -> Option<Clock> {
        let column = Column {
            name: name.to_owned(),
            values,
            ..Column::default()
        };
        Clock::of(&Table {
            columns: vec![column],
            ..Table::default()
        })
    }

    #[test]
    fn gaps_ties_and_resets_are_counted() {
        let mut t: Vec<f64> = (0..100).map(|k| 0.1 * f64::from(k)).collect();
        t.extend([9.9, 9.85, 12.0, 2.0, 2.1]);
        let c = of("t_s", t).unwrap();
        assert!((c.rate - 10.0).abs() < 1e-6 && c.jitter < 1e-6, "{}", c.rate);
        assert_eq!((c.gaps, c.ties, c.backwards, c.resets), (1, 1, 2, 1));
        assert!((c.longest.0 - 2.15).abs() < 1e-9, "{:?}", c.longest);
    }

    #[test]
    fn units_of_stamps_are_told_by_name_and_by_size() {
        let unit = |name, first: f64, step: f64| of(name, (0..20).map(|k| first + step * f64::from(k)).collect()).unwrap().unit;
        assert_eq!(unit("t_ms", 0.0, 0.01), "ms");
        assert_eq!(unit("#timestamp [ns]", 1.52e18, 5e6), "ns");
        assert_eq!(unit("Timestamp", 1.586e9, 0.26), "s");
        assert_eq!(unit("1", 261_906.0, 10.0), "ms");
        assert!(of("x", vec![1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]).is_none());
    }
}
