//! Checkpoints: the memory of a navigator or a run, saved so that another process can resume.
//!
//! ```text
//! "fusion" 0x00 0x1a    8 bytes: what this is, text or truncated text by no chance; of a run 0x01 0x1a
//! version               u32: that of this format
//! design                u64: a number made of everything that the design says of the filter; of a run, of
//!                       all that the design says, and of its options
//! length                u64: bytes that follow the checksum
//! checksum              u64: of those
//! memory                as `fusion_core::memory` writes it
//! ```
//!
//! All little-endian. The hashes of text and bytes are 64-bit FNV-1a: they detect accidental changes, not
//! forgeries.

use crate::config::{Document, Node, Value};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;
use thiserror::Error;

/// The kind of a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Of {
    Navigator,
    Run,
}

impl Of {
    const fn magic(self) -> [u8; 8] {
        match self {
            Self::Navigator => *b"fusion\0\x1a",
            Self::Run => *b"fusion\x01\x1a",
        }
    }
}

/// Raised whenever what is remembered, or how it is written, changes.
const VERSION: u32 = 2;
const HEADER: usize = 36;

/// Why a program cannot resume from these bytes.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum CheckpointError {
    /// They are not a checkpoint.
    #[error("this is no checkpoint")]
    Other,
    /// Another version of this program wrote them.
    #[error("this checkpoint has version {found}, and this program reads version {VERSION}: start anew")]
    Version {
        /// The version found.
        found: u32,
    },
    /// There are too few or too many of them.
    #[error("this checkpoint should have {wanted} bytes and has {found}: it was not written to its end, or something was added")]
    Length {
        /// Bytes that it should have.
        wanted: u64,
        /// Bytes that it has.
        found: u64,
    },
    /// Their checksum does not match.
    #[error("this checkpoint is damaged: its checksum is another")]
    Damaged,
    /// They belong to another design.
    #[error(
        "this checkpoint is of another design; what the design says of process, sensors, stages, initialisers and filter must be as it was"
    )]
    Design,
}

/// The tables of a design that do not affect its filter: the sources of the rows, and the use of the
/// estimates.
const OUTSIDE: [&str; 6] = ["source", "simulation", "reference", "stress", "variant", "include"];
/// The keys under `run` that do not affect the filter.
const OUTSIDE_RUN: [&str; 7] = ["description", "data_dir", "start", "stop", "output_rate", "smooth", "seed"];

/// A hash of all that a design declares for a run, and of the `options`.
#[must_use]
pub(crate) fn fingerprint_of_run(document: &Document, options: &str) -> u64 {
    let mut hash = Fnv::new();
    // The values of the selected variants are already in the other tables.
    for entry in document.root().entries().iter().filter(|e| e.key != "variant") {
        hash.text(&entry.key);
        hash.node(&entry.node);
    }
    hash.text(options);
    hash.0
}

/// A hash of all that a design declares for its filter, in the order of the file.
#[must_use]
pub(crate) fn fingerprint(document: &Document) -> u64 {
    let mut hash = Fnv::new();
    for entry in document.root().entries().iter().filter(|e| !OUTSIDE.contains(&e.key.as_str())) {
        hash.text(&entry.key);
        if entry.key == "run" {
            let keys = entry.node.entries().iter();
            for entry in keys.filter(|e| !OUTSIDE_RUN.contains(&e.key.as_str())) {
                hash.text(&entry.key);
                hash.node(&entry.node);
            }
        } else {
            hash.node(&entry.node);
        }
    }
    hash.0
}

/// A checkpoint of `memory`, of a filter or a run with the `design`'s fingerprint.
pub(crate) fn sealed(of: Of, design: u64, memory: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + memory.len());
    bytes.extend(of.magic());
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(design.to_le_bytes());
    bytes.extend((memory.len() as u64).to_le_bytes());
    bytes.extend(checksum(memory).to_le_bytes());
    bytes.extend(memory);
    bytes
}

