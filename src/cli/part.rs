//! Parts of works: files, and their numbers on the command line.

use super::Failure;
use core::ops::Range;
use fusion::config::{Diagnostic, Diagnostics};
use fusion_judge::part::{Part, Source, Unreadable};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Seek, Write};
use std::path::Path;

/// Numbers of runs or cases, from the command line.
pub(super) fn range(text: &str) -> Result<Range<u64>, String> {
    let ends = text
        .split_once("..")
        .and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
    ends.filter(|runs: &Range<u64>| !runs.is_empty())
        .ok_or_else(|| "write two numbers such as 50..100, the first one smaller".to_owned())
}

/// Does work into a part: the named file, complete or not at all, or a temporary one.
pub(super) fn work(path: Option<&Path>, write: impl FnOnce(&mut dyn Write) -> Result<(), Diagnostics>) -> Result<Part, Failure> {
    let Some(path) = path else {
        let unwritable = |e: io::Error| Diagnostic::error(format!("no temporary file can be written: {e}"));
        let file = tempfile::tempfile().map_err(unwritable)?;
        let mut out = BufWriter::new(file);
        write(&mut out)?;
        let file = out.into_inner().map_err(|e| unwritable(e.into_error()))?;
        let source: Source = Box::new(move || {
            let mut again = file.try_clone()?;
            again.rewind()?;
            Ok(Box::new(BufReader::new(again)))
        });
        return Part::open("the temporary file", source).map_err(refused);
    };
    let unwritable = |e: io::Error| Diagnostic::error(format!("`{}` cannot be written: {e}", path.display()));
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    let mut out = BufWriter::new(File::create(&partial).map_err(unwritable)?);
    write(&mut out)?;
    let whole = || -> io::Result<()> {
        out.into_inner()?.sync_all()?;
        std::fs::rename(&partial, path)
    };
    whole().map_err(unwritable)?;
    open(path)
}

/// A part on disk.
pub(super) fn open(path: &Path) -> Result<Part, Failure> {
    let file = path.to_owned();
    let source: Source = Box::new(move || Ok(Box::new(BufReader::new(File::open(&file)?))));
    Part::open(&path.display().to_string(), source).map_err(refused)
}

pub(super) fn refused(why: Unreadable) -> Failure {
    Diagnostic::error(why.to_string()).into()
}
