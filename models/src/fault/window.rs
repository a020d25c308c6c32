//! The windows of a fault.

use crate::units::{Duration, Positive, dim};
use core::fmt;
use fusion_core::time::{Time, nanos};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;

/// A time span: it includes `from`, but not `to`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// Its first instant.
    pub from: Time,
    /// The first instant after it.
    pub to: Time,
}

fusion_core::memory!(Window { from, to });

/// Time spans of the log, each once or repeated.
///
/// ```toml
/// window = { from = "300 s", to = "360 s" }
/// window = { from = "300 s", duration = "60 s", every = "180 s", until = "1200 s" }
/// window = [{ to = "10 s" }, { from = "500 s" }]
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Windows(Vec<Repeated>);

impl Default for Windows {
    /// Always.
    fn default() -> Self {
        Self(vec![Repeated {
            first: Window {
                from: Time::MIN,
                to: Time::MAX,
            },
            every: None,
            until: Time::MAX,
        }])
    }
}

impl Windows {
    /// From `from` on.
    #[must_use]
    pub fn since(from: Time) -> Self {
        let first = Window { from, to: Time::MAX };
        Self(vec![Repeated {
            first,
            every: None,
            until: Time::MAX,
        }])
    }

    /// The windows that overlap `span`, each from its beginning to its end, in order within each declaration. Without
    /// windows that are infinite in both directions.
    pub fn within(&self, span: Window) -> impl Iterator<Item = Window> {
        self.0.iter().flat_map(move |repeated| repeated.within(span))
    }

    /// Returns true if a window contains `time`.
    #[must_use]
    pub fn contains(&self, time: Time) -> bool {
        self.0.iter().any(|r| r.contains(time))
    }

    /// The window that contains `time`; of several, the window that began last.
    #[must_use]
    pub fn containing(&self, time: Time) -> Option<Window> {
        let found = self.0.iter().filter_map(|r| r.at(time));
        found.max_by_key(|w| w.from)
    }

    /// Each declared time span: a single window, or a repeated one.
    pub fn each(&self) -> impl Iterator<Item = Repeated> {
        self.0.iter().copied()
    }
}

/// A time span, once or repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repeated {
    first: Window,
    every: Option<i64>,
    until: Time,
}

impl Repeated {
    /// Returns true if it contains `time`.
    #[must_use]
    pub fn contains(&self, time: Time) -> bool {
        self.at(time).is_some()
    }

    /// Its windows that overlap `span`; none if it is infinite in both directions.
    fn within(self, span: Window) -> impl Iterator<Item = Window> {
        let Window { from, to } = self.first;
        let is_bounded = from != Time::MIN || to != Time::MAX;
        // The first window that may overlap: the window at the beginning of the span, or the next.
        let since = span.from.nanos().saturating_sub(from.nanos()).max(0);
        let passed = self.every.map_or(0, |every| since / every);
        let begins = move |number: i64| match self.every {
            Some(every) => Some(from.nanos().checked_add(number.checked_mul(every)?)?),
            None => (number == 0).then(|| from.nanos()),
        };
        (passed..)
            .map_while(begins)
            .map(Time::from_nanos)
            .take_while(move |begin| is_bounded && *begin < span.to.min(self.until))
            .filter_map(move |begin| self.at(begin))
            .filter(move |window| window.to > span.from)
    }

    /// The window that contains `time`. An open end is [`Time::MIN`] or [`Time::MAX`].
    ///
    /// The window of a repetition is computed directly, without counting: it may have begun decades ago.
    #[must_use]
    pub fn at(&self, time: Time) -> Option<Window> {
        let Window { from, to } = self.first;
        if time < from || time >= self.until && self.until != Time::MAX {
            return None;
        }
        // Both are later than 1677, so their difference fits an unsigned number.
        let length = to.nanos().abs_diff(from.nanos());
        let since = time.nanos().abs_diff(from.nanos());
        let into = self.every.map_or(since, |every| since % every.unsigned_abs());
        let begun = Time::from_nanos(time.nanos().wrapping_sub_unsigned(into));
        let to = if to == Time::MAX {
            Time::MAX
        } else {
            Time::from_nanos(begun.nanos().saturating_add_unsigned(length)).min(self.until)
        };
        (into < length || to == Time::MAX).then_some(Window { from: begun, to })
    }
}

