//! Instants of other clocks on one scale: nanoseconds of GPS time since 1980-01-06.
//!
//! GPS time has no leap seconds; Unix time and UTC have. The table of leap seconds is from the crate `hifitime`,
//! which is used only here.
//!
//! Not here  UTC before 1972, whose seconds were not those of TAI

use super::clock::decimal_nanos;
use core::cell::Cell;
use hifitime::{Duration, Epoch, TimeScale};
use schemars::JsonSchema;
use serde::Deserialize;

const SECOND: i128 = 1_000_000_000;
const DAY: i128 = 86_400 * SECOND;
/// 1980-01-06 in days of 1970-01-01.
const GPS_DAY: i128 = 3657;
/// TAI minus GPS time.
const TAI_AHEAD: i128 = 19 * SECOND;
/// Limit of the instants, about a million years: no table of leap seconds is valid beyond it.
const LARGEST: i128 = 1 << 84;

const NO_TIME: &str = "is no time of day, such as `19:34:18.25` or `193418.25`";
const NO_YEAR_FIRST: &str = "begins with the day or the month: declare which, `order = \"dmy\"` or `\"mdy\"`";
const NO_DAY: &str = "has no date: name its column by `date`, or write the date of the first row as `day = \"2025-07-08\"`";
const OTHER_SCALE: &str = "names another time scale than is declared";
const NO_DATE: &str = "is not a date and time, year first, such as `2025-07-08T19:34:18.25Z`";

/// The zero point of a count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// 1970-01-01 UTC, as computers count: leap seconds are left out.
    Unix,
    /// 1980-01-06, as GPS counts: every second.
    Gps,
}

/// The scale of a calendar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// UTC, or local time where the text gives its offset.
    Utc,
    /// GPS time.
    Gps,
    /// International atomic time.
    Tai,
}

/// The order of year, month and day in a date.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// `2025-07-08`.
    Ymd,
    /// `08.07.2025`.
    Dmy,
    /// `07/08/2025`.
    Mdy,
}

/// A day of the calendar: year, month, day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Date(i32, u8, u8);

/// How a text is written, as far as it is declared.
#[derive(Clone, Copy, Debug, Default)]
struct Writing {
    /// The order of the date, which then may have two digits for the year and no separators.
    order: Option<Order>,
    /// The time of day may be without separators.
    is_compact: bool,
}

impl Origin {
    /// A count of nanoseconds as an instant; `None` beyond any log.
    pub(in super::super) fn instant(self, count: i128) -> Option<i128> {
        match self {
            Self::Gps => Some(count),
            Self::Unix => (count.abs() < LARGEST).then(|| {
                // A leap second comes at midnight. `hifitime` looks it up by seconds that are rounded, and would have it
                // some nanoseconds too early.
                let midnight = count.div_euclid(DAY) * DAY;
                let day = Epoch::from_unix_duration(Duration::from_total_nanoseconds(midnight));
                day.to_gpst_duration().total_nanoseconds() + count - midnight
            }),
        }
    }

    /// The calendar of a count from this origin.
    pub(super) const fn scale(self) -> Scale {
        match self {
            Self::Unix => Scale::Utc,
            Self::Gps => Scale::Gps,
        }
    }
}

/// The zero point of the counts of a column. The leap seconds of a day are looked up once.
#[derive(Clone, Debug)]
pub(super) struct ZeroPoint {
    pub(super) origin: Origin,
    /// The first count of the day of the last count, and how far the instants of that day are ahead of the counts.
    day: Cell<Option<(i128, i128)>>,
}

impl ZeroPoint {
    pub(super) const fn new(origin: Origin) -> Self {
        Self {
            origin,
            day: Cell::new(None),
        }
    }

    /// As [`Origin::instant`].
    pub(super) fn instant(&self, count: i128) -> Option<i128> {
        if let Some((_, ahead)) = self.day.get().filter(|(midnight, _)| (0..DAY).contains(&(count - midnight))) {
            return Some(count + ahead);
        }
        let instant = self.origin.instant(count)?;
        self.day.set(Some((count.div_euclid(DAY) * DAY, instant - count)));
        Some(instant)
    }
}

