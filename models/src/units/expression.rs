//! From text to a value in SI and its dimension: a recursive-descent parser.
//!
//! ```text
//! quantity = number [unit]
//! unit     = factor { ("*" | "/") factor }        left to right: deg/h/sqrt(Hz)
//! factor   = atom [ "^" exponent ]
//! atom     = symbol | "1" | "(" unit ")" | "sqrt(" unit ")" | "√" atom
//! exponent = number | "(" number [ "/" number ] ")"       whole or half
//! ```

use super::catalogue;
use super::dimension::{Dimension, LARGEST};
use super::error::UnitError;
use fusion_core::math;

/// Deeper parentheses are a mistake or an attack on the stack.
const DEEPEST: usize = 16;

/// A unit being read: its SI factor and dimension.
type Scale = (f64, Dimension);

/// Reads a quantity such as `"0.125 deg/sqrt(h)"`: its value in SI and its dimension.
///
/// # Errors
/// Text that is not a finite number followed by a known unit.
pub fn parse(text: &str) -> Result<(f64, Dimension), UnitError> {
    let body = text.trim();
    let not_finite = || UnitError::Number { text: text.to_owned() };
    let (number, unit) = body.split_at(number_length(body));
    let number: f64 = number.parse().map_err(|_| not_finite())?;
    let (factor, dimension) = match unit.trim_start() {
        "" => (1.0, Dimension::NONE),
        unit => Parser::new(text, unit).whole()?,
    };
    let value = number * factor;
    value.is_finite().then_some((value, dimension)).ok_or_else(not_finite)
}

/// Reads a bare unit such as `"deg/s"`: its factor to SI and its dimension. Instruments that count parts of a unit have
/// a power of ten before it: `"1e-7 deg"`.
///
/// # Errors
/// An unknown symbol or a malformed expression.
pub fn parse_unit(text: &str) -> Result<(f64, Dimension), UnitError> {
    let body = text.trim();
    match body.split_once(' ').filter(|(power, _)| power.starts_with("1e")) {
        Some((power, unit)) if number_length(power) == power.len() => {
            let (factor, dimension) = Parser::new(text, unit.trim_start()).whole()?;
            let size = power.parse::<f64>().map_or(f64::NAN, |power| power * factor);
            let is_sound = size.is_finite() && size > 0.0;
            is_sound
                .then_some((size, dimension))
                .ok_or_else(|| UnitError::Number { text: text.to_owned() })
        }
        _ => Parser::new(text, body).whole(),
    }
}

/// The length in bytes of the decimal number at the start of `text`; 0 without a number.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let sign = |at: usize| usize::from(matches!(bytes.get(at), Some(b'+' | b'-')));
    let mut end = sign(0);
    end += digits(end);
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let exponent = end + 1 + sign(end + 1);
        if digits(exponent) > 0 {
            end = exponent + digits(exponent);
        }
    }
    end
}

struct Parser<'t> {
    /// The whole text, for messages.
    text: &'t str,
    rest: &'t str,
    depth: usize,
}

impl<'t> Parser<'t> {
    fn new(text: &'t str, rest: &'t str) -> Self {
        Self { text, rest, depth: 0 }
    }

    fn fail<T>(&self, problem: &'static str) -> Result<T, UnitError> {
        Err(UnitError::Syntax {
            text: self.text.to_owned(),
            problem,
        })
    }

