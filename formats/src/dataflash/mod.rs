//! Logs of ArduPilot: DataFlash, files `.BIN`.
//!
//! ```text
//! A3 95 TYPE content ── FMT defines the fields of a type, FMTU their units and multipliers by UNIT and MULT
//! ```
//!
//! A topic is a message and its instance: `IMU` is instance 0, `IMU[1]` the next one. The values are those of
//! `pymavlink`: hundredths and 1e-7 deg are divided out, and a multiplier of `FMTU` is a prefix of the unit, as in
//! `MagX [mgauss]`.
//!
//! Damage    reading resumes at the next message that another one or the end follows
//! Own       `ardupilot-binlog` 0.2 does not read units or instances, and ends at damage without an error
//! Not here  logs from before 2015, whose stamps are `TimeMS`
//! Source    <https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html>

mod format;
#[cfg(test)]
mod tests;
mod units;

use crate::damage::Damage;
use crate::messages::{Broken, Cells, MessageReader, message_format};
use crate::signature::DATAFLASH;
use crate::stream::Stream;
use format::Format;
use fusion::rows::{DataError, SourceError};
use fusion::source::table::{Role, Topic};
use fusion::source::{DataFile, OpenContext};
use memchr::memmem;
use std::collections::HashMap;
use units::Units;

message_format! {
    /// A log of ArduPilot (DataFlash). Stamps count microseconds since the start of the autopilot.
    DataflashSpec reads Dataflash as "dataflash";
    stamps in "TimeUS", unit "us", since None;
    signature DATAFLASH;
    example r#"
path = "log.BIN"
topic = "IMU"
[channels.angular_rate]
columns = ["GyrX", "GyrY", "GyrZ"]
unit = "rad/s"
"#;
}

/// The column of the stamps \[µs\].
const STAMP: &str = "TimeUS";
/// The first bytes of a message.
const MARK: [u8; 2] = [0xa3, 0x95];
/// Bytes before the content of a message: the mark and the type.
const HEADER: usize = 3;
/// The type of the messages that define formats.
const FMT: u8 = 128;
/// A message is not longer than this: its length is a number of 8 bits.
const LONGEST: usize = 255;
/// Instances of all messages. A vehicle has some hundred.
const MOST_TOPICS: usize = 1 << 14;

/// Reads a log of ArduPilot.
pub(crate) struct Dataflash {
    stream: Stream,
    /// The format of each type.
    formats: Vec<Option<Format>>,
    units: Units,
    topics: Vec<Topic>,
    /// The type and the columns of each topic.
    known: Vec<(u8, Vec<String>)>,
    /// The topic of each type and instance.
    of_instances: HashMap<(u8, i64), usize>,
    /// The topic of the current message, and its length.
    current: Option<(usize, usize)>,
    damage: Damage,
}

impl Dataflash {
    fn of(mut stream: Stream) -> Result<Self, String> {
        let start = stream.fill(HEADER).map_err(|broken| broken.to_string())?;
        if !start.starts_with(&MARK) {
            return Err("this is not a log of ArduPilot: it does not begin with a message".to_owned());
        }
        let mut formats = vec![None; 256];
        formats[usize::from(FMT)] = Some(Format::of_formats());
        Ok(Self {
            stream,
            formats,
            units: Units::default(),
            topics: Vec::new(),
            known: Vec::new(),
            of_instances: HashMap::new(),
            current: None,
            damage: Damage::default(),
        })
    }

    /// The type and the length of a message that begins with these bytes.
    fn message(&self, ahead: &[u8]) -> Option<(u8, usize)> {
        let [0xa3, 0x95, kind, ..] = ahead else { return None };
        Some((*kind, self.formats[usize::from(*kind)].as_ref()?.length))
    }

    /// Passes over bytes up to a message that another message or the end of the file follows. Returns whether there is
    /// one.
    fn resume(&mut self) -> Result<bool, Broken> {
        let start = self.stream.at();
        loop {
            self.stream.consume(1);
            self.stream.fill(2 * LONGEST)?;
            let ahead = self.stream.ahead();
            let Some(found) = memmem::find(ahead, &MARK) else {
                if ahead.len() < HEADER {
                    self.damage.add(start, self.stream.at() + ahead.len() as u64);
                    return Ok(false);
                }
                // The last byte may be the first one of a mark.
                self.stream.consume(ahead.len() - 2);
                continue;
            };
            self.stream.consume(found);
            self.stream.fill(LONGEST + HEADER)?;
            let ahead = self.stream.ahead();
            let next = self.message(ahead).and_then(|(_, length)| ahead.get(length..));
            if next.is_some_and(|next| next.is_empty() || next.starts_with(&MARK)) {
                self.damage.add(start, self.stream.at());
                return Ok(true);
            }
        }
    }