impl Scale {
    /// The instant of a date with its time of day, such as `2025-07-08T19:34:18.25Z`; a text that names
    /// another scale is wrong.
    ///
    /// # Errors
    /// The mistake in the text.
    pub(super) fn instant(self, text: &str, order: Option<Order>) -> Result<i128, &'static str> {
        let (date, time) = parts_of(text).map_err(|none| if is_time_of_day(text) { NO_DAY } else { none })?;
        self.of_day(date, time, order)
    }

    /// As [`instant`](Self::instant), for separate texts of date and time of day.
    ///
    /// # Errors
    /// The mistake in the texts.
    pub(in super::super) fn of_day(self, date: &str, time: &str, order: Option<Order>) -> Result<i128, &'static str> {
        let (scale, instant) = self.named(date, time, Writing { order, is_compact: true })?;
        if scale == self { Ok(instant) } else { Err(OTHER_SCALE) }
    }

    /// The instant of a time of day without a date. The date is chosen so that the instant is nearest to `around`;
    /// without `around` it is `day`.
    ///
    /// # Errors
    /// The mistake in the text.
    pub(super) fn nearest(self, day: Date, time: &str, around: Option<i128>) -> Result<i128, &'static str> {
        let on = |day: Date| {
            let (scale, instant) = self.dated(day, time, true)?;
            if scale == self { Ok(instant) } else { Err(OTHER_SCALE) }
        };
        let first = on(day).map_err(|what| if what == NO_DATE { NO_TIME } else { what })?;
        let Some(around) = around else { return Ok(first) };
        let days = (around - first + DAY / 2).div_euclid(DAY);
        if days == 0 { Ok(first) } else { on(day.plus(days).ok_or(NO_TIME)?) }
    }

    /// As [`instant`](Self::instant), for a text that may name any scale.
    ///
    /// # Errors
    /// The mistake in the text.
    pub(super) fn any_instant(self, text: &str) -> Result<i128, &'static str> {
        let (date, time) = parts_of(text)?;
        Ok(self.named(date, time, Writing::default())?.1)
    }

    /// The scale that an undeclared text names, by default UTC, and the instant.
    pub(in super::super) fn guessed(text: &str) -> Option<(Self, i128)> {
        let (date, time) = parts_of(text).ok()?;
        Self::guessed_of_day(date, time)
    }

    /// As [`guessed`](Self::guessed), for separate texts of date and time of day.
    pub(in super::super) fn guessed_of_day(date: &str, time: &str) -> Option<(Self, i128)> {
        Self::Utc.named(date, time, Writing::default()).ok()
    }

    /// The name of the scale in designs.
    pub(in super::super) const fn name(self) -> &'static str {
        match self {
            Self::Utc => "utc",
            Self::Gps => "gps",
            Self::Tai => "tai",
        }
    }

    /// The instant of nanoseconds since 1980-01-06 of this calendar; `None` beyond any log.
    pub(in super::super) fn of_count(self, count: i128) -> Option<i128> {
        match self {
            Self::Utc => Origin::Unix.instant(count + GPS_DAY * DAY),
            Self::Gps => Some(count),
            Self::Tai => Some(count - TAI_AHEAD),
        }
    }

    /// The scale that the text names, by default this one, and the instant.
    fn named(self, date: &str, time: &str, writing: Writing) -> Result<(Self, i128), &'static str> {
        self.dated(Date::read(date, writing.order)?, time, writing.is_compact)
    }

    /// As [`named`](Self::named), for a known day.
    fn dated(self, Date(year, month, day): Date, time: &str, is_compact: bool) -> Result<(Self, i128), &'static str> {
        let (time, zone) = zone_of(time.trim()).ok_or(NO_DATE)?;
        let compact = || time_of_digits(time).filter(|_| is_compact);
        let (hour, minute, nanos) = time_of(time).or_else(compact).ok_or(NO_DATE)?;
        let (scale, ahead) = zone.unwrap_or((self, 0));
        let is_leap = nanos >= 60 * SECOND;
        let second = u8::try_from(nanos / SECOND).map_err(|_| NO_DATE)?;
        let unleaped = if is_leap { 59 } else { second };
        let civil = |second| Epoch::maybe_from_gregorian(year, month, day, hour, minute, second, 0, scale.hifitime());
        if hour > 23 || civil(second).is_err() {
            return Err("does not exist: there is no such day or time of day");
        }
        let days = days_since_1970(year, month, day).ok_or(NO_DATE)?;
        let of_day = (i128::from(hour) * 60 + i128::from(minute)) * 60 + i128::from(unleaped);
        let count = days * DAY + of_day * SECOND + nanos % SECOND - ahead;
        let instant = scale.of_count(count - GPS_DAY * DAY).ok_or(NO_DATE)?;
        // The leap second is the one after 23:59:59.
        Ok((scale, instant + if is_leap { SECOND } else { 0 }))
    }

    const fn hifitime(self) -> TimeScale {
        match self {
            Self::Utc => TimeScale::UTC,
            Self::Gps => TimeScale::GPST,
            Self::Tai => TimeScale::TAI,
        }
    }
}

