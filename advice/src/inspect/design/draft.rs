//! A first design as data: parts of the template, edits of them, and notes; and the text of it.

use crate::rules::set;
use core::fmt::Write;
use fusion::config::Edit;
use std::collections::BTreeSet;
use toml_edit::{DocumentMut, InlineTable, Value};

/// The parts of first designs.
const TEMPLATE: &str = include_str!("template.toml");
/// A line begins a part if it begins with this.
const PART: &str = "#: ";
/// A section begins and ends with these.
const SECTION: (&str, &str) = ("# --- ", " ---");
/// The value of a line that is left out unless an edit gives it a value.
const OPEN: &str = "?";
/// Comments start in this column if the line before them is shorter.
const MARGIN: usize = 36;
/// Longer lines have their comment on the line above.
const WIDTH: usize = 118;

/// One step of a first design.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    /// A part of the template.
    Part(&'static str),
    /// An empty table.
    Table(String),
    /// The table of channels, which follows its source without a space.
    Channels(String),
    /// A rule with a name.
    Section(String),
    /// A comment on a separate line.
    Note(String),
    /// A value. A key that the table does not have is added at its end.
    Edit(Edit),
    /// The reason for the value of a line.
    Reason(String, String),
}

/// A first design: steps in the order of its text. Keys are relative to the latest table.
#[derive(Clone, Debug, Default)]
pub(super) struct Draft {
    steps: Vec<Step>,
    table: String,
    /// The columns that it reads: the number of the log, and of the column.
    read: BTreeSet<(usize, usize)>,
}

impl Draft {
    /// Adds a part of the template. A part without a header continues the table before it.
    pub(super) fn part(&mut self, name: &'static str) {
        let header = |line: &'static str| line.strip_prefix('[')?.strip_suffix(']');
        if let Some(table) = lines_of(name).filter_map(header).last() {
            table.clone_into(&mut self.table);
        }
        self.steps.push(Step::Part(name));
    }

    pub(super) fn table(&mut self, name: &str) {
        name.clone_into(&mut self.table);
        self.steps.push(Step::Table(name.to_owned()));
    }

    /// Continues with an earlier table of the latest part.
    pub(super) fn within(&mut self, table: &str) {
        table.clone_into(&mut self.table);
    }

    /// Begins the channels of a source.
    pub(super) fn channels(&mut self, source: &str) {
        self.table = format!("source.{source}.channels");
        self.steps.push(Step::Channels(self.table.clone()));
    }

    pub(super) fn section(&mut self, name: &str) {
        self.steps.push(Step::Section(name.to_owned()));
    }

    pub(super) fn note(&mut self, words: &str) {
        self.steps.push(Step::Note(words.to_owned()));
    }

    pub(super) fn set(&mut self, key: &str, value: impl Into<Value>) {
        let edit = Edit::set(key, value.into().to_string());
        self.steps.push(Step::Edit(edit.within(&self.table)));
    }

    /// Sets a value and gives its reason.
    pub(super) fn guess(&mut self, key: &str, value: impl Into<Value>, why: &str) {
        self.set(key, value);
        self.reason(key, why);
    }

    pub(super) fn leave_out(&mut self, key: &str) {
        self.steps.push(Step::Edit(Edit::leave_out(key).within(&self.table)));
    }

    /// Replaces the reason of the line with this key.
    pub(super) fn reason(&mut self, key: &str, why: &str) {
        self.steps.push(Step::Reason(format!("{}.{key}", self.table), why.to_owned()));
    }

    /// Remembers that columns of a log are read.
    pub(super) fn reads(&mut self, log: usize, columns: impl IntoIterator<Item = usize>) {
        self.read.extend(columns.into_iter().map(|column| (log, column)));
    }

    /// The text, and the columns that it reads.
    pub(super) fn finish(self) -> (String, BTreeSet<(usize, usize)>) {
        let mut page = Page::default();
        self.steps.into_iter().for_each(|step| page.take(step));
        (page.text(), self.read)
    }
}

