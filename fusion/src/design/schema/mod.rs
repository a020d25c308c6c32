//! The JSON Schema of a whole design, for editors that complete and check TOML.
//!
//! Every registered block is one definition, `role.name`, with its `type` as a constant; a table
//! that takes any block of a role refers to the definition `role`, which selects the block by its `type`.
//!
//! In a design that includes parts, the parts may contain the required fields of a block. So in such a design
//! only the names of its tables are checked.
//!
//! Not here  units and ranges beyond what JSON Schema can say: those are checked on reading

mod choices;

use crate::config::INCLUDE;
use crate::design::{
    FILTER_TABLES, FilterSpec, FurtherTable, HealthSpec, InputSpec, LinkCommon, NoiseSpec, OnlyWithSpec, OutputCommon, ReferenceSpec,
    RunSpec, SwitchSpec,
};
use fusion_models::param::ScalarParam;
use fusion_models::registry::{self, Registration, Role};
use fusion_models::sim::SimulationSpec;
use fusion_models::units::dim;
use schemars::{JsonSchema, schema_for};
use serde_json::{Map, Value, json};

const DEFS: &str = "$defs";
const REF: &str = "$ref";

/// The schema of a design made of the blocks that are linked into this program.
#[must_use]
pub fn design() -> Value {
    let Whole(mut schema) = whole();
    choices::lead(&mut schema);
    schema
}

/// The schema of a design, in which a choice is plainly one.
pub(super) struct Whole(pub(super) Value);

impl Whole {
    /// The schema itself, or the definition to which it refers.
    pub(super) fn resolved<'s>(&'s self, schema: &'s Value) -> &'s Value {
        choices::resolved(schema, &self.0[DEFS])
    }
}

pub(super) fn whole() -> Whole {
    fusion_models::link();
    let mut s = Builder::default();
    for block in registry::all() {
        let schema = s.block(block);
        s.defs.insert(definition(block.role, block.name), schema);
    }
    s.add_siblings();
    let simulation = s.simulation();
    let mut sections = vec![
        ("run", s.of::<RunSpec>("run")),
        ("filter", s.of::<FilterSpec>("filter")),
        ("health", s.of::<HealthSpec>("health")),
        ("process", s.any(Role::Process, "The process model: what moves the state.")),
        (
            "sensor",
            s.named(Role::Sensor, "Measurement models by name, each with its source and noise."),
        ),
        (
            "stage",
            s.named(Role::Stage, "Streams made of streams, by name; consumers read them like sources."),
        ),
        (
            "initial",
            s.named(
                Role::Initialiser,
                "How the filter starts: initialisers by name, each writing part of the state.",
            ),
        ),
        ("source", s.named(Role::Source, "Recorded data by name.")),
        (
            "link",
            s.linked(Role::Link, "Connections to instruments and programs by name, for `fusion live`."),
        ),
        (
            "output",
            s.linked(Role::Output, "Estimates that leave while the filter runs, by name."),
        ),
        ("simulation", simulation),
        ("reference", s.of::<ReferenceSpec>("reference")),
    ];
    for table in FurtherTable::all() {
        if let Some(schema) = table.schema {
            sections.push((table.name, s.adopt(schema().to_value(), table.name)));
        }
    }
    for (table, schema) in &sections {
        if FILTER_TABLES.contains(table) {
            s.set(&definition(Role::Stage, "filter"), table, schema);
        }
    }
    let over: Map<String, Value> = sections
        .iter()
        .map(|(name, _)| ((*name).to_owned(), json!({ "type": "object" })))
        .collect();
    let whole: Map<String, Value> = sections.into_iter().map(|(name, schema)| (name.to_owned(), schema)).collect();
    let include = json!({
        "description": "Parts to include, by paths relative to this file. The values of this file have priority, then those of the later part.",
        "type": "array",
        "items": { "type": "string" },
    });
    s.set(&definition(Role::Stage, "filter"), INCLUDE, &include);
    let mut partial = over.clone();
    partial.insert(INCLUDE.to_owned(), include.clone());
    let mut properties = over.clone();
    properties.insert(INCLUDE.to_owned(), include);
    properties.insert(
        "variant".to_owned(),
        json!({
            "description": "Values that differ in a variant, by its name: `fusion run --variant NAME`.",
            "type": "object",
            "additionalProperties": { "type": "object", "properties": partial, "additionalProperties": false },
        }),
    );
    s.defs.insert("design".to_owned(), json!({ "properties": whole }));
    // Where parts are included, any table may be completed by them. Editors complete by the hint.
    Whole(json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "fusion design",
        "description": "A navigation filter composed of blocks.",
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
        "if": { "not": { "required": [INCLUDE] } },
        "then": { "allOf": [reference("design")], "required": ["process"] },
        "anyOf": [reference("design"), {}],
        DEFS: s.defs,
    }))
}

