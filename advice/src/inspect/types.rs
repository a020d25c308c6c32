//! Quantities of message types whose fields have a defined meaning: the usual ones of ROS.
//!
//! Covariances of ROS are matrices row by row. Those of a position are along east, north, up. Those of a pose or of a
//! twist have six rows: along x, y, z, then about x, y, z. A covariance of zero is unknown, and so is one that begins
//! with −1 (`sensor_msgs/Imu`).

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
    (
        Kind::AttitudeSigma,
        &[
            "orientation_covariance[0]",
            "orientation_covariance[4]",
            "orientation_covariance[8]",
        ],
        "rad^2",
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
/// Metres of a map or a room: x, y, z as east, north, up.
const POSE: Fields = &[
    (
        Kind::Local,
        &["pose.pose.position.y", "pose.pose.position.x", "-pose.pose.position.z"],
        "m",
    ),
    (
        Kind::PositionSigma,
        &["pose.covariance[7]", "pose.covariance[0]", "pose.covariance[14]"],
        "m^2",
    ),
    (
        Kind::Quaternion,
        &[
            "pose.pose.orientation.w",
            "pose.pose.orientation.x",
            "pose.pose.orientation.y",
            "pose.pose.orientation.z",
        ],
        "",
    ),
    (
        Kind::AttitudeSigma,
        &["pose.covariance[21]", "pose.covariance[28]", "pose.covariance[35]"],
        "rad^2",
    ),
];
/// Wheels give no sideways velocity: then the forward one is a speed.
const TWIST: Fields = &[
    (
        Kind::BodyVelocity,
        &["twist.twist.linear.x", "-twist.twist.linear.y", "-twist.twist.linear.z"],
        "m/s",
    ),
    (Kind::Speed, &["twist.twist.linear.x"], "m/s"),
    (Kind::YawRate, &["-twist.twist.angular.z"], "rad/s"),
    (
        Kind::BodyVelocitySigma,
        &["twist.covariance[0]", "twist.covariance[7]", "twist.covariance[14]"],
        "m^2/s^2",
    ),
    (Kind::SpeedSigma, &["twist.covariance[0]"], "m^2/s^2"),
    (Kind::YawRateSigma, &["twist.covariance[35]"], "rad^2/s^2"),
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
        "geometry_msgs/PoseWithCovarianceStamped" => POSE,
        "geometry_msgs/TwistWithCovarianceStamped" | "nav_msgs/Odometry" => TWIST,
        _ => return None,
    })
}
