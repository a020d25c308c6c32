//! The stamps of sentences: the time of day of a sentence, and the date of the newest one.

use super::sentence::Sentence;
use fusion::core::math;
use fusion::source::table::gps_of_unix;

const SECOND: i64 = 1_000_000_000;
const DAY: i64 = 86_400 * SECOND;
/// 1980-01-06 in days of 1970-01-01.
const GPS_DAY: i64 = 3657;

/// The clock of a log of sentences.
#[derive(Clone, Debug, Default)]
pub(crate) struct Clock {
    /// The date in days of 1970-01-01, and the time of day \[ns\] of the newest sentence.
    newest: Option<(i64, i64)>,
}

impl Clock {
    /// A clock that begins on the date of this sentence, if it has one.
    pub(crate) fn begins(sentence: &Sentence<'_>) -> Option<Self> {
        let (time, date) = of(sentence)?;
        Some(Self {
            newest: Some((date?, time)),
        })
    }

    /// A clock that begins at an instant of GPS time \[ns\].
    #[cfg(feature = "ubx")]
    pub(crate) fn at(instant: i64) -> Self {
        // The next sentence is less than half a day from it: leap seconds do not matter.
        let unix = instant.saturating_add(GPS_DAY * DAY);
        Self {
            newest: Some((unix.div_euclid(DAY), unix.rem_euclid(DAY))),
        }
    }

    /// A clock without any date: its stamps are times of day on the first day of GPS time.
    pub(crate) const fn without_date() -> Self {
        Self {
            newest: Some((GPS_DAY, 0)),
        }
    }

    /// The stamp of a sentence \[ns\] of GPS time. A sentence without a time has that of the sentence before it.
    pub(crate) fn stamp(&mut self, sentence: &Sentence<'_>) -> Option<i64> {
        if let (Some((time, date)), Some((day, before))) = (of(sentence), self.newest) {
            let day = match date {
                Some(day) => day,
                // Sentences of one log are less than half a day apart.
                None if time + DAY / 2 < before => day + 1,
                None if time > before + DAY / 2 => day - 1,
                None => day,
            };
            self.newest = Some((day, time));
        }
        let (day, time) = self.newest?;
        let seconds = gps_of_unix((day * 86_400 + time / SECOND) as f64)?;
        (math::round(seconds) as i64).checked_mul(SECOND)?.checked_add(time % SECOND)
    }
}

/// The time of day \[ns\] and the date of a sentence.
fn of(sentence: &Sentence<'_>) -> Option<(i64, Option<i64>)> {
    let fields = || sentence.fields();
    let field = |k: usize| fields().nth(k).and_then(|field| core::str::from_utf8(field).ok());
    match Sentence::kind(sentence.address) {
        "GGA" | "GNS" | "GST" | "GBS" => Some((time(field(0)?)?, None)),
        "GLL" => Some((time(field(4)?)?, None)),
        "RMC" => {
            let date = field(8).filter(|date| date.len() == 6 && date.is_ascii());
            let part = |date: &str, from: usize| date[from..from + 2].parse::<i64>().ok();
            // Years of two digits are 1980 to 2079.
            let year = |year: i64| if year < 80 { 2000 + year } else { 1900 + year };
            let date = date.and_then(|date| days(year(part(date, 4)?), part(date, 2)?, part(date, 0)?));
            Some((time(field(0)?)?, date))
        }
        "ZDA" => {
            let number = |k: usize| field(k)?.parse::<i64>().ok();
            let date = || days(number(3)?, number(2)?, number(1)?);
            Some((time(field(0)?)?, date()))
        }
        _ => None,
    }
}

/// A time of day `hhmmss.sss` \[ns\].
fn time(text: &str) -> Option<i64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let is_number = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.len() != 6 || !is_number(whole) || !is_number(fraction) || fraction.len() > 9 {
        return None;
    }
    let part = |from: usize| whole[from..from + 2].parse::<i64>().ok();
    let seconds = 3600 * part(0)? + 60 * part(2)? + part(4)?;
    let nanos: i64 = format!("{fraction:0<9}").parse().ok()?;
    // A leap second is the last one of its day.
    (seconds <= 86_400).then_some(seconds * SECOND + nanos)
}

/// The days of a date since 1970-01-01, by the algorithm of H. Hinnant.
pub(crate) fn days(year: i64, month: i64, day: i64) -> Option<i64> {
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) || !(1980..2200).contains(&year) {
        return None;
    }
    let year = if month <= 2 { year - 1 } else { year };
    let (era, of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    Some(era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468)
}
