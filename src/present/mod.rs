//! Results as people read them.
//!
//! What is shown of a result is a [`Page`] of sections and tables, built once from the data of the
//! result ([`run`], [`comparison`], [`campaign`]) and drawn by three back ends: [`text`] for a
//! terminal, [`json`] for programs, [`html`] for the report. Names, units and digits are decided
//! in the tree ([`Cell`], [`Unit`]), so that no back end can differ from another in them.
//!
//! `summary.json` is not drawn from the tree: it is the data themselves, in SI and full precision,
//! with keys that programs rely on.

mod brief;
pub mod campaign;
pub mod comparison;
mod control;
mod drawn;
pub mod health;
pub mod html;
pub mod json;
mod judged;
mod number;
pub mod run;
mod sensors;
mod stress;
pub mod text;
mod trajectory;
mod tree;
mod unit;

pub(crate) use brief::before_the_start;
pub use number::short;
pub use sensors::residual_rows;
pub use tree::{Cell, Column, Page, Row, Section, Table};
pub use unit::Unit;