/// A list of values.
pub(super) fn list<V: Into<Value>>(values: impl IntoIterator<Item = V>) -> Value {
    values.into_iter().map(Into::into).collect()
}

/// A number as it is written.
pub(super) fn number(text: &str) -> Value {
    text.parse().unwrap_or_else(|_| Value::from(text))
}

fn lines_of(part: &str) -> impl Iterator<Item = &'static str> {
    let mut lines = TEMPLATE.lines();
    lines.by_ref().find(|line| line.strip_prefix(PART) == Some(part));
    lines.take_while(|line| !line.starts_with(PART)).filter(|line| !line.is_empty())
}

/// The design while the steps are made.
#[derive(Debug, Default)]
struct Page {
    items: Vec<Item>,
    table: String,
}

#[derive(Debug)]
enum Item {
    /// A header or a comment.
    Text(String),
    Line(Box<Line>),
}

/// A key and its value, with the reason.
#[derive(Debug)]
struct Line {
    table: String,
    key: String,
    value: Value,
    why: String,
}

impl Page {
    fn take(&mut self, step: Step) {
        match step {
            Step::Part(name) => lines_of(name).for_each(|line| self.read(line)),
            Step::Table(name) => {
                self.items.push(Item::Text(format!("\n[{name}]")));
                self.table = name;
            }
            Step::Channels(name) => {
                self.items.push(Item::Text(format!("[{name}]")));
                self.table = name;
            }
            Step::Section(name) => self.items.push(Item::Text(format!("\n{}{name}{}", SECTION.0, SECTION.1))),
            Step::Note(words) => self.items.push(Item::Text(format!("# {words}"))),
            Step::Edit(Edit { key, value: Some(value) }) => self.set(&key, number(&value)),
            Step::Edit(Edit { key, value: None }) => self
                .items
                .retain(|item| !matches!(item, Item::Line(line) if line.inner(&key).is_some())),
            Step::Reason(key, why) => {
                if let Some((line, _)) = self.find(&key) {
                    line.why = why;
                }
            }
        }
    }

    /// A line of the template.
    fn read(&mut self, line: &str) {
        let section = line.strip_prefix(SECTION.0).and_then(|line| line.strip_suffix(SECTION.1));
        if let Some(name) = section {
            self.take(Step::Section(name.to_owned()));
        } else if line.starts_with("# ") {
            self.items.push(Item::Text(line.to_owned()));
        } else if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            self.take(Step::Table(name.to_owned()));
        } else if let Some((key, rest)) = line.split_once(" = ")
            && let Some((value, why)) = value_of(rest)
        {
            self.add(key, value, why);
        }
    }

    fn add(&mut self, key: &str, value: Value, why: String) {
        let (table, key) = (self.table.clone(), key.to_owned());
        self.items.push(Item::Line(Box::new(Line { table, key, value, why })));
    }

    /// The latest line that has a key, and the rest of the key inside the value of the line.
    fn find<'a>(&mut self, key: &'a str) -> Option<(&mut Line, &'a str)> {
        self.items.iter_mut().rev().find_map(|item| match item {
            Item::Line(line) => line.inner(key).map(|rest| (&mut **line, rest)),
            Item::Text(_) => None,
        })
    }

    fn set(&mut self, key: &str, value: Value) {
        if self.find(key).is_none() {
            let own = key.strip_prefix(&self.table).map_or(key, |rest| rest.trim_start_matches('.'));
            let first = own.split('.').next().unwrap_or_default();
            self.add(first, Value::from(OPEN), String::new());
        }
        if let Some((line, rest)) = self.find(key) {
            line.set(rest, value);
        }
    }

    fn text(&self) -> String {
        let mut text = String::new();
        for item in &self.items {
            let _ = match item {
                Item::Text(words) => writeln!(text, "{words}"),
                Item::Line(line) if is_open(&line.value) => Ok(()),
                Item::Line(line) => writeln!(text, "{}", line.text()),
            };
        }
        text
    }
}

