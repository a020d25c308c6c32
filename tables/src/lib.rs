//! Tables with units, and their output formats.
//!
//! A displayed result is a [`Page`] of sections and tables. It is built once from the data of the result. Three back
//! ends draw it: [`text`] for a terminal, [`json`] for programs, [`html`] for the report. The tree ([`Cell`], [`Unit`])
//! decides names, units and digits, so they are the same in all back ends.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod html;
pub mod json;
mod number;
pub mod text;
mod tree;
mod unit;

pub use number::{NONE, fixed, short, significant};
pub use tree::{Cell, Column, Page, Section, Table, TableRow};
pub use unit::Unit;
