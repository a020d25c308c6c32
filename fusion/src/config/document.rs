//! A TOML file as a tree in which every key and value remembers where it was written.

use std::ops::Range;
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};
use toml::value::Datetime;

use super::diagnostic::{Diagnostic, Place, Source};

/// A declaration: the tree of one file, with what the command line changed in it. Copies share the tree until
/// one of them is changed.
#[derive(Clone, Debug)]
pub struct Document {
    pub(super) root: Arc<Node>,
    /// The tree without the variants that were laid over it; `None` without variants.
    pub(super) base: Option<Arc<Node>>,
    pub(super) changes: Changes,
}

/// The changes made to a document since it was read, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// The tables that were laid over it, for example `variant.udu`.
    pub overlays: Vec<String>,
    /// The values that were set, as `gate.threshold=9`.
    pub edits: Vec<String>,
}

/// A value with its places.
#[derive(Clone, Debug)]
pub struct Node {
    pub(super) value: Value,
    /// The place of the value; for a table with a header, the place of the header.
    pub(super) place: Place,
    /// The place of the key; in an array, the place of the value.
    pub(super) name: Place,
}

/// The value of a node.
#[derive(Clone, Debug)]
pub enum Value {
    /// Text.
    String(String),
    /// A whole number.
    Integer(i64),
    /// A number with a fraction or an exponent.
    Float(f64),
    /// `true` or `false`.
    Boolean(bool),
    /// A date, a time, or both.
    Datetime(Datetime),
    /// Values in order.
    Array(Vec<Node>),
    /// Values by name.
    Table {
        /// In the order of the file.
        entries: Vec<Entry>,
        /// Keys that [`Node::split_off`] has moved elsewhere, still good as suggestions.
        moved: Vec<String>,
    },
}

/// One key of a table with its value.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The key, without quotes.
    pub key: String,
    /// Its value.
    pub node: Node,
}

impl Document {
    /// Reads `text`; `name` is what diagnostics call it.
    ///
    /// If there are syntax errors, the document holds the readable parts. Further reading finds more
    /// mistakes, but some of them are only consequences.
    pub fn parse(name: &str, text: &str) -> (Self, Vec<Diagnostic>) {
        let source = Arc::new(Source {
            name: name.to_owned(),
            text: text.to_owned(),
        });
        let (table, errors) = DeTable::parse_recoverable(text);
        let mut grower = Grower {
            source,
            offset: 0,
            found: Vec::new(),
        };
        grower.found = first_of_each_line(text, errors).map(|error| grower.syntax(&error)).collect();
        let place = Place::File {
            path: name.to_owned(),
            line: None,
        };
        let root = Node {
            value: grower.table(table.get_ref()),
            name: place.clone(),
            place,
        };
        let document = Self {
            root: Arc::new(root),
            base: None,
            changes: Changes::default(),
        };
        (document, grower.found)
    }

    /// A document of one table of this one.
    pub(crate) fn within(&self, table: Node) -> Self {
        Self {
            root: Arc::new(table),
            base: None,
            changes: Changes::default(),
        }
    }

    /// The document without the variants that were laid over it.
    #[must_use]
    pub fn base(&self) -> Self {
        Self {
            root: Arc::clone(self.base.as_ref().unwrap_or(&self.root)),
            base: None,
            changes: Changes {
                overlays: Vec::new(),
                ..self.changes.clone()
            },
        }
    }

    /// The changes made to it.
    #[must_use]
    pub const fn changes(&self) -> &Changes {
        &self.changes
    }

    /// The file that it was read from, as it was named.
    #[must_use]
    pub fn name(&self) -> &str {
        match &self.root.place {
            Place::File { path, .. } => path,
            Place::Text { source, .. } => &source.name,
            Place::Nowhere => "",
        }
    }

    /// The whole tree.
    #[must_use]
    pub fn root(&self) -> &Node {
        &self.root
    }

    /// The whole tree, for later use independent of the document.
    pub(crate) fn shared(&self) -> Arc<Node> {
        Arc::clone(&self.root)
    }
}

impl Node {
    /// Its value.
    #[must_use]
    pub fn value(&self) -> &Value {
        &self.value
    }

    /// The place of the value.
    #[must_use]
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// The place of its key.
    #[must_use]
    pub fn name_place(&self) -> &Place {
        &self.name
    }

