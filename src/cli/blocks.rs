//! `fusion blocks`: the registered blocks.

use super::{Failure, OutputArgs, print};
use clap::Args;
use fusion::config::Diagnostic;
use fusion::models::block::{Channel, ProcessSpec, SensorSpec};
use fusion::models::registry::{self, Registration, Role};
use fusion::models::units::{Dimension, Dimensional, dim};
use fusion::models::vocabulary::channel;
use fusion_tables::text::{WIDTH, wrapped};
use fusion_tables::{Page, Section, Table};
use serde_json::Value;

/// The mark of a parameter that may be a state.
const ESTIMATED: &str = "fixed or estimated";

#[derive(Debug, Args)]
pub(super) struct BlocksArgs {
    /// The `type` of a block, or a table of a design such as `reference`; without a name, all blocks are listed.
    name: Option<String>,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn blocks(args: &BlocksArgs) -> Result<(), Failure> {
    fusion::models::link();
    match &args.name {
        None => args.output.print(&list()),
        Some(name) => print(&describe(name)?),
    }
}

/// The first sentence or line of a block's description.
fn headline(description: &str) -> String {
    let text = description.split("\n\n").next().unwrap_or_default().replace('\n', " ");
    match text.find(". ") {
        Some(end) => text[..=end].to_owned(),
        None => text,
    }
}

fn list() -> Page {
    let section = |role: Role| {
        let mut t = Table::list();
        for r in registry::all().into_iter().filter(|r| r.role == role) {
            let description = fusion::schema::block(r)["description"].as_str().map(headline).unwrap_or_default();
            t.row([r.name.to_owned(), description]);
        }
        Section::new(format!("{}, in {}", role.name(), place(role, "NAME")), [t])
    };
    let whole = fusion::schema::design();
    let tables: Vec<String> = tables(&whole).map(|(name, _)| format!("`{name}`")).collect();
    let more = format!(
        "`fusion blocks NAME` describes one: its fields, their units and defaults, and an example; and so a table of a \
         design: {}.",
        tables.join(", ")
    );
    Page {
        sections: Role::ALL
            .into_iter()
            .map(section)
            .chain([Section::new("", []).note(more)])
            .collect(),
        ..Page::default()
    }
}

/// The place of a block of this role in a design.
fn place(role: Role, name: &str) -> String {
    match role {
        Role::Process => "[process]".to_owned(),
        Role::Sensor | Role::Stage | Role::Source | Role::Link | Role::Output => format!("[{}.{name}]", role.name()),
        Role::Initialiser => format!("[initial.{name}]"),
        Role::Gate => "[sensor.NAME] as `gate`".to_owned(),
        Role::Loss => "[sensor.NAME] as `loss`".to_owned(),
        Role::Fault => format!("[source.SOURCE.fault.{name}], or fault.{name} of a simulated sensor or unit"),
        Role::Segment => "[simulation] in the array `trajectory`".to_owned(),
        Role::Vehicle | Role::Control => format!("[simulation.{}]", role.name()),
        Role::Task => "[simulation] in the array `mission`".to_owned(),
    }
}

fn describe(name: &str) -> Result<String, Failure> {
    let found: Vec<&Registration> = registry::all().into_iter().filter(|r| r.name == name).collect();
    let whole = fusion::schema::design();
    let section = tables(&whole).find(|(table, _)| *table == name);
    if found.is_empty() && section.is_none() {
        let names: Vec<&str> = registry::all()
            .iter()
            .map(|r| r.name)
            .chain(tables(&whole).map(|(name, _)| name))
            .collect();
        let unknown = Diagnostic::error(format!("no block and no table is called `{name}`"));
        let speak = speaking_of(name);
        let unknown = if speak.is_empty() {
            unknown.meant(name, &names)
        } else {
            unknown.help(format!("blocks that speak of it: {}", speak.join(", ")))
        };
        let unknown = unknown.and_help("`fusion blocks` lists them all");
        return Err(Failure::Mistakes(unknown.into()));
    }
    let section = section.map(|(name, schema)| table(name, schema, &whole));
    Ok(found.into_iter().map(one).chain(section).collect::<Vec<_>>().join("\n\n"))
}

/// The blocks with this word in their description, each with its role.
fn speaking_of(word: &str) -> Vec<String> {
    /// Shorter words are in every text.
    const SHORTEST: usize = 3;
    let word = word.to_lowercase();
    let has_it = |r: &&Registration| {
        let text = fusion::schema::block(r)["description"].as_str().unwrap_or_default().to_lowercase();
        // Words match from their beginning: "spoof" is in "spoofed", "range" is not in "arrange".
        text.split(|c: char| !c.is_alphanumeric()).any(|known| known.starts_with(&word))
    };
    let found = registry::all().into_iter().filter(has_it);
    let named = found.map(|r| format!("`{}` ({})", r.name, r.role.name()));
    if word.len() < SHORTEST { Vec::new() } else { named.collect() }
}

/// The tables of a design, with their schemas.
fn tables(whole: &Value) -> impl Iterator<Item = (&str, &Value)> {
    let tables = whole["$defs"]["design"]["properties"].as_object();
    tables.into_iter().flatten().map(|(name, schema)| (name.as_str(), schema))
}

/// A table of a design: its keys, or the blocks that it holds.
fn table(name: &str, schema: &Value, whole: &Value) -> String {
    let mut text = format!("[{name}]\n");
    let target = resolved(schema, whole);
    let meaning = schema["description"]
        .as_str()
        .or(target["description"].as_str())
        .unwrap_or_default();
    text += &paragraphs(meaning);
    let mut fields = String::new();
    if target["properties"].is_object() {
        add_fields(&mut fields, target, whole, 1);
    }
    if fields.is_empty() {
        return text + "\n`fusion blocks` lists the blocks that may be there, `fusion blocks NAME` describes one.\n";
    }
    text + "\nFields\n" + &fields
}

fn one(r: &Registration) -> String {
    let schema = fusion::schema::block(r);
    let mut text = format!("{} ({}, in {})\n", r.name, r.role.name(), place(r.role, "NAME"));
    text += &paragraphs(schema["description"].as_str().unwrap_or_default());
    let mut fields = String::new();
    add_fields(&mut fields, &schema, &schema, 1);
    if fields.is_empty() {
        text += "\nIt has no fields.\n";
    } else {
        text += &format!("\nFields\n{fields}");
    }
    if fields.contains(ESTIMATED) {
        text += "\nA field that may be estimated is a state if written `{ estimate = true, initial = …, sigma = … }`,\n\
                 with `random_walk` or `correlation_time` if it varies; `{ shared = \"block.field\" }` is the state\n\
                 of another block.\n";
    }
    match r.role {
        Role::Sensor => text += "\nAlso: `source`, `noise`, `time_offset`, `gate`, `loss`, `quality`, `only_with` and `enabled`.\n",
        Role::Process => text += "\nAlso: `source`, the stream of its input.\n",
        Role::Source => text += "\nAlso: `fault`, the faults of its rows by name.\n",
        _ => {}
    }
    text + "\nExample\n" + &example(r)
}

/// A description, indented.
fn paragraphs(text: &str) -> String {
    let lines: String = wrapped(&unbroken(text), WIDTH - 2)
        .into_iter()
        .map(|line| format!("{line}\n"))
        .collect();
    indented(&lines)
}

/// Removes the line breaks of the source text; paragraphs are kept.
fn unbroken(text: &str) -> String {
    text.split("\n\n")
        .map(|paragraph| paragraph.replace('\n', " "))
        .collect::<Vec<_>>()
        .join("\n\n")
}

/// The definition that a schema refers to, or itself.
fn resolved<'a>(schema: &'a Value, root: &'a Value) -> &'a Value {
    let target = schema["$ref"].as_str().and_then(|r| root.pointer(r.strip_prefix('#')?));
    target.unwrap_or(schema)
}

/// Adds a line per field with its type, followed by its meaning.
fn add_fields(text: &mut String, schema: &Value, root: &Value, depth: usize) {
    let Some(properties) = schema["properties"].as_object() else {
        return;
    };
    let required = |name: &str| schema["required"].as_array().is_some_and(|r| r.iter().any(|f| f == name));
    // The required fields first, as they must be written.
    let (first, then): (Vec<_>, Vec<_>) = properties.iter().partition(|(name, _)| required(name));
    for (name, field) in first.into_iter().chain(then) {
        let target = resolved(field, root);
        let need = match (required(name), default_of(field)) {
            (true, _) => "required".to_owned(),
            (false, Some(default)) => format!("default {default}"),
            (false, None) => "optional".to_owned(),
        };
        let indent = "  ".repeat(depth);
        let head = format!("{indent}{name}: {} ({need})", type_of(target, root));
        *text += &(wrapped(&head, WIDTH).join("\n") + "\n");
        let meaning = field["description"].as_str().or(target["description"].as_str()).unwrap_or_default();
        for line in wrapped(&unbroken(meaning), WIDTH - 4 - indent.len()) {
            *text += &format!("{indent}    {line}\n");
        }
        let items = target["additionalProperties"]
            .as_object()
            .and(Some(&target["additionalProperties"]));
        let is_table = |choice: &&Value| choice["properties"].is_object() && !choice["properties"]["estimate"].is_object();
        let choice = target["anyOf"]
            .as_array()
            .and_then(|any| any.iter().map(|c| resolved(c, root)).find(is_table));
        // A table of keys rejects unknown keys; a table of names, like an array, gives the schema of each entry.
        let is_keyed = |schema: &&Value| schema["properties"].is_object();
        let each = || items.or_else(|| target.get("items")).map(|items| resolved(items, root));
        let keyed = || Some(target).filter(is_keyed).or_else(|| each().filter(is_keyed));
        let nested = choice.or_else(keyed).unwrap_or(&Value::Null);
        if depth < 4 {
            add_fields(text, nested, root, depth + 1);
        }
    }
}

fn default_of(field: &Value) -> Option<String> {
    match field.get("default")? {
        Value::Object(o) if o.is_empty() => None,
        Value::String(text) => Some(format!("{text:?}")),
        other => Some(other.to_string()),
    }
}

/// The allowed values of a choice.
fn one_of(choices: &[Value], root: &Value) -> String {
    if let [fixed, table] = choices {
        if table["properties"]["estimate"].is_object() {
            return format!("{}, {ESTIMATED}", type_of(fixed, root));
        }
        if table["type"] == "array" && table["items"] == *fixed {
            let count = table["minItems"]
                .as_u64()
                .map_or_else(|| "an array of them".to_owned(), |n| format!("an array of {n}"));
            return format!("{}, or {count}", type_of(fixed, root));
        }
    }
    let mut words: Vec<String> = Vec::new();
    for word in choices.iter().map(|c| type_of(c, root)) {
        if !words.contains(&word) {
            words.push(word);
        }
    }
    words.join(" | ")
}

/// The allowed values, in a few words.
fn type_of(schema: &Value, root: &Value) -> String {
    let schema = resolved(schema, root);
    if let Some(text) = schema["const"].as_str() {
        return format!("{text:?}");
    }
    if let Some(names) = schema["enum"].as_array() {
        return names.iter().map(Value::to_string).collect::<Vec<_>>().join(" | ");
    }
    for key in ["anyOf", "oneOf"] {
        if let Some(choices) = schema[key].as_array() {
            return one_of(choices, root);
        }
    }
    let is = |name: &str| schema["type"] == name || schema["type"].as_array().is_some_and(|t| t.iter().any(|t| t == name));
    if is("number") && is("string") {
        return schema["examples"][0]
            .as_str()
            .map_or_else(|| "number or text".to_owned(), |e| format!("quantity such as {e:?}"));
    }
    if is("array") {
        let length = schema["minItems"].as_u64().filter(|n| schema["maxItems"].as_u64() == Some(*n));
        let of = type_of(&schema["items"], root);
        let many = of
            .strip_prefix("quantity ")
            .map_or_else(|| of.clone(), |rest| format!("quantities {rest}"));
        return length.map_or_else(|| format!("array of {many}"), |n| format!("array of {n} {many}"));
    }
    if is("object") {
        return if schema["properties"].is_object() {
            "table"
        } else {
            "tables by name"
        }
        .to_owned();
    }
    let words = [
        ("integer", "whole number"),
        ("number", "number"),
        ("boolean", "true | false"),
        ("string", "text"),
    ];
    words
        .into_iter()
        .find(|(name, _)| is(name))
        .map_or_else(|| "any".to_owned(), |(_, word)| word.to_owned())
}

/// The registered example in the form of a design.
fn example(r: &Registration) -> String {
    let fields = r.example.trim();
    let inline = || fields.lines().map(str::trim).collect::<Vec<_>>().join(", ");
    let comma = if fields.is_empty() { "" } else { ", " };
    let nested = |header: &str| fields.replace("\n[", &format!("\n[{header}."));
    match r.role {
        Role::Gate | Role::Loss => {
            format!(
                "  [sensor.{}]\n  {} = {{ type = {:?}{comma}{} }}\n",
                "gnss",
                r.role.name(),
                r.name,
                inline()
            )
        }
        Role::Segment | Role::Task => {
            let array = if r.role == Role::Task { "mission" } else { "trajectory" };
            format!(
                "  [simulation]\n  {array} = [\n    {{ type = {:?}{comma}{} }},\n  ]\n",
                r.name,
                inline()
            )
        }
        Role::Sensor => indented(&sensor(r)),
        role => {
            let header = match role {
                Role::Process => "process".to_owned(),
                Role::Fault => "source.gnss.fault.example".to_owned(),
                Role::Initialiser => "initial.example".to_owned(),
                Role::Vehicle | Role::Control => format!("simulation.{}", role.name()),
                _ => format!("{}.example", role.name()),
            };
            let source = if role == Role::Process { input(r) } else { None };
            let source = source.map_or_else(String::new, |name| format!("source = {name:?}\n"));
            indented(&format!("[{header}]\ntype = {:?}\n{source}{}", r.name, nested(&header)))
        }
    }
}

fn indented(text: &str) -> String {
    let lines = text.trim_end().lines();
    lines
        .map(|line| if line.is_empty() { "\n".to_owned() } else { format!("  {line}\n") })
        .collect()
}

/// The source that drives a process; `None` if only time drives it.
fn input(r: &Registration) -> Option<&'static str> {
    let channels = r.spec::<Box<dyn ProcessSpec>>().ok()?.input();
    let is = |wanted: &Channel| channels.iter().any(|c| c.name == wanted.name);
    if is(&channel::ANGULAR_RATE) || is(&channel::SPECIFIC_FORCE) {
        Some("imu")
    } else if is(&channel::ATTITUDE) {
        Some("attitude")
    } else {
        channels.first().map(|_| "odometry")
    }
}

