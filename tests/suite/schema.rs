use fusion::models::registry::{self, Role};
use jsonschema::Validator;
use jsonschema::error::ValidationError;
use serde_json::{Value, json};
use std::sync::LazyLock;

/// The errors that the schema finds in a design, each as `/path/to/the/value keyword: reason`.
fn against_schema(design: &Value) -> Vec<String> {
    static SCHEMA: LazyLock<Validator> = LazyLock::new(|| {
        fusion_live::link_blocks();
        jsonschema::draft202012::new(&fusion::schema::design()).unwrap()
    });
    let told = |error: ValidationError<'_>| format!("{} {}: {error}", error.instance_path(), error.kind().keyword());
    SCHEMA.iter_errors(design).map(told).collect()
}

fn read(toml: &str) -> Value {
    serde_json::to_value(toml::from_str::<toml::Table>(toml).unwrap()).unwrap()
}

/// The example of every block at its place in a design.
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
            Role::Link => {
                block["sources"] = json!(["gnss"]);
                block["clock"] = json!("related");
                design["link"] = json!({ "x": block });
            }
            Role::Output => {
                block["rate"] = json!("10 Hz");
                design["output"] = json!({ "x": block });
            }
            Role::Fault => {
                design["source"]["gnss"]["fault"] = json!({ "x": block.clone() });
                let rows = json!({ "rate": "1 Hz", "fault": { "x": block } });
                let trajectory = json!([{ "type": "rest", "duration": 1 }]);
                design["simulation"] = json!({ "trajectory": trajectory, "imu": rows, "sensor": { "gnss": rows } });
            }
            Role::Segment => design["simulation"] = json!({ "trajectory": [block] }),
            Role::Task => design["simulation"] = json!({ "mission": [block] }),
            Role::Vehicle | Role::Control => design["simulation"] = json!({ r.role.name(): block }),
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
            if path.is_dir() && !path.ends_with("parts") {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "toml") {
                // As it is written, and with its parts.
                let flat = fusion::config::Document::load(&path).unwrap().flat();
                for text in [std::fs::read_to_string(&path).unwrap(), flat] {
                    assert_eq!(against_schema(&read(&text)), [] as [&str; 0], "{}", path.display());
                }
                count += 1;
            }
        }
    }
    assert!(count > 0);
}

