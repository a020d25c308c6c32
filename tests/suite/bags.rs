//! Real logs of messages: as the reference readers give them, and in the place of the text files made of them.

use super::real::{data, real};
use fusion::run::Summary;
use fusion::source::table::LogTable;

/// The rows and the sum of a column: `rosbags` 0.11 for bags, `mcap-protobuf-support` 0.6 for MCAP (both PyPI).
const SUMS: [(&str, &str, usize, &str, f64); 14] = [
    (HUSKY, "/imu/data", 11865, "angular_velocity.y", -108.080_235_536_210_24),
    (HUSKY, "/imu/data", 11865, "linear_acceleration_covariance[8]", 113.951_459_999_988),
    (
        HUSKY,
        "/husky_velocity_controller/odom",
        3952,
        "twist.twist.linear.x",
        3_586.747_040_997_876,
    ),
    (
        HUSKY,
        "/husky_velocity_controller/odom",
        3952,
        "pose.covariance[35]",
        118.560_000_000_003_73,
    ),
    (HUSKY, "/fix", 989, "latitude", 41_910.347_555_000_06),
    (HUSKY, "/fix", 989, "position_covariance[8]", 3_054.639_999_999_950_8),
    (JACKAL, "/imu/data", 3061, "angular_velocity.y", -3.269_054_241_752_148_6),
    (
        JACKAL,
        "/jackal_velocity_controller/odom",
        3060,
        "twist.twist.linear.x",
        4_208.729_320_151_748,
    ),
    (DIVE, "blueye.protocol.Imu2Tel", 7434, "imu.gyroscope.z", -780.834_768_153_384_3),
    (DIVE, "blueye.protocol.DepthTel", 1609, "depth.value", 6_728.359_996_020_794),
    (
        SQUARE,
        "blueye.protocol.DvlVelocityTel",
        5425,
        "dvl_velocity.velocity.x",
        2_814.930_871_549_993_8,
    ),
    (
        SQUARE,
        "blueye.protocol.PositionEstimateTel",
        2284,
        "position_estimate.northing",
        22_069.775_388_376_787,
    ),
    (GRID, "blueye.protocol.Imu2Tel", 19943, "imu.gyroscope.z", -277.188_337_093_757_87),
    (GRID, "blueye.protocol.DepthTel", 2182, "depth.value", 193.293_000_452_220_44),
];

const HUSKY: &str = "robot_localization_husky/original/test1.bag";
const JACKAL: &str = "binary_logs/test2.bag";
const DIVE: &str = "blueye_rov/original/log_dive_2min_2025-05-07_15_06_13.mcap";
const SQUARE: &str = "blueye_rov/original/log_auto_square_2025-05-07_14_55_13.mcap";
const GRID: &str = "blueye_rov/original/log_grid_01_05_scaled.mcap";

#[test]
fn real_bags_have_the_values_of_the_reference_readers() {
    fusion_formats::link();
    let Some(data) = data() else { return };
    for file in [HUSKY, JACKAL, DIVE, SQUARE, GRID] {
        let tables = LogTable::read_all(&data.join(file)).unwrap();
        for (_, topic, rows, column, sum) in SUMS.iter().filter(|sum| sum.0 == file) {
            let table = tables
                .iter()
                .find(|table| table.topic.as_ref().is_some_and(|of| of.name == *topic))
                .unwrap();
            let values = &table.columns.iter().find(|of| of.name == *column).unwrap().values;
            assert_eq!((table.rows(), table.malformed, &table.broken), (*rows, 0, &None), "{file} {topic}");
            // The sum of the reference is made in the same order.
            assert_eq!(values.iter().sum::<f64>(), *sum, "{file} {topic} {column}");
        }
    }
}

/// The keys that put a log into the place of the text file of a source.
fn in_place(source: &str, (format, path, topic, epoch): (&str, &str, &str, u64), keys: &[&str]) -> Vec<String> {
    let common = [
        format!("type=\"{format}\""),
        format!("path=\"{path}\""),
        format!("topic=\"{topic}\""),
        format!("time.epoch={epoch}000000000"),
    ];
    let keys = keys.iter().map(|key| (*key).to_owned());
    common.into_iter().chain(keys).map(|key| format!("source.{source}.{key}")).collect()
}

