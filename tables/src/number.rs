//! Number formatting.

/// The text for a missing number.
pub const NONE: &str = "–";

/// Four significant digits.
#[must_use]
pub fn significant(value: f64) -> String {
    if !value.is_finite() {
        NONE.to_owned()
    } else if value == 0.0 {
        "0".to_owned()
    } else {
        let scientific = format!("{value:.3e}");
        // Rounded first, because 9.9999 gets the digits of 10.
        let exponent = scientific.split_once('e').and_then(|(_, e)| e.parse::<i32>().ok());
        match exponent {
            Some(e @ -3..=5) => fixed(value, usize::try_from(3 - e).unwrap_or(0)),
            _ => scientific,
        }
    }
}

/// A fixed number of decimals.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let rounded = format!("{value:.decimals$}");
    // A value that rounds to zero has no sign.
    if rounded.trim_matches(['-', '0', '.']).is_empty() {
        rounded.trim_start_matches('-').to_owned()
    } else {
        rounded
    }
}

/// At most four significant digits, without trailing zeros, for values from a user.
#[must_use]
pub fn short(value: f64) -> String {
    let text = significant(value);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// One number if all are equal, otherwise a list.
#[must_use]
pub fn list(values: &[f64]) -> String {
    match values {
        [] => String::new(),
        [first, rest @ ..] if rest.iter().all(|v| v == first) => short(*first),
        _ => values.iter().map(|v| short(*v)).collect::<Vec<_>>().join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_four_digits() {
        let cases = [
            (0.0, "0"),
            (-0.000_000_1, "-1.000e-7"),
            (12.3456, "12.35"),
            (-0.012_345, "-0.01235"),
            (98765.4, "98765"),
            (1.5e6, "1.500e6"),
            (9.999_99, "10.00"),
            (999_999.9, "1.000e6"),
            (0.001, "0.001000"),
            (f64::NAN, "–"),
            (f64::NEG_INFINITY, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(significant(value), text);
        }
        assert_eq!((fixed(-0.0001, 2).as_str(), short(2.5).as_str()), ("0.00", "2.5"));
        assert_eq!((list(&[2.0; 3]).as_str(), list(&[1.0, 2.5]).as_str()), ("2", "1, 2.5"));
    }
}
