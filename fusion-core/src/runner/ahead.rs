//! Rows that are stamped ahead of the process input.
//!
//! Time goes on by the newest stamp of all. A sensor whose clock is ahead would so make every row of
//! the input late, for good. So rows that are valid after the newest row of the input wait for it; of a
//! measurement nothing could be made before anyway. Where the input is silent they would wait for
//! ever: rows that go on for longer than one of its samples stands for, while no input comes, are not
//! ahead, and the process coasts.

use super::StreamId;
use super::rows::Row;
use crate::time::Time;

/// How far the input is, and who is ahead of it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ahead {
    /// The latest stamp of the input.
    input: Option<Time>,
    /// Rows since then that are ahead.
    since: Option<Stretch>,
}
crate::memory!(Ahead { input, since });

/// Rows of any stream, one after the other.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    /// The stream of the first.
    stream: StreamId,
    first: Time,
    latest: Time,
}
crate::memory!(Stretch { stream, first, latest });

impl Ahead {
    /// Takes a row of the input, of which a sample stands for no more than `longest` \[ns\]. If it shows
    /// that a row before it was further ahead than that: the stream of the row, and by how much \[s\].
    pub(super) fn input(&mut self, row: &Row<'_>, longest: i64) -> Option<(StreamId, f64)> {
        if self.input.is_some_and(|latest| row.time <= latest) {
            return None;
        }
        self.input = Some(row.time);
        let ahead = self.since.take().filter(|since| since.first > row.time.shifted(longest))?;
        Some((ahead.stream, ahead.first.seconds_since(row.time)))
    }

    /// Takes a row of another stream.
    pub(super) fn other(&mut self, row: &Row<'_>) {
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
    pub(super) fn reach(&self, longest: i64) -> Time {
        let is_silent = |since: &Stretch| since.latest > since.first.shifted(longest);
        match (self.input, self.since.filter(is_silent)) {
            (None, _) => Time::MAX,
            (Some(_), Some(silent)) => silent.latest,
            (Some(input), None) => input,
        }
    }
}
