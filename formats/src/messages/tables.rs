//! All topics of a log as tables, for `inspect`.

use super::{Cells, MessageReader};
use fusion::rows::{DataError, SourceError};
use fusion::source::decode::{Cell, Malformed, RawRows};
use fusion::source::table::LogTable;
use fusion::source::{DataFile, LogFormat, OpenContext};
use std::path::Path;

/// One message as a row.
struct One<'a> {
    columns: &'a [String],
    cells: &'a Cells,
    wrong: Option<String>,
}

impl RawRows for One<'_> {
    fn columns(&self) -> &[String] {
        self.columns
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        Ok(false)
    }

    fn place(&self) -> usize {
        0
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        self.cells.get(column)
    }

    fn malformed(&self) -> Option<Malformed> {
        self.wrong.clone().map(|message| Malformed {
            message,
            help: "",
            is_last: false,
        })
    }
}

/// A table for each topic with messages, in the order of the first messages. The file is read once.
///
/// # Errors
/// It cannot be opened, or has no message before its damage.
pub fn tables<R: MessageReader>(path: &Path, format: &'static LogFormat) -> Result<Vec<LogTable>, SourceError> {
    let context = OpenContext::default();
    let mut reader = R::open(&DataFile::new(path, &context), &context)?;
    let (mut tables, mut order): (Vec<Option<LogTable>>, Vec<usize>) = (Vec::new(), Vec::new());
    let mut cells = Cells::default();
    let broken = loop {
        let topic = match reader.advance() {
            Ok(Some(topic)) => topic,
            Ok(None) => break None,
            Err(broken) => break Some(broken),
        };
        cells.clear();
        let wrong = reader.decode(&mut cells).err();
        tables.resize_with(reader.topics().len().max(tables.len()), || None);
        let columns = reader.columns(topic);
        let table = tables[topic].get_or_insert_with(|| {
            order.push(topic);
            let about = reader.topics()[topic].clone();
            let mut table = LogTable::of_topic(path, format, about, columns);
            table.role = reader.role(topic);
            for (column, of) in table.columns.iter_mut().enumerate() {
                of.label = reader.label(topic, column);
            }
            table
        });
        table.add(&One {
            columns,
            cells: &cells,
            wrong,
        });
    };
    if let (true, Some(broken)) = (order.is_empty(), &broken) {
        return Err(DataError::new(path.display().to_string(), broken.to_string()).into());
    }
    let mut tables: Vec<LogTable> = order.into_iter().filter_map(|topic| tables[topic].take()).collect();
    for table in &mut tables {
        table.broken = broken.as_ref().map(ToString::to_string);
        table.remarks = reader.remarks();
    }
    Ok(tables)
}
