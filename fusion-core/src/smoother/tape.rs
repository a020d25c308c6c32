//! Records in a sequence, read back from the end.

use super::record::Unreadable;
use crate::Printed;
use crate::printed::role;
use crate::runner::Halt;
use alloc::boxed::Box;
use alloc::vec::Vec;

/// Bytes of a block: some hundred steps, read from a disk at once.
const BLOCK: usize = 1 << 20;

/// The bytes behind a record that hold its length.
const LENGTH: usize = size_of::<u32>();

/// Where full blocks of a [`Tape`] wait: in memory, or in a file.
pub trait Shelf: Printed + Send {
    /// Puts a block on top.
    ///
    /// # Errors
    /// Where it cannot be kept.
    fn put(&mut self, block: &[u8]) -> Result<(), Halt>;

    /// Removes the top block and puts it in place of the contents of `block`. Returns false if no block is left.
    ///
    /// # Errors
    /// Where it cannot be read back.
    fn take(&mut self, block: &mut Vec<u8>) -> Result<bool, Halt>;
}

role!(Shelf);

/// In memory.
impl Shelf for Vec<Vec<u8>> {
    fn put(&mut self, block: &[u8]) -> Result<(), Halt> {
        self.push(block.to_vec());
        Ok(())
    }

    fn take(&mut self, block: &mut Vec<u8>) -> Result<bool, Halt> {
        let taken = self.pop();
        let is_there = taken.is_some();
        *block = taken.unwrap_or_default();
        Ok(is_there)
    }
}

/// Records of any length, the last one written being read first.
#[derive(Debug)]
pub struct Tape {
    shelf: Box<dyn Shelf>,
    block: Vec<u8>,
}

impl Tape {
    /// Without a record; full blocks go to `shelf`.
    #[must_use]
    pub fn new(shelf: Box<dyn Shelf>) -> Self {
        Self {
            shelf,
            block: Vec::with_capacity(BLOCK),
        }
    }

    /// Keeps a record.
    ///
    /// # Errors
    /// Where the shelf cannot keep a block.
    pub fn push(&mut self, record: &[u8]) -> Result<(), Halt> {
        let length = u32::try_from(record.len())?;
        if !self.block.is_empty() && self.block.len() + record.len() + LENGTH > BLOCK {
            self.shelf.put(&self.block)?;
            self.block.clear();
        }
        self.block.extend_from_slice(record);
        self.block.extend_from_slice(&length.to_le_bytes());
        Ok(())
    }

    /// Removes the last record and puts it in place of the contents of `record`. Returns false if no record is left.
    ///
    /// # Errors
    /// Where the shelf cannot give a block back.
    pub fn pop(&mut self, record: &mut Vec<u8>) -> Result<bool, Halt> {
        record.clear();
        if self.block.is_empty() && !self.shelf.take(&mut self.block)? {
            return Ok(false);
        }
        let (rest, length) = self.block.split_last_chunk().ok_or(Unreadable)?;
        let length = u32::from_le_bytes(*length) as usize;
        let start = rest.len().checked_sub(length).ok_or(Unreadable)?;
        record.extend_from_slice(&rest[start..]);
        self.block.truncate(start);
        Ok(true)
    }
}
