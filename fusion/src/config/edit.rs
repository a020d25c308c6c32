//! Changing a declaration without touching its file: one value from the command line, or a whole
//! variant kept in the file itself.

use core::ops::Range;
use std::sync::Arc;

use toml::de::DeValue;

use super::diagnostic::{Diagnostic, Place, Source};
use super::document::{Document, Entry, Grower, Node, Value};

/// The name of the command line in diagnostics.
pub(super) const COMMAND_LINE: &str = "command line";

impl Document {
    /// Sets one value from an argument such as `gate.threshold=9`, replacing what was there.
    ///
    /// The value is TOML. A value that does not begin like an array, a table or a string needs no quotes:
    /// `rate=100 Hz`. An array is indexed: `lever_arm.0=0.2`. Missing tables on the path are created; if the
    /// path is wrong, the reader of the table rejects it. Later diagnostics point to the argument.
    ///
    /// # Errors
    /// The argument is malformed, or its path does not exist.
    pub fn set(&mut self, assignment: &str) -> Result<(), Diagnostic> {
        const PREFIX: &str = "--set ";
        let source = Arc::new(Source {
            name: COMMAND_LINE.to_owned(),
            text: format!("{PREFIX}{assignment}"),
        });
        let text = source.text.as_str();
        let rest = Place::text(&source, PREFIX.len()..text.len());
        let wanted = || Diagnostic::error("`--set` takes `path=value`").at(&rest);
        let equals = text.find('=').ok_or_else(wanted)?;
        if text[equals + 1..].trim().is_empty() {
            return Err(wanted().label("a value is missing after `=`"));
        }

        assign(Arc::make_mut(&mut self.root), &source, PREFIX.len()..equals)?;
        if let Some(base) = &mut self.base {
            // A path that exists only in a variant is missing here.
            drop(assign(Arc::make_mut(base), &source, PREFIX.len()..equals));
        }
        self.changes.edits.push(assignment.to_owned());
        Ok(())
    }

    /// Returns true if a value was [set](Self::set), or is inside a value that was.
    pub(crate) fn is_set(&self, node: &Node) -> bool {
        matches!(&node.place, Place::Text { source, .. } if source.name == COMMAND_LINE)
    }

    /// Removes the table or value `key` from the whole tree, if it exists.
    pub(crate) fn remove(&mut self, key: &str) {
        Arc::make_mut(&mut self.root).take(key);
    }

    /// Lays `over`, a table of another document, over the whole tree, as [`overlay`](Self::overlay) does.
    pub fn lay(&mut self, over: &Node) {
        merge(Arc::make_mut(&mut self.root), over);
    }

    /// Lays the table at `path`, such as `variant.udu`, over the whole tree.
    ///
    /// Tables merge entry by entry, an array with a table of its indices likewise, and everything else is replaced; a block of another `type` is
    /// replaced as a whole, for its fields mean something else, and so is a parameter that becomes
    /// `shared`, or was.
    ///
    /// # Errors
    /// There is no table at `path`.
    pub fn overlay(&mut self, path: &str) -> Result<(), Diagnostic> {
        let mut node = &*self.root;
        for key in path.split('.') {
            node = node.get(key).ok_or_else(|| unknown(node, key, &node.name))?;
        }
        let Value::Table { .. } = node.value else {
            let help = "a variant is a table of the values that differ: `[variant.NAME]`";
            return Err(Diagnostic::error(format!("`{path}` is not a table")).at(&node.place).help(help));
        };
        let over = node.clone();
        self.base.get_or_insert_with(|| Arc::clone(&self.root));
        merge(Arc::make_mut(&mut self.root), &over);
        self.changes.overlays.push(path.to_owned());
        Ok(())
    }
}

/// Sets a value from an argument. `path` is the range of the path in the text; `=` and the value follow.
fn assign(root: &mut Node, source: &Arc<Source>, path: Range<usize>) -> Result<(), Diagnostic> {
    let (mut node, mut start) = (root, path.start);
    while let Some(length) = source.text[start..path.end].find('.') {
        let key = source.text[start..start + length].trim();
        node = child(node, key, &Place::text(source, start..start + length))?;
        start += length + 1;
    }
    let key = source.text[start..path.end].trim();
    let name = Place::text(source, start..path.end);
    let new = parse_value(source, path.end + 1, &name)?;
    if let Some(old) = node.get_mut(key) {
        *old = new;
        return Ok(());
    }
    match &mut node.value {
        Value::Table { entries, .. } if !key.is_empty() => entries.push(Entry {
            key: key.to_owned(),
            node: new,
        }),
        _ => return Err(unknown(node, key, &name)),
    }
    Ok(())
}

