//! Other declarations of a channel: the common mistakes, each as the keys to write.
//!
//! A search reads the channel again with each of them, and tests whether it then agrees with the other channels. So the
//! advice has been tested.

use super::judge::Judge;
use super::log::{self, Track};
use super::mistake::Remedy;
use fusion::config::{Edit, Node, Value};
use fusion::design::Design;

/// Keys of a channel with other values.
#[derive(Clone, Debug)]
pub(super) struct Declaration {
    /// The mistake in words.
    pub(super) wrong: String,
    /// The keys and their right values.
    pub(super) writes: Vec<(&'static str, String)>,
}

impl Declaration {
    fn of(wrong: &str, writes: &[(&'static str, String)]) -> Self {
        Self {
            wrong: wrong.to_owned(),
            writes: writes.to_vec(),
        }
    }

    /// The keys and values, as they are written.
    pub(super) fn listed(&self) -> String {
        let each = self.writes.iter().map(|(key, value)| format!("{key} = {value}"));
        each.collect::<Vec<_>>().join(", ")
    }

    pub(super) fn remedy(&self) -> Remedy {
        Remedy::write(&self.writes)
    }

    /// Returns true if only the unit is another one.
    pub(super) fn is_unit(&self) -> bool {
        matches!(self.writes[..], [("unit", _)])
    }
}

/// Other declarations of the table of a channel.
pub(super) fn others(channel: &str, table: &Node) -> Vec<Declaration> {
    match channel {
        "attitude" => [attitude(table), unit(table, &["rpy"])].concat(),
        "heading" => [signs(table), unit(table, &["column"])].concat(),
        "body_velocity" => ahead_and_right(table),
        "position" if table.get("north").is_some() => local(table),
        "position" => [signs(table), exchanged(table).into_iter().collect(), unit(table, &["latitude"])].concat(),
        _ => signs(table),
    }
}

fn word<'a>(table: &'a Node, key: &str) -> Option<&'a str> {
    table.get(key).and_then(Node::as_str)
}

/// The names of columns.
fn columns<'a>(table: &'a Node, key: &str) -> Option<Vec<&'a str>> {
    match table.get(key)?.value() {
        Value::Array(items) => items.iter().map(Node::as_str).collect(),
        _ => None,
    }
}

/// A column with the other sign.
fn minus(column: &str) -> String {
    column.strip_prefix('-').map_or_else(|| format!("-{column}"), str::to_owned)
}

/// One column with the other sign.
fn signs(table: &Node) -> Vec<Declaration> {
    let of = |key: &'static str| {
        let other = format!("{:?}", minus(word(table, key)?));
        let wrong = if key == "column" { String::new() } else { format!(" of the {key}") };
        Some(Declaration::of(&format!("a wrong sign{wrong}"), &[(key, other)]))
    };
    ["column", "latitude", "longitude", "height"].into_iter().filter_map(of).collect()
}

/// Latitude and longitude exchanged.
fn exchanged(table: &Node) -> Option<Declaration> {
    let (latitude, longitude) = (word(table, "latitude")?, word(table, "longitude")?);
    let writes = [("latitude", format!("{longitude:?}")), ("longitude", format!("{latitude:?}"))];
    Some(Declaration::of("exchanged columns", &writes))
}

/// Positions north, east, down with other signs, and with north and east exchanged.
fn local(table: &Node) -> Vec<Declaration> {
    let keys = ["north", "east", if table.get("up").is_some() { "up" } else { "down" }];
    let columns: Option<Vec<&str>> = keys.iter().map(|key| word(table, key)).collect();
    let Some(&[north, east, down]) = columns.as_deref() else {
        return Vec::new();
    };
    let orders = [("a wrong sign", [north, east, down]), ("exchanged columns", [east, north, down])];
    let of = |(wrong, columns): (&str, [&str; 3]), signs: usize| {
        let written = [0, 1, 2].map(|k| {
            if signs >> k & 1 == 1 {
                minus(columns[k])
            } else {
                columns[k].to_owned()
            }
        });
        let differs = keys
            .into_iter()
            .zip(written)
            .filter(|(key, written)| word(table, key) != Some(written));
        let writes: Vec<_> = differs.map(|(key, written)| (key, format!("{written:?}"))).collect();
        Declaration::of(wrong, &writes)
    };
    let all = (0..8).flat_map(|signs| orders.map(|order| of(order, signs)));
    all.filter(|other| !other.writes.is_empty()).collect()
}

/// Angles in the other unit, if one of these keys has them.
fn unit(table: &Node, of: &[&str]) -> Vec<Declaration> {
    let is_of = of.iter().any(|key| table.get(key).is_some());
    let other = if word(table, "unit") == Some("deg") { "rad" } else { "deg" };
    let found = Declaration::of("columns in another unit", &[("unit", format!("{other:?}"))]);
    Some(found).filter(|_| is_of).into_iter().collect()
}

