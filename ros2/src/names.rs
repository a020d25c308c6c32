//! Names of ROS 2, and how DDS has them.
//!
//! Source   <https://design.ros2.org/articles/topic_and_service_names.html>

use schemars::JsonSchema;
use serde::Deserialize;

/// The number of a DDS domain, which nodes have in `ROS_DOMAIN_ID`. Its ports are 7400 + 250 times the domain and
/// following, and end below 65536: the last domain is 232.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(try_from = "u16")]
pub struct Domain(u16);

/// The last domain.
const LAST_DOMAIN: u16 = 232;

impl TryFrom<u16> for Domain {
    type Error = String;

    fn try_from(number: u16) -> Result<Self, String> {
        if number > LAST_DOMAIN {
            return Err(format!("there is no domain {number}: the domains are 0 to {LAST_DOMAIN}"));
        }
        Ok(Self(number))
    }
}

impl From<Domain> for u16 {
    fn from(domain: Domain) -> Self {
        domain.0
    }
}

/// Whether a text is a word of a name: letters, digits and underscores, and no digit first.
fn is_word(text: &str) -> bool {
    let is_of_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text.starts_with(|c: char| !c.is_ascii_digit()) && text.chars().all(is_of_word)
}

/// The full name of a topic, such as `/imu/data`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
pub struct TopicName(String);

impl TryFrom<String> for TopicName {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let words = name.strip_prefix('/');
        let is_full = words.is_some_and(|words| words.split('/').all(is_word));
        if is_full {
            Ok(Self(name))
        } else {
            Err(format!("`{name}` is not the full name of a topic, such as `/imu/data`"))
        }
    }
}

impl TopicName {
    /// The usual name of estimates.
    pub(crate) fn estimates() -> Self {
        Self("/estimate".to_owned())
    }

    /// The name in ROS.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The name in DDS, such as `rt/imu/data`.
    pub(crate) fn in_dds(&self) -> String {
        format!("rt{}", self.0)
    }
}

/// A message type, such as `sensor_msgs/msg/Imu`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
pub struct MessageType(String);

impl TryFrom<String> for MessageType {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let words: Vec<&str> = name.split('/').collect();
        match words[..] {
            [package, "msg", message] if is_word(package) && is_word(message) => Ok(Self(name)),
            _ => Err(format!("`{name}` is not a message type, such as `sensor_msgs/msg/Imu`")),
        }
    }
}

impl MessageType {
    /// The name in ROS.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The name in DDS, such as `sensor_msgs::msg::dds_::Imu_`.
    pub(crate) fn in_dds(&self) -> String {
        format!("{}_", self.0.replacen("/msg/", "::msg::dds_::", 1))
    }

    /// The name in ROS of a type in DDS; the name in DDS for a type that does not belong to ROS.
    pub(crate) fn of_dds(name: &str) -> String {
        let short = name.strip_suffix('_').unwrap_or(name);
        short.replacen("::msg::dds_::", "/msg/", 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_dds() {
        let topic = TopicName::try_from("/imu/data_raw".to_owned()).unwrap();
        assert_eq!(topic.in_dds(), "rt/imu/data_raw");
        let message_type = MessageType::try_from("sensor_msgs/msg/Imu".to_owned()).unwrap();
        assert_eq!(message_type.in_dds(), "sensor_msgs::msg::dds_::Imu_");
        assert_eq!(MessageType::of_dds("sensor_msgs::msg::dds_::Imu_"), "sensor_msgs/msg/Imu");
    }

    #[test]
    fn names_that_no_node_can_have_are_refused() {
        for name in ["imu", "", "/", "/imu/", "/2d", "/a b", "//a", "/é"] {
            assert!(TopicName::try_from(name.to_owned()).is_err(), "{name}");
        }
        for name in ["Imu", "sensor_msgs/Imu", "sensor_msgs/srv/Imu", "a/msg/", "a/msg/b/c"] {
            assert!(MessageType::try_from(name.to_owned()).is_err(), "{name}");
        }
        assert!(Domain::try_from(232).is_ok() && Domain::try_from(233).is_err());
    }
}
