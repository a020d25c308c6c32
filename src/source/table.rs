//! A file as columns of numbers, before anybody has declared what they are.
//!
//! The rows are those of the format's own reader. A cell that is not a number is NaN here; a row that
//! cannot be split into cells is counted and left out.
//!
//! Memory   all of the file, eight bytes for each cell

use super::OpenContext;
use super::csv::CsvSpec;
use super::decode::RawRows;
use super::file::DataFile;
use super::rtklib::PosRows;
use crate::rows::{DataError, SourceError};
use fusion_models::block::BuildError;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// What may separate the fields of a text file, the usual one first.
const DELIMITERS: [&str; 3] = [",", ";", "\t"];

/// How the rows of a file are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// Fields with something between them.
    #[default]
    Csv,
    /// A solution of RTKLIB.
    Rtklib,
}

/// A file as columns of numbers.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// The file.
    pub path: PathBuf,
    /// How it is written.
    pub format: Format,
    /// What separates its fields.
    pub delimiter: String,
    /// Whether its first line names the columns.
    pub header: bool,
    /// Its columns.
    pub columns: Vec<Column>,
    /// Rows that cannot be split into as many cells as there are columns.
    pub malformed: usize,
}

/// A column.
#[derive(Clone, Debug, Default)]
pub struct Column {
    /// As declarations refer to it.
    pub name: String,
    /// Its first cell as it is written.
    pub first: String,
    /// The numbers, NaN where a cell is none.
    pub values: Vec<f64>,
}

impl Table {
    /// Reads all of a file.
    ///
    /// # Errors
    /// It cannot be opened or read.
    pub fn read(path: &Path) -> Result<Self, SourceError> {
        let name = path.to_string_lossy();
        if name.ends_with(".pos") || name.ends_with(".pos.gz") {
            let rows = PosRows::open(&DataFile::new(path, &OpenContext::default()), &OpenContext::default())?;
            let table = Self {
                path: path.to_owned(),
                format: Format::Rtklib,
                header: true,
                ..Self::default()
            };
            return table.filled(rows);
        }
        let mut best: Option<(&str, Vec<String>)> = None;
        for delimiter in DELIMITERS {
            let names = names(path, delimiter)?;
            if best.as_ref().is_none_or(|(_, columns)| names.len() > columns.len()) {
                best = Some((delimiter, names));
            }
        }
        let (delimiter, names) = best.unwrap_or_default();
        let header = !names.iter().all(|name| name.parse::<f64>().is_ok());
        let table = Self {
            path: path.to_owned(),
            delimiter: delimiter.to_owned(),
            header,
            ..Self::default()
        };
        table.filled(spec(path, delimiter, header)?.raw(&OpenContext::default())?)
    }

    /// With all rows.
    fn filled(mut self, mut rows: impl RawRows) -> Result<Self, SourceError> {
        let named = rows.columns().iter().map(|name| Column {
            name: name.clone(),
            ..Column::default()
        });
        self.columns = named.collect();
        while rows.advance()? {
            self.take(&rows);
        }
        Ok(self)
    }

    fn take(&mut self, row: &impl RawRows) {
        if row.malformed().is_some() {
            self.malformed += 1;
            return;
        }
        for (k, column) in self.columns.iter_mut().enumerate() {
            let cell = row.cell(k);
            if column.values.is_empty() {
                column.first = cell.shown().into_owned();
            }
            column.values.push(cell.number().unwrap_or(f64::NAN));
        }
    }

    /// How many rows it has.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.values.len())
    }
}

/// The first line, cell by cell.
fn names(path: &Path, delimiter: &str) -> Result<Vec<String>, SourceError> {
    let rows = spec(path, delimiter, true)?.raw(&OpenContext::default())?;
    Ok(rows.columns().to_vec())
}

/// The declaration of a file of which nothing is known; the column of time is not looked at.
fn spec(path: &Path, delimiter: &str, header: bool) -> Result<CsvSpec, SourceError> {
    let unreadable = |why: String| SourceError::from(DataError::new(path.display().to_string(), why));
    let Some(name) = path.to_str() else {
        return Err(BuildError::at("path", "the name of this file is not UTF-8 text").into());
    };
    let mut declared = toml::Table::new();
    declared.insert("path".to_owned(), name.into());
    declared.insert("delimiter".to_owned(), delimiter.into());
    declared.insert("header".to_owned(), header.into());
    declared.insert(
        "time".to_owned(),
        toml::Table::from_iter([("column".to_owned(), "1".into())]).into(),
    );
    CsvSpec::deserialize(declared).map_err(|e| unreadable(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, text: &str) -> Table {
        let path = std::env::temp_dir().join(format!("fusion-table-{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let table = Table::read(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        table
    }

    #[test]
    fn a_solution_of_rtklib_has_its_stamps_in_nanoseconds() {
        let header = "% program : RTKPOST\n%  GPST  latitude(deg) longitude(deg) height(m) Q\n";
        let rows = "2025/07/08 19:34:18.500 40.1 -105.2 1601.4 1\n2374 243259.750 40.2 -105.2 1601.5 2\n2025/07/08 lost\n";
        let table = of("solution.pos", &format!("{header}{rows}"));
        assert_eq!((table.format, table.rows(), table.malformed), (Format::Rtklib, 2, 1));
        let names: Vec<&str> = table.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["time", "latitude(deg)", "longitude(deg)", "height(m)", "Q"]);
        // Week 2374 began on 6 July 2025; in double precision a stamp of today is known to 256 ns.
        let stamps = &table.columns[0].values;
        assert!((stamps[1] - stamps[0] - 1.25e9).abs() < 512.0, "{stamps:?}");
        assert_eq!(table.columns[1].values, [40.1, 40.2]);
    }

    #[test]
    fn names_are_taken_from_a_header_and_numbers_where_there_is_none() {
        let named = of("named", "t_s;x\n1;2\n2;lost\n3\n");
        assert_eq!(
            (named.delimiter.as_str(), named.header, named.rows(), named.malformed),
            (";", true, 2, 1)
        );
        assert_eq!((named.columns[1].name.as_str(), named.columns[1].first.as_str()), ("x", "2"));
        assert!(named.columns[1].values[1].is_nan());
        let bare = of("bare", "1,2\n3,4\n");
        assert_eq!((bare.header, bare.rows(), bare.columns[1].name.as_str()), (false, 2, "2"));
    }
}
