//! The messages of one topic as rows.

use super::pass::{MOST_WAITING, Message, Next, Pass};
use super::{Broken, MessageReader};
use core::fmt;
use fusion::models::block::BuildError;
use fusion::rows::{DataError, SourceError};
use fusion::source::decode::{Cell, Malformed, RawRows};
use fusion::source::{DataFile, OpenContext, SharedReaders};
use std::sync::{Arc, Mutex, PoisonError};

/// Names in a message about a topic that does not exist; more would hide the message.
const MOST_NAMED: usize = 40;

/// A pass of several sources.
type SharedPass<R> = Arc<Mutex<Pass<R>>>;

/// The messages of one topic as rows.
pub struct Read<R> {
    file: DataFile,
    context: OpenContext,
    topic: String,
    /// The topic and its list, if the elements of a list are the rows.
    list: Option<(String, String)>,
    columns: Vec<String>,
    /// The columns that are read; `None`: all.
    wanted: Option<Vec<usize>>,
    pub(super) pass: SharedPass<R>,
    pub(super) queue: usize,
    /// The place of each column among the cells of a message, once there is one.
    places: Vec<usize>,
    pub(super) message: Message,
}

/// The place of a column without cells.
const NONE: usize = usize::MAX;

impl<R> fmt::Debug for Read<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Read").field("topic", &self.topic).finish_non_exhaustive()
    }
}

/// Opens a topic of a log; without a name, the only topic of the log. With a list `each`, its elements are the rows.
///
/// # Errors
/// The log cannot be opened, or has no such topic or list, or has several topics if none is named.
pub fn open<R: MessageReader>(
    file: &DataFile,
    context: &OpenContext,
    topic: Option<&str>,
    each: Option<&str>,
) -> Result<Read<R>, SourceError> {
    let list = match (topic, each) {
        (Some(topic), Some(list)) => Some((topic.to_owned(), list.to_owned())),
        (None, Some(_)) => return Err(BuildError::at("each", "a list needs the `topic` that has it").into()),
        (_, None) => None,
    };
    let Found {
        topic,
        columns,
        pass,
        queue,
    } = if context.arriving.is_some() {
        arriving::<R>(file, context, topic, list.as_ref())?
    } else {
        recorded::<R>(file, context, topic, list.as_ref())?
    };
    Ok(Read {
        file: file.clone(),
        context: context.clone(),
        topic,
        list,
        columns,
        wanted: None,
        pass,
        queue,
        places: Vec::new(),
        message: Message::default(),
    })
}

/// The topic of a source, and the queue of its messages.
struct Found<R> {
    topic: String,
    columns: Vec<String>,
    pass: SharedPass<R>,
    queue: usize,
}

/// Finds a topic of a file, which is read once for all sources.
fn recorded<R: MessageReader>(
    file: &DataFile,
    context: &OpenContext,
    topic: Option<&str>,
    list: Option<&(String, String)>,
) -> Result<Found<R>, SourceError> {
    let (topic, columns) = first::<R>(file, context, topic, list)?;
    let pass = context.shared.reader(file.path(), || pass::<R>(file, context))?;
    let joined = pass.lock().unwrap_or_else(PoisonError::into_inner).join(&topic, list);
    let (pass, queue) = match joined {
        Some(queue) => (pass, queue),
        None => alone(file, context, &topic, list)?,
    };
    Ok(Found {
        topic,
        columns,
        pass,
        queue,
    })
}

/// Waits for the first message of a topic, or of any topic if none is named. The bytes come once: the pass continues after
/// this message.
fn arriving<R: MessageReader>(
    file: &DataFile,
    context: &OpenContext,
    topic: Option<&str>,
    list: Option<&(String, String)>,
) -> Result<Found<R>, SourceError> {
    let mut reader = reader::<R>(file, context)?;
    let elements = elements(&mut reader, list)?;
    let wanted = elements.as_deref().or(topic);
    let (number, broken) = next_of(&mut reader, wanted);
    let Some(number) = number else {
        return Err(without(&reader, file, wanted, broken));
    };
    let (topic, columns) = (reader.topics()[number].name.clone(), reader.columns(number).to_vec());
    let mut pass = Pass::new(reader, MOST_WAITING);
    let queue = pass.join(&topic, None).unwrap_or_default();
    pass.deliver(number);
    Ok(Found {
        topic,
        columns,
        pass: Arc::new(Mutex::new(pass)),
        queue,
    })
}

/// The name of the topic of the elements of a list.
fn elements<R: MessageReader>(reader: &mut R, list: Option<&(String, String)>) -> Result<Option<String>, BuildError> {
    let elements = list.map(|(topic, list)| reader.split(topic, list)).transpose();
    elements.map_err(|why| BuildError::at("each", why))
}

/// Reads on to the next message of a topic, or of any topic, and returns the number of the topic, or the damage before.
fn next_of<R: MessageReader>(reader: &mut R, wanted: Option<&str>) -> (Option<usize>, Option<Broken>) {
    loop {
        match reader.advance() {
            Ok(Some(topic)) if wanted.is_none_or(|wanted| reader.topics()[topic].name == wanted) => return (Some(topic), None),
            Ok(Some(_)) => {}
            Ok(None) => return (None, None),
            Err(broken) => return (None, Some(broken)),
        }
    }
}

