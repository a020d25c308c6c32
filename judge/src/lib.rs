//! Judging a design by many runs: campaigns of many seeds, and stress by declared and drawn faults.
//!
//! A program that links this crate checks the table `[stress]` of a design when the design is read.

pub mod campaign;
pub mod stress;
