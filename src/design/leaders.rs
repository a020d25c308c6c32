//! `only_with`: a sensor that is used only with another, its leader.

use super::{Named, SensorDesign};
use crate::config::{Diagnostic, Diagnostics, Node};
use std::iter::successors;

fn leader(sensor: &Named<SensorDesign>) -> Option<&str> {
    sensor.block.common.only_with.as_deref()
}

/// A leader is a sensor of the design, be it left out, and goes with none of those that go with it.
pub(super) fn check(root: &Node, sensors: &[Named<SensorDesign>], d: &mut Diagnostics) {
    check_names(root, sensors, d);
    check_circles(sensors, d);
}

fn check_names(root: &Node, sensors: &[Named<SensorDesign>], d: &mut Diagnostics) {
    let declared = root.get("sensor").map_or(&[][..], Node::entries);
    let names: Vec<&str> = declared.iter().map(|s| s.key.as_str()).collect();
    for sensor in sensors {
        let Some(name) = leader(sensor).filter(|name| !names.contains(name)) else {
            continue;
        };
        let place = sensor.node.place_of("only_with");
        let unknown = Diagnostic::error(format!("no sensor is called `{name}`")).at(place);
        d.push(unknown.suggest(name, &names, "there are"));
    }
}

/// Refuses a cyclic `only_with`.
fn check_circles(sensors: &[Named<SensorDesign>], d: &mut Diagnostics) {
    let next = |&at: &usize| leader(&sensors[at]).and_then(|name| sensors.iter().position(|s| s.name == name));
    for start in 0..sensors.len() {
        let onwards = successors(next(&start), |at| if *at == start { None } else { next(at) });
        let path: Vec<usize> = onwards.take(sensors.len()).collect();
        // Each circle is told once, where it is entered first in the file.
        if path.last() != Some(&start) || path.iter().any(|at| *at < start) {
            continue;
        }
        let names: Vec<String> = [start].iter().chain(&path).map(|&at| format!("`{}`", sensors[at].name)).collect();
        let place = sensors[start].node.place_of("only_with");
        let help = "a sensor is judged after the one that it goes with: take one `only_with` out";
        let message = format!("`only_with` goes in a circle: {}", names.join(", "));
        d.push(Diagnostic::error(message).at(place).help(help));
    }
}