/// The schema of one block's own fields, with its definitions.
#[must_use]
pub fn block(block: &Registration) -> Value {
    let mut schema = (block.schema)().to_value();
    strip_null(&mut schema);
    schema
}

fn definition(role: Role, name: &str) -> String {
    format!("{}.{name}", role.name())
}

/// Every block of a role.
fn blocks(role: Role) -> Vec<Value> {
    registry::names(role)
        .iter()
        .map(|name| reference(&definition(role, name)))
        .collect()
}

fn reference(name: &str) -> Value {
    json!({ REF: format!("#/{DEFS}/{name}") })
}

#[derive(Default)]
struct Builder {
    defs: Map<String, Value>,
}

impl Builder {
    /// Takes the definitions out of a schema and renames them, so that equal names of two blocks
    /// stay apart.
    fn adopt(&mut self, mut schema: Value, prefix: &str) -> Value {
        strip_null(&mut schema);
        let taken = schema.as_object_mut().and_then(|o| {
            o.remove("$schema");
            o.remove(DEFS)
        });
        rename(&mut schema, prefix);
        if let Some(Value::Object(defs)) = taken {
            for (name, mut def) in defs {
                rename(&mut def, prefix);
                self.defs.insert(format!("{prefix}.{name}"), def);
            }
        }
        schema
    }

    fn of<T: JsonSchema>(&mut self, prefix: &str) -> Value {
        self.adopt(schema_for!(T).to_value(), prefix)
    }

    fn block(&mut self, block: &Registration) -> Value {
        let mut schema = self.adopt((block.schema)().to_value(), &definition(block.role, block.name));
        property(
            &mut schema,
            "type",
            json!({ "const": block.name, "description": "The kind of block." }),
        );
        require(&mut schema, "type");
        schema
    }

    /// Sets the description of a field of a definition.
    fn set(&mut self, definition: &str, field: &str, schema: &Value) {
        if let Some(definition) = self.defs.get_mut(definition) {
            property(definition, field, schema.clone());
        }
    }

    /// Adds the fields in the table of a block that the block itself does not read.
    fn add_siblings(&mut self) {
        let noise = self.of::<NoiseSpec>("noise");
        let input = self.of::<InputSpec>("input");
        let source = |description: &str| json!({ "type": "string", "description": description });
        let enabled = json!({ "type": "boolean", "default": true, "description": "False leaves the block out." });
        let quality = json!({
            "type": "string",
            "description": "A channel of its source with one number that says how good a row is, HDOP for one: for gates that judge by it.",
        });
        let mut time_offset = self.of::<ScalarParam<dim::Duration>>("time_offset");
        describe(&mut time_offset, "How late its rows are stamped: valid at stamp − offset.");
        let only_with = self.of::<OnlyWithSpec>("only_with");
        let mut switch = self.of::<SwitchSpec>("switch");
        describe(
            &mut switch,
            "Rows that switch the sensor while the filter runs; each holds until the next one.",
        );
        let gate = self.any(Role::Gate, "Accepts or rejects each measurement; without a gate, all are accepted.");
        let loss = self.any(Role::Loss, "Weighs each measurement; without one, least squares.");
        let faults = self.named(Role::Fault, "Faults of the rows, by name, applied in order.");
        let (link, output) = (self.of::<LinkCommon>("link"), self.of::<OutputCommon>("output"));
        for block in registry::all() {
            let Some(schema) = self.defs.get_mut(&definition(block.role, block.name)) else {
                continue;
            };
            match block.role {
                Role::Process => {
                    let what = "The source of its input; none for a process driven by time alone.";
                    property(schema, "source", source(what));
                    property(schema, "input", input.clone());
                }
                Role::Sensor => {
                    property(schema, "source", source("The source or stage that it reads or that times it."));
                    property(schema, "noise", noise.clone());
                    property(schema, "quality", quality.clone());
                    property(schema, "time_offset", time_offset.clone());
                    property(schema, "only_with", only_with.clone());
                    property(schema, "switch", switch.clone());
                    property(schema, "enabled", enabled.clone());
                    property(schema, "gate", gate.clone());
                    property(schema, "loss", loss.clone());
                    require(schema, "source");
                    require(schema, "noise");
                }
                Role::Stage | Role::Initialiser => property(schema, "enabled", enabled.clone()),
                Role::Source => property(schema, "fault", faults.clone()),
                Role::Link => join(schema, &link),
                Role::Output => join(schema, &output),
                _ => {}
            }
        }
    }

