//! What became of measurements: names, counts and units that all results share.

use fusion::observe::{Innovations, SensorStatistics};
use fusion_tables::Unit;
use fusion_tables::{Cell, Column, Section};

/// A count of a sensor; none where it is not known.
pub(super) type Count = fn(&SensorStatistics) -> Option<u64>;

/// The title of the first count of disturbed rows.
const MISSED: &str = "missed";

/// The counts worth a column in a table of these sensors, with their titles: of disturbed rows
/// where a fault may disturb any, of rare outcomes where there were any.
pub(super) fn counts<'a>(sensors: impl IntoIterator<Item = &'a SensorStatistics> + Clone) -> Vec<(&'static str, Count)> {
    const USUAL: [(&str, Count); 4] = [
        ("accepted", |s| Some(s.accepted)),
        ("rejected", |s| Some(s.rejected)),
        (MISSED, |s| Some(s.disturbed?.missed)),
        ("false", |s| Some(s.disturbed?.false_rejections)),
    ];
    const RARE: [(&str, Count); 2] = [("re-acquired", |s| Some(s.reacquired)), ("unusable", |s| Some(s.unusable))];
    let values = |count: Count| sensors.clone().into_iter().filter_map(count);
    let usual = USUAL.into_iter().filter(|(_, count)| values(*count).next().is_some());
    let rare = RARE.into_iter().filter(|(_, count)| values(*count).any(|n| n > 0));
    usual.chain(rare).collect()
}

/// The section with a table of these counts; it says what those of disturbed rows are.
pub(super) fn counted(section: Section, counts: &[(&'static str, Count)]) -> Section {
    if counts.iter().any(|(title, _)| *title == MISSED) {
        section.note("missed: rows that a declared fault disturbed and that were used. false: other rows that were rejected.")
    } else {
        section
    }
}

/// Their columns.
pub(super) fn count_columns(counts: &[(&'static str, Count)]) -> impl Iterator<Item = Column> {
    counts.iter().map(|(title, _)| Column::number(*title))
}

/// A count over several sensors together; empty where it is known of none of them.
pub(super) fn sum<'a>(sensors: impl IntoIterator<Item = &'a SensorStatistics>, count: Count) -> Cell {
    Cell::count(sensors.into_iter().filter_map(count).reduce(|a, b| a + b))
}

/// Each residual row of a sensor: its name, `north`, or its number where it has none and there
/// are several; and its unit.
#[must_use]
pub fn residual_rows(s: &SensorStatistics) -> Vec<(String, Unit)> {
    let Innovations { axis, unit, .. } = &s.innovations;
    let row = |(k, si): (usize, &String)| {
        let name = match axis.get(k % axis.len().max(1)) {
            // Of several alike: which one, and its row.
            Some(name) if unit.len() > axis.len() => format!("{} {name}", k / axis.len() + 1),
            Some(name) => (*name).to_owned(),
            None if unit.len() > 1 => (k + 1).to_string(),
            None => String::new(),
        };
        (name, Unit::of_si(si))
    };
    unit.iter().enumerate().map(row).collect()
}

/// `gnss north`, or the sensor alone.
pub(super) fn row_name(sensor: &SensorStatistics, row: &str) -> Cell {
    Cell::text(format!("{} {row}", sensor.name).trim_end())
}
