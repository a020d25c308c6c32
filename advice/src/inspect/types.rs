//! Quantities of message types whose fields have a defined meaning: the usual ones of ROS.
//!
//! Covariances of ROS are matrices row by row. Those of a position are along east, north, up.

use super::signal::Kind;

/// Quantities of a message type.
pub(super) type Fields = &'static [(Kind, &'static [&'static str], &'static str)];

const IMU: Fields = &[
    (
        Kind::AngularRate,
        &["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"],
        "rad/s",
    ),
    (
        Kind::SpecificForce,
        &["linear_acceleration.x", "linear_acceleration.y", "linear_acceleration.z"],
        "m/s^2",
    ),
    (
        Kind::Quaternion,
        &["orientation.w", "orientation.x", "orientation.y", "orientation.z"],
        "",
    ),
];
const FIX: Fields = &[
    (Kind::Geodetic, &["latitude", "longitude", "altitude"], "deg"),
    (
        Kind::PositionSigma,
        &["position_covariance[4]", "position_covariance[0]", "position_covariance[8]"],
        "m^2",
    ),
];
/// Wheels give no sideways velocity: then the forward one is a speed.
const ODOMETRY: Fields = &[
    (
        Kind::BodyVelocity,
        &["twist.twist.linear.x", "-twist.twist.linear.y", "-twist.twist.linear.z"],
        "m/s",
    ),
    (Kind::Speed, &["twist.twist.linear.x"], "m/s"),
    (Kind::YawRate, &["-twist.twist.angular.z"], "rad/s"),
];
const FIELD: Fields = &[(
    Kind::MagneticField,
    &["magnetic_field.x", "magnetic_field.y", "magnetic_field.z"],
    "T",
)];
const PRESSURE: Fields = &[(Kind::Pressure, &["fluid_pressure"], "Pa")];

/// The quantities of a message type; `None` if its fields are not known here.
pub(super) fn fields(message_type: &str) -> Option<Fields> {
    let name = message_type.replacen("/msg/", "/", 1);
    Some(match name.as_str() {
        "sensor_msgs/Imu" => IMU,
        "sensor_msgs/NavSatFix" => FIX,
        "sensor_msgs/MagneticField" => FIELD,
        "sensor_msgs/FluidPressure" => PRESSURE,
        "nav_msgs/Odometry" => ODOMETRY,
        _ => return None,
    })
}