/// Reads a file that may be a checkpoint. If it is another kind of file, only its beginning is read.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    // Opening a pipe without a writer would wait forever.
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is no file"));
    }
    let (mut file, mut bytes) = (File::open(path)?, Vec::new());
    file.by_ref().take(HEADER as u64).read_to_end(&mut bytes)?;
    if [Of::Navigator, Of::Run].iter().any(|of| bytes.starts_with(&of.magic())) {
        file.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

/// The memory in a checkpoint.
pub(crate) fn opened(of: Of, design: u64, bytes: &[u8]) -> Result<&[u8], CheckpointError> {
    let found = bytes.len() as u64;
    let (magic, rest) = bytes.split_first_chunk::<8>().ok_or(CheckpointError::Other)?;
    if *magic != of.magic() {
        return Err(CheckpointError::Other);
    }
    let too_short = CheckpointError::Length {
        wanted: HEADER as u64,
        found,
    };
    let (version, rest) = rest.split_first_chunk().ok_or(too_short)?;
    match u32::from_le_bytes(*version) {
        VERSION => {}
        found => return Err(CheckpointError::Version { found }),
    }
    let (made_of, rest) = rest.split_first_chunk().ok_or(too_short)?;
    let (length, rest) = rest.split_first_chunk().ok_or(too_short)?;
    let (sum, memory) = rest.split_first_chunk().ok_or(too_short)?;
    let wanted = u64::from_le_bytes(*length).saturating_add(HEADER as u64);
    if wanted != found {
        return Err(CheckpointError::Length { wanted, found });
    }
    if u64::from_le_bytes(*sum) != checksum(memory) {
        return Err(CheckpointError::Damaged);
    }
    if u64::from_le_bytes(*made_of) != design {
        return Err(CheckpointError::Design);
    }
    Ok(memory)
}

fn checksum(bytes: &[u8]) -> u64 {
    let mut hash = Fnv::new();
    hash.bytes(bytes);
    hash.0
}

/// FNV-1a.
struct Fnv(u64);

impl Fnv {
    const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// Text and its length, so that no two lists of texts are alike.
    fn text(&mut self, text: &str) {
        self.bytes(&(text.len() as u64).to_le_bytes());
        self.bytes(text.as_bytes());
    }

    fn node(&mut self, node: &Node) {
        match node.value() {
            Value::Table { entries, .. } => {
                self.text("{");
                for entry in entries {
                    self.text(&entry.key);
                    self.node(&entry.node);
                }
                self.text("}");
            }
            Value::Array(items) => {
                self.text("[");
                items.iter().for_each(|item| self.node(item));
                self.text("]");
            }
            value => self.text(&format!("{value:?}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_that_is_not_whole_is_refused() {
        let bytes = sealed(Of::Navigator, 7, b"everything");
        assert_eq!(opened(Of::Navigator, 7, &bytes), Ok(&b"everything"[..]));
        assert_eq!(opened(Of::Navigator, 8, &bytes), Err(CheckpointError::Design));
        assert_eq!(opened(Of::Run, 7, &bytes), Err(CheckpointError::Other));
        for end in 0..bytes.len() {
            let refused = opened(Of::Navigator, 7, &bytes[..end]).unwrap_err();
            let is_told = matches!(refused, CheckpointError::Length { .. }) || end < 8;
            assert!(is_told, "{end}: {refused}");
        }
        let longer = [bytes.as_slice(), b"!"].concat();
        assert!(matches!(opened(Of::Navigator, 7, &longer), Err(CheckpointError::Length { .. })));
        for at in 0..bytes.len() {
            let mut wrong = bytes.clone();
            wrong[at] ^= 0x10;
            assert!(opened(Of::Navigator, 7, &wrong).is_err(), "byte {at}");
        }
    }

    #[test]
    fn what_says_nothing_of_the_filter_leaves_the_fingerprint() {
        let of = |text: &str| fingerprint(&Document::parse("design.toml", text).0);
        let text = "run.reorder = '1 s'\nprocess.type = 'hold'\nsource.a.path = 'x'";
        assert_eq!(
            of(text),
            of("run.reorder = '1 s'\nrun.stop = 5\nprocess.type = 'hold'\nsource.a.path = 'y'")
        );
        for other in [
            "run.reorder = '2 s'\nprocess.type = 'hold'",
            "run.reorder = '1 s'\nprocess.type = 'holds'",
            "run.reorder = '1 s'\nprocess.type = 'hold'\nprocess.x = 1",
        ] {
            assert_ne!(of(text), of(other), "{other}");
        }
    }
}