/// The child of that name; it is created if the table does not have it.
fn child<'n>(node: &'n mut Node, key: &str, place: &Place) -> Result<&'n mut Node, Diagnostic> {
    let is_new = node.get(key).is_none() && !key.is_empty();
    if let Value::Table { entries, .. } = &mut node.value
        && is_new
    {
        entries.push(Entry {
            key: key.to_owned(),
            node: Node {
                value: Value::table(Vec::new()),
                place: place.clone(),
                name: place.clone(),
            },
        });
    }
    let missing = unknown(node, key, place);
    node.get_mut(key).ok_or(missing)
}

/// There is no `key` in `node`.
fn unknown(node: &Node, key: &str, place: &Place) -> Diagnostic {
    let diagnostic = Diagnostic::error(format!("there is no `{key}` here")).at(place);
    match &node.value {
        Value::Table { .. } => diagnostic.suggest(key, &node.keys(), "known here"),
        Value::Array(nodes) => diagnostic.help(format!("an array of {}, indexed from 0", nodes.len())),
        _ => diagnostic.help("this is a single value, with nothing in it"),
    }
}

/// Reads the rest of `source` from `start` as a value.
fn parse_value(source: &Arc<Source>, start: usize, name: &Place) -> Result<Node, Diagnostic> {
    let text = &source.text[start..];
    let offset = start + text.len() - text.trim_start().len();
    let text = text.trim();
    let mut grower = Grower {
        source: Arc::clone(source),
        offset,
        found: Vec::new(),
    };
    let node = match DeValue::parse(text) {
        Ok(value) => grower.node(Some(name.clone()), &value),
        Err(error) if text.starts_with(['[', '{', '"', '\'']) => return Err(grower.syntax(&error)),
        Err(_) => Node {
            value: Value::String(text.to_owned()),
            place: Place::text(source, offset..offset + text.len()),
            name: name.clone(),
        },
    };
    grower.found.pop().map_or(Ok(node), Err)
}

/// Returns true if one table would replace another whose fields have another meaning. That is a block of another
/// `type`, or two declarations of a parameter of which only one is `shared`.
pub(super) fn is_retyped(base: &Node, over: &Node) -> bool {
    let type_of = |node: &Node| node.get("type").and_then(Node::as_str).map(str::to_owned);
    let has = |node: &Node, key: &str| node.get(key).is_some();
    let is_shared_now = |a: &Node, b: &Node| has(a, "shared") && has(b, "estimate") && !has(b, "shared");
    let is_other_type = matches!((type_of(base), type_of(over)), (Some(old), Some(new)) if old != new);
    is_other_type || is_shared_now(base, over) || is_shared_now(over, base)
}

fn merge(base: &mut Node, over: &Node) {
    let is_table = matches!(over.value, Value::Table { .. }) && !is_retyped(base, over);
    match &mut base.value {
        Value::Table { entries, .. } if is_table => {
            for Entry { key, node } in over.entries() {
                match entries.iter_mut().find(|entry| entry.key == *key) {
                    Some(entry) => merge(&mut entry.node, node),
                    None => entries.push(Entry {
                        key: key.clone(),
                        node: node.clone(),
                    }),
                }
            }
        }
        Value::Array(nodes) if is_table && has_indices(over, nodes.len()) => {
            for Entry { key, node } in over.entries() {
                if let Some(element) = key.parse::<usize>().ok().and_then(|k| nodes.get_mut(k)) {
                    merge(element, node);
                }
            }
        }
        _ => *base = over.clone(),
    }
}

/// Returns true if each key is an index into an array of `length` elements, as in `columns.2 = "…"`.
fn has_indices(over: &Node, length: usize) -> bool {
    let is_index = |e: &Entry| e.key.parse::<usize>().is_ok_and(|k| k < length);
    !over.entries().is_empty() && over.entries().iter().all(is_index)
}

#[cfg(test)]
mod tests {
    use super::super::Diagnostics;
    use super::*;

    fn parse(text: &str) -> Document {
        let (document, found) = Document::parse("filter.toml", text);
        assert_eq!(found, []);
        document
    }

    fn get<T: serde::de::DeserializeOwned>(document: &Document, path: &str) -> T {
        let mut diagnostics = Diagnostics::new();
        let read = document.root().at(path).unwrap().read(&mut diagnostics);
        read.unwrap_or_else(|| panic!("{diagnostics}"))
    }

