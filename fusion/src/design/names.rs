//! Names: of tables, and of streams, which share one space.

use super::Draft;
use crate::config::{Diagnostic, Diagnostics, Entry, INCLUDE, Node};
use fusion_models::sim::{REFERENCE, SimulationSpec};

/// Tables at the top level of a design, without those of other crates. The crate that judges designs reads `stress`, that
/// of live links `link` and `output`. A program without these crates ignores their tables.
const TABLES: [&str; 14] = [
    "run",
    "filter",
    "health",
    "process",
    "sensor",
    "stage",
    "initial",
    "source",
    "simulation",
    "reference",
    "stress",
    "link",
    "output",
    "variant",
];

/// Tables that are allowed at the top level of a design.
pub(super) fn tables() -> Vec<&'static str> {
    let further = super::FurtherTable::all().into_iter().map(|table| table.name);
    let mut all = TABLES.to_vec();
    all.extend(further.filter(|name| !TABLES.contains(name)));
    all
}

/// Refuses tables that are not among `known`.
pub(super) fn check_tables(root: &Node, known: &[&str], d: &mut Diagnostics) {
    if let Some(include) = root.get(INCLUDE) {
        let message = "nothing can be included here: this design was not read from a file";
        let help = "use `Navigator::from_file`, or say where its paths start with `Navigator::from_toml_in`";
        d.push(Diagnostic::error(message).at(include.name_place()).help(help));
    }
    let entries = root.entries().iter().filter(|e| e.key != INCLUDE);
    for Entry { key, node } in entries.filter(|e| !known.contains(&e.key.as_str())) {
        let unknown = Diagnostic::error(format!("unknown table `{key}`")).at(node.name_place());
        d.push(unknown.suggest(key, known, "known tables"));
    }
}

/// Checks the relations between tables.
pub(super) fn check(design: &mut Draft, d: &mut Diagnostics) {
    check_origin(design, d);
    check_streams(design, d);
    let before = d.iter().count();
    check_simulated(design, d);
    design.unread.simulation |= d.iter().count() > before;
}

fn check_origin(design: &Draft, d: &mut Diagnostics) {
    if design
        .run
        .origin
        .is_some_and(|o| o.latitude.si().abs() > std::f64::consts::FRAC_PI_2)
    {
        let place = design.document.root().place_of("run.origin.latitude");
        let help = "a bare number is in radians: write \"47 deg\"";
        d.push(Diagnostic::error("a latitude lies between -90 and 90 degrees").at(place).help(help));
    }
}

/// Sources, stages and simulated streams share one space of names.
fn check_streams(design: &Draft, d: &mut Diagnostics) {
    let world = design.simulation.as_ref().map(|s| &s.block.world);
    let blocks = design.stages.iter().map(|s| (&s.name, &s.node));
    for (name, node) in blocks.chain(design.filters.iter().map(|f| (&f.name, &f.node))) {
        let name = name.as_str();
        let mut taken = |by: &str, help: &str| {
            let message = format!("`{name}` is the name of {by}");
            d.push(Diagnostic::error(message).at(node.name_place()).help(help));
        };
        if design.sources.iter().any(|s| s.name == name) {
            taken("a source and of a stage", "names of streams must differ; rename one of the two");
        }
        if world.is_some_and(|w| is_instrument(w, name) || name == REFERENCE || w.sensor.contains_key(name)) {
            taken("a stream of the simulated world", "rename the stage, here and where it is read");
        }
    }
}

/// Returns true if an instrument of the world has the stream `name`. Without a ship, the names of its streams are free.
fn is_instrument(world: &SimulationSpec, name: &str) -> bool {
    let is_free = |table: &str| world.ship.is_none() && table.starts_with("ship.");
    world.instruments().iter().any(|(stream, table)| stream == name && !is_free(table))
}

/// Checks that every simulated sensor has the name of a sensor of the design.
fn check_simulated(design: &Draft, d: &mut Diagnostics) {
    let sensors = design.document.root().get("sensor").map_or(&[][..], Node::entries);
    let names: Vec<&str> = sensors.iter().map(|s| s.key.as_str()).collect();
    let simulated = design.simulation.as_ref().and_then(|s| s.node.get("sensor"));
    let simulated = simulated.map_or(&[][..], Node::entries).iter();
    for Entry { key, node } in simulated.filter(|e| !names.contains(&e.key.as_str())) {
        let unknown = Diagnostic::error(format!("`{key}` is simulated, but this design has no sensor of that name")).at(node.name_place());
        d.push(unknown.suggest(key, &names, "a simulated sensor has the name of its sensor"));
    }
}
