//! Lines of TOML with comments.

use core::fmt::Write;
use std::collections::BTreeSet;

/// The text of a design that is being written.
#[derive(Debug, Default)]
pub(super) struct Text {
    written: String,
    /// The columns that it reads: the number of the log, and of the column.
    read: BTreeSet<(usize, usize)>,
}

/// Comments start in this column if the line before them is shorter.
const MARGIN: usize = 36;
/// Longer lines have their comment on the line above.
const WIDTH: usize = 118;

impl Text {
    /// A comment on a separate line.
    pub(super) fn comment(&mut self, words: &str) {
        let _ = writeln!(self.written, "# {words}");
    }

    /// A rule with a name.
    pub(super) fn section(&mut self, name: &str) {
        let _ = writeln!(self.written, "\n# --- {name} ---");
    }

    /// `[name]`.
    pub(super) fn table(&mut self, name: &str) {
        let _ = writeln!(self.written, "\n[{name}]");
    }

    /// A line and the reason for it.
    pub(super) fn line(&mut self, line: &str, why: &str) {
        let _ = match why {
            "" => writeln!(self.written, "{line}"),
            _ if line.len().max(MARGIN) + why.chars().count() + 3 > WIDTH => writeln!(self.written, "# {why}:\n{line}"),
            _ if line.len() < MARGIN => writeln!(self.written, "{line:MARGIN$}# {why}"),
            _ => writeln!(self.written, "{line}  # {why}"),
        };
    }

    /// `key = "text"`.
    pub(super) fn quoted(&mut self, key: &str, value: &str) {
        let _ = writeln!(self.written, "{key} = {}", quoted(value));
    }

    /// Remembers that columns of a log are read.
    pub(super) fn reads(&mut self, log: usize, columns: impl IntoIterator<Item = usize>) {
        self.read.extend(columns.into_iter().map(|column| (log, column)));
    }

    /// The text, and the columns that it reads.
    pub(super) fn finish(self) -> (String, BTreeSet<(usize, usize)>) {
        (self.written, self.read)
    }
}

/// A string as TOML writes it.
pub(super) fn quoted(text: &str) -> String {
    ::toml::Value::String(text.to_owned()).to_string()
}

/// An array of strings.
pub(super) fn array(texts: &[String]) -> String {
    let all: Vec<String> = texts.iter().map(|t| quoted(t)).collect();
    format!("[{}]", all.join(", "))
}
