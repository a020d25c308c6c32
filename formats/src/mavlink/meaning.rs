//! The roles of messages, and what the names and units of their fields do not say.

use super::definition::{Field, Message};
use fusion::source::table::Role;

/// The role of a message.
pub(super) fn role(message: &str) -> Role {
    const MEASUREMENTS: [&str; 31] = [
        "HIGHRES_IMU",
        "RAW_IMU",
        "SCALED_IMU",
        "SCALED_IMU2",
        "SCALED_IMU3",
        "HIL_SENSOR",
        "GPS_RAW_INT",
        "GPS2_RAW",
        "GPS_INPUT",
        "HIL_GPS",
        "RAW_PRESSURE",
        "SCALED_PRESSURE",
        "SCALED_PRESSURE2",
        "SCALED_PRESSURE3",
        "AIRSPEED",
        "DISTANCE_SENSOR",
        "RANGEFINDER",
        "WATER_DEPTH",
        "WHEEL_DISTANCE",
        "RPM",
        "RAW_RPM",
        "OPTICAL_FLOW",
        "OPTICAL_FLOW_RAD",
        "HIL_OPTICAL_FLOW",
        "ATT_POS_MOCAP",
        "VICON_POSITION_ESTIMATE",
        "VISION_POSITION_ESTIMATE",
        "VISION_SPEED_ESTIMATE",
        "VISION_POSITION_DELTA",
        "GLOBAL_VISION_POSITION_ESTIMATE",
        "GLOBAL_POSITION_SENSOR",
    ];
    const ESTIMATES: [&str; 15] = [
        "ATTITUDE",
        "ATTITUDE_QUATERNION",
        "ATTITUDE_QUATERNION_COV",
        "LOCAL_POSITION_NED",
        "LOCAL_POSITION_NED_COV",
        "GLOBAL_POSITION_INT",
        "GLOBAL_POSITION_INT_COV",
        "CONTROL_SYSTEM_STATE",
        "ODOMETRY",
        "VFR_HUD",
        "ALTITUDE",
        "AHRS",
        "AHRS2",
        "AHRS3",
        "HIGH_LATENCY2",
    ];
    const TRUTHS: [&str; 4] = ["HIL_STATE", "HIL_STATE_QUATERNION", "SIM_STATE", "SIMSTATE"];
    match message {
        _ if MEASUREMENTS.contains(&message) => Role::Measurement,
        _ if ESTIMATES.contains(&message) => Role::Estimate,
        _ if TRUTHS.contains(&message) => Role::Truth,
        _ => Role::Other,
    }
}

/// The vector of an inertial unit, by an axis before its name; the same in all messages.
const VECTORS: [(&str, &str); 9] = [
    ("xacc", "acc_x"),
    ("yacc", "acc_y"),
    ("zacc", "acc_z"),
    ("xgyro", "gyro_x"),
    ("ygyro", "gyro_y"),
    ("zgyro", "gyro_z"),
    ("xmag", "mag_x"),
    ("ymag", "mag_y"),
    ("zmag", "mag_z"),
];

/// Fields and what their names mean.
type Meanings = &'static [(&'static str, &'static str)];

/// Messages, and what the names of their fields mean.
const MEANINGS: [(&[&str], Meanings); 4] = [
    (
        &["GPS_RAW_INT", "GPS2_RAW", "HIL_GPS"],
        &[("vel", "ground_speed"), ("vel_acc", "s_acc")],
    ),
    (
        &[
            "GLOBAL_POSITION_INT",
            "GLOBAL_POSITION_INT_COV",
            "HIL_STATE",
            "HIL_STATE_QUATERNION",
        ],
        &[("vx", "v_north"), ("vy", "v_east"), ("vz", "v_down")],
    ),
    (
        &["LOCAL_POSITION_NED", "LOCAL_POSITION_NED_COV"],
        &[
            ("x", "north"),
            ("y", "east"),
            ("z", "down"),
            ("vx", "v_north"),
            ("vy", "v_east"),
            ("vz", "v_down"),
        ],
    ),
    (
        &["SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3"],
        &[("press_abs", "pressure")],
    ),
];

/// Units of the definitions that designs write in another way.
const UNITS: [(&str, &str); 4] = [("degE7", "1e-7 deg"), ("degE5", "1e-5 deg"), ("m/s/s", "m/s^2"), ("mG", "mg")];

/// A field with its unit, if its definition says more than its name; `element` is the index of an array.
pub(super) fn label(message: &Message, field: &Field, element: Option<usize>) -> Option<String> {
    let of_message = MEANINGS.iter().find(|(messages, _)| messages.contains(&message.name));
    let meanings = of_message.map_or(&[][..], |(_, fields)| *fields).iter().chain(&VECTORS);
    let name = meanings
        .into_iter()
        .find(|(name, _)| *name == field.name)
        .map(|(_, meaning)| *meaning);
    let unit = field
        .unit
        .map(|unit| UNITS.iter().find(|(of, _)| *of == unit).map_or(unit, |(_, unit)| *unit));
    let element = element.map_or_else(String::new, |k| format!("[{k}]"));
    match (name, unit) {
        (None, None) => None,
        (name, None) => Some(format!("{}{element}", name?)),
        (name, Some(unit)) => Some(format!("{}{element} [{unit}]", name.unwrap_or(field.name))),
    }
}
