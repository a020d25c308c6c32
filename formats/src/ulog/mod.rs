//! Logs of PX4: ULog, files `.ulg`.
//!
//! ```text
//! header ── definitions: formats ── subscriptions, messages with the number of their subscription, drop-outs
//! ```
//!
//! A topic is a message and its instance: `vehicle_imu` is the first instance, `vehicle_imu[1]` the next one. An array
//! is `gyro_rad[0]` …, a message in a message `esc[0].esc_rpm`, as `pyulog` names them. Texts are one column.
//!
//! Damage    the messages after the next synchronisation are read; without one, the log ends
//! Own       `px4-ulog` 0.6 ends at the first damage, and panics on parameters without a name
//! Not here  parameters, texts of the log
//! Source    <https://docs.px4.io/main/en/dev_log/ulog_file_format>

mod kinds;
mod layout;
#[cfg(test)]
mod tests;

use crate::damage::Damage;
use crate::messages::{Broken, Cells, MessageReader, message_format};
use crate::signature::ULOG;
use crate::stream::Stream;
use fusion::rows::{DataError, SourceError};
use fusion::source::table::{Role, Topic};
use fusion::source::{DataFile, OpenContext};
use layout::{Formats, Layout};
use memchr::memmem;

message_format! {
    /// A log of PX4 (ULog). Stamps count microseconds since the start of the autopilot.
    UlogSpec reads Ulog as "ulog";
    stamps in "timestamp", unit "us", since None;
    signature ULOG;
    example r#"
path = "log.ulg"
topic = "sensor_combined"
[channels.angular_rate]
columns = ["gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"]
unit = "rad/s"
"#;
}

/// Bytes of the header: its mark, the version, the time of the start.
const HEADER: usize = 16;
/// Bytes before the content of a message: its length and its type.
const PREFIX: usize = 3;
/// Bytes of the number of a subscription.
const ID: usize = 2;
/// The content of a message that synchronises.
const SYNC: [u8; 8] = [0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];
/// Columns of all topics. The largest logs of PX4 have some ten thousand.
const MOST_COLUMNS: usize = 1 << 20;

/// Reads a log of PX4.
pub(crate) struct Ulog {
    stream: Stream,
    formats: Formats,
    topics: Vec<Topic>,
    layouts: Vec<Layout>,
    columns: usize,
    /// The topic of each number of a subscription.
    of_ids: Vec<Option<usize>>,
    current: Option<Current>,
    /// Where appended data begin, the next place last.
    appended: Vec<u64>,
    drop_outs: DropOuts,
    damage: Damage,
}

/// The current message.
#[derive(Clone, Copy, Debug)]
struct Current {
    topic: usize,
    /// Its length with its prefix.
    length: usize,
    /// Where the next message begins.
    next: usize,
}

/// Intervals in which the logger could not write.
#[derive(Debug, Default)]
struct DropOuts {
    count: usize,
    /// \[ms\]
    total: u64,
    longest: u16,
}

impl Ulog {
    fn of(mut stream: Stream) -> Result<Self, String> {
        let header = stream.fill(HEADER).map_err(|broken| broken.to_string())?;
        if header.len() < HEADER || !(ULOG.recognises)(header) {
            return Err("this is not a ULog: it does not begin with its mark".to_owned());
        }
        stream.consume(HEADER);
        let mut log = Self {
            stream,
            formats: Formats::default(),
            topics: Vec::new(),
            layouts: Vec::new(),
            columns: 0,
            of_ids: Vec::new(),
            current: None,
            appended: Vec::new(),
            drop_outs: DropOuts::default(),
            damage: Damage::default(),
        };
        log.flags()?;
        Ok(log)
    }

    /// Reads the flags, which are the first message of newer logs.
    fn flags(&mut self) -> Result<(), String> {
        /// Bytes of compatible flags, incompatible flags, and offsets of appended data.
        const LENGTH: usize = 8 + 8 + 3 * 8;
        let ahead = self.stream.fill(PREFIX + LENGTH).map_err(|broken| broken.to_string())?;
        if ahead.len() < PREFIX + LENGTH || ahead[2] != b'B' {
            return Ok(());
        }
        let (flags, offsets) = ahead[PREFIX + 8..PREFIX + LENGTH].split_at(8);
        if flags[0] & !1 != 0 || flags[1..].iter().any(|flag| *flag != 0) {
            return Err("this log is of a newer version of ULog: it has flags that are not known".to_owned());
        }
        let offsets = offsets.chunks_exact(8).map(|bytes| bytes.try_into().map_or(0, u64::from_le_bytes));
        self.appended = offsets.filter(|offset| *offset > HEADER as u64).collect();
        self.appended.sort_unstable_by(|one, other| other.cmp(one));
        Ok(())
    }

    /// The length of the next message with its prefix, and its type; `None` at the end of the file.
    fn next(&mut self) -> Result<Option<(usize, u8)>, Broken> {
        loop {
            let at = self.stream.at();
            let ahead = self.stream.fill(PREFIX)?;
            let length = match ahead {
                [] => return Ok(None),
                [low, high, ..] => PREFIX + usize::from(u16::from_le_bytes([*low, *high])),
                _ => PREFIX,
            };
            // The last message before appended data may be cut off.
            if let Some(offset) = self.appended.last().copied().filter(|offset| at + length as u64 > *offset) {
                self.appended.pop();
                self.stream.skip(offset.saturating_sub(at))?;
                continue;
            }
            let ahead = self.stream.fill(length)?;
            if ahead.len() >= length {
                return Ok(Some((length, ahead[2])));
            }
            if !self.resume()? {
                return Err(Broken::at(at, "the file is cut off within a message"));
            }
        }
    }