/// When a fault acts.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// The first instant of the window, in the time of the log; by default the beginning.
    from: Option<Duration>,
    /// The first instant after the window; by default it lasts to the end.
    to: Option<Duration>,
    /// How long it lasts, instead of `to`.
    duration: Option<Positive<dim::Duration>>,
    /// Repeats the window at this interval.
    every: Option<Positive<dim::Duration>>,
    /// The end of the repetition.
    until: Option<Duration>,
}

impl Keys {
    fn check(&self) -> Result<Repeated, String> {
        let instant = |d: &Option<Duration>| d.map(|d| Time::from_seconds(d.si()));
        let from = instant(&self.from);
        let to = match (instant(&self.to), self.duration) {
            (Some(_), Some(_)) => return Err("a window has an end, `to`, or a `duration`, not both".to_owned()),
            (to, None) => to,
            (None, Some(d)) => match from {
                Some(from) => Some(from.shifted(nanos(d.si()).max(1))),
                None => return Err("a window with a `duration` needs `from`".to_owned()),
            },
        };
        let first = Window {
            from: from.unwrap_or(Time::MIN),
            to: to.unwrap_or(Time::MAX),
        };
        if first.to <= first.from {
            return Err(format!(
                "the window ends at {}, not after its beginning at {}",
                first.to, first.from
            ));
        }
        let every = self.every.map(|e| nanos(e.si()));
        match (every, from, to) {
            (None, ..) if self.until.is_some() => Err("`until` ends a repetition and needs `every`".to_owned()),
            (Some(_), None, _) | (Some(_), _, None) => Err("a repeated window needs `from` and an end".to_owned()),
            (Some(every), Some(from), Some(to)) if every < to.nanos().saturating_sub(from.nanos()) => Err(
                "the window is longer than `every`, the interval at which it repeats: write a longer `every` or a shorter window"
                    .to_owned(),
            ),
            _ => Ok(Repeated {
                first,
                every,
                until: instant(&self.until).unwrap_or(Time::MAX),
            }),
        }
    }
}

impl<'de> Deserialize<'de> for Repeated {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Keys::deserialize(deserializer)?.check().map_err(D::Error::custom)
    }
}

impl<'de> Deserialize<'de> for Windows {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMany;