/// A sensor with a suitable source, and a noise in its units. A sensor without its own rows comes with the stage that
/// times it.
fn sensor(r: &Registration) -> String {
    let spec = r.spec::<Box<dyn SensorSpec>>().ok();
    let timing = spec.as_ref().and_then(|s| s.timing());
    let reads = |wanted: &Channel| {
        spec.as_ref()
            .is_some_and(|s| s.reading().channels().iter().any(|c| c.name == wanted.name))
    };
    let (stage, source) = match timing {
        Some(stage) => (clock(stage), "timing"),
        None if reads(&channel::SPECIFIC_FORCE) || reads(&channel::ANGULAR_RATE) => (String::new(), "imu"),
        None => {
            // One receiver has both; all others are named by their type.
            let family = ["gnss", "usbl"].into_iter().find(|family| r.name.starts_with(family));
            (String::new(), family.unwrap_or(r.name))
        }
    };
    let noise = spec.map_or_else(Vec::new, |s| s.noise());
    let sigma: Vec<String> = noise.iter().map(|d| usual(*d)).collect();
    let sigma = match sigma.as_slice() {
        [first, rest @ ..] if rest.iter().any(|s| s != first) => format!("[{}]", sigma.join(", ")),
        [first, ..] => first.clone(),
        [] => "0.1".to_owned(),
    };
    let fields = r.example.trim().replace("\n[", "\n[sensor.example.");
    format!(
        "{stage}[sensor.example]\ntype = {:?}\nsource = {source:?}\nnoise = {{ sigma = {sigma} }}\n{fields}",
        r.name
    )
}

/// The stage that times a sensor, with the inertial unit alone.
fn clock(stage: &str) -> String {
    let all = registry::all();
    let example = all
        .iter()
        .find(|r| r.role == Role::Stage && r.name == stage)
        .map_or("", |r| r.example);
    let own: Vec<&str> = example.trim().lines().filter(|line| !line.starts_with("gnss")).collect();
    format!("[stage.timing]\ntype = {stage:?}\n{}\n\n", own.join("\n"))
}

/// An example of a 1σ; in SI if there is no usual value.
fn usual(of: Dimension) -> String {
    let known = [
        (dim::Length::KIND, "0.5 m"),
        (dim::Speed::KIND, "0.1 m/s"),
        (dim::Acceleration::KIND, "0.5 m/s^2"),
        (dim::Angle::KIND, "1 deg"),
        (dim::AngularRate::KIND, "0.1 deg/s"),
        (dim::Pressure::KIND, "3 Pa"),
        (dim::MagneticField::KIND, "0.5 uT"),
    ];
    let named = known.into_iter().find(|(kind, _)| kind.dimension == of);
    named.map_or_else(|| "0.1".to_owned(), |(_, text)| format!("{text:?}"))
}
