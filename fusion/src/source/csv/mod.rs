//! Tables of text: one row per line, plain or gzip-compressed, read as a stream.
//!
//! ```toml
//! [source.imu]
//! type = "csv"
//! path = "drive/imu.csv.gz"
//! time = { column = "t_ns", unit = "ns", epoch = 1520530308000000000 }
//! rate = "100 Hz"
//! [source.imu.channels]
//! angular_rate = { columns = ["dthx", "dthy", "-dthz"], unit = "rad", increment = true }
//! specific_force = { columns = ["ax", "ay", "az"], unit = "g", rotation = { axes = ["-x", "y", "-z"] } }
//! ```
//!
//! Memory   one row of 16 MiB at most: a longer one, such as after a quotation mark that is never closed, is an error

mod blanks;
mod dropped;
mod lines;
mod reader;
#[cfg(test)]
mod tests;

use super::decode::RawRows;
use super::decode::{Plan, TimeSpec, format_spec};
use super::file::DataFile;
use super::{OpenContext, SourceSpec};
use crate::rows::{ProvidedChannel, RowStream, SourceError};
use core::num::NonZeroUsize;
use fusion_models::block::BuildError;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

pub(super) use reader::{CsvRows, Dialect, Head, Names};

fusion_models::register!(
    Source,
    "csv",
    CsvSpec,
    r#"
path = "drive/gnss.csv"
time = { column = "t_s", unit = "s" }
valid = { column = "q", equals = 1 }
[channels.position]
latitude = "lat_deg"
longitude = "lon_deg"
height = "h_m"
unit = "deg"
[channels.velocity]
columns = ["vn_mps", "ve_mps", "vd_mps"]
unit = "m/s"
latency = "0.13 s"
"#
);

format_spec! {
    /// Rows of a text file, one stamp and any channels in each: comma- or otherwise separated, plain
    /// or gzip-compressed.
    pub struct CsvSpec {
        /// The file, relative to the data directory; gzip is recognised by its content.
        path: PathBuf,
        /// The delimiter of the fields: a character, or `"blanks"` for runs of blanks and tabs.
        #[serde(default = "comma")]
        delimiter: String,
        /// Lines that begin with this text, such as `"#"`, `"%"` or `"//"`, are comments.
        comment: Option<String>,
        /// Whether the first line names the columns; without a header they are called `1`, `2`, …. With `"comment"`,
        /// the last comment before the first row names them. A number is the number of the line with the names: the
        /// lines before it are skipped.
        #[serde(default)]
        header: Header,
        /// Names for the columns, instead of a header.
        names: Option<Vec<String>>,
        /// Number of lines to skip between the header and the first row, such as a line of units. Without a header or
        /// with `names`: lines to skip at the beginning of the file.
        #[serde(default)]
        skip: usize,
        /// The stamp of a row.
        time: TimeSpec,
    }
}

fn comma() -> String {
    ",".to_owned()
}

/// The value of `delimiter` for runs of blanks.
const BLANKS: &str = "blanks";

/// Which line names the columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected true, false, \"comment\" or the number of a line")]
enum Header {
    /// The first line, or no line.
    First(bool),
    /// The line with this number, from 1.
    Line(NonZeroUsize),
    /// A comment.
    Within(Within),
}

/// The place of the names, if they have no separate line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum Within {
    /// In the last comment before the first row.
    Comment,
}

impl Default for Header {
    fn default() -> Self {
        Self::First(true)
    }
}

impl CsvSpec {
    /// Checks everything that can be checked without the file.
    fn plan(&self) -> Result<Plan<'_>, Vec<BuildError>> {
        let mut errors = Vec::new();
        let plan = self.rows().plan(&mut errors);
        let message = "this is one plain character, such as \",\", \";\" or \"\\t\"";
        if self.delimiter != BLANKS && plain(&self.delimiter).is_none() {
            errors.push(BuildError::at("delimiter", message).help("runs of blanks are `delimiter = \"blanks\"`"));
        }
        let is_mark = |text: &String| !text.is_empty() && !text.contains(['\n', '\r', '"']);
        if self.comment.as_ref().is_some_and(|text| !is_mark(text)) {
            errors.push(BuildError::at(
                "comment",
                "this is what comments begin with, such as \"#\" or \"//\"",
            ));
        }
        if self.names.is_some() && matches!(self.header, Header::Line(_)) {
            let help = "leave out one of them; a header is passed over by `skip`, the number of its lines";
            errors.push(BuildError::at("header", "`names` stand instead of a header").help(help));
        }
        if self.header == Header::Within(Within::Comment) && self.comment.is_none() {
            let message = "a header within a comment needs the character that begins comments";
            errors.push(BuildError::at("header", message).help("add e.g. `comment = \"#\"`"));
        }
        if errors.is_empty() { Ok(plan) } else { Err(errors) }
    }

    fn dialect(&self) -> Dialect<'_> {
        Dialect {
            delimiter: if self.delimiter == BLANKS { None } else { plain(&self.delimiter) },
            comment: self.comment.as_deref(),
        }
    }

    fn head(&self) -> Head<'_> {
        let (names, before) = match (&self.names, self.header) {
            (Some(names), _) => (Names::Given(names), 0),
            (None, Header::First(true)) => (Names::FirstLine, 0),
            (None, Header::Line(line)) => (Names::FirstLine, line.get() - 1),
            (None, Header::First(false)) => (Names::Numbered, 0),
            (None, Header::Within(Within::Comment)) => (Names::Comment, 0),
        };
        Head {
            names,
            before,
            after: self.skip,
        }
    }

    /// Its rows as in the file.
    pub(super) fn raw(&self, context: &OpenContext) -> Result<CsvRows, SourceError> {
        CsvRows::open(self.dialect(), self.head(), &DataFile::new(&self.path, context), context)
    }
}

/// The character that can be a delimiter or begin a comment.
fn plain(text: &str) -> Option<u8> {
    match *text.as_bytes() {
        [byte] if byte.is_ascii() && !matches!(byte, b'\n' | b'\r' | b'"') => Some(byte),
        _ => None,
    }
}

#[typetag::deserialize(name = "csv")]
impl SourceSpec for CsvSpec {
    fn files(&self) -> Vec<PathBuf> {
        vec![self.path.clone()]
    }

    fn channels(&self) -> Result<Vec<ProvidedChannel>, Vec<BuildError>> {
        Ok(self.plan()?.provided())
    }

    fn time_zero(&self) -> Option<i64> {
        self.rows().time_zero()
    }

    fn open(&self, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        let plan = self.plan()?;
        let file = DataFile::new(&self.path, context);
        plan.decode(self.raw(context)?, &file, context)
    }

    fn open_rows(&self, rows: Box<dyn RawRows>, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        self.plan()?.decode(rows, &DataFile::new(&self.path, context), context)
    }
}