/// A second of GPS time as a date and time of day of UTC, such as `2025-07-08T19:34:18Z`. A leap second is `23:59:60Z`.
pub(in super::super) fn utc_text(gps_seconds: i64) -> String {
    let instant = i128::from(gps_seconds) * SECOND;
    let count = last_unix(instant);
    // `hifitime` has a new leap second half a minute too early: in TAI it counts as Unix time does, without leap seconds.
    let calendar = Epoch::from_gregorian_tai_at_midnight(1970, 1, 1) + Duration::from_total_nanoseconds(count);
    let (year, month, day, hour, minute, second, _) = calendar.to_gregorian_tai();
    let is_leap = Origin::Unix.instant(count).is_some_and(|begin| begin < instant);
    let second = second + u8::from(is_leap);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Nanoseconds since 1970-01-01 UTC, without leap seconds as computers count, of nanoseconds of GPS time.
pub(in super::super) fn unix_of_gps(nanos: i64) -> i64 {
    i64::try_from(last_unix(i128::from(nanos))).unwrap_or(i64::MAX)
}

/// The last count of Unix time that is no later than an instant of GPS time; in a leap second, that of a second before.
fn last_unix(instant: i128) -> i128 {
    let near = Epoch::from_gpst_duration(Duration::from_total_nanoseconds(instant));
    let near = near.to_unix_duration().total_nanoseconds();
    // In the last half minute before a leap second `hifitime` has it already.
    let is_past = |count: &i128| Origin::Unix.instant(*count).is_some_and(|begin| begin <= instant);
    let count = [near + SECOND, near, near - SECOND].into_iter().find(is_past);
    count.unwrap_or(near)
}

/// Days of the calendar since 1970-01-01.
fn days_since_1970(year: i32, month: u8, day: u8) -> Option<i128> {
    let midnight = |y, m, d| Epoch::maybe_from_gregorian(y, m, d, 0, 0, 0, 0, TimeScale::TAI).ok();
    Some((midnight(year, month, day)? - midnight(1970, 1, 1)?).total_nanoseconds() / DAY)
}

/// Date and time of day.
fn parts_of(text: &str) -> Result<(&str, &str), &'static str> {
    let at = text.find(['T', 't', ' ']).ok_or(NO_DATE)?;
    let (date, time) = text.split_at(at);
    Ok((date, time.get(1..).unwrap_or_default()))
}

impl Date {
    /// `2025-07-08` or `2025/07/08`; with a declared order also `08.07.25` and `080725`.
    pub(super) fn read(text: &str, order: Option<Order>) -> Result<Self, &'static str> {
        let text = text.trim();
        let parts = parts_of_date(text, order).ok_or(NO_DATE)?;
        let [year, month, day] = match order {
            None | Some(Order::Ymd) => parts,
            Some(Order::Dmy) => [parts[2], parts[1], parts[0]],
            Some(Order::Mdy) => [parts[2], parts[0], parts[1]],
        };
        let is_short = year.len() == 2 && order.is_some();
        if order.is_none() && day.len() == 4 {
            return Err(NO_YEAR_FIRST);
        }
        if year.len() != 4 && !is_short {
            return Err(NO_DATE);
        }
        let read = || {
            let year: i32 = number(year)?;
            // GPS time begins in 1980.
            let century = if !is_short {
                0
            } else if year < 80 {
                2000
            } else {
                1900
            };
            Some(Self(century + year, number(month)?, number(day)?))
        };
        read().ok_or(NO_DATE)
    }

    /// The date a number of days later; `None` beyond the calendar.
    fn plus(self, days: i128) -> Option<Self> {
        let Self(year, month, day) = self;
        let midnight = Epoch::maybe_from_gregorian(year, month, day, 0, 0, 0, 0, TimeScale::TAI).ok()?;
        let later = midnight + Duration::from_total_nanoseconds(days.checked_mul(DAY)?);
        let (year, month, day, ..) = later.to_gregorian_tai();
        Some(Self(year, month, day))
    }
}

