//! Mistakes of a block that was read, shown at the place of the field.

use super::{Diagnostic, Node};
use fusion_models::block::BuildError;

impl Node {
    /// The error of a block declared by this table: at the field it names, or at the table's name.
    pub fn locate(&self, error: &BuildError) -> Diagnostic {
        let place = match error.field.as_str() {
            "" => self.name_place(),
            field => self.place_of(field),
        };
        let diagnostic = Diagnostic::error(error.message.as_str()).at(place);
        match &error.help {
            Some(help) => diagnostic.help(help.as_str()),
            None => diagnostic,
        }
    }
}
