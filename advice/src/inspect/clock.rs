//! The stamps of a file: their column, their unit, how regular they are.

use super::Day;
use super::numbers::{median, quantile};
use super::signal::factor;
use super::words::{Words, contains};
use fusion::source::OwnClock;
use fusion::source::decode;
use fusion::source::table::{LogColumn, LogTable, gps_of_unix};
use fusion_core::math;

/// An interval longer than this number of usual ones is a gap.
const GAP: f64 = 3.5;

/// How the stamps of a file are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Numbers of the unit.
    Count,
    /// Numbers of the unit, and a second column that is added.
    Sum {
        /// The second column.
        second: usize,
        /// The unit of the second column, as designs write it.
        each: &'static str,
    },
    /// A second column numbers the recordings, whose clocks restart: each recording is shifted by this number of
    /// seconds.
    Recordings {
        /// The second column.
        second: usize,
        /// Seconds for each.
        each: u32,
    },
    /// A counter; a comment gives its counts per second.
    Counter,
    /// Dates with the time of day.
    Calendar,
    /// None: samples are evenly spaced.
    Even,
}

/// The origin of the stamps of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The file does not give it.
    Unknown,
    /// GPS time, as calendars and GPS weeks are read.
    Gps,
    /// 1970-01-01 UTC; here they are brought to GPS time.
    Unix,
}

impl Origin {
    /// Its name in a design.
    pub(super) const fn name(self) -> Option<&'static str> {
        match self {
            Self::Unknown => None,
            Self::Gps => Some("gps"),
            Self::Unix => Some("unix"),
        }
    }
}

/// A week of GPS.
const WEEK: f64 = 604_800.0;

/// The stamps of a file.
#[derive(Clone, Debug)]
pub struct Clock {
    /// Its column.
    pub column: usize,
    /// How it is written.
    pub form: Form,
    /// Its origin.
    pub origin: Origin,
    /// Its unit as designs write it.
    pub unit: &'static str,
    /// Why this column and this unit.
    pub why: String,
    /// The stamps in seconds, as they are written; calendars and weeks in GPS time.
    pub stamps: Vec<f64>,
    /// Rows a second, by the median interval.
    pub rate: f64,
    /// Half of the intervals differ from the median by more than this share of it.
    pub jitter: f64,
    /// Intervals of more than 3.5 usual ones.
    pub gaps: usize,
    /// The longest interval \[s\], and its start.
    pub longest: (f64, f64),
    /// Rows with the stamp of the row before.
    pub ties: usize,
    /// Rows with an earlier stamp than the row before.
    pub backwards: usize,
    /// Rows whose stamp goes back by more than a second: the clock restarted.
    pub resets: usize,
    /// The shift that brings the stamps to the clock of the positions \[s\].
    pub shift: f64,
    /// The day of times of day, if the file has no date.
    pub day: Option<Day>,
}

impl Clock {
    /// The clock of a table; `None` if no column looks like time.
    pub(super) fn of(table: &LogTable) -> Option<Self> {
        let unnamed = || rising(table).filter(|k| !is_counter(table, *k));
        let clock =
            Self::named(table).or_else(|| unnamed().map(|column| Self::at(table, column, &Words::of(table.columns[column].called()))));
        let clock = clock.or_else(|| counted(table))?;
        Some(clock.of_recordings(table).unwrap_or(clock))
    }

    /// The clock from a column that is called time.
    pub(crate) fn named(table: &LogTable) -> Option<Self> {
        if let Some(own) = Self::own(table) {
            return Some(own);
        }
        if let Some(column) = table.stamp {
            let words = stamp_words(table.columns[column].called());
            return calendar(table)
                .filter(|c| c.column == column)
                .or_else(|| Some(Self::at(table, column, &words)));
        }
        let by_name = || named(table).map(|(column, words)| Self::at(table, column, &words));
        // Dates to the second next to finer stamps give the date of the log, not the time of a row.
        let dates = calendar(table);
        let fine = dates.clone().filter(|c| c.ties * 2 < c.stamps.len() && c.day.is_none());
        let others = || week(table).or_else(|| split(table)).or_else(by_name).or_else(|| even(table));
        fine.or_else(others).or(dates)
    }

