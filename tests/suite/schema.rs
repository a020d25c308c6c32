use fusion::models::registry::{self, Role};
use serde_json::{Value, json};

/// What of `value` the schema does not allow, as far as the framework uses JSON Schema.
fn complaints(schema: &Value, value: &Value, root: &Value, path: &str) -> Vec<String> {
    let mut found = Vec::new();
    if let Some(reference) = schema["$ref"].as_str() {
        found.extend(complaints(root.pointer(&reference[1..]).unwrap(), value, root, path));
    }
    for key in ["oneOf", "anyOf"] {
        let Some(choices) = schema[key].as_array() else { continue };
        let mut each: Vec<_> = choices.iter().map(|c| complaints(c, value, root, path)).collect();
        let fitting = each.iter().filter(|c| c.is_empty()).count();
        if fitting == 0 {
            // The nearest choice tells most: of blocks the one of that type.
            let is_other = |c: &Vec<String>| c.iter().any(|c| c.starts_with(&format!("{path}.type:")));
            each.sort_by_key(|c| (is_other(c), c.len()));
            found.extend(each.swap_remove(0));
        } else if key == "oneOf" && fitting > 1 {
            found.push(format!("{path}: {fitting} choices fit"));
        }
    }
    let is = |name: &Value| match name.as_str().unwrap() {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_i64() || value.is_u64(),
        "boolean" => value.is_boolean(),
        other => panic!("type {other}"),
    };
    let typed = match &schema["type"] {
        Value::Null => true,
        Value::Array(any) => any.iter().any(is),
        one => is(one),
    };
    if !typed {
        return vec![format!("{path}: {value} is not {}", schema["type"])];
    }
    if schema.get("const").is_some_and(|c| c != value) {
        found.push(format!("{path}: {value} is not {}", schema["const"]));
    }
    if schema["enum"].as_array().is_some_and(|e| !e.contains(value)) {
        found.push(format!("{path}: {value} is none of {}", schema["enum"]));
    }
    if let Some(n) = value.as_f64() {
        let beyond = |key: &str, wrong: fn(f64, f64) -> bool| schema[key].as_f64().is_some_and(|limit| wrong(n, limit));
        if beyond("minimum", |n, l| n < l) || beyond("maximum", |n, l| n > l) || beyond("exclusiveMinimum", |n, l| n <= l) {
            found.push(format!("{path}: {n} is out of range"));
        }
    }
    if let Some(items) = value.as_array() {
        let count = items.len() as u64;
        if schema["minItems"].as_u64().is_some_and(|n| count < n) || schema["maxItems"].as_u64().is_some_and(|n| count > n) {
            found.push(format!("{path}: {count} elements"));
        }
        for (k, item) in items.iter().enumerate().filter(|_| schema.get("items").is_some()) {
            found.extend(complaints(&schema["items"], item, root, &format!("{path}[{k}]")));
        }
    }
    if let Some(object) = value.as_object() {
        for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if !object.contains_key(name) {
                found.push(format!("{path}: no `{name}`"));
            }
        }
        for (key, inner) in object {
            let path = format!("{path}.{key}");
            match (schema["properties"].get(key), schema.get("additionalProperties")) {
                (Some(of), _) => found.extend(complaints(of, inner, root, &path)),
                (None, Some(Value::Bool(false))) => found.push(format!("{path} is not known")),
                (None, Some(of @ Value::Object(_))) => found.extend(complaints(of, inner, root, &path)),
                _ => {}
            }
        }
    }
    found
}

fn read(toml: &str) -> Value {
    serde_json::to_value(toml::from_str::<toml::Table>(toml).unwrap()).unwrap()
}

fn against_schema(design: &Value) -> Vec<String> {
    let schema = fusion::schema::design();
    complaints(&schema, design, &schema, "")
}

