//! Compares declared units with the units that the names of the columns state.

use crate::inspect::stated_unit;
use fusion::config::{Diagnostic, Diagnostics, Node, Value};
use fusion::design::Design;
use fusion_models::units::{by_letter, parse_unit};

/// Warns if the `unit` of a channel, or of the stamps, differs from the unit in the name of its column: `columns =
/// ["gyro_x [deg/s]"]` with `unit = "rad/s"`.
#[must_use]
pub fn units(design: &Design) -> Diagnostics {
    let mut d = Diagnostics::new();
    for named in &design.sources {
        let channels = named.node.get("channels").map_or(&[][..], Node::entries);
        let tables = channels.iter().map(|e| &e.node).chain(named.node.get("time"));
        d.extend(tables.filter_map(contradiction));
    }
    d
}

/// The first column of a table whose name states another unit than the table declares.
fn contradiction(table: &Node) -> Option<Diagnostic> {
    let unit = table.get("unit")?;
    let declared = unit.as_str()?;
    // An offset is a quantity, not a column. A height and a course have separate units.
    let is_other = |key: &str| matches!(key, "height" | "height_unit" | "course" | "unit" | "offset");
    let fields = table.entries().iter().filter(|e| !is_other(&e.key));
    let columns = fields.flat_map(|e| match e.node.value() {
        Value::Array(nodes) => nodes.iter().filter_map(Node::as_str).collect(),
        _ => e.node.as_str().into_iter().collect::<Vec<_>>(),
    });
    let dimension = parse_unit(declared).ok().map(|(_, dimension)| dimension);
    let meant = |stated: &str| {
        dimension
            .and_then(|dimension| by_letter(stated, dimension))
            .unwrap_or_else(|| stated.to_owned())
    };
    let (column, stated) = columns
        .filter_map(|c| Some((c, meant(stated_unit(c)?))))
        .find(|(c, s)| differs(c, s, declared))?;
    let message = format!("the column `{column}` is named as in `{stated}`, but the `unit` that is declared is `{declared}`");
    let help = format!("write `unit = {stated:?}` if the name is right; if it is not, leave it: this is only a warning");
    Some(Diagnostic::warning(message).at(unit.place()).rule("named-unit").help(help))
}

/// Returns true if two units differ. The last letters of a name may not be a unit, for example `mag_g`. So without
/// brackets only a unit of the same dimension counts.
fn differs(column: &str, stated: &str, declared: &str) -> bool {
    let (Ok((stated, of_name)), Ok((declared, dimension))) = (parse_unit(stated), parse_unit(declared)) else {
        return false;
    };
    let is_bracketed = column.trim_end().ends_with([']', ')']);
    // 1e-9: factors such as π/180 are rounded.
    let is_other_size = (stated / declared - 1.0).abs() > 1e-9;
    if of_name == dimension { is_other_size } else { is_bracketed }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::config::Document;

    fn warned(channel: &str) -> Option<String> {
        let (document, found) = Document::parse("design.toml", &format!("channel = {channel}\n"));
        assert_eq!(found, []);
        contradiction(document.root().get("channel")?).map(|d| d.message)
    }

    #[test]
    fn a_unit_that_the_name_of_a_column_contradicts_is_told() {
        for (channel, column) in [
            (r#"{ columns = ["gx [deg/s]", "gy [deg/s]"], unit = "rad/s" }"#, "gx [deg/s]"),
            (r#"{ columns = ["gx_rads", "gy_dps"], unit = "rad/s" }"#, "gy_dps"),
            (r#"{ column = "-acc (g)", unit = "m/s^2" }"#, "-acc (g)"),
            (r#"{ column = "B [uT]", unit = "m" }"#, "B [uT]"),
            (
                r#"{ latitude = "lat_deg", longitude = "lon_deg", height = "h_m", unit = "rad" }"#,
                "lat_deg",
            ),
            (r#"{ column = "t_ms", unit = "s" }"#, "t_ms"),
            (r#"{ column = "mag (mG)", unit = "gauss" }"#, "mag (mG)"),
        ] {
            let told = warned(channel).unwrap_or_default();
            assert!(told.contains(&format!("`{column}`")), "{channel}: {told}");
        }
    }

    #[test]
    fn units_that_agree_or_that_a_name_may_not_mean_are_not_told() {
        for channel in [
            r#"{ columns = ["gx [deg/s]", "gy_dps"], unit = "deg/s" }"#,
            r#"{ column = "speed [m/s]" }"#,
            r#"{ speed = "SOG", course = "COG [deg]", unit = "kn" }"#,
            r#"{ column = "speed_kmh", unit = "km/h" }"#,
            r#"{ rpy = ["roll", "pitch", "yaw"], unit = "rad", offset = [0, 0, "90 deg"] }"#,
            // Gauss, written with the letter that means grams-force elsewhere.
            r#"{ column = "mag_g", unit = "gauss" }"#,
            r#"{ column = "Magnetometer X (G)", unit = "gauss" }"#,
            r#"{ column = "Accelerometer X (G)", unit = "g" }"#,
            r#"{ latitude = "lat", longitude = "lon", height = "h_m", unit = "deg" }"#,
        ] {
            assert_eq!(warned(channel), None, "{channel}");
        }
    }
}
