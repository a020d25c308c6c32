//! A file that cannot be written.

use crate::config::{Diagnostic, Diagnostics};
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A file, or a folder, that cannot be written.
#[derive(Debug, Error)]
#[error("cannot write {}: {error}", path.display())]
pub struct Unwritable {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub error: io::Error,
}

impl Unwritable {
    /// The file at `path`.
    #[must_use]
    pub fn new(path: &Path, error: io::Error) -> Self {
        let path = path.to_owned();
        Self { path, error }
    }
}

impl From<Unwritable> for Diagnostics {
    fn from(unwritable: Unwritable) -> Self {
        Diagnostic::error(unwritable.to_string()).into()
    }
}