    fn at(table: &LogTable, column: usize, words: &Words) -> Self {
        let values = &table.columns[column].values;
        let step = median(values.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0));
        let (unit, why) = match table.unit {
            Some(unit) => (unit, format!("that of `{}` in the other files", table.columns[column].called())),
            None => unit(words, values, step),
        };
        let scale = factor(unit);
        Self {
            column,
            unit,
            why,
            ..Self::measured(values.iter().map(|v| v * scale).collect())
        }
    }

    /// The clock of a format that defines its stamps: its first column, or the times of recording if those of the first
    /// column cannot be used.
    fn own(table: &LogTable) -> Option<Self> {
        let own = table.format.clock?;
        let scale = factor(own.unit);
        let (column, why) = of_recorder(table, scale, own).unwrap_or_else(|| (0, "as the format defines it".to_owned()));
        let stamps = table.columns.get(column)?.values.iter().map(|v| v * scale);
        let first = stamps.clone().find(|t| t.is_finite())?;
        let (origin, shift) = match own.counts_from {
            None => (Origin::Unknown, 0.0),
            Some(decode::Origin::Gps) => (Origin::Gps, 0.0),
            Some(decode::Origin::Unix) => (Origin::Unix, gps_of_unix(first).map_or(0.0, |gps| gps - first)),
        };
        Some(Self {
            column,
            unit: own.unit,
            origin,
            why,
            ..Self::measured(stamps.map(|t| t + shift).collect())
        })
    }

    /// A note about stamps of messages that cannot be used.
    pub(super) fn instead(&self, table: &LogTable) -> Option<String> {
        table.format.clock.filter(|_| self.column != 0)?;
        let [usual, instead] = [0, self.column].map(|k| &table.columns[k].name);
        Some(format!(
            "`{}`: {}. A source reads `{usual}` by default; write `time.column = \"{instead}\"`, the time of recording",
            table.name(),
            self.why
        ))
    }

    /// The columns that the clock reads.
    pub(super) fn columns(&self, table: &LogTable) -> Vec<usize> {
        let date = table.columns[self.column].calendar.as_ref().and_then(|c| c.date);
        let second = match self.form {
            Form::Sum { second, .. } | Form::Recordings { second, .. } => Some(second),
            _ => date,
        };
        core::iter::once(self.column).chain(second).collect()
    }

    /// Brings stamps that may count since 1970 to GPS time, if other logs have GPS time. Of both origins it takes the
    /// one that brings the logs closer together.
    pub(super) fn bring_to_gps(&mut self, others: (f64, f64)) {
        let (first, last) = self.span();
        let Some(shift) = gps_of_unix(first).map(|gps| gps - first) else {
            return;
        };
        let apart = |by: f64| (first + by - others.1).max(others.0 - last - by).max(0.0);
        if apart(shift) > apart(0.0) {
            self.origin = Origin::Gps;
            return;
        }
        self.origin = Origin::Unix;
        self.stamps.iter_mut().for_each(|t| *t += shift);
        self.longest.1 += shift;
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
            form: Form::Count,
            origin: Origin::Unknown,
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
            day: None,
            stamps,
        }
    }

    /// This clock, if it restarts each time that another column (the number of a recording) steps.
    fn of_recordings(&self, table: &LogTable) -> Option<Self> {
        /// The filter does not continue from one recording to the next: this is longer than any gap that it bridges
        /// \[s\].
        const APART: f64 = 10.0;
        if self.resets == 0 || self.form != Form::Count {
            return None;
        }
        let t = &self.stamps;
        let steps = |column: &usize| {
            let values = &table.columns[*column].values;
            let is_number = values.iter().all(|v| math::fract(*v) == 0.0 && (0.0..1e6).contains(v));
            is_number && (1..t.len()).all(|k| (values[k] > values[k - 1]) == (t[k] < t[k - 1]) && values[k] >= values[k - 1])
        };
        let second = (0..table.columns.len()).filter(|k| *k != self.column).find(steps)?;
        let (first, last) = self.span();
        // The next of 1, 2, 5, 10, …
        let least = (last - first) + APART;
        let power = math::powf(10_f64, math::floor(math::log10(least)));
        let each = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|each| *each >= least)?;
        let stamps = t.iter().zip(&table.columns[second].values).map(|(t, number)| t + each * number);
        Some(Self {
            column: self.column,
            form: Form::Recordings { second, each: each as u32 },
            unit: self.unit,
            why: self.why.clone(),
            origin: self.origin,
            ..Self::measured(stamps.collect())
        })
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