    #[test]
    fn an_override_replaces_and_may_add_to_a_table() {
        let mut document = parse("[gate]\nlimit = 5\narm = [0, 0.5, 1]\n");
        let sets = [
            "gate.limit=9.5",
            "gate.arm.1 = 7",
            "gate.new=abc",
            "gate.unit = 5 deg/s",
            "gate.quoted='a=b'",
            "gate.table={ deep = [true] }",
        ];
        for set in sets {
            assert_eq!(document.set(set), Ok(()), "{set}");
        }
        assert_eq!(get::<f64>(&document, "gate.limit"), 9.5);
        assert_eq!(get::<Vec<f64>>(&document, "gate.arm"), [0.0, 7.0, 1.0]);
        assert_eq!(get::<String>(&document, "gate.new"), "abc");
        assert_eq!(get::<String>(&document, "gate.unit"), "5 deg/s");
        assert_eq!(get::<String>(&document, "gate.quoted"), "a=b");
        assert_eq!(get::<Vec<bool>>(&document, "gate.table.deep"), [true]);
    }

    #[test]
    fn an_override_goes_through_tables_and_elements_only() {
        let mut document = parse("[gate]\nlimit = 5\narm = [0, 0.5, 1]\n");
        let help = |result: Result<(), Diagnostic>| result.unwrap_err().help.unwrap();
        assert_eq!(help(document.set("gate.arm.3=1")), "an array of 3, indexed from 0");
        assert_eq!(help(document.set("gate.limit.x=1")), "this is a single value, with nothing in it");
        assert!(document.set("=1").is_err());
        assert!(document.set("gate.=1").is_err());
    }

    #[test]
    fn a_variant_is_merged_by_path() {
        let mut document = parse(
            "form = 'joseph'\narm = [0, 0.5, 1]\nold = [1, 2]\n[gate]\ntype = 'nis'\nlimit = 5\nage = 1\n\
             [variant.udu]\nform = 'udu'\ngate.limit = 9\nsensor.gnss.rate = 2\narm.1 = 7\nold.3 = 4\n",
        );
        assert_eq!(document.overlay("variant.udu"), Ok(()));
        assert_eq!(get::<String>(&document, "form"), "udu");
        assert_eq!((get::<i64>(&document, "gate.limit"), get::<i64>(&document, "gate.age")), (9, 1));
        assert_eq!(get::<i64>(&document, "sensor.gnss.rate"), 2);
        assert_eq!(get::<Vec<f64>>(&document, "arm"), [0.0, 7.0, 1.0]);
        // There is no such element, so a table replaces the array; the reader reports it.
        assert_eq!(document.root().get("old").unwrap().keys(), ["3"]);
    }

    #[test]
    fn a_block_of_another_type_is_replaced_as_a_whole() {
        let mut document = parse("gate = { type = 'nis', limit = 5 }\n[variant.open]\ngate = { type = 'none' }\n");
        assert_eq!(document.overlay("variant.open"), Ok(()));
        assert_eq!(document.root().get("gate").unwrap().keys(), ["type"]);
    }

    #[test]
    fn a_parameter_that_becomes_shared_or_was_is_replaced_as_a_whole() {
        let mut document = parse(
            "own = { estimate = true, initial = 1, sigma = 2 }\nother = { shared = 'a.b' }\n\
             [variant.swapped]\nown = { shared = 'a.b' }\nother = { estimate = true, initial = 3, sigma = 4 }\n\
             [variant.wide]\nown.sigma = 9\n[variant.fixed]\nown = 7\n",
        );
        assert_eq!(document.overlay("variant.wide"), Ok(()));
        assert_eq!((get::<i64>(&document, "own.sigma"), get::<i64>(&document, "own.initial")), (9, 1));
        assert_eq!(document.overlay("variant.swapped"), Ok(()));
        assert_eq!(document.root().get("own").unwrap().keys(), ["shared"]);
        assert_eq!(document.root().get("other").unwrap().keys(), ["estimate", "initial", "sigma"]);
        assert_eq!(document.overlay("variant.fixed"), Ok(()));
        assert_eq!(get::<i64>(&document, "own"), 7);
    }

    #[test]
    fn an_unknown_variant_is_told_the_known_ones() {
        let mut document = parse("[variant.udu]\n[variant.plain]\n");
        let expected = "\
error: there is no `ud` here
 --> filter.toml:1:2
  |
1 | [variant.udu]
  |  ^^^^^^^ did you mean `udu`?
  |
  = help: known here: `udu`, `plain`";
        let error = document.overlay("variant.ud").unwrap_err();
        assert_eq!(Diagnostics::from(error).to_string(), expected);
    }
}
