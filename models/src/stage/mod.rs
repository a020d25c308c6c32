//! Stages: streams in, a stream out.

pub mod attitude_reference;
pub mod compass;
pub mod periodic;
pub mod stationarity;
pub mod steady_force;
pub mod still;