/// The column with the times of recording.
fn recorded(table: &LogTable) -> Option<usize> {
    table.columns.iter().position(|column| column.name == "log_time")
}

/// The column with the times of recording, and why the stamps of the messages cannot be used, if most of them cannot.
/// `scale` is the unit of both \[s\], and `own` is the clock that the format defines.
fn of_recorder(table: &LogTable, scale: f64, own: OwnClock) -> Option<(usize, String)> {
    /// A stamp this long after its recording is wrong: time zones differ by a day at most \[s\].
    const AHEAD: f64 = 86_400.0;
    /// A clock that is set shows 1973 or later. An earlier stamp counts from the start of a device \[s\].
    const SET: f64 = 1e8;
    let column = recorded(table)?;
    if own.counts_from.is_none() {
        let why = "the senders of these messages count from different starts";
        return (table.stamp == Some(column)).then(|| (column, why.to_owned()));
    }
    let seconds = |k: usize| table.columns[k].values.iter().map(move |v| v * scale);
    let pairs: Vec<(f64, f64)> = seconds(0).zip(seconds(column)).collect();
    let share =
        |is: &dyn Fn(f64, f64) -> bool| pairs.iter().filter(|(stamp, recorded)| is(*stamp, *recorded)).count() as f64 / pairs.len() as f64;
    let (zero, early, ahead) = (
        share(&|stamp, _| stamp == 0.0),
        share(&|stamp, recorded| stamp < SET && recorded >= SET),
        share(&|stamp, recorded| stamp > recorded + AHEAD),
    );
    let why = if zero > 0.5 {
        format!("the stamps in the messages are 0 in {:.0} % of the rows", 100.0 * zero)
    } else if early > 0.5 {
        "the stamps in the messages count from the start of a device, not from 1970".to_owned()
    } else if ahead > 0.5 {
        let days = median(pairs.iter().map(|(stamp, recorded)| stamp - recorded)) / AHEAD;
        format!("the stamps in the messages are {days:.1} days after the recording")
    } else {
        return None;
    };
    Some((column, why))
}

/// Dates with the time of day.
fn calendar(table: &LogTable) -> Option<Clock> {
    let column = table.stamp.filter(|k| table.columns[*k].calendar.is_some());
    let column = column.or_else(|| table.columns.iter().position(|c| c.calendar.is_some()))?;
    let scale = table.columns[column].calendar.as_ref()?.scale;
    Some(Clock {
        column,
        form: Form::Calendar,
        origin: Origin::Gps,
        unit: "ns",
        why: format!("dates, {scale} unless their text names another scale"),
        day: table.columns[column].is_time_of_day.then(Day::default),
        ..Clock::measured(table.columns[column].values.iter().map(|v| v * 1e-9).collect())
    })
}

/// Rows that a column counts; a comment gives their rate.
fn counted(table: &LogTable) -> Option<Clock> {
    let (comment, rate) = table.told.as_ref()?;
    let column = rising(table).filter(|k| is_counter(table, *k))?;
    let stamps = table.columns[column].values.iter().map(|v| v / rate);
    Some(Clock {
        column,
        form: Form::Counter,
        why: format!("guessed: it counts the rows, and a comment says `{comment}`"),
        rate: *rate,
        ..Clock::measured(stamps.collect())
    })
}

