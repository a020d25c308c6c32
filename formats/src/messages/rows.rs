//! The messages of one topic as rows.

use super::MessageReader;
use super::pass::{MOST_WAITING, Message, Next, Pass};
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
    let (topic, columns) = first::<R>(file, context, topic, list.as_ref())?;
    let pass = context.shared.reader(file.path(), || pass::<R>(file, context))?;
    let joined = pass.lock().unwrap_or_else(PoisonError::into_inner).join(&topic, list.as_ref());
    let (pass, queue) = match joined {
        Some(queue) => (pass, queue),
        None => alone(file, context, &topic, list.as_ref())?,
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
    let elements = list.map(|(topic, list)| reader.split(topic, list)).transpose();
    let elements = elements.map_err(|why| BuildError::at("each", why))?;
    let wanted = elements.as_deref().or(topic);
    let (mut found, mut broken): (Option<usize>, _) = (None, None);
    loop {
        match reader.advance() {
            Ok(Some(topic)) if wanted.is_some_and(|wanted| reader.topics()[topic].name == wanted) => {
                found = Some(topic);
                break;
            }
            // All topics have to be known before one can be called the only one.
            Ok(Some(topic)) if wanted.is_none() && found.is_none_or(|found| found == topic) => found = Some(topic),
            Ok(Some(_)) if wanted.is_none() => {
                found = None;
                break;
            }
            Ok(Some(_)) => {}
            Ok(None) => break,
            Err(error) => {
                broken = Some(error);
                break;
            }
        }
    }
    if let Some(topic) = found {
        return Ok((reader.topics()[topic].name.clone(), reader.columns(topic).to_vec()));
    }
    let name = file.name();
    let mut known: Vec<String> = reader.topics().iter().map(|topic| format!("`{}`", topic.name)).collect();
    if known.is_empty() {
        let why = broken.map_or_else(|| "this log has no messages".to_owned(), |broken| broken.to_string());
        return Err(DataError::new(name, why).into());
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
    Err(BuildError::at("topic", message).help(help).into())
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
        self.pass
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .select(self.queue, columns);
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
