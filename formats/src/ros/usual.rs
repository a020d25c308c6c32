//! The definitions of the usual messages of ROS 2, for data that have none.

use super::{Definitions, short_name};

const USUAL: &str = include_str!("usual.msg");

/// The line between two definitions, as bags have it.
const RULE: &str = "================================================================================";

/// The usual definitions: the name of the type without `msg`, and its fields.
fn usual() -> impl Iterator<Item = (&'static str, &'static str)> {
    USUAL.split("MSG: ").skip(1).filter_map(|part| part.split_once('\n'))
}

/// The message types of ROS 2 that have a [`definition`], such as `sensor_msgs/msg/Imu`, in alphabetic order.
pub fn known_types() -> impl Iterator<Item = String> {
    usual().map(|(name, _)| name.replacen('/', "/msg/", 1))
}

/// The definition of a usual message type of ROS 2, such as `sensor_msgs/msg/Imu`, with the definitions of the types that
/// it needs: the text that bags have, with the encoding `ros2msg`. `None` for a type that is not [known](known_types).
#[must_use]
pub fn definition(message_type: &str) -> Option<String> {
    let short = short_name(message_type);
    let (_, text) = usual().find(|(name, _)| *name == short)?;
    completed(message_type, text).ok()
}

/// Adds the usual definitions to the text of a `.msg` file: those of the types that it needs and does not define.
///
/// # Errors
/// The text has a line that cannot be read, or needs a type that it does not define and that is not usual.
pub fn completed(message_type: &str, text: &str) -> Result<String, String> {
    let mut text = format!("{}\n", text.trim_end());
    loop {
        let missing = Definitions::missing(message_type, &text)?;
        let Some((name, part)) = usual().find(|(name, _)| missing.contains(*name)) else {
            return Definitions::parse(message_type, &text).map(|_| text);
        };
        text.push_str(&format!("{RULE}\nMSG: {name}\n{part}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_usual_definitions_are_complete() {
        assert!(known_types().count() > 80 && known_types().is_sorted());
        for message_type in known_types() {
            let text = definition(&message_type).unwrap_or_else(|| panic!("{message_type} needs a type that is not usual"));
            let parts = text.matches("MSG:").count();
            assert_eq!(parts > 0, text.contains('/'), "{message_type}");
        }
    }

    #[test]
    fn a_definition_has_those_of_the_types_that_it_needs_once() {
        let text = definition("nav_msgs/msg/Odometry").unwrap();
        assert!(text.starts_with("std_msgs/Header header\nstring child_frame_id\n"));
        let parts: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
        let expected = [
            "geometry_msgs/PoseWithCovariance",
            "geometry_msgs/Pose",
            "geometry_msgs/Point",
            "geometry_msgs/Quaternion",
            "geometry_msgs/TwistWithCovariance",
            "geometry_msgs/Twist",
            "geometry_msgs/Vector3",
            "std_msgs/Header",
            "builtin_interfaces/Time",
        ];
        assert_eq!(parts.len(), expected.len(), "{parts:?}");
        assert!(expected.iter().all(|name| parts.contains(name)), "{parts:?}");
        assert_eq!(definition("own_msgs/msg/Imu"), None);
    }

    #[test]
    fn a_definition_of_a_file_is_completed() {
        let text = "# Speed of a wheel.\nHeader header\nOther other\ngeometry_msgs/Vector3 axis\n\
                    ===\nMSG: own_msgs/Other\nfloat32 x";
        let whole = completed("own_msgs/msg/Wheel", text).unwrap();
        assert!(whole.starts_with(text), "{whole}");
        let added = whole.matches(RULE).count();
        // Vector3, Header and Time.
        assert_eq!(added, 3, "{whole}");
        let unknown = completed("own_msgs/msg/Wheel", "own_msgs/Gear gear").unwrap_err();
        assert!(unknown.contains("`own_msgs/Gear`, which is not defined"), "{unknown}");
    }
}
