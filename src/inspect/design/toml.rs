//! Lines of TOML with comments.

use core::fmt::Write;

/// The text of a design that is being written.
#[derive(Debug, Default)]
pub(super) struct Text(String);

/// Comments begin in this column, where the line before them is shorter.
const MARGIN: usize = 36;
/// Longer lines have their comment above them.
const WIDTH: usize = 118;

impl Text {
    /// A comment on lines of its own.
    pub(super) fn comment(&mut self, words: &str) {
        let _ = writeln!(self.0, "# {words}");
    }

    /// A rule with a name.
    pub(super) fn section(&mut self, name: &str) {
        let _ = writeln!(self.0, "\n# --- {name} ---");
    }

    /// `[name]`.
    pub(super) fn table(&mut self, name: &str) {
        let _ = writeln!(self.0, "\n[{name}]");
    }

    /// A line with the reason of it.
    pub(super) fn line(&mut self, line: &str, why: &str) {
        let _ = match why {
            "" => writeln!(self.0, "{line}"),
            _ if line.len().max(MARGIN) + why.chars().count() + 3 > WIDTH => writeln!(self.0, "# {why}:\n{line}"),
            _ if line.len() < MARGIN => writeln!(self.0, "{line:MARGIN$}# {why}"),
            _ => writeln!(self.0, "{line}  # {why}"),
        };
    }

    /// `key = "text"`.
    pub(super) fn quoted(&mut self, key: &str, value: &str) {
        let _ = writeln!(self.0, "{key} = {}", quoted(value));
    }

    pub(super) fn finish(self) -> String {
        self.0
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
