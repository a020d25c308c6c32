//! Stages: streams in, a stream out.

pub mod periodic;
pub mod stationarity;
pub mod still;
