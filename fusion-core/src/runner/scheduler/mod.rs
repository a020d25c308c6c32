//! The scheduler: serves measurements, stages and initialisers, and drives the estimator.
//!
//! It gets rows when they are due, with the circumstances in which they are used as values, and reports events. It
//! starts the filter once its initialisers can write the first belief. It knows no queue and no input.
//!
//! Time offsets may be estimated. A row of such a sensor is queued at the earliest time at which it may be valid, stamp
//! − `most`. At that time the scheduler reads the offset τ̂, and the row is queued again at stamp − τ̂. By then exactly
//! the rows that are valid earlier have been used: τ̂ does not depend on the order of arrival. The offset may have
//! changed by the time the row is served, or the row came late from a stage. Then
//! [`Lateness`](crate::filter::Lateness) corrects the rest to first order.

mod calibration;
mod realign;
mod restart;
mod schedule;
mod sensors;
mod stages;
mod starter;
#[cfg(test)]
mod tests;

pub(super) use schedule::Scheduler;
pub(super) use sensors::{Circumstances, Waiting};
pub(super) use stages::Emission;
