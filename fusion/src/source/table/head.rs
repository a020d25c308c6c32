//! The head of a text file: comments, and the lines that name its columns.

use super::{BLANKS, DELIMITERS, is_stamp};
use crate::rows::SourceError;
use crate::source::OpenContext;
use crate::source::file::DataFile;
use ::csv::ReaderBuilder;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Possible marks of comments.
const MARKS: [&str; 3] = ["//", "#", "%"];
/// The number of lines examined.
const LINES: usize = 200;
/// Bytes of a line that are examined; the reader of rows reports a longer line.
const LONGEST: u64 = 1 << 20;
/// The largest number of lines with names and units.
const MOST: usize = 4;

/// The head of a text file.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) delimiter: &'static str,
    /// The mark of comments, if the file begins with comments.
    pub(super) comment: Option<&'static str>,
    /// The comments that the file begins with, without their mark.
    comments: Vec<String>,
    /// Whether the last comment names the columns.
    pub(super) is_commented: bool,
    /// The lines before the rows that are not comments, each with its number from 1.
    lines: Vec<(usize, Vec<String>)>,
}

/// The names of the columns.
#[derive(Debug, Default)]
pub(super) struct Names {
    /// Names for a declaration, if a name in the file belongs to several columns.
    pub(super) given: Option<Vec<String>>,
    /// Lines that a declaration skips.
    pub(super) skip: usize,
    /// The names with the text of the line below, such as a unit.
    pub(super) labels: Vec<String>,
}

impl Head {
    /// Reads the head of a file.
    pub(super) fn read(path: &Path) -> Result<Self, SourceError> {
        let context = OpenContext::default();
        Ok(Self::of(&lines(BufReader::new(DataFile::new(path, &context).bytes(&context)?))))
    }

    fn of(lines: &[(usize, String)]) -> Self {
        let mark = MARKS
            .into_iter()
            .find(|mark| lines.first().is_some_and(|(_, line)| line.starts_with(mark)));
        let is_comment = |line: &str| mark.is_some_and(|mark| line.starts_with(mark));
        let leading: Vec<&str> = lines
            .iter()
            .map(|(_, line)| line.as_str())
            .take_while(|line| is_comment(line))
            .collect();
        let first = lines
            .iter()
            .map(|(_, line)| line.as_str())
            .find(|line| !is_comment(line))
            .unwrap_or_default();
        let delimiter = delimiter(first);
        let fields = split(first, delimiter);
        // A mark may be a part of the first name, as in `#timestamp [ns]`.
        let is_named = |line: &str| fields.len() > 1 && split(line, delimiter).len() == fields.len() && is_row(&fields);
        let is_name = matches!(leading[..], [only] if is_named(only)) || leading.len() == lines.len();
        let comment = mark.filter(|_| !is_name);
        let plain = |line: &&str| line.trim_start_matches(mark.unwrap_or_default()).trim().to_owned();
        let comments: Vec<String> = leading.iter().filter(|_| comment.is_some()).map(plain).collect();
        let is_commented = comments.last().is_some_and(|last| is_named(last));
        let delimiter = if is_name {
            self::delimiter(leading.first().copied().unwrap_or(first))
        } else {
            delimiter
        };
        let rest = lines
            .iter()
            .filter(|(_, line)| comment.is_none() || !is_comment(line))
            .take(MOST + 1);
        let rest: Vec<(usize, Vec<String>)> = rest.map(|(number, line)| (*number, split(line, delimiter))).collect();
        let count = if is_commented { 0 } else { header(&rest) };
        Self {
            delimiter,
            comment,
            comments,
            is_commented,
            lines: rest.into_iter().take(count).collect(),
        }
    }

    /// Whether a separate line names the columns.
    pub(super) fn has_header(&self) -> bool {
        !self.lines.is_empty()
    }

