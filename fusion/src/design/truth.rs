//! `truth` of a simulated sensor: parameters whose true values differ from those of the filter.
//!
//! A simulated sensor measures by the model that the filter has of it. The *true design* is the design with these
//! values laid over its sensors. For an estimated parameter the value is the true one, and the filter starts from
//! `initial`. The true design has the states of the filter, so that the truth can be given in these states. It also
//! has the current of the sea as a state, if a sensor measures against a current that the filter takes as known.

use super::{Design, Draft};
use crate::config::{Diagnostic, Diagnostics, Document, Entry, Node, Value};
use fusion_models::param::ScalarParam;
use fusion_models::registry::{self, Role};
use fusion_models::units::dim;
use fusion_models::vocabulary::parameter;
use schemars::schema_for;
use serde_json::Value as Json;

/// The table of a simulated sensor, and the keys of a parameter that is a state, its own or that of another block.
const TRUTH: &str = "truth";
const ESTIMATE: &str = "estimate";
const SHARED: &str = "shared";
/// A parameter that every sensor has.
const TIME_OFFSET: &str = "time_offset";

/// The true values that differ from those of the filter.
#[derive(Debug)]
pub struct Truth {
    /// The true design: its process and its sensors are those of the world.
    pub design: Box<Design>,
    /// States whose true value is declared, such as `gnss.lever_arm`.
    pub given: Vec<String>,
}

impl Truth {
    /// Takes the tables `truth` out of `simulation`. If there are any, lays them over `document` and reads the true
    /// design. The sensors `kept`, which the filter leaves out, are enabled in it.
    pub(super) fn take(simulation: &mut Node, document: &Document, kept: &[String], d: &mut Diagnostics) -> Option<Self> {
        let is_wet = simulation.at("sea.current").is_some();
        let mut told: Vec<(String, Node)> = Vec::new();
        for Entry { key, node } in simulation.get_mut("sensor").map_or(&mut [][..], Node::entries_mut) {
            let truth = node.take(TRUTH).unwrap_or_else(|| node.emptied());
            told.push((key.clone(), truth));
        }
        let (mut of_truth, mut given, mut is_other) = (document.root().clone(), Vec::new(), !kept.is_empty());
        for name in kept {
            let sensor = of_truth.get_mut("sensor").and_then(|sensors| sensors.get_mut(name));
            drop(sensor.and_then(|sensor| sensor.take("enabled")));
        }
        let before = d.iter().count();
        for (name, truth) in &mut told {
            let Some(sensor) = of_truth.get_mut("sensor").and_then(|sensors| sensors.get_mut(name)) else {
                continue;
            };
            // A sensor that measures through water does so in the simulated current of the sea.
            let is_constant = |declared: &Node| declared.get(ESTIMATE).is_none() && declared.get(SHARED).is_none();
            if let Some(current) = truth.get(parameter::CURRENT).filter(|_| is_wet) {
                let message = "the sea has a current already, and it is what there truly is";
                let help = format!("remove this one, or `{}` of the sea", parameter::CURRENT);
                d.push(Diagnostic::error(message).at(current.name_place()).help(help));
            }
            if is_wet && sensor.get(parameter::CURRENT).is_some_and(is_constant) {
                sensor.put(parameter::CURRENT, moving_water());
                is_other = true;
            }
            let schema = schema_of(sensor);
            let laid = Laid {
                name,
                root: &schema,
                is_plain: &mut is_other,
                given: &mut given,
            };
            d.extend(laid.table("", &schema, truth, sensor));
        }
        if given.is_empty() && !is_other || d.iter().count() > before {
            return None;
        }
        of_truth
            .get_mut("simulation")?
            .get_mut("sensor")?
            .entries_mut()
            .iter_mut()
            .for_each(|sensor| {
                sensor.node.take(TRUTH);
            });
        let mut found = Diagnostics::new();
        let design = Draft::of(document.within(of_truth), &mut found).whole();
        // The reader of the design itself reports its other mistakes.
        let is_of_truth = |mistake: &&Diagnostic| told.iter().any(|(_, truth)| truth.any(&|node| node.place().holds(&mistake.place)));
        d.extend(found.iter().filter(is_of_truth).cloned());
        let design = design.ok().filter(|_| !found.has_errors())?;
        Some(Self {
            design: Box::new(design),
            given,
        })
    }
}

