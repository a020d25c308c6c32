//! A log of lines `TOPIC NUMBER …` under the rules that all logs of messages share.

use super::pass::{Message, Next, Pass};
use super::spec::message_format;
use super::*;
use crate::signature::Signature;
use fusion::models::registry;
use fusion::source::decode::RawRows;
use fusion::source::table::LogTable;
use fusion::source::{ArrivingBytes, SharedReaders};
use std::collections::VecDeque;
use std::fs;
use std::io::{BufRead, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const LINES: Signature = Signature {
    name: "test_lines",
    endings: &[".lines"],
    recognises: |first| first.starts_with(b"LINES"),
};

message_format! {
    /// Lines `TOPIC STAMP NUMBER …`, for tests.
    LinesSpec reads Lines as "test_lines";
    stamps in "t", unit "ms", since None;
    signature LINES;
    example r#"
path = "log.lines"
topic = "a"
[channels.x]
columns = ["x[0]", "x[1]"]
"#;
}

static OPENED: AtomicUsize = AtomicUsize::new(0);

struct Lines {
    /// As readers of several files keep it.
    _context: OpenContext,
    text: BufReader<Box<dyn std::io::Read + Send>>,
    line: String,
    at: u64,
    topics: Vec<Topic>,
    columns: Vec<Vec<String>>,
}

impl MessageReader for Lines {
    fn open(file: &DataFile, context: &OpenContext) -> Result<Self, SourceError> {
        OPENED.fetch_add(1, Ordering::Relaxed);
        let mut bytes = file.bytes(context)?;
        let mut magic = [0; 6];
        bytes.read_exact(&mut magic).unwrap();
        Ok(Self {
            _context: context.clone(),
            text: BufReader::new(bytes),
            line: String::new(),
            at: 6,
            topics: Vec::new(),
            columns: Vec::new(),
        })
    }

    fn advance(&mut self) -> Result<Option<usize>, Broken> {
        self.line.clear();
        match self.text.read_line(&mut self.line) {
            Ok(0) => return Ok(None),
            Ok(_) if !self.line.ends_with('\n') => return Err(Broken::at(self.at, "the file is cut off")),
            read => self.at += read.unwrap() as u64,
        }
        let mut words = self.line.split_whitespace();
        let name = words.next().unwrap_or_default().to_owned();
        let known = self.topics.iter().position(|topic| topic.name == name);
        Ok(Some(known.unwrap_or_else(|| {
            let columns = (0..words.count() - 1).map(|k| format!("x[{k}]"));
            self.columns.push(core::iter::once("t".to_owned()).chain(columns).collect());
            self.topics.push(Topic {
                name,
                message_type: "numbers".to_owned(),
            });
            self.topics.len() - 1
        })))
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn columns(&self, topic: usize) -> &[String] {
        &self.columns[topic]
    }

    fn decode(&mut self, cells: &mut Cells) -> Result<(), String> {
        for word in self.line.split_whitespace().skip(1) {
            cells.number(word.parse().map_err(|_| format!("`{word}` is no number"))?);
        }
        Ok(())
    }
}

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, log: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fusion-messages-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join("log.lines"), format!("LINES\n{log}")).unwrap();
        Self(path)
    }

    fn context(&self) -> OpenContext {
        OpenContext {
            data_dir: self.0.clone(),
            ..OpenContext::default()
        }
    }

    fn open(&self, context: &OpenContext, topic: Option<&str>) -> Result<Read<Lines>, SourceError> {
        open(&DataFile::new(Path::new("log.lines"), context), context, topic, None)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The numbers of the first column after the stamps, and the place of a row that is wrong as a negative number.
fn all(mut rows: impl RawRows) -> Vec<f64> {
    let mut all = Vec::new();
    while rows.advance().unwrap() {
        let place = rows.place() as f64;
        all.push(rows.malformed().map_or_else(|| rows.cell(1).number().unwrap(), |_| -place));
    }
    all
}

#[test]
fn a_format_of_messages_obeys_the_laws_of_sources() {
    let folder = Folder::new("laws", "a 0 1 2\nb 1 5\na 10 3 4\na 20 5\n");
    let own = registry::all().into_iter().find(|r| r.name == "test_lines").unwrap();
    // The last message has no second element.
    let error = fusion::source::testing::check(own, &folder.context(), 3).unwrap_err();
    assert!(error.contains("message 3") && error.contains("`x[1]` is empty"), "{error}");
    let folder = Folder::new("laws", "a 0 1 2\nb 1 5\na 10 3 4\na 20 5 6 7\n");
    fusion::source::testing::check(own, &folder.context(), 3).unwrap();
}

#[test]
fn the_sources_of_a_run_read_a_log_once() {
    let folder = Folder::new("once", "a 0 1\nb 1 5\na 2 2\nb 3 6\nb 4 7\n");
    let context = OpenContext {
        shared: SharedReaders::default(),
        ..folder.context()
    };
    let [a, b, again] = ["a", "b", "b"].map(|topic| folder.open(&context, Some(topic)).unwrap());
    let opened = OPENED.load(Ordering::Relaxed);
    assert_eq!(
        (all(a), all(b), all(again)),
        (vec![1.0, 2.0], vec![5.0, 6.0, 7.0], vec![5.0, 6.0, 7.0])
    );
    assert!(OPENED.load(Ordering::Relaxed) - opened <= 2, "other tests open two logs at most");
    // A pass that has begun is not joined.
    assert_eq!(all(folder.open(&context, Some("a")).unwrap()), [1.0, 2.0]);
}

#[test]
fn a_log_is_closed_with_its_last_source() {
    // Longer than all buffers.
    let folder = Folder::new("closed", &"a 0 1\n".repeat(100_000));
    let context = folder.context();
    let unread = context.unread.clone();
    let mut rows = folder.open(&context, Some("a")).unwrap();
    assert!(rows.advance().unwrap() && unread.bytes() > 0);
    drop((rows, context));
    assert_eq!(unread.bytes(), 0);
}

#[test]
fn a_source_that_lies_far_behind_reads_the_log_itself() {
    let log: String = (0..100).map(|k| format!("a {k} {k}\nb {k} {}\n", 2 * k)).collect();
    let folder = Folder::new("behind", &log);
    let context = folder.context();
    let mut late = folder.open(&context, Some("a")).unwrap();
    let file = DataFile::new(Path::new("log.lines"), &context);
    let mut pass = Pass::new(Lines::open(&file, &context).unwrap(), 1000);
    let [a, b] = ["a", "b"].map(|topic| pass.join(topic, None).unwrap());
    let mut message = Message::default();
    let mut count = 0;
    while matches!(pass.next(b, &mut message), Next::Message) {
        count += 1;
        if count == 3 {
            assert!(matches!(pass.next(a, &mut late.message), Next::Message));
        }
    }
    assert_eq!((count, message.cells.get(1).number()), (100, Some(198.0)));
    assert!(matches!(pass.next(a, &mut Message::default()), Next::LeftBehind));
    (late.pass, late.queue) = (std::sync::Arc::new(std::sync::Mutex::new(pass)), a);
    let rest: Vec<f64> = (1..100).map(f64::from).collect();
    assert_eq!(all(late), rest);
}

#[test]
fn rows_before_a_damage_are_used_and_the_damage_is_reported() {
    let folder = Folder::new("cut", "a 0 1\na 1 lost\na 2 3\nb 3");
    let context = folder.context();
    assert_eq!(all(folder.open(&context, Some("a")).unwrap()), [1.0, -2.0, 3.0, -4.0]);
    let declared = "path = \"log.lines\"\ntopic = \"a\"\nbad_rows = \"skip\"\n[channels.x]\ncolumns = [\"x[0]\"]\n";
    let read = |text: &str| {
        let spec: LinesSpec = toml::from_str(text).unwrap();
        let mut stream = fusion::source::SourceSpec::open(&spec, &context).unwrap();
        let mut values = Vec::new();
        let mut rows = 0;
        loop {
            match stream.next(&mut values) {
                Ok(Some(_)) => rows += 1,
                Ok(None) => return Ok((rows, stream.report().to_string())),
                Err(error) => return Err(error.to_string()),
            }
        }
    };
    let (rows, report) = read(declared).unwrap();
    assert_eq!(rows, 2);
    assert!(report.contains("message 2: `lost` is no number"), "{report}");
    assert!(report.contains("message 4: after byte 27: the file is cut off"), "{report}");
    let error = read(&declared.replace("bad_rows = \"skip\"\n", "")).unwrap_err();
    assert!(error.contains("log.lines, message 2: `lost` is no number"), "{error}");
    let tables = LogTable::read_all(&folder.0.join("log.lines")).unwrap();
    let [table] = &tables[..] else { panic!("{tables:?}") };
    assert_eq!(
        (table.rows(), table.malformed, table.columns[0].values.as_slice()),
        (2, 1, &[0.0, 2.0][..])
    );
    assert_eq!(table.broken.as_deref(), Some("after byte 27: the file is cut off"));
}

#[test]
fn a_topic_that_a_log_does_not_have_is_an_error_with_its_topics() {
    let folder = Folder::new("topics", "a 0 1\nb 1 5\n");
    let context = folder.context();
    let error = folder.open(&context, Some("c")).unwrap_err();
    assert!(error.to_string().contains("no message of the topic `c`"), "{error}");
    let SourceError::Declared(errors) = error else { panic!("{error}") };
    assert_eq!(errors[0].help.as_deref(), Some("its topics: `a`, `b`"));
    let error = folder.open(&context, None).unwrap_err();
    assert!(error.to_string().contains("several topics"), "{error}");
    let folder = Folder::new("only", "a 0 1\na 1 5\n");
    assert_eq!(all(folder.open(&folder.context(), None).unwrap()), [1.0, 5.0]);
}

/// A line at a time; a reader must not wait for a line before the rows of the lines before are taken.
struct Given {
    lines: VecDeque<&'static str>,
    /// Lines that may be read.
    allowed: Arc<AtomicUsize>,
}

impl std::io::Read for Given {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let Some(line) = self.lines.pop_front() else { return Ok(0) };
        let left = self.allowed.fetch_sub(1, Ordering::Relaxed);
        assert!(left > 0, "the reader waits before it gives a row");
        buffer[..line.len()].copy_from_slice(line.as_bytes());
        Ok(line.len())
    }
}

