//! Estimates as topics.

use crate::cdr::{AsBytes, Leaving, failed};
use crate::names::{Domain, MessageType, TopicName};
use crate::qos::qos;
use core::fmt::Write;
use fusion::core::health::State;
use fusion::core::time::Time;
use fusion::models::register;
use fusion_formats::ros::messages::{Encoder, Frames, Kind, Level, Message, Status};
use fusion_live::{About, Outgoing, Output, OutputSpec, Sender, SensorNow};
use rustdds::no_key::DataWriter;
use rustdds::{DomainParticipant, QosPolicies, TopicKind};
use schemars::JsonSchema;
use serde::Deserialize;
use std::io;
use std::sync::Arc;

/// Messages that are kept for readers that have missed them.
const KEPT: i32 = 10;
/// The same for `/tf`, as the broadcaster of tf2 does.
const KEPT_TRANSFORMS: i32 = 100;
/// Diagnostics are sent when the health changes, and after this time.
const DIAGNOSTICS_EVERY: f64 = 1.0;

/// Topics of ROS 2: `nav_msgs/msg/Odometry` and `sensor_msgs/msg/NavSatFix` with covariances, `tf2_msgs/msg/TFMessage` on
/// `/tf`, and the health of the filter and of each sensor on `/diagnostics`. The axes are those of REP 103.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ros2OutputSpec {
    /// The domain, which nodes have in `ROS_DOMAIN_ID`; 0 by default.
    #[serde(default)]
    domain: Domain,
    /// The name in `/diagnostics`; `"fusion"` by default.
    #[serde(default = "default_node")]
    node: String,
    /// The topics are `odometry` and `fix` below this name; `"/estimate"` by default.
    #[serde(default = "default_topics")]
    topics: TopicName,
    /// The frame east, north, up from the origin; `"map"` by default.
    world_frame: Option<String>,
    /// The frame of the body: forward, left, up; `"base_link"` by default.
    body_frame: Option<String>,
    /// Whether the transform from the world to the body is published on `/tf`; true by default. Without it, another node
    /// gives the body frame its parent.
    #[serde(default = "default_tf")]
    tf: bool,
}

fn default_node() -> String {
    "fusion".to_owned()
}

fn default_topics() -> TopicName {
    TopicName::estimates()
}

const fn default_tf() -> bool {
    true
}

