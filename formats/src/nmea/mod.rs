//! Sentences of NMEA 0183: text, files `.nmea`.
//!
//! A topic is an address as the file has it, talker and type: `GNGGA`. The columns have the names of `pynmeagps`; the
//! raw time of day is `utc`. Positions are degrees with a sign. The stamp is the time of day with the date of the newest
//! `RMC` or `ZDA`, before the first one with its date. A sentence without a time has the stamp of the one before it.
//! If no sentence has a date, stamps are times of day.
//!
//! Damage    a sentence with a wrong checksum is a malformed row, if its address is known
//! Own       `nmea` 0.8 has no `THS`, no sentences of manufacturers, and its own name for each field
//! Not here  the fields of `GSV` by name, lines before the sentence such as stamps of a logger

pub(crate) mod clock;
pub(crate) mod fields;
pub(crate) mod sentence;
#[cfg(test)]
pub(crate) mod tests;

use crate::damage::Damage;
use crate::messages::{Broken, Cells, MessageReader, message_format};
use crate::signature::NMEA;
use crate::stream::Stream;
use clock::Clock;
use fields::Columns;
use fusion::rows::{DataError, SourceError};
use fusion::source::decode::Origin;
use fusion::source::table::{Role, Topic};
use fusion::source::{DataFile, OpenContext};
use memchr::memchr;
use sentence::Sentence;

message_format! {
    /// Sentences of NMEA 0183. Stamps count nanoseconds of GPS time.
    NmeaSpec reads Nmea as "nmea";
    stamps in "time", unit "ns", since Some(Origin::Gps);
    signature NMEA;
    example r#"
path = "log.nmea"
topic = "GNGGA"
[channels.position]
latitude = "lat"
longitude = "lon"
height = "alt"
unit = "deg"
"#;
}

/// Bytes of the longest line. The standard has 82; sentences of manufacturers are longer.
pub(crate) const LONGEST: usize = 1024;
/// Addresses of a log. A ship has some fifty.
pub(crate) const MOST_TOPICS: usize = 1 << 10;

/// Reads sentences.
pub(crate) struct Nmea {
    stream: Stream,
    clock: Clock,
    has_date: bool,
    topics: Vec<Topic>,
    columns: Vec<Columns>,
    current: Option<Current>,
    /// Lines without a sentence.
    others: usize,
    damage: Damage,
}

/// The current sentence.
#[derive(Clone, Copy, Debug)]
struct Current {
    topic: usize,
    /// Its place in its line.
    from: usize,
    /// The length of the line.
    length: usize,
    stamp: Option<i64>,
}

/// The length of the next line with its end; `None` at the end of the file.
fn line(stream: &mut Stream) -> Result<Option<usize>, Broken> {
    let ahead = stream.fill(LONGEST)?;
    let whole = memchr(b'\n', &ahead[..ahead.len().min(LONGEST)]).map(|end| end + 1);
    Ok(whole.or_else(|| (!ahead.is_empty()).then(|| ahead.len().min(LONGEST))))
}

/// The place where a sentence begins in a line.
fn begins(line: &[u8]) -> Option<usize> {
    memchr(b'$', line)
}

impl Nmea {
    /// The clock of the first sentence with a date.
    fn first_date(mut stream: Stream) -> Result<Option<Clock>, Broken> {
        while let Some(length) = line(&mut stream)? {
            let line = &stream.ahead()[..length];
            let sentence = begins(line).and_then(|from| Sentence::of(&line[from..]).ok());
            if let Some(clock) = sentence.and_then(|sentence| Clock::begins(&sentence)) {
                return Ok(Some(clock));
            }
            stream.consume(length);
        }
        Ok(None)
    }

    fn of(stream: Stream, first: Option<Clock>) -> Self {
        Self {
            stream,
            has_date: first.is_some(),
            clock: first.unwrap_or_else(Clock::without_date),
            topics: Vec::new(),
            columns: Vec::new(),
            current: None,
            others: 0,
            damage: Damage::default(),
        }
    }

