//! The stamps of messages: the time of the week, and the week of the newest message that has one.

use super::layout::Layout;
use crate::nmea::clock::days;
use fusion::core::math;
use fusion::source::table::gps_of_unix;

pub(super) use crate::nmea::fields::STAMP;

const MILLISECOND: i64 = 1_000_000;
/// A week \[ms\].
const WEEK: i64 = 7 * 86_400 * 1000;

/// The clock of a receiver.
#[derive(Clone, Debug, Default)]
pub(super) struct Clock {
    /// The week and the time of the week \[ms\] of the newest message.
    newest: Option<(i64, i64)>,
}

impl Clock {
    /// A clock that begins in the week of this message, if it has one.
    pub(super) fn begins(layout: &Layout, content: &[u8]) -> Option<Self> {
        let (tow, week) = of(layout, content)?;
        Some(Self {
            newest: Some((week?, tow)),
        })
    }

    /// A clock of a log without any week.
    pub(super) const fn without_week() -> Self {
        Self { newest: Some((0, 0)) }
    }

    /// The stamp of the newest message \[ns\].
    pub(super) fn newest(&self) -> Option<i64> {
        let (week, tow) = self.newest?;
        instant(week, tow)
    }

    /// The stamp of a message \[ns\] of GPS time. A message without a time has that of the message before it.
    pub(super) fn stamp(&mut self, layout: &Layout, content: &[u8]) -> Option<i64> {
        if let Some(own) = event(layout, content) {
            return Some(own);
        }
        if let (Some((tow, week)), Some((newest, before))) = (of(layout, content), self.newest) {
            let week = match week {
                Some(week) => week,
                // Messages of one log are less than half a week apart.
                None if tow + WEEK / 2 < before => newest + 1,
                None if tow > before + WEEK / 2 => newest - 1,
                None => newest,
            };
            self.newest = Some((week, tow));
        }
        self.newest()
    }
}

/// An instant of a week \[ns\]; `None` beyond the range of stamps.
fn instant(week: i64, tow: i64) -> Option<i64> {
    week.checked_mul(WEEK)?.checked_add(tow)?.checked_mul(MILLISECOND)
}

/// The time of a pulse or of an edge, which is not the time of the message.
fn event(layout: &Layout, content: &[u8]) -> Option<i64> {
    let whole = |name: &str| layout.whole(name, content);
    match layout.name {
        "TIM-TP" => {
            // Parts of 2⁻³² ms.
            let nanos = (i128::from(whole("towSubMS")?) * i128::from(MILLISECOND)) >> 32;
            instant(whole("week")?, whole("towMS")?)?.checked_add(nanos as i64)
        }
        "TIM-TM2" => instant(whole("wnR")?, whole("towMsR")?)?.checked_add(whole("towSubMsR")?),
        _ => None,
    }
}

/// The time of the week \[ms\] and the week of a message.
fn of(layout: &Layout, content: &[u8]) -> Option<(i64, Option<i64>)> {
    let whole = |name: &str| layout.whole(name, content);
    let is = |flag: &str| whole(flag) == Some(1);
    let tow = whole("iTOW").filter(|tow| (0..WEEK).contains(tow))?;
    let of_date = |second: &str| {
        let day = days(whole("year")?, whole("month")?, whole("day")?)?;
        let seconds = day * 86_400 + whole("hour")? * 3600 + whole("min")? * 60 + whole(second)?;
        let gps = math::round(gps_of_unix(seconds as f64)?) as i64;
        // The time of the week is the same time, but for the part of a second.
        Some((gps * 1000 - tow + WEEK / 2).div_euclid(WEEK))
    };
    let week = match layout.name {
        "NAV-PVT" | "HNR-PVT" if is("validDate") && is("validTime") => of_date("second"),
        "NAV-TIMEUTC" if is("validUTC") => of_date("sec"),
        "NAV-TIMEGPS" if is("weekValid") => whole("week"),
        "NAV-SOL" if is("wknSet") => whole("week"),
        _ => None,
    };
    Some((tow, week))
}
