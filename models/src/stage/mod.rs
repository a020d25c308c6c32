//! Stages: streams in, a stream out.

pub mod compass;
pub mod gravity_gradient;
pub mod once_per;
pub mod periodic;
pub mod stationarity;
pub mod steady_force;
pub mod still;
pub mod track_velocity;
pub mod usbl_fix;
