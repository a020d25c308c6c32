//! Bags of ROS 2 in SQLite. The files of newer recorders have the definitions of their messages; for others the usual
//! definitions are known here.
//!
//! SQLite is the C library, which the crate `rusqlite` builds: the feature needs a C compiler.
//!
//! Source   <https://github.com/ros2/rosbag2>, `rosbag2_storage_sqlite3`
//! Packed   files and messages, by zstd; a packed file is unpacked into the folder for temporary files

mod database;
#[cfg(test)]
mod tests;

use crate::folder::Parts;
use crate::messages::{Broken, Cells, MessageReader, message_format};
use crate::ros::{self, Definitions, Encoding};
use crate::signature::ROSBAG2;
use crate::stamped::{Schema, Streams, Unreadable};
use database::{Database, TopicRow};
use fusion::rows::{DataError, SourceError};
use fusion::source::decode::Origin;
use fusion::source::table::Topic;
use fusion::source::{DataFile, OpenContext};
use std::collections::HashMap;

message_format! {
    /// A topic of a bag of ROS 2 in SQLite: a file, or a folder with such files.
    Rosbag2Spec reads Rosbag2Reader as "rosbag2";
    stamps in "stamp", unit "ns", since Some(Origin::Unix);
    signature ROSBAG2;
    example r#"
path = "log.db3"
topic = "/imu/data"
[channels.angular_rate]
columns = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"]
unit = "rad/s"
"#;
}

/// Reads the messages of a bag.
struct Rosbag2Reader {
    parts: Parts,
    database: Database,
    /// The numbers of the topics of the current file in `streams`.
    topics: HashMap<i64, usize>,
    /// The topics of all files by name and type.
    known: HashMap<(String, String), usize>,
    streams: Streams,
}

impl Rosbag2Reader {
    /// Adds the topics of the current file.
    fn add_topics(&mut self) {
        self.topics.clear();
        for row in core::mem::take(&mut self.database.topics) {
            let key = (row.name.clone(), row.message_type.clone());
            let streams = &mut self.streams;
            let known = self.known.entry(key);
            let number = known.or_insert_with(|| streams.add(&row.name, &row.message_type, schema(&row)));
            self.topics.insert(row.id, *number);
        }
    }
}

fn schema(row: &TopicRow) -> Box<dyn Schema> {
    if row.serialisation != "cdr" {
        return Box::new(Unreadable(format!("messages of the encoding `{}` are not read", row.serialisation)));
    }
    let definition = row.definition.clone().or_else(|| ros::definition(&row.message_type));
    let definition = definition.ok_or_else(|| "this file has no definition of it".to_owned());
    let definitions = definition.and_then(|text| Definitions::parse(&row.message_type, &text));
    ros::schema(&row.message_type, definitions, Encoding::Cdr)
}

impl MessageReader for Rosbag2Reader {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let mut parts = Parts::of(file, ROSBAG2.endings);
        let first = parts.next_file().ok_or_else(|| parts.none())?;
        // Its errors name the places where a missing file was searched.
        first.bytes(context)?;
        let mut reader = Self {
            parts,
            database: Database::open(&first).map_err(|why| DataError::new(file.name(), why))?,
            topics: HashMap::new(),
            known: HashMap::new(),
            streams: Streams::default(),
        };
        reader.add_topics();
        Ok(reader)
    }

    fn split(&mut self, topic: &str, list: &str) -> Result<String, String> {
        Ok(self.streams.split(topic, list))
    }

    fn advance(&mut self) -> Result<Option<usize>, Broken> {
        if let Some(element) = self.streams.next_element(self.database.message()) {
            return Ok(Some(element));
        }
        let broken = |message: String| Broken { at: None, message };
        loop {
            if let Some((topic, log_time)) = self.database.next().map_err(broken)? {
                // A message of a topic that the file does not declare.
                let Some(channel) = self.topics.get(&topic) else { continue };
                let topic = self.streams.receive(*channel, self.database.message(), log_time);
                return topic.map(Some).map_err(broken);
            }
            let Some(file) = self.parts.next_file() else { return Ok(None) };
            self.database = Database::open(&file).map_err(broken)?;
            self.add_topics();
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
        self.streams.decode(self.database.message(), cells)
    }
}
