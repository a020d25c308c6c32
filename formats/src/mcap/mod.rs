//! MCAP: messages of ROS 2 by their definitions, protobuf by its descriptors, and JSON.
//!
//! The records are read here, and not with the crate `mcap`. Its reader of a stream (0.26) does not give the place of a
//! damage, and subtracts the length of a record from that of its chunk without a check. Its packings need a C compiler.
//!
//! Source   <https://mcap.dev/spec>
//! Live     a message is given as soon as its record is complete, and bytes that arrive may end after any record
//! Not read attachments, metadata, the summary at the end

mod json;
mod protobuf;
mod records;
#[cfg(test)]
mod tests;

use crate::damage::Damage;
use crate::folder::Parts;
use crate::messages::{Broken, Cells, MessageReader, message_format};
use crate::ros::{self, Definitions, Encoding};
use crate::signature::MCAP;
use crate::stamped::{Schema, Streams, Unreadable};
use fusion::rows::SourceError;
use fusion::source::decode::Origin;
use fusion::source::table::Topic;
use fusion::source::{DataFile, OpenContext};
use records::{Entry, Records};
use std::collections::{BTreeMap, HashMap};

message_format! {
    /// A topic of an MCAP file, or of a folder of ROS 2 with such files.
    McapSpec reads McapReader as "mcap";
    stamps in "stamp", unit "ns", since Some(Origin::Unix);
    signature MCAP;
    example r#"
path = "log.mcap"
topic = "/imu/data"
[channels.angular_rate]
columns = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"]
unit = "rad/s"
"#;
}

/// Reads the messages of an MCAP file.
struct McapReader {
    context: OpenContext,
    parts: Parts,
    records: Records,
    /// The numbers of the channels of the current file in `streams`.
    channels: BTreeMap<u16, usize>,
    /// The channels of all files by topic, schema and encoding.
    known: HashMap<(String, String, Vec<u8>), usize>,
    schemas: HashMap<u16, WrittenSchema>,
    streams: Streams,
    message: Vec<u8>,
    damage: Damage,
}

/// A schema as the file has it.
struct WrittenSchema {
    name: String,
    encoding: String,
    data: Vec<u8>,
}

impl WrittenSchema {
    /// The schema of the messages of a channel with this encoding.
    fn read(&self, encoding: &str) -> Box<dyn Schema> {
        match (encoding, self.encoding.as_str()) {
            ("cdr", "ros2msg") => self.ros(Encoding::Cdr),
            ("ros1", "ros1msg") => self.ros(Encoding::Ros1),
            ("protobuf", "protobuf") => protobuf::schema(&self.name, &self.data),
            ("json", _) => Box::new(json::JsonSchema),
            (messages, schema) => Box::new(Unreadable(format!(
                "messages of the encoding `{messages}` with a schema of `{schema}` are not read"
            ))),
        }
    }

    fn ros(&self, encoding: Encoding) -> Box<dyn Schema> {
        let definitions = Definitions::parse(&self.name, &String::from_utf8_lossy(&self.data));
        ros::schema(&self.name, definitions, encoding)
    }
}

impl McapReader {
    fn add_channel(&mut self, number: u16, schema: u16, topic: &str, encoding: &str) {
        let none = WrittenSchema {
            name: String::new(),
            encoding: String::new(),
            data: Vec::new(),
        };
        let schema = self.schemas.get(&schema).unwrap_or(&none);
        let key = (topic.to_owned(), format!("{} {encoding}", schema.name), schema.data.clone());
        let streams = &mut self.streams;
        let known = self.known.entry(key);
        let channel = known.or_insert_with(|| streams.add(topic, &schema.name, schema.read(encoding)));
        self.channels.insert(number, *channel);
    }
}

impl MessageReader for McapReader {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let is_arriving = context.arriving.is_some();
        let mut parts = if is_arriving {
            Parts::one(file)
        } else {
            Parts::of(file, MCAP.endings)
        };
        let bytes = parts.next_bytes(context).transpose()?.ok_or_else(|| parts.none())?;
        Ok(Self {
            context: context.clone(),
            parts,
            records: records::open(bytes, is_arriving).map_err(|why| fusion::rows::DataError::new(file.name(), why))?,
            channels: BTreeMap::new(),
            known: HashMap::new(),
            schemas: HashMap::new(),
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
                Some(Entry::Message { channel, log_time }) => {
                    let Some(channel) = self.channels.get(&channel) else {
                        self.damage.undeclared(|| format!("channel {channel}"));
                        continue;
                    };
                    let topic = self.streams.receive(*channel, &self.message, log_time);
                    return topic.map(Some).map_err(|message| Broken { at: None, message });
                }
                Some(Entry::Schema {
                    number,
                    name,
                    encoding,
                    data,
                }) => {
                    self.schemas.insert(number, WrittenSchema { name, encoding, data });
                }
                Some(Entry::Channel {
                    number,
                    schema,
                    topic,
                    encoding,
                }) => self.add_channel(number, schema, &topic, &encoding),
                None => {
                    let Some(bytes) = self.parts.next_bytes(&self.context) else {
                        return self.damage.reported();
                    };
                    let broken = |message: String| Broken { at: None, message };
                    let bytes = bytes.map_err(|error| broken(error.to_string()))?;
                    self.records = records::open(bytes, self.context.arriving.is_some()).map_err(broken)?;
                    self.channels.clear();
                    self.schemas.clear();
                }
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
