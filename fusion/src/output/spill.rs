//! A file that is written and read back from its end.

use super::Unwritable;
use fusion_core::runner::Halt;
use fusion_core::smoother::Shelf;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

/// The bytes behind a block that hold its length.
const LENGTH: usize = size_of::<u64>();

/// Blocks in a separate file; the block written last is read first. The file is removed at the end.
#[derive(Debug)]
pub struct Spill {
    path: PathBuf,
    file: File,
    /// Where the next block is written.
    end: u64,
}

impl Spill {
    pub(super) fn create(path: PathBuf) -> Result<Self, Unwritable> {
        let opened = File::options().read(true).write(true).create(true).truncate(true).open(&path);
        match opened {
            Ok(file) => Ok(Self { path, file, end: 0 }),
            Err(error) => Err(Unwritable { path, error }),
        }
    }

    fn failed(&self) -> impl FnOnce(io::Error) -> Unwritable + use<> {
        let path = self.path.clone();
        |error| Unwritable { path, error }
    }

    fn write(&mut self, block: &[u8]) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(self.end))?;
        self.file.write_all(block)?;
        self.file.write_all(&(block.len() as u64).to_le_bytes())?;
        self.end += (block.len() + LENGTH) as u64;
        Ok(())
    }

    /// Reads the last block; returns false if no block is left.
    fn read(&mut self, block: &mut Vec<u8>) -> io::Result<bool> {
        let Some(at) = self.end.checked_sub(LENGTH as u64) else {
            return Ok(false);
        };
        let mut length = [0; LENGTH];
        self.file.seek(SeekFrom::Start(at))?;
        self.file.read_exact(&mut length)?;
        let length = u64::from_le_bytes(length);
        let start = at.checked_sub(length).ok_or(io::ErrorKind::InvalidData)?;
        block.resize(length as usize, 0);
        self.file.seek(SeekFrom::Start(start))?;
        self.file.read_exact(block)?;
        self.end = start;
        Ok(true)
    }
}

impl Shelf for Spill {
    fn put(&mut self, block: &[u8]) -> Result<(), Halt> {
        Ok(self.write(block).map_err(self.failed())?)
    }

    fn take(&mut self, block: &mut Vec<u8>) -> Result<bool, Halt> {
        let read = self.read(block);
        Ok(read.map_err(self.failed())?)
    }
}

impl Drop for Spill {
    fn drop(&mut self) {
        // A file that cannot be removed is removed with its folder.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(test: &str) -> PathBuf {
        std::env::temp_dir().join(format!("fusion-spill-{test}-{}", std::process::id()))
    }

    #[test]
    fn blocks_come_back_from_the_last_one_and_the_file_goes() {
        let path = path("blocks");
        let mut spill = Spill::create(path.clone()).unwrap();
        let (block, mut found) = (|k: u8| vec![k; usize::from(k) * 1000], vec![1]);
        // Put and taken in turns; one is empty.
        (0..9).for_each(|k| spill.put(&block(k)).unwrap());
        for k in (5..9).rev() {
            assert!(spill.take(&mut found).unwrap() && found == block(k), "{k}");
        }
        (5..7).for_each(|k| spill.put(&block(k)).unwrap());
        for k in (0..7).rev() {
            assert!(spill.take(&mut found).unwrap() && found == block(k), "{k}");
        }
        assert!(!spill.take(&mut found).unwrap());
        drop(spill);
        assert!(!path.exists());
    }

    #[test]
    fn a_file_that_was_changed_is_told_by_its_name() {
        let path = path("changed");
        for (length, bytes) in [(10, &[][..]), (1008, &[0xff; 8])] {
            let mut spill = Spill::create(path.clone()).unwrap();
            spill.put(&[7; 1000]).unwrap();
            let mut file = File::options().write(true).open(&path).unwrap();
            file.set_len(length).unwrap();
            file.seek(SeekFrom::Start(length - bytes.len() as u64)).unwrap();
            file.write_all(bytes).unwrap();
            let told = spill.take(&mut Vec::new()).unwrap_err().to_string();
            assert!(told.contains("fusion-spill-changed"), "{told}");
        }
    }
}
