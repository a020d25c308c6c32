//! The outcomes of measurements: names, counts and units that all results share.

use fusion::observe::{Innovations, SensorStatistics};
use fusion_tables::Unit;
use fusion_tables::{Cell, Column, Section};

/// A count of a sensor; `None` if it is unknown.
pub(super) type Count = fn(&SensorStatistics) -> Option<u64>;

/// The title of the first count of disturbed rows.
const MISSED: &str = "missed";

/// The counts that get a column in a table of these sensors, with their titles. Disturbed rows are included if
/// a fault may disturb rows, rare outcomes if there were any.
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

/// The section with a table of these counts; a note explains the counts of disturbed rows.
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

/// The sum of a count over several sensors; empty if no sensor has this count.
pub(super) fn sum<'a>(sensors: impl IntoIterator<Item = &'a SensorStatistics>, count: Count) -> Cell {
    Cell::count(sensors.into_iter().filter_map(count).reduce(|a, b| a + b))
}

/// Each residual row of a sensor, with its unit. The name is for example `north`; several rows without names have
/// their numbers.
#[must_use]
pub fn residual_rows(s: &SensorStatistics) -> Vec<(String, Unit)> {
    let Innovations { axis, unit, .. } = &s.innovations;
    let row = |(k, si): (usize, &String)| {
        let name = match axis.get(k % axis.len().max(1)) {
            // If there are several groups of equal rows: the number of the group, and the name of the row.
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
