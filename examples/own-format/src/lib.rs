//! A project's own log format: JSON lines, an object in each, as loggers of robots write them.
//!
//! The format only finds the cells of a row. Their meaning (stamps, calendars, units, `valid`, gzip, bad rows) is
//! declared and decoded as for every format. A column's name is its path: `angular_velocity.x`, `gyro[0]`.
//!
//! A file may have several streams. Each line is then an envelope:
//! `{"topic": "/imu", "type": "sensor_msgs/Imu", "message": {…}}`. A source selects one stream by `topic`.
//!
//! Memory   one line, of 16 MiB at most
//!
//! [`wire`] has a link and an output for `fusion live`.

#[cfg(unix)]
pub mod wire;

use fusion::models::block::BuildError;
use fusion::rows::{DataError, ProvidedChannel, RowStream, SourceError};
use fusion::source::decode::{Cell, Malformed, Plan, RawRows, TimeSpec};
use fusion::source::table::{LogTable, Topic};
use fusion::source::{DataFile, LogFormat, OpenContext, SourceSpec};
use serde_json::{Map, Value};
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// The longest line \[bytes\].
const LONGEST: u64 = 16 << 20;

/// Links the format into a program; call it once, so that the linker keeps it.
pub fn link() {}

fusion::format_spec! {
    /// JSON lines, plain or gzip-compressed. A column is called by its path, such as `angular_velocity.x` or `gyro[0]`.
    pub struct JsonLinesSpec {
        /// The file, relative to the data directory; gzip is recognised by its content.
        path: PathBuf,
        /// The stream, if the lines are envelopes with `topic`, `type` and `message`.
        topic: Option<String>,
        /// The clock: the column of the stamps and their meaning.
        time: TimeSpec,
    }
}

fusion::models::register! { Source, "json_lines", JsonLinesSpec, r#"
path = "drive.jsonl"
time = { column = "stamp", unit = "ms" }
[channels.angular_rate]
columns = ["gyro[0]", "gyro[1]", "gyro[2]"]
unit = "deg/s"
"# }

static FORMAT: LogFormat = LogFormat {
    name: "json_lines",
    clock: None,
    endings: &[".jsonl", ".jsonl.gz"],
    recognises: |first| first.starts_with(b"{\""),
    read: tables,
};

fusion::inventory::submit! { FORMAT }

/// One table for each stream, or for the whole file if its lines are no envelopes.
fn tables(path: &Path) -> Result<Vec<LogTable>, SourceError> {
    let context = OpenContext::default();
    let file = DataFile::new(path, &context);
    let table = |topic: Option<Topic>| {
        let rows = Lines::open(&file, &context, topic.as_ref().map(|topic| topic.name.as_str()))?;
        let table = LogTable::of_rows(path, &FORMAT, rows)?;
        Ok(LogTable { topic, ..table })
    };
    let topics = topics(&file, &context)?;
    if topics.is_empty() {
        return Ok(vec![table(None)?]);
    }
    topics.into_iter().map(|topic| table(Some(topic))).collect()
}

/// The streams of a file, in the order of their first messages.
fn topics(file: &DataFile, context: &OpenContext) -> Result<Vec<Topic>, SourceError> {
    let mut lines = Lines::unread(file, context, None)?;
    let mut topics: Vec<Topic> = Vec::new();
    while let Some(object) = lines.object()? {
        let Ok(object) = object else { continue };
        let text = |key: &str| object.get(key).and_then(Value::as_str);
        let Some(name) = text("topic") else { continue };
        if topics.iter().all(|topic| topic.name != name) {
            topics.push(Topic {
                name: name.to_owned(),
                message_type: text("type").unwrap_or_default().to_owned(),
            });
        }
    }
    Ok(topics)
}

#[typetag::deserialize(name = "json_lines")]
impl SourceSpec for JsonLinesSpec {
    fn files(&self) -> Vec<PathBuf> {
        vec![self.path.clone()]
    }

    fn channels(&self) -> Result<Vec<ProvidedChannel>, Vec<BuildError>> {
        Ok(self.plan()?.provided())
    }

    fn time_zero(&self) -> Option<i64> {
        self.rows().time_zero()
    }

    fn open(&self, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        let file = DataFile::new(&self.path, context);
        self.plan()?
            .decode(Lines::open(&file, context, self.topic.as_deref())?, &file, context)
    }

    fn open_rows(&self, rows: Box<dyn RawRows>, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
        self.plan()?.decode(rows, &DataFile::new(&self.path, context), context)
    }
}

impl JsonLinesSpec {
    fn plan(&self) -> Result<Plan<'_>, Vec<BuildError>> {
        self.rows().checked()
    }
}

/// The object of a line, or the reason that it has none.
type Object = Result<Value, String>;

/// The lines of a file. The first object defines the columns.
struct Lines {
    file: String,
    /// The stream whose messages are the rows.
    topic: Option<String>,
    text: BufReader<Box<dyn Read + Send>>,
    line: usize,
    columns: Vec<String>,
    places: HashMap<String, usize>,
    cells: Vec<Value>,
    wrong: Option<String>,
    /// The first row has been read already.
    is_ahead: bool,
}