/// Evenly spaced samples; a number in the file gives their rate.
fn even(table: &LogTable) -> Option<Clock> {
    let (name, rate) = table.rate.as_ref()?;
    let stamps = table.columns.first()?.values.iter().map(|v| v * 1e-9);
    Some(Clock {
        form: Form::Even,
        unit: "ns",
        why: format!("no array of stamps; `{name}` gives the rate"),
        rate: *rate,
        ..Clock::measured(stamps.collect())
    })
}

/// The column whose last word is one of these, and the part of its name before that word.
fn ending(table: &LogTable, words: &[&str], is_sound: impl Fn(f64) -> bool) -> Option<(usize, String)> {
    let name = |k: usize| table.columns[k].called().to_lowercase();
    let found = (0..table.columns.len()).find_map(|k| {
        let name = name(k);
        let last = name.rsplit(|c: char| !c.is_alphanumeric()).find(|w| !w.is_empty())?;
        let prefix = name[..name.rfind(last)?].to_owned();
        words.contains(&last).then_some((k, prefix))
    })?;
    let values = || table.columns[found.0].values.iter().filter(|v| v.is_finite());
    (values().count() * 2 > table.rows() && values().all(|v| is_sound(*v))).then_some(found)
}

/// Stamps in two columns, their sum.
fn sum(table: &LogTable, column: usize, unit: &'static str, second: usize, each: &'static str, size: f64) -> Clock {
    let (a, b) = (&table.columns[column].values, &table.columns[second].values);
    Clock {
        column,
        form: Form::Sum { second, each },
        unit,
        why: format!("`{}` is added, {each} each", table.columns[second].name),
        ..Clock::measured(a.iter().zip(b).map(|(a, b)| a * factor(unit) + b * size).collect())
    }
}

/// A GPS week and the time of week.
fn week(table: &LogTable) -> Option<Clock> {
    let (second, _) = ending(table, &["week", "weeknumber", "wn", "gpsweek"], |v| {
        math::fract(v) == 0.0 && (1000.0..10_000.0).contains(&v)
    })?;
    let in_seconds = ending(table, &["tow", "sow", "itow", "seconds", "secs", "s"], |v| {
        (0.0..WEEK + 1.0).contains(&v)
    });
    let in_milliseconds = || ending(table, &["tow", "itow", "ms", "towms"], |v| (0.0..1e3 * (WEEK + 1.0)).contains(&v));
    let (column, unit) = in_seconds
        .map(|(k, _)| (k, "s"))
        .or_else(|| in_milliseconds().map(|(k, _)| (k, "ms")))?;
    Some(Clock {
        origin: Origin::Gps,
        ..sum(table, column, unit, second, "604800 s", WEEK)
    })
}

/// Whole seconds, and their fraction in finer units.
fn split(table: &LogTable) -> Option<Clock> {
    let whole = |limit: f64| move |v: f64| math::fract(v) == 0.0 && (0.0..limit).contains(&v);
    let nanos = ending(
        table,
        &["ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanosecond", "nanoseconds", "nanos"],
        whole(1e9),
    );
    let micros = || ending(table, &["us", "usec", "usecs", "microsec", "microseconds", "micros"], whole(1e6));
    let (fine, each, size) = nanos.map(|n| (n, "1 ns", 1e-9)).or_else(|| micros().map(|m| (m, "1 us", 1e-6)))?;
    let (column, prefix) = ending(table, &["s", "sec", "secs", "second", "seconds"], |v| math::fract(v) == 0.0)?;
    (prefix == fine.1).then(|| sum(table, column, "s", fine.0, each, size))
}

/// The words in the name of a column of stamps. A unit may be joined to it, as in `TimeUS`. Other quantities have no
/// joined unit, because `times` is a word and `accels` another.
pub(super) fn stamp_words(name: &str) -> Words {
    let mut words = Words::of(name);
    let joined = ["timestamp", "time"]
        .iter()
        .find_map(|w| words.stem.strip_prefix(w).map(|unit| (*w, unit)));
    let unit = |written: &str| ["s", "ms", "us", "ns"].into_iter().find(|unit| *unit == written);
    if let Some((stem, Some(unit))) = joined.map(|(stem, written)| (stem, unit(written))) {
        words = Words {
            stem: stem.to_owned(),
            unit: words.unit.or(Some(unit)),
        };
    }
    words
}

