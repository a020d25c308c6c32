//! The kinds of messages of PX4: their role, and what the names of their fields do not say.

use fusion::source::table::Role;

/// Messages of instruments. Most others begin with `sensor_`.
const MEASUREMENTS: [&str; 10] = [
    "vehicle_imu",
    "vehicle_gps_position",
    "vehicle_magnetometer",
    "vehicle_air_data",
    "vehicle_visual_odometry",
    "vehicle_mocap_odometry",
    "vehicle_optical_flow",
    "airspeed",
    "distance_sensor",
    "wheel_encoders",
];

/// Messages that begin with `sensor_` and are no measurements.
const OF_SENSORS: [&str; 5] = [
    "sensor_selection",
    "sensor_correction",
    "sensor_preflight_mag",
    "sensor_preflight_imu",
    "sensor_hygrometer",
];

/// Estimates of the vehicle, after `vehicle_` or `estimator_`.
const ESTIMATES: [&str; 4] = ["attitude", "local_position", "global_position", "odometry"];

/// The role of messages with this name.
pub(super) fn role(message: &str) -> Role {
    let is_of_sensor = message.starts_with("sensor_") && !OF_SENSORS.contains(&message);
    let estimate = ["vehicle_", "estimator_"].iter().find_map(|start| message.strip_prefix(start));
    match () {
        () if is_of_sensor || MEASUREMENTS.contains(&message) => Role::Measurement,
        () if message.ends_with("_groundtruth") => Role::Truth,
        () if estimate.is_some_and(|of| ESTIMATES.contains(&of)) => Role::Estimate,
        () => Role::Other,
    }
}

/// Fields and their meaning.
type Meanings = &'static [(&'static str, &'static str)];

/// Messages, and what their fields mean: a name with a unit.
const MEANINGS: [(&[&str], Meanings); 6] = [
    (
        &["sensor_gps", "vehicle_gps_position"],
        &[
            ("lat", "lat [1e-7 deg]"),
            ("lon", "lon [1e-7 deg]"),
            ("alt", "alt [mm]"),
            ("alt_ellipsoid", "alt_ellipsoid [mm]"),
            ("eph", "eph [m]"),
            ("epv", "epv [m]"),
        ],
    ),
    (
        &[
            "vehicle_global_position",
            "vehicle_global_position_groundtruth",
            "estimator_global_position",
        ],
        &[
            ("lat", "lat [deg]"),
            ("lon", "lon [deg]"),
            ("alt", "alt [m]"),
            ("alt_ellipsoid", "alt_ellipsoid [m]"),
        ],
    ),
    // Its axes are north, east and down. Its reference is a constant.
    (
        &[
            "vehicle_local_position",
            "vehicle_local_position_groundtruth",
            "estimator_local_position",
        ],
        &[
            ("x", "north [m]"),
            ("y", "east [m]"),
            ("z", "down [m]"),
            ("vx", "v_north [m/s]"),
            ("vy", "v_east [m/s]"),
            ("vz", "v_down [m/s]"),
            ("ref_lat", "state of the reference"),
            ("ref_lon", "state of the reference"),
        ],
    ),
    (
        &["sensor_gyro"],
        &[("x", "gyro_x [rad/s]"), ("y", "gyro_y [rad/s]"), ("z", "gyro_z [rad/s]")],
    ),
    (
        &["sensor_accel"],
        &[("x", "acc_x [m/s^2]"), ("y", "acc_y [m/s^2]"), ("z", "acc_z [m/s^2]")],
    ),
    (
        &["sensor_mag"],
        &[("x", "mag_x [gauss]"), ("y", "mag_y [gauss]"), ("z", "mag_z [gauss]")],
    ),
];

/// The meaning of a field.
pub(super) fn meaning(message: &str, field: &str) -> Option<&'static str> {
    let (_, fields) = MEANINGS.iter().find(|(messages, _)| messages.contains(&message))?;
    fields.iter().find(|(name, _)| *name == field).map(|(_, meaning)| *meaning)
}
