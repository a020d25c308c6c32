//! The topics of a log whose messages have a schema: bags, and MCAP.
//!
//! The first message of a topic defines its columns. The first two are `stamp`, that of the message's header if it has
//! one, and `log_time`, when it was recorded: both in nanoseconds since 1970.
//!
//! A list of messages in a message can be split: each element is then a message of the topic `TOPIC LIST[]`.

#[cfg(test)]
pub(crate) mod testing;

use crate::messages::Cells;
use core::ops::Range;
use fusion::source::table::Topic;
use std::collections::VecDeque;

/// The columns that all messages have.
pub(crate) const STAMPS: [&str; 2] = ["stamp", "log_time"];

/// A message type as its log describes it.
pub(crate) trait Schema: Send {
    /// Learns how the first message, or the element at this place of it, becomes cells.
    ///
    /// # Errors
    /// Its type cannot be read.
    fn learn(&self, message: &[u8], place: Range<usize>) -> Result<Box<dyn Decoder>, String>;

    /// Finds a list of messages in this type.
    ///
    /// # Errors
    /// There is no such list.
    fn split(&self, list: &str) -> Result<Box<dyn Split>, String>;
}

/// How the messages of a topic become cells.
pub(crate) trait Decoder: Send {
    /// The names of the cells: [`STAMPS`], then the fields.
    fn columns(&self) -> &[String];

    /// As [`MessageReader::select`](crate::messages::MessageReader::select).
    fn select(&mut self, _columns: &[usize]) -> Option<Vec<usize>> {
        None
    }

    /// Adds the cells of a message, or of the element at this place of it. `usual` is its stamp if it has no header.
    ///
    /// # Errors
    /// The message is damaged, or does not fit its type.
    fn decode(&mut self, message: &[u8], place: Range<usize>, usual: i64, log_time: i64, cells: &mut Cells) -> Result<(), String>;
}

/// The elements of a list.
pub(crate) trait Split: Send {
    /// The type of an element, and its name.
    fn schema(&self) -> (&dyn Schema, &str);

    /// Writes the places of the elements of a message, and returns the stamp of its header, if it has one.
    ///
    /// # Errors
    /// The message is damaged, or does not fit its type.
    fn places(&self, message: &[u8], places: &mut Vec<Range<usize>>) -> Result<Option<i64>, String>;
}

/// A type that cannot be read: its messages have stamps only.
pub(crate) struct Unreadable(pub(crate) String);

impl Schema for Unreadable {
    fn learn(&self, _message: &[u8], _place: Range<usize>) -> Result<Box<dyn Decoder>, String> {
        Err(self.0.clone())
    }

    fn split(&self, _list: &str) -> Result<Box<dyn Split>, String> {
        Err(self.0.clone())
    }
}

/// A message without columns for its fields.
struct Opaque([String; 2]);

impl Decoder for Opaque {
    fn columns(&self) -> &[String] {
        &self.0
    }

    fn decode(&mut self, _message: &[u8], _place: Range<usize>, usual: i64, log_time: i64, cells: &mut Cells) -> Result<(), String> {
        cells.integer(usual);
        cells.integer(log_time);
        Ok(())
    }
}

/// The topics of a log.
#[derive(Default)]
pub(crate) struct Streams {
    topics: Vec<Topic>,
    decoders: Vec<Box<dyn Decoder>>,
    channels: Vec<Channel>,
    /// Topics and their lists that are split.
    wanted: Vec<(String, String)>,
    current: Current,
    /// The elements of the current message that follow.
    elements: VecDeque<(Place, Current)>,
    places: Vec<Range<usize>>,
}

/// A channel of a log: messages of one type on one topic.
struct Channel {
    topic: String,
    message_type: String,
    schema: Box<dyn Schema>,
    number: Option<usize>,
    /// Set at the first message.
    lists: Option<Vec<List>>,
}

struct List {
    name: String,
    split: Box<dyn Split>,
    number: Option<usize>,
}

/// A list of a channel.
type Place = (usize, usize);

/// The current message.
#[derive(Clone, Default)]
struct Current {
    topic: usize,
    place: Range<usize>,
    usual: i64,
    log_time: i64,
}

/// The name of the topic of the elements of a list.
fn split_name(topic: &str, list: &str) -> String {
    format!("{topic} {list}[]")
}

impl Streams {
    pub(crate) fn topics(&self) -> &[Topic] {
        &self.topics
    }

    pub(crate) fn columns(&self, topic: usize) -> &[String] {
        self.decoders[topic].columns()
    }

    pub(crate) fn select(&mut self, topic: usize, columns: &[usize]) -> Option<Vec<usize>> {
        self.decoders[topic].select(columns)
    }

