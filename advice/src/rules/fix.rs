//! Writes edits into the text of a design. Comments, order and spaces stay as they are.

use fusion::config::{Diagnostic, Edit};
use toml_edit::{DocumentMut, InlineTable, Item, Table, TableLike, Value};

/// A design with edits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fixed {
    /// The text of the file.
    pub text: String,
    /// The edits that are in it.
    pub made: Vec<Edit>,
    /// The other edits, each with its reason.
    pub left: Vec<(Edit, String)>,
}

/// Writes `edits` into `text`, the most important edit first: of two edits of one key, the first is made.
///
/// If a selected variant declares the key, its value is written in the table of the variant, which replaces the value
/// of the design. The value of a key in an included part is written into this file, and replaces the value of the part.
///
/// # Errors
/// The text is not TOML.
pub fn fix(text: &str, variants: &[&str], edits: &[Edit]) -> Result<Fixed, Diagnostic> {
    let parsed = text.parse::<DocumentMut>();
    let mut document = parsed.map_err(|error| Diagnostic::error(format!("the design cannot be edited: {error}")))?;
    let mut fixed = Fixed::default();
    for edit in edits {
        if fixed.made.contains(edit) {
            continue;
        }
        let before = fixed
            .made
            .iter()
            .find(|made| is_inside(&made.key, &edit.key) || is_inside(&edit.key, &made.key));
        let written = match before {
            Some(made) => Err(format!("`{}` is changed already", made.key)),
            None => write(document.as_table_mut(), variants, edit),
        };
        match written {
            Ok(()) => fixed.made.push(edit.clone()),
            Err(reason) => fixed.left.push((edit.clone(), reason)),
        }
    }
    fixed.text = document.to_string();
    Ok(fixed)
}

/// Whether the first path is the second one or a part of it.
fn is_inside(path: &str, table: &str) -> bool {
    path.strip_prefix(table)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn write(root: &mut Table, variants: &[&str], edit: &Edit) -> Result<(), String> {
    let in_variant = variants.iter().rev().map(|name| format!("variant.{name}.{}", edit.key));
    let path = in_variant
        .into_iter()
        .find(|path| has(root, path))
        .unwrap_or_else(|| edit.key.clone());
    let keys: Vec<&str> = path.split('.').collect();
    match &edit.value {
        Some(value) => {
            let value = value.parse::<Value>().unwrap_or_else(|_| Value::from(value.as_str()));
            set(root, false, &keys, value)
        }
        None if has(root, &path) => remove(root, &keys),
        None => Err("it is not in this file, but in a part that the file includes".to_owned()),
    }
}

fn has(root: &Table, path: &str) -> bool {
    let mut keys = path.split('.');
    let first = keys.next().and_then(|key| root.get(key));
    keys.try_fold(first, |item, key| item.map(|item| child(item, key)))
        .flatten()
        .is_some()
}

fn child<'a>(item: &'a Item, key: &str) -> Option<&'a Item> {
    match key.parse::<usize>() {
        Ok(index) => item.get(index),
        Err(_) => item.get(key),
    }
}

/// Sets a value below a table, which is written inline or not. Tables that are missing on the path get the form of
/// the table around them.
pub(crate) fn set(table: &mut dyn TableLike, is_inline: bool, keys: &[&str], value: Value) -> Result<(), String> {
    let [key, rest @ ..] = keys else { return Ok(()) };
    if rest.is_empty() {
        match table.get_mut(key) {
            Some(Item::Value(old)) => {
                let decor = old.decor().clone();
                *old = value;
                *old.decor_mut() = decor;
            }
            _ => {
                table.insert(key, Item::Value(value));
                if is_inline {
                    // The space before the closing bracket belonged to the last entry.
                    table.fmt();
                }
            }
        }
        return Ok(());
    }
    if !table.contains_key(key) {
        let inner = if is_inline {
            Item::Value(Value::InlineTable(InlineTable::new()))
        } else {
            let mut inner = Table::new();
            inner.set_implicit(true);
            Item::Table(inner)
        };
        table.insert(key, inner);
    }
    let inner = table.get_mut(key).ok_or_else(|| format!("there is no `{key}`"))?;
    set_below(inner, key, rest, value)
}

