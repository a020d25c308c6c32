//! The parameters: numbers of a design, each multiplied by a factor.

use crate::likelihood::is_real;
use fusion::config::{Diagnostic, Document, Edit, Node, Value};
use fusion::design::Design;
use fusion_core::math;
use fusion_models::units;

/// Whether a key names a noise that may be tuned: `noise`, `gyro_noise` and the like among them.
fn is_noise(key: &str) -> bool {
    key.ends_with("noise") || ["random_walk", "walk", "correlation_time", "vibration"].contains(&key)
}

/// A parameter: numbers of the design that have one common factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its path in the design.
    pub path: String,
    /// The value as declared, in TOML.
    pub declared: String,
    /// The path of the numbers: that of the value, or that of a part of a table.
    key: String,
}

impl Parameter {
    /// The parameter at a path; `None` if the value has no number.
    fn at(path: &str, node: &Node) -> Option<Self> {
        let (key, declared) = match node.value() {
            Value::Table { .. } => {
                let part = if node.get("from_source").is_some_and(|n| n.inline() == "true") {
                    "scale"
                } else {
                    "sigma"
                };
                let declared = node.get(part).map(Node::inline);
                (
                    format!("{path}.{part}"),
                    declared.or_else(|| (part == "scale").then(|| "1.0".to_owned()))?,
                )
            }
            _ => (path.to_owned(), node.inline()),
        };
        (scaled(&declared, 1.0, None) != scaled(&declared, 2.0, None)).then(|| Self {
            path: path.to_owned(),
            declared,
            key,
        })
    }

    /// The edit that gives it `factor` times its declared value, with all digits or with `digits` significant ones.
    #[must_use]
    pub fn times(&self, factor: f64, digits: Option<usize>) -> Edit {
        Edit::set(&self.key, scaled(&self.declared, factor, digits))
    }

    /// The logarithm of its value in another design over the declared value; `None` if that design does not declare it.
    pub(super) fn over_declared(&self, declared: &Document, other: &Document) -> Option<f64> {
        let size = |document: &Document| document.root().at(&self.key).map_or(Some(1.0), size);
        let ratio = size(other)? / size(declared)?;
        (ratio > 0.0 && ratio.is_finite()).then(|| math::ln(ratio))
    }

    /// The declared parameters of a design that a pattern selects. A `*` matches any text inside a key. The first
    /// key `process` may be left out.
    ///
    /// # Errors
    /// A pattern that selects nothing.
    pub fn select(document: &Document, patterns: &[String]) -> Result<Vec<Self>, Diagnostic> {
        let all = all(document);
        let mut found: Vec<Self> = Vec::new();
        for pattern in patterns {
            let matches = |path: &str| is_like(pattern, path) || is_like(&format!("process.{pattern}"), path);
            let own: Vec<&Self> = all.iter().filter(|p| matches(&p.path)).collect();
            if own.is_empty() {
                let known: Vec<&str> = all.iter().map(|p| p.path.as_str()).collect();
                return Err(Diagnostic::error(format!("`{pattern}` selects no declared noise")).suggest(pattern, &known, "there are"));
            }
            let new = own.into_iter().filter(|p| found.iter().all(|known| known.path != p.path));
            let new: Vec<Self> = new.cloned().collect();
            found.extend(new);
        }
        Ok(found)
    }

    /// The noises of the input, and those of sensors that measure. A constraint agrees with itself, so its noise
    /// cannot be judged by its innovations.
    #[must_use]
    pub fn of_instruments(design: &Design) -> Vec<Self> {
        let measures = |path: &str| {
            let name = path.strip_prefix("sensor.").and_then(|rest| rest.split('.').next());
            name.is_none_or(|name| design.sensors.iter().any(|s| s.name == name && is_real(design, s)))
        };
        let all = all(&design.document).into_iter();
        all.filter(|p| p.path.ends_with("noise") && measures(&p.path)).collect()
    }
}

/// The first quantity of a value that is not zero, in SI.
fn size(node: &Node) -> Option<f64> {
    let found = match node.value() {
        Value::String(text) => units::parse(text).ok()?.0,
        Value::Integer(value) => *value as f64,
        Value::Float(value) => *value,
        Value::Array(elements) => return elements.iter().find_map(size),
        _ => return None,
    };
    (found != 0.0).then_some(found)
}

/// All noises that a design declares for its process and its sensors.
fn all(document: &Document) -> Vec<Parameter> {
    let mut found = Vec::new();
    for table in ["process", "sensor"] {
        if let Some(node) = document.root().get(table) {
            collect(table, node, &mut found);
        }
    }
    found
}

fn collect(path: &str, node: &Node, found: &mut Vec<Parameter>) {
    if !matches!(node.value(), Value::Table { .. }) {
        return;
    }
    let is_off = node.get("enabled").is_some_and(|n| n.inline() == "false");
    for entry in node.entries().iter().filter(|_| !is_off) {
        let path = format!("{path}.{}", entry.key);
        if is_noise(&entry.key) {
            found.extend(Parameter::at(&path, &entry.node));
        } else {
            collect(&path, &entry.node, found);
        }
    }
}

