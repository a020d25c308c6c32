//! Edits of a design as values, which can be shown, tried and written.

use super::diagnostic::{Diagnostic, Place};
use super::document::{Document, Value};
use core::fmt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// One change of a design: a key gets a value, or is left out.
///
/// ```
/// use fusion::config::{Document, Edit};
///
/// let (mut document, _) = Document::parse("drive.toml", "[source.gnss]\nunit = 'rad'\nscale = 2\n");
/// let gnss = "source.gnss";
/// document.apply(&Edit::set("unit", "\"deg\"").within(gnss))?;
/// document.apply(&Edit::leave_out("scale").within(gnss))?;
/// assert_eq!(document.root().at(gnss).map(|node| node.inline()), Some("{ unit = \"deg\" }".to_owned()));
/// # Ok::<(), fusion::config::Diagnostic>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Edit {
    /// The dotted path of the key, from the root of the design; an element of an array by its index.
    pub key: String,
    /// The value as TOML; `None` leaves the key out.
    pub value: Option<String>,
}

impl Edit {
    /// Gives `key` a value, written as TOML.
    #[must_use]
    pub fn set(key: impl Into<String>, value: impl Into<String>) -> Self {
        Self {
            key: key.into(),
            value: Some(value.into()),
        }
    }

    /// Leaves `key` out.
    #[must_use]
    pub fn leave_out(key: impl Into<String>) -> Self {
        Self {
            key: key.into(),
            value: None,
        }
    }

    /// The same edit of a key inside the table at the path `table`.
    #[must_use]
    pub fn within(self, table: &str) -> Self {
        Self {
            key: format!("{table}.{}", self.key),
            ..self
        }
    }
}

/// The advice to make this edit: ``write `key = value` ``, or ``leave out `key` ``.
impl fmt::Display for Edit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.value {
            Some(value) => write!(f, "write `{} = {value}`", self.key),
            None => write!(f, "leave out `{}`", self.key),
        }
    }
}

impl Document {
    /// Makes an edit.
    ///
    /// # Errors
    /// The path goes through a single value, or the key to leave out is not there.
    pub fn apply(&mut self, edit: &Edit) -> Result<(), Diagnostic> {
        if let Some(value) = &edit.value {
            return self.set(&format!("{}={value}", edit.key));
        }
        let (path, key) = edit.key.rsplit_once('.').unwrap_or(("", &edit.key));
        let root = Arc::make_mut(&mut self.root);
        let mut keys = path.split('.').filter(|key| !key.is_empty());
        let table = keys.try_fold(root, |node, key| node.get_mut(key));
        let entries = table.and_then(|node| match &mut node.value {
            Value::Table { entries, .. } => Some(entries),
            _ => None,
        });
        let missing = || Diagnostic::error(format!("there is no `{}` to leave out", edit.key)).at(&Place::Nowhere);
        let entries = entries.ok_or_else(missing)?;
        let at = entries.iter().position(|entry| entry.key == key).ok_or_else(missing)?;
        entries.remove(at);
        Ok(())
    }
}
