//! Damaged places that a reader passes over.

use crate::messages::Broken;

/// The damaged places of a file so far, and the messages that cannot be read without them.
#[derive(Debug, Default)]
pub(crate) struct Damage {
    /// The first place, and what is wrong there, if it is known.
    first: Option<(u64, String)>,
    places: usize,
    bytes: u64,
    /// Messages of channels that the file does not declare, and the first of these channels.
    undeclared: Option<(usize, String)>,
}

impl Damage {
    /// Adds the bytes from one place to another.
    pub(crate) fn add(&mut self, from: u64, to: u64) {
        self.lose(from, to, String::new());
    }

    /// The same, with what is wrong there.
    pub(crate) fn lose(&mut self, from: u64, to: u64, why: String) {
        self.first.get_or_insert((from, why));
        self.places += 1;
        self.bytes += to.saturating_sub(from);
    }

    /// Counts a message of a channel that the file does not declare.
    pub(crate) fn undeclared(&mut self, channel: impl FnOnce() -> String) {
        self.undeclared.get_or_insert_with(|| (0, channel())).0 += 1;
    }

    /// The end of the file, with a report of its damage, once.
    pub(crate) fn reported<T>(&mut self) -> Result<Option<T>, Broken> {
        let message = core::mem::take(self).message();
        message.map_or(Ok(None), |message| Err(Broken { at: None, message }))
    }

    /// The place where reading ends, with the damage before it.
    pub(crate) fn before(&mut self, end: Broken) -> Broken {
        match core::mem::take(self).message() {
            Some(before) => Broken {
                message: format!("{}; before it, {before}", end.message),
                ..end
            },
            None => end,
        }
    }

    fn message(self) -> Option<String> {
        let Self {
            first,
            places,
            bytes,
            undeclared,
        } = self;
        let lost = first.map(|(first, why)| {
            let why = if why.is_empty() { why } else { format!(" ({why})") };
            match places {
                1 => format!("a place is damaged, after byte {first}{why}: {bytes} bytes were skipped"),
                _ => format!("{places} places are damaged, the first after byte {first}{why}: {bytes} bytes were skipped"),
            }
        });
        let undeclared = undeclared.map(|(count, first)| {
            let what = if count == 1 { "message belongs" } else { "messages belong" };
            format!("{count} {what} to no channel that the file declares, the first to {first}")
        });
        let all: Vec<String> = [lost, undeclared].into_iter().flatten().collect();
        (!all.is_empty()).then(|| all.join("; "))
    }
}
