//! Bytes that arrive while the filter runs, in place of the file of a source.

use core::fmt;
use std::io::Read;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes that arrive while the filter runs. A source then reads these in place of its file, with the same declaration.
///
/// A row is decoded without the rows after it: stamps that go back or jump ahead are passed on, and a row that cannot be
/// read is left out and counted, also with `bad_rows = "stop"`.
#[derive(Clone)]
pub struct ArrivingBytes(Arc<Mutex<Option<Box<dyn Read + Send>>>>);

impl ArrivingBytes {
    /// The bytes of this reader, which waits for those that have not arrived. They can be taken once.
    #[must_use]
    pub fn new(reader: Box<dyn Read + Send>) -> Self {
        Self(Arc::new(Mutex::new(Some(reader))))
    }

    /// The bytes; none if they have been taken.
    pub(super) fn take(&self) -> Box<dyn Read + Send> {
        let taken = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        taken.unwrap_or_else(|| Box::new(std::io::empty()))
    }
}

impl fmt::Debug for ArrivingBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ArrivingBytes")
    }
}
