//! From a document to a design, with every mistake of reading, of the simulated world and of assembling.

mod selection;
mod worlds;

pub use selection::{BASE, Selection};
pub(crate) use worlds::{faults, no_origin};

use crate::assembly;
use crate::config::{Diagnostics, Document};
use crate::design::{Design, Draft, FurtherTable, explain};

/// The design of `document`, which can be assembled.
///
/// # Errors
/// Every mistake of reading, of the declared sources and of assembling.
pub fn build(document: Document) -> Result<Design, Diagnostics> {
    let (draft, d) = draft(document);
    match draft.whole() {
        Ok(design) => d.unless_errors(design),
        Err(_) => Err(d),
    }
}

/// The readable part of a document, with the mistakes of reading and of assembling it.
pub(crate) fn draft(document: Document) -> (Draft, Diagnostics) {
    let mut d = Diagnostics::new();
    let draft = Draft::of(document, &mut d);
    assembly::check(&draft, &mut d);
    worlds::check(&draft, &mut d);
    for table in FurtherTable::all() {
        (table.check)(&draft.document, &mut d);
    }
    explain(draft.document.root(), &mut d);
    (draft, d)
}