    /// The topic of the sentence in a line; `None` if it is damaged and its address is not known.
    fn topic(&mut self, from: usize, length: usize) -> Option<usize> {
        let line = &self.stream.ahead()[from..length];
        let address = Sentence::address(line)?;
        if let Some(topic) = self.topics.iter().position(|topic| topic.name == address) {
            return Some(topic);
        }
        let sentence = Sentence::of(line).ok().filter(|_| self.topics.len() < MOST_TOPICS)?;
        self.columns.push(Columns::of(&sentence));
        self.topics.push(topic(address));
        Some(self.topics.len() - 1)
    }
}

/// The role of an address. Wind, satellites and texts are not measured motion.
pub(crate) fn role(address: &str) -> Role {
    const MEASUREMENTS: [&str; 15] = [
        "GGA", "GLL", "GNS", "GST", "RMC", "VTG", "HDT", "HDM", "HDG", "THS", "ROT", "VBW", "VHW", "DPT", "DBT",
    ];
    match Sentence::kind(address) {
        kind if MEASUREMENTS.contains(&kind) => Role::Measurement,
        _ => Role::Other,
    }
}

/// The topic of an address.
pub(crate) fn topic(address: &str) -> Topic {
    Topic {
        name: address.to_owned(),
        message_type: format!("NMEA {}", Sentence::kind(address)),
    }
}

impl MessageReader for Nmea {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let unread = OpenContext {
            unread: Default::default(),
            ..context.clone()
        };
        let damaged = |broken: Broken| DataError::new(file.name(), broken.to_string());
        let first = Self::first_date(Stream::open(file, &unread)?).map_err(damaged)?;
        Ok(Self::of(Stream::open(file, context)?, first))
    }

    fn advance(&mut self) -> Result<Option<usize>, Broken> {
        if let Some(current) = self.current.take() {
            self.stream.consume(current.length);
        }
        while let Some(length) = line(&mut self.stream)? {
            let at = self.stream.at();
            let line = &self.stream.ahead()[..length];
            let is_whole = line.ends_with(b"\n");
            let Some(from) = begins(line) else {
                self.others += usize::from(!line.trim_ascii().is_empty());
                self.stream.consume(length);
                continue;
            };
            if !is_whole && length < LONGEST && Sentence::of(&line[from..]).is_err() {
                return Err(Broken::at(at, "the file is cut off within a sentence"));
            }
            if let Some(topic) = self.topic(from, length) {
                let sentence = Sentence::of(&self.stream.ahead()[from..length]).ok();
                let stamp = sentence.and_then(|sentence| self.clock.stamp(&sentence));
                self.current = Some(Current {
                    topic,
                    from,
                    length,
                    stamp,
                });
                return Ok(Some(topic));
            }
            self.stream.consume(length);
            self.damage.add(at, self.stream.at());
        }
        self.damage.reported()
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn columns(&self, topic: usize) -> &[String] {
        &self.columns[topic].names
    }

    fn label(&self, topic: usize, column: usize) -> Option<String> {
        self.columns[topic].label(column)
    }

    fn role(&self, topic: usize) -> Role {
        role(&self.topics[topic].name)
    }

    fn remarks(&self) -> Vec<String> {
        let date = (!self.has_date).then(|| "no sentence has a date: stamps are times of day".to_owned());
        let others = (self.others > 0).then(|| format!("{} lines have no sentence", self.others));
        [date, others].into_iter().flatten().collect()
    }

    fn decode(&mut self, cells: &mut Cells) -> Result<(), String> {
        let Some(Current {
            topic,
            from,
            length,
            stamp,
        }) = self.current
        else {
            return Ok(());
        };
        let sentence = Sentence::of(&self.stream.ahead()[from..length])?;
        match stamp {
            Some(stamp) => cells.integer(stamp),
            None => cells.empty(),
        }
        self.columns[topic].decode(&sentence, cells)
    }
}
