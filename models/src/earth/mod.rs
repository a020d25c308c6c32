//! The Earth: gravity, rotation rates, and the frames a position is written in.
//!
//! The ellipsoid and the geodetic manifold themselves live in
//! [`fusion_core::geometry::wgs84`].

pub mod frames;
pub mod gravity;
pub mod magnetic;
pub mod rates;
pub mod utm;

pub use frames::LocalFrame;
pub use gravity::{Gravity, STANDARD_GRAVITY};
pub use rates::{LocalEarth, SPEED_OF_LIGHT};