    /// Takes `token` if it comes next.
    fn take(&mut self, token: &str) -> bool {
        let rest = self.rest.trim_start().strip_prefix(token);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn whole(mut self) -> Result<Scale, UnitError> {
        let (factor, dimension) = self.unit()?;
        match self.rest.trim_start().chars().next() {
            Some('²' | '³' | '⁻' | '¹') => self.fail("write powers as `m^2`"),
            Some(')') => self.fail("a `)` has no `(`"),
            Some(_) => self.fail("write `*` or `/` between units"),
            None if factor.is_finite() && factor > 0.0 => Ok((factor, dimension)),
            None => self.fail("its factor is beyond all range"),
        }
    }

    fn unit(&mut self) -> Result<Scale, UnitError> {
        let (mut factor, mut dimension) = self.factor()?;
        loop {
            let sign = match () {
                () if self.take("*") || self.take("·") => 1,
                () if self.take("/") => -1,
                () => return Ok((factor, dimension)),
            };
            let (next_factor, next) = self.factor()?;
            factor *= math::powi(next_factor, i32::from(sign));
            let product = next.power(2 * sign).and_then(|next| dimension.times(next));
            let Some(product) = product else {
                return self.fail("its powers are too large");
            };
            dimension = product;
        }
    }

    fn factor(&mut self) -> Result<Scale, UnitError> {
        let atom = self.atom()?;
        if !self.take("^") {
            return Ok(atom);
        }
        let halves = self.exponent()?;
        self.raise(atom, halves)
    }

    fn deeper(&mut self) -> Result<(), UnitError> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return self.fail("its parentheses are nested too deeply");
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<Scale, UnitError> {
        // The notation of data sheets: µg/√Hz.
        if self.take("√") {
            self.deeper()?;
            let inner = self.atom()?;
            self.depth -= 1;
            return self.raise(inner, 1);
        }
        let root = self.take("sqrt");
        if self.take("(") {
            self.deeper()?;
            let inner = self.unit()?;
            if !self.take(")") {
                return self.fail("a `)` is missing");
            }
            self.depth -= 1;
            return if root { self.raise(inner, 1) } else { Ok(inner) };
        }
        if root {
            return self.fail("write `sqrt(…)`");
        }
        if self.take("1") {
            return Ok((1.0, Dimension::NONE));
        }
        let rest = self.rest.trim_start();
        let is_symbol = |c: char| c.is_alphabetic() || matches!(c, '%' | '°' | '_');
        let (symbol, rest) = rest.split_at(rest.find(|c| !is_symbol(c)).unwrap_or(rest.len()));
        if symbol.is_empty() {
            return self.fail("a unit is missing");
        }
        self.rest = rest;
        catalogue::find(symbol).ok_or_else(|| UnitError::UnknownUnit {
            text: self.text.to_owned(),
            unit: symbol.to_owned(),
            suggestion: catalogue::suggest(symbol, None),
        })
    }

    /// Twice the exponent, which must be whole.
    fn exponent(&mut self) -> Result<i8, UnitError> {
        let power = if self.take("(") {
            let numerator = self.number()?;
            let denominator = if self.take("/") { self.number()? } else { 1.0 };
            if !self.take(")") {
                return self.fail("a `)` is missing");
            }
            numerator / denominator
        } else {
            self.number()?
        };
        let halves = 2.0 * power;
        if math::fract(halves) == 0.0 && halves.abs() <= f64::from(LARGEST) {
            Ok(halves as i8)
        } else {
            self.fail("a power is a multiple of one half, at most 8")
        }
    }

    fn number(&mut self) -> Result<f64, UnitError> {
        let rest = self.rest.trim_start();
        let (number, rest) = rest.split_at(number_length(rest));
        let Ok(number) = number.parse() else {
            return self.fail("a power is missing after `^`");
        };
        self.rest = rest;
        Ok(number)
    }

    fn raise(&self, (factor, dimension): Scale, halves: i8) -> Result<Scale, UnitError> {
        let Some(dimension) = dimension.power(halves) else {
            return self.fail("its powers are not multiples of one half, or too large");
        };
        let factor = match halves {
            1 => math::sqrt(factor),
            _ if halves % 2 == 0 => math::powi(factor, i32::from(halves) / 2),
            _ => math::powf(factor, f64::from(halves) / 2.0),
        };
        Ok((factor, dimension))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::STANDARD_GRAVITY as G;
    use super::*;

    fn message(text: &str) -> String {
        parse(text).expect_err(text).to_string()
    }

    #[test]
    fn quantities_of_data_sheets_come_out_in_si() {
        let cases = [
            ("0.125 deg/sqrt(h)", 0.125 * PI / 180.0 / 60.0, "rad/sqrt(s)"),
            ("1 mg", 1e-3 * G, "m/s^2"),
            ("5 cm", 0.05, "m"),
            ("70 ug/sqrt(Hz)", 70e-6 * G, "m/s/sqrt(s)"),
            ("70 µg/sqrt(Hz)", 70e-6 * G, "m/s/sqrt(s)"),
            ("70 µg/√Hz", 70e-6 * G, "m/s/sqrt(s)"),
            ("10 nT/√(s)", 1e-8, "kg/s^2/sqrt(s)/A"),
            ("3.8e-5 deg/s^2/sqrt(Hz)", 3.8e-5 * PI / 180.0, "rad/s/sqrt(s)"),
            ("36.098 deg", 36.098 * PI / 180.0, "rad"),
            ("-36.098°", -36.098 * PI / 180.0, "rad"),
            ("10 km/h", 10.0 / 3.6, "m/s"),
            ("1013 hPa", 101_300.0, "Pa"),
            ("44 uT", 44e-6, "T"),
            ("2 %", 0.02, "1"),
            ("500 ppm", 5e-4, "1"),
            ("1 deg/h", PI / 180.0 / 3600.0, "rad/s"),
            ("0.065 fps/sqrt(h)", 0.065 * 0.3048 / 60.0, "m/s/sqrt(s)"),
            ("5 min", 300.0, "s"),
            ("100 Hz", 100.0, "1/s"),
            ("9 m^2", 9.0, "m^2"),
            ("2 cm^2", 2e-4, "m^2"),
            ("1 m*s^-1.5", 1.0, "m/s/sqrt(s)"),
            ("1 m / s^(3/2)", 1.0, "m/s/sqrt(s)"),
            ("3 kg*m^2", 3.0, "m^2*kg"),
            ("8 1/(km/h)", 28.8, "s/m"),
            ("5", 5.0, "1"),
            ("5m", 5.0, "m"),
            (".5e1 m", 5.0, "m"),
        ];
        for (text, value, unit) in cases {
            let (si, dimension) = parse(text).unwrap_or_else(|error| panic!("{error}"));
            // 4 ε: a handful of rounded factors
            assert!((si - value).abs() <= 4.0 * f64::EPSILON * value.abs(), "{text}: {si}");
            assert_eq!(dimension.to_string(), unit, "{text}");
        }
    }

    #[test]
    fn a_power_of_ten_may_be_before_a_unit() {
        let (size, dimension) = parse_unit("1e-7 deg").unwrap();
        // 2 ε: two rounded factors
        assert!((size / (1e-7 * PI / 180.0) - 1.0).abs() < 2.0 * f64::EPSILON && dimension.to_string() == "rad");
        for wrong in ["1e-7", "1e-7 furlong", "1e-400 deg", "2 deg", "1e deg", "1e-7 1e-7 deg"] {
            assert!(parse_unit(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_mistake_is_named() {
        let cases = [
            ("", r#""" is not a finite number followed by a unit"#),
            ("m 5", r#""m 5" is not a finite number followed by a unit"#),
            ("1e999 m", r#""1e999 m" is not a finite number followed by a unit"#),
            ("nan", r#""nan" is not a finite number followed by a unit"#),
            ("5 sec", r#"unknown unit `sec` in "5 sec"; did you mean `s`?"#),
            ("5 furlong", r#"unknown unit `furlong` in "5 furlong""#),
            ("5 m/", r#""5 m/" is not a unit: a unit is missing"#),
            ("5 m s", r#""5 m s" is not a unit: write `*` or `/` between units"#),
            ("5 m²", r#""5 m²" is not a unit: write powers as `m^2`"#),
            ("5 (m/s", r#""5 (m/s" is not a unit: a `)` is missing"#),
            ("5 m)", r#""5 m)" is not a unit: a `)` has no `(`"#),
            ("5 sqrt m", r#""5 sqrt m" is not a unit: write `sqrt(…)`"#),
            ("5 m^", r#""5 m^" is not a unit: a power is missing after `^`"#),
            (
                "5 m^0.3",
                r#""5 m^0.3" is not a unit: a power is a multiple of one half, at most 8"#,
            ),
            ("5 km^8*km", r#""5 km^8*km" is not a unit: its powers are too large"#),
            (
                "5 (m^3)^3",
                r#""5 (m^3)^3" is not a unit: its powers are not multiples of one half, or too large"#,
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(message(text), expected);
        }
    }

    #[test]
    fn deep_nesting_is_refused_before_the_stack_is() {
        let text = format!("1 {}m", "(".repeat(100_000));
        assert!(message(&text).ends_with("its parentheses are nested too deeply"));
    }

    #[test]
    fn a_bare_unit_gives_its_factor() {
        let (factor, dimension) = parse_unit("deg/s").unwrap();
        assert_eq!((factor, dimension.to_string()), (PI / 180.0, "rad/s".to_owned()));
        assert_eq!(parse_unit("1"), Ok((1.0, Dimension::NONE)));
        assert_eq!(parse_unit("sec").unwrap_err().to_string(), "unknown unit `sec`; did you mean `s`?");
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_parser_panic(text in "[-+0-9.eE a-zA-Zµ°%*/^()²]{0,24}") {
            let _ = parse(&text);
            let _ = parse_unit(&text);
        }

        #[test]
        fn every_finite_number_keeps_its_bits(number in -1e300..1e300f64) {
            proptest::prop_assert_eq!(parse(&format!("{number:e} m")).unwrap().0.to_bits(), number.to_bits());
        }
    }
}
