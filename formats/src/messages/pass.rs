//! One pass over a log for all of its readers.

use super::{Broken, Cells, MessageReader};
use std::collections::VecDeque;

/// Messages that wait for their source have at most this number of bytes. If the sources of a run lie further apart in
/// a file, one of them reads the file itself.
pub const MOST_WAITING: usize = 64 << 20;

/// A message of a topic.
#[derive(Clone, Debug, Default)]
pub(super) struct Message {
    /// Its number among the messages of its topic, from 1.
    pub(super) number: usize,
    pub(super) cells: Cells,
    /// Why it has no cells.
    pub(super) wrong: Option<String>,
    /// The file is damaged here: no message follows.
    pub(super) is_last: bool,
}

impl Message {
    fn size(&self) -> usize {
        size_of::<Self>() + self.cells.size()
    }
}

/// The result of asking a pass for the next message.
pub(super) enum Next {
    Message,
    End,
    /// The messages of this source were not kept: it lay too far behind the others.
    LeftBehind,
}

/// One pass over a log.
pub(super) struct Pass<R> {
    reader: R,
    queues: Vec<Queue>,
    /// The topics whose messages have arrived so far.
    topics: Vec<Delivered>,
    waiting: usize,
    most: usize,
    /// Messages whose memory is used again.
    spare: Vec<Message>,
    has_begun: bool,
    has_ended: bool,
}

/// A topic, and where its messages go.
#[derive(Default)]
struct Delivered {
    queues: Vec<usize>,
    /// The columns with cells; `None`: all.
    selected: Option<Vec<usize>>,
}

/// The messages that wait for one source.
struct Queue {
    topic: String,
    /// The columns that the source reads, in order; `None`: all.
    columns: Option<Vec<usize>>,
    waiting: VecDeque<Message>,
    /// Messages of the topic so far.
    count: usize,
    is_left_behind: bool,
}

impl<R: MessageReader> Pass<R> {
    pub(super) const fn new(reader: R, most: usize) -> Self {
        Self {
            reader,
            queues: Vec::new(),
            topics: Vec::new(),
            waiting: 0,
            most,
            spare: Vec::new(),
            has_begun: false,
            has_ended: false,
        }
    }

    /// Adds a queue for the messages of a topic, or for the elements of a list of a topic; `None` if messages have been
    /// read already.
    pub(super) fn join(&mut self, topic: &str, list: Option<&(String, String)>) -> Option<usize> {
        if self.has_begun {
            return None;
        }
        if let Some((topic, list)) = list {
            self.reader.split(topic, list).ok()?;
        }
        self.queues.push(Queue {
            topic: topic.to_owned(),
            columns: None,
            waiting: VecDeque::new(),
            count: 0,
            is_left_behind: false,
        });
        Some(self.queues.len() - 1)
    }

    /// The source of a queue reads these columns only. It says so before it reads.
    pub(super) fn select(&mut self, queue: usize, columns: &[usize]) {
        self.queues[queue].columns = Some(columns.to_owned());
    }

    /// The columns whose cells the messages of a queue have, in order; `None`: all. They are known with its first message.
    pub(super) fn selected(&self, queue: usize) -> Option<&[usize]> {
        let topic = self.topics.iter().find(|topic| topic.queues.contains(&queue));
        topic?.selected.as_deref()
    }

    /// Puts the next message of a queue in place of `message`.
    pub(super) fn next(&mut self, queue: usize, message: &mut Message) -> Next {
        self.has_begun = true;
        loop {
            if let Some(next) = self.queues[queue].waiting.pop_front() {
                self.waiting -= next.size();
                self.spare.push(core::mem::replace(message, next));
                return Next::Message;
            }
            if self.queues[queue].is_left_behind {
                return Next::LeftBehind;
            }
            if self.has_ended {
                return Next::End;
            }
            match self.reader.advance() {
                Ok(Some(topic)) => self.deliver(topic),
                Ok(None) => self.has_ended = true,
                Err(broken) => self.end(&broken),
            }
        }
    }

    /// Puts the current message into the queues of its topic.
    pub(super) fn deliver(&mut self, topic: usize) {
        self.has_begun = true;
        while self.topics.len() <= topic {
            let begun = self.begin(self.topics.len());
            self.topics.push(begun);
        }
        let Some((last, others)) = self.topics[topic].queues.split_last() else {
            return;
        };
        let mut message = self.spare.pop().unwrap_or_default();
        message.cells.clear();
        message.wrong = self.reader.decode(&mut message.cells).err();
        for k in others {
            let queue = &mut self.queues[*k];
            self.waiting += queue.add(message.clone());
        }
        self.waiting += self.queues[*last].add(message);
        if self.waiting > self.most {
            self.leave_behind();
        }
    }

    /// Finds the queues of a topic, and selects the columns that their sources read.
    fn begin(&mut self, topic: usize) -> Delivered {
        let name = &self.reader.topics()[topic].name;
        let of_topic = || self.queues.iter().enumerate().filter(|(_, queue)| queue.topic == *name);
        let queues: Vec<usize> = of_topic().map(|(k, _)| k).collect();
        let columns: Option<Vec<&[usize]>> = of_topic().map(|(_, queue)| queue.columns.as_deref()).collect();
        let columns = columns.map(|all| all.concat()).filter(|_| !queues.is_empty());
        let selected = columns.and_then(|columns| self.reader.select(topic, &columns));
        Delivered { queues, selected }
    }

    /// Drops the messages of the longest queue. Its source has to read the file itself.
    fn leave_behind(&mut self) {
        if let Some(longest) = self.queues.iter_mut().max_by_key(|queue| queue.waiting.len()) {
            longest.is_left_behind = true;
            self.waiting -= longest.waiting.drain(..).map(|message| message.size()).sum::<usize>();
            self.spare.clear();
        }
    }

    fn end(&mut self, broken: &Broken) {
        self.has_ended = true;
        for queue in &mut self.queues {
            self.waiting += queue.add(Message {
                wrong: Some(broken.to_string()),
                is_last: true,
                ..Message::default()
            });
        }
    }
}

impl Queue {
    /// Adds a message, and returns its size.
    fn add(&mut self, mut message: Message) -> usize {
        self.count += 1;
        if self.is_left_behind {
            return 0;
        }
        message.number = self.count;
        let size = message.size();
        self.waiting.push_back(message);
        size
    }
}