    /// Where a synchronisation ends within the next bytes.
    fn synchronised(&self, length: usize) -> Option<usize> {
        let content = self.stream.ahead().get(PREFIX..length)?;
        Some(PREFIX + memmem::find(content, &SYNC)? + SYNC.len())
    }

    /// Continues after the next synchronisation, and returns whether there is one.
    fn resume(&mut self) -> Result<bool, Broken> {
        let start = self.stream.at();
        loop {
            let ahead = self.stream.ahead();
            if let Some(found) = memmem::find(ahead, &SYNC) {
                self.stream.consume(found + SYNC.len());
                self.damage.add(start, self.stream.at());
                return Ok(true);
            }
            let kept = ahead.len().min(SYNC.len() - 1);
            self.stream.consume(ahead.len() - kept);
            if self.stream.fill(kept + 1)?.len() <= kept {
                return Ok(false);
            }
        }
    }

    /// Reads a message without data of a topic. `None` if it is damaged.
    fn define(&mut self, length: usize, kind: u8) -> Option<()> {
        let content = &self.stream.ahead()[PREFIX..length];
        match kind {
            b'F' => self.formats.define(core::str::from_utf8(content).ok()?),
            b'A' => {
                let (&[instance, low, high], name) = content.split_first_chunk()?;
                let name = core::str::from_utf8(name).ok()?.to_owned();
                self.subscribe(instance, u16::from_le_bytes([low, high]), &name)
            }
            b'R' => {
                let id = u16::from_le_bytes(content.first_chunk().copied()?);
                if let Some(topic) = self.of_ids.get_mut(usize::from(id)) {
                    *topic = None;
                }
                Some(())
            }
            b'O' => {
                let milliseconds = u16::from_le_bytes(content.first_chunk().copied()?);
                self.drop_outs.count += 1;
                self.drop_outs.total += u64::from(milliseconds);
                self.drop_outs.longest = self.drop_outs.longest.max(milliseconds);
                Some(())
            }
            // A type that is not known may be of a newer version.
            _ => kind.is_ascii_uppercase().then_some(()),
        }
    }

    fn subscribe(&mut self, instance: u8, id: u16, format: &str) -> Option<()> {
        let name = match instance {
            0 => format.to_owned(),
            _ => format!("{format}[{instance}]"),
        };
        let known = self.topics.iter().position(|topic| topic.name == name);
        let topic = match known {
            Some(topic) => topic,
            None => {
                let layout = self.formats.layout(format).ok()?;
                self.columns += layout.names.len();
                if self.columns > MOST_COLUMNS {
                    return None;
                }
                self.layouts.push(layout);
                self.topics.push(Topic {
                    name,
                    message_type: format.to_owned(),
                });
                self.topics.len() - 1
            }
        };
        let id = usize::from(id);
        self.of_ids.resize(self.of_ids.len().max(id + 1), None);
        self.of_ids[id] = Some(topic);
        Some(())
    }

    /// The topic of a message of data.
    fn topic(&self, length: usize) -> Option<usize> {
        let id = self.stream.ahead()[PREFIX..length].first_chunk().copied()?;
        self.of_ids.get(usize::from(u16::from_le_bytes(id))).copied().flatten()
    }
}

impl MessageReader for Ulog {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        Self::of(Stream::open(file, context)?).map_err(|why| DataError::new(file.name(), why).into())
    }

    fn advance(&mut self) -> Result<Option<usize>, Broken> {
        if let Some(Current { next, .. }) = self.current.take() {
            self.stream.consume(next);
        }
        while let Some((length, kind)) = self.next()? {
            let at = self.stream.at();
            if kind == b'D'
                && let Some(topic) = self.topic(length)
            {
                let is_sound = self.layouts[topic].is_length(length - PREFIX - ID);
                let next = self.synchronised(length).filter(|_| !is_sound).unwrap_or(length);
                self.current = Some(Current { topic, length, next });
                return Ok(Some(topic));
            }
            if kind != b'D' && self.define(length, kind).is_some() {
                self.stream.consume(length);
                continue;
            }
            // The length may be wrong: the next message is perhaps within this one.
            let next = self
                .synchronised(length)
                .or((kind.is_ascii_uppercase() && length > PREFIX).then_some(length));
            if let Some(next) = next {
                self.stream.consume(next);
                self.damage.add(at, self.stream.at());
            } else if !self.resume()? {
                return Err(Broken::at(at, "this is not a message, and no synchronisation follows"));
            }
        }
        self.damage.reported()
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn columns(&self, topic: usize) -> &[String] {
        &self.layouts[topic].names
    }

    fn label(&self, topic: usize, column: usize) -> Option<String> {
        let name = &self.layouts[topic].names[column];
        kinds::meaning(&self.topics[topic].message_type, name).map(str::to_owned)
    }

    fn role(&self, topic: usize) -> Role {
        kinds::role(&self.topics[topic].message_type)
    }

    fn remarks(&self) -> Vec<String> {
        let DropOuts { count, total, longest } = self.drop_outs;
        let said = format!(
            "{count} drop-outs of the logger, {:.3} s in all, {:.3} s the longest",
            total as f64 * 1e-3,
            f64::from(longest) * 1e-3
        );
        (count > 0).then_some(said).into_iter().collect()
    }

    fn decode(&mut self, cells: &mut Cells) -> Result<(), String> {
        let Some(Current { topic, length, .. }) = self.current else {
            return Ok(());
        };
        let layout = &self.layouts[topic];
        let content = &self.stream.ahead()[PREFIX + ID..length];
        if !layout.is_length(content.len()) {
            return Err(format!("it has {} bytes, which its format does not have", content.len()));
        }
        layout.decode(content, cells);
        Ok(())
    }
}
