//! From the cell of a stamp to the time of the log, to the nanosecond.

use super::Cell;
use super::header_unit::header_unit;
use super::instant::{Date, Order, Scale, ZeroPoint};
use super::raw::RawRows;
use super::spec::{Stamp, Timing};
use fusion_core::math;
use fusion_core::time::nanos;
use fusion_models::block::BuildError;
use fusion_models::units::{Dimensional, dim, parse_unit};

/// Digits of a fraction that are read; further digits are below one nanosecond in any unit.
const FRACTION_DIGITS: u32 = 15;
/// More nanoseconds than any log has; two such values can be added.
const LARGEST: i128 = i128::MAX / 4;

/// Stamps of one column, or of two.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    form: Form,
    /// The instants of the last stamp in order and of the current row; a time of day is near them.
    last: Option<i128>,
    hand: Option<i128>,
    /// The columns, once the file is open.
    columns: Vec<usize>,
    epoch: i128,
    scale: f64,
    /// The time at which the clock is correct: declared, or its first stamp.
    about: Option<i64>,
    is_about_declared: bool,
    offset: i64,
    /// Rows before this time are left out.
    pub(super) start: i64,
    /// The source ends here.
    pub(super) stop: i64,
}

/// The format of the cells of a stamp.
#[derive(Clone, Debug)]
enum Form {
    /// A sum of counts: the nanoseconds per count of each column, and the origin of the counts.
    Count { units: Vec<i128>, zero: Option<ZeroPoint> },
    /// Rows, or counts of a column, at this rate per second.
    Counter(f64),
    /// A date with the time of day, in one column or in two.
    Calendar(Scale, Option<Order>),
    /// Times of day, from this day on.
    TimeOfDay(Scale, Date),
}

impl Clock {
    pub(super) fn new(stamp: &Stamp<'_>, spec: Timing<'_>, errors: &mut Vec<BuildError>) -> Self {
        let form = Form::new(stamp, errors);
        let mut wrong = |field: &str, message: String| errors.push(BuildError::at(format!("time.{field}"), message));
        let epoch = spec
            .epoch
            .as_ref()
            .map_or(Ok(0), |epoch| form.epoch(&epoch.0))
            .unwrap_or_else(|message| {
                wrong("epoch", message);
                0
            });
        if !(spec.scale.is_finite() && spec.scale > 0.0) {
            wrong(
                "scale",
                format!(
                    "the scale of a clock is greater than 0 and near 1, e.g. 1.00002, not {}",
                    spec.scale
                ),
            );
        }
        let at = |d: fusion_models::units::Duration| nanos(d.si());
        let (start, stop) = (spec.start.map_or(i64::MIN, at), spec.stop.map_or(i64::MAX, at));
        if stop <= start {
            wrong(
                "stop",
                "`stop` is not later than `start`, so that no row is left: write a later `stop` or an earlier `start`".to_owned(),
            );
        }
        let (about, offset) = (spec.about.map(at), at(spec.offset));
        Self {
            form,
            last: None,
            hand: None,
            columns: Vec::new(),
            epoch,
            scale: spec.scale,
            about,
            is_about_declared: about.is_some(),
            offset,
            start,
            stop,
        }
    }

    /// GPS time at time zero of the log \[ns\]; `None` if the zero point of the stamps is not declared.
    pub(super) fn time_zero(&self) -> Option<i64> {
        match self.form {
            Form::Count { zero: None, .. } | Form::Counter(_) => None,
            _ => i64::try_from(self.epoch).ok(),
        }
    }

    /// Sets the columns of the file that it reads, in order.
    pub(super) fn place(&mut self, columns: Vec<usize>) {
        self.columns = columns;
    }

    /// The first stamp was wrong.
    pub(super) const fn forget_first(&mut self) {
        if !self.is_about_declared {
            self.about = None;
        }
    }

