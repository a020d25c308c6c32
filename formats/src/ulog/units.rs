//! The units that the messages of PX4 define and that the names of their fields do not say.

/// Messages, fields and their unit. The fields of an array have the name before its bracket.
const UNITS: [(&[&str], &[&str], &str); 11] = [
    (&["sensor_gps", "vehicle_gps_position"], &["lat", "lon"], "1e-7 deg"),
    (&["sensor_gps", "vehicle_gps_position"], &["alt", "alt_ellipsoid"], "mm"),
    (&["sensor_gps", "vehicle_gps_position"], &["eph", "epv"], "m"),
    (&["vehicle_global_position", "vehicle_global_position_groundtruth"], &["lat", "lon"], "deg"),
    (
        &["vehicle_global_position", "vehicle_global_position_groundtruth"],
        &["alt", "alt_ellipsoid", "eph", "epv"],
        "m",
    ),
    (
        &["vehicle_local_position", "vehicle_local_position_groundtruth"],
        &["x", "y", "z", "eph", "epv"],
        "m",
    ),
    (
        &["vehicle_local_position", "vehicle_local_position_groundtruth"],
        &["vx", "vy", "vz", "evh", "evv"],
        "m/s",
    ),
    (&["sensor_gyro"], &["x", "y", "z"], "rad/s"),
    (&["sensor_accel"], &["x", "y", "z"], "m/s^2"),
    (&["sensor_mag"], &["x", "y", "z"], "gauss"),
    (&["vehicle_angular_velocity"], &["xyz"], "rad/s"),
];

/// The unit of a field.
pub(super) fn of(message: &str, field: &str) -> Option<&'static str> {
    let name = field.split('[').next().unwrap_or_default();
    let found = UNITS.iter().find(|(messages, fields, _)| messages.contains(&message) && fields.contains(&name));
    found.map(|(.., unit)| *unit)
}
