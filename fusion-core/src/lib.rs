//! The estimator of the fusion framework.
//!
//! Named state blocks on manifolds, process and measurement traits with block Jacobians in one
//! canonical chart, and Kalman backends that are three independent choices: chart, update, form.
//!
//! What is absent here: no sensor, no file, no clock, no thread, no global generator. A run is a
//! function of its inputs.

pub mod chart;
pub mod consistency;
pub mod covariance;
pub mod filter;
pub mod gate;
pub mod geometry;
pub mod health;
pub mod linear;
pub mod loss;
pub mod memory;
pub mod model;
pub mod runner;
pub mod smoother;
pub mod state;
pub mod testing;
pub mod time;

pub use state::{Param, Quantity, Slot};
pub use time::Time;
