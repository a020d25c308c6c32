//! The declaration of the link.

use super::subscription::Subscription;
use super::{Inlet, failed};
use crate::names::{Domain, MessageType, TopicName};
use crate::qos::Reading;
use fusion::models::register;
use fusion_formats::ros;
use fusion_live::{Ends, LinkSpec};
use rustdds::{DomainParticipant, QosPolicies};
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::time::SystemTime;

/// Topics of ROS 2. Sources of the type `mcap` read them as they read a bag: a source names its `topic`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ros2LinkSpec {
    /// The domain, which nodes have in `ROS_DOMAIN_ID`; 0 by default.
    #[serde(default)]
    domain: Domain,
    /// The topics that are received.
    #[schemars(with = "Vec<TopicTable>")]
    topics: Vec<Topic>,
}

/// A topic that is received.
#[derive(Debug, Deserialize)]
#[serde(try_from = "TopicTable")]
pub(super) struct Topic {
    pub(super) name: TopicName,
    pub(super) message_type: MessageType,
    definition: Definition,
    pub(super) reading: Reading,
}

/// A topic as declared.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TopicTable {
    /// Its full name, such as `"/imu/data"`.
    topic: TopicName,
    /// The type of its messages, such as `"sensor_msgs/msg/Imu"`.
    r#type: MessageType,
    /// The quality of service: `"sensor_data"` by default, which all publishers offer, or `"reliable"`.
    #[serde(default)]
    qos: Reading,
    /// The file with the definition of the type, for a type that is not known. A relative path starts at the working
    /// directory. It needs no definitions of the usual types.
    definition: Option<PathBuf>,
}

/// The definition of a message type.
#[derive(Debug)]
enum Definition {
    Known(String),
    File(PathBuf),
}

impl TryFrom<TopicTable> for Topic {
    type Error = String;

    fn try_from(table: TopicTable) -> Result<Self, String> {
        let definition = match table.definition {
            Some(path) => Definition::File(path),
            None => Definition::Known(known(table.r#type.as_str())?),
        };
        Ok(Self {
            name: table.topic,
            message_type: table.r#type,
            definition,
            reading: table.qos,
        })
    }
}

/// The definition of a known type.
fn known(message_type: &str) -> Result<String, String> {
    let unknown = || {
        let known: Vec<String> = ros::known_types().collect();
        let known = known.join("`, `");
        format!("no definition of `{message_type}` is known: give its file as `definition`, or use a known type: `{known}`")
    };
    ros::definition(message_type).ok_or_else(unknown)
}

impl Topic {
    /// The definition of its messages with those of all types that they need.
    ///
    /// # Errors
    /// The file cannot be read, or does not define the type.
    pub(super) fn definition(&self) -> io::Result<String> {
        let path = match &self.definition {
            Definition::Known(text) => return Ok(text.clone()),
            Definition::File(path) => path,
        };
        let wrong = |kind: ErrorKind, why: String| io::Error::new(kind, format!("`{}`: {why}", path.display()));
        let text = std::fs::read_to_string(path).map_err(|error| wrong(error.kind(), error.to_string()))?;
        ros::completed(self.message_type.as_str(), &text).map_err(|why| wrong(ErrorKind::InvalidData, why))
    }
}

register! {
    Link, "ros2", Ros2LinkSpec,
    r#"topics = [{ topic = "/imu/data", type = "sensor_msgs/msg/Imu" }]"#
}

#[typetag::deserialize(name = "ros2")]
impl LinkSpec for Ros2LinkSpec {
    fn open(&self) -> io::Result<Ends> {
        let participant = DomainParticipant::new(self.domain.into()).map_err(failed)?;
        let subscriber = participant.create_subscriber(&QosPolicies::qos_none()).map_err(failed)?;
        let mut subscriptions: Vec<Subscription> = Vec::new();
        for (topic, number) in self.topics.iter().zip(1..) {
            if subscriptions.iter().any(|other| other.name() == &topic.name) {
                let twice = format!("the topic `{}` is declared twice", topic.name.as_str());
                return Err(io::Error::new(ErrorKind::InvalidInput, twice));
            }
            subscriptions.push(Subscription::open(topic, number, &participant, &subscriber)?);
        }
        let receiver = Inlet {
            subscriptions,
            participant,
            has_begun: false,
            latest: SystemTime::now(),
        };
        Ok(Ends {
            receiver: Box::new(receiver),
            sender: None,
        })
    }

    fn peer(&self) -> String {
        format!("ros2 domain {}", u16::from(self.domain))
    }
}