fn pass<R: MessageReader>(file: &DataFile, context: &OpenContext) -> Result<Mutex<Pass<R>>, SourceError> {
    Ok(Mutex::new(Pass::new(reader(file, context)?, MOST_WAITING)))
}

/// Opens a reader. It gets no shared readers: one that keeps its context would otherwise keep itself, and its file, for
/// ever.
fn reader<R: MessageReader>(file: &DataFile, context: &OpenContext) -> Result<R, SourceError> {
    let context = OpenContext {
        shared: SharedReaders::default(),
        ..context.clone()
    };
    R::open(file, &context)
}

/// A pass for one source.
fn alone<R: MessageReader>(
    file: &DataFile,
    context: &OpenContext,
    topic: &str,
    list: Option<&(String, String)>,
) -> Result<(SharedPass<R>, usize), SourceError> {
    let mut pass = Pass::new(reader(file, context)?, MOST_WAITING);
    let queue = pass.join(topic, list).unwrap_or_default();
    Ok((Arc::new(Mutex::new(pass)), queue))
}

/// The name and the columns of a topic, from its first message.
fn first<R: MessageReader>(
    file: &DataFile,
    context: &OpenContext,
    topic: Option<&str>,
    list: Option<&(String, String)>,
) -> Result<(String, Vec<String>), SourceError> {
    let context = OpenContext {
        unread: Default::default(),
        ..context.clone()
    };
    let mut reader = R::open(file, &context)?;
    let elements = elements(&mut reader, list)?;
    let wanted = elements.as_deref().or(topic);
    let (mut found, mut broken) = next_of(&mut reader, wanted);
    // All topics have to be known before one can be called the only one.
    while let (None, Some(only)) = (wanted, found) {
        match next_of(&mut reader, None) {
            (Some(topic), _) if topic == only => {}
            (Some(_), _) => found = None,
            (None, damage) => {
                broken = damage;
                break;
            }
        }
    }
    match found {
        Some(topic) => Ok((reader.topics()[topic].name.clone(), reader.columns(topic).to_vec())),
        None => Err(without(&reader, file, wanted, broken)),
    }
}

/// That a log has no message of a topic, or several topics and none is named.
fn without<R: MessageReader>(reader: &R, file: &DataFile, wanted: Option<&str>, broken: Option<Broken>) -> SourceError {
    let name = file.name();
    let mut known: Vec<String> = reader.topics().iter().map(|topic| format!("`{}`", topic.name)).collect();
    if known.is_empty() {
        let why = broken.map_or_else(|| "this log has no messages".to_owned(), |broken| broken.to_string());
        return DataError::new(name, why).into();
    }
    let further = known.len().saturating_sub(MOST_NAMED);
    known.truncate(MOST_NAMED);
    let further = if further > 0 {
        format!(" and {further} more")
    } else {
        String::new()
    };
    let mut help = format!("its topics: {}{further}", known.join(", "));
    if let Some(broken) = broken {
        help = format!("{help}; reading ends: {broken}");
    }
    let message = match wanted {
        Some(wanted) => format!("`{name}` has no message of the topic `{wanted}`"),
        None => format!("`{name}` has several topics, and the source names none"),
    };
    BuildError::at("topic", message).help(help).into()
}

impl<R: MessageReader> Read<R> {
    /// Reads the file itself, up to the last message that it has got.
    fn catch_up(&mut self) -> Result<(), DataError> {
        let unreadable = |error: SourceError| DataError::new(self.file.name(), error.to_string());
        let done = self.message.number;
        (self.pass, self.queue) = alone(&self.file, &self.context, &self.topic, self.list.as_ref()).map_err(unreadable)?;
        self.places.clear();
        let mut pass = self.pass.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(wanted) = &self.wanted {
            pass.select(self.queue, wanted);
        }
        for _ in 0..done {
            pass.next(self.queue, &mut self.message);
        }
        Ok(())
    }
}

/// The place of each column among the cells of the selected columns, or of all.
fn places(columns: usize, selected: Option<&[usize]>) -> Vec<usize> {
    let Some(selected) = selected else { return (0..columns).collect() };
    let place = |column| selected.binary_search(&column).unwrap_or(NONE);
    (0..columns).map(place).collect()
}

impl<R: MessageReader> RawRows for Read<R> {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn select(&mut self, columns: &[usize]) {
        self.pass.lock().unwrap_or_else(PoisonError::into_inner).select(self.queue, columns);
        self.wanted = Some(columns.to_owned());
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        loop {
            let mut pass = self.pass.lock().unwrap_or_else(PoisonError::into_inner);
            match pass.next(self.queue, &mut self.message) {
                Next::Message => {
                    if self.places.is_empty() {
                        self.places = places(self.columns.len(), pass.selected(self.queue));
                    }
                    return Ok(true);
                }
                Next::End => return Ok(false),
                Next::LeftBehind => {}
            }
            drop(pass);
            self.catch_up()?;
        }
    }

    fn place(&self) -> usize {
        self.message.number
    }

    fn counted(&self) -> &'static str {
        "message"
    }

    #[inline]
    fn cell(&self, column: usize) -> Cell<'_> {
        self.message.cells.get(self.places.get(column).copied().unwrap_or(NONE))
    }

    fn malformed(&self) -> Option<Malformed> {
        self.message.wrong.clone().map(|message| Malformed {
            message,
            help: "is this message damaged?",
            is_last: self.message.is_last,
        })
    }
}
