//! Log formats, as `fusion inspect` recognises them.

use super::decode::Origin;
use super::table::LogTable;
use super::{DataFile, OpenContext};
use crate::rows::SourceError;
use std::io::Read;
use std::path::Path;

/// How many bytes of a file are shown to a format that has to recognise it.
const FIRST: u64 = 4096;

/// A format of logs. A crate with a [`SourceSpec`](super::SourceSpec) registers its format too; `fusion inspect` then
/// reads its files and writes designs with sources of this `type`.
///
/// ```
/// use fusion::source::LogFormat;
/// use fusion::source::table::LogTable;
///
/// static STARS: LogFormat = LogFormat {
///     name: "stars",
///     clock: None,
///     endings: &[".stars"],
///     recognises: |first| first.starts_with(b"*****"),
///     read: |path| {
///         let table = LogTable { path: path.to_owned(), format: &STARS, ..LogTable::default() };
///         Ok(vec![table])
///     },
/// };
/// fusion::inventory::submit! { STARS }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct LogFormat {
    /// The `type` of its sources.
    pub name: &'static str,
    /// The meaning of the stamps, if the format defines it: a source then does not declare its clock.
    pub clock: Option<OwnClock>,
    /// The endings of its file names. A folder is searched for them.
    pub endings: &'static [&'static str],
    /// Whether a file has this format, by its first bytes: 4096 at most, unpacked if it is gzip-compressed. It is
    /// not called if the name has one of the endings.
    pub recognises: fn(&[u8]) -> bool,
    /// Reads a whole file: one table for each set of columns with common rows. If the file has several streams, each
    /// table has its [`Topic`](super::table::Topic), and a source selects it by the key `topic`.
    ///
    /// # Errors
    /// It cannot be opened or read.
    pub read: fn(&Path) -> Result<Vec<LogTable>, SourceError>,
}

crate::inventory::collect!(LogFormat);

/// The stamps of a format that defines their meaning. They are the first column of each [`LogTable`].
#[derive(Clone, Copy, Debug)]
pub struct OwnClock {
    /// Their unit, as designs write it.
    pub unit: &'static str,
    /// Their zero point; `None` if it differs from log to log.
    pub counts_from: Option<Origin>,
}

impl LogFormat {
    /// All formats that are linked, by name.
    #[must_use]
    pub fn all() -> Vec<&'static Self> {
        let mut all: Vec<_> = crate::inventory::iter::<Self>.into_iter().collect();
        all.sort_by_key(|format| format.name);
        all
    }

    /// The format of a file, by its name or by its first bytes: `csv` if no other format recognises it.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn of(path: &Path) -> Result<&'static Self, SourceError> {
        let all = Self::all();
        let name = path.to_string_lossy();
        let others = || all.iter().copied().filter(|format| format.name != TEXT.name);
        if let Some(format) = others().find(|format| format.endings.iter().any(|end| name.ends_with(end))) {
            return Ok(format);
        }
        let context = OpenContext::default();
        let mut first = Vec::new();
        // The reader of the whole file reports a file that cannot be unpacked.
        let _ = DataFile::new(path, &context).bytes(&context)?.take(FIRST).read_to_end(&mut first);
        Ok(others().find(|format| (format.recognises)(&first)).unwrap_or(&TEXT))
    }
}

/// Fields with a delimiter between them: the default for text files.
pub(super) static TEXT: LogFormat = LogFormat {
    name: "csv",
    clock: None,
    endings: &[".csv", ".csv.gz", ".txt", ".txt.gz"],
    recognises: |_| false,
    read: |path| Ok(vec![LogTable::of_text(path)?]),
};

crate::inventory::submit! { TEXT }

impl Default for &LogFormat {
    fn default() -> Self {
        &TEXT
    }
}
