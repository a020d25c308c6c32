//! Recorded sources: from what a `[source.NAME]` table declares to decoded rows.
//!
//! ```text
//! file ── a format's reader ──▶ raw rows ── decode ──▶ rows (time, numbers in SI)
//!            RawRows             cells                RowStream
//! ```
//!
//! A format knows how its rows lie in a file, and nothing else. One of another crate implements [`RawRows`] and
//! [`SourceSpec`], and registers both: `examples/own-format`. What the cells mean (stamps,
//! channels, units, validity, what to do with a bad row) is declared and decoded alike for all.

mod csv;
pub mod decode;
mod file;
mod format;
mod mat;
mod rtklib;
mod supply;
pub mod table;
pub mod testing;
mod unread;

pub use self::csv::CsvSpec;
pub(crate) use self::decode::have_rows_in_common;
pub use self::file::DataFile;
pub use self::format::LogFormat;
pub use self::mat::MatSpec;
pub use self::rtklib::RtklibSpec;
pub use self::supply::{Columns, Supply, Values};
pub use self::unread::Unread;

use self::decode::RawRows;
use crate::rows::{ProvidedChannel, RowStream, SourceError};
use core::fmt::Debug;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_models::block::BuildError;
use fusion_models::fault::derive_seed;
use std::path::{Path, PathBuf};

/// What a source is opened with.
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
    /// What is still to be read of the files that are opened with it.
    pub unread: Unread,
    /// Rows in place of the source's file.
    pub rows: Option<Supply>,
}

impl OpenContext {
    /// A declared path as it is opened.
    #[must_use]
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.data_dir.join(path)
    }

    /// The seed of one of this source's faults.
    #[must_use]
    pub fn fault_seed(&self, fault: &str) -> u64 {
        derive_seed(self.seed, &[&self.name, &format!("fault.{fault}")])
    }
}

/// A source as declared.
#[typetag::deserialize]
pub trait SourceSpec: Debug + Send + Sync {
    /// The files it reads, as declared.
    fn files(&self) -> Vec<PathBuf>;

    /// What its rows consist of, from the declaration alone.
    ///
    /// # Errors
    /// All mistakes of the declaration, each naming its field.
    fn channels(&self) -> Result<Vec<ProvidedChannel>, Vec<BuildError>>;

    /// Makes it ready to read: of a file, the header is read and checked.
    ///
    /// # Errors
    /// As [`channels`](Self::channels), and what is wrong with the file.
    fn open(&self, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError>;

    /// The same of rows that a program brings in place of the file.
    ///
    /// # Errors
    /// As [`open`](Self::open); a source that reads nothing but its file.
    fn open_rows(&self, _rows: Box<dyn RawRows>, _context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        let message = "a source of this type reads its file, and no rows from memory";
        Err(BuildError::at("type", message).help("declare it as `csv`").into())
    }
}