    /// Any block of a role. A block without required fields may also be given by its name alone.
    fn any(&mut self, role: Role, description: &str) -> Value {
        let mut choices = blocks(role);
        let needs_nothing = |name: &&str| {
            let required = self
                .defs
                .get(&definition(role, name))
                .and_then(|d| d["required"].as_array().cloned());
            required.is_none_or(|r| r.iter().all(|field| field == "type"))
        };
        let bare: Vec<&str> = registry::names(role).into_iter().filter(needs_nothing).collect();
        if !bare.is_empty() {
            choices.push(json!({ "type": "string", "enum": bare }));
        }
        let all = json!({ "description": description, "oneOf": choices });
        self.defs.insert(role.name().to_owned(), all);
        reference(role.name())
    }

    /// A table that is a block of a role.
    fn table(&mut self, role: Role) -> Value {
        self.defs.insert(role.name().to_owned(), json!({ "oneOf": blocks(role) }));
        reference(role.name())
    }

    /// A table of blocks of a role, by names of the author's choice.
    fn named(&mut self, role: Role, description: &str) -> Value {
        json!({ "description": description, "type": "object", "additionalProperties": self.table(role) })
    }

    /// Blocks by name, of a role whose blocks another crate has. A program without that crate does not look at them.
    fn linked(&mut self, role: Role, description: &str) -> Value {
        if registry::names(role).is_empty() {
            return json!({ "description": description, "type": "object" });
        }
        self.named(role, description)
    }

    /// The simulated world: segments, vehicle, controller and tasks are blocks, and its units and sensors have faults.
    fn simulation(&mut self) -> Value {
        let mut schema = self.of::<SimulationSpec>("simulation");
        let faults = self.named(Role::Fault, "Faults of the rows, by name, applied in order.");
        let properties = &mut schema["properties"];
        for (array, role) in [("trajectory", Role::Segment), ("mission", Role::Task)] {
            if let Some(array) = properties.get_mut(array).and_then(Value::as_object_mut) {
                array.insert("items".to_owned(), self.table(role));
            }
        }
        for (field, role) in [("vehicle", Role::Vehicle), ("control", Role::Control)] {
            // The derived schema has no choice of types for a single block.
            if let Some(field) = properties.get_mut(field) {
                let description = field["description"].take();
                *field = self.table(role);
                field["description"] = description;
            }
        }
        for path in ["/imu", "/odometry", "/sensor/additionalProperties"] {
            let target = match named(properties.pointer(path)) {
                Some(name) => self.defs.get_mut(&name),
                None => properties.pointer_mut(path),
            };
            if let Some(target) = target {
                property(target, "fault", faults.clone());
                if path.starts_with("/sensor") {
                    property(target, "truth", truth());
                }
            }
        }
        let ship = named(properties.get("ship")).and_then(|ship| self.defs.get(&ship));
        let instruments = ["gps", "attitude", "usbl"].map(|of| named(ship.and_then(|ship| ship["properties"].get(of))));
        for instrument in instruments.into_iter().flatten() {
            if let Some(target) = self.defs.get_mut(&instrument) {
                property(target, "fault", faults.clone());
            }
        }
        schema
    }
}

