//! Logs of messages: one file, several topics, each with its own columns.
//!
//! A format implements [`MessageReader`], and declares its sources with `message_format!`. The first message of a
//! topic defines its columns. A later message with fewer elements has empty cells, and further elements are not read.
//!
//! Memory   one message of each topic, and the messages that wait for their source: [`MOST_WAITING`] bytes

mod cells;
mod pass;
mod rows;
mod spec;
mod tables;
#[cfg(test)]
mod tests;

pub use crate::LONGEST_ARRAY;
pub use cells::Cells;
pub use pass::MOST_WAITING;
pub use rows::{Read, open};
#[allow(unused_imports, reason = "a program may be built without any format")]
pub(crate) use spec::message_format;
pub use tables::tables;

use fusion::rows::SourceError;
use fusion::source::table::{Role, Topic};
use fusion::source::{DataFile, OpenContext};

/// Reads the messages of a log in the order of the file.
pub trait MessageReader: Sized + Send + 'static {
    /// Opens a log. A file whose first bytes have another format is an error.
    ///
    /// # Errors
    /// It cannot be opened, or is not a log of this format.
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError>;

    /// Makes each element of a list of a topic a message, and returns the name of their topic.
    ///
    /// # Errors
    /// The messages of this format have no lists of messages.
    fn split(&mut self, _topic: &str, _list: &str) -> Result<String, String> {
        Err("the messages of this format have no lists of messages".to_owned())
    }

    /// Reads on to the next message, and returns the number of its topic in [`topics`](Self::topics). `None` after
    /// the last one.
    ///
    /// # Errors
    /// The file is cut off or damaged, and nothing more can be read.
    fn advance(&mut self) -> Result<Option<usize>, Broken>;

    /// The topics known so far. A topic keeps its number.
    fn topics(&self) -> &[Topic];

    /// The columns of a topic, as its first message defined them. The first one has the usual stamps.
    fn columns(&self, topic: usize) -> &[String];

    /// The meaning of a column, if the type of the messages defines more than its name says: another name, the unit in
    /// brackets, as in `lat [1e-7 deg]`. `inspect` reads it in place of the name.
    fn label(&self, _topic: usize, _column: usize) -> Option<String> {
        None
    }

    /// The role of a topic, if the type of its messages shows it.
    fn role(&self, _topic: usize) -> Role {
        Role::Unknown
    }

    /// Remarks of the log about itself, such as drop-outs of the logger. They are complete after the last message.
    fn remarks(&self) -> Vec<String> {
        Vec::new()
    }

    /// Selects the columns of a topic that are used. A format that can read them alone returns the columns whose cells
    /// [`decode`](Self::decode) adds from now on: in order, and at least these. `None`: it adds all cells.
    fn select(&mut self, _topic: usize, _columns: &[usize]) -> Option<Vec<usize>> {
        None
    }

    /// Adds the cells of the current message, one for each column of its topic, or for each column that it selected.
    /// Cells that are missing at the end are empty.
    ///
    /// # Errors
    /// The mistake of this message. The next one can be read.
    fn decode(&mut self, cells: &mut Cells) -> Result<(), String>;
}

/// The place where a log is cut off or damaged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broken {
    /// The number of bytes before the damage, if it is known.
    pub at: Option<u64>,
    /// The damage.
    pub message: String,
}

impl Broken {
    /// After this number of bytes.
    pub fn at(byte: u64, message: impl Into<String>) -> Self {
        Self {
            at: Some(byte),
            message: message.into(),
        }
    }
}

impl core::fmt::Display for Broken {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.at {
            Some(byte) => write!(f, "after byte {byte}: {}", self.message),
            None => f.write_str(&self.message),
        }
    }
}
