//! Judging a design by many runs: campaigns of many seeds, stress by declared and drawn faults, and tuning of its noises.
//!
//! A program that links this crate checks the table `[stress]` of a design when the design is read.

pub mod campaign;
pub mod stress;
pub mod tune;
