//! Reads the messages of a stream or of a log with the stamps of its recorder.

use super::clock::{CENTURY, Clock};
use super::definition::{self, Message};
use super::frame::{self, Frame, Sound};
use super::meaning;
use crate::LONGEST_ARRAY;
use crate::damage::Damage;
use crate::messages::{Broken, Cells, MessageReader};
use crate::stream::Stream;
use core::fmt::Write;
use core::ops::Range;
use fusion::rows::{DataError, SourceError};
use fusion::source::table::{Role, Topic};
use fusion::source::{DataFile, OpenContext};
use std::collections::{BTreeMap, HashMap};

/// The columns of all messages, and of those that a recorder has stamped.
const STAMP: &str = "stamp";
const LOG_TIME: &str = "log_time";
/// Bytes of the stamp of a recorder.
const RECORDED: usize = 8;
/// Messages of all senders. A network of ten vehicles has some thousand.
const MOST_TOPICS: usize = 1 << 14;
/// Types that are counted although they are not known.
const MOST_UNKNOWN: usize = 1 << 10;
/// Types that a remark names.
const MOST_NAMED: usize = 8;

/// Reads messages.
pub(crate) struct Mavlink {
    stream: Stream,
    all: &'static BTreeMap<u32, Message>,
    /// Whether a recorder has stamped the frames; `None` before the first message.
    is_recorded: Option<bool>,
    clock: Clock,
    topics: Vec<Topic>,
    known: Vec<Known>,
    of_senders: HashMap<(u32, (u8, u8)), usize>,
    current: Option<Current>,
    /// Bytes that begin nothing, from this one on.
    noise: Option<u64>,
    /// A frame that the file does not end.
    open: Option<u64>,
    damage: Damage,
    /// Frames of each type that is not known.
    unknown: BTreeMap<u32, usize>,
}

/// The messages of a topic.
struct Known {
    message: &'static Message,
    columns: Vec<String>,
    /// The field and the element of each column after the stamps.
    cells: Vec<(usize, Option<usize>)>,
}

/// The current message.
#[derive(Clone, Debug)]
struct Current {
    topic: usize,
    stamp: Option<i64>,
    /// The stamp of the recorder.
    log_time: Option<i64>,
    content: Range<usize>,
    length: usize,
}

/// The bytes before a frame, and the frame.
type Record = (usize, Frame);

impl Mavlink {
    pub(super) fn of(stream: Stream) -> Result<Self, String> {
        Ok(Self {
            stream,
            all: definition::all()?,
            is_recorded: None,
            clock: Clock::default(),
            topics: Vec::new(),
            known: Vec::new(),
            of_senders: HashMap::new(),
            current: None,
            noise: None,
            open: None,
            damage: Damage::default(),
            unknown: BTreeMap::new(),
        })
    }

    /// The record at the start of these bytes. The first sound message shows whether a recorder has stamped it.
    fn record(&self, ahead: &[u8]) -> Record {
        let is_recorded = self.is_recorded.unwrap_or(ahead.first() == Some(&0));
        let before = if is_recorded { RECORDED } else { 0 };
        let frame = match ahead.get(before..) {
            Some(frame) if before == 0 || recorded(ahead).is_some() => frame::of(frame, self.all),
            // The first byte of a stamp of this century is zero.
            None if ahead.first() == Some(&0) => Frame::Short(1),
            _ => Frame::Other,
        };
        match frame {
            Frame::Short(length) => (before, Frame::Short(before + length)),
            frame => (before, frame),
        }
    }

    /// Reads on to the next record; `None` at the end of the file.
    ///
    /// No byte beyond a record is asked for. After noise, a mark may be noise too: then a sound message within the bytes
    /// that would be its frame is not kept waiting for the rest of them.
    fn next(&mut self) -> Result<Option<Record>, Broken> {
        let mut wanted = 1;
        loop {
            self.stream.fill(wanted)?;
            let ahead = self.stream.ahead();
            if ahead.is_empty() {
                return Ok(None);
            }
            let record = self.record(ahead);
            match record {
                (_, Frame::Short(length)) if ahead.len() >= wanted && !self.is_lost() => wanted = length,
                (_, Frame::Short(_)) if ahead.len() >= wanted => {
                    let is_sound = |from: usize| matches!(self.record(&ahead[from..]), (_, Frame::Sound(_)));
                    if (1..ahead.len()).any(is_sound) {
                        return Ok(Some((0, Frame::Other)));
                    }
                    wanted = ahead.len() + 1;
                }
                record => return Ok(Some(record)),
            }
        }
    }

    /// Whether the place is not known to be the end of a frame.
    const fn is_lost(&self) -> bool {
        self.noise.is_some() || self.is_recorded.is_none()
    }

    /// Whether the file ends, or another frame begins, after this many bytes.
    fn ends_after(&mut self, before: usize, length: usize) -> Result<bool, Broken> {
        let ahead = self.stream.fill(length + before + 1)?;
        let rest = ahead.get(length..).unwrap_or_default();
        Ok(rest.is_empty() || rest.get(before).is_some_and(|byte| frame::is_mark(*byte)))
    }

    /// A frame begins here: the bytes before it are damage.
    fn begin(&mut self) {
        self.open = None;
        if let Some(from) = self.noise.take() {
            self.damage.add(from, self.stream.at());
        }
    }