/// Parameters of a simulated sensor; the sensor of the same name determines which exist.
fn truth() -> Value {
    let description = "Parameters of the sensor that are truly others than the filter believes, and `time_offset`, each a fixed value; of \
                       one that is estimated the true value in place of a draw.";
    json!({ "type": "object", "description": description, "examples": [{ "lever_arm": [0.5, 0, "-1 m"] }] })
}

/// The definition that a schema refers to, or one of its choices.
fn named(schema: Option<&Value>) -> Option<String> {
    let schema = schema?;
    let choices = schema["anyOf"].as_array().map_or(&[][..], Vec::as_slice);
    let mut refers = core::iter::once(schema).chain(choices).filter_map(|s| s[REF].as_str());
    refers.next()?.rsplit('/').next().map(str::to_owned)
}

fn property(schema: &mut Value, name: &str, value: Value) {
    if let Some(object) = schema.as_object_mut() {
        let properties = object.entry("properties").or_insert_with(|| json!({}));
        if let Some(properties) = properties.as_object_mut() {
            properties.insert(name.to_owned(), value);
        }
    }
}

/// Adds the properties of a table that all blocks of a role share.
fn join(schema: &mut Value, shared: &Value) {
    for (name, value) in shared["properties"].as_object().into_iter().flatten() {
        property(schema, name, value.clone());
    }
    for name in shared["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        require(schema, name);
    }
}

fn describe(schema: &mut Value, description: &str) {
    if let Some(object) = schema.as_object_mut() {
        object.insert("description".to_owned(), json!(description));
    }
}

fn require(schema: &mut Value, name: &str) {
    if let Some(object) = schema.as_object_mut() {
        let required = object.entry("required").or_insert_with(|| json!([]));
        if let Some(required) = required.as_array_mut() {
            required.push(json!(name));
        }
    }
}

/// Puts `prefix` before the names of the definitions referred to.
fn rename(schema: &mut Value, prefix: &str) {
    match schema {
        Value::Object(object) => {
            for (key, value) in object {
                match value.as_str().and_then(|v| v.strip_prefix("#/$defs/")) {
                    Some(name) if key == REF => *value = reference(&format!("{prefix}.{name}"))[REF].take(),
                    _ => rename(value, prefix),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| rename(item, prefix)),
        _ => {}
    }
}

/// Removes `null`, which TOML does not have: an optional field is a field that may be left out.
fn strip_null(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            if object.get("default").is_some_and(Value::is_null) {
                object.remove("default");
            }
            if let Some(Value::Array(types)) = object.get_mut("type") {
                types.retain(|t| t != "null");
                if let [one] = &types[..] {
                    let one = one.clone();
                    object.insert("type".to_owned(), one);
                }
            }
            if let Some(Value::Array(any)) = object.get_mut("anyOf") {
                any.retain(|choice| choice["type"] != "null");
                if let [Value::Object(one)] = &any[..] {
                    let one = one.clone();
                    object.remove("anyOf");
                    // The description of the field wins over the description of its type.
                    one.into_iter().for_each(|(key, value)| {
                        object.entry(key).or_insert(value);
                    });
                }
            }
            object.values_mut().for_each(strip_null);
        }
        Value::Array(items) => items.iter_mut().for_each(strip_null),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reference_leads_to_a_definition() {
        fn check(value: &Value, root: &Value) {
            match value {
                Value::Object(object) => {
                    if let Some(r) = object.get(REF).and_then(Value::as_str) {
                        let name = r.strip_prefix("#/$defs/").unwrap_or_else(|| panic!("{r}"));
                        assert!(root[DEFS].get(name).is_some(), "{r}");
                    }
                    object.values().for_each(|v| check(v, root));
                }
                Value::Array(items) => items.iter().for_each(|v| check(v, root)),
                _ => {}
            }
        }
        let schema = design();
        check(&schema, &schema);
    }

    #[test]
    fn every_block_is_a_definition_with_its_type() {
        let schema = design();
        for block in registry::all() {
            let of = &schema[DEFS][definition(block.role, block.name)];
            assert_eq!(of["properties"]["type"]["const"], block.name);
            assert!(of["description"].is_string(), "{}", block.name);
        }
    }

    #[test]
    fn nothing_may_be_null() {
        assert!(!design().to_string().contains("\"null\""));
    }
}
