//! Logs of u-blox receivers: UBX, mixed with NMEA and RTCM 3, files `.ubx`.
//!
//! A topic is a message, `NAV-PVT`, or the address of a sentence, `GNGGA`. The columns have the names and the scales of
//! `pyubx2`: latitudes in degrees, heights in millimetres. The stamp is GPS time: the time of the week with the week of
//! the newest message that has one. `TIM-TP` and `TIM-TM2` have the stamp of their pulse. A message without a time has
//! the stamp of the one before it. If no message has a week, stamps count from the start of a week.
//!
//! `ESF-MEAS` and `ESF-RAW` have a column for each sensor in its unit. A message `ESF-RAW` has a row for each tag.
//!
//! Damage    a message with a wrong checksum is a malformed row, if its topic is known; reading resumes after its mark
//! Own       `ublox` 0.10 has one type for each message and each protocol, and its own name for each field
//! Not here  satellites and raw measurements, messages of configuration; RTCM is passed over
//! Source    u-blox F9 HPG interface description, UBX-22008968

mod clock;
mod frame;
mod layout;
mod sensors;
#[cfg(test)]
mod tests;

use crate::damage::Damage;
use crate::messages::{Broken, Cells, MessageReader, message_format};
use crate::nmea::clock::Clock as Calendar;
use crate::nmea::fields::Columns;
use crate::nmea::sentence::Sentence;
use crate::nmea::{self, MOST_TOPICS};
use crate::signature::UBX;
use crate::stream::Stream;
use clock::Clock;
use frame::{CHECKSUM, Frame, HEADER};
use fusion::rows::{DataError, SourceError};
use fusion::source::decode::Origin;
use fusion::source::table::{Role, Topic};
use fusion::source::{DataFile, OpenContext};
use layout::Layout;

message_format! {
    /// A log of a u-blox receiver: UBX, mixed with NMEA and RTCM 3. Stamps count nanoseconds of GPS time.
    UbxSpec reads Ubx as "ubx";
    stamps in "time", unit "ns", since Some(Origin::Gps);
    signature UBX;
    example r#"
path = "log.ubx"
topic = "NAV-PVT"
[channels.position]
latitude = "lat"
longitude = "lon"
height = "height"
unit = "deg"
height_unit = "mm"
"#;
}

/// Reads a log of a receiver.
pub(crate) struct Ubx {
    stream: Stream,
    layouts: Vec<([u8; 2], Layout)>,
    clock: Clock,
    calendar: Calendar,
    has_week: bool,
    topics: Vec<Topic>,
    of_topics: Vec<Kind>,
    current: Option<Current>,
    /// Bytes that begin nothing, from this one on.
    unknown: Option<u64>,
    /// A message that the file does not end.
    open: Option<u64>,
    damage: Damage,
}

/// The messages of a topic.
#[derive(Clone, Debug)]
enum Kind {
    /// The number of the layout.
    Fields(usize),
    Sensors([u8; 2], Vec<String>),
    Sentence(Columns),
}

/// The current message.
#[derive(Clone, Copy, Debug)]
struct Current {
    topic: usize,
    /// Its length, without its checksum for a message of u-blox.
    length: usize,
    /// Where reading goes on.
    next: usize,
    is_sound: bool,
    stamp: Option<i64>,
    /// The measurements of one tag.
    part: (usize, usize),
}

/// The clocks at the beginning of a log.
#[derive(Debug, Default)]
struct Beginning {
    clock: Option<Clock>,
    calendar: Option<Calendar>,
}

impl Ubx {
    /// The clocks of the first messages that have a week or a date.
    fn beginning(mut stream: Stream) -> Result<Beginning, Broken> {
        let layouts = layout::all();
        let mut found = Beginning::default();
        while found.clock.is_none() {
            let length = match next(&mut stream)? {
                None => break,
                Some(Frame::Ubx {
                    id,
                    length,
                    is_sound: true,
                }) => {
                    let content = &stream.ahead()[HEADER..length - CHECKSUM];
                    let layout = of_id(&layouts, id, content.len());
                    found.clock = layout.and_then(|layout| Clock::begins(&layouts[layout].1, content));
                    length
                }
                Some(Frame::Nmea(length)) => {
                    let sentence = Sentence::of(&stream.ahead()[..length]).ok();
                    let begins = || sentence.and_then(|sentence| Calendar::begins(&sentence));
                    found.calendar = found.calendar.or_else(begins);
                    length
                }
                Some(Frame::Rtcm(length)) => length,
                Some(_) => 1,
            };
            stream.consume(length);
        }
        Ok(found)
    }

