//! Choices that lead to the value that is wrong.
//!
//! For `anyOf` and `oneOf`, a validator can only say that nothing fits. So each choice is put behind a
//! condition: the `type` of a block, or the type of the JSON value. If no block has this `type`, the
//! known types are listed.
//!
//! With `additionalProperties: false`, an unknown key makes the whole table wrong, and an editor marks the
//! whole table. Here no value is allowed under an unknown key, so that the editor marks only the key.
//!
//! The editors that complete TOML look into `anyOf`, but not behind conditions. So the choices stay in
//! `anyOf` as hints, with one more choice that accepts every value.

use super::{DEFS, REF};
use serde_json::{Map, Value, json};

const TYPES: [&str; 6] = ["object", "array", "string", "number", "integer", "boolean"];

/// Replaces the choices of a whole schema, its definitions included.
pub(super) fn lead(schema: &mut Value) {
    let defs = schema[DEFS].clone();
    walk(schema, &defs);
}

fn walk(schema: &mut Value, defs: &Value) {
    match schema {
        Value::Object(object) => {
            if object.get("additionalProperties") == Some(&json!(false)) {
                let nothing = json!({ "not": { "description": "unknown key" } });
                object.insert("additionalProperties".to_owned(), nothing);
            }
            object.values_mut().for_each(|value| walk(value, defs));
            for key in ["anyOf", "oneOf"] {
                if let Some(Value::Array(choices)) = object.get(key) {
                    let choices = choices.clone();
                    replace(object, key, &choices, defs);
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| walk(item, defs)),
        _ => {}
    }
}

fn replace(object: &mut Map<String, Value>, key: &str, choices: &[Value], defs: &Value) {
    if let Some(one) = flat(choices) {
        object.remove(key);
        for (keyword, value) in one {
            object.entry(keyword).or_insert(value);
        }
        return;
    }
    let accepted: Option<Vec<Vec<&str>>> = choices.iter().map(|choice| types(resolved(choice, defs))).collect();
    let Some(accepted) = accepted else { return };
    let allowed: Vec<&str> = TYPES.into_iter().filter(|t| accepted.iter().any(|a| a.contains(t))).collect();
    let mut conditions = Vec::new();
    for json_type in &allowed {
        let fitting: Vec<&Value> = choices
            .iter()
            .zip(&accepted)
            .filter(|(_, types)| types.contains(json_type))
            .map(|(choice, _)| choice)
            .collect();
        behind(json_type, &fitting, defs, &mut conditions);
    }
    let mut hints = choices.to_vec();
    hints.push(
        object
            .get("description")
            .map_or_else(|| json!({}), |text| json!({ "description": text })),
    );
    object.remove(key);
    object.insert("type".to_owned(), json!(allowed));
    object.insert("allOf".to_owned(), json!(conditions));
    object.insert("anyOf".to_owned(), json!(hints));
}

/// Adds the conditions for a value of one JSON type.
fn behind(json_type: &str, fitting: &[&Value], defs: &Value, conditions: &mut Vec<Value>) {
    let holds = |then: Value| json!({ "if": { "type": json_type }, "then": then });
    if let [one] = fitting {
        conditions.push(holds((*one).clone()));
        return;
    }
    let tags: Option<Vec<&str>> = fitting.iter().map(|choice| tag(resolved(choice, defs))).collect();
    if let Some(tags) = tags.filter(|_| json_type == "object") {
        let known = json!({ "required": ["type"], "properties": { "type": { "enum": tags } } });
        conditions.push(holds(known));
        for (tag, choice) in tags.iter().zip(fitting) {
            let named = json!({ "type": "object", "required": ["type"], "properties": { "type": { "const": tag } } });
            conditions.push(json!({ "if": named, "then": choice }));
        }
        return;
    }
    let words: Option<Vec<Vec<Value>>> = fitting.iter().map(|choice| words(resolved(choice, defs))).collect();
    conditions.push(holds(match words {
        Some(words) => json!({ "enum": words.concat() }),
        None => json!({ "anyOf": fitting }),
    }));
}

/// One schema instead of choices of different JSON types: each keyword holds for its own type.
fn flat(choices: &[Value]) -> Option<Map<String, Value>> {
    /// Keywords that hold for values of one type only.
    const OWN: [&str; 13] = [
        "items",
        "minItems",
        "maxItems",
        "uniqueItems",
        "minimum",
        "maximum",
        "exclusiveMinimum",
        "exclusiveMaximum",
        "format",
        "pattern",
        "minLength",
        "maxLength",
        "properties",
    ];
    /// Keywords that only describe.
    const SAID: [&str; 3] = ["description", "examples", "title"];
    let mut one = Map::new();
    let mut all: Vec<Value> = Vec::new();
    for choice in choices {
        for (keyword, value) in choice.as_object()? {
            match keyword.as_str() {
                "type" => {
                    let types = value.as_array().cloned().unwrap_or_else(|| vec![value.clone()]);
                    if types.iter().any(|t| all.contains(t)) {
                        return None;
                    }
                    all.extend(types);
                }
                known if SAID.contains(&known) => {
                    one.entry(known).or_insert_with(|| value.clone());
                }
                known if OWN.contains(&known) && one.insert(known.to_owned(), value.clone()).is_none() => {}
                _ => return None,
            }
        }
        choice.get("type")?;
    }
    one.insert("type".to_owned(), json!(all));
    Some(one)
}

pub(super) fn resolved<'a>(schema: &'a Value, defs: &'a Value) -> &'a Value {
    let name = schema[REF].as_str().and_then(|r| r.rsplit('/').next());
    name.and_then(|name| defs.get(name)).unwrap_or(schema)
}

/// The JSON types that a schema accepts; `None` if it does not declare them.
fn types(schema: &Value) -> Option<Vec<&str>> {
    match &schema["type"] {
        Value::String(one) => Some(vec![one]),
        Value::Array(several) => several.iter().map(Value::as_str).collect(),
        _ if words(schema).is_some() => Some(vec!["string"]),
        _ => schema["anyOf"]
            .as_array()
            .or_else(|| schema["oneOf"].as_array())?
            .iter()
            .map(types)
            .collect::<Option<Vec<_>>>()
            .map(|all| all.concat()),
    }
}

/// The `type` that a block must have.
fn tag(schema: &Value) -> Option<&str> {
    let is_required = schema["required"].as_array()?.iter().any(|field| field == "type");
    schema["properties"]["type"]["const"].as_str().filter(|_| is_required)
}

/// The texts that a schema lists.
fn words(schema: &Value) -> Option<Vec<Value>> {
    let listed = schema["enum"].as_array().cloned();
    let all = listed.or_else(|| schema.get("const").map(|one| vec![one.clone()]))?;
    all.iter().all(Value::is_string).then_some(all)
}