/// A design with other keys.
fn with(name: &str, variants: &[&str], sets: &[String]) -> Option<Summary> {
    let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
    real(name, variants, &sets)
}

/// The text files have stamps to 0.1 ms and values of six or seven digits. Of an innovation, this changes less than 1e-4
/// of its σ, and of a position less than 0.1 mm.
const ROUNDING: f64 = 1e-4;

#[test]
fn a_robot_of_ros_gives_the_figures_of_its_text_files() {
    fusion_formats::link();
    let log = |topic| ("rosbag", HUSKY, topic, 1_432_235_497);
    let column = "time.column=\"stamp\"";
    let gnss = [
        column,
        "channels.position.latitude=\"latitude\"",
        "channels.position.longitude=\"longitude\"",
        "channels.position.height=\"altitude\"",
    ];
    let sets = [
        in_place("gnss", log("/fix"), &gnss),
        in_place(
            "odometry",
            log("/husky_velocity_controller/odom"),
            &[column, "channels.speed.column=\"twist.twist.linear.x\""],
        ),
        in_place(
            "imu",
            log("/imu/data"),
            &[column, "channels.yaw_rate.column=\"-angular_velocity.y\""],
        ),
    ];
    let Some(text) = real("husky", &[], &[]) else { return };
    let bag = with("husky", &[], &sets.concat()).unwrap();
    assert_eq!(text.sensors().len(), 3);
    for (text, bag) in text.sensors().iter().zip(bag.sensors()) {
        assert_eq!((&text.name, text.accepted, text.rejected), (&bag.name, bag.accepted, bag.rejected));
        let [one, other] = [text, bag].map(|sensor| sensor.nis.as_ref().unwrap().mean);
        assert!((one - other).abs() < ROUNDING, "{}: {one} {other}", text.name);
    }
}

/// The keys for the original of a log of the Blueye.
fn blueye(path: &str, epoch: u64) -> Vec<String> {
    let column = "time.column=\"log_time\"";
    let of = |topic| ("mcap", path, topic, epoch);
    // The receiver is one of the instruments in a list.
    let receiver = [
        column,
        "each=\"position_estimate.navigation_sensors\"",
        "valid=[{ column = \"sensor_id\", equals = \"NAVIGATION_SENSOR_ID_BLUEYE_GNSS\" }, { column = \"is_valid\", equals = 1 }]",
        "channels.horizontal_position.latitude=\"global_position.latitude\"",
        "channels.horizontal_position.longitude=\"global_position.longitude\"",
    ];
    let unit = [
        column,
        "channels.angular_rate.columns=[\"imu.gyroscope.x\", \"imu.gyroscope.y\", \"imu.gyroscope.z\"]",
        "channels.specific_force.columns=[\"imu.accelerometer.x\", \"imu.accelerometer.y\", \"imu.accelerometer.z\"]",
    ];
    let velocity = [
        column,
        "channels.body_velocity.columns=[\"dvl_velocity.velocity.x\", \"dvl_velocity.velocity.y\", \"dvl_velocity.velocity.z\"]",
    ];
    [
        in_place("imu", of("blueye.protocol.Imu2Tel"), &unit),
        in_place("dvl", of("blueye.protocol.DvlVelocityTel"), &velocity),
        in_place(
            "depth",
            of("blueye.protocol.DepthTel"),
            &[column, "channels.depth.column=\"depth.value\""],
        ),
        in_place("gnss", of("blueye.protocol.PositionEstimateTel"), &receiver),
        in_place("withheld", of("blueye.protocol.PositionEstimateTel"), &receiver),
    ]
    .concat()
}

#[test]
fn an_underwater_vehicle_gives_the_figures_of_its_text_files() {
    fusion_formats::link();
    for (variants, path, epoch) in [
        (&[][..], DIVE, 1_746_623_174),
        (&["square"], SQUARE, 1_746_622_514),
        (&["grid"], GRID, 1_746_099_142),
    ] {
        let Some(text) = real("blueye", variants, &[]) else { return };
        let log = with("blueye", variants, &blueye(path, epoch)).unwrap();
        let [text, log] = [&text, &log].map(|summary| summary.score().unwrap().horizontal_rms);
        assert!((text - log).abs() < ROUNDING, "{path}: {text} m {log} m");
    }
}