    /// The entries of a table, in the order of the file; empty if the node is not a table.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        match &self.value {
            Value::Table { entries, .. } => entries,
            _ => &[],
        }
    }

    /// The entries of a table, mutable; empty if the node is not a table.
    pub(crate) fn entries_mut(&mut self) -> &mut [Entry] {
        match &mut self.value {
            Value::Table { entries, .. } => entries,
            _ => &mut [],
        }
    }

    /// How many values it has, its own included.
    pub(super) fn count(&self) -> usize {
        match &self.value {
            Value::Array(values) => 1 + values.iter().map(Self::count).sum::<usize>(),
            Value::Table { entries, .. } => 1 + entries.iter().map(|entry| entry.node.count()).sum::<usize>(),
            _ => 1,
        }
    }

    /// The keys of a table.
    pub(super) fn keys(&self) -> Vec<&str> {
        self.entries().iter().map(|entry| entry.key.as_str()).collect()
    }

    /// The text, where it is text.
    #[must_use]
    pub fn as_str(&self) -> Option<&str> {
        match &self.value {
            Value::String(text) => Some(text),
            _ => None,
        }
    }

    /// The child of this name; in an array, of this index.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&Self> {
        match &self.value {
            Value::Table { entries, .. } => entries.iter().find(|entry| entry.key == key).map(|entry| &entry.node),
            Value::Array(nodes) => nodes.get(key.parse::<usize>().ok()?),
            _ => None,
        }
    }

    /// The child of this name or index, to be changed.
    pub(crate) fn get_mut(&mut self, key: &str) -> Option<&mut Self> {
        match &mut self.value {
            Value::Table { entries, .. } => {
                let entry = entries.iter_mut().find(|entry| entry.key == key);
                entry.map(|entry| &mut entry.node)
            }
            Value::Array(nodes) => nodes.get_mut(key.parse::<usize>().ok()?),
            _ => None,
        }
    }

    /// The node at a dotted path such as `measurement.gnss.noise`.
    #[must_use]
    pub fn at(&self, path: &str) -> Option<&Self> {
        path.split('.').try_fold(self, |node, key| node.get(key))
    }

    /// The place of the value at a dotted path, or of the name of the deepest table on the path. It is for
    /// mistakes that are found only when a block is built.
    #[must_use]
    pub fn place_of(&self, path: &str) -> &Place {
        let mut node = self;
        for key in path.split('.') {
            match node.get(key) {
                Some(child) => node = child,
                None => return &node.name,
            }
        }
        &node.place
    }

    /// Moves the entries named in `keys` into a separate table at the same place.
    ///
    /// The remaining table still suggests these keys for a misspelt one.
    #[must_use]
    pub fn split_off(&mut self, keys: &[&str]) -> Self {
        let mut split = Vec::new();
        if let Value::Table { entries, moved } = &mut self.value {
            let listed = |entry: &mut Entry| keys.contains(&entry.key.as_str());
            split.extend(entries.extract_if(.., listed));
            moved.extend(keys.iter().map(|key| (*key).to_owned()));
        }
        Self {
            value: Value::table(split),
            place: self.place.clone(),
            name: self.name.clone(),
        }
    }

    /// A table without entries at the same place.
    pub(crate) fn emptied(&self) -> Self {
        Self {
            value: Value::table(Vec::new()),
            place: self.place.clone(),
            name: self.name.clone(),
        }
    }

    /// Sets the value of a key of the table; it replaces an existing value. A node that is not a table does not change.
    pub(crate) fn put(&mut self, key: &str, node: Self) {
        let Value::Table { entries, .. } = &mut self.value else { return };
        match entries.iter_mut().find(|entry| entry.key == key) {
            Some(entry) => entry.node = node,
            None => entries.push(Entry { key: key.to_owned(), node }),
        }
    }

    /// Takes one entry out of the table.
    pub fn take(&mut self, key: &str) -> Option<Self> {
        let Value::Table { mut entries, .. } = self.split_off(&[key]).value else {
            return None;
        };
        entries.pop().map(|entry| entry.node)
    }
}

impl Value {
    pub(super) fn table(entries: Vec<Entry>) -> Self {
        Self::Table {
            entries,
            moved: Vec::new(),
        }
    }
}

/// The first error of each line, in the order of the text: it often causes the other errors of the line.
fn first_of_each_line(text: &str, mut errors: Vec<toml::de::Error>) -> impl Iterator<Item = toml::de::Error> {
    let start = |error: &toml::de::Error| error.span().map_or(text.len(), |span| span.start);
    let line = |error: &mut toml::de::Error| {
        let before = &text.as_bytes()[..start(error)];
        before.iter().filter(|byte| **byte == b'\n').count()
    };
    errors.sort_by_key(start);
    errors.dedup_by_key(line);
    errors.into_iter()
}

/// Grows the tree from the result of the TOML parser.
pub(super) struct Grower {
    pub(super) source: Arc<Source>,
    /// Where the parsed text begins in the source.
    pub(super) offset: usize,
    pub(super) found: Vec<Diagnostic>,
}

impl Grower {
    fn place(&self, span: Range<usize>) -> Place {
        Place::text(&self.source, span.start + self.offset..span.end + self.offset)
    }

    pub(super) fn syntax(&self, error: &toml::de::Error) -> Diagnostic {
        let length = self.source.text.len() - self.offset;
        let diagnostic = Diagnostic::error(error.message());
        diagnostic.at(&self.place(error.span().unwrap_or(length..length)))
    }