    fn of(stream: Stream, Beginning { clock, calendar }: Beginning) -> Self {
        let of_clock = || clock.as_ref().and_then(Clock::newest).map(Calendar::at);
        Self {
            stream,
            layouts: layout::all(),
            has_week: clock.is_some() || calendar.is_some(),
            calendar: calendar.or_else(of_clock).unwrap_or_else(Calendar::without_date),
            clock: clock.unwrap_or_else(Clock::without_week),
            topics: Vec::new(),
            of_topics: Vec::new(),
            current: None,
            unknown: None,
            open: None,
            damage: Damage::default(),
        }
    }

    /// The topic of this name, new for a sound message.
    fn topic(&mut self, name: &str, kind: impl FnOnce() -> Option<Kind>) -> Option<usize> {
        if let Some(topic) = self.topics.iter().position(|topic| topic.name == name) {
            return Some(topic);
        }
        let kind = kind().filter(|_| self.topics.len() < MOST_TOPICS)?;
        self.topics.push(match kind {
            Kind::Sentence(_) => nmea::topic(name),
            _ => Topic {
                name: name.to_owned(),
                message_type: format!("UBX-{name}"),
            },
        });
        self.of_topics.push(kind);
        Some(self.topics.len() - 1)
    }

    /// The topic of a message of u-blox; `None` if it is not read.
    fn ubx(&mut self, id: [u8; 2], length: usize, is_sound: bool) -> Option<Current> {
        let end = length - CHECKSUM;
        let mut part = (0, 0);
        let (name, kind) = match id {
            sensors::MEAS => ("ESF-MEAS", Kind::Sensors(id, sensors::columns(id))),
            sensors::RAW => {
                let (content, from) = (&self.stream.ahead()[HEADER..end], sensors::RAW_HEAD);
                if sensors::has_raw(content, from) {
                    part = (from, sensors::next_raw(content, from));
                } else if is_sound {
                    return None;
                }
                ("ESF-RAW", Kind::Sensors(id, sensors::columns(id)))
            }
            _ => {
                let layout = of_id(&self.layouts, id, end - HEADER)?;
                (self.layouts[layout].1.name, Kind::Fields(layout))
            }
        };
        let topic = self.topic(name, || is_sound.then_some(kind))?;
        let content = &self.stream.ahead()[HEADER..end];
        let stamp = match &self.of_topics[topic] {
            Kind::Fields(layout) if is_sound => self.clock.stamp(&self.layouts[*layout].1, content),
            _ => self.clock.newest(),
        };
        Some(Current {
            stamp,
            topic,
            length: end,
            // The length may be wrong too.
            next: if is_sound { length } else { 1 },
            is_sound,
            part,
        })
    }

    /// The topic of a sentence.
    fn sentence(&mut self, length: usize) -> Option<Current> {
        let line = &self.stream.ahead()[..length];
        let name = Sentence::address(line)?.to_owned();
        let columns = Sentence::of(line).ok().map(|sentence| Columns::of(&sentence));
        let is_sound = columns.is_some();
        let topic = self.topic(&name, || columns.map(Kind::Sentence))?;
        let sentence = Sentence::of(&self.stream.ahead()[..length]).ok();
        Some(Current {
            stamp: sentence.and_then(|sentence| self.calendar.stamp(&sentence)),
            topic,
            length,
            next: if is_sound { length } else { 1 },
            is_sound: true,
            part: (0, 0),
        })
    }

    /// Something known begins here: the bytes before it are damage.
    fn known(&mut self) {
        self.open = None;
        if let Some(from) = self.unknown.take() {
            self.damage.add(from, self.stream.at());
        }
    }

    /// Continues with the next tag of a message `ESF-RAW`.
    fn next_part(&mut self, current: Current) -> Option<usize> {
        let (_, end) = current.part;
        let content = self.stream.ahead().get(HEADER..current.length)?;
        if !current.is_sound || end == 0 || !sensors::has_raw(content, end) {
            return None;
        }
        let part = (end, sensors::next_raw(content, end));
        self.current = Some(Current { part, ..current });
        Some(current.topic)
    }
}

/// The layout of a message. If there are several versions, the longest one that it fills, or else the first one.
fn of_id(layouts: &[([u8; 2], Layout)], id: [u8; 2], length: usize) -> Option<usize> {
    let all = || layouts.iter().enumerate().filter(|(_, (of, _))| *of == id);
    let filled = all().filter(|(_, (_, layout))| layout.length() <= length);
    let longest = filled.max_by_key(|(_, (_, layout))| layout.length());
    longest.or_else(|| all().next()).map(|(k, _)| k)
}