/// Whether a column is called time.
pub(super) fn is_called_time(words: &Words) -> bool {
    words.ends_with(&["t", "time", "timestamp", "stamp", "tow", "gpst", "utc"])
}

/// The column that is called time. A `t` alone may be a temperature: any other such name outranks it, and it has to
/// rise.
fn named(table: &LogTable) -> Option<(usize, Words)> {
    let words = table.columns.iter().map(|c| stamp_words(c.called())).enumerate();
    let is_number = |k: &usize| {
        table.columns[*k].calendar.is_none() && table.columns[*k].values.iter().filter(|v| v.is_finite()).count() * 2 > table.rows()
    };
    let is_bare = |w: &Words| w.stem == "t" && w.unit.is_none();
    let rank = |(k, w): &(usize, Words)| (!is_in_order(table, *k), is_bare(w), w.stem.len());
    words
        .filter(|(k, w)| is_called_time(w) && is_number(k) && (!is_bare(w) || is_in_order(table, *k)))
        .min_by_key(rank)
}

/// Whether a column goes back in less than a hundredth of the rows.
fn is_in_order(table: &LogTable, column: usize) -> bool {
    let values = &table.columns[column].values;
    values.windows(2).filter(|w| w[1] < w[0]).count() * 100 < values.len()
}

/// Returns true if a column that is not called time rises by exactly one from row to row. It counts the rows, and gives
/// no rate.
fn is_counter(table: &LogTable, column: usize) -> bool {
    let column = &table.columns[column];
    let by_one = column.values.windows(2).filter(|w| w[1] - w[0] == 1.0).count();
    let is_unit = |unit: &str| matches!(unit, "s" | "ms" | "us" | "ns");
    let words = Words::of(column.called());
    // Packets may be lost, or every n-th row may belong to one sensor: whole numbers that are called a count are a
    // counter.
    let is_called = contains(
        &words.stem,
        &["packet", "count", "counter", "index", "sample", "samples", "frame", "seq", "row"],
    ) && column.values.iter().all(|v| !v.is_finite() || math::fract(*v) == 0.0);
    !words.unit.is_some_and(is_unit) && !is_unit(&words.stem) && (is_called || by_one * 100 >= column.values.len().saturating_sub(1) * 99)
}

/// Why a table has no clock, in a sentence about its file, and what to do.
pub(super) fn why_none(table: &LogTable) -> String {
    let name = table.name();
    let is_text = |c: &&LogColumn| {
        !c.first.trim().is_empty()
            && c.calendar.is_none()
            && c.values.iter().all(|v| v.is_nan())
            && is_called_time(&stamp_words(c.called()))
    };
    if let Some(column) = table.columns.iter().find(is_text) {
        let (column, first) = (&column.name, column.first.trim());
        let parts: Vec<&str> = first.split(|c: char| !c.is_ascii_digit()).collect();
        let numbers: Vec<u32> = parts.iter().map_while(|p| p.parse().ok()).collect();
        // The day or the month may come first: numbers up to twelve do not show it.
        let order = match numbers[..] {
            [1..=12, 13..=31, ..] => Some("\"mdy\""),
            [13..=31, 1..=12, ..] => Some("\"dmy\""),
            [1..=12, 1..=12, ..] => Some("\"dmy\"` or `\"mdy\""),
            _ => None,
        };
        return match order {
            Some(order) => format!(
                "`{name}`: the dates of `{column}`, such as {first}, begin with the day or the month. Declare `time = {{ column = \
                 \"{column}\", calendar = \"utc\", order = … }}` with the order `{order}`"
            ),
            None => format!("`{name}`: `{column}` holds no numbers and no dates that are known here; its first is {first}"),
        };
    }
    if let Some(counter) = rising(table).filter(|k| is_counter(table, *k)) {
        // A column without a name is called by its number.
        let number = (counter + 1).to_string();
        let column = Some(&table.columns[counter].name)
            .filter(|name| !name.is_empty() && table.names.is_none())
            .unwrap_or(&number);
        return format!(
            "`{name}` has no time: `{column}` counts its rows, and nothing here says how many there are in a second. Declare it: `time = {{ \
             column = \"{column}\", rate = \"100 Hz\" }}` with the rate of the instrument"
        );
    }
    format!("`{name}` has no column of time: none is called `t`, `time` or `timestamp`, and none rises from row to row")
}

