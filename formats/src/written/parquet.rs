//! A table of Parquet with the columns and the digits of estimates.csv.
//!
//! Memory   the rows of one group: [`GROUP`]

use arrow_array::builder::Float64Builder;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use core::cell::RefCell;
use fusion::core::belief::Belief;
use fusion::output::{EstimateAbout, EstimateFormat, EstimateSink, EstimateWriter, OutputFile};
use fusion::solution::Solution;
use parquet::arrow::ArrowWriter;
use std::io::{self, Write};
use std::rc::Rc;
use std::sync::Arc;

/// Rows of a group.
const GROUP: usize = 16_384;

fusion::inventory::submit! {
    EstimateFormat {
        name: "parquet",
        ending: "parquet",
        about: "the columns and digits of estimates.csv for pandas and polars",
        begin: |file, about| Ok(Box::new(Table::begin(file, about)?)),
    }
}

/// A line of text that its writer and its reader share.
#[derive(Clone, Debug, Default)]
struct Line(Rc<RefCell<Vec<u8>>>);

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Line {
    /// The text so far, which is removed.
    fn take(&self) -> io::Result<String> {
        String::from_utf8(core::mem::take(&mut *self.0.borrow_mut())).map_err(io::Error::other)
    }
}

#[derive(Debug)]
struct Table {
    /// Writes a row as text, so that both files have the same digits.
    text: EstimateWriter<Line>,
    line: Line,
    columns: Vec<Float64Builder>,
    rows: usize,
    schema: Arc<Schema>,
    file: ArrowWriter<OutputFile>,
}

impl Table {
    fn begin(file: OutputFile, about: &EstimateAbout<'_>) -> io::Result<Self> {
        let line = Line::default();
        let text = EstimateWriter::new(line.clone(), about.layout, about.origin.clone())?;
        let header = line.take()?;
        let names = header.trim_end().split(',').map(|name| name.trim_matches('"'));
        let fields: Vec<Field> = names.map(|name| Field::new(name, DataType::Float64, true)).collect();
        let columns = fields.iter().map(|_| Float64Builder::new()).collect();
        let schema = Arc::new(Schema::new(fields));
        let file = ArrowWriter::try_new(file, Arc::clone(&schema), None).map_err(io::Error::other)?;
        Ok(Self {
            text,
            line,
            columns,
            rows: 0,
            schema,
            file,
        })
    }

    /// Writes the rows of a group.
    fn write_group(&mut self) -> io::Result<()> {
        let arrays = self
            .columns
            .iter_mut()
            .map(|column| Arc::new(column.finish()) as ArrayRef)
            .collect();
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays).map_err(io::Error::other)?;
        self.rows = 0;
        self.file.write(&batch).map_err(io::Error::other)?;
        self.file.flush().map_err(io::Error::other)
    }
}

impl EstimateSink for Table {
    fn write(&mut self, solution: &Solution, belief: &Belief) -> io::Result<()> {
        self.text.write(solution, belief)?;
        self.text.flush()?;
        let line = self.line.take()?;
        for (column, cell) in self.columns.iter_mut().zip(line.trim_end().split(',')) {
            column.append_option(cell.parse().ok());
        }
        self.rows += 1;
        if self.rows == GROUP { self.write_group() } else { Ok(()) }
    }

    fn finish(mut self: Box<Self>) -> io::Result<OutputFile> {
        self.write_group()?;
        self.file.into_inner().map_err(io::Error::other)
    }
}
