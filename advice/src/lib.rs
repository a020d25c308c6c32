//! Advice: the probable meaning of logs without a description, declarations that the data contradict, and findings.
//!
//! | module | has |
//! |---|---|
//! | [`inspect`] | the probable meaning of the columns of logs, and a first design |
//! | [`frames`] | wrong axes, signs, units and fixed parameters, found by comparing recorded channels |
//! | [`findings`] | what to look at next, from the statistics of a run |
//! | [`rules`] | the rules of findings and frames, and the file with their edits |
//! | [`allan`] | the noises of an inertial unit, from a log at rest |
//!
//! A program that links this crate gets its findings in the summary of every run
//! ([`Advisor`](fusion::run::Advisor)).

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod allan;
pub mod findings;
pub mod frames;
pub mod inspect;
pub mod rules;
