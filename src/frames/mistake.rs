//! What is said of a mistake, and what to write instead.

use crate::config::{Diagnostic, Node};

/// Where each body axis is found: the declared axis, and whether with the other sign.
pub(super) type Axes = [(usize, bool); 3];

/// As declared.
pub(super) const DECLARED: Axes = [(0, false), (1, false), (2, false)];

const NAMES: [&str; 3] = ["x", "y", "z"];
const WORLD: [&str; 3] = ["north", "east", "down"];

/// Completes what is known by the right hand; `None` where it is too little, or an axis is there twice. Where no axis is
/// exchanged for another a sign may be wrong alone, and the right hand tells nothing.
pub(super) fn complete(known: [Option<(usize, bool)>; 3]) -> Option<Axes> {
    let missing: Vec<usize> = (0..3).filter(|i| known[*i].is_none()).collect();
    let mut axes = known.map(|k| k.unwrap_or((3, false)));
    match missing[..] {
        [] => {}
        [row] if (0..3).all(|i| i == row || axes[i].0 == i) => {
            axes[row] = (row, false);
            return (axes == DECLARED).then_some(axes);
        }
        [row] => {
            let used: usize = axes.iter().map(|(axis, _)| *axis).filter(|a| *a < 3).sum();
            axes[row] = (3_usize.checked_sub(used)?, false);
            if !is_permutation(&axes) {
                return None;
            }
            axes[row].1 = handedness(&axes) < 0.0;
        }
        _ => return None,
    }
    is_permutation(&axes).then_some(axes)
}

fn is_permutation(axes: &Axes) -> bool {
    (0..3).all(|axis| axes.iter().any(|(a, _)| *a == axis))
}

/// The determinant: −1 where the axes as declared are left-handed.
pub(super) fn handedness(axes: &Axes) -> f64 {
    let mut m = nalgebra::Matrix3::zeros();
    axes.iter()
        .enumerate()
        .for_each(|(row, (axis, negative))| m[(row, *axis)] = if *negative { -1.0 } else { 1.0 });
    m.determinant()
}

fn signed(name: &str, negative: bool) -> String {
    if negative { format!("-{name}") } else { name.to_owned() }
}

/// The names of axes of the body, or of the world.
pub(super) const fn names(is_world: bool) -> [&'static str; 3] {
    if is_world { WORLD } else { NAMES }
}

/// What differs, an axis each: `north is the declared east`.
pub(super) fn differing(known: &[Option<(usize, bool)>; 3], is_world: bool) -> String {
    let bodies = ["forward", "right", "down"];
    let (are, declared) = if is_world { (WORLD, WORLD) } else { (bodies, NAMES) };
    let differ = known
        .iter()
        .enumerate()
        .filter_map(|(row, k)| k.filter(|k| *k != (row, false)).map(|k| (row, k)));
    let each = differ.map(|(row, (axis, negative))| {
        let sign = if negative { "minus " } else { "" };
        format!("{} is {sign}the declared {}", are[row], declared[axis])
    });
    each.collect::<Vec<_>>().join(", ")
}

/// What to write instead in the table of a channel.
pub(super) fn remedy(channel: Option<&Node>, axes: &Axes) -> String {
    let columns: Option<Vec<&str>> = channel
        .and_then(|c| c.get("columns"))
        .and_then(|c| match c.value() {
            crate::config::Value::Array(items) => items.iter().map(Node::as_str).collect(),
            _ => None,
        })
        .filter(|c: &Vec<&str>| c.len() == 3);
    let rotation = channel.and_then(|c| c.get("rotation"));
    let before = rotation.map_or(Some(DECLARED), axes_of);
    let is_turned = handedness(axes) > 0.0;
    match (columns, before) {
        (_, Some(before)) if is_turned && rotation.is_some() => {
            let after = axes.map(|(axis, negative)| (before[axis].0, before[axis].1 != negative));
            format!("write `rotation = {{ axes = [{}] }}`", list(&after))
        }
        (Some(columns), Some(before)) => format!("write `columns = [{}]`", exchanged(&columns, &before, axes).join(", ")),
        (None, Some(_)) if is_turned => format!("write `rotation = {{ axes = [{}] }}`", list(axes)),
        (_, None) if is_turned => format!("after the `rotation` there, turn the axes by `{}`", list(axes)),
        _ => format!(
            "the axes are left-handed: change the sign of a column; the body axes are {}",
            list(axes)
        ),
    }
}

/// The columns that a rotation `before` of them brings to `axes` of what is declared.
fn exchanged(columns: &[&str], before: &Axes, axes: &Axes) -> Vec<String> {
    let mut written = vec![String::new(); 3];
    for ((to, outer), (axis, negative)) in before.iter().zip(axes) {
        let (from, inner) = before[*axis];
        let (is_negative, name) = columns[from].strip_prefix('-').map_or((false, columns[from]), |name| (true, name));
        let minus = [*outer, *negative, inner, is_negative].iter().filter(|minus| **minus).count() % 2 == 1;
        written[*to] = format!("{:?}", signed(name, minus));
    }
    written
}

fn list(axes: &Axes) -> String {
    let one = |(axis, negative): &(usize, bool)| format!("{:?}", signed(NAMES[*axis], *negative));
    axes.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// The axes that a rotation is declared by.
fn axes_of(rotation: &Node) -> Option<Axes> {
    let mut found = DECLARED;
    let crate::config::Value::Array(items) = rotation.get("axes")?.value() else {
        return None;
    };
    for (to, item) in found.iter_mut().zip(items) {
        let text = item.as_str()?;
        let (negative, letter) = text.strip_prefix('-').map_or((false, text), |letter| (true, letter));
        *to = (NAMES.iter().position(|n| *n == letter)?, negative);
    }
    Some(found)
}

/// A mistake in a channel of a source.
pub(super) fn at(source: &Node, channel: &str, key: &str, message: String) -> Diagnostic {
    let path = format!("channels.{channel}");
    let place = match source.at(&path).and_then(|c| c.get(key)) {
        Some(node) => node.place(),
        None => source.place_of(&path),
    };
    Diagnostic::warning(message).at(place)
}

/// What a wrong factor may come from, and what to write; `small` is by how much the numbers are too small.
pub(super) fn unit(channel: &str, small: f64, rate: f64) -> Option<&'static str> {
    let is = |factor: f64| (small / factor).ln().abs() < 0.25;
    let degrees = 1.0_f64.to_radians();
    match channel {
        "angular_rate" | "position" if is(1.0 / degrees) => Some("degrees are declared, the columns are radians: write `rad` in `unit`"),
        "angular_rate" | "position" if is(degrees) => Some("radians are declared, the columns are degrees: write `deg` in `unit`"),
        "specific_force" if is(9.81) => {
            Some("metres per second squared are declared, the columns are in units of gravity: write `unit = \"g\"`")
        }
        "specific_force" if is(1.0 / 9.81) => {
            Some("units of gravity are declared, the columns are metres per second squared: write `unit = \"m/s^2\"`")
        }
        "velocity" if is(1.0 / 3.6) => Some("metres per second are declared, the columns are kilometres per hour: write `unit = \"km/h\"`"),
        "velocity" if is(3.6) => Some("kilometres per hour are declared, the columns are metres per second: write `unit = \"m/s\"`"),
        "angular_rate" | "specific_force" if is(rate) => Some("the columns hold increments over a sample: write `increment = true`"),
        "angular_rate" | "specific_force" if is(1.0 / rate) => Some("the columns hold rates, no increments: leave out `increment`"),
        _ => None,
    }
}
