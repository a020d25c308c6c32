//! Tables at the top of a design that other crates read.

use crate::config::{Diagnostics, Document};
use schemars::Schema;

/// A table that another crate reads: it is known where the crate is linked, checked with the design, and part of the
/// schema.
///
/// ```
/// use fusion::design::FurtherTable;
/// use fusion::inventory;
///
/// inventory::submit! {
///     FurtherTable {
///         name: "logbook",
///         schema: Some(|| schemars::schema_for!(std::collections::BTreeMap<String, String>)),
///         check: |_document, _diagnostics| {},
///     }
/// }
///
/// let (document, _) = fusion::config::Document::parse("design.toml", "logbook = { }");
/// let told = fusion::examine::build(document).unwrap_err().to_string();
/// assert!(!told.contains("unknown table `logbook`"), "{told}");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FurtherTable {
    /// Its name in the design.
    pub name: &'static str,
    /// Its fields as JSON Schema; `None` for a table of registered blocks, whose schema is known.
    pub schema: Option<fn() -> Schema>,
    /// Reports the mistakes of the table, where the document has it.
    pub check: fn(&Document, &mut Diagnostics),
}

crate::inventory::collect!(FurtherTable);

impl FurtherTable {
    /// Those of all linked crates, by name.
    pub(crate) fn all() -> Vec<&'static Self> {
        let mut all: Vec<_> = crate::inventory::iter::<Self>.into_iter().collect();
        all.sort_by_key(|table| table.name);
        all
    }
}
