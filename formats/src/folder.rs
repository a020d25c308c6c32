//! The files of a bag of ROS 2: one file, or a folder with `metadata.yaml` and several files.

#[cfg(feature = "mcap")]
use crate::bytes::Bytes;
use fusion::rows::DataError;
#[cfg(feature = "mcap")]
use fusion::rows::SourceError;
use fusion::source::DataFile;
#[cfg(feature = "mcap")]
use fusion::source::OpenContext;
use std::path::Path;

/// The files of a log, in the order in which they were recorded.
pub(crate) struct Parts {
    name: String,
    files: std::vec::IntoIter<DataFile>,
}

impl Parts {
    /// The files of a folder with one of these endings; or the file itself.
    pub(crate) fn of(file: &DataFile, endings: &[&str]) -> Self {
        let path = file.path();
        let files = if path.is_dir() {
            listed(path, endings).iter().map(|name| file.within(name)).collect()
        } else {
            vec![file.clone()]
        };
        Self {
            name: file.name(),
            files: files.into_iter(),
        }
    }

    /// The file alone, for bytes that arrive in its place.
    #[cfg(feature = "mcap")]
    pub(crate) fn one(file: &DataFile) -> Self {
        Self {
            name: file.name(),
            files: vec![file.clone()].into_iter(),
        }
    }

    /// That there is no such file.
    pub(crate) fn none(&self) -> DataError {
        DataError::new(self.name.clone(), "this folder has no file of this format")
    }
}

impl Parts {
    /// The next file.
    pub(crate) fn next_file(&mut self) -> Option<DataFile> {
        self.files.next()
    }

    /// The bytes of the next file.
    #[cfg(feature = "mcap")]
    pub(crate) fn next_bytes(&mut self, context: &OpenContext) -> Option<Result<Bytes, SourceError>> {
        Some(Bytes::open(&self.next_file()?, context))
    }
}

/// The names of the files that `metadata.yaml` lists; without it, all by the numbers in their names.
fn listed(folder: &Path, endings: &[&str]) -> Vec<String> {
    let metadata = std::fs::read_to_string(folder.join("metadata.yaml")).unwrap_or_default();
    let mut lines = metadata.lines().map(str::trim);
    let is_list = lines.any(|line| line == "relative_file_paths:");
    let listed = lines.map_while(|line| line.strip_prefix("- ")).filter(|_| is_list);
    let has_ending = |name: &str| endings.iter().any(|ending| name.ends_with(ending));
    let listed: Vec<String> = listed.filter(|name| has_ending(name)).map(str::to_owned).collect();
    if !listed.is_empty() {
        return listed;
    }
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| has_ending(name)).collect();
    // `bag_10` comes after `bag_9`.
    names.sort_by_key(|name| (name.len(), name.clone()));
    names
}
