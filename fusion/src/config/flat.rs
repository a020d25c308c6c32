//! A document written out flat, with where each value comes from.

use std::fmt::Write;

use super::diagnostic::Place;
use super::document::{Document, Node, Value};
use super::edit::COMMAND_LINE;

/// Comments start at this column where the line is shorter.
const COMMENTS: usize = 56;

impl Document {
    /// The whole tree as TOML, without its variants. Each value is on a separate line with its origin: the
    /// file and line, the variant, or `--set`.
    #[must_use]
    pub fn flat(&self) -> String {
        let mut writer = Writer {
            variants: self.root.get("variant"),
            text: String::new(),
        };
        writer.table("", &self.root);
        writer.text
    }
}

struct Writer<'a> {
    variants: Option<&'a Node>,
    text: String,
}

impl Writer<'_> {
    fn table(&mut self, path: &str, node: &Node) {
        let is_table = |node: &Node| matches!(node.value, Value::Table { .. });
        let entries = || node.entries().iter().filter(|e| !(path.is_empty() && e.key == "variant"));
        let has_values = entries().any(|e| !is_table(&e.node));
        if !path.is_empty() && (has_values || node.entries().is_empty()) {
            if !self.text.is_empty() {
                self.text.push('\n');
            }
            self.line(&format!("[{path}]"), if has_values { None } else { Some(node) });
        }
        for entry in entries().filter(|e| !is_table(&e.node)) {
            self.value(&key(&entry.key), &entry.node);
        }
        for entry in entries().filter(|e| is_table(&e.node)) {
            let dot = if path.is_empty() { "" } else { "." };
            self.table(&format!("{path}{dot}{}", key(&entry.key)), &entry.node);
        }
    }

    /// An array whose elements are tables, or were written in different places, has a line for each.
    fn value(&mut self, key: &str, node: &Node) {
        let Value::Array(elements) = &node.value else {
            return self.line(&format!("{key} = {}", inline(node)), Some(node));
        };
        let is_plain = |element: &Node| !matches!(element.value, Value::Table { .. }) && element.place.source() == node.place.source();
        if elements.iter().all(is_plain) {
            return self.line(&format!("{key} = {}", inline(node)), Some(node));
        }
        self.line(&format!("{key} = ["), Some(node));
        for element in elements {
            self.line(&format!("    {},", inline(element)), Some(element));
        }
        self.text.push_str("]\n");
    }

    fn line(&mut self, line: &str, from: Option<&Node>) {
        // Writing to a String cannot fail.
        let _ = match from.map(|node| self.origin(node)) {
            Some(origin) => writeln!(self.text, "{line:COMMENTS$}  # {origin}"),
            None => writeln!(self.text, "{line}"),
        };
    }

    fn origin(&self, node: &Node) -> String {
        let Place::Text { source, span } = &node.place else {
            return String::new();
        };
        if source.name == COMMAND_LINE {
            return "--set".to_owned();
        }
        let line = source.text.as_bytes()[..span.start].iter().filter(|b| **b == b'\n').count() + 1;
        let variants = self.variants.map_or(&[][..], Node::entries).iter();
        let mut brought = variants.filter(|variant| variant.node.any(&|inner| inner.place == node.place));
        let variant = brought.next().map_or_else(String::new, |v| format!(", variant {}", v.key));
        format!("{}:{line}{variant}", source.name.replace('\n', " "))
    }
}

fn key(key: &str) -> String {
    let is_bare = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_'));
    if is_bare { key.to_owned() } else { quoted(key) }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string().replace('\n', "\\n")
}

impl Node {
    /// The value as TOML, on one line.
    pub fn inline(&self) -> String {
        inline(self)
    }
}

/// A value on one line.
fn inline(node: &Node) -> String {
    match &node.value {
        Value::String(text) => quoted(text),
        Value::Integer(number) => number.to_string(),
        Value::Float(number) if number.is_finite() => format!("{number:?}"),
        Value::Float(number) => number.to_string().to_lowercase(),
        Value::Boolean(flag) => flag.to_string(),
        Value::Datetime(instant) => instant.to_string(),
        Value::Array(elements) => format!("[{}]", elements.iter().map(inline).collect::<Vec<_>>().join(", ")),
        Value::Table { entries, .. } => {
            let fields: Vec<String> = entries.iter().map(|e| format!("{} = {}", key(&e.key), inline(&e.node))).collect();
            if fields.is_empty() {
                "{}".to_owned()
            } else {
                format!("{{ {} }}", fields.join(", "))
            }
        }
    }
}
