//! The text for a mistake, and its correction.

use super::regression::Known;
use fusion::config::{Diagnostic, Diagnostics, Edit, Node};
use fusion::design::{Named, SourceDesign};
use fusion_core::math;
use fusion_models::units::{Duration, parse_unit};
use nalgebra::Vector3;

/// For each body axis: the declared axis, and whether its sign is inverted.
pub(super) type Axes = [(usize, bool); 3];

/// As declared.
pub(super) const DECLARED: Axes = [(0, false), (1, false), (2, false)];

const NAMES: [&str; 3] = ["x", "y", "z"];
const BODY: [&str; 3] = ["forward", "right", "down"];
const WORLD: [&str; 3] = ["north", "east", "down"];

/// The axes as they should be declared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Whole {
    pub(super) axes: Axes,
    /// The axis with an undecided sign: it keeps the declared sign.
    pub(super) open: Option<usize>,
}

impl Whole {
    /// Chooses the undecided sign so that the axes are right-handed.
    pub(super) fn turned(mut self) -> Self {
        if let Some(row) = self.open.filter(|_| handedness(&self.axes) < 0.0) {
            self.axes[row].1 = !self.axes[row].1;
        }
        self
    }
}

/// Completes the known axes. If one axis is missing, it must be the remaining one, and `sign` says if it is negated.
/// `None` if too few axes are known, or if an axis occurs twice.
pub(super) fn complete(known: Known, sign: impl Fn(usize, usize) -> Option<bool>) -> Option<Whole> {
    let missing: Vec<usize> = (0..3).filter(|i| known[*i].is_none()).collect();
    let mut axes = known.map(|k| k.unwrap_or((3, false)));
    let mut open = None;
    match missing[..] {
        [] => {}
        [row] => {
            let used: usize = axes.iter().map(|(axis, _)| *axis).filter(|a| *a < 3).sum();
            let left = 3_usize.checked_sub(used)?;
            let told = sign(row, left);
            axes[row] = (left, told.unwrap_or(false));
            open = told.is_none().then_some(row);
        }
        _ => return None,
    }
    is_permutation(&axes).then_some(Whole { axes, open })
}

fn is_permutation(axes: &Axes) -> bool {
    (0..3).all(|axis| axes.iter().any(|(a, _)| *a == axis))
}

/// The determinant: −1 if the axes as declared are left-handed.
pub(super) fn handedness(axes: &Axes) -> f64 {
    let mut m = nalgebra::Matrix3::zeros();
    axes.iter()
        .enumerate()
        .for_each(|(row, (axis, negative))| m[(row, *axis)] = if *negative { -1.0 } else { 1.0 });
    m.determinant()
}

/// The vector in the corrected axes.
pub(super) fn turned(v: &Vector3<f64>, axes: &Axes) -> Vector3<f64> {
    Vector3::from_fn(|row, _| if axes[row].1 { -v[axes[row].0] } else { v[axes[row].0] })
}

pub(super) fn signed(name: &str, negative: bool) -> String {
    if negative { format!("-{name}") } else { name.to_owned() }
}

/// The correction of a channel: in words, and as edits of keys of its table. Without edits it needs a decision.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Remedy {
    pub(super) words: String,
    pub(super) edits: Vec<Edit>,
}

impl Remedy {
    /// Words alone.
    pub(super) fn words(words: impl Into<String>) -> Self {
        Self {
            words: words.into(),
            edits: Vec::new(),
        }
    }

    /// Writes the values of keys.
    pub(super) fn write(assignments: &[(&str, String)]) -> Self {
        let each: Vec<String> = assignments.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        Self {
            words: format!("write `{}`", each.join(", ")),
            edits: assignments.iter().map(|(key, value)| Edit::set(*key, value)).collect(),
        }
    }

    /// Leaves a key out.
    fn leave_out(key: &str) -> Self {
        Self {
            words: format!("leave out `{key}`"),
            edits: vec![Edit::leave_out(key)],
        }
    }

    /// The cause before the correction.
    pub(super) fn after(self, cause: &str) -> Self {
        Self {
            words: format!("{cause}: {}", self.words),
            ..self
        }
    }

    /// More words.
    pub(super) fn and(mut self, more: &str) -> Self {
        self.words += more;
        self
    }

    /// Corrects a mistake in the table at the path `table`.
    pub(super) fn of(self, told: Diagnostic, table: &str) -> Diagnostic {
        let edits = self.edits.into_iter().map(|edit| edit.within(table));
        told.help(self.words).edits(edits.collect())
    }
}

/// The names of axes of the body, or of the world.
pub(super) const fn names(is_world: bool) -> [&'static str; 3] {
    if is_world { WORLD } else { NAMES }
}

/// The axes for which `is_one` is true, separated by commas.
pub(super) fn of_rows(is_world: bool, is_one: impl Fn(usize) -> bool) -> String {
    let all = if is_world { WORLD } else { BODY };
    let named: Vec<&str> = (0..3).filter(|row| is_one(*row)).map(|row| all[row]).collect();
    named.join(", ")
}