/// Whether a path is like a pattern, key by key.
fn is_like(pattern: &str, path: &str) -> bool {
    let (pattern, path): (Vec<&str>, Vec<&str>) = (pattern.split('.').collect(), path.split('.').collect());
    let is_key = |(pattern, key): (&&str, &&str)| match pattern.split_once('*') {
        None => pattern == key,
        Some((head, tail)) => key.len() >= head.len() + tail.len() && key.starts_with(head) && key.ends_with(tail),
    };
    pattern.len() == path.len() && pattern.iter().zip(&path).all(is_key)
}

/// A value as TOML with each of its numbers multiplied. A number inside a unit is not one of them: a number begins the
/// value, a text or an element.
fn scaled(value: &str, factor: f64, digits: Option<usize>) -> String {
    let mut out = String::new();
    let mut rest = value;
    let mut may_begin = true;
    while let Some(first) = rest.chars().next() {
        let length = if may_begin { number(rest) } else { 0 };
        if length > 0 {
            let before: f64 = rest[..length].replace('_', "").parse().unwrap_or(f64::NAN);
            out += &written(before * factor, digits);
            rest = &rest[length..];
            may_begin = false;
        } else {
            may_begin = matches!(first, '"' | '\'' | '[' | ',') || may_begin && first == ' ';
            out.push(first);
            rest = &rest[first.len_utf8()..];
        }
    }
    out
}

/// The length of the number at the beginning of a text.
fn number(text: &str) -> usize {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E' | '_');
    let longest = text.find(|c| !is_part(c)).unwrap_or(text.len());
    // The letter e may begin a unit.
    let is_number = |length: &usize| text[..*length].replace('_', "").parse::<f64>().is_ok();
    (1..=longest).rev().find(is_number).unwrap_or(0)
}

/// A number as TOML writes it: never a whole number, which has another type.
pub(super) fn written(value: f64, digits: Option<usize>) -> String {
    match digits {
        None => format!("{value:e}"),
        Some(digits) => {
            let rounded: f64 = format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value);
            let size = rounded.abs();
            if size != 0.0 && !(1e-3..1e6).contains(&size) {
                format!("{rounded:e}")
            } else {
                format!("{rounded:?}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_of_a_value_has_the_factor_and_no_number_of_a_unit() {
        for (value, expected) in [
            ("\"2 m\"", "\"5.0 m\""),
            ("2", "5.0"),
            ("\"1e-3 rad/s/sqrt(Hz)\"", "\"0.0025 rad/s/sqrt(Hz)\""),
            ("[\"1 m/s^2\", \"0.5 m/s^2\", 4.0]", "[\"2.5 m/s^2\", \"1.25 m/s^2\", 10.0]"),
            ("\"4e-6 m\"", "\"1e-5 m\""),
            ("true", "true"),
        ] {
            assert_eq!(scaled(value, 2.5, Some(4)), expected);
        }
        let exact = scaled("\"1 m\"", 1.0 / 3.0, None);
        assert_eq!(
            exact.trim_matches('"').split(' ').next().unwrap().parse::<f64>().unwrap(),
            1.0 / 3.0
        );
    }

    const DESIGN: &str = "
[process]
gyro.noise = '1e-3 rad/s/sqrt(Hz)'
gyro.bias = { estimate = true, random_walk = '1e-5 rad/s/sqrt(s)', sigma = '1 deg/s' }
accelerometer.noise = '1 mg/sqrt(Hz)'
[sensor.gnss]
noise = { sigma = ['1 m', '2 m'] }
[sensor.wheel]
noise = { from_source = true, sigma = '9 m/s' }
[sensor.off]
enabled = false
noise = '1 m'
";

    fn selected(patterns: &[&str]) -> Result<Vec<String>, Diagnostic> {
        let (document, found) = Document::parse("x.toml", DESIGN);
        assert_eq!(found, []);
        let patterns: Vec<String> = patterns.iter().map(|p| (*p).to_owned()).collect();
        let all = Parameter::select(&document, &patterns)?;
        Ok(all.iter().map(|p| p.times(2.0, Some(3)).to_string()).collect())
    }

    #[test]
    fn patterns_select_declared_noises_in_their_own_form() {
        let found = selected(&["gyro.noise", "sensor.*.noise", "process.gyro.noise"]).unwrap();
        assert_eq!(
            found,
            [
                "write `process.gyro.noise = \"0.002 rad/s/sqrt(Hz)\"`",
                "write `sensor.gnss.noise.sigma = [\"2.0 m\", \"4.0 m\"]`",
                "write `sensor.wheel.noise.scale = 2.0`"
            ]
        );
        let walk = selected(&["gyro.bias.*"]).unwrap();
        assert_eq!(walk, ["write `process.gyro.bias.random_walk = \"2e-5 rad/s/sqrt(s)\"`"]);
        let error = selected(&["sensor.gns.noise"]).unwrap_err();
        assert!(error.message.contains("`sensor.gns.noise` selects no declared noise"), "{error:?}");
    }
}
