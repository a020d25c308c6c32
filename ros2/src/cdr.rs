//! Messages as their bytes: CDR with the four bytes before it that give its encoding.

use core::fmt;
use rustdds::RepresentationIdentifier;
use rustdds::bytes::Bytes;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use std::io;

/// The bytes before the content, of which the last two have no meaning.
const HEAD: usize = 4;

/// A message that leaves.
pub(crate) struct Leaving(Bytes);

impl Leaving {
    /// The content of a little-endian message with its head.
    pub(crate) fn new(message: &[u8]) -> Self {
        Self(Bytes::copy_from_slice(message.get(HEAD..).unwrap_or_default()))
    }
}

/// A message that has arrived, with its head.
pub(crate) struct Arrived(pub(crate) Vec<u8>);

/// Leaves messages as they are.
#[derive(Clone, Copy)]
pub(crate) struct AsBytes;

/// No message is unreadable as bytes.
#[derive(Debug)]
pub(crate) enum Never {}

impl fmt::Display for Never {
    fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {}
    }
}

impl std::error::Error for Never {}

impl DeserializerAdapter<Arrived> for AsBytes {
    type Error = Never;
    type Decoded = Arrived;

    /// All of CDR: a source reports those that ROS 2 does not have.
    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        use RepresentationIdentifier as Id;
        &[
            Id::CDR_LE,
            Id::CDR_BE,
            Id::XCDR2_LE,
            Id::XCDR2_BE,
            Id::PL_CDR_LE,
            Id::PL_CDR_BE,
            Id::D_CDR2_LE,
            Id::D_CDR2_BE,
            Id::PL_XCDR2_LE,
            Id::PL_XCDR2_BE,
        ]
    }

    fn transform_decoded(decoded: Arrived) -> Arrived {
        decoded
    }
}

impl DefaultDecoder<Arrived> for AsBytes {
    type Decoder = Self;
    const DECODER: Self = Self;
}

impl Decode<'_, Arrived> for AsBytes {
    type Error = Never;

    fn decode_bytes(self, content: &[u8], encoding: RepresentationIdentifier) -> Result<Arrived, Never> {
        let mut message = Vec::with_capacity(HEAD + content.len());
        message.extend(encoding.to_bytes());
        message.extend([0; 2]);
        message.extend_from_slice(content);
        Ok(Arrived(message))
    }
}

impl SerializerAdapter<Leaving> for AsBytes {
    type Error = Never;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(message: &Leaving) -> Result<Bytes, Never> {
        Ok(message.0.clone())
    }
}

/// The error of a link or an output, for an error of DDS.
pub(crate) fn failed(error: impl fmt::Display) -> io::Error {
    io::Error::other(format!("DDS: {error}"))
}
