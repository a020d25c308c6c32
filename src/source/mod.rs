//! Where rows come from: recorded files now, simulated and live ones behind the same trait.
//!
//! ```text
//! SourceSpec ── open ──▶ Source ── Faulted ──▶ Source ── Merged ──▶ rows of all sources by time
//!  (declared)            (streams rows)        (declared faults)
//! ```
//!
//! A source streams: it holds one row, not the file. What it leaves out it counts, with the
//! reason and the first examples; nothing is lost without a word.

mod csv;
mod error;
mod fault;
mod merge;
mod report;

pub use self::csv::CsvSpec;
pub use error::{DataError, SourceError};
pub(crate) use fault::Chain;
pub use fault::{Faulted, outages};
pub use fusion_models::fault::ProvidedChannel;
pub use merge::{Failed, Lent, Merged};
pub use report::{Example, Skipped, SourceReport};

use core::fmt::Debug;
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::time::Time;
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
}

impl OpenContext {
    /// A declared path as it is opened.
    #[must_use]
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.data_dir.join(path)
    }

    /// The seed of something random that belongs to this source.
    #[must_use]
    pub fn seed_of(&self, what: &str) -> u64 {
        derive_seed(self.seed, &[&self.name, what])
    }
}

/// A source as declared.
#[typetag::deserialize]
pub trait SourceSpec: Debug + Send + Sync {
    /// The files it reads, as declared; none for a simulated one.
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
    fn open(&self, context: &OpenContext) -> Result<Box<dyn Source>, SourceError>;
}

/// A stream of rows.
pub trait Source: Debug + Send {
    /// What a row consists of.
    fn channels(&self) -> &[ProvidedChannel];

    /// Writes the next row and returns its stamp; `None` after the last.
    ///
    /// # Errors
    /// What is wrong with the data; the source has ended then.
    fn next(&mut self, row: &mut Vec<f64>) -> Result<Option<Time>, SourceError>;

    /// The numbers of the last row that a fault changed.
    fn disturbed(&self) -> &[Range<usize>] {
        &[]
    }

    /// The numbers of its rows that declared faults may change.
    fn disturbable(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    /// What has been read so far.
    fn report(&self) -> SourceReport;
}

/// The width of a row.
#[must_use]
pub fn width(channels: &[ProvidedChannel]) -> usize {
    channels.iter().map(|c| c.offset + c.channel.width).max().unwrap_or(0)
}

#[cfg(test)]
mod testing {
    use super::*;

    /// Rows held in memory: one number each, or an error in their place.
    #[derive(Debug)]
    pub(super) struct Listed {
        rows: std::vec::IntoIter<Result<(f64, f64), &'static str>>,
        channels: Vec<ProvidedChannel>,
        tally: report::Tally,
    }

    pub(super) fn listed(rows: Vec<Result<(f64, f64), &'static str>>) -> Box<dyn Source> {
        use fusion_models::units::{Dimensional, dim};
        let channel = fusion_models::block::Channel::vector("speed", 1, dim::Speed::KIND.dimension);
        let channels = vec![ProvidedChannel {
            channel,
            offset: 0,
            delay_ns: 0,
        }];
        Box::new(Listed {
            rows: rows.into_iter(),
            channels,
            tally: report::Tally::default(),
        })
    }

    impl Source for Listed {
        fn channels(&self) -> &[ProvidedChannel] {
            &self.channels
        }

        fn next(&mut self, row: &mut Vec<f64>) -> Result<Option<Time>, SourceError> {
            let Some(next) = self.rows.next() else { return Ok(None) };
            let (t, value) = next.map_err(|what| DataError::new("listed", what))?;
            row.clear();
            row.push(value);
            let time = Time::from_seconds(t);
            self.tally.row();
            self.tally.used(time);
            Ok(Some(time))
        }

        fn report(&self) -> SourceReport {
            self.tally.report()
        }
    }
}
