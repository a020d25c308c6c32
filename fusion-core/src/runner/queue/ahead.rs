//! Rows that are stamped ahead of the process input.
//!
//! The newest stamp of all streams sets the time. A sensor whose clock is ahead would thus make every row of the
//! input late, permanently. So rows that are valid after the newest row of the input wait for it; they could not be
//! used earlier anyway. Without input they would wait for ever. So if such rows span more time than one sample of the
//! input covers, and no input comes, they do not count as ahead, and the process coasts.

use crate::runner::{Row, StreamId};
use crate::time::Time;

/// How far the input is, and which rows are ahead of it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ahead {
    /// The latest stamp of the input.
    input: Option<Time>,
    /// Rows since then that are ahead.
    since: Option<Stretch>,
}
crate::memory!(Ahead { input, since });

/// Successive rows of any stream.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    /// The stream of the first row.
    stream: StreamId,
    first: Time,
    latest: Time,
}
crate::memory!(Stretch { stream, first, latest });

impl Ahead {
    /// Takes a row of the input, whose samples each cover at most `longest` \[ns\]. If it shows that an earlier row
    /// was further ahead than that, returns the stream of that row and the difference \[s\].
    pub(crate) fn input(&mut self, row: &Row<'_>, longest: i64) -> Option<(StreamId, f64)> {
        if self.input.is_some_and(|latest| row.time <= latest) {
            return None;
        }
        self.input = Some(row.time);
        let ahead = self.since.take().filter(|since| since.first > row.time.shifted(longest))?;
        Some((ahead.stream, ahead.first.seconds_since(row.time)))
    }

    /// Takes a row of another stream.
    pub(crate) fn other(&mut self, row: &Row<'_>) {
        if self.input.is_some_and(|input| row.time > input) {
            let since = self.since.get_or_insert(Stretch {
                stream: row.stream,
                first: row.time,
                latest: row.time,
            });
            since.latest = since.latest.max(row.time);
        }
    }

    /// The stamp up to which rows do not wait for the input.
    pub(crate) fn reach(&self, longest: i64) -> Time {
        let is_silent = |since: &Stretch| since.latest > since.first.shifted(longest);
        match (self.input, self.since.filter(is_silent)) {
            (None, _) => Time::MAX,
            (Some(_), Some(silent)) => silent.latest,
            (Some(input), None) => input,
        }
    }
}
