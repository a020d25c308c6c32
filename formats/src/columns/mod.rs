//! Tables of columns: Parquet, and Arrow IPC (Feather).
//!
//! A field of a structure is the column `a.b`, an element of a list `a[0]`; the first row defines the number of
//! elements. Times, dates and durations are whole nanoseconds, those of dates since 1970-01-01. A truth value is 0 or 1.
//!
//! Memory   one batch of rows
//! Not here maps, unions and binary values

mod cell;
mod place;
mod rows;
mod spec;
#[cfg(test)]
mod tests;

use arrow_array::RecordBatch;
use fusion::rows::SourceError;
use fusion::source::DataFile;
use rows::Rows;

/// The batches of a file, or the text of an error.
type Batches = Box<dyn Iterator<Item = Result<RecordBatch, String>> + Send>;

#[cfg(feature = "parquet")]
mod parquet {
    use super::{Batches, DataFile, Rows, SourceError, rows, spec::column_format};
    use crate::signature::PARQUET;
    use arrow_schema::SchemaRef;
    use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

    column_format! {
        /// A table of Parquet. A column is called by its path, such as `gyro.x` or `gyro[0]`.
        ParquetSpec opens open as "parquet";
        signature PARQUET;
        example r#"
path = "drive.parquet"
time = { column = "t" }
[channels.angular_rate]
columns = ["gyro.x", "gyro.y", "gyro.z"]
unit = "deg/s"
"#;
    }

    /// Rows of a batch.
    const BATCH: usize = 1024;

    fn open(file: &DataFile) -> Result<Rows, SourceError> {
        Rows::new(file, |bytes| {
            let reader = ParquetRecordBatchReaderBuilder::try_new(bytes).map_err(rows::text)?;
            let reader = reader.with_batch_size(BATCH).build().map_err(rows::text)?;
            let schema: SchemaRef = arrow_array::RecordBatchReader::schema(&reader);
            let batches: Batches = Box::new(reader.map(|batch| batch.map_err(rows::text)));
            Ok((schema, batches))
        })
    }
}

#[cfg(feature = "arrow")]
mod arrow {
    use super::{Batches, DataFile, Rows, SourceError, rows, spec::column_format};
    use crate::signature::ARROW;
    use arrow_ipc::reader::StreamReader;
    use std::io::{BufReader, Read, Seek, SeekFrom};

    column_format! {
        /// A table of Arrow IPC, also called Feather. A column is called by its path, such as `gyro.x` or `gyro[0]`.
        ArrowSpec opens open as "arrow";
        signature ARROW;
        example r#"
path = "drive.arrow"
time = { column = "t" }
[channels.angular_rate]
columns = ["gyro.x", "gyro.y", "gyro.z"]
unit = "deg/s"
"#;
    }

    /// The mark of a file and its padding are at most this long \[bytes\].
    const MARK: u64 = 64;

    /// The index at the end of a file is not read, so that a file that is cut off gives the rows before the cut.
    fn open(file: &DataFile) -> Result<Rows, SourceError> {
        Rows::new(file, |mut bytes| {
            let mut start = Vec::new();
            bytes.by_ref().take(MARK).read_to_end(&mut start).map_err(rows::text)?;
            // After the mark of six bytes come zeros to a multiple of 8, or of 64. Then a stream begins.
            let begin = (6..start.len()).find(|k| start[*k] != 0).unwrap_or(start.len());
            bytes.seek(SeekFrom::Start(begin as u64)).map_err(rows::text)?;
            let reader = StreamReader::try_new(BufReader::new(bytes), None).map_err(rows::text)?;
            let schema = reader.schema();
            let batches: Batches = Box::new(reader.map(|batch| batch.map_err(rows::text)));
            Ok((schema, batches))
        })
    }
}
