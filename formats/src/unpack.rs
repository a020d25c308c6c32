//! Packed chunks of logs. All of these libraries are Rust: no C compiler is needed.

use std::io::{Error, ErrorKind, Read};

/// Unpacks a chunk of at most `most` bytes into a buffer. After an error the buffer has the bytes before the damage.
///
/// # Errors
/// The chunk is damaged, cut off or longer, or this program does not know how it is packed.
pub(crate) fn unpack(packing: &str, packed: &[u8], most: u64, buffer: &mut Vec<u8>) -> Result<(), String> {
    buffer.clear();
    let done = match packing {
        "lz4" => all(lz4_flex::frame::FrameDecoder::new(packed), most, buffer),
        #[cfg(feature = "mcap")]
        "zstd" => crate::zstd::Frames::new(packed).and_then(|frames| all(frames, most, buffer)),
        #[cfg(feature = "rosbag")]
        "bz2" => all(bzip2::read::BzDecoder::new(packed), most, buffer),
        other => return Err(format!("a chunk is packed by `{other}`, which is not read")),
    };
    done.map_err(|error| format!("a chunk cannot be unpacked: {error}"))
}

fn all(reader: impl Read, most: u64, buffer: &mut Vec<u8>) -> Result<(), Error> {
    let before = buffer.len();
    reader.take(most + 1).read_to_end(buffer)?;
    if (buffer.len() - before) as u64 > most {
        buffer.truncate(before);
        return Err(Error::new(ErrorKind::InvalidData, "it is longer than declared"));
    }
    Ok(())
}
