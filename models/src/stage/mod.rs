//! Stages: streams in, a stream out.

pub mod compass;
pub mod elevation_noise;
pub mod gravity_gradient;
pub mod klobuchar;
pub mod once_per;
pub mod periodic;
pub mod saastamoinen;
pub mod satellite;
pub mod stationarity;
pub mod steady_force;
pub mod still;
pub mod track_velocity;
pub mod usbl_fix;
