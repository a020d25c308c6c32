//! State: named blocks on manifolds, and typed handles to them.

mod layout;
mod manifold;
mod name;
mod quantity;
mod space;

/// The largest 1σ of an attitude \[rad\] about which is linearised: the sine of 15° is within 1 % of the angle.
pub(crate) const ALIGNED: f64 = 15.0 * core::f64::consts::PI / 180.0;

pub use layout::{Block, Declaration, Dynamics, Layout, LayoutBuilder, LayoutError, StateRole};
pub use manifold::{Angle, Attitude, Geodetic, Kind, Manifold, Position, Scalar, Tangent, Vector, Velocity, wrap};
pub use name::QuantityName;
pub use quantity::{Param, Quantity, Signal, Slot, View};
pub use space::{AxisUnit, Space};