/// Exchanged or mirrored columns of a velocity forward and right: no mounting mirrors them.
fn ahead_and_right(table: &Node) -> Vec<Declaration> {
    let columns = columns(table, "columns").unwrap_or_default();
    let [ahead, right, rest @ ..] = &columns[..] else {
        return Vec::new();
    };
    let of = |(wrong, [a, b]): (&str, [String; 2])| {
        let all: Vec<String> = [a, b].into_iter().chain(rest.iter().map(|&rest| rest.to_owned())).collect();
        Declaration::of(wrong, &[("columns", format!("{all:?}"))])
    };
    let changes = [
        ("exchanged columns", [(*right).to_owned(), (*ahead).to_owned()]),
        ("exchanged columns, both with the other sign", [minus(right), minus(ahead)]),
        ("a wrong sign", [(*ahead).to_owned(), minus(right)]),
        ("a wrong sign", [minus(ahead), (*right).to_owned()]),
    ];
    changes.into_iter().map(of).collect()
}

/// Another order of a quaternion, the inverse rotation, and the axes forward, left, up in a world with the vertical up.
fn attitude(table: &Node) -> Vec<Declaration> {
    let is_inverse = table.get("inverse").is_some_and(|n| n.inline() == "true");
    let inverse = ("inverse", (!is_inverse).to_string());
    let mut all = vec![vec![inverse.clone()]];
    if let Some([a, b, c, d]) = columns(table, "quaternion").as_deref() {
        // Scalar last instead of scalar first, and the reverse.
        let orders = [[d, a, b, c], [b, c, d, a]].map(|order| ("quaternion", format!("{order:?}")));
        all.splice(0..0, orders.iter().map(|order| vec![order.clone()]));
        all.extend(orders.map(|order| vec![order, inverse.clone()]));
    }
    let axes = ["rotation", "navigation_rotation"];
    if axes.iter().all(|key| table.get(key).is_none()) {
        let up = axes.map(|key| (key, "{ axes = [\"x\", \"-y\", \"-z\"] }".to_owned()));
        let turned: Vec<_> = all.iter().map(|writes| [&writes[..], &up[..]].concat()).collect();
        all.extend(turned.into_iter().chain([up.to_vec()]));
    }
    all.iter().map(|writes| Declaration::of("another form", writes)).collect()
}

impl Judge<'_> {
    /// Reads a channel with another declaration, after the corrections so far.
    pub(super) fn read_as(&self, track: &Track, other: &Declaration) -> Option<Track> {
        let (mut document, table) = (self.design.document.clone(), self.table(track));
        let so_far = self.found.mistakes.iter().flat_map(|mistake| mistake.corrections().iter().cloned());
        let writes = other.writes.iter().map(|(key, value)| Edit::set(*key, value).within(&table));
        let mut edits = so_far.filter(|edit| edit.key.starts_with(&table)).chain(writes);
        edits.try_for_each(|edit| document.apply(&edit)).ok()?;
        let design = Design::read(document).ok()?;
        let read = log::read_source(&design, self.options, track.source).ok()?;
        read.into_iter().find(|found| found.channel == track.channel)
    }

    /// The first other declaration of a channel with which it passes a test, and the track that it gives.
    pub(super) fn declared_as(&self, track: &Track, mut is_right: impl FnMut(&Track) -> bool) -> Option<(Declaration, Track)> {
        others(track.channel, self.channel(track)?).into_iter().find_map(|other| {
            let read = self.read_as(track, &other)?;
            is_right(&read).then_some((other, read))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::config::Document;

    fn of(channel: &str, table: &str) -> Vec<String> {
        let (document, found) = Document::parse("design.toml", &format!("channel = {table}\n"));
        assert_eq!(found, []);
        let table = document.root().get("channel");
        others(channel, table.unwrap()).iter().map(Declaration::listed).collect()
    }

    #[test]
    fn the_common_mistakes_of_each_channel_are_tried_once() {
        for (channel, table, count, one) in [
            // Three signs, the exchange, the unit.
            (
                "position",
                r#"{ latitude = "a", longitude = "-b", height = "h", unit = "rad" }"#,
                5,
                r#"longitude = "b""#,
            ),
            // Eight signs of two orders, without the declared one.
            (
                "position",
                r#"{ north = "n", east = "e", up = "u" }"#,
                15,
                r#"north = "e", east = "n", up = "-u""#,
            ),
            // Three orders, with the inverse, with the vertical up, without what is declared.
            (
                "attitude",
                r#"{ quaternion = ["w", "x", "y", "z"] }"#,
                11,
                r#"quaternion = ["x", "y", "z", "w"], inverse = true"#,
            ),
            (
                "attitude",
                r#"{ rpy = ["r", "p", "y"], unit = "deg", rotation = { axes = ["x", "-y", "-z"] } }"#,
                2,
                r#"unit = "rad""#,
            ),
            ("heading", r#"{ column = "-h", unit = "rad" }"#, 2, r#"column = "h""#),
            (
                "body_velocity",
                r#"{ columns = ["x", "y", "z"] }"#,
                4,
                r#"columns = ["-y", "-x", "z"]"#,
            ),
            ("depth", r#"{ column = "d" }"#, 1, r#"column = "-d""#),
        ] {
            let mut all = of(channel, table);
            assert!(all.iter().any(|other| other == one), "{channel}: {all:?}");
            all.sort_unstable();
            all.dedup();
            assert_eq!(all.len(), count, "{channel}: {all:?}");
        }
    }
}
