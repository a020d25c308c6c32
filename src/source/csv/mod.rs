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
//! Not here fields separated by runs of blanks

mod lines;
mod reader;
#[cfg(test)]
mod tests;

use super::decode::{Plan, format_spec};
use super::file::DataFile;
use super::{OpenContext, SourceSpec};
use crate::rows::{ProvidedChannel, RowStream, SourceError};
use fusion_models::block::BuildError;
use reader::CsvRows;
use std::path::PathBuf;

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
        /// What separates the fields.
        #[serde(default = "comma")]
        delimiter: char,
        /// Lines that begin with this character, such as `"#"`, are comments. Do not set it if the
        /// header line begins with it: its names are taken as written.
        comment: Option<char>,
        /// Whether the first line names the columns; without header they are called `1`, `2`, ….
        #[serde(default = "yes")]
        header: bool,
        /// Names for the columns of a file without header.
        names: Option<Vec<String>>,
    }
}

const fn comma() -> char {
    ','
}

const fn yes() -> bool {
    true
}

impl CsvSpec {
    /// Everything that can be checked without the file.
    fn plan(&self) -> Result<Plan<'_>, Vec<BuildError>> {
        let mut errors = Vec::new();
        let plan = self.rows().plan(&mut errors);
        for (field, c) in [("delimiter", Some(self.delimiter)), ("comment", self.comment)] {
            if c.is_some_and(|c| !c.is_ascii() || matches!(c, '\n' | '\r' | '"')) {
                let message = "this is one plain character, such as \",\", \";\" or \"\\t\"";
                errors.push(BuildError::at(field, message));
            }
        }
        if errors.is_empty() { Ok(plan) } else { Err(errors) }
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
        let rows = CsvRows::open(self, &file, context)?;
        plan.decode(rows, &file, context)
    }
}