/// The example of every block where it belongs in a design.
#[test]
fn every_example_is_valid() {
    fusion::models::link();
    for r in registry::all() {
        let mut block = read(r.example);
        block["type"] = json!(r.name);
        let mut design = read(crate::support::DESIGN);
        match r.role {
            Role::Process => design["process"] = block,
            Role::Sensor => {
                block["source"] = json!("gnss");
                block["enabled"] = json!(false);
                block["only_with"] = json!("gnss");
                block["noise"] = json!({ "sigma": ["1 m", 2.5], "from_source": true, "scale": 1.5 });
                design["sensor"]["x"] = block;
            }
            Role::Stage => {
                block["enabled"] = json!(true);
                design["stage"] = json!({ "x": block });
            }
            Role::Initialiser => {
                block["enabled"] = json!(false);
                design["initial"]["x"] = block;
            }
            Role::Gate => design["sensor"]["gnss"]["gate"] = block,
            Role::Loss => design["sensor"]["gnss"]["loss"] = block,
            Role::Source => design["source"]["x"] = block,
            Role::Fault => {
                design["source"]["gnss"]["fault"] = json!({ "x": block.clone() });
                let rows = json!({ "rate": "1 Hz", "fault": { "x": block } });
                let trajectory = json!([{ "type": "rest", "duration": 1 }]);
                design["simulation"] = json!({ "trajectory": trajectory, "imu": rows, "sensor": { "gnss": rows } });
            }
            Role::Segment => design["simulation"] = json!({ "trajectory": [block] }),
        }
        assert_eq!(against_schema(&design), [] as [&str; 0], "{} `{}`", r.role.name(), r.name);
    }
}

#[test]
fn every_shipped_design_is_valid() {
    let mut folders = vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs")];
    let mut count = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "toml") {
                let found = against_schema(&read(&std::fs::read_to_string(&path).unwrap()));
                assert_eq!(found, [] as [&str; 0], "{}", path.display());
                count += 1;
            }
        }
    }
    assert!(count > 0);
}

/// That the comparison can fail.
#[test]
fn slips_are_invalid() {
    let slips = [
        ("[sensor.x]\ntype = \"zero_velocity\"\nnoise = { sigma = 1 }", "no `source`"),
        (
            "[sensor.x]\ntype = \"zero_velocity\"\nsource = \"gnss\"\nnoise = { sigma = 1 }\nenabled = 1",
            ".enabled: 1 is not",
        ),
        (
            "[sensor.x]\ntype = \"zero_velocity\"\nsource = \"gnss\"\nnoise = { sigma = 1 }\nonly_with = [\"gnss\"]",
            ".only_with: [\"gnss\"] is not",
        ),
        ("[sensors.x]", ".sensors is not known"),
        ("[filter]\nbackend = \"ekff\"", "is not"),
        ("[stage.x]\ntype = \"periodic\"\nsource = \"gnss\"", "no `rate`"),
        ("[stage.x]\ntype = \"periodic\"\nsource = \"gnss\"\nrate = true", "is not"),
        (
            "[initial.x]\ntype = \"course\"\nsource = \"gnss\"\nmin_speed = 3\nsigma = 1\nlever_arm = 1",
            "is not known",
        ),
        (
            "[sensor.x]\ntype = \"gnss_position\"\nsource = \"gnss\"\nnoise = {}\nlever_arm = [1, 2]",
            "lever_arm",
        ),
        ("[source.gnss.fault.x]\ntype = \"drop\"\nshare = 0.1", "not"),
        (
            "[simulation]\ntrajectory = []\n[simulation.imu]\nrate = 1\nfault.x = { type = \"drop\", share = 0.1 }",
            "imu.fault.x",
        ),
    ];
    for (slip, word) in slips {
        let found = against_schema(&read(&format!("{}\n{slip}\n", crate::support::DESIGN)));
        assert!(found.iter().any(|f| f.contains(word)), "{slip}: {found:?}");
    }
    assert_eq!(against_schema(&read(crate::support::DESIGN)), [] as [&str; 0]);
}