/// The three parts of a date, in the order in which they are written.
fn parts_of_date(text: &str, order: Option<Order>) -> Option<[&str; 3]> {
    if let Some(order) = order
        && text.bytes().all(|b| b.is_ascii_digit())
    {
        let year = text.len().checked_sub(4).filter(|year| matches!(year, 2 | 4))?;
        let (a, b) = if order == Order::Ymd { (year, year + 2) } else { (2, 4) };
        return Some([text.get(..a)?, text.get(a..b)?, text.get(b..)?]);
    }
    let is_separator = |c: &char| matches!(c, '-' | '/') || *c == '.' && order.is_some();
    let separator = text.chars().find(|c| !c.is_ascii_digit()).filter(is_separator)?;
    let mut parts = text.split(separator);
    let three = [parts.next()?, parts.next()?, parts.next()?];
    parts.next().is_none().then_some(three)
}

/// Whether it is a time of day, without a date.
fn is_time_of_day(text: &str) -> bool {
    zone_of(text.trim()).is_some_and(|(time, _)| time_of(time).or_else(|| time_of_digits(time)).is_some())
}

/// `193418.25`, as NMEA writes it.
fn time_of_digits(text: &str) -> Option<(u8, u8, i128)> {
    let whole = text.find('.').unwrap_or(text.len());
    if whole != 6 {
        return None;
    }
    time_of(&format!("{}:{}:{}", text.get(..2)?, text.get(2..4)?, text.get(4..)?))
}

/// `19:34:18.25`: hours, minutes, nanoseconds of the minute.
fn time_of(text: &str) -> Option<(u8, u8, i128)> {
    let mut parts = text.split(':');
    let (hour, minute, second) = (parts.next()?, parts.next()?, parts.next()?);
    let is_plain = second.bytes().all(|b| b.is_ascii_digit() || b == b'.') && parts.next().is_none();
    let nanos = decimal_nanos(second, SECOND).filter(|nanos| is_plain && *nanos < 61 * SECOND)?;
    Some((number(hour)?, number(minute)?, nanos))
}

/// Splits a text into the time of day and, after its digits, the scale with its offset in nanoseconds.
fn zone_of(text: &str) -> Option<(&str, Option<(Scale, i128)>)> {
    let end = text
        .find(|c: char| !(c.is_ascii_digit() || matches!(c, ':' | '.')))
        .unwrap_or(text.len());
    let (time, zone) = text.split_at(end);
    let named = match zone.trim() {
        "" => return Some((time, None)),
        "Z" | "z" | "UTC" => (Scale::Utc, 0),
        "GPST" | "GPS" => (Scale::Gps, 0),
        "TAI" => (Scale::Tai, 0),
        offset => (Scale::Utc, offset_of(offset)?),
    };
    Some((time, Some(named)))
}

/// `+02:00`, `+0200` or `+02`.
fn offset_of(text: &str) -> Option<i128> {
    let sign = match text.as_bytes().first()? {
        b'+' => 1,
        b'-' => -1,
        _ => return None,
    };
    let (hours, minutes) = match text.get(1..)?.as_bytes() {
        [a, b] => ([*a, *b], *b"00"),
        [a, b, b':', c, d] | [a, b, c, d] => ([*a, *b], [*c, *d]),
        _ => return None,
    };
    let two = |digits: [u8; 2]| number::<u8>(core::str::from_utf8(&digits).ok()?).map(i128::from);
    let (hours, minutes) = (two(hours)?, two(minutes).filter(|minutes| *minutes < 60)?);
    Some(sign * (hours * 60 + minutes) * 60 * SECOND)
}