    /// Uses a message that defines others. `None` if it is damaged.
    fn define(&mut self, kind: u8, length: usize) -> Option<()> {
        let content = &self.stream.ahead()[HEADER..length];
        if kind == FMT {
            let (kind, format) = Format::defined(content)?;
            let known = &mut self.formats[usize::from(kind)];
            // The columns of a topic do not change.
            let is_used = || self.known.iter().any(|(of, _)| *of == kind);
            return match known {
                Some(known) if *known == format => Some(()),
                Some(_) if kind == FMT || is_used() => None,
                _ => {
                    *known = Some(format);
                    Some(())
                }
            };
        }
        let format = self.formats[usize::from(kind)].as_ref()?;
        self.units.define(format, content)
    }

    /// The topic of a message.
    fn topic(&mut self, kind: u8, length: usize) -> Option<usize> {
        let format = self.formats[usize::from(kind)].as_ref()?;
        let content = &self.stream.ahead()[HEADER..length];
        let instance = self.units.instance(kind).and_then(|field| format.bytes(field, content));
        let instance = instance.map_or(0, |bytes| match *bytes {
            [byte] => i64::from(byte),
            [low, high] => u16::from_le_bytes([low, high]).into(),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]).into(),
            _ => 0,
        });
        if let Some(topic) = self.of_instances.get(&(kind, instance)) {
            return Some(*topic);
        }
        let name = match instance {
            0 => format.name.clone(),
            _ => format!("{}[{instance}]", format.name),
        };
        // Two types may have one name.
        if self.topics.len() == MOST_TOPICS || self.topics.iter().any(|topic| topic.name == name) {
            return None;
        }
        self.known.push((kind, format.columns()));
        self.topics.push(Topic {
            name,
            message_type: format.name.clone(),
        });
        self.of_instances.insert((kind, instance), self.topics.len() - 1);
        Some(self.topics.len() - 1)
    }
}

/// The role of messages with this name.
fn role(name: &str) -> Role {
    const MEASUREMENTS: [&str; 14] = [
        "IMU", "IMU2", "IMU3", "GPS", "GPS2", "MAG", "MAG2", "MAG3", "BARO", "BAR2", "BAR3", "ARSP", "RFND", "WENC",
    ];
    // The filters have the number of their core at the end.
    let estimate = name.trim_end_matches(|last: char| last.is_ascii_digit());
    match name {
        _ if MEASUREMENTS.contains(&name) => Role::Measurement,
        "SIM" => Role::Truth,
        _ if ["ATT", "AHR", "POS", "NKF", "XKF"].contains(&estimate) => Role::Estimate,
        _ => Role::Other,
    }
}

impl MessageReader for Dataflash {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        Self::of(Stream::open(file, context)?).map_err(|why| DataError::new(file.name(), why).into())
    }

    fn advance(&mut self) -> Result<Option<usize>, Broken> {
        if let Some((_, length)) = self.current.take() {
            self.stream.consume(length);
        }
        loop {
            let at = self.stream.at();
            self.stream.fill(LONGEST)?;
            let ahead = self.stream.ahead();
            if ahead.is_empty() {
                return self.damage.reported();
            }
            let Some((kind, length)) = self.message(ahead) else {
                if !self.resume()? {
                    return self.damage.reported();
                }
                continue;
            };
            if ahead.len() < length {
                return Err(Broken::at(at, "the file is cut off within a message"));
            }
            let name = self.formats[usize::from(kind)].as_ref().map(|format| format.name.as_str());
            let is_sound = if matches!(name, Some("FMT" | "FMTU" | "UNIT" | "MULT")) {
                self.define(kind, length).is_some()
            } else if let Some(topic) = self.topic(kind, length) {
                self.current = Some((topic, length));
                return Ok(Some(topic));
            } else {
                false
            };
            self.stream.consume(length);
            if !is_sound {
                self.damage.add(at, self.stream.at());
            }
        }
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn columns(&self, topic: usize) -> &[String] {
        &self.known[topic].1
    }

    fn label(&self, topic: usize, column: usize) -> Option<String> {
        let (kind, columns) = &self.known[topic];
        let format = self.formats[usize::from(*kind)].as_ref()?;
        let field = *format.fields_of_columns().get(column)?;
        let unit = self.units.of(*kind, field, format.has_divisor(field))?;
        Some(format!("{} [{unit}]", columns[column]))
    }

    fn role(&self, topic: usize) -> Role {
        role(&self.topics[topic].message_type)
    }

    fn decode(&mut self, cells: &mut Cells) -> Result<(), String> {
        let Some((topic, length)) = self.current else { return Ok(()) };
        if let Some(format) = &self.formats[usize::from(self.known[topic].0)] {
            format.decode(&self.stream.ahead()[HEADER..length], cells);
        }
        Ok(())
    }
}