impl Lines {
    /// The lines before the first one is read.
    fn unread(file: &DataFile, context: &OpenContext, topic: Option<&str>) -> Result<Self, SourceError> {
        Ok(Self {
            file: file.name(),
            topic: topic.map(str::to_owned),
            text: BufReader::new(file.bytes(context)?),
            line: 0,
            columns: Vec::new(),
            places: HashMap::new(),
            cells: Vec::new(),
            wrong: None,
            is_ahead: false,
        })
    }

    fn open(file: &DataFile, context: &OpenContext, topic: Option<&str>) -> Result<Self, SourceError> {
        let mut lines = Self::unread(file, context, topic)?;
        if let Some(first) = lines.message()? {
            if let Ok(object) = &first {
                flattened("", object.clone(), &mut |name, _| lines.columns.push(name));
            }
            lines.places = lines.columns.iter().cloned().zip(0..).collect();
            lines.take(first);
            lines.is_ahead = true;
        } else if let Some(topic) = topic {
            let message = format!("`{}` has no message of the topic `{topic}`", lines.file);
            let known: Vec<String> = topics(file, context)?.into_iter().map(|topic| topic.name).collect();
            return Err(BuildError::at("topic", message)
                .help(format!("its topics: {}", known.join(", ")))
                .into());
        }
        Ok(lines)
    }

    /// The object of the next line that is not empty; `None` after the last line.
    fn object(&mut self) -> Result<Option<Object>, DataError> {
        let wrong = |line: usize, what: String| DataError::new(self.file.clone(), format!("line {line}: {what}"));
        let mut text = String::new();
        while text.trim().is_empty() {
            text.clear();
            self.line += 1;
            let read = (&mut self.text).take(LONGEST).read_line(&mut text);
            match read.map_err(|error| wrong(self.line, error.to_string()))? as u64 {
                0 => return Ok(None),
                LONGEST => return Err(wrong(self.line, "it is longer than 16 MiB".to_owned())),
                _ => {}
            }
        }
        let object: Result<Map<String, Value>, _> = serde_json::from_str(&text);
        Ok(Some(object.map(Value::Object).map_err(|error| error.to_string())))
    }

    /// The next message of the stream; the next object, if no stream is selected. A line that is no object counts as
    /// one, so that it is reported.
    fn message(&mut self) -> Result<Option<Object>, DataError> {
        loop {
            let object = match (self.object()?, &self.topic) {
                (Some(Ok(object)), Some(topic)) => (object, topic),
                (other, _) => return Ok(other),
            };
            let (mut object, topic) = object;
            if object.get("topic").and_then(Value::as_str) == Some(topic) {
                return Ok(Some(Ok(object["message"].take())));
            }
        }
    }

    /// Makes an object the current row.
    fn take(&mut self, object: Object) {
        self.cells.clear();
        self.cells.resize(self.columns.len(), Value::Null);
        self.wrong = None;
        match object {
            Err(error) => self.wrong = Some(format!("this line is no JSON object: {error}")),
            Ok(object) => {
                let (places, cells) = (&self.places, &mut self.cells);
                flattened("", object, &mut |name, value| {
                    if let Some(place) = places.get(&name) {
                        cells[*place] = value;
                    }
                });
            }
        }
    }
}

/// Passes the numbers and texts of a value to `tell`, each with its path.
fn flattened(path: &str, value: Value, tell: &mut dyn FnMut(String, Value)) {
    match value {
        Value::Object(fields) => {
            for (name, inner) in fields {
                let path = if path.is_empty() { name } else { format!("{path}.{name}") };
                flattened(&path, inner, tell);
            }
        }
        Value::Array(items) => {
            for (k, inner) in items.into_iter().enumerate() {
                flattened(&format!("{path}[{k}]"), inner, tell);
            }
        }
        single => tell(path.to_owned(), single),
    }
}

impl RawRows for Lines {
    fn columns(&self) -> &[String] {
        &self.columns
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        if core::mem::take(&mut self.is_ahead) {
            return Ok(true);
        }
        let next = self.message()?;
        let is_there = next.is_some();
        next.into_iter().for_each(|object| self.take(object));
        Ok(is_there)
    }

    fn place(&self) -> usize {
        self.line
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        match &self.cells[column] {
            Value::Number(number) => match number.as_i64() {
                Some(whole) => Cell::Integer(whole),
                None => Cell::Number(number.as_f64().unwrap_or(f64::NAN)),
            },
            Value::String(text) => Cell::Text(text.as_bytes()),
            Value::Bool(is_so) => Cell::Integer(i64::from(*is_so)),
            _ => Cell::Text(b""),
        }
    }

    fn malformed(&self) -> Option<Malformed> {
        self.wrong.clone().map(|message| Malformed {
            message,
            help: "leave such lines out with `bad_rows = \"skip\"`",
            is_last: false,
        })
    }
}
