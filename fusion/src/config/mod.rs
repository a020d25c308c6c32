//! Reading a declaration, with every mistake pointed at where it was written.
//!
//! ```text
//! text ── Document::parse ──▶ Node tree ── compose, overlay, set ──▶ Node tree ── read, read_block ──▶ specs
//!                                  │                               │                              │
//!                                  └──────────────── Diagnostics ◀─┴──────────────────────────────┘
//! ```
//!
//! Every [`Node`] remembers its [`Place`] in the file, or in the command-line argument that set it.
//! A table with a `type` reads as a trait object or as an enum, wherever it stands:
//! `gate = { type = "nis", probability = 0.99 }`.
//!
//! Not here  any knowledge of filters: which blocks exist and what their fields mean.

mod diagnostic;
mod document;
mod edit;
mod fault;
mod flat;
mod include;
mod located;
#[cfg(test)]
mod mistakes;
mod proposal;
mod read;
mod reader;
mod text;

pub use diagnostic::{Diagnostic, Diagnostics, Place, Severity, Source, did_you_mean};
pub use document::{Changes, Document, Entry, Node, Value};
pub use include::Files;
pub(crate) use include::INCLUDE;
pub use proposal::Edit;
pub(crate) use text::is_utf_16;
pub use text::{Unread, read_piped_text, read_text};
