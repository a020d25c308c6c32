//! Whether recorded data are what their declarations say: axes, signs, units and lever arms, judged by comparing
//! channels that tell of the same motion.
//!
//! | declared | compared with |
//! |---|---|
//! | position | the origin of the design, the position of the reference (`place.rs`) |
//! | velocity | the slope of the position of its source, or of another (`world.rs`) |
//! | stamps of an inertial unit | whatever tells of turns, shifted against it (`clock.rs`) |
//! | attitude, heading | the course; forces and rates of the inertial unit together (`redeclared.rs`) |
//! | specific force | gravity; the slope of the velocity, ahead and to the right of the course |
//! | angular rate | the turn of the attitude, or of the course and of the direction of gravity |
//! | magnetic field | how the field turns in an inertial unit, and the unit in the field (`field.rs`) |
//! | pressure of the air, field, rows of an inertial unit | what there is on Earth (`range.rs`) |
//! | fixed lever arms, mountings, scales, declinations, latencies of sensors; signs, units and quarter turns of what the filter does not follow | what the filter of the design makes of others in their place (`free/`) |
//!
//! A comparison is a regression of what is expected along one axis on each measured axis (`regression.rs`). A mistake
//! is told only where another signed axis, or a factor such as 57.3, explains the data clearly better than what is
//! declared, in most parts of the log; where the data cannot tell, nothing is said. That ahead is x is taken from the
//! course of whatever moves faster than 2 m/s: something that drifts sideways as often as it moves
//! ahead shows no correlation, and is not judged by its course. What could not be judged is listed with what would help.
//!
//! Without data, the units that the names of columns state are compared with those that are declared (`header.rs`).

mod clock;
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
mod redeclared;
mod regression;
mod upright;
mod world;

pub use header::units;
pub use judge::{Comparison, Judged, Step, judge};