/// Opens a source on lines that arrive, of which it may wait for `count`.
fn opened_on(lines: &[&'static str], topic: Option<&str>, count: usize) -> (Result<Read<Lines>, SourceError>, Arc<AtomicUsize>) {
    let allowed = Arc::new(AtomicUsize::new(count));
    let given = Given {
        lines: lines.iter().copied().collect(),
        allowed: allowed.clone(),
    };
    let context = OpenContext {
        arriving: Some(ArrivingBytes::new(Box::new(given))),
        ..OpenContext::default()
    };
    let file = DataFile::new(Path::new("log.lines"), &context);
    (open::<Lines>(&file, &context, topic, None), allowed)
}

#[test]
fn arriving_bytes_are_read_once_and_each_row_is_given_before_the_next_one_is_awaited() {
    let lines = ["LINES\n", "b 1 5\n", "a 2 6 7\n", "b 3 8\n", "a 4 9 10\n"];
    let (rows, allowed) = opened_on(&lines, Some("a"), 3);
    let mut rows = rows.unwrap();
    assert_eq!(rows.columns(), ["t", "x[0]", "x[1]"]);
    let shown = |rows: &Read<Lines>| (0..3).map(|k| rows.cell(k).shown().into_owned()).collect::<Vec<_>>();
    assert!(rows.advance().unwrap());
    assert_eq!(shown(&rows), ["2", "6", "7"]);
    allowed.store(2, Ordering::Relaxed);
    assert!(rows.advance().unwrap());
    assert_eq!((shown(&rows), rows.place()), (["4", "9", "10"].map(str::to_owned).to_vec(), 2));
    assert!(!rows.advance().unwrap());
}

#[test]
fn arriving_bytes_without_a_named_topic_have_the_topic_of_their_first_message() {
    let lines = ["LINES\n", "b 1 5\n", "a 2 6\n", "b 3 8\n"];
    let (rows, _) = opened_on(&lines, None, 4);
    let mut rows = rows.unwrap();
    let mut stamps = Vec::new();
    while rows.advance().unwrap() {
        stamps.push(rows.cell(0).shown().into_owned());
    }
    assert_eq!(stamps, ["1", "3"]);
    let (rows, _) = opened_on(&lines, Some("c"), 4);
    let error = rows.unwrap_err().to_string();
    assert!(error.contains("has no message of the topic `c`"), "{error}");
}