    /// The names of the columns.
    pub(super) fn names(&self) -> Names {
        let [(first, names), (second, below), ..] = &self.lines[..] else {
            return Names::default();
        };
        let last = self.lines.last().map_or(*second, |(number, _)| *number);
        if is_ambiguous(names) {
            let both = names
                .iter()
                .zip(below)
                .enumerate()
                .map(|(k, (name, below))| match (name.as_str(), below.as_str()) {
                    ("", "") => (k + 1).to_string(),
                    ("", only) | (only, "") => only.to_owned(),
                    (name, below) => format!("{name}_{below}"),
                });
            return Names {
                given: Some(both.collect()),
                skip: last,
                labels: Vec::new(),
            };
        }
        let label = |(name, below): (&String, &String)| {
            if below.is_empty() {
                name.clone()
            } else {
                format!("{name} [{below}]")
            }
        };
        Names {
            given: None,
            skip: last - first,
            labels: names.iter().zip(below).map(label).collect(),
        }
    }

    /// The rate that a comment states, and the comment.
    pub(super) fn rate(&self) -> Option<(String, f64)> {
        let rate = |comment: &String| {
            let lower = comment.to_lowercase();
            let after = &lower[lower.find("rate")?..];
            let number = &after[after.find(|c: char| c.is_ascii_digit())?..];
            let end = number.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(number.len());
            let is_hertz = number[end..].trim_start().starts_with("hz");
            let rate: f64 = number[..end].parse().ok()?;
            (is_hertz && rate > 0.0).then(|| (comment.clone(), rate))
        };
        self.comments.iter().find_map(rate)
    }
}

/// The lines that are not empty, each with its number from 1. The reader of the rows reports read errors.
fn lines(mut reader: impl BufRead) -> Vec<(usize, String)> {
    let mut all = Vec::new();
    for number in 1..=LINES {
        let mut line = Vec::new();
        match reader.by_ref().take(LONGEST).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => break,
            Ok(_) => {}
        }
        let line = String::from_utf8_lossy(&line).trim_end_matches(['\r', '\n']).to_owned();
        if !line.trim().is_empty() {
            all.push((number, line));
        }
    }
    all
}

/// The delimiter of a line: the most frequent delimiter, or blanks if it has no delimiter.
fn delimiter(line: &str) -> &'static str {
    let count = |delimiter: &str| split(line, delimiter).len();
    let best = DELIMITERS.into_iter().rev().max_by_key(|d| count(d)).unwrap_or(",");
    if count(best) < 2 && count(BLANKS) > 1 { BLANKS } else { best }
}

/// The fields of a line.
fn split(line: &str, delimiter: &str) -> Vec<String> {
    let squeezed = || line.split_whitespace().collect::<Vec<_>>().join(" ");
    let (line, byte) = match delimiter.as_bytes() {
        &[byte] => (line.to_owned(), byte),
        _ => (squeezed(), b' '),
    };
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(byte)
        .from_reader(line.as_bytes());
    let record = reader.records().next().and_then(Result::ok).unwrap_or_default();
    record.iter().map(|field| field.trim().to_owned()).collect()
}

/// Returns true if one of the fields is a number or a stamp.
fn is_row(fields: &[String]) -> bool {
    fields.iter().any(|field| field.parse::<f64>().is_ok() || is_stamp(field, fields))
}

/// The number of lines that name the columns. The first line does, unless it has only numbers and stamps. Lines after
/// it count too if they have as many fields and no number or stamp, and a row with numbers or stamps follows.
fn header(lines: &[(usize, Vec<String>)]) -> usize {
    let Some((_, first)) = lines.first() else { return 1 };
    if first.iter().all(|field| field.parse::<f64>().is_ok() || is_stamp(field, first)) {
        return 0;
    }
    let is_more = |fields: &[String]| fields.len() == first.len() && !is_row(fields) && fields.iter().any(|field| !field.is_empty());
    let more = lines[1..].iter().take_while(|(_, fields)| is_more(fields)).count();
    let ends = lines.get(1 + more).is_some_and(|(_, fields)| is_row(fields));
    if ends && !is_row(first) { 1 + more } else { 1 }
}

/// Returns true if several columns have the same name.
pub(super) fn is_ambiguous(names: &[String]) -> bool {
    (1..names.len()).any(|k| names[..k].contains(&names[k]))
}