    /// The stamp of the current row, number `number` of the file from 0, in nanoseconds of the log's time; `Err` names
    /// the wrong column and the mistake.
    pub(super) fn read(&mut self, row: &impl RawRows, number: u64) -> Result<i64, (usize, &'static str)> {
        let (instant, last) = self.form.read(&self.columns, row, number, self.last)?;
        self.hand = Some(instant);
        self.log_time(instant, last)
    }

    /// As [`read`](Self::read), for a row after the current row. `before` is the instant of the latest row between
    /// them, and is set to the instant read: a time of day is near it.
    pub(super) fn read_after(&mut self, row: &impl RawRows, number: u64, before: &mut Option<i128>) -> Result<i64, (usize, &'static str)> {
        let (instant, last) = self.form.read(&self.columns, row, number, before.or(self.hand))?;
        *before = Some(instant);
        self.log_time(instant, last)
    }

    /// The stamp of the row at hand is in order.
    pub(super) const fn took(&mut self) {
        self.last = self.hand;
    }

    fn log_time(&mut self, instant: i128, last: usize) -> Result<i64, (usize, &'static str)> {
        let beyond = "lies beyond the 292 years that a log spans: set `time.epoch`, or another `time.unit`";
        let stamp = i64::try_from(instant - self.epoch).map_err(|_| (last, beyond))?;
        let about = *self.about.get_or_insert(stamp);
        let stretched = match self.scale {
            1.0 => 0,
            scale => math::round(stamp.saturating_sub(about) as f64 * (scale - 1.0)) as i64,
        };
        Ok(stamp.saturating_add(stretched).saturating_add(self.offset))
    }
}

impl Form {
    fn new(spec: &Stamp<'_>, errors: &mut Vec<BuildError>) -> Self {
        let mut wrong = |field: &str, message: String| errors.push(BuildError::at(format!("time.{field}"), message));
        let has_date = spec.columns.iter().any(|(field, _)| *field == "time.date");
        let mut misfits = |what: &str, keys: &[(&str, bool)]| {
            for (field, _) in keys.iter().filter(|(_, is_given)| *is_given) {
                wrong(field, format!("`{field}` does not apply to {what}"));
            }
        };
        let of_count = [
            ("unit", spec.unit.is_some()),
            ("counts_from", spec.counts_from.is_some()),
            ("plus", spec.each.is_some()),
        ];
        let of_calendar = [
            ("calendar", spec.calendar.is_some()),
            ("date", has_date),
            ("day", spec.day.is_some()),
            ("order", spec.order.is_some()),
        ];
        if let Some(rate) = spec.rate {
            misfits("a rate", &of_count);
            misfits("a rate", &of_calendar);
            return Self::Counter(rate);
        }
        if let Some(scale) = spec.calendar {
            misfits("a calendar", &of_count);
            let Some(day) = spec.day else {
                return Self::Calendar(scale, spec.order);
            };
            misfits("times of day", &[("date", has_date), ("order", spec.order.is_some())]);
            return match Date::read(day, None) {
                Ok(day) if scale.nearest(day, "00:00:00", None).is_ok() => Self::TimeOfDay(scale, day),
                _ => {
                    wrong("day", format!("`{day}` is no date such as `2025-07-08`"));
                    Self::Calendar(scale, None)
                }
            };
        }
        for (field, is_given) in of_calendar {
            if is_given {
                let what = if field == "order" { "an order of" } else { "" };
                let needs = format!("{what} a date needs its `calendar`: \"utc\", \"gps\" or \"tai\"");
                wrong(field, needs.trim_start().to_owned());
            }
        }
        if spec.columns.is_empty() {
            let message = "a row has its stamp in a `column`, or rows are evenly spaced and have a `rate`, such as \"100 Hz\"";
            errors.push(BuildError::at("time", message).help("write e.g. `time = { column = \"t\" }` or `time = { rate = \"100 Hz\" }`"));
            return Self::Counter(1.0);
        }
        let of_header = spec.columns.first().and_then(|(_, column)| header_unit(column, None));
        let of_header = of_header.filter(|unit| unit_nanos(unit).is_ok());
        let unit = unit_nanos(spec.unit.or(of_header.as_deref()).unwrap_or("s")).unwrap_or_else(|message| {
            wrong("unit", message);
            1
        });
        let each = spec.each.map(|each| i128::from(nanos(each)));
        if each == Some(0) {
            wrong("plus.each", "this is less than the nanosecond in which time is counted".to_owned());
        }
        Self::Count {
            units: core::iter::once(unit).chain(each).collect(),
            zero: spec.counts_from.map(ZeroPoint::new),
        }
    }

