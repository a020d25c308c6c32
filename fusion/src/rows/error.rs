//! Errors of a source: of its declaration, or of its data.

use crate::config::{Diagnostic, Node, Place};
use fusion_models::block::BuildError;
use thiserror::Error;

/// The unit in which a text file counts its rows.
pub const LINE: &str = "line";

/// Something wrong in a file of data.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{}: {message}", self.place())]
pub struct DataError {
    /// The file.
    pub file: String,
    /// Its line, from 1, or the number of its message in a log of messages.
    pub line: Option<usize>,
    /// The unit of `line`: [`LINE`], or `message`.
    pub counted: &'static str,
    /// The error.
    pub message: String,
    /// How to correct it.
    pub help: Option<String>,
}

impl DataError {
    /// About the file as a whole.
    pub fn new(file: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            line: None,
            counted: LINE,
            message: message.into(),
            help: None,
        }
    }

    /// In this line.
    #[must_use]
    pub fn line(self, line: usize) -> Self {
        Self { line: Some(line), ..self }
    }

    /// In this line or message.
    #[must_use]
    pub fn row(self, counted: &'static str, number: usize) -> Self {
        Self {
            line: Some(number),
            counted,
            ..self
        }
    }

    /// With advice.
    #[must_use]
    pub fn help(self, help: impl Into<String>) -> Self {
        Self {
            help: Some(help.into()),
            ..self
        }
    }

    fn place(&self) -> String {
        match self.line {
            Some(line) if self.counted == LINE => format!("{}:{line}", self.file),
            Some(number) => format!("{}, {} {number}", self.file, self.counted),
            None => self.file.clone(),
        }
    }
}

/// Points at the line of the data file.
impl From<&DataError> for Diagnostic {
    fn from(error: &DataError) -> Self {
        let place = Place::File {
            path: if error.counted == LINE { error.file.clone() } else { error.place() },
            line: error.line.filter(|_| error.counted == LINE),
        };
        let diagnostic = Self::error(error.message.as_str()).at(&place);
        match &error.help {
            Some(help) => diagnostic.help(help.as_str()),
            None => diagnostic,
        }
    }
}

/// Why a source cannot be opened, or not be read any further.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum SourceError {
    /// Mistakes of the declaration, each naming its field.
    #[error("{}", .0.iter().map(|e| format!("{}: {e}", e.field)).collect::<Vec<_>>().join("; "))]
    Declared(Vec<BuildError>),
    /// Something wrong in the data.
    #[error(transparent)]
    Data(Box<DataError>),
    /// The data have ended, and no row of them could be used.
    #[error(transparent)]
    NoRow(Box<DataError>),
}

impl SourceError {
    /// As they are shown where nothing but the file is declared: without a place in a declaration.
    #[must_use]
    pub fn of_file(&self) -> Vec<Diagnostic> {
        match self {
            Self::Declared(errors) => errors.iter().map(|error| Diagnostic::error(error.to_string())).collect(),
            Self::Data(error) | Self::NoRow(error) => vec![error.as_ref().into()],
        }
    }

    /// As they are shown: a mistake of the declaration points into `declaration`, the table of the
    /// source; a fault of the data at its line.
    #[must_use]
    pub fn diagnostics(&self, declaration: &Node) -> Vec<Diagnostic> {
        match self {
            Self::Declared(errors) => errors.iter().map(|error| declaration.locate(error)).collect(),
            Self::Data(error) | Self::NoRow(error) => vec![error.as_ref().into()],
        }
    }
}

impl From<DataError> for SourceError {
    fn from(error: DataError) -> Self {
        Self::Data(Box::new(error))
    }
}

impl From<BuildError> for SourceError {
    fn from(error: BuildError) -> Self {
        Self::Declared(vec![error])
    }
}

impl From<Vec<BuildError>> for SourceError {
    fn from(errors: Vec<BuildError>) -> Self {
        Self::Declared(errors)
    }
}