fn set_below(item: &mut Item, name: &str, keys: &[&str], value: Value) -> Result<(), String> {
    let [key, rest @ ..] = keys else { return Ok(()) };
    let is_inline = item.is_inline_table();
    if let Some(table) = item.as_table_like_mut() {
        return set(table, is_inline, keys, value);
    }
    let index = key.parse::<usize>().ok();
    let element = index
        .filter(|_| item.is_array_of_tables() || item.is_array())
        .and_then(|index| item.get_mut(index));
    match (element, rest) {
        (Some(Item::Value(old)), []) => {
            let decor = old.decor().clone();
            *old = value;
            *old.decor_mut() = decor;
            Ok(())
        }
        (Some(element), [_, ..]) => set_below(element, key, rest, value),
        _ => Err(format!("`{name}` has no `{key}`")),
    }
}

fn remove(root: &mut Table, keys: &[&str]) -> Result<(), String> {
    let Some(([first, path @ ..], last)) = keys.split_last().map(|(last, path)| (path, *last)) else {
        return root
            .remove(keys.first().copied().unwrap_or_default())
            .map_or(Err("it is not there".to_owned()), |_| Ok(()));
    };
    let mut item = root.get_mut(first);
    for key in path {
        item = item.and_then(|item| match key.parse::<usize>() {
            Ok(index) => item.get_mut(index),
            Err(_) => item.get_mut(key),
        });
    }
    let removed = match item {
        Some(Item::Value(Value::InlineTable(table))) => {
            let removed = table.remove(last).map(Item::Value);
            // The space before the closing bracket belonged to the last entry.
            table.fmt();
            removed
        }
        other => other.and_then(Item::as_table_like_mut).and_then(|table| table.remove(last)),
    };
    removed.map_or_else(|| Err("it is not there".to_owned()), |_| Ok(()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DESIGN: &str = "\
# A car.
[source.imu] # the unit
file = 'imu.csv'
channels.angular_rate = { columns = [\"x\", \"y\"], scale = 2 } # rates
[sensor.gnss]
noise = '2 m' # by its data sheet

[variant.wide]
sensor.gnss.noise = '5 m'
";

    fn fixed(variants: &[&str], edits: &[Edit]) -> Fixed {
        fix(DESIGN, variants, edits).unwrap()
    }

    #[test]
    fn comments_and_order_stay() {
        let edits = [
            Edit::set("source.imu.channels.angular_rate.columns", "[\"y\", \"-x\"]"),
            Edit::leave_out("source.imu.channels.angular_rate.scale"),
            Edit::set("sensor.gnss.noise", "\"3 m\""),
            Edit::set("sensor.gnss.gate.probability", "0.99"),
            Edit::set("filter.bank.headings", "8"),
            Edit::set("source.imu.channels.angular_rate.increment", "true"),
        ];
        let found = fixed(&[], &edits);
        let expected = "\
# A car.
[source.imu] # the unit
file = 'imu.csv'
channels.angular_rate = { columns = [\"y\", \"-x\"], increment = true } # rates
[sensor.gnss]
noise = \"3 m\" # by its data sheet

[sensor.gnss.gate]
probability = 0.99

[variant.wide]
sensor.gnss.noise = '5 m'

[filter.bank]
headings = 8
";
        assert_eq!(found.text, expected);
        assert_eq!((found.made.as_slice(), found.left.as_slice()), (&edits[..], &[][..]));
    }

    #[test]
    fn a_key_of_a_selected_variant_is_written_there() {
        let edit = [Edit::set("sensor.gnss.noise", "\"3 m\"")];
        let of = |variants: &[&str]| fixed(variants, &edit).text;
        assert!(
            of(&["wide"]).ends_with("[variant.wide]\nsensor.gnss.noise = \"3 m\"\n"),
            "{}",
            of(&["wide"])
        );
        assert!(of(&[]).contains("\nnoise = \"3 m\" #") && of(&[]).ends_with("'5 m'\n"));
    }

    #[test]
    fn what_cannot_be_written_is_left_with_its_reason() {
        let edits = [
            Edit::set("sensor.gnss.noise", "\"3 m\""),
            Edit::set("sensor.gnss.noise", "\"4 m\""),
            Edit::set("sensor.gnss.noise.sigma", "\"4 m\""),
            Edit::set("source.imu.file.name", "1"),
            Edit::leave_out("source.imu.rate"),
        ];
        let found = fixed(&[], &edits);
        assert_eq!(found.made, edits[..1]);
        let reasons: Vec<&str> = found.left.iter().map(|(_, reason)| reason.as_str()).collect();
        assert_eq!(
            reasons,
            [
                "`sensor.gnss.noise` is changed already",
                "`sensor.gnss.noise` is changed already",
                "`file` has no `name`",
                "it is not in this file, but in a part that the file includes"
            ]
        );
    }
}
