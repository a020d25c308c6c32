//! Links, outputs and tables that the tests share.

pub mod estimate;

use fusion::source::table::LogTable;
use fusion::source::{ArrivingBytes, OpenContext, SourceSpec};
use fusion_live::{LinkSpec, OutputSpec, Received, Receiver};
use std::io::Cursor;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Everything on a computer under load takes less.
pub const PATIENCE: Duration = Duration::from_secs(30);

/// A domain that differs from those of most other programs on this computer, below the ports that Linux gives to others.
pub fn domain() -> u16 {
    1 + (std::process::id() % 100) as u16
}

/// The beginning of the names of topics that no other test has.
pub fn prefix(test: &str) -> String {
    format!("/{test}_{}", std::process::id())
}

pub fn link(fields: &str) -> Box<dyn LinkSpec> {
    fusion_ros2::link();
    toml::from_str(&format!("[ros2]\n{fields}")).unwrap()
}

pub fn output(fields: &str) -> Box<dyn OutputSpec> {
    fusion_ros2::link();
    toml::from_str(&format!("[ros2]\n{fields}")).unwrap()
}

/// Waits until something is true.
pub fn wait_until(what: &str, mut is_true: impl FnMut() -> bool) {
    let end = Instant::now() + PATIENCE;
    while !is_true() {
        assert!(Instant::now() < end, "{what} took longer than {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Receives until there are this many messages.
pub fn receive(receiver: &mut dyn Receiver, bytes: &mut Vec<u8>, count: usize) {
    let end = Instant::now() + PATIENCE;
    while messages(bytes) < count {
        assert!(
            Instant::now() < end,
            "{} of {count} messages: {:?}",
            messages(bytes),
            receiver.status()
        );
        let before = bytes.len();
        let received = receiver.receive(Duration::from_millis(50), bytes).unwrap();
        assert_eq!(received == Received::Bytes, bytes.len() > before);
    }
}

/// The number of messages in records of MCAP.
pub fn messages(bytes: &[u8]) -> usize {
    let (mut at, mut count) = (8, 0);
    while at < bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
        count += usize::from(bytes[at] == 5);
        at += 9 + length as usize;
    }
    count
}

/// Topics as `fusion inspect` reads them of a file, and as sources read them.
pub struct Topics {
    file: PathBuf,
    tables: Vec<LogTable>,
}

impl Topics {
    pub fn read(name: &str, bytes: &[u8]) -> Self {
        fusion_formats::link();
        let file = std::env::temp_dir().join(format!("fusion-ros2-{}-{name}.mcap", std::process::id()));
        // The record that ends the data.
        std::fs::write(&file, [bytes, &[0x0f, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]].concat()).unwrap();
        let tables = LogTable::read_all(&file).unwrap();
        assert!(tables.iter().all(|table| table.broken.is_none() && table.malformed == 0));
        Self { file, tables }
    }

    /// The rows of a source with this channel, of the file or of bytes that arrive: time in nanoseconds, and numbers.
    pub fn rows(&self, topic: &str, channel: &str, arriving: Option<&[u8]>) -> Vec<(i64, Vec<f64>)> {
        let text = format!("[mcap]\npath = \"{}\"\ntopic = \"{topic}\"\n{channel}", self.file.display());
        let source: Box<dyn SourceSpec> = toml::from_str(&text).unwrap();
        let context = OpenContext {
            arriving: arriving.map(|bytes| ArrivingBytes::new(Box::new(Cursor::new(bytes.to_vec())))),
            ..OpenContext::default()
        };
        let mut stream = source.open(&context).unwrap();
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        while let Some(stamp) = stream.next(&mut values).unwrap() {
            rows.push((stamp.time.nanos(), values.clone()));
        }
        assert_eq!(stream.report().left_out(), 0);
        rows
    }

    pub fn topic(&self, name: &str) -> &LogTable {
        let named = |table: &&LogTable| table.topic.as_ref().is_some_and(|topic| topic.name == name);
        self.tables.iter().find(named).unwrap_or_else(|| panic!("no topic {name}"))
    }
}

impl Drop for Topics {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.file);
    }
}

/// The numbers of a column.
pub fn column<'a>(table: &'a LogTable, name: &str) -> &'a [f64] {
    let found = table.columns.iter().find(|column| column.name == name);
    &found.unwrap_or_else(|| panic!("no column {name} of {:?}", table.topic)).values
}

/// The first cell of a column.
pub fn first<'a>(table: &'a LogTable, name: &str) -> &'a str {
    &table.columns.iter().find(|column| column.name == name).unwrap().first
}
