//! Records of MCAP: one byte for the kind, eight for the length, then the content.
//!
//! They are written here, because the writer of the crate `mcap` keeps its file, and a link gives its bytes away.
//!
//! Source   <https://mcap.dev/spec>

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
const HEADER: u8 = 0x01;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;

/// Adds a record.
fn record(bytes: &mut Vec<u8>, kind: u8, content: impl FnOnce(&mut Vec<u8>)) {
    bytes.push(kind);
    let from = bytes.len();
    bytes.extend([0; 8]);
    content(bytes);
    let length = (bytes.len() - from - 8) as u64;
    bytes[from..from + 8].copy_from_slice(&length.to_le_bytes());
}

/// Adds bytes after their number.
fn counted(bytes: &mut Vec<u8>, content: &[u8]) {
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend_from_slice(content);
}

/// Adds the beginning of a file.
pub(crate) fn begin(bytes: &mut Vec<u8>) {
    bytes.extend(MAGIC);
    record(bytes, HEADER, |content| {
        counted(content, b"ros2");
        counted(content, b"fusion");
    });
}

/// Adds a channel with messages of ROS 2, and its schema with the same number. Schemas are numbered from 1.
pub(crate) fn channel(bytes: &mut Vec<u8>, number: u16, topic: &str, message_type: &str, definition: &str) {
    record(bytes, SCHEMA, |content| {
        content.extend(number.to_le_bytes());
        for part in [message_type, "ros2msg", definition] {
            counted(content, part.as_bytes());
        }
    });
    record(bytes, CHANNEL, |content| {
        content.extend(number.to_le_bytes());
        content.extend(number.to_le_bytes());
        // The last one is the map of metadata, which is empty.
        for part in [topic, "cdr", ""] {
            counted(content, part.as_bytes());
        }
    });
}

/// The times of a message, in nanoseconds since 1970-01-01 UTC.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Times {
    pub(crate) arrived: u64,
    pub(crate) sent: u64,
}

/// Adds a message of a channel.
pub(crate) fn message(bytes: &mut Vec<u8>, channel: u16, sequence: u32, times: Times, message: &[u8]) {
    record(bytes, MESSAGE, |content| {
        content.extend(channel.to_le_bytes());
        content.extend(sequence.to_le_bytes());
        content.extend(times.arrived.to_le_bytes());
        content.extend(times.sent.to_le_bytes());
        content.extend_from_slice(message);
    });
}