    /// The topic of a message of a sender; `None` if there are too many.
    fn topic(&mut self, message: &'static Message, sender: (u8, u8)) -> Option<usize> {
        if let Some(topic) = self.of_senders.get(&(message.id, sender)) {
            return Some(*topic);
        }
        if self.topics.len() == MOST_TOPICS {
            return None;
        }
        let is_first = self.known.iter().all(|known| known.message.id != message.id);
        let name = match sender {
            _ if is_first => message.name.to_owned(),
            (system, component) => format!("{}[{system}.{component}]", message.name),
        };
        self.topics.push(Topic {
            name,
            message_type: format!("MAVLink {}", message.name),
        });
        self.known.push(Known::of(message, self.is_recorded == Some(true)));
        self.of_senders.insert((message.id, sender), self.topics.len() - 1);
        Some(self.topics.len() - 1)
    }

    /// Makes a message the current one.
    fn receive(&mut self, before: usize, sound: Sound) -> Option<usize> {
        self.is_recorded.get_or_insert(before > 0);
        let topic = self.topic(sound.message, sound.sender)?;
        let ahead = self.stream.ahead();
        let content = before + sound.content.start..before + sound.content.end;
        self.current = Some(Current {
            topic,
            stamp: self.clock.stamp(sound.message, &ahead[content.clone()], sound.sender),
            log_time: recorded(ahead).filter(|_| before > 0),
            content,
            length: before + sound.length,
        });
        Some(topic)
    }

    fn count(&mut self, id: u32) {
        if self.unknown.len() < MOST_UNKNOWN || self.unknown.contains_key(&id) {
            *self.unknown.entry(id).or_default() += 1;
        }
    }
}

/// The stamp of a recorder \[µs\].
fn recorded(ahead: &[u8]) -> Option<i64> {
    let stamp = i64::from_be_bytes(*ahead.first_chunk()?);
    CENTURY.contains(&stamp).then_some(stamp)
}

impl Known {
    fn of(message: &'static Message, is_recorded: bool) -> Self {
        let mut columns = vec![STAMP.to_owned()];
        columns.extend(is_recorded.then(|| LOG_TIME.to_owned()));
        let mut cells = Vec::new();
        for (k, field) in message.fields.iter().enumerate() {
            let is_one = field.count.is_none() || field.form == definition::Form::Text;
            match field.count.filter(|_| !is_one) {
                None => {
                    columns.push(field.name.to_owned());
                    cells.push((k, None));
                }
                Some(count) if count <= LONGEST_ARRAY => {
                    columns.extend((0..count).map(|element| format!("{}[{element}]", field.name)));
                    cells.extend((0..count).map(|element| (k, Some(element))));
                }
                Some(_) => {}
            }
        }
        Self { message, columns, cells }
    }
}

impl MessageReader for Mavlink {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        Self::of(Stream::open(file, context)?).map_err(|why| DataError::new(file.name(), why).into())
    }

    fn advance(&mut self) -> Result<Option<usize>, Broken> {
        if let Some(Current { length, .. }) = self.current.take() {
            self.stream.consume(length);
        }
        while let Some((before, frame)) = self.next()? {
            let at = self.stream.at();
            match frame {
                Frame::Sound(sound) => {
                    self.begin();
                    let length = before + sound.length;
                    if let Some(topic) = self.receive(before, sound) {
                        return Ok(Some(topic));
                    }
                    self.stream.consume(length);
                    self.damage.add(at, self.stream.at());
                }
                Frame::Doubtful { id, is_known, length } if self.ends_after(before, before + length)? => {
                    self.begin();
                    self.stream.consume(before + length);
                    if is_known {
                        self.damage.add(at, self.stream.at());
                    } else {
                        self.count(id);
                    }
                }
                other => {
                    if matches!(other, Frame::Short(_)) {
                        self.open.get_or_insert(at);
                    }
                    self.noise.get_or_insert(at);
                    self.stream.consume(1);
                }
            }
        }
        if let Some(open) = self.open.take() {
            return Err(Broken::at(open, "the file is cut off within a message"));
        }
        self.begin();
        self.damage.reported()
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn columns(&self, topic: usize) -> &[String] {
        &self.known[topic].columns
    }

    fn label(&self, topic: usize, column: usize) -> Option<String> {
        let Known { message, columns, cells } = &self.known[topic];
        let (field, element) = *cells.get(column.checked_sub(columns.len() - cells.len())?)?;
        meaning::label(message, &message.fields[field], element)
    }

    fn role(&self, topic: usize) -> Role {
        meaning::role(self.known[topic].message.name)
    }

    fn remarks(&self) -> Vec<String> {
        if self.unknown.is_empty() {
            return Vec::new();
        }
        let mut said = format!("{} messages are of types that are not known:", self.unknown.values().sum::<usize>());
        for (k, (id, count)) in self.unknown.iter().take(MOST_NAMED).enumerate() {
            let comma = if k > 0 { "," } else { "" };
            let _ = write!(said, "{comma} {count} with the number {id}");
        }
        let further = self.unknown.len().saturating_sub(MOST_NAMED);
        if further > 0 {
            let _ = write!(said, ", and {further} further numbers");
        }
        vec![said]
    }

    fn decode(&mut self, cells: &mut Cells) -> Result<(), String> {
        let Some(Current {
            topic,
            stamp,
            log_time,
            content,
            ..
        }) = self.current.clone()
        else {
            return Ok(());
        };
        let content = &self.stream.ahead()[content];
        let known = &self.known[topic];
        match stamp {
            Some(stamp) => cells.integer(stamp),
            None => cells.empty(),
        }
        if let Some(log_time) = log_time {
            cells.integer(log_time);
        }
        for (field, element) in &known.cells {
            known.message.fields[*field].decode(content, element.unwrap_or(0), cells);
        }
        Ok(())
    }
}