/// Selects columns of time and units so that the tables agree.
pub(super) fn agree(tables: &mut [LogTable]) {
    use_recorder_for_several_starts(tables);
    agree_on_columns(tables);
    agree_on_units(tables);
}

/// Selects in each table the column of time that all other tables use, if this table has a column of that name, too.
fn agree_on_columns(tables: &mut [LogTable]) {
    let used = |table: &LogTable| {
        let clock = Clock::named(table)?;
        Some(table.columns[clock.column].called().to_lowercase())
    };
    let mut names: Vec<Option<String>> = tables.iter().map(used).collect();
    for k in 0..tables.len() {
        let mut others = names
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != k)
            .filter_map(|(_, name)| name.as_ref());
        let Some(common) = others.next().filter(|first| others.all(|name| name == *first)).cloned() else {
            continue;
        };
        let own = names[k].as_ref().is_some_and(|own| *own != common);
        let column = tables[k].columns.iter().position(|c| c.called().to_lowercase() == common);
        let is_sound = |column: &usize| {
            let of = &tables[k].columns[*column];
            let is_told = of.calendar.is_some() || is_called_time(&stamp_words(of.called()));
            is_told && is_in_order(&tables[k], *column) && of.values.iter().filter(|v| v.is_finite()).count() * 2 > of.values.len()
        };
        if let Some(column) = column.filter(|column| own && is_sound(column)) {
            tables[k].stamp = Some(column);
            names[k] = Some(common);
        }
    }
}

/// Selects one unit for columns of time with one name, if only the steps between their numbers suggest a unit. Steps of 5
/// may be seconds of an acoustic fix or milliseconds of an inertial unit. A date tells its unit, and is left as it is.
fn agree_on_units(tables: &mut [LogTable]) {
    /// Rows of instruments come at such rates \[Hz\].
    const RATES: core::ops::RangeInclusive<f64> = 0.005..=10_000.0;
    let guessed = |table: &LogTable| {
        let clock = Clock::named(table).filter(|clock| clock.form == Form::Count && clock.origin == Origin::Unknown)?;
        let column = table.columns[clock.column].called();
        let first = first(&table.columns[clock.column].values);
        let is_told = table.format.clock.is_some() || unit_by_name(&stamp_words(column)).is_some() || unit_of_date(first).is_some();
        // One row has no rate, and suggests nothing.
        (!is_told && clock.rate.is_finite()).then(|| (column.to_lowercase(), clock))
    };
    let clocks: Vec<Option<(String, Clock)>> = tables.iter().map(guessed).collect();
    for (k, table) in tables.iter_mut().enumerate() {
        let Some((name, own)) = &clocks[k] else { continue };
        let others = || clocks.iter().flatten().filter(|(other, _)| other == name).map(|(_, clock)| clock);
        let in_unit = |clock: &Clock, unit: &str| clock.rate * factor(clock.unit) / factor(unit);
        let is_common = |unit: &&str| others().all(|clock| RATES.contains(&in_unit(clock, unit)));
        // The file with the most rows decides between several units.
        let common = others().filter(|clock| is_common(&clock.unit));
        let unit = common.max_by_key(|clock| clock.stamps.len()).map(|clock| clock.unit);
        table.unit = unit.filter(|unit| *unit != own.unit);
    }
}

