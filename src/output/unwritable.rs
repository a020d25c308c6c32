//! A file that cannot be written.

use crate::config::{Diagnostic, Diagnostics};
use std::io;
use std::path::PathBuf;
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

impl From<Unwritable> for Diagnostics {
    fn from(unwritable: Unwritable) -> Self {
        Diagnostic::error(unwritable.to_string()).into()
    }
}
