//! Checks recorded data against their declarations: axes, signs, units and lever arms. It compares channels that
//! measure the same motion.
//!
//! | declared | compared with |
//! |---|---|
//! | position | the origin of the design, the position of the reference (`place.rs`) |
//! | velocity | the slope of the position of its source, or of another (`world.rs`) |
//! | stamps of an inertial unit | any source that measures rotation, shifted against it (`clock.rs`) |
//! | attitude, heading | the course; forces and rates of the inertial unit together (`attitude.rs`) |
//! | specific force | gravity; the slope of the velocity, ahead and to the right of the course |
//! | angular rate | the rotation of the attitude, or of the course and of the direction of gravity |
//! | magnetic field | the rotation of the field in an inertial unit, and of the unit in the field (`field.rs`) |
//! | pressure of the air, field, rows of an inertial unit | the values that occur on Earth (`range.rs`) |
//! | fixed lever arms, mountings, scales, declinations, latencies of sensors; signs, units and quarter turns of sensors that the filter does not follow | the estimates or the fit of the design's filter with other values (`free/`) |
//!
//! A comparison is a regression of the expected value along one axis on each measured axis (`regression.rs`). A mistake
//! is reported only if another signed axis, or a factor such as 57.3, explains the data clearly better than the
//! declaration. This must hold in most parts of the log. If the data cannot decide, nothing is reported.
//!
//! The course of anything that moves faster than 2 m/s shows that forward is x. An object that drifts sideways as often
//! as it moves forward shows no correlation and is not judged by its course. Items that could not be judged are listed
//! with advice on what would help.
//!
//! Without data, the units that the names of columns state are compared with the declared units (`header.rs`).

mod attitude;
mod clock;
mod compare;
mod declared;
mod field;
mod free;
mod header;
mod heading;
mod judge;
mod log;
mod mistake;
mod motion;
mod place;
mod range;
mod regression;
mod unit;
mod upright;
mod world;

pub use header::units;
pub use judge::{Comparison, Judged, Step, judge};