/// Reads on to the next frame; `None` at the end of the file.
fn next(stream: &mut Stream) -> Result<Option<Frame>, Broken> {
    let mut wanted = 1;
    loop {
        let ahead = stream.fill(wanted)?;
        if ahead.is_empty() {
            return Ok(None);
        }
        match frame::of(ahead) {
            Frame::Short(length) if ahead.len() >= wanted && length > wanted => wanted = length,
            frame => return Ok(Some(frame)),
        }
    }
}

impl MessageReader for Ubx {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        let unread = OpenContext {
            unread: Default::default(),
            ..context.clone()
        };
        let damaged = |broken: Broken| DataError::new(file.name(), broken.to_string());
        let beginning = Self::beginning(Stream::open(file, &unread)?).map_err(damaged)?;
        Ok(Self::of(Stream::open(file, context)?, beginning))
    }

    fn advance(&mut self) -> Result<Option<usize>, Broken> {
        if let Some(current) = self.current.take() {
            if let Some(topic) = self.next_part(current) {
                return Ok(Some(topic));
            }
            self.stream.consume(current.next);
        }
        while let Some(frame) = next(&mut self.stream)? {
            let at = self.stream.at();
            let (current, length) = match frame {
                Frame::Ubx { id, length, is_sound } => {
                    let current = self.ubx(id, length, is_sound);
                    (current, if is_sound { length } else { 0 })
                }
                Frame::Nmea(length) => {
                    let current = self.sentence(length);
                    (
                        current,
                        if current.is_some_and(|current| current.next == length) {
                            length
                        } else {
                            0
                        },
                    )
                }
                Frame::Rtcm(length) => (None, length),
                Frame::Short(_) => {
                    self.open.get_or_insert(at);
                    (None, 0)
                }
                Frame::Other => (None, 0),
            };
            match length {
                // A malformed message counts itself.
                0 if current.is_none() => {
                    self.unknown.get_or_insert(at);
                    self.stream.consume(1);
                    continue;
                }
                0 => {}
                _ => self.known(),
            }
            match current {
                Some(current) => {
                    self.current = Some(current);
                    return Ok(Some(current.topic));
                }
                None => self.stream.consume(length),
            }
        }
        if let Some(open) = self.open.take() {
            return Err(Broken::at(open, "the file is cut off within a message"));
        }
        self.known();
        self.damage.reported()
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn columns(&self, topic: usize) -> &[String] {
        match &self.of_topics[topic] {
            Kind::Fields(layout) => &self.layouts[*layout].1.columns,
            Kind::Sensors(_, columns) => columns,
            Kind::Sentence(columns) => &columns.names,
        }
    }

    fn label(&self, topic: usize, column: usize) -> Option<String> {
        match &self.of_topics[topic] {
            Kind::Fields(layout) => self.layouts[*layout].1.label(column),
            Kind::Sensors(id, _) => sensors::label(*id, column),
            Kind::Sentence(columns) => columns.label(column),
        }
    }

    fn role(&self, topic: usize) -> Role {
        match self.topics[topic].name.as_str() {
            name if matches!(self.of_topics[topic], Kind::Sentence(_)) => nmea::role(name),
            // The receiver's own filter of its sensors.
            "NAV-ATT" | "ESF-ALG" => Role::Estimate,
            "NAV-STATUS" | "NAV-DOP" | "NAV-CLOCK" | "NAV-COV" | "NAV-TIMEGPS" | "NAV-TIMEUTC" | "TIM-TP" | "TIM-TM2" => Role::Other,
            name if name.starts_with("HNR-") => Role::Estimate,
            _ => Role::Measurement,
        }
    }

    fn remarks(&self) -> Vec<String> {
        let week = "no message has the week: stamps count from the start of a week";
        (!self.has_week).then(|| week.to_owned()).into_iter().collect()
    }

    fn decode(&mut self, cells: &mut Cells) -> Result<(), String> {
        let Some(Current {
            topic,
            length,
            is_sound,
            stamp,
            part,
            ..
        }) = self.current
        else {
            return Ok(());
        };
        if !is_sound {
            return Err("its checksum is wrong".to_owned());
        }
        match stamp {
            Some(stamp) => cells.integer(stamp),
            None => cells.empty(),
        }
        let ahead = self.stream.ahead();
        match &self.of_topics[topic] {
            Kind::Sentence(columns) => return columns.decode(&Sentence::of(&ahead[..length])?, cells),
            Kind::Fields(layout) => self.layouts[*layout].1.decode(&ahead[HEADER..length], cells),
            Kind::Sensors(sensors::MEAS, _) => return sensors::decode_meas(&ahead[HEADER..length], cells),
            Kind::Sensors(..) => sensors::decode_raw(&ahead[HEADER..length][part.0..part.1], cells),
        }
        Ok(())
    }
}
