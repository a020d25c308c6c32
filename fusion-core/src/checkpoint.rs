//! Checkpoints: the memory of a filter as bytes that outlive its process.
//!
//! ```text
//! "fusion" 0x00 0x1a    8 bytes: what this is, text or truncated text by no chance; of a run 0x01 0x1a
//! version               u32: that of this format
//! design                u64: a number made of everything that the design says of the filter; of a run, of
//!                       all that the design says, and of its options
//! length                u64: bytes that follow the checksum
//! checksum              u64: of those
//! memory                as [`memory`](crate::memory) writes it
//! ```
//!
//! All little-endian, the same on every platform.

use alloc::vec::Vec;
use thiserror::Error;

/// The kind of a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// A filter that is fed row by row.
    Navigator,
    /// A run over the sources of a design.
    Run,
}

impl Of {
    /// Its first bytes.
    #[must_use]
    pub const fn magic(self) -> [u8; 8] {
        match self {
            Self::Navigator => *b"fusion\0\x1a",
            Self::Run => *b"fusion\x01\x1a",
        }
    }
}

/// Raised whenever what is remembered, or how it is written, changes.
const VERSION: u32 = 5;
/// Bytes before the memory.
pub const HEADER: usize = 36;

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

/// A checkpoint of `memory`, of a filter or a run with the `design`'s fingerprint.
#[must_use]
pub fn sealed(of: Of, design: u64, memory: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + memory.len());
    bytes.extend(of.magic());
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(design.to_le_bytes());
    bytes.extend((memory.len() as u64).to_le_bytes());
    bytes.extend(checksum(memory).to_le_bytes());
    bytes.extend(memory);
    bytes
}

/// The memory in a checkpoint.
///
/// # Errors
/// [`CheckpointError`]: the bytes are not whole, or not of this kind, version and design.
pub fn opened(of: Of, design: u64, bytes: &[u8]) -> Result<&[u8], CheckpointError> {
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
    let mut hash = Fnv::default();
    hash.bytes(bytes);
    hash.value()
}

/// The 64-bit FNV-1a hash: it detects accidental changes, not forgeries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    /// Adds bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// The hash of all bytes so far.
    #[must_use]
    pub const fn value(self) -> u64 {
        self.0
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
}
