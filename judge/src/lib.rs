//! Judging a design: campaigns of many seeds, stress by declared and drawn faults, its error budget, the likelihood of its
//! innovations, tuning of its noises by it, and the states that its motion determines.
//!
//! A program that links this crate checks the table `[stress]` of a design when the design is read, and finds the
//! likelihood among the sections of a result.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod bisect;
pub mod budget;
pub mod campaign;
pub mod likelihood;
pub mod observability;
pub mod part;
pub mod stress;
pub mod tune;
