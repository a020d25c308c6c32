//! Times of day without a date: recognised, and given the day of another log.

use super::clock::{is_called_time, stamp_words};
use super::{ABSOLUTE, Clock, Form, Log, Origin};
use fusion::source::table::{Calendar, LogColumn, LogTable, SOME_DAY, gps_of_text, gps_of_unix, utc_text};
use fusion_core::math;

/// The day of times of day.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Day {
    /// As designs write it.
    pub date: String,
    /// The file that gives it.
    pub from: Option<String>,
}

impl Default for Day {
    fn default() -> Self {
        Self {
            date: SOME_DAY.to_owned(),
            from: None,
        }
    }
}

/// Reads a column of `hhmmss.ss`, the NMEA form of times of day, as times of day, if no column has dates. It continues
/// after midnight.
pub(super) fn read_times_of_day(table: &mut LogTable) {
    let Some(midnight) = gps_of_text(&format!("{SOME_DAY}T00:00:00Z")) else {
        return;
    };
    if table.columns.iter().all(|c| c.calendar.is_none()) {
        for column in table.columns.iter_mut().filter(|c| is_hhmmss(c)) {
            let second = |v: &f64| (midnight + 3600.0 * math::floor(v / 1e4) + 60.0 * (math::floor(v / 100.0) % 100.0) + v % 100.0) * 1e9;
            column.values = column.values.iter().map(second).collect();
            column.calendar = Some(Calendar { scale: "utc", date: None });
            column.is_time_of_day = true;
        }
    }
    for column in table.columns.iter_mut().filter(|c| c.is_time_of_day) {
        /// Half of it, too \[ns\].
        const DAY: f64 = 86_400e9;
        let mut last = f64::NAN;
        for v in column.values.iter_mut().filter(|v| v.is_finite()) {
            if last.is_finite() {
                *v += DAY * math::round((last - *v) / DAY);
            }
            last = *v;
        }
    }
}

/// Returns true if a column is called time and holds hours, minutes and seconds in one number. It has six digits and
/// never 60 minutes or seconds. Now and then it moves to the next minute, which no count of seconds does.
fn is_hhmmss(column: &LogColumn) -> bool {
    /// Rarer samples cannot separate seconds from hundreds \[s\].
    const RARE: f64 = 30.0;
    let whole = column.first.split('.').next().unwrap_or_default();
    let is_written = whole.len() == 6 && whole.bytes().all(|b| b.is_ascii_digit());
    let words = stamp_words(column.called());
    if !(is_written && is_called_time(&words) && words.unit.is_none()) {
        return false;
    }
    let is_time = |v: &f64| (0.0..240_000.0).contains(v) && math::floor(v / 100.0) % 100.0 < 60.0 && v % 100.0 < 60.0;
    let minute = |v: f64| math::floor(v / 100.0);
    let values = || column.values.iter().copied().filter(|v| v.is_finite());
    let steps: Vec<f64> = values()
        .zip(values().skip(1))
        .filter(|(a, b)| minute(*a) == minute(*b))
        .map(|(a, b)| b - a)
        .collect();
    let is_often = steps.iter().all(|step| *step < RARE) && steps.len() > 1;
    let goes_on = values().zip(values().skip(1)).any(|(a, b)| minute(a) != minute(b));
    values().all(|v| is_time(&v)) && is_often && (goes_on || whole.starts_with('0'))
}

/// Gives times of day the day that brings them nearest to a log with dates, or to a log that counts from a known day.
pub(super) fn give_days(logs: &mut [Log]) {
    let is_dated = |clock: &&Clock| clock.day.is_none() && (clock.origin == Origin::Gps || clock.span().0 > ABSOLUTE);
    let in_gps = |clock: &Clock| {
        let (first, last) = clock.span();
        let shift = if clock.origin == Origin::Gps {
            0.0
        } else {
            gps_of_unix(first)? - first
        };
        Some((first + shift, last + shift))
    };
    let dated = logs
        .iter()
        .find_map(|log| Some((log.name(), log.clock.as_ref().filter(is_dated).and_then(in_gps)?)));
    let (Some((from, span)), Some(some_day)) = (dated, noon(SOME_DAY)) else {
        return;
    };
    for clock in logs
        .iter_mut()
        .filter_map(|log| log.clock.as_mut())
        .filter(|clock| clock.day.is_some())
    {
        let (first, last) = clock.span();
        let days = [-1, 0, 1].map(|day| utc_text((span.0 as i64).saturating_add(86_400 * day))[..10].to_owned());
        let by = |day: &String| Some(noon(day)? - some_day);
        let apart = |by: f64| (first + by - span.1).max(span.0 - last - by).max(0.0);
        let known = days.into_iter().filter_map(|day| Some((by(&day)?, day)));
        // If two days are equally near, take the day that brings the starts of both logs closer.
        let rank = |(by, _): &(f64, String)| (apart(*by), (first + by - span.0).abs());
        let nearest = known.min_by(|a, b| rank(a).partial_cmp(&rank(b)).unwrap_or(core::cmp::Ordering::Equal));
        if let Some((by, date)) = nearest {
            clock.stamps.iter_mut().for_each(|t| *t += by);
            clock.longest.1 += by;
            clock.day = Some(Day {
                date,
                from: Some(from.clone()),
            });
        }
    }
}

/// The second of GPS time at noon of a day.
fn noon(day: &str) -> Option<f64> {
    gps_of_text(&format!("{day}T12:00:00Z"))
}

impl Log {
    /// A note about times of day without a date.
    pub(super) fn of_day(&self) -> Option<String> {
        let clock = self.clock.as_ref()?;
        let (day, column) = (clock.day.as_ref()?, &self.table.columns[clock.column].name);
        let told = match &day.from {
            Some(file) => format!("It is taken to be {}, the day of `{file}`", day.date),
            None => format!("No file gives it: {} is used instead", day.date),
        };
        Some(format!("`{}`: `{column}` holds times of day without a date. {told}", self.name()))
    }
}

impl Clock {
    /// The reason for the day of a time of day.
    pub(super) fn why_day(&self) -> Option<String> {
        let day = self.day.as_ref().filter(|_| self.form == Form::Calendar)?;
        Some(match &day.from {
            Some(file) => format!("times of day; guessed: the day of `{file}`"),
            None => "times of day, and no file has a date: put in that of the first row as `day`".to_owned(),
        })
    }
}