    /// The instant of time zero of the log, as written.
    fn epoch(&self, text: &str) -> Result<i128, String> {
        let of_calendar = |scale: Scale| scale.any_instant(text).map_err(|what| format!("`{text}` {what}"));
        match self {
            Self::Calendar(scale, _) | Self::TimeOfDay(scale, _) => of_calendar(*scale),
            Self::Counter(rate) => {
                let count = text.parse().ok().and_then(|count| counted_nanos(count, *rate));
                count.ok_or_else(|| "the epoch of a counter is the count at time zero".to_owned())
            }
            Self::Count { units, zero } => match (decimal_nanos(text, units[0]), zero) {
                (Some(count), None) => Ok(count),
                (Some(count), Some(zero)) => zero.instant(count).ok_or_else(|| "the epoch lies beyond any log".to_owned()),
                (None, Some(zero)) => of_calendar(zero.origin.scale()),
                (None, None) => {
                    let message = "the epoch is not a number in the unit of the time column; for a date and time say what the \
                                   stamps count from: `counts_from = \"unix\"` or `\"gps\"`";
                    Err(message.to_owned())
                }
            },
        }
    }

    /// The nanoseconds of the current row, and its last column; `Err` names the wrong column and the mistake.
    fn read(
        &self,
        columns: &[usize],
        row: &impl RawRows,
        number: u64,
        around: Option<i128>,
    ) -> Result<(i128, usize), (usize, &'static str)> {
        let last = columns.last().copied().unwrap_or_default();
        let text = |column: usize| row.cell(column).text().ok_or((column, "is not text"));
        let instant = match self {
            Self::Count { units, zero } => {
                let mut sum = 0;
                for (&column, &unit) in columns.iter().zip(units) {
                    sum += cell_nanos(row.cell(column), unit).map_err(|what| (column, what))?;
                }
                let counted = zero.as_ref().map_or(Some(sum), |zero| zero.instant(sum));
                counted.ok_or((last, "is not a time"))?
            }
            Self::Counter(rate) => {
                let count = match columns.first() {
                    Some(&column) => row.cell(column).number(),
                    None => Some(number as f64),
                };
                count
                    .and_then(|count| counted_nanos(count, *rate))
                    .ok_or((last, "is not a number"))?
            }
            Self::Calendar(scale, order) => match *columns {
                [date, time] => scale.of_day(text(date)?, text(time)?, *order),
                _ => scale.instant(text(last)?, *order),
            }
            .map_err(|what| (last, what))?,
            Self::TimeOfDay(scale, day) => scale.nearest(*day, text(last)?, around).map_err(|what| (last, what))?,
        };
        Ok((instant, last))
    }
}

