//! The files of a run.

use super::also::FormatFile;
use super::{Options, Summary};
use crate::assembly::Assembly;
use crate::design::{Design, OrderSpec};
use crate::observe::{EstimateFile, Filters, Thinning, UpdateFile};
use crate::output::{EstimateFormat, FileSet, Origin, Spill, Unwritable};
use fusion_core::time::nanos;
use fusion_models::earth::LocalFrame;
use std::path::PathBuf;
use std::{fs, io};

/// The files of smoothed estimates, of estimates at the time, and of revised estimates.
const SMOOTHED: &str = "smoothed.csv";
const CURRENT: &str = "current.csv";
const REVISED: &str = "revised.csv";

/// The files that are written while a design is run.
#[derive(Debug, Default)]
pub(super) struct Files {
    set: Option<FileSet>,
    /// By filter.
    pub(super) estimates: Vec<EstimateFile>,
    pub(super) smoothed: Option<EstimateFile>,
    pub(super) current: Option<EstimateFile>,
    pub(super) updates: Option<UpdateFile>,
    /// Estimates and smoothed estimates in further formats.
    pub(super) also: Vec<FormatFile>,
    pub(super) also_smoothed: Vec<FormatFile>,
}

impl Files {
    /// No files without a folder to write to; smoothed.csv if estimates are smoothed, current.csv if later rows
    /// change them.
    pub(super) fn create(
        (design, assembly): (&Design, &Assembly),
        options: &Options,
        filters: &Filters,
        is_smoothed: bool,
    ) -> Result<Self, Unwritable> {
        let is_current = design.run.order == OrderSpec::Rewind;
        let Some(out) = &options.out else {
            return Ok(Self::default());
        };
        let mut set = match (&options.resume, &options.checkpoint) {
            (Some(_), _) => FileSet::go_on(out)?,
            (None, Some(_)) => FileSet::begin_kept(out)?,
            (None, None) => FileSet::begin(out)?,
        };
        if !is_smoothed {
            set.without(SMOOTHED);
        }
        let is_causal = options.causal && is_current;
        if !is_current || is_causal {
            set.without(CURRENT);
        }
        if !is_causal {
            set.without(REVISED);
        }
        let [estimated, at_the_time] = if is_causal {
            ["revised", "estimates"]
        } else {
            ["estimates", "current"]
        };
        let declared = design.run.origin.map(|place| LocalFrame::new(place.into()));
        let thinning = thinning(design);
        for format in EstimateFormat::all() {
            let is_written = options.also.iter().any(|also| also.name == format.name);
            for (name, is_there) in [("estimates", is_written), ("smoothed", is_written && is_smoothed)] {
                if !is_there {
                    set.without(&format!("{name}.{}", format.ending));
                }
            }
        }
        let (mut estimates, mut smoothed, mut current) = (Vec::new(), None, None);
        let (mut also, mut also_smoothed) = (Vec::new(), Vec::new());
        for filter in filters.iter() {
            let origin = Origin::new(declared);
            let name = if filter.is_outermost() { estimated } else { "estimates" };
            estimates.push(EstimateFile::create(&set, name, filter, origin.clone(), thinning)?);
            if is_smoothed && filter.is_outermost() {
                smoothed = Some(EstimateFile::create(&set, "smoothed", filter, origin.clone(), thinning)?);
            }
            for format in options.also.iter().filter(|_| filter.is_outermost()) {
                let file = |first| {
                    let of = (filter, origin.clone());
                    FormatFile::create((&set, first), format, (design, assembly), of, thinning)
                };
                also.push(file("estimates")?);
                if is_smoothed {
                    also_smoothed.push(file("smoothed")?);
                }
            }
            if is_current && filter.is_outermost() {
                current = Some(EstimateFile::create(&set, at_the_time, filter, origin, thinning)?);
            }
        }
        Ok(Self {
            estimates,
            smoothed,
            current,
            updates: Some(UpdateFile::create(&set, filters)?),
            also,
            also_smoothed,
            set: Some(set),
        })
    }

    /// A file for data kept until the end of the run; `None` without a folder to write to.
    pub(super) fn spill(&self, name: &str) -> Result<Option<Spill>, Unwritable> {
        self.set.as_ref().map(|set| set.spill(name)).transpose()
    }

    /// Ends the files that are written while a design is run; they do not have their names yet.
    pub(super) fn finish(self) -> Result<Option<FileSet>, Unwritable> {
        let Some(mut set) = self.set else { return Ok(None) };
        for file in self.estimates.into_iter().chain(self.smoothed).chain(self.current) {
            set.close(file.finish()?)?;
        }
        for file in self.also.into_iter().chain(self.also_smoothed) {
            set.close(file.finish()?)?;
        }
        if let Some(file) = self.updates {
            set.close(file.finish()?)?;
        }
        Ok(Some(set))
    }
}

/// The estimates that have a row in their file, by `run.output_rate`.
#[must_use]
pub fn thinning(design: &Design) -> Thinning {
    Thinning::new(design.run.output_rate.map_or(0, |rate| nanos(1.0 / rate.si())))
}

/// A run that came to its end.
#[derive(Debug)]
pub struct Finished {
    /// Its result.
    pub summary: Summary,
    /// Its files, without their names yet; `None` without a folder to write to.
    pub files: Option<FileSet>,
    /// The checkpoint files written during the run.
    pub(super) checkpoints: Vec<PathBuf>,
}

impl Finished {
    /// Writes summary.json, gives all files their names, and removes the checkpoints.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn keep(self) -> Result<Summary, Unwritable> {
        if let Some(mut files) = self.files {
            files.write("summary.json", |file| Ok(serde_json::to_writer_pretty(file, &self.summary)?))?;
            files.commit()?;
        }
        for path in self.checkpoints {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(Unwritable { path, error }),
                _ => {}
            }
        }
        Ok(self.summary)
    }
}