        impl<'de> Visitor<'de> for OneOrMany {
            type Value = Windows;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a window, e.g. { from = \"300 s\", to = \"360 s\" }, or an array of windows")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Windows, A::Error> {
                Repeated::deserialize(MapAccessDeserializer::new(map)).map(|w| Windows(vec![w]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Windows, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(Windows)
            }
        }

        deserializer.deserialize_any(OneOrMany)
    }
}

impl JsonSchema for Windows {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Windows".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = Keys::json_schema(generator);
        json_schema!({ "anyOf": [one, { "type": "array", "items": one }] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Holder {
        window: Windows,
    }

    fn read(value: &str) -> Result<Windows, String> {
        let read = toml::from_str::<Holder>(&format!("window = {value}"));
        read.map(|h| h.window).map_err(|e| e.message().to_owned())
    }

    /// The window at `s` seconds, in whole seconds.
    fn at(windows: &Windows, s: f64) -> Option<(i64, i64)> {
        let found = windows.each().find_map(|w| w.at(t(s)))?;
        Some((found.from.nanos() / 1_000_000_000, found.to.nanos() / 1_000_000_000))
    }

    fn t(seconds: f64) -> Time {
        Time::from_seconds(seconds)
    }

    #[test]
    fn the_windows_within_a_span_are_those_that_overlap_it() {
        let within = |value: &str, from: f64, to: f64| {
            let span = Window { from: t(from), to: t(to) };
            let seconds = |w: Window| [w.from, w.to].map(|t| (t.nanos() as f64 * 1e-9).round());
            read(value).unwrap().within(span).map(seconds).collect::<Vec<_>>()
        };
        let every = "{ from = 10, duration = 5, every = 20, until = 72 }";
        assert_eq!(within(every, 0.0, 100.0), [[10.0, 15.0], [30.0, 35.0], [50.0, 55.0], [70.0, 72.0]]);
        assert_eq!(within(every, 34.0, 50.5), [[30.0, 35.0], [50.0, 55.0]]);
        assert_eq!(within(every, 35.0, 50.0), [] as [[f64; 2]; 0]);
        assert_eq!(within("{ from = -1e9, duration = 5, every = 20 }", 41.0, 42.0), [[40.0, 45.0]]);
        assert_eq!(within("[{ to = 10 }, { from = 90 }]", 0.0, 100.0).len(), 2);
        assert_eq!(within("[{ to = 10 }, { from = 90 }]", 20.0, 80.0).len(), 0);
        // A span without ends has no window.
        assert_eq!(Windows::default().within(Window { from: t(0.0), to: t(1.0) }).count(), 0);
        assert_eq!(Windows::since(t(3.0)).within(Window { from: t(0.0), to: t(9.0) }).count(), 1);
    }

    #[test]
    fn a_window_holds_its_beginning_and_not_its_end() {
        let w = read("{ from = '1 min', duration = 10 }").unwrap();
        let held: Vec<bool> = [59.999, 60.0, 69.999, 70.0].into_iter().map(|s| w.contains(t(s))).collect();
        assert_eq!(held, [false, true, true, false]);
    }

    #[test]
    fn the_window_of_a_repetition_is_found_at_any_time_in_it() {
        let w = read("{ from = 100, to = 115, every = 50, until = 260 }").unwrap();
        let listed = [(100, 115), (150, 165), (200, 215), (250, 260)];
        for s in 0..300 {
            let expected = listed.into_iter().find(|(from, to)| (*from..*to).contains(&s));
            assert_eq!(at(&w, s as f64), expected, "{s} s");
            assert_eq!(w.containing(t(s as f64)).is_some(), expected.is_some(), "{s} s");
        }
    }

    #[test]
    fn open_ends_reach_to_the_ends_of_the_log() {
        let w = read("[{ to = 10 }, { from = 500 }]").unwrap();
        assert!(w.contains(t(-1e6)) && !w.contains(t(10.0)) && w.contains(t(1e9)));
        let last = w.each().last().and_then(|w| w.at(t(600.0)));
        assert_eq!(last.map(|w| (w.from, w.to)), Some((t(500.0), Time::MAX)));
        assert!(Windows::default().contains(Time::MIN));
    }

    #[test]
    fn a_repetition_has_no_horizon() {
        // Seconds of Unix time; one minute of every three.
        let w = read("{ from = 300, duration = 60, every = 180 }").unwrap();
        let k = 9_737_000;
        let unix = 300 + 180 * k;
        assert_eq!(at(&w, (unix + 59) as f64), Some((unix, unix + 60)));
        assert_eq!(at(&w, (unix + 60) as f64), None);
        let before = read("{ from = '-500 s', duration = 60, every = 180 }").unwrap();
        assert_eq!(at(&before, -271.0), Some((-320, -260)));
        assert_eq!(at(&before, -501.0), None);
        let last = Windows::default().each().next().and_then(|w| w.at(Time::MAX));
        assert_eq!(last.map(|w| (w.from, w.to)), Some((Time::MIN, Time::MAX)));
    }

    #[test]
    fn windows_that_make_no_sense_are_refused() {
        let said = |text| read(text).unwrap_err();
        assert_eq!(
            said("{ from = 5, to = 5 }"),
            "the window ends at 5.000000 s, not after its beginning at 5.000000 s"
        );
        assert_eq!(
            said("{ from = 5, to = 6, duration = 1 }"),
            "a window has an end, `to`, or a `duration`, not both"
        );
        assert_eq!(said("{ duration = 1 }"), "a window with a `duration` needs `from`");
        assert_eq!(said("{ from = 5, every = 9 }"), "a repeated window needs `from` and an end");
        assert_eq!(
            said("{ from = 5, to = 9, every = 3 }"),
            "the window is longer than `every`, the interval at which it repeats: write a longer `every` or a shorter window"
        );
        assert_eq!(
            said("{ from = 5, to = 9, until = 30 }"),
            "`until` ends a repetition and needs `every`"
        );
    }
}
