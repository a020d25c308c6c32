//! The description of a field, shown next to a refused value.
//!
//! A message names the mistake and gives an example. The schema has the description of the field and the words
//! that it accepts; they are looked up by the path of the refused value.

use super::schema::{self, Whole};
use crate::config::{Diagnostics, Node, Severity, Value};
use serde_json::Value as Json;
use std::sync::LazyLock;

/// Which blocks there are is settled when the program is linked.
static WHOLE: LazyLock<Whole> = LazyLock::new(schema::whole);

/// Adds the description of the field to each error that has no help yet.
pub(crate) fn explain(root: &Node, d: &mut Diagnostics) {
    for error in d.iter_mut().filter(|e| e.severity == Severity::Error && e.help.is_none()) {
        let mut path = Vec::new();
        if error.label.is_some() || !find(root, &|node| *node.place() == error.place, &mut path) {
            continue;
        }
        // An element of an array is described with its array.
        let field = path.iter().rposition(|key| key.parse::<usize>().is_err());
        let Some(field) = field else { continue };
        error.help = help(&WHOLE, root, &path, field);
    }
}

/// Finds the path of the first node for which `is` holds.
fn find<'n>(node: &'n Node, is: &dyn Fn(&Node) -> bool, path: &mut Vec<&'n str>) -> bool {
    /// Keys of elements; a longer array is of numbers that are alike.
    const INDICES: [&str; 10] = ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9"];
    let below = |key: &'n str, child: &'n Node, path: &mut Vec<&'n str>| {
        path.push(key);
        let found = is(child) || find(child, is, path);
        if !found {
            path.pop();
        }
        found
    };
    match node.value() {
        Value::Array(nodes) => nodes.iter().zip(INDICES).any(|(child, key)| below(key, child, path)),
        _ => node.entries().iter().any(|e| below(&e.key, &e.node, path)),
    }
}

fn help(whole: &Whole, root: &Node, path: &[&str], field: usize) -> Option<String> {
    // A field without a description is described by its table.
    let described = (0..=field).rev().find_map(|last| {
        let text = whole.description(whole.at(root, &path[..=last])?)?;
        Some(format!("`{}`: {text}", path[last]))
    });
    let words = whole.at(root, path).map(|refused| whole.words(refused)).unwrap_or_default();
    let known = (!words.is_empty()).then(|| format!("known: `{}`", words.join("`, `")));
    match (described, known) {
        (Some(described), Some(known)) => Some(format!("{described} {known}")),
        (described, known) => described.or(known),
    }
}

impl Whole {
    /// The schema of the value at `path` below `node`; of choices, that of the `type` which is written there.
    fn at(&self, root: &Node, path: &[&str]) -> Option<&Json> {
        self.below(&self.0, root, path)
    }

    fn below<'s>(&'s self, schema: &'s Json, node: &Node, path: &[&str]) -> Option<&'s Json> {
        let Some((key, rest)) = path.split_first() else {
            return Some(schema);
        };
        let schema = self.resolved(schema);
        let tag = schema["properties"]["type"]["const"].as_str();
        let named = node.as_str().or_else(|| node.get("type")?.as_str());
        if tag.is_some_and(|tag| named.is_some_and(|named| named != tag)) {
            return None;
        }
        let child = node.get(key)?;
        let is_array = matches!(node.value(), Value::Array(_));
        let any = &schema[if is_array { "items" } else { "additionalProperties" }];
        let own = [&schema["properties"][*key], any];
        let own = own
            .into_iter()
            .filter(|schema| schema.is_object())
            .map(|schema| (schema, child, rest));
        let choices = ["anyOf", "oneOf", "allOf"].into_iter().filter_map(|key| schema[key].as_array());
        let choices = choices.flatten().map(|schema| (schema, node, path));
        own.chain(choices).find_map(|(schema, node, path)| self.below(schema, node, path))
    }

    /// The first paragraph of the description in a schema, in one line.
    fn description(&self, schema: &Json) -> Option<String> {
        let text = schema["description"].as_str();
        let text = text.or_else(|| self.resolved(schema)["description"].as_str())?;
        let paragraph = text.split("\n\n").next().unwrap_or(text);
        Some(paragraph.split_whitespace().collect::<Vec<_>>().join(" "))
    }

    /// The words, or types of blocks, that a schema lists.
    fn words<'s>(&'s self, schema: &'s Json) -> Vec<&'s str> {
        let schema = self.resolved(schema);
        let listed = schema["enum"].as_array().into_iter().flatten();
        let one = [&schema["const"], &schema["properties"]["type"]["const"]];
        let mut words: Vec<&str> = listed.chain(one).filter_map(Json::as_str).collect();
        for choices in ["anyOf", "oneOf"].into_iter().filter_map(|key| schema[key].as_array()) {
            words.extend(choices.iter().flat_map(|choice| self.words(choice)));
        }
        if words.is_empty() && schema["items"].is_object() {
            words = self.words(&schema["items"]);
        }
        let mut seen = std::collections::BTreeSet::new();
        words.retain(|word| seen.insert(*word));
        words
    }
}
