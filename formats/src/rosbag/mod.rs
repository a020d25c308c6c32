//! Bags of ROS 1.
//!
//! The records are read here, and not with the crate `rosbag`: it panics if a bag is cut off or has no index, it takes
//! memory of any size that a damaged chunk declares, and its libraries need a C compiler.
//!
//! Source   <https://wiki.ros.org/Bags/Format/2.0>

mod records;
#[cfg(test)]
mod tests;

use crate::bytes::Bytes;
use crate::damage::Damage;
use crate::messages::{Broken, Cells, MessageReader, message_format};
use crate::ros::{self, Definitions, Encoding, short_name};
use crate::signature::ROSBAG;
use crate::stamped::Streams;
use fusion::rows::{DataError, SourceError};
use fusion::source::decode::Origin;
use fusion::source::table::Topic;
use fusion::source::{DataFile, OpenContext};
use records::{Entry, Records};
use std::collections::HashMap;

message_format! {
    /// A topic of a bag of ROS 1.
    BagSpec reads BagReader as "rosbag";
    stamps in "stamp", unit "ns", since Some(Origin::Unix);
    signature ROSBAG;
    example r#"
path = "log.bag"
topic = "/imu/data"
[channels.angular_rate]
columns = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"]
unit = "rad/s"
"#;
}

/// Reads the messages of a bag.
struct BagReader {
    records: Records,
    /// The numbers of the connections in `streams`.
    connections: HashMap<u32, usize>,
    /// The connections by topic, type and definition.
    known: HashMap<(String, String, String), usize>,
    streams: Streams,
    message: Vec<u8>,
    damage: Damage,
}

impl BagReader {
    fn connect(&mut self, number: u32, topic: String, message_type: &str, definition: String) {
        let message_type = short_name(message_type);
        let key = (topic, message_type, definition);
        let known = match self.known.get(&key) {
            Some(known) => *known,
            None => {
                let (topic, message_type, definition) = &key;
                let definitions = Definitions::parse(message_type, definition);
                let schema = ros::schema(message_type, definitions, Encoding::Ros1);
                let added = self.streams.add(topic, message_type, schema);
                *self.known.entry(key).or_insert(added)
            }
        };
        self.connections.insert(number, known);
    }
}

impl MessageReader for BagReader {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let records = records::open(Bytes::open(file, context)?);
        Ok(Self {
            records: records.map_err(|why| DataError::new(file.name(), why))?,
            connections: HashMap::new(),
            known: HashMap::new(),
            streams: Streams::default(),
            message: Vec::new(),
            damage: Damage::default(),
        })
    }

    fn split(&mut self, topic: &str, list: &str) -> Result<String, String> {
        Ok(self.streams.split(topic, list))
    }

    fn advance(&mut self) -> Result<Option<usize>, Broken> {
        if let Some(element) = self.streams.next_element(&self.message) {
            return Ok(Some(element));
        }
        loop {
            match self.records.next(&mut self.message, &mut self.damage)? {
                Some(Entry::Message { connection, log_time }) => {
                    let Some(channel) = self.connections.get(&connection) else {
                        self.damage.undeclared(|| format!("connection {connection}"));
                        continue;
                    };
                    let topic = self.streams.receive(*channel, &self.message, log_time);
                    return topic.map(Some).map_err(|message| Broken { at: None, message });
                }
                Some(Entry::Connection {
                    number,
                    topic,
                    message_type,
                    definition,
                }) => self.connect(number, topic, &message_type, definition),
                None => return self.damage.reported(),
            }
        }
    }

    fn topics(&self) -> &[Topic] {
        self.streams.topics()
    }

    fn columns(&self, topic: usize) -> &[String] {
        self.streams.columns(topic)
    }

    fn select(&mut self, topic: usize, columns: &[usize]) -> Option<Vec<usize>> {
        self.streams.select(topic, columns)
    }

    fn decode(&mut self, cells: &mut Cells) -> Result<(), String> {
        self.streams.decode(&self.message, cells)
    }
}
