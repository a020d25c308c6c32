//! Counts the bytes of the files of a run that are still to be read.

use std::io::{Read, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of open files that are still to be read, as stored on disk. Clones share one count.
#[derive(Clone, Debug, Default)]
pub struct Unread(Arc<AtomicU64>);

impl Unread {
    /// The number of bytes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Counts the bytes read of `file`, of which `left` bytes are still to be read.
    pub(super) fn count<R>(&self, file: R, left: u64) -> Counted<R> {
        self.0.fetch_add(left, Ordering::Relaxed);
        let all = self.clone();
        Counted { file, left, all }
    }
}

/// A file whose read bytes are counted. When it is closed, its remaining bytes no longer count as unread.
#[derive(Debug)]
pub(super) struct Counted<R> {
    file: R,
    left: u64,
    all: Unread,
}

impl<R> Counted<R> {
    /// A file that grows while it is read counts with its size at opening.
    fn has_read(&mut self, bytes: u64) {
        let counted = bytes.min(self.left);
        self.left -= counted;
        self.all.0.fetch_sub(counted, Ordering::Relaxed);
    }
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let bytes = self.file.read(buffer)?;
        self.has_read(bytes as u64);
        Ok(bytes)
    }
}

impl<R> Drop for Counted<R> {
    fn drop(&mut self) {
        self.has_read(self.left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_or_closed_is_no_longer_to_be_read() {
        let unread = Unread::default();
        let mut first = unread.count(&[0; 10][..], 10);
        let second = unread.count(&[0; 5][..], 5);
        assert_eq!(unread.bytes(), 15);
        first.read_exact(&mut [0; 4]).unwrap();
        assert_eq!(unread.bytes(), 11);
        drop(second);
        assert_eq!(unread.bytes(), 6);
        first.read_to_end(&mut Vec::new()).unwrap();
        assert_eq!(unread.bytes(), 0);
    }

    #[test]
    fn a_file_that_has_grown_is_not_counted_twice() {
        let unread = Unread::default();
        let _other = unread.count(&[0; 7][..], 7);
        unread.count(&[0; 10][..], 4).read_to_end(&mut Vec::new()).unwrap();
        assert_eq!(unread.bytes(), 7);
    }
}
