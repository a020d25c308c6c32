//! Why a block could not be built.

#![cfg(feature = "declare")]

use crate::units::UnitError;
use fusion_core::state::LayoutError;
use thiserror::Error;

/// Why a block could not be built. `field` names the culprit within the block's table.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{message}")]
pub struct BuildError {
    /// Path of the field inside the block, empty for the block as a whole.
    pub field: String,
    /// The error.
    pub message: String,
    /// How to correct it.
    pub help: Option<String>,
}

impl BuildError {
    /// About the block as a whole.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            field: String::new(),
            message: message.into(),
            help: None,
        }
    }

    /// About one field.
    pub fn at(field: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            message: message.into(),
            help: None,
        }
    }

    /// About a quantity of a field, or about its wrong element.
    pub fn quantity(field: &str, error: &UnitError) -> Self {
        Self::at(error.path(field), error.to_string())
    }

    /// With advice.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// For an error of a block that is at `path` inside another block.
    #[must_use]
    pub fn within(self, path: impl Into<String>) -> Self {
        let mut field = path.into();
        if !self.field.is_empty() {
            field.push('.');
            field.push_str(&self.field);
        }
        Self { field, ..self }
    }
}

impl From<LayoutError> for BuildError {
    fn from(error: LayoutError) -> Self {
        Self::new(error.to_string())
    }
}

impl From<UnitError> for BuildError {
    fn from(error: UnitError) -> Self {
        Self::new(error.to_string())
    }
}