/// A current as a state, whose value the sea gives.
fn moving_water() -> Node {
    let text = format!("{} = {{ {ESTIMATE} = true, initial = [0, 0, 0], sigma = 1 }}", parameter::CURRENT);
    let (document, _) = Document::parse("", &text);
    document.root().entries()[0].node.clone()
}

/// Whether a parameter is a state.
fn is_estimated(declared: &Node) -> bool {
    matches!(declared.get(ESTIMATE).map(Node::value), Some(Value::Boolean(true)))
}

/// Returns true if a parameter, or any parameter in a table, is a state. The true value of a state is drawn, or is
/// the initial value of the filter.
fn has_estimated(declared: &Node) -> bool {
    is_estimated(declared) || matches!(declared.value(), Value::Table { .. }) && declared.entries().iter().any(|e| has_estimated(&e.node))
}

/// Lays the true values over a sensor.
struct Laid<'a> {
    name: &'a str,
    /// The schema of its block, to which others refer.
    root: &'a Json,
    /// Parameters whose true value is declared.
    given: &'a mut Vec<String>,
    /// Set if another figure, which is not a parameter, differs.
    is_plain: &'a mut bool,
}

impl Laid<'_> {
    /// Lays `truth` over the table of the sensor at `path`, which has this schema; the mistakes.
    fn table(mut self, path: &str, schema: &Json, truth: &Node, sensor: &mut Node) -> Vec<Diagnostic> {
        let mut mistakes = Vec::new();
        self.lay(path, schema, truth, sensor, &mut mistakes);
        mistakes
    }

    fn lay(&mut self, path: &str, schema: &Json, truth: &Node, sensor: &mut Node, mistakes: &mut Vec<Diagnostic>) {
        if !matches!(truth.value(), Value::Table { .. }) {
            let help = "such as `truth = { lever_arm = [0.5, 0, \"-1 m\"] }`";
            let message = format!("a table of true parameters of `{}{path}` is expected here", self.name);
            mistakes.push(Diagnostic::error(message).at(truth.place()).help(help));
            return;
        }
        let fields = schema["properties"].as_object().into_iter().flatten();
        let fields = fields.map(|(key, field)| (key.as_str(), resolved(self.root, field)));
        let known: Vec<&str> = fields.filter(|(_, field)| may_differ(field)).map(|(key, _)| key).collect();
        for Entry { key, node } in truth.entries() {
            let field = resolved(self.root, &schema["properties"][key]);
            if !known.contains(&key.as_str()) {
                let message = format!(
                    "`{key}` is no figure of `{}{path}`, and only these may truly differ from what the filter believes",
                    self.name
                );
                let mistake = Diagnostic::error(message).at(node.name_place()).suggest(key, &known, "figures");
                mistakes.push(if key == "noise" {
                    mistake.and_help("how noisy it truly is, `white` of the simulated sensor says")
                } else {
                    mistake
                });
            } else if is_group(field) {
                if sensor.get(key).is_none() {
                    sensor.put(key, node.emptied());
                }
                if let Some(declared) = sensor.get_mut(key) {
                    self.lay(&format!("{path}.{key}"), field, node, declared, mistakes);
                }
            } else if matches!(node.value(), Value::Table { .. }) {
                let help = "write the value alone, as for a parameter that is fixed";
                mistakes.push(Diagnostic::error("what is true is a value").at(node.place()).help(help));
            } else {
                if is_parameter(field) {
                    self.given.push(format!("{}{path}.{key}", self.name));
                } else {
                    *self.is_plain = true;
                }
                match sensor.get_mut(key).filter(|declared| is_estimated(declared)) {
                    Some(declared) => declared.put("initial", node.clone()),
                    None => sensor.put(key, node.clone()),
                }
            }
        }
    }
}

