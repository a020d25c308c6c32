//! A table of Parquet with the columns and the digits of estimates.csv.
//!
//! Memory   the rows of one group: [`GROUP`]

use arrow_array::builder::Float64Builder;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use fusion::core::belief::Belief;
use fusion::output::{Digits, EstimateAbout, EstimateCells, EstimateColumns, EstimateFormat, EstimateSink, OutputFile};
use fusion::solution::Solution;
use parquet::arrow::ArrowWriter;
use std::io;
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

/// The cells of a group, column by column.
#[derive(Debug)]
struct Group {
    columns: Vec<Float64Builder>,
    /// The column of the next cell.
    next: usize,
    rows: usize,
}

impl EstimateCells for Group {
    fn number(&mut self, value: f64, digits: Digits) {
        let shown = Some(digits.rounded(value)).filter(|shown| !shown.is_nan());
        self.columns[self.next].append_option(shown);
        self.next += 1;
    }

    fn empty(&mut self, cells: usize) {
        let empty = self.next..self.next + cells;
        self.columns[empty].iter_mut().for_each(Float64Builder::append_null);
        self.next += cells;
    }
}

#[derive(Debug)]
struct Table {
    columns: EstimateColumns,
    group: Group,
    schema: Arc<Schema>,
    file: ArrowWriter<OutputFile>,
}

impl Table {
    fn begin(file: OutputFile, about: &EstimateAbout<'_>) -> io::Result<Self> {
        let columns = EstimateColumns::new(about.layout, about.origin.clone());
        let names = columns.names().into_iter();
        let fields: Vec<Field> = names.map(|name| Field::new(name, DataType::Float64, true)).collect();
        let group = Group {
            columns: fields.iter().map(|_| Float64Builder::new()).collect(),
            next: 0,
            rows: 0,
        };
        let schema = Arc::new(Schema::new(fields));
        let file = ArrowWriter::try_new(file, Arc::clone(&schema), None).map_err(io::Error::other)?;
        Ok(Self {
            columns,
            group,
            schema,
            file,
        })
    }

    /// Writes the rows of a group.
    fn write_group(&mut self) -> io::Result<()> {
        let columns = self.group.columns.iter_mut();
        let arrays = columns.map(|column| Arc::new(column.finish()) as ArrayRef).collect();
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays).map_err(io::Error::other)?;
        self.group.rows = 0;
        self.file.write(&batch).map_err(io::Error::other)?;
        self.file.flush().map_err(io::Error::other)
    }
}

impl EstimateSink for Table {
    fn write(&mut self, solution: &Solution, belief: &Belief) -> io::Result<()> {
        self.group.next = 0;
        self.columns.write(solution, belief, &mut self.group);
        self.group.rows += 1;
        if self.group.rows == GROUP { self.write_group() } else { Ok(()) }
    }

    fn finish(mut self: Box<Self>) -> io::Result<OutputFile> {
        self.write_group()?;
        self.file.into_inner().map_err(io::Error::other)
    }
}
