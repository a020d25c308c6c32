//! Tables with units, and what draws them.
//!
//! What is shown of a result is a [`Page`] of sections and tables, built once from the data of the result and drawn by
//! three back ends: [`text`] for a terminal, [`json`] for programs, [`html`] for the report. Names, units and digits
//! are decided in the tree ([`Cell`], [`Unit`]), so that no back end can differ from another in them.

pub mod html;
pub mod json;
mod number;
pub mod text;
mod tree;
mod unit;

pub use number::{NONE, fixed, short, significant};
pub use tree::{Cell, Column, Page, Row, Section, Table};
pub use unit::Unit;