/// Selects the times of recording in the tables of a file whose stamps count from the starts of several senders. Each
/// sender has another difference between the time of recording and the stamp.
fn use_recorder_for_several_starts(tables: &mut [LogTable]) {
    /// Links delay by less \[s\].
    const APART: f64 = 5.0;
    let start = |table: &LogTable| {
        let own = table.format.clock.filter(|own| own.counts_from.is_none())?;
        let (stamps, recorded) = (&table.columns.first()?.values, &table.columns[recorded(table)?].values);
        let start = median(stamps.iter().zip(recorded).map(|(stamp, recorded)| recorded - stamp)) * factor(own.unit);
        start.is_finite().then_some(start)
    };
    let starts: Vec<Option<f64>> = tables.iter().map(start).collect();
    for k in 0..tables.len() {
        let is_apart = |other: usize| {
            let pair = starts[k].zip(starts[other]);
            tables[k].path == tables[other].path && pair.is_some_and(|(a, b)| (a - b).abs() > APART)
        };
        if (0..tables.len()).any(is_apart) {
            tables[k].stamp = recorded(&tables[k]);
        }
    }
}

/// The column that rises from row to row, except in a hundredth of the rows.
fn rising(table: &LogTable) -> Option<usize> {
    let rises = |k: &usize| {
        let values = &table.columns[*k].values;
        let up = values.windows(2).filter(|w| w[1] > w[0]).count();
        values.len() > 10 && up * 100 >= (values.len() - 1) * 99
    };
    (0..table.columns.len()).find(rises)
}

/// The unit of stamps in their name, which may be a unit alone.
fn unit_by_name(words: &Words) -> Option<&'static str> {
    let named = words.unit.filter(|unit| matches!(*unit, "s" | "ms" | "us" | "ns"));
    named.or_else(|| ["ms", "us", "ns"].into_iter().find(|unit| *unit == words.stem))
}

/// The first number, without its sign.
fn first(values: &[f64]) -> f64 {
    values.iter().copied().find(|v| v.is_finite()).unwrap_or_default().abs()
}

/// The unit of a number that is a date of this century, counted from 1970.
const fn unit_of_date(first: f64) -> Option<&'static str> {
    match first {
        f if f > 1e17 => Some("ns"),
        f if f > 1e14 => Some("us"),
        f if f > 1e11 => Some("ms"),
        f if f > 1e9 => Some("s"),
        _ => None,
    }
}

/// The unit of stamps, by the name or by their size.
fn unit(words: &Words, values: &[f64], step: f64) -> (&'static str, String) {
    if let Some(unit) = unit_by_name(words) {
        return (unit, "by its name".to_owned());
    }
    // Or the step of a counter since power-up.
    let first = first(values);
    let unit = unit_of_date(first).unwrap_or(match step {
        s if s >= 1e6 => "ns",
        s if s >= 1e3 => "us",
        s if s >= 4.0 && math::fract(first) == 0.0 => "ms",
        _ => "s",
    });
    (unit, format!("first {first}, usual interval {step}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, values: Vec<f64>) -> Option<Clock> {
        let column = LogColumn {
            name: name.to_owned(),
            values,
            ..LogColumn::default()
        };
        Clock::of(&LogTable {
            columns: vec![column],
            ..LogTable::default()
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
        assert_eq!(unit("ms", 0.0, 1000.0), "ms");
        assert_eq!(unit("#timestamp [ns]", 1.52e18, 5e6), "ns");
        assert_eq!(unit("Timestamp", 1.586e9, 0.26), "s");
        assert_eq!(unit("1", 261_906.0, 10.0), "ms");
        // Joined to the name, in any case, and before the size: the number looks like seconds of 2016.
        assert_eq!(unit("TimeUS", 1.464e9, 2e5), "us");
        assert_eq!(unit("timestampMs", 0.0, 1.0), "ms");
        assert_eq!(stamp_words("TimeUS [us]").stem, "time");
        assert!(of("x", vec![1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]).is_none());
    }
}
