//! The messages of one topic.

use super::declared::Topic;
use super::failed;
use crate::cdr::{Arrived, AsBytes};
use crate::names::{MessageType, TopicName};
use crate::qos::{Reading, qos};
use crate::records::{self, Times};
use core::fmt::Write;
use rustdds::discovery::DiscoveredWriterData;
use rustdds::no_key::SimpleDataReader;
use rustdds::policy::Reliability;
use rustdds::{DomainParticipant, GUID, Subscriber, Timestamp, TopicKind};
use std::collections::BTreeMap;
use std::io;
use std::task::Waker;

/// DDS keeps this number of messages of a topic until they are taken: half a second of an inertial unit with 1 kHz.
/// Further ones displace the oldest, which are counted as lost.
const MOST_WAITING: i32 = 512;
/// The latest numbers of this many publishers are remembered. A publisher that starts again is another one.
const MOST_PUBLISHERS: usize = 64;

/// The messages of one topic.
pub(super) struct Subscription {
    name: TopicName,
    message_type: MessageType,
    reading: Reading,
    definition: String,
    reader: SimpleDataReader<Arrived, AsBytes>,
    /// The number of the channel.
    number: u16,
    /// The latest message of each publisher.
    latest: BTreeMap<GUID, i64>,
    received: u64,
    lost: u64,
}

impl Subscription {
    /// # Errors
    /// The definition of its type cannot be read, or DDS has no room for it.
    pub(super) fn open(topic: &Topic, number: u16, participant: &DomainParticipant, subscriber: &Subscriber) -> io::Result<Self> {
        let qos = qos(topic.reading == Reading::Reliable, MOST_WAITING);
        let in_dds = participant
            .create_topic(topic.name.in_dds(), topic.message_type.in_dds(), &qos, TopicKind::NoKey)
            .map_err(failed)?;
        Ok(Self {
            name: topic.name.clone(),
            message_type: topic.message_type.clone(),
            reading: topic.reading,
            definition: topic.definition()?,
            reader: subscriber.create_simple_datareader_no_key(&in_dds, Some(qos)).map_err(failed)?,
            number,
            latest: BTreeMap::new(),
            received: 0,
            lost: 0,
        })
    }

    pub(super) const fn name(&self) -> &TopicName {
        &self.name
    }

    /// The next message wakes by `waker`.
    pub(super) fn wake_by(&self, waker: &Waker) {
        self.reader.drain_read_notifications();
        self.reader.set_waker(Some(waker.clone()));
    }

    /// Adds the records of the channel.
    pub(super) fn declare(&self, bytes: &mut Vec<u8>) {
        records::channel(bytes, self.number, self.name.as_str(), self.message_type.as_str(), &self.definition);
    }

    /// Adds the record of the next message, if there is one.
    pub(super) fn take(&mut self, bytes: &mut Vec<u8>) -> bool {
        let message = match self.reader.try_take_one() {
            Ok(Some(message)) => message,
            Ok(None) => return false,
            // An encoding that no version of CDR has: the next message counts it as lost.
            Err(_) => return true,
        };
        let sequence = i64::from(message.sequence_number);
        self.count(message.writer_guid, sequence);
        let arrived = unix_nanos(message.receive_instant);
        let times = Times {
            arrived,
            sent: message.source_timestamp().map_or(arrived, unix_nanos),
        };
        // The number of a record has 32 bits.
        records::message(bytes, self.number, sequence as u32, times, &message.sample.0);
        true
    }

    /// Counts a message, and those of its publisher that are missing before it.
    fn count(&mut self, publisher: GUID, sequence: i64) {
        self.received += 1;
        if self.latest.len() >= MOST_PUBLISHERS && !self.latest.contains_key(&publisher) {
            self.latest.clear();
        }
        let latest = self.latest.entry(publisher).or_insert(sequence - 1);
        let missing = sequence.saturating_sub(latest.saturating_add(1));
        self.lost += u64::try_from(missing).unwrap_or_default();
        *latest = sequence.max(*latest);
    }

    /// The counts of messages and publishers, and the reason why the messages of a publisher are not received.
    pub(super) fn status(&self, writers: &[DiscoveredWriterData]) -> String {
        let topic = self.name.in_dds();
        let publishers = writers.iter().map(|writer| &writer.publication_topic_data);
        let publishers: Vec<_> = publishers.filter(|publisher| publisher.topic_name == topic).collect();
        let mut text = format!(
            "{}: {} messages, {} publishers",
            self.name.as_str(),
            self.received,
            publishers.len()
        );
        if self.lost > 0 {
            let _ = write!(text, ", {} lost", self.lost);
        }
        let own = self.message_type.in_dds();
        if let Some(other) = publishers.iter().find(|publisher| publisher.type_name != own) {
            let _ = write!(text, ", published as `{}`", MessageType::of_dds(&other.type_name));
        }
        let is_best_effort = publishers
            .iter()
            .any(|publisher| publisher.reliability == Some(Reliability::BestEffort));
        if self.reading == Reading::Reliable && is_best_effort {
            text.push_str(", published as best effort: declare `qos = \"sensor_data\"`");
        }
        text
    }
}

/// Nanoseconds since 1970-01-01 UTC. A tick is 2⁻³² s.
fn unix_nanos(time: Timestamp) -> u64 {
    ((u128::from(time.to_ticks()) * 1_000_000_000) >> 32) as u64
}
