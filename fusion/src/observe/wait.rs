//! The wait of a run before its filter started.

use core::fmt;
use fusion_core::time::Time;
use schemars::JsonSchema;
use serde::Serialize;

/// An initialiser is a cause of the wait if it was still waiting after this share of it; all others were ready long
/// before.
const LATE: f64 = 0.9;
/// The interval between two queries of what the filter waits for \[s\]: the answer is a text, and a log may have
/// thousands of rows per second.
const EVERY: f64 = 0.1;

/// The part of a log before the start of the outermost filter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Wait {
    /// From the first row to the start \[s\].
    pub seconds: f64,
    /// From the first row to the last \[s\].
    pub of: f64,
    /// The causes of the wait: the initialisers, and what each waited for.
    pub waited: Vec<(String, String)>,
}

impl Wait {
    /// The share of the log before the start.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.seconds / self.of
    }
}

/// For example: ``98 % of the log is before it and was not used: `levelling` waited for rest``.
impl fmt::Display for Wait {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.0} % of the log is before it and was not used", 100.0 * self.share())?;
        for (k, (name, what)) in self.waited.iter().enumerate() {
            write!(f, "{} `{name}` waited for {what}", if k == 0 { ":" } else { ";" })?;
        }
        Ok(())
    }
}

/// Follows the rows of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Waiting {
    first: Option<Time>,
    last: Time,
    /// The first start; a filter may start again later.
    started: Option<Time>,
    /// The time of the last query.
    asked: Option<Time>,
    /// Each initialiser, what it waits for, and the last row at which it waited.
    pending: Vec<(String, String, Time)>,
}

fusion_core::memory!(Waiting {
    first,
    last,
    started,
    asked,
    pending
});

impl Waiting {
    /// A row that is about to be fed, and what the filter waits for, if it has not started.
    pub(super) fn row(&mut self, time: Time, waits_for: impl FnOnce() -> Vec<(String, String)>) {
        let first = *self.first.get_or_insert(time);
        (self.first, self.last) = (Some(first.min(time)), self.last.max(time));
        if self.started.is_some() || self.asked.is_some_and(|asked| time.seconds_since(asked).abs() < EVERY) {
            return;
        }
        self.asked = Some(time);
        for (name, what) in waits_for() {
            match self.pending.iter_mut().find(|(known, ..)| *known == name) {
                Some(known) => *known = (name, what, time),
                None => self.pending.push((name, what, time)),
            }
        }
    }

    pub(super) fn started(&mut self, time: Time) {
        self.started.get_or_insert(time);
    }

    /// `None` if the filter never started.
    pub(super) fn finish(self) -> Option<Wait> {
        let (first, started) = self.first.zip(self.started)?;
        let seconds = started.seconds_since(first).max(0.0);
        let is_late = |until: Time| until.seconds_since(first) >= LATE * seconds;
        let pending = self.pending.into_iter().filter(|(_, _, until)| is_late(*until));
        Some(Wait {
            seconds,
            of: self.last.seconds_since(first),
            waited: pending.map(|(name, what, _)| (name, what)).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_waited_for_to_the_last_is_what_the_wait_was_for() {
        let mut waiting = Waiting::default();
        for k in 0..=100 {
            let time = Time::from_seconds(f64::from(k));
            let of = |name: &str, what: &str| (name.to_owned(), what.to_owned());
            waiting.row(time, || {
                let fix = (k < 3).then(|| of("fix", "a position"));
                let rest = (k < 40).then(|| of("levelling", if k < 2 { "a sample" } else { "rest" }));
                fix.into_iter().chain(rest).collect()
            });
            if k == 40 || k == 70 {
                waiting.started(time);
            }
        }
        let found = waiting.finish().unwrap();
        assert_eq!((found.seconds, found.of, found.share()), (40.0, 100.0, 0.4));
        assert_eq!(found.waited, [("levelling".to_owned(), "rest".to_owned())]);
        assert_eq!(Waiting::default().finish(), None);
        // One second of a fast log: ten queries.
        let (mut waiting, mut asked) = (Waiting::default(), 0);
        for k in 0..1000 {
            waiting.row(Time::from_nanos(k * 1_000_000), || {
                asked += 1;
                Vec::new()
            });
        }
        assert_eq!(asked, 10);
    }
}