/// The differences, for each axis: `north is the declared east`.
pub(super) fn differing(known: &Known, is_world: bool) -> String {
    let (are, declared) = if is_world { (WORLD, WORLD) } else { (BODY, NAMES) };
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

/// The correction for the table of a channel.
pub(super) fn remedy(channel: Option<&Node>, axes: &Axes) -> Remedy {
    let columns: Option<Vec<&str>> = channel
        .and_then(|c| c.get("columns"))
        .and_then(|c| match c.value() {
            fusion::config::Value::Array(items) => items.iter().map(Node::as_str).collect(),
            _ => None,
        })
        .filter(|c: &Vec<&str>| c.len() == 3);
    let rotation = channel.and_then(|c| c.get("rotation"));
    let before = rotation.map_or(Some(DECLARED), axes_of);
    let is_turned = handedness(axes) > 0.0;
    match (columns, before) {
        (_, Some(before)) if is_turned && rotation.is_some() => {
            let after = axes.map(|(axis, negative)| (before[axis].0, before[axis].1 != negative));
            Remedy::write(&[("rotation", format!("{{ axes = [{}] }}", list(&after)))])
        }
        (Some(columns), Some(before)) => Remedy::write(&[("columns", format!("[{}]", exchanged(&columns, &before, axes).join(", ")))]),
        (None, Some(_)) if is_turned => Remedy::write(&[("rotation", format!("{{ axes = [{}] }}", list(axes)))]),
        (_, None) if is_turned => Remedy::words(format!("after the `rotation` there, turn the axes by `{}`", list(axes))),
        _ => Remedy::words(format!(
            "the axes are left-handed: change the sign of a column; the body axes are {}",
            list(axes)
        )),
    }
}

/// The columns to write so that the rotation `before` turns them into `axes` of the declared ones.
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

/// The axes of a declared rotation.
fn axes_of(rotation: &Node) -> Option<Axes> {
    let mut found = DECLARED;
    let fusion::config::Value::Array(items) = rotation.get("axes")?.value() else {
        return None;
    };
    for (to, item) in found.iter_mut().zip(items) {
        let text = item.as_str()?;
        let (negative, letter) = text.strip_prefix('-').map_or((false, text), |letter| (true, letter));
        *to = (NAMES.iter().position(|n| *n == letter)?, negative);
    }
    Some(found)
}

/// A mistake in a channel of a source, found by `rule`.
pub(super) fn at(rule: &'static str, source: &Node, channel: &str, key: &str, message: String) -> Diagnostic {
    let path = format!("channels.{channel}");
    let place = match source.at(&path).and_then(|c| c.get(key)) {
        Some(node) => node.place(),
        None => source.place_of(&path),
    };
    Diagnostic::warning(message).at(place).rule(rule)
}

/// The units of the columns of a channel, as they are written.
fn units(channel: &str, is_increment: bool) -> &'static [&'static str] {
    match (channel, is_increment) {
        ("angular_rate", true) => &["rad", "deg"],
        ("angular_rate", false) => &["rad/s", "deg/s"],
        ("specific_force", true) => &["m/s"],
        ("specific_force", false) => &["m/s^2", "g", "mg"],
        ("velocity", _) => &["m/s", "km/h", "kn", "mph", "ft/s", "cm/s", "mm/s"],
        _ => &[],
    }
}

/// Returns true if a factor is the ratio of two velocity units within 5 %, one of which is m/s.
pub(super) fn is_of_velocities(factor: f64) -> bool {
    let sizes = units("velocity", false).iter().filter_map(|unit| parse_unit(unit).ok());
    sizes
        .map(|(size, _)| size)
        .any(|size| (math::ln(factor).abs() - math::ln(size).abs()).abs() < 0.05)
}

/// The advice for numbers that fit no unit.
pub(super) fn check_unit() -> Remedy {
    Remedy::words("check `unit` and `scale`")
}

/// The `time.offset` that a source declares \[s\].
pub(super) fn declared_offset(source: &Node) -> f64 {
    let declared: Option<Duration> = source.at("time.offset").and_then(|n| n.read(&mut Diagnostics::new()));
    declared.map_or(0.0, Duration::si)
}

/// The stamps of a source are wrong: with `by` seconds more they are right. `or` is more advice.
pub(super) fn shifted(source: &Named<SourceDesign>, by: f64, message: String, or: &str) -> Diagnostic {
    let offset = declared_offset(&source.node) + by;
    let edit = Edit::set(format!("source.{}.time.offset", source.name), format!("\"{offset:.2} s\""));
    let place = source
        .node
        .at("time.offset")
        .map_or_else(|| source.node.place_of("time"), Node::place);
    let help = format!("{edit}{or}");
    Diagnostic::warning(message).at(place).rule("clock").help(help).edits(vec![edit])
}

