//! Stages: streams in, a stream out.

pub mod attitude_reference;
pub mod periodic;
pub mod stationarity;
pub mod still;