/// The comparison can fail.
#[test]
fn slips_are_invalid() {
    let sensor = "[sensor.x]\ntype = \"zero_velocity\"\nsource = \"gnss\"\nnoise = { sigma = 1 }\n";
    let stage = "[stage.x]\ntype = \"periodic\"\nsource = \"gnss\"\n";
    let simulation = "[simulation]\ntrajectory = [{ type = \"rest\", duration = 1 }]\n[simulation.imu]\nrate = 1\n";
    let slips = [
        // Missing keys.
        (sensor.replace("source = \"gnss\"\n", ""), ["/sensor/x required"].as_slice()),
        (stage.to_owned(), &["/stage/x required"]),
        (sensor.replace("type = \"zero_velocity\"\n", ""), &["/sensor/x required"]),
        // Values of a wrong type.
        (format!("{sensor}enabled = 1"), &["/sensor/x/enabled type"]),
        (format!("{sensor}only_with = [\"gnss\"]"), &["/sensor/x/only_with type"]),
        (format!("{stage}rate = true"), &["/stage/x/rate type"]),
        (
            sensor.replace("zero_velocity", "gnss_position") + "lever_arm = [1, 2]",
            &["/sensor/x/lever_arm minItems"],
        ),
        // Parts.
        ("include = \"part.toml\"".to_owned(), &["/include type"]),
        // Unknown names: a table, a key, a block, a choice.
        ("[sensors.x]".to_owned(), &["/sensors not"]),
        (format!("{sensor}lever_rm = 1"), &["/sensor/x/lever_rm not"]),
        (sensor.replace("zero_velocity", "zero_velocty"), &["/sensor/x/type enum"]),
        ("[filter]\nbackend = \"ekff\"".to_owned(), &["/filter/backend enum"]),
        (
            "[initial.x]\ntype = \"course\"\nsource = \"gnss\"\nmin_speed = 3\nsigma = 1\nlever_arm = 1".to_owned(),
            &["/initial/x/lever_arm not"],
        ),
        // The noise: its 1σ, an array of them, a table.
        (sensor.replace("{ sigma = 1 }", "true"), &["/sensor/x/noise type"]),
        (sensor.replace("{ sigma = 1 }", "[1, true]"), &["/sensor/x/noise/1 type"]),
        (sensor.replace("{ sigma = 1 }", "{ sigm = 1 }"), &["/sensor/x/noise/sigm not"]),
        // Deep inside a block: a parameter, a gate, a segment of a trajectory.
        (
            sensor.replace("zero_velocity", "gnss_position") + "lever_arm = { estimate = true, initial = [0, 0, 1], sigma = true }",
            &["/sensor/x/lever_arm/sigma type"],
        ),
        (
            format!("{sensor}gate = {{ type = \"nis\", probability = true }}"),
            &["/sensor/x/gate/probability type"],
        ),
        (format!("{sensor}gate = \"niss\""), &["/sensor/x/gate enum"]),
        (
            simulation.replace("duration = 1", "duration = true"),
            &["/simulation/trajectory/0/duration type"],
        ),
        // A fault without its rate and with a key of another fault, on a source and on the simulated unit.
        (
            "[source.gnss.fault.x]\ntype = \"drop\"\nshare = 0.1".to_owned(),
            &["/source/gnss/fault/x required", "/source/gnss/fault/x/share not"],
        ),
        (
            format!("{simulation}fault.x = {{ type = \"drop\", share = 0.1 }}"),
            &["/simulation/imu/fault/x required", "/simulation/imu/fault/x/share not"],
        ),
    ];
    for (slip, expected) in slips {
        let (before, after) = if slip.starts_with("include") {
            (slip.as_str(), "")
        } else {
            ("", slip.as_str())
        };
        let found = against_schema(&read(&format!("{before}\n{}\n{after}\n", crate::support::DESIGN)));
        let kinds: Vec<&str> = found.iter().map(|f| f.split(':').next().unwrap()).collect();
        assert_eq!(kinds, expected, "{slip}\n{found:#?}");
    }
    assert_eq!(against_schema(&read(crate::support::DESIGN)), [] as [&str; 0]);
}

/// The published schemas are the output of the program.
#[test]
fn the_published_schemas_are_the_printed_ones() {
    let schemas = [
        ("fusion", "", fusion::schema::design()),
        ("summary", " --summary", fusion::run::summary_schema()),
    ];
    for (name, option, schema) in schemas {
        let path = format!("schema/{name}.schema.json");
        let published = std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(&path)).unwrap();
        assert!(
            published == format!("{schema:#}\n"),
            "{path} is not what the program prints: `cargo run -- schema{option} > {path}`"
        );
    }
}

/// Every key of a result is in the schema, and every value is as it says.
#[test]
fn a_summary_obeys_its_schema() {
    let mut schema = fusion::run::summary_schema();
    close(&mut schema);
    let validator = jsonschema::draft202012::new(&schema).unwrap();
    for (design, options) in [
        ("ins-gps", &["--smooth=iterate"] as &[&str]),
        ("tracked-navigators", &[]),
        ("utv-square", &[]),
        ("after-outage", &[]),
    ] {
        let workspace = crate::support::Workspace::new("summary-schema");
        let path = format!("{}/configs/{design}.toml", env!("CARGO_MANIFEST_DIR"));
        workspace.fusion(&[&["run", &path, "--out", "out"], options].concat()).success();
        let summary = serde_json::from_str(&workspace.read("out/summary.json")).unwrap();
        let wrong: Vec<String> = validator
            .iter_errors(&summary)
            .map(|e| format!("{}: {e}", e.instance_path()))
            .collect();
        assert!(wrong.is_empty(), "{design}: {wrong:#?}");
    }
}

/// Refuses keys that an object of the schema does not name.
fn close(schema: &mut serde_json::Value) {
    match schema {
        serde_json::Value::Object(map) => {
            if map.contains_key("properties") {
                map.insert("unevaluatedProperties".to_owned(), false.into());
            }
            map.values_mut().for_each(close);
        }
        serde_json::Value::Array(items) => items.iter_mut().for_each(close),
        _ => {}
    }
}