/// Digits alone, as a number.
fn number<T: core::str::FromStr>(digits: &str) -> Option<T> {
    digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utc(text: &str) -> Result<i128, &'static str> {
        Scale::Utc.instant(text, None)
    }

    #[test]
    fn the_leap_seconds_of_a_day_are_those_of_each_of_its_counts() {
        let zero = ZeroPoint::new(Origin::Unix);
        // Across the leap seconds of 2015 and 2017 and back, and across time zero.
        for seconds in [
            1_435_708_799,
            1_435_708_800,
            1_483_228_799,
            1_483_228_800,
            1_483_228_799,
            0,
            -1,
            86_399,
        ] {
            for nanos in [0, 999_999_999] {
                let count = seconds * SECOND + nanos;
                assert_eq!(zero.instant(count), Origin::Unix.instant(count), "{count}");
            }
        }
        // The last nanosecond before the leap second of 2015, with 16 seconds.
        let last = 1_435_708_800 * SECOND - 1;
        assert_eq!(zero.instant(last), Some(last - (315_964_800 - 16) * SECOND));
        for count in [last, last - 20 * SECOND, last + 1, last + 20 * SECOND] {
            let gps = zero.instant(count).unwrap();
            assert_eq!(i128::from(unix_of_gps(gps as i64)), count, "{count}");
        }
        assert_eq!(zero.instant(LARGEST), None);
        assert_eq!(ZeroPoint::new(Origin::Gps).instant(5), Some(5));
    }

    #[test]
    fn the_text_of_a_second_is_read_as_that_second() {
        // The minute around the leap second at the end of 2016, and a second without any near it.
        for second in (1_167_263_980..1_167_264_040).chain([1_000_000_000]) {
            assert_eq!(utc(&utc_text(second)).unwrap(), i128::from(second) * SECOND, "{}", utc_text(second));
        }
        assert_eq!(utc_text(1_167_264_017), "2016-12-31T23:59:60Z");
    }

    #[test]
    fn unix_and_gps_times_differ_by_the_leap_seconds_of_their_day() {
        // GPS week 1025, the first epoch of 1999-08-29: 13 leap seconds (IGS calendar).
        assert_eq!(utc("1999-08-28T23:59:47Z").unwrap(), 1025 * 7 * DAY);
        // 2017-01-01 00:00:00 UTC is GPS second 1167264018: the 18th leap second has passed (IERS Bulletin C 52).
        assert_eq!(utc("2017-01-01T00:00:00Z").unwrap(), 1_167_264_018 * SECOND);
        assert_eq!(Origin::Unix.instant(1_483_228_800 * SECOND), Some(1_167_264_018 * SECOND));
        assert_eq!(Origin::Unix.instant(1_483_228_799 * SECOND), Some(1_167_264_016 * SECOND));
        assert_eq!(utc("2016-12-31T23:59:60.5Z").unwrap(), 1_167_264_017 * SECOND + SECOND / 2);
        assert_eq!(Scale::Gps.instant("1980-01-06 00:00:00", None), Ok(0));
        assert_eq!(Scale::Tai.instant("1980-01-06 00:00:19 TAI", None), Ok(0));
        assert_eq!(utc("1980-01-06 00:00:00"), Ok(0));
        assert_eq!(Origin::Unix.instant(i128::MAX / 4), None);
    }

    #[test]
    fn a_date_is_read_however_it_is_written_year_first() {
        let instant = utc("2025-07-08T19:34:18.499Z").unwrap();
        for text in [
            "2025/07/08 19:34:18.499",
            "2025-7-8 19:34:18.49900",
            "2025-07-08t21:34:18.499+02:00",
            "2025-07-08 14:04:18.499-0530",
            "2025-07-09T00:34:18.499+05",
            "2025-07-08  19:34:18.499 UTC",
        ] {
            assert_eq!(utc(text), Ok(instant), "{text}");
        }
        // 18 leap seconds in 2025.
        assert_eq!(Scale::Gps.instant("2025/07/08 19:34:36.499", None), Ok(instant));
        // Local time on the other side of a leap second.
        let before = utc("2016-12-31T23:30:00Z").unwrap();
        assert_eq!(utc("2017-01-01T01:30:00+02:00"), Ok(before));
    }

    #[test]
    fn a_date_in_a_declared_order_and_digits_without_separators_are_read() {
        let instant = utc("2025-07-08T19:34:18.5Z");
        for (text, order) in [
            ("08/07/2025 19:34:18.5", Order::Dmy),
            ("8.7.25 193418.5", Order::Dmy),
            ("080725 193418.50Z", Order::Dmy),
            ("08072025 19:34:18.5", Order::Dmy),
            ("07/08/2025 19:34:18.5", Order::Mdy),
            ("07-08-25 19:34:18.5", Order::Mdy),
            ("2025.07.08 19:34:18.5", Order::Ymd),
            ("20250708 193418.5", Order::Ymd),
        ] {
            assert_eq!(Scale::Utc.instant(text, Some(order)), instant, "{text}");
        }
        assert_eq!(Date::read("311280", Some(Order::Dmy)), Ok(Date(1980, 12, 31)));
        for text in [
            "8/7/202 10:00:00",
            "8072025 10:00:00",
            "08/07-2025 10:00:00",
            "08/07/2025 1000",
            "08/07/2025 1000000",
        ] {
            assert_eq!(Scale::Utc.instant(text, Some(Order::Dmy)), Err(NO_DATE), "{text}");
        }
        assert!(
            Scale::Utc
                .instant("07/25/2025 10:00:00", Some(Order::Dmy))
                .is_err_and(|e| e.starts_with("does not exist"))
        );
        // A guess accepts only unambiguous texts.
        assert_eq!(Scale::guessed("080725 193418"), None);
        assert_eq!(Scale::guessed_of_day("2025-07-08", "193418"), None);
    }

    #[test]
    fn a_time_of_day_belongs_to_the_day_that_brings_it_near() {
        let day = Date::read("2016-12-31", None).unwrap();
        let at = |time: &str, around: Option<i128>| Scale::Utc.nearest(day, time, around);
        let evening = utc("2016-12-31 23:59:59").unwrap();
        assert_eq!(at("23:59:59", None), Ok(evening));
        // A leap second came between.
        assert_eq!(at("00:00:00", Some(evening)), Ok(evening + 2 * SECOND));
        let later = utc("2017-03-01 23:00:00").unwrap();
        assert_eq!(at("010000", Some(later)), utc("2017-03-02 01:00:00"));
        assert_eq!(at("22:59:59Z", Some(later)), Ok(later - SECOND));
        assert_eq!(at("x", None), Err(NO_TIME));
    }

    #[test]
    fn what_is_no_instant_is_refused() {
        for text in [
            "",
            "T",
            "2025-07-08",
            "08.07.2025 10:00:00",
            "2025-07-08T10",
            "2025-07-08T10:00",
            "2025-07-08T10:00:-1",
            "2025-07-08T10:00:1e1",
            "2025-07-08T10:00:00+2",
            "2025-07-08T10:00:00 CEST",
            "2025-07/08 10:00:00",
            "2025-07-08T+1:00:00",
            "99999999999-01-01 00:00:00",
            "é-é-é é:é:é",
            "2025-07-08T10:00:00+0é",
        ] {
            assert_eq!(utc(text), Err(NO_DATE), "{text}");
        }
        assert_eq!(utc("08/07/2025 10:00:00"), Err(NO_YEAR_FIRST));
        assert_eq!(utc("10:00:00"), Err(NO_DAY));
        for text in [
            "2025-02-29T10:00:00",
            "2025-13-01T10:00:00",
            "2025-07-08T24:00:00",
            "2025-07-08T10:60:00",
            "2025-07-08T23:59:60",
        ] {
            assert!(utc(text).is_err_and(|e| e.starts_with("does not exist")), "{text}");
        }
        assert!(
            Scale::Gps
                .instant("2025-07-08T10:00:00Z", None)
                .is_err_and(|e| e.starts_with("names another"))
        );
    }
}
