//! Rotations and the ellipsoid: the geometry that states live on.

pub mod gamma;
pub mod so3;
pub mod wgs84;
