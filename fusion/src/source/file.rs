//! A data file: found, opened, unpacked, with messages that report where it was searched.

use super::OpenContext;
use crate::config::{did_you_mean, is_utf_16};
use crate::rows::{DataError, SourceError};
use flate2::bufread::MultiGzDecoder;
use fusion_models::block::BuildError;
use std::fs::File;
use std::io::{BufReader, Cursor, Error, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// The first bytes of a gzip file (RFC 1952).
const GZIP: [u8; 2] = [0x1f, 0x8b];
/// The byte order mark of UTF-8, which some programs write first.
const BOM: [u8; 3] = [0xef, 0xbb, 0xbf];
/// Bytes that are read at a time.
pub(super) const BUFFER: usize = 1 << 16;

/// A file as declared and as opened.
#[derive(Clone, Debug)]
pub struct DataFile {
    /// The path of the declaration.
    pub(super) declared: PathBuf,
    /// The path that is opened, and that messages about its content name.
    pub(super) opened: PathBuf,
}

impl DataFile {
    /// The file that a declaration names.
    #[must_use]
    pub fn new(declared: &Path, context: &OpenContext) -> Self {
        Self {
            declared: declared.to_owned(),
            opened: context.resolve(declared),
        }
    }

    /// A file of this folder.
    #[must_use]
    pub fn within(&self, name: &str) -> Self {
        Self {
            declared: self.declared.join(name),
            opened: self.opened.join(name),
        }
    }

    /// Its path as opened.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.opened
    }

    /// Its name in messages.
    #[must_use]
    pub fn name(&self) -> String {
        self.opened.display().to_string()
    }

    /// Its bytes, unpacked if it is gzip-compressed; or those that arrive in its place, as they are.
    ///
    /// # Errors
    /// It cannot be opened, or is UTF-16 text.
    pub fn bytes(&self, context: &OpenContext) -> Result<Box<dyn Read + Send>, SourceError> {
        let unreadable = |error: Error| {
            let message = format!("`{}` cannot be read: {}", self.declared.display(), in_words(&error));
            BuildError::at("path", message).help(self.whereabouts(context))
        };
        if let Some(arriving) = &context.arriving {
            return Ok(arriving.take());
        }
        let mut file = File::open(&self.opened).map_err(unreadable)?;
        let metadata = file.metadata().map_err(unreadable)?;
        if metadata.is_dir() {
            let message = format!("`{}` is a directory, not a file", self.declared.display());
            return Err(BuildError::at("path", message).into());
        }
        // A pipe may deliver byte by byte.
        let mut start = Vec::with_capacity(BOM.len());
        file.by_ref().take(BOM.len() as u64).read_to_end(&mut start).map_err(unreadable)?;
        if is_utf_16(&start) {
            let error = DataError::new(self.name(), "this file is UTF-16 text");
            let utf_8 = format!("save it as UTF-8: iconv -f UTF-16 -t UTF-8 {} > NEW", self.declared.display());
            return Err(error.help(utf_8).into());
        }
        let is_packed = start.starts_with(&GZIP);
        // A pipe has no length.
        let left = metadata.len().saturating_sub(start.len() as u64);
        if start == BOM {
            start.clear();
        }
        let file = BufReader::with_capacity(BUFFER, Cursor::new(start).chain(context.unread.count(file, left)));
        if is_packed {
            return Ok(Box::new(MultiGzDecoder::new(file)));
        }
        if self.opened.extension().is_some_and(|e| e == "gz") {
            let message = "this file is not gzip-compressed, although its name ends in `.gz`";
            let error = DataError::new(self.name(), message);
            return Err(error.help("copy or download it again, or rename it").into());
        }
        Ok(Box::new(file))
    }

    /// Where a missing file was searched, and the file that was probably meant.
    fn whereabouts(&self, context: &OpenContext) -> String {
        let name = self.opened.file_name().unwrap_or_default().to_string_lossy();
        let beside = self.opened.parent().and_then(|parent| std::fs::read_dir(parent).ok());
        let beside = beside.into_iter().flatten();
        let names = beside.filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()));
        let mut known: Vec<String> = names.collect();
        known.sort_unstable();
        let known: Vec<&str> = known.iter().map(String::as_str).collect();
        match did_you_mean(&name, &known) {
            Some(meant) => format!("did you mean `{meant}`, next to it?"),
            None => format!("a relative path starts at the data directory, `{}`", context.data_dir.display()),
        }
    }
}

fn in_words(error: &Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => "there is no such file".to_owned(),
        ErrorKind::PermissionDenied => "permission is denied".to_owned(),
        _ => error.to_string(),
    }
}