impl Line {
    /// The rest of a key inside the value of this line; `None` if the key is not in this line.
    fn inner<'a>(&self, key: &'a str) -> Option<&'a str> {
        let rest = key
            .strip_prefix(self.table.as_str())?
            .strip_prefix('.')?
            .strip_prefix(self.key.as_str())?;
        if rest.is_empty() { Some(rest) } else { rest.strip_prefix('.') }
    }

    fn set(&mut self, rest: &str, value: Value) {
        if rest.is_empty() {
            self.value = value;
            return;
        }
        if !self.value.is_inline_table() {
            self.value = Value::InlineTable(InlineTable::new());
        }
        if let Value::InlineTable(table) = &mut self.value {
            let keys: Vec<&str> = rest.split('.').collect();
            // Keys on the way are tables here: nothing can fail.
            let _ = set(table, true, &keys, value);
        }
    }

    fn text(&self) -> String {
        let line = format!("{} = {}", self.key, self.value.to_string().trim());
        match self.why.as_str() {
            "" => line,
            why if line.len().max(MARGIN) + why.chars().count() + 3 > WIDTH => format!("# {why}:\n{line}"),
            why if line.len() < MARGIN => format!("{line:MARGIN$}# {why}"),
            why => format!("{line}  # {why}"),
        }
    }
}

/// The value of a line and the comment behind it.
fn value_of(text: &str) -> Option<(Value, String)> {
    let document: DocumentMut = format!("value = {text}").parse().ok()?;
    let mut value = document.get("value")?.as_value()?.clone();
    let comment = value.decor().suffix().and_then(|suffix| suffix.as_str()).unwrap_or_default();
    let why = comment.trim_start_matches([' ', '#']).to_owned();
    value.decor_mut().clear();
    Some((value, why))
}

/// Whether a part of a value was not given.
fn is_open(value: &Value) -> bool {
    match value {
        Value::String(text) => text.value() == OPEN,
        Value::Array(values) => values.iter().any(is_open),
        Value::InlineTable(table) => table.iter().any(|(_, value)| is_open(value)),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_template_is_read() {
        let mut parts: Vec<&str> = TEMPLATE.lines().filter_map(|line| line.strip_prefix(PART)).collect();
        let all = parts.len();
        let lines: usize = parts.iter().map(|part| lines_of(part).count()).sum();
        let mut page = Page::default();
        parts.iter().for_each(|part| lines_of(part).for_each(|line| page.read(line)));
        assert_eq!(page.items.len(), lines);
        parts.sort_unstable();
        parts.dedup();
        assert_eq!(parts.len(), all, "two parts have one name");
    }

    #[test]
    fn edits_fill_the_template_and_open_lines_are_left_out() {
        let mut draft = Draft::default();
        draft.part("barometer");
        assert!(!draft.clone().finish().0.contains("noise"), "its 1σ is open");
        draft.set("noise.sigma", "4.0 Pa");
        draft.guess("sea_level_pressure.initial", "1013 hPa", "measured");
        draft.leave_out("source");
        draft.set("gate.probability", number("0.99"));
        draft.note("a note");
        let expected = "\n[sensor.barometer]\ntype = \"barometer\"\n# measured:\nsea_level_pressure = { estimate = true, initial = \"1013 hPa\", \
                        sigma = \"2 hPa\", random_walk = \"2 Pa/sqrt(s)\" }\n";
        let (text, _) = draft.finish();
        assert!(text.starts_with(expected), "{text}");
        assert!(
            text.ends_with("\nnoise = { sigma = \"4.0 Pa\" }\ngate = { probability = 0.99 }\n# a note\n"),
            "{text}"
        );
    }
}
