//! Measurement models, one file each.

mod attitude;
mod barometer;
mod body_velocity;
mod depth;
mod dvl;
mod gnss_position;
mod gnss_velocity;
mod gravity_direction;
mod heading;
mod height;
mod horizontal_position;
mod horizontal_velocity;
mod landmark;
mod magnetometer;
mod pseudorange;
mod pseudorange_rate;
mod range;
mod receiver_clock;
mod satellite;
mod track_odometry;
mod usbl;
mod usbl_position;
mod vertical;
mod vessel_pose;
mod yaw_rate;
mod zero_angular_rate;
mod zero_velocity;

/// Axes of rows resolved in navigation axes.
const NED: &[&str] = &["north", "east", "down"];
/// Axes of rows resolved in the axes of a body or sensor.
const XYZ: &[&str] = &["x", "y", "z"];