/// The value of a cell, in nanoseconds.
fn cell_nanos(cell: Cell<'_>, unit: i128) -> Result<i128, &'static str> {
    let nanos = match cell {
        Cell::Text(bytes) => decimal_nanos(core::str::from_utf8(bytes).map_err(|_| "is not text")?, unit),
        Cell::Integer(count) => i128::from(count).checked_mul(unit),
        Cell::Number(value) => rounded_nanos(value, unit),
    };
    nanos.filter(|nanos| nanos.abs() < LARGEST).ok_or("is not a number")
}

/// The nanoseconds of a count with `rate` counts per second.
fn counted_nanos(count: f64, rate: f64) -> Option<i128> {
    rounded_nanos(count / rate, 1_000_000_000)
}

/// A unit of time in whole nanoseconds.
fn unit_nanos(text: &str) -> Result<i128, String> {
    let (factor, dimension) = parse_unit(text).map_err(|e| e.to_string())?;
    if dimension != dim::Duration::KIND.dimension {
        return Err(format!("{text:?} is the unit of {}, not of a time", dimension.kind()));
    }
    let unit = factor * 1e9;
    if unit < 0.999 {
        return Err(format!("{text:?} is finer than the nanosecond in which time is counted"));
    }
    Ok(math::round(unit) as i128)
}

/// A decimal number of `unit` nanoseconds, in whole nanoseconds: exact if it is written without exponent.
pub(in super::super) fn decimal_nanos(text: &str, unit: i128) -> Option<i128> {
    let (negative, digits) = match text.as_bytes() {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        rest => (false, rest),
    };
    let (mut whole, mut fraction, mut fraction_digits) = (0_i128, 0_i128, 0);
    let (mut point, mut any) = (false, false);
    for byte in digits {
        match byte {
            b'0'..=b'9' => {
                any = true;
                let digit = i128::from(byte - b'0');
                if !point {
                    // 19 digits fill an i64; more than 25 digits are not a time in any unit.
                    whole = (whole < 10_i128.pow(25)).then(|| whole * 10 + digit)?;
                } else if fraction_digits < FRACTION_DIGITS {
                    fraction = fraction * 10 + digit;
                    fraction_digits += 1;
                }
            }
            b'.' if !point => point = true,
            b'e' | b'E' if any => return float_nanos(text, unit),
            _ => return None,
        }
    }
    let power = 10_i128.pow(fraction_digits);
    let nanos = whole.checked_mul(unit)? + (fraction * unit + power / 2) / power;
    any.then_some(if negative { -nanos } else { nanos })
}

/// With an exponent, the number is rounded as a floating-point number.
fn float_nanos(text: &str, unit: i128) -> Option<i128> {
    rounded_nanos(text.parse().ok()?, unit)
}

fn rounded_nanos(value: f64, unit: i128) -> Option<i128> {
    let nanos = value * unit as f64;
    (nanos.abs() < 1e30).then_some(math::round(nanos) as i128)
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i128 = 1_000_000_000;

    #[test]
    fn decimal_stamps_are_exact_to_the_nanosecond() {
        let cases = [
            ("1520530308181901469", 1, 1_520_530_308_181_901_469),
            ("1752003258.123456789", S, 1_752_003_258_123_456_789),
            ("-0.25", S, -250_000_000),
            ("+7.", 1_000_000, 7_000_000),
            (".5", 60 * S, 30 * S),
            ("0.0000000005", S, 1),
            ("0.00000000049999999999999999999", S, 0),
            ("1.5e3", S, 1500 * S),
        ];
        for (text, unit, nanos) in cases {
            assert_eq!(decimal_nanos(text, unit), Some(nanos), "{text}");
        }
    }

    #[test]
    fn what_is_no_number_is_no_stamp() {
        for text in [
            "",
            "-",
            ".",
            "1.2.3",
            "12:30",
            "e5",
            "1e",
            "nan",
            "inf",
            "1e400",
            "0x10",
            "１",
            "9999999999999999999999999999999999999999",
        ] {
            assert_eq!(decimal_nanos(text, S), None, "{text}");
        }
    }

    #[test]
    fn units_of_time_are_whole_nanoseconds() {
        let read: Vec<_> = ["ns", "us", "ms", "s", "min", "h", "day"]
            .into_iter()
            .map(|u| unit_nanos(u).unwrap())
            .collect();
        assert_eq!(read, [1, 1000, 1_000_000, S, 60 * S, 3600 * S, 86_400 * S]);
        assert_eq!(
            unit_nanos("ps").unwrap_err(),
            "\"ps\" is finer than the nanosecond in which time is counted"
        );
        assert_eq!(unit_nanos("m").unwrap_err(), "\"m\" is the unit of a length [m], not of a time");
    }
}