    /// A node for `value`; `name` is the place of its key.
    pub(super) fn node(&mut self, name: Option<Place>, value: &Spanned<DeValue<'_>>) -> Node {
        let place = self.place(value.span());
        let value = match value.get_ref() {
            DeValue::String(text) => Value::String(text.clone().into_owned()),
            DeValue::Integer(number) => {
                let parsed = i64::from_str_radix(number.as_str(), number.radix());
                Value::Integer(parsed.unwrap_or_else(|_| {
                    self.found.push(
                        Diagnostic::error("this integer exceeds 64 bits")
                            .at(&place)
                            .help("write it with a decimal point or an exponent, e.g. 1e20"),
                    );
                    0
                }))
            }
            // The parser has checked the syntax; 1e999 reads as infinite, and no quantity accepts that.
            DeValue::Float(number) => Value::Float(number.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(flag) => Value::Boolean(*flag),
            DeValue::Datetime(instant) => Value::Datetime(*instant),
            DeValue::Array(values) => Value::Array(values.iter().map(|value| self.node(None, value)).collect()),
            DeValue::Table(table) => self.table(table),
        };
        Node {
            value,
            name: name.unwrap_or_else(|| place.clone()),
            place,
        }
    }

    fn table(&mut self, table: &DeTable<'_>) -> Value {
        let mut pairs: Vec<_> = table.iter().collect();
        pairs.sort_by_key(|(key, _)| key.span().start);
        let entry = |(key, value): (&Spanned<_>, _)| Entry {
            key: ToString::to_string(key.get_ref()),
            node: self.node(Some(self.place(key.span())), value),
        };
        Value::table(pairs.into_iter().map(entry).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Document {
        let (document, found) = Document::parse("filter.toml", text);
        assert_eq!(found, []);
        document
    }

    /// The text at a place.
    fn quote(place: &Place) -> &str {
        match place {
            Place::Text { source, span } => &source.text[span.clone()],
            _ => "",
        }
    }

    #[test]
    fn entries_keep_the_order_of_the_file() {
        let document = parse("z = 1\na = 2\n[m]\nx.q = 1\nb = 2\n[c]\n");
        assert_eq!(document.root().keys(), ["z", "a", "m", "c"]);
        assert_eq!(document.root().at("m").unwrap().keys(), ["x", "b"]);
    }

    #[test]
    fn keys_and_values_know_their_places() {
        let document = parse("[gate.of]\nprobability = 0.99 # much\nx.y = [1, 'b']\n");
        let root = document.root();
        assert_eq!(quote(root.at("gate.of.probability").unwrap().place()), "0.99");
        assert_eq!(quote(root.at("gate.of.probability").unwrap().name_place()), "probability");
        assert_eq!(quote(root.at("gate.of").unwrap().name_place()), "of");
        assert_eq!(quote(root.at("gate.of.x.y.1").unwrap().place()), "'b'");
    }

    #[test]
    fn the_place_of_what_is_missing_is_the_name_of_its_table() {
        let document = parse("[gate]\nprobability = 0.99\n");
        let root = document.root();
        assert_eq!(quote(root.place_of("gate.probability")), "0.99");
        assert_eq!(quote(root.place_of("gate.threshold")), "gate");
        assert_eq!(root.place_of("noise"), root.place());
    }

    #[test]
    fn split_entries_move_with_their_places() {
        let mut node = parse("a = 1\nb = 2\nc = 3\n").root().clone();
        let split = node.split_off(&["c", "a", "d"]);
        assert_eq!((node.keys(), split.keys()), (vec!["b"], vec!["a", "c"]));
        assert_eq!(quote(split.get("c").unwrap().place()), "3");
        assert!(node.take("b").is_some() && node.take("b").is_none());
    }

    #[test]
    fn integers_are_read_in_every_base_and_must_fit() {
        let document = parse("a = 0x1_0\nb = -1_000\nc = 0b11\n");
        let value = |key| match document.root().get(key).unwrap().value() {
            Value::Integer(number) => *number,
            other => panic!("{other:?}"),
        };
        assert_eq!(["a", "b", "c"].map(value), [16, -1000, 3]);
        let (_, found) = Document::parse("filter.toml", "a = 99999999999999999999");
        assert_eq!(found[0].message, "this integer exceeds 64 bits");
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_parsing_or_rendering_panic(text in "[]\\[{}=.,#'\"\\\\ \r\nabcé°1-]{0,60}") {
            let (document, found) = Document::parse("filter.toml", &text);
            let mut diagnostics = super::super::Diagnostics::new();
            diagnostics.extend(found);
            let _ = document.root().read::<Vec<u8>>(&mut diagnostics);
            proptest::prop_assert!(!diagnostics.render(true).is_empty());
        }
    }
}
