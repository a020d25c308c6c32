//! The tables of a bag.

use crate::zstd::{Frames, MAGIC, is_packed};
use core::ops::Range;
use fusion::source::DataFile;
use rusqlite::types::Type;
use rusqlite::{Connection, Error, OpenFlags, Row};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use tempfile::NamedTempFile;

/// Messages are read until they have this number of bytes, then decoded.
const BATCH: usize = 1 << 20;
/// A message that is packed has at most this number of bytes. An image has a few tens of megabytes.
const MOST_BYTES: u64 = 256 << 20;

/// A row of the table `topics`.
pub(super) struct TopicRow {
    pub(super) id: i64,
    pub(super) name: String,
    pub(super) message_type: String,
    pub(super) serialisation: String,
    /// The definition of the type, if the file has it.
    pub(super) definition: Option<String>,
}

/// A file, and the messages of it that were read last.
pub(super) struct Database {
    connection: Connection,
    /// The content of a packed file; it is removed with the database, after the connection is closed.
    _unpacked: Option<NamedTempFile>,
    /// The content of a packed message.
    message: Vec<u8>,
    pub(super) topics: Vec<TopicRow>,
    bytes: Vec<u8>,
    batch: Vec<Message>,
    next: usize,
    /// The damage after the messages of the batch.
    broken: Option<Error>,
    last_id: i64,
    has_ended: bool,
}

struct Message {
    topic: i64,
    log_time: i64,
    place: Range<usize>,
}

impl Database {
    /// # Errors
    /// The file is not a bag, or it is damaged.
    pub(super) fn open(file: &DataFile) -> Result<Self, String> {
        let unpacked = if is_packed(file.path()) { Some(unpack(file)?) } else { None };
        let path = unpacked.as_ref().map_or(file.path(), NamedTempFile::path);
        let open = |name: &str| {
            let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX | OpenFlags::SQLITE_OPEN_URI;
            let connection = Connection::open_with_flags(name, flags)?;
            let topics = topics(&connection)?;
            Ok::<_, Error>((connection, topics))
        };
        let name = uri(path);
        // A file that a recorder left in a folder without the right to write is read without a lock.
        let opened = open(&name).or_else(|_| open(&format!("{name}?immutable=1")));
        let (connection, topics) = opened.map_err(|error| format!("this is not a bag of ROS 2: {error}"))?;
        Ok(Self {
            connection,
            _unpacked: unpacked,
            message: Vec::new(),
            topics,
            bytes: Vec::new(),
            batch: Vec::new(),
            next: 0,
            broken: None,
            last_id: i64::MIN,
            has_ended: false,
        })
    }

    /// Goes to the next message, and returns its topic and when it was recorded.
    ///
    /// # Errors
    /// The file is damaged.
    pub(super) fn next(&mut self) -> Result<Option<(i64, i64)>, String> {
        if self.next == self.batch.len() {
            if let Some(error) = self.broken.take() {
                self.has_ended = true;
                return Err(error.to_string());
            }
            if self.has_ended {
                return Ok(None);
            }
            self.broken = self.read().err();
            if self.batch.is_empty() {
                return self.broken.take().map_or(Ok(None), |error| Err(error.to_string()));
            }
        }
        self.next += 1;
        let Message { topic, log_time, .. } = self.batch[self.next - 1];
        Ok(Some((topic, log_time)))
    }

    /// The current message.
    pub(super) fn message(&self) -> &[u8] {
        let current = self.next.checked_sub(1).and_then(|current| self.batch.get(current));
        current.map_or(&[], |message| &self.bytes[message.place.clone()])
    }

    /// Reads the next messages, in the order in which they were recorded.
    fn read(&mut self) -> Result<(), Error> {
        self.bytes.clear();
        self.batch.clear();
        (self.next, self.has_ended) = (0, true);
        let query = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ?1 ORDER BY id";
        let mut statement = self.connection.prepare_cached(query)?;
        let mut rows = statement.query([self.last_id])?;
        while let Some(row) = rows.next()? {
            let from = self.bytes.len();
            let message = row.get_ref(3)?.as_blob()?;
            // The encapsulation of a message that is not packed begins with a zero.
            if message.starts_with(&MAGIC) {
                unpack_message(message, &mut self.message).map_err(|error| Error::FromSqlConversionFailure(3, Type::Blob, error.into()))?;
                self.bytes.extend_from_slice(&self.message);
            } else {
                self.bytes.extend_from_slice(message);
            }
            self.last_id = row.get(0)?;
            self.batch.push(Message {
                topic: row.get(1)?,
                log_time: row.get(2)?,
                place: from..self.bytes.len(),
            });
            if self.bytes.len() >= BATCH {
                self.has_ended = false;
                break;
            }
        }
        Ok(())
    }
}

/// The content of a packed file, in the folder for temporary files: SQLite reads a file.
fn unpack(file: &DataFile) -> Result<NamedTempFile, String> {
    let copy = || {
        let mut unpacked = NamedTempFile::new()?;
        std::io::copy(&mut Frames::new(BufReader::new(File::open(file.path())?))?, &mut unpacked)?;
        Ok::<_, std::io::Error>(unpacked)
    };
    copy().map_err(|error| format!("this packed file cannot be unpacked: {error}"))
}

/// Puts the content of a packed message into a buffer.
fn unpack_message(packed: &[u8], message: &mut Vec<u8>) -> Result<(), std::io::Error> {
    message.clear();
    Frames::new(packed)?.take(MOST_BYTES + 1).read_to_end(message)?;
    if message.len() as u64 > MOST_BYTES {
        return Err(std::io::Error::other(format!("the message has more than {MOST_BYTES} bytes")));
    }
    Ok(())
}

fn topics(connection: &Connection) -> Result<Vec<TopicRow>, Error> {
    let query = "SELECT count(*) FROM sqlite_master WHERE name = 'message_definitions'";
    let has_definitions = connection.query_row(query, (), |row| row.get(0)).map(|count: i64| count > 0)?;
    let definition = "(SELECT encoded_message_definition FROM message_definitions WHERE topic_type = type AND encoding = 'ros2msg')";
    let definition = if has_definitions { definition } else { "NULL" };
    let query = format!("SELECT id, name, type, serialization_format, {definition} FROM topics");
    let mut statement = connection.prepare(&query)?;
    let read = |row: &Row<'_>| {
        let definition: Option<String> = row.get(4)?;
        Ok(TopicRow {
            id: row.get(0)?,
            name: row.get(1)?,
            message_type: row.get(2)?,
            serialisation: row.get(3)?,
            definition: definition.filter(|text| !text.is_empty()),
        })
    };
    statement.query_map((), read)?.collect()
}

/// The path as SQLite takes it with options.
fn uri(path: &Path) -> String {
    let mut name = "file:".to_owned();
    for byte in path.to_string_lossy().bytes() {
        if byte.is_ascii_alphanumeric() || b"/._-".contains(&byte) {
            name.push(byte.into());
        } else {
            name.push_str(&format!("%{byte:02X}"));
        }
    }
    name
}
