//! Topics of messages whose fields have a defined meaning.

use super::*;
use fusion::source::table::Topic;

/// The names and the unit of a quantity in a topic of this type.
fn found(message_type: &str, columns: &[(&str, &dyn Fn(f64) -> f64)], kind: Kind) -> Option<(Vec<String>, String)> {
    let topic = Topic {
        name: "/topic".to_owned(),
        message_type: message_type.to_owned(),
    };
    let stamped = [&[("t_s", &(|t| t) as &dyn Fn(f64) -> f64)], columns].concat();
    let log = Log::of(LogTable {
        topic: Some(topic),
        ..table(&stamped, 200, 10.0)
    });
    log.signal(kind).map(|s| (s.names(&log.table), s.unit.clone()))
}

#[test]
fn covariances_along_east_north_up_are_reported_sigmas() {
    let fix: [(&str, &dyn Fn(f64) -> f64); 6] = [
        ("latitude", &|t| 42.0 + 1e-5 * t),
        ("longitude", &|_| -71.0),
        ("altitude", &|_| 7.0),
        ("position_covariance[0]", &|t| 1.0 + 0.1 * t),
        ("position_covariance[4]", &|t| 2.0 + 0.1 * t),
        ("position_covariance[8]", &|t| 3.0 + 0.1 * t),
    ];
    let north_east_down = ["position_covariance[4]", "position_covariance[0]", "position_covariance[8]"];
    for name in ["sensor_msgs/NavSatFix", "sensor_msgs/msg/NavSatFix"] {
        let sigma = found(name, &fix, Kind::PositionSigma).unwrap();
        assert_eq!(sigma, (north_east_down.map(str::to_owned).to_vec(), "m^2".to_owned()));
        assert_eq!(found(name, &fix, Kind::Geodetic).unwrap().1, "deg");
    }
    // Of an unknown type the elements of a matrix are no vector.
    assert_eq!(found("own_msgs/Fix", &fix, Kind::Local), None);
}

#[test]
fn odometry_without_a_sideways_velocity_is_a_speed() {
    let with = |side: &'static dyn Fn(f64) -> f64| -> [(&'static str, &'static dyn Fn(f64) -> f64); 4] {
        [
            ("twist.twist.linear.x", &|t| 1.0 + 0.1 * t),
            ("twist.twist.linear.y", side),
            ("twist.twist.linear.z", &|_| 0.0),
            ("twist.twist.angular.z", &|t| 0.01 * t),
        ]
    };
    let names = |found: Option<(Vec<String>, String)>| found.map(|(names, _)| names.join(" "));
    let wheels = with(&|_| 0.0);
    assert_eq!(
        names(found("nav_msgs/Odometry", &wheels, Kind::Speed)).unwrap(),
        "twist.twist.linear.x"
    );
    assert_eq!(found("nav_msgs/Odometry", &wheels, Kind::BodyVelocity), None);
    assert_eq!(
        names(found("nav_msgs/Odometry", &wheels, Kind::YawRate)).unwrap(),
        "-twist.twist.angular.z"
    );
    // Forward, left, up: the signs of the other axes change.
    let slides = with(&|t| 0.1 * t);
    let body = names(found("nav_msgs/msg/Odometry", &slides, Kind::BodyVelocity)).unwrap();
    assert_eq!(body, "twist.twist.linear.x -twist.twist.linear.y -twist.twist.linear.z");
    assert_eq!(found("nav_msgs/msg/Odometry", &slides, Kind::Speed), None);
}
