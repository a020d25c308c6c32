//! The files of a run.

use super::{Options, Summary};
use crate::design::Design;
use crate::observe::{EstimateFile, Filters, UpdateFile};
use crate::output::{FileSet, Unwritable};
use fusion_core::time::nanos;
use fusion_models::earth::LocalFrame;

/// The files that are written while a design is run.
#[derive(Debug, Default)]
pub(super) struct Files {
    set: Option<FileSet>,
    /// By filter.
    pub(super) estimates: Vec<EstimateFile>,
    pub(super) updates: Option<UpdateFile>,
}

impl Files {
    /// None without a folder to write to.
    pub(super) fn create(design: &Design, options: &Options, filters: &Filters) -> Result<Self, Unwritable> {
        let Some(out) = &options.out else {
            return Ok(Self::default());
        };
        let set = FileSet::begin(out)?;
        let origin = design.run.origin.map(Into::into);
        let period = design.run.output_rate.map_or(0, |rate| nanos(1.0 / rate.si()));
        let estimates = filters
            .iter()
            .map(|filter| EstimateFile::create(&set, filter, origin.map(LocalFrame::new), period));
        Ok(Self {
            estimates: estimates.collect::<Result<_, _>>()?,
            updates: Some(UpdateFile::create(&set, filters)?),
            set: Some(set),
        })
    }

    /// Ends what is written while a design is run; none of it has its name yet.
    pub(super) fn finish(self) -> Result<Option<FileSet>, Unwritable> {
        let Some(mut set) = self.set else { return Ok(None) };
        for file in self.estimates {
            set.close(file.finish()?)?;
        }
        if let Some(file) = self.updates {
            set.close(file.finish()?)?;
        }
        Ok(Some(set))
    }
}

/// A run that came to its end.
#[derive(Debug)]
pub struct Finished {
    /// Its result.
    pub summary: Summary,
    /// Its files, without their names yet; none without a folder to write to.
    pub files: Option<FileSet>,
}

impl Finished {
    /// Writes summary.json and gives all files their names.
    ///
    /// # Errors
    /// Where one cannot be written.
    pub fn keep(self) -> Result<Summary, Unwritable> {
        if let Some(mut files) = self.files {
            files.write("summary.json", |file| Ok(serde_json::to_writer_pretty(file, &self.summary)?))?;
            files.commit()?;
        }
        Ok(self.summary)
    }
}
