//! Damaged places that a reader passes over.

use crate::messages::Broken;

/// The damaged places of a file so far.
#[derive(Debug, Default)]
pub(crate) struct Damage {
    first: Option<u64>,
    places: usize,
    bytes: u64,
}

impl Damage {
    /// Adds the bytes from one place to another.
    pub(crate) fn add(&mut self, from: u64, to: u64) {
        self.first.get_or_insert(from);
        self.places += 1;
        self.bytes += to.saturating_sub(from);
    }

    /// The end of the file, with a report of its damage, once.
    pub(crate) fn reported<T>(&mut self) -> Result<Option<T>, Broken> {
        match core::mem::take(self) {
            Self {
                first: Some(first),
                places,
                bytes,
            } => {
                let message = format!("{places} places are damaged, the first after byte {first}: {bytes} bytes were skipped");
                Err(Broken { at: None, message })
            }
            _ => Ok(None),
        }
    }
}
