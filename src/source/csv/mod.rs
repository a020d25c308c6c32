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
//! Memory   one row; a quotation mark that is never closed makes the rest of the file that row

mod blanks;
mod lines;
mod reader;
#[cfg(test)]
mod tests;

use super::decode::{Plan, TimeSpec, format_spec};
use super::file::DataFile;
use super::{OpenContext, SourceSpec};
use crate::rows::{ProvidedChannel, RowStream, SourceError};
use fusion_models::block::BuildError;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

pub(super) use reader::{CsvRows, Dialect, Names};

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
        /// What separates the fields: a character, or `"blanks"` for runs of blanks and tabs.
        #[serde(default = "comma")]
        delimiter: String,
        /// Lines that begin with this character, such as `"#"` or `"%"`, are comments.
        comment: Option<char>,
        /// Whether the first line names the columns; without header they are called `1`, `2`, …. With
        /// `"comment"` the last comment before the first row names them.
        #[serde(default)]
        header: Header,
        /// Names for the columns of a file without header.
        names: Option<Vec<String>>,
        /// The stamp of a row.
        time: TimeSpec,
    }
}

fn comma() -> String {
    ",".to_owned()
}

/// What `delimiter` says for runs of blanks.
const BLANKS: &str = "blanks";

/// Which line names the columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected true, false or \"comment\"")]
enum Header {
    /// The first, or none.
    First(bool),
    /// A comment.
    Within(Within),
}

/// Where the names are, if not in a line of their own.
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
    /// Everything that can be checked without the file.
    fn plan(&self) -> Result<Plan<'_>, Vec<BuildError>> {
        let mut errors = Vec::new();
        let plan = self.rows().plan(&mut errors);
        let message = "this is one plain character, such as \",\", \";\" or \"\\t\"";
        if self.delimiter != BLANKS && plain(&self.delimiter).is_none() {
            errors.push(BuildError::at("delimiter", message).help("runs of blanks are `delimiter = \"blanks\"`"));
        }
        if self.comment.is_some_and(|c| plain(c.encode_utf8(&mut [0; 4])).is_none()) {
            errors.push(BuildError::at("comment", message));
        }
        if self.header == Header::Within(Within::Comment) && self.comment.is_none() {
            let message = "a header within a comment needs the character that begins comments";
            errors.push(BuildError::at("header", message).help("add e.g. `comment = \"#\"`"));
        }
        if errors.is_empty() { Ok(plan) } else { Err(errors) }
    }

    fn dialect(&self) -> Dialect {
        Dialect {
            delimiter: if self.delimiter == BLANKS { None } else { plain(&self.delimiter) },
            comment: self.comment.and_then(|c| plain(c.encode_utf8(&mut [0; 4]))),
        }
    }

    fn names(&self) -> Names<'_> {
        match (&self.names, self.header) {
            (Some(names), _) => Names::Given(names),
            (None, Header::First(true)) => Names::FirstLine,
            (None, Header::First(false)) => Names::Numbered,
            (None, Header::Within(Within::Comment)) => Names::Comment,
        }
    }

    /// Its rows as they lie in the file.
    pub(super) fn raw(&self, context: &OpenContext) -> Result<CsvRows, SourceError> {
        CsvRows::open(self.dialect(), self.names(), &DataFile::new(&self.path, context), context)
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

    fn open(&self, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        let plan = self.plan()?;
        let file = DataFile::new(&self.path, context);
        plan.decode(self.raw(context)?, &file, context)
    }
}