/// The schema that a field refers to, or its own.
fn resolved<'a>(root: &'a Json, field: &'a Json) -> &'a Json {
    let named = field["$ref"].as_str().and_then(|path| root.pointer(path.strip_prefix('#')?));
    named.unwrap_or(field)
}

/// Returns true if the true value of a field may differ: a parameter, a figure with a unit, or a table of these.
fn may_differ(field: &Json) -> bool {
    let is = |name: &str| field["type"].as_array().into_iter().flatten().any(|kind| kind == name);
    is_parameter(field) || is("number") && is("string") || is_group(field)
}

/// Whether a field is a table of figures.
fn is_group(field: &Json) -> bool {
    let mut inside = field["properties"].as_object().into_iter().flatten();
    !is_parameter(field) && inside.any(|(_, field)| is_parameter(field))
}

/// The fields that a sensor may declare: its own fields, and the common ones that can be estimated.
fn schema_of(sensor: &Node) -> Json {
    let kind = sensor.get("type").and_then(Node::as_str).unwrap_or_default();
    let block = registry::all().into_iter().find(|r| r.role == Role::Sensor && r.name == kind);
    let mut schema = block.map(|block| (block.schema)().to_value()).unwrap_or_default();
    if let Some(fields) = schema["properties"].as_object_mut() {
        fields.insert(TIME_OFFSET.to_owned(), schema_for!(ScalarParam<dim::Duration>).to_value());
    }
    schema
}

/// The parameters of a sensor with their schemas. A design may declare each as fixed or as estimated.
pub fn parameters(sensor: &Node) -> Vec<(String, Json)> {
    let schema = schema_of(sensor);
    let fields = schema["properties"].as_object().into_iter().flatten();
    let parameters = fields.filter(|(_, schema)| is_parameter(schema));
    parameters.map(|(key, schema)| (key.clone(), schema.clone())).collect()
}

/// The figures of a sensor that may be others in truth, by their fields.
fn figures(sensor: &Node) -> Vec<String> {
    let schema = schema_of(sensor);
    let fields = schema["properties"].as_object().into_iter().flatten();
    let figures = fields.filter(|(_, field)| may_differ(resolved(&schema, field)));
    figures.map(|(key, _)| key.clone()).collect()
}

/// Whether a field has a form with `estimate`.
fn is_parameter(schema: &Json) -> bool {
    let mut forms = schema["anyOf"].as_array().into_iter().flatten();
    schema["properties"].get(ESTIMATE).is_some() || forms.any(is_parameter)
}

/// Warnings for fields of a simulated sensor that variants and `--set` have changed. Without `truth`, they change the
/// simulated instrument too.
pub(crate) fn shared(document: &Document) -> Diagnostics {
    let (root, before) = (document.root(), document.base());
    let mut d = Diagnostics::new();
    let Some(simulation) = root.get("simulation") else { return d };
    let is_wet = simulation.at("sea.current").is_some();
    for Entry { key: name, node } in simulation.get("sensor").map_or(&[][..], Node::entries) {
        let table = |root: &Node| root.get("sensor").and_then(|sensors| sensors.get(name)).cloned();
        let (Some(sensor), Some(base)) = (table(root), table(before.root())) else {
            continue;
        };
        for key in figures(&sensor) {
            let is_told = node.at(&format!("{TRUTH}.{key}")).is_some() || is_wet && key == parameter::CURRENT;
            let Some(value) = sensor.get(&key).filter(|value| !is_told && !has_estimated(value)) else {
                continue;
            };
            let is_same = base.get(&key).is_some_and(|base| base.inline() == value.inline());
            if is_same && !document.is_set(value) {
                continue;
            }
            let message = format!("the simulated instrument `{name}` has this `{key}` too, so the filter is right about it");
            let help = format!("to see what a wrong value does, say what is true: `truth.{key} = …` in `[simulation.sensor.{name}]`");
            d.push(Diagnostic::warning(message).at(value.place()).help(help));
        }
    }
    d
}
