//! The text of a design, and of the files that it includes: read whole, up to a limit.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

/// Bytes of one file. Its tree takes about seven times as much memory.
pub const LONGEST: u64 = 16 << 20;

/// The byte order marks of UTF-16: low byte first, high byte first.
const UTF_16: [[u8; 2]; 2] = [[0xff, 0xfe], [0xfe, 0xff]];

/// Why a file is not the text of a design.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unread {
    /// There is no such file.
    Missing,
    /// The reason, and the help.
    Because(String, &'static str),
}

/// The text of a file.
///
/// # Errors
/// The file is missing, is not a regular file, is larger than 16 MiB, or is not UTF-8 text.
pub fn read_text(path: &Path) -> Result<String, Unread> {
    // Opening a pipe without a writer would wait forever; a device has no end.
    if std::fs::metadata(path).is_ok_and(|what| !what.is_file() && !what.is_dir()) {
        return Err(because("it is a pipe or a device, not a file", "write its text to a file first"));
    }
    read_piped_text(path)
}

fn because(why: &str, help: &'static str) -> Unread {
    Unread::Because(why.to_owned(), help)
}

/// The text of a file or a pipe that is named on a command line. It waits for the writer of a pipe.
///
/// # Errors
/// As [`read_text`].
pub fn read_piped_text(path: &Path) -> Result<String, Unread> {
    let failed = |error: std::io::Error| match error.kind() {
        ErrorKind::NotFound => Unread::Missing,
        _ => Unread::Because(error.to_string(), "check that you may read it"),
    };
    if path.is_dir() {
        return Err(because("it is a directory", "name the TOML file in it"));
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(failed)?;
    file.take(LONGEST + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > LONGEST {
        let why = format!("it is larger than {} MiB", LONGEST >> 20);
        return Err(Unread::Because(why, "a design is a TOML file; is this a log?"));
    }
    if is_utf_16(&bytes) {
        return Err(because("it is UTF-16 text", "save it as UTF-8"));
    }
    String::from_utf8(bytes).map_err(|e| {
        let sound = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = sound.iter().filter(|b| **b == b'\n').count() + 1;
        Unread::Because(format!("line {line} is not UTF-8 text"), "a design is a TOML file, saved as UTF-8")
    })
}

/// Whether a text begins as UTF-16 does.
pub(crate) fn is_utf_16(bytes: &[u8]) -> bool {
    UTF_16.iter().any(|mark| bytes.starts_with(mark))
}
