//! A format of a few lines: rows of numbers in memory. It needs [`RawRows`] and its own table.

use super::{Cell, RawRows, TimeSpec, format_spec};
use crate::config::{Diagnostics, Document};
use crate::rows::{DataError, SourceError, SourceReport};
use crate::source::OpenContext;
use crate::source::file::DataFile;
use std::path::Path;

format_spec! {
    /// Rows that a test holds.
    pub struct ListedSpec {
        /// The stamp of a row.
        time: TimeSpec,
    }
}

/// A count of nanoseconds, then numbers.
struct Listed {
    columns: Vec<String>,
    rows: std::vec::IntoIter<(i64, Vec<f64>)>,
    row: (i64, Vec<f64>),
    place: usize,
}

impl RawRows for Listed {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        let next = self.rows.next();
        self.place += 1;
        let more = next.is_some();
        self.row = next.unwrap_or_default();
        Ok(more)
    }

    fn place(&self) -> usize {
        self.place
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        match column {
            0 => Cell::Integer(self.row.0),
            column => Cell::Number(self.row.1[column - 1]),
        }
    }
}

/// Stamp in nanoseconds, number, values of every row used.
type Used = Vec<(i64, u64, Vec<f64>)>;

fn read(toml: &str, rows: Vec<(i64, Vec<f64>)>) -> Result<(Used, SourceReport), SourceError> {
    let (document, _) = Document::parse("filter.toml", toml);
    let mut diagnostics = Diagnostics::new();
    let spec: ListedSpec = document.root().read(&mut diagnostics).unwrap_or_else(|| panic!("{diagnostics}"));
    let mut errors = Vec::new();
    let plan = spec.rows().plan(&mut errors);
    assert_eq!(errors, []);
    let context = OpenContext::default();
    let raw = Listed {
        columns: ["t", "speed", "quality"].map(str::to_owned).to_vec(),
        rows: rows.into_iter(),
        row: (0, Vec::new()),
        place: 0,
    };
    let mut stream = plan.decode(raw, &DataFile::new(Path::new("log.bin"), &context), &context)?;
    let (mut used, mut values) = (Vec::new(), Vec::new());
    while let Some(stamp) = stream.next(&mut values)? {
        used.push((stamp.time.nanos(), stamp.number, values.clone()));
    }
    Ok((used, stream.report()))
}

const SPEED: &str = "
    time = { column = 't', unit = 'ns', epoch = 1520530308000000000 }
    valid = { column = 'quality', at_least = 1 }
    bad_rows = 'skip'
    channels.speed = { column = '-speed', unit = 'km/h' }";

#[test]
fn a_format_needs_only_its_cells_to_be_decoded_as_declared() {
    const EPOCH: i64 = 1_520_530_308_000_000_000;
    let rows = vec![
        (EPOCH + 1, vec![36.0, 4.0]),
        (EPOCH + 3, vec![72.0, 0.0]),
        (EPOCH + 5, vec![f64::NAN, 4.0]),
        (EPOCH + 7, vec![-3.6, 1.0]),
    ];
    let (used, report) = read(SPEED, rows).unwrap();
    // The stamp of 19 digits has lost none: as a floating-point number it would be 256 ns coarse.
    assert_eq!(used, [(1, 1, vec![-10.0]), (7, 4, vec![1.0])]);
    let expected = "\
2 of 4 rows, 0.0 s at 166666666.667 Hz, longest gap 0.000 s at 0.000 s
  left out 1: not valid as declared
  left out 1: bad rows
    line 3: `NaN` in column `speed` is not finite";
    assert_eq!(report.to_string(), expected);
}

#[test]
fn what_is_wrong_with_a_row_names_its_place() {
    let toml = SPEED.replace("skip", "stop");
    let error = read(&toml, vec![(0, vec![1.0, 1.0]), (-1_000_000, vec![1.0, 1.0])]).unwrap_err();
    let message = "log.bin:2: time runs backwards: -1520530308.001000 s comes after -1520530308.000000 s";
    assert_eq!(error.to_string(), message);
}
