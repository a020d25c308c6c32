//! Units that a header states.

use fusion_models::units::{Dimension, by_letter, parse_unit};
use std::borrow::Cow;

/// The unit in brackets at the end of a column's name, as in `gyro_x [deg/s]` or `height(m)`; `None` without
/// brackets or without a known unit in them. The `wanted` dimension decides if `(G)` is gauss or standard gravity.
pub(super) fn header_unit(column: &str, wanted: Option<Dimension>) -> Option<Cow<'_, str>> {
    let column = column.trim_end();
    let open = match column.chars().next_back()? {
        ']' => '[',
        ')' => '(',
        _ => return None,
    };
    let inner = column.get(column.rfind(open)? + 1..column.len() - 1)?.trim();
    if let Some(meant) = wanted.and_then(|wanted| by_letter(inner, wanted)) {
        return Some(meant.into());
    }
    // `x[2]` is an element of an array.
    let is_element = inner.bytes().all(|byte| byte.is_ascii_digit());
    (!is_element && parse_unit(inner).is_ok()).then_some(inner.into())
}

/// The unit that all of these columns state, if any; `Err` has two columns that do not agree.
pub(super) fn common_unit<'a>(
    columns: impl IntoIterator<Item = &'a String>,
    wanted: Option<Dimension>,
) -> Result<Option<Cow<'a, str>>, (&'a str, &'a str)> {
    let mut columns = columns.into_iter();
    let Some(first) = columns.next() else { return Ok(None) };
    let unit = header_unit(first, wanted);
    match columns.find(|column| header_unit(column, wanted) != unit) {
        Some(other) => Err((first, other)),
        None => Ok(unit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_that_in_brackets_at_the_end() {
        for (column, unit) in [
            ("gyro_x [deg/s]", Some("deg/s")),
            ("-acc_x (m/s^2)", Some("m/s^2")),
            ("latitude(deg)", Some("deg")),
            ("B [ uT ] ", Some("uT")),
            ("f(x) [m]", Some("m")),
            ("alt_m", None),
            ("q_w []", None),
            ("x[2]", None),
            ("gyro[1]", None),
            ("x [raw]", None),
            ("[m] x", None),
            ("x (m]", None),
            ("m]", None),
            ("", None),
            ("é]", None),
        ] {
            assert_eq!(header_unit(column, None).as_deref(), unit, "{column}");
        }
        let field = parse_unit("T").ok().map(|(_, field)| field);
        assert_eq!(header_unit("Magnetometer X (G)", field).as_deref(), Some("gauss"));
        assert_eq!(header_unit("Magnetometer X (uT)", field).as_deref(), Some("uT"));
        assert_eq!(header_unit("Magnetometer X (G)", None), None);
    }
}