/// The possible cause of a wrong factor, and its correction. `small` is the factor by which the numbers are too small.
/// `within` is the uncertainty of its logarithm. `rate` is the number of samples per second.
pub(super) fn unit(node: Option<&Node>, channel: &str, small: f64, within: f64, rate: f64) -> Option<Remedy> {
    let is = |factor: f64| math::ln(small / factor).abs() < within;
    let is_increment = node.and_then(|n| n.get("increment")).is_some_and(|n| n.inline() == "true");
    let all = units(channel, is_increment);
    let declared = node.and_then(|n| n.get("unit")).and_then(Node::as_str).or(all.first().copied())?;
    let size = |unit: &str| parse_unit(unit).ok().map(|(size, _)| size);
    let scale: f64 = node.and_then(|n| n.get("scale")).map_or(Some(1.0), |n| n.inline().parse().ok())?;
    if scale != 1.0 && is(1.0 / scale) {
        return Some(Remedy::leave_out("scale").after("it would fit without the `scale`"));
    }
    let declared_size = size(declared)?;
    let away = |unit: &str| Some(math::ln(size(unit)? / (declared_size * scale * small)).abs());
    let nearest = all.iter().filter_map(|unit| Some((away(unit)?, *unit)));
    let nearest = nearest
        .filter(|(away, unit)| *away < within && *unit != declared)
        .min_by(|a, b| a.0.total_cmp(&b.0));
    // A rate of 50 rows per second is close to 57.3, the degrees per radian.
    let is_nearer = |factor: f64| is(factor) && nearest.is_none_or(|(away, _)| math::ln(small / factor).abs() < away);
    if matches!(channel, "angular_rate" | "specific_force") && !is_increment && is_nearer(rate) {
        let increment = Remedy::write(&[("increment", "true".to_owned())]);
        return Some(increment.after("the columns hold increments over a sample"));
    }
    if is_increment && is_nearer(1.0 / rate) {
        return Some(Remedy::leave_out("increment").after("the columns hold rates, no increments"));
    }
    let (_, unit) = nearest?;
    Some(fitting(declared, unit))
}

/// The numbers of a channel fit another unit than declared.
pub(super) fn fitting(declared: &str, unit: &str) -> Remedy {
    let written = Remedy::write(&[("unit", format!("{unit:?}"))]);
    written.after(&format!("`{declared}` is declared, the numbers fit `{unit}`"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::config::Document;

    #[test]
    fn of_a_missing_axis_no_sign_is_invented() {
        let exchanged = [Some((1, false)), Some((0, false)), None];
        let of = |sign: Option<bool>| complete(exchanged, |_, _| sign);
        let axes = |down: bool| [(1, false), (0, false), (2, down)];
        let whole = |down, open| Some(Whole { axes: axes(down), open });
        assert_eq!(of(None), whole(false, Some(2)));
        assert_eq!(of(Some(true)), whole(true, None));
        assert_eq!(of(Some(false)), whole(false, None));
        // A unit that is mounted differently gets the sign that makes a rotation.
        assert_eq!(of(None).map(Whole::turned), whole(true, Some(2)));
        assert_eq!(of(Some(false)).map(Whole::turned), whole(false, None), "what is decided stays");
        assert_eq!(complete([Some((1, false)), None, None], |_, _| None), None, "two are missing");
        assert_eq!(
            complete([Some((0, false)), Some((0, true)), None], |_, _| None),
            None,
            "one is there twice"
        );
    }

    #[test]
    fn a_factor_is_told_as_the_unit_that_fits() {
        let told = |channel: &str, table: &str, small: f64| {
            let (document, found) = Document::parse("design.toml", &format!("channel = {table}\n"));
            assert_eq!(found, []);
            unit(document.root().get("channel"), channel, small, 0.05, 100.0)
        };
        for (channel, table, small, write) in [
            ("velocity", r#"{ unit = "m/s" }"#, 1852.0 / 3600.0, "write `unit = \"kn\"`"),
            ("velocity", "{}", 1.0 / 3.6, "write `unit = \"km/h\"`"),
            ("velocity", r#"{ unit = "kn" }"#, 3600.0 / 1852.0, "write `unit = \"m/s\"`"),
            ("velocity", r#"{ unit = "m/s" }"#, 0.3048, "write `unit = \"ft/s\"`"),
            ("velocity", r#"{ unit = "m/s", scale = 1.9 }"#, 1.0 / 1.9, "leave out `scale`"),
            ("angular_rate", r#"{ unit = "rad/s" }"#, 0.01745, "write `unit = \"deg/s\"`"),
            ("specific_force", r#"{ unit = "g" }"#, 0.102, "write `unit = \"m/s^2\"`"),
            ("specific_force", r#"{ unit = "m/s" }"#, 100.0, "write `increment = true`"),
            (
                "angular_rate",
                r#"{ unit = "rad", increment = true }"#,
                0.01,
                "leave out `increment`",
            ),
        ] {
            let told = told(channel, table, small).unwrap();
            assert!(told.words.contains(write), "{channel} {table} {small}: {told:?}");
            assert_eq!(told.edits.len(), 1, "{told:?}");
        }
        assert_eq!(told("velocity", r#"{ unit = "m/s" }"#, 1.43), None, "no unit is that large");
    }
}