register! { Output, "ros2", Ros2OutputSpec, r#"topics = "/estimate""# }

#[typetag::deserialize(name = "ros2")]
impl OutputSpec for Ros2OutputSpec {
    fn link(&self) -> Option<&str> {
        None
    }

    fn open(&self, about: &About) -> io::Result<Box<dyn Output>> {
        let usual = Frames::default();
        let frames = Frames {
            world: self.world_frame.clone().unwrap_or(usual.world),
            body: self.body_frame.clone().unwrap_or(usual.body),
        };
        let participant = DomainParticipant::new(self.domain.into()).map_err(failed)?;
        let kinds = Kind::ALL.into_iter().filter(|kind| self.tf || *kind != Kind::Transform);
        let topics = kinds.map(|kind| Topic::open(kind, self.topics.as_str(), &participant));
        Ok(Box::new(Outlet {
            topics: topics.collect::<io::Result<_>>()?,
            participant,
            encoder: Encoder::new(about.origin.clone(), about.clock, frames),
            node: self.node.clone(),
            sensors: about.sensors.clone(),
            reported: None,
        }))
    }
}

/// A topic that is published.
struct Topic {
    kind: Kind,
    name: TopicName,
    writer: DataWriter<Leaving, AsBytes>,
}

impl Topic {
    fn open(kind: Kind, prefix: &str, participant: &DomainParticipant) -> io::Result<Self> {
        let invalid = |why: String| io::Error::new(io::ErrorKind::InvalidInput, why);
        let name = TopicName::try_from(kind.topic(prefix)).map_err(invalid)?;
        let message_type = MessageType::try_from(kind.message_type().to_owned()).map_err(invalid)?;
        let depth = if kind == Kind::Transform { KEPT_TRANSFORMS } else { KEPT };
        let qos = qos(true, depth);
        let topic = participant
            .create_topic(name.in_dds(), message_type.in_dds(), &qos, TopicKind::NoKey)
            .map_err(failed)?;
        let publisher = participant.create_publisher(&QosPolicies::qos_none()).map_err(failed)?;
        let writer = publisher.create_datawriter_no_key(&topic, Some(qos)).map_err(failed)?;
        Ok(Self { kind, name, writer })
    }
}

struct Outlet {
    // Topics end before their participant.
    topics: Vec<Topic>,
    participant: DomainParticipant,
    encoder: Encoder,
    node: String,
    sensors: Vec<String>,
    /// The health in the latest diagnostics, and their time.
    reported: Option<(Time, State, Arc<[String]>)>,
}

impl Output for Outlet {
    fn send(&mut self, estimate: &Outgoing, _: Option<&mut dyn Sender>) -> io::Result<()> {
        let components = self.is_report_due(estimate).then(|| self.components(estimate));
        for Topic { kind, writer, .. } in &self.topics {
            let solution = estimate.solution.as_ref();
            let message = match kind {
                Kind::Odometry => solution.and_then(|solution| self.encoder.odometry(solution)),
                Kind::Fix => solution.and_then(|solution| self.encoder.fix(solution)),
                Kind::Transform => solution.and_then(|solution| self.encoder.transform(solution)),
                Kind::Diagnostics => components.as_ref().map(|all| self.encoder.diagnostics(estimate.time, all)),
            };
            if let Some(Message { bytes, .. }) = message {
                writer.write(Leaving::new(bytes), None).map_err(failed)?;
            }
        }
        if components.is_some() {
            self.reported = Some((estimate.time, estimate.health, estimate.reasons.clone()));
        }
        Ok(())
    }

    fn status(&self) -> Option<String> {
        let readers = self.participant.discovered_readers();
        let names = readers.iter().map(|reader| reader.subscription_topic_data.topic_name());
        let names: Vec<&String> = names.collect();
        let mut text = String::new();
        for Topic { name, .. } in &self.topics {
            let topic = name.in_dds();
            let count = names.iter().filter(|name| ***name == topic).count();
            let comma = if text.is_empty() { "" } else { ", " };
            let _ = write!(text, "{comma}{}: {count} subscribers", name.as_str());
        }
        Some(text)
    }
}

impl Outlet {
    fn is_report_due(&self, estimate: &Outgoing) -> bool {
        self.reported.as_ref().is_none_or(|(time, health, reasons)| {
            let is_changed = *health != estimate.health || *reasons != estimate.reasons;
            is_changed || (estimate.time.seconds() - time.seconds()).abs() >= DIAGNOSTICS_EVERY
        })
    }

    /// The filter, then its sensors.
    fn components(&self, estimate: &Outgoing) -> Vec<Status> {
        let named = |name: &str, value: String| (name.to_owned(), value);
        let mut values: Vec<_> = estimate.age.map(|age| named("age [s]", format!("{age:.3}"))).into_iter().collect();
        values.extend(estimate.reasons.iter().map(|reason| named("reason", reason.clone())));
        values.extend(estimate.waits_for.iter().map(|awaited| named("waits for", awaited.clone())));
        let filter = Status {
            level: estimate.health.into(),
            name: format!("{}: filter", self.node),
            message: estimate.health.word().to_owned(),
            values,
        };
        let sensors = self.sensors.iter().zip(estimate.sensors.iter());
        let sensors = sensors.map(|(name, now)| sensor(format!("{}: {name}", self.node), now, estimate.time));
        core::iter::once(filter).chain(sensors).collect()
    }
}

/// The state of a sensor.
fn sensor(name: String, now: &SensorNow, time: Time) -> Status {
    let (level, message) = match now.time {
        None => (Level::Stale, "no measurement"),
        Some(_) if now.is_used => (Level::Ok, "used"),
        Some(_) => (Level::Warn, "rejected"),
    };
    let age = now.time.map(|latest| time.seconds() - latest.seconds());
    let values = [
        ("age [s]", age.map(|age| format!("{age:.3}"))),
        ("used", Some(now.used.to_string())),
        ("rejected", Some(now.rejected.to_string())),
        ("NIS", now.nis.map(|nis| format!("{nis:.3}"))),
    ];
    let values = values.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
    Status {
        level,
        name,
        message: message.to_owned(),
        values: values.collect(),
    }
}
