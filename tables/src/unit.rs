//! Units for display.

use super::number;

/// A displayed unit, and the factor to it from the unit of the calculation.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    factor: f64,
    symbol: String,
}

impl Unit {
    /// For values in the SI unit `si`, as `Dimension` writes it (`rad/s`, `m/s^2`, `1`).
    ///
    /// Angles are shown in degrees, pressures in hectopascals, magnetic fields in microteslas, pure numbers without
    /// unit.
    #[must_use]
    pub fn of_si(si: &str) -> Self {
        // The unit in base units: a rate of a unit with a name.
        let named = [("kg/m/s^2", "Pa"), ("kg/m/s^3", "Pa/s"), ("kg/s^2/A", "T"), ("kg/s^3/A", "T/s")];
        let si = named.iter().find(|(base, _)| *base == si).map_or(si, |(_, name)| name);
        let (factor, symbol) = match (si, si.strip_prefix("rad")) {
            ("" | "1", _) => (1.0, String::new()),
            ("Pa" | "Pa/s", _) => (0.01, format!("h{si}")),
            ("T" | "T/s", _) => (1e6, format!("µ{si}")),
            (_, Some(rest)) => (1_f64.to_degrees(), format!("deg{rest}")),
            _ => (1.0, si.to_owned()),
        };
        let symbol = symbol.replace("^2", "²").replace("^3", "³").replace('*', "·");
        Self { factor, symbol }
    }

    /// For values that are already in the displayed unit.
    #[must_use]
    pub fn shown(symbol: &str) -> Self {
        Self {
            factor: 1.0,
            symbol: symbol.to_owned(),
        }
    }

    /// The unit of a pure number.
    #[must_use]
    pub fn none() -> Self {
        Self::shown("")
    }

    /// Its symbol; empty for a pure number.
    #[must_use]
    pub fn symbol(&self) -> &str {
        &self.symbol
    }

    /// `value` in this unit.
    #[must_use]
    pub fn of(&self, value: f64) -> f64 {
        value * self.factor
    }

    /// `name [m]`, or `name` for a pure number.
    #[must_use]
    pub fn beside(&self, name: &str) -> String {
        match (name, self.symbol.as_str()) {
            (name, "") => name.to_owned(),
            ("", symbol) => format!("[{symbol}]"),
            (name, symbol) => format!("{name} [{symbol}]"),
        }
    }

    /// Declared values with the unit: `2 m`, `0.5, 0.5, 1 deg`; one value if all are equal.
    #[must_use]
    pub fn list(&self, values: &[f64]) -> String {
        let shown: Vec<f64> = values.iter().map(|v| self.of(*v)).collect();
        format!("{} {}", number::list(&shown), self.symbol).trim().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_shown_in_degrees_and_pressures_in_hectopascals() {
        let rate = Unit::of_si("rad/s");
        assert_eq!((rate.symbol(), rate.of(core::f64::consts::PI)), ("deg/s", 180.0));
        let pressure = Unit::of_si("Pa");
        assert_eq!(pressure.list(&[101_325.0]), "1013 hPa");
        // As a dimension writes them.
        assert_eq!(Unit::of_si("kg/m/s^3").list(&[20.34]), "0.2034 hPa/s");
        assert_eq!(Unit::of_si("kg/s^3/A").list(&[5e-7]), "0.5 µT/s");
        assert_eq!(Unit::of_si("m/s^2").list(&[2.0, 2.0]), "2 m/s²");
        assert_eq!(Unit::of_si("1").list(&[0.5, 1.0]), "0.5, 1");
    }

    #[test]
    fn a_unit_stands_in_brackets_beside_a_name() {
        assert_eq!(Unit::of_si("m").beside("east"), "east [m]");
        assert_eq!(Unit::none().beside("scale"), "scale");
        assert_eq!(Unit::of_si("rad").beside(""), "[deg]");
    }
}