    /// Makes the elements of a list of a topic messages of a topic, and returns its name.
    pub(crate) fn split(&mut self, topic: &str, list: &str) -> String {
        let wanted = (topic.to_owned(), list.to_owned());
        if !self.wanted.contains(&wanted) {
            self.wanted.push(wanted);
        }
        split_name(topic, list)
    }

    /// Adds a channel, and returns its number.
    pub(crate) fn add(&mut self, topic: &str, message_type: &str, schema: Box<dyn Schema>) -> usize {
        self.channels.push(Channel {
            topic: topic.to_owned(),
            message_type: message_type.to_owned(),
            schema,
            number: None,
            lists: None,
        });
        self.channels.len() - 1
    }

    /// Makes this message of a channel the current message, and returns its topic.
    ///
    /// # Errors
    /// A list that is to be split does not exist.
    pub(crate) fn receive(&mut self, channel: usize, message: &[u8], log_time: i64) -> Result<usize, String> {
        let number = match self.channels[channel].number {
            Some(number) => number,
            None => self.begin(channel, message)?,
        };
        self.current = Current {
            topic: number,
            place: 0..message.len(),
            usual: log_time,
            log_time,
        };
        self.elements.clear();
        for (k, list) in self.channels[channel].lists.iter().flatten().enumerate() {
            // The topic of the message reports what is wrong with it.
            let Ok(stamp) = list.split.places(message, &mut self.places) else {
                continue;
            };
            let elements = self.places.drain(..).map(|place| Current {
                topic: number,
                place,
                usual: stamp.unwrap_or(log_time),
                log_time,
            });
            self.elements.extend(elements.map(|element| ((channel, k), element)));
        }
        Ok(number)
    }

    /// Begins the topic of a channel, and finds its lists.
    fn begin(&mut self, channel: usize, message: &[u8]) -> Result<usize, String> {
        let Channel {
            topic,
            message_type,
            schema,
            ..
        } = &self.channels[channel];
        let lists = self.wanted.iter().filter(|(of, _)| of == topic).map(|(_, list)| {
            Ok(List {
                name: list.clone(),
                split: schema.split(list)?,
                number: None,
            })
        });
        let lists: Result<Vec<List>, String> = lists.collect();
        let (lists, learnt) = (lists?, schema.learn(message, 0..message.len()));
        let (topic, message_type) = (topic.clone(), message_type.clone());
        let number = self.open(topic, message_type, learnt);
        let channel = &mut self.channels[channel];
        (channel.lists, channel.number) = (Some(lists), Some(number));
        Ok(number)
    }

    /// The number of a topic. Channels of one topic have different numbers if their columns differ.
    fn open(&mut self, name: String, mut message_type: String, learnt: Result<Box<dyn Decoder>, String>) -> usize {
        let decoder = learnt.unwrap_or_else(|why| {
            message_type = format!("{message_type}: {why}");
            Box::new(Opaque(STAMPS.map(str::to_owned)))
        });
        let named = |name: &str| self.topics.iter().position(|topic| topic.name == *name);
        let mut free = name.clone();
        let mut twin = 2;
        while let Some(known) = named(&free) {
            if self.topics[known].message_type == message_type && self.columns(known) == decoder.columns() {
                return known;
            }
            free = format!("{name} ({twin})");
            twin += 1;
        }
        self.topics.push(Topic { name: free, message_type });
        self.decoders.push(decoder);
        self.topics.len() - 1
    }

    /// Makes the next element of the current message the current message, and returns its topic.
    pub(crate) fn next_element(&mut self, message: &[u8]) -> Option<usize> {
        let ((channel, k), element) = self.elements.pop_front()?;
        let Channel { topic, lists, .. } = &self.channels[channel];
        let list = &lists.as_ref()?[k];
        let number = match list.number {
            Some(number) => number,
            None => {
                let (schema, message_type) = list.split.schema();
                let learnt = schema.learn(message, element.place.clone());
                let (name, message_type) = (split_name(topic, &list.name), message_type.to_owned());
                let number = self.open(name, message_type, learnt);
                self.channels[channel].lists.as_mut()?[k].number = Some(number);
                number
            }
        };
        self.current = Current { topic: number, ..element };
        Some(number)
    }

    /// Adds the cells of the current message.
    ///
    /// # Errors
    /// The message is damaged, or does not fit its type.
    pub(crate) fn decode(&mut self, message: &[u8], cells: &mut Cells) -> Result<(), String> {
        let Current {
            topic,
            place,
            usual,
            log_time,
        } = self.current.clone();
        self.decoders[topic].decode(message, place, usual, log_time, cells)
    }
}
