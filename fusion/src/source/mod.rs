//! Recorded sources: from the declaration in `[source.NAME]` to decoded rows.
//!
//! ```text
//! file ── a format's reader ──▶ raw rows ── decode ──▶ rows (time, numbers in SI)
//!            RawRows             cells                RowStream
//! ```
//!
//! A format knows only the layout of its rows in a file. A format of another crate implements [`RawRows`] and
//! [`SourceSpec`], and registers both: see `examples/own-format`, and the crate `fusion-formats` for logs of
//! messages. The meaning of the cells (stamps, channels, units, validity, the action for a bad row) is declared and
//! decoded in the same way for all formats.

mod csv;
pub mod decode;
mod file;
mod format;
mod link;
mod mat;
mod rtklib;
mod shared;
mod supply;
pub mod table;
pub mod testing;
mod unread;

pub use self::csv::CsvSpec;
pub(crate) use self::decode::have_rows_in_common;
pub use self::file::DataFile;
pub use self::format::{LogFormat, OwnClock};
pub use self::link::ArrivingBytes;
pub use self::mat::MatSpec;
pub use self::rtklib::RtklibSpec;
pub use self::shared::SharedReaders;
pub use self::supply::{Columns, Supply, Values};
pub use self::unread::Unread;

use self::decode::RawRows;
use crate::rows::{ProvidedChannel, RowStream, SourceError};
use core::fmt::Debug;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_models::block::BuildError;
use fusion_models::fault::derive_seed;
use std::path::{Path, PathBuf};

/// The context in which a source is opened.
#[derive(Clone, Debug, Default)]
pub struct OpenContext {
    /// Relative paths start here.
    pub data_dir: PathBuf,
    /// The source's own name.
    pub name: String,
    /// The declared origin of local coordinates.
    pub origin: Option<Geodetic>,
    /// The seed of the run.
    pub seed: u64,
    /// The bytes still to be read of the files that are opened with it.
    pub unread: Unread,
    /// The readers of files with several streams, which the sources of a run share.
    pub shared: SharedReaders,
    /// Rows in place of the source's file.
    pub rows: Option<Supply>,
    /// Bytes in place of the source's file, while they arrive.
    pub arriving: Option<ArrivingBytes>,
}

impl OpenContext {
    /// The path to open for a declared path.
    #[must_use]
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.data_dir.join(path)
    }

    /// The seed of one of this source's faults.
    #[must_use]
    pub(crate) fn fault_seed(&self, fault: &str) -> u64 {
        derive_seed(self.seed, &[&self.name, &format!("fault.{fault}")])
    }
}

/// A source as declared.
#[typetag::deserialize]
pub trait SourceSpec: Debug + Send + Sync {
    /// The files it reads, as declared.
    fn files(&self) -> Vec<PathBuf>;

    /// The channels of its rows, from the declaration alone.
    ///
    /// # Errors
    /// All mistakes of the declaration, each naming its field.
    fn channels(&self) -> Result<Vec<ProvidedChannel>, Vec<BuildError>>;

    /// GPS time at time zero of its rows \[ns\]; `None` if the declaration does not give it.
    fn time_zero(&self) -> Option<i64> {
        None
    }

    /// Makes it ready to read; the header of a file is read and checked.
    ///
    /// # Errors
    /// As [`channels`](Self::channels), and mistakes of the file.
    fn open(&self, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError>;

    /// The same for rows that a program supplies instead of the file.
    ///
    /// # Errors
    /// As [`open`](Self::open); also a source that can only read its file.
    fn open_rows(&self, _rows: Box<dyn RawRows>, _context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        let message = "a source of this type reads its file, and no rows from memory";
        Err(BuildError::at("type", message).help("declare it as `csv`").into())
    }
}
