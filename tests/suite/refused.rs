//! Every value of every shipped design is replaced by wrong values: the message points at the value and says what is
//! accepted. Every third wrong value is tried, a different third for each field.

use super::rewind::designs;
use fusion::assembly::{assemble, declared_streams};
use fusion::config::{Diagnostic, Diagnostics, Document, Node, Place, Severity, Value};
use fusion::design::Design;
use fusion::examine::build;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

const FOLDERS: [&str; 5] = [
    "configs",
    "configs/backends",
    "configs/published",
    "configs/real",
    "configs/templates",
];

/// A value of a design with its place.
struct Leaf {
    path: String,
    span: Range<usize>,
    wrong: Vec<String>,
}

/// The values below a node, except those of variants: each once per kind of block and key.
fn leaves(node: &Node, path: &str, block: &str, seen: &mut BTreeSet<String>, found: &mut Vec<Leaf>) {
    let block = node.get("type").and_then(Node::as_str).unwrap_or(block);
    for entry in node.entries() {
        if path.is_empty() && ["include", "variant"].contains(&entry.key.as_str()) {
            continue;
        }
        let (path, kind) = (format!("{path}.{}", entry.key), format!("{block}/{}", entry.key));
        leaf(&entry.node, &path, &kind, seen, found);
        leaves(&entry.node, &path, &kind, seen, found);
    }
}

fn leaf(node: &Node, path: &str, kind: &str, seen: &mut BTreeSet<String>, found: &mut Vec<Leaf>) {
    let Place::Text { span, .. } = node.place() else { return };
    let mut wrong = vec!["{ zz = 1 }".to_owned()];
    match node.value() {
        Value::Table { .. } => return,
        Value::Array(nodes) => {
            let texts = |nodes: &[Node]| format!("[{}]", nodes.iter().map(text).collect::<Vec<_>>().join(", "));
            wrong.extend([texts(&nodes[..nodes.len().saturating_sub(1)]), "[]".to_owned(), "\"\"".to_owned()]);
            for (index, element) in nodes.iter().enumerate() {
                leaf(element, &format!("{path}.{index}"), &format!("{kind}/#"), seen, found);
                leaves(element, &format!("{path}.{index}"), kind, seen, found);
            }
        }
        Value::Boolean(_) => wrong.push("\"yes\"".to_owned()),
        _ => {
            let wrongs = [
                "true",
                "-1",
                "nan",
                "\"inf m\"",
                "\"5 furlong\"",
                "\"5 kg^2\"",
                "\"furlong\"",
                "\"\"",
                "[]",
            ];
            wrong.extend(wrongs.map(str::to_owned));
        }
    }
    if seen.insert(format!("{kind} {:?}", std::mem::discriminant(node.value()))) {
        let (path, span) = (path.to_owned(), span.clone());
        found.push(Leaf { path, span, wrong });
    }
}

/// A value as TOML.
fn text(node: &Node) -> String {
    match node.place() {
        Place::Text { source, span } => source.text[span.clone()].to_owned(),
        _ => String::new(),
    }
}

/// Every error of a design.
fn mistakes(text: &str) -> Vec<Diagnostic> {
    let (document, found) = Document::parse("design.toml", text);
    let mut d = Diagnostics::new();
    d.extend(found);
    let built = build(document).and_then(|design: Design| assemble(&design, declared_streams(&design)?));
    if let Err(mistakes) = built {
        d.extend(mistakes.iter().cloned());
    }
    let errors = d.iter().filter(|d| d.severity == Severity::Error);
    errors.cloned().collect()
}

/// Returns true if one of the errors points at the value or inside it. Also accepted are its key, or the declaration
/// around it if the value is wrong only in combination with others. An undeclared name is reported where it is used.
fn is_placed(errors: &[Diagnostic], text: &str, was: &str, span: &Range<usize>, length: usize) -> bool {
    if errors
        .iter()
        .any(|e| e.message.contains(&format!("is called `{}`", was.trim_matches('"'))))
    {
        return true;
    }
    let value = span.start..span.start + length;
    let line = text[..span.start].rfind('\n').map_or(0, |at| at + 1)..value.end;
    let table = text[..span.start].rfind("\n[").map_or(0, |at| at + 1);
    let header = table..table + text[table..].find('\n').unwrap_or(0);
    errors.iter().any(|error| match &error.place {
        Place::Text { span, .. } => [&value, &line, &header]
            .iter()
            .any(|at| span.start <= at.end && at.start <= span.end),
        _ => false,
    })
}

/// Returns true if the message gives the accepted value: an example, the words, or a description of the field.
fn advises(error: &Diagnostic) -> bool {
    error.help.is_some() || error.label.is_some() || ["e.g.", "write "].iter().any(|said| error.message.contains(said))
}

#[test]
fn each_refused_value_is_pointed_at_and_told_what_is_accepted() {
    let (mut seen, mut poor) = (BTreeSet::new(), BTreeMap::new());
    let (mut values, mut refused) = (0, 0);
    for file in FOLDERS.iter().flat_map(|folder| designs(folder)) {
        let flat = Document::load(&file).unwrap_or_else(|d| panic!("{d}")).flat();
        assert_eq!(mistakes(&flat), [], "{}", file.display());
        let (document, _) = Document::parse("design.toml", &flat);
        let mut found = Vec::new();
        leaves(document.root(), "", "", &mut seen, &mut found);
        for (turn, Leaf { path, span, wrong }) in found.into_iter().enumerate() {
            for wrong in wrong.into_iter().skip(turn % 3).step_by(3) {
                let text = format!("{}{wrong}{}", &flat[..span.start], &flat[span.end..]);
                let errors = mistakes(&text);
                values += 1;
                refused += usize::from(!errors.is_empty());
                let is_wrong_type = wrong.starts_with('{');
                let is_poor = !errors.is_empty() && !is_placed(&errors, &text, &flat[span.clone()], &span, wrong.len())
                    || !errors.iter().all(advises);
                let is_unread = errors
                    .iter()
                    .any(|e| e.message.contains("did not match") || e.message.contains("Spec"));
                if is_poor || is_unread || (is_wrong_type && errors.is_empty()) {
                    let said: Vec<&str> = errors.iter().map(|e| e.message.as_str()).collect();
                    poor.insert(format!("{}{path} = {wrong}", file.display()), said.join(" / "));
                }
            }
        }
    }
    assert!(poor.is_empty(), "{} of {refused} messages: {poor:#?}", poor.len());
    // Names, paths and descriptions may be any text. Most other values are rejected.
    assert!(
        refused > 1500 && refused * 10 > values * 7,
        "{refused} of {values} values are refused"
    );
}
