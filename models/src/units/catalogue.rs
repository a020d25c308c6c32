//! The units that can be written, and suggestions for unknown units.

use std::f64::consts::{PI, TAU};

use super::dimension::Dimension;
use crate::earth::STANDARD_GRAVITY;

/// One unit: symbol, SI factor, dimension, whether it takes prefixes, spellings that lead to this unit as a suggestion.
struct Unit {
    symbol: &'static str,
    factor: f64,
    dimension: Dimension,
    prefixed: bool,
    also: &'static [&'static str],
}

const fn unit(symbol: &'static str, factor: f64, halves: [i8; 6], also: &'static [&'static str]) -> Unit {
    Unit {
        symbol,
        factor,
        dimension: Dimension::from_halves(halves),
        prefixed: false,
        also,
    }
}

const fn prefixed(symbol: &'static str, factor: f64, halves: [i8; 6], also: &'static [&'static str]) -> Unit {
    Unit {
        prefixed: true,
        ..unit(symbol, factor, halves, also)
    }
}

const NONE: [i8; 6] = [0; 6];
const LENGTH: [i8; 6] = [2, 0, 0, 0, 0, 0];
const TIME: [i8; 6] = [0, 0, 2, 0, 0, 0];
const SPEED: [i8; 6] = [2, 0, -2, 0, 0, 0];
const ANGLE: [i8; 6] = [0, 0, 0, 0, 0, 2];
const ANGULAR_RATE: [i8; 6] = [0, 0, -2, 0, 0, 2];
const PRESSURE: [i8; 6] = [-2, 2, -4, 0, 0, 0];
const FIELD: [i8; 6] = [0, 2, -4, -2, 0, 0];

static UNITS: &[Unit] = &[
    unit("%", 1e-2, NONE, &["percent"]),
    unit("ppm", 1e-6, NONE, &[]),
    prefixed("m", 1.0, LENGTH, &["meter", "metre", "meters", "metres"]),
    unit("ft", 0.3048, LENGTH, &["foot", "feet"]),
    unit("nmi", 1852.0, LENGTH, &["NM"]),
    prefixed("s", 1.0, TIME, &["sec", "second", "seconds"]),
    unit("min", 60.0, TIME, &["minute", "minutes"]),
    unit("h", 3600.0, TIME, &["hr", "hour", "hours"]),
    unit("day", 86_400.0, TIME, &["d", "days"]),
    prefixed("Hz", 1.0, [0, 0, -2, 0, 0, 0], &["hertz"]),
    unit("kn", 1852.0 / 3600.0, SPEED, &["kt", "kts", "knot", "knots"]),
    unit("fps", 0.3048, SPEED, &[]),
    unit("mph", 1609.344 / 3600.0, SPEED, &[]),
    unit("kph", 1.0 / 3.6, SPEED, &["kmh", "kmph"]),
    prefixed("g", STANDARD_GRAVITY, [2, 0, -4, 0, 0, 0], &["gee"]),
    prefixed("Gal", 1e-2, [2, 0, -4, 0, 0, 0], &["gal"]),
    prefixed("rad", 1.0, ANGLE, &["radian", "radians"]),
    prefixed("deg", PI / 180.0, ANGLE, &["degree", "degrees"]),
    unit("°", PI / 180.0, ANGLE, &[]),
    unit("arcmin", PI / 10_800.0, ANGLE, &["amin"]),
    unit("arcsec", PI / 648_000.0, ANGLE, &["asec", "as"]),
    unit("rev", TAU, ANGLE, &["turn", "turns"]),
    unit("dps", PI / 180.0, ANGULAR_RATE, &[]),
    unit("rpm", TAU / 60.0, ANGULAR_RATE, &[]),
    unit("kg", 1.0, [0, 2, 0, 0, 0, 0], &["gram", "kilogram"]),
    prefixed("N", 1.0, [2, 2, -4, 0, 0, 0], &["newton"]),
    prefixed("J", 1.0, [4, 2, -4, 0, 0, 0], &["joule"]),
    prefixed("W", 1.0, [4, 2, -6, 0, 0, 0], &["watt"]),
    prefixed("Pa", 1.0, PRESSURE, &["pascal"]),
    prefixed("bar", 1e5, PRESSURE, &[]),
    unit("atm", 101_325.0, PRESSURE, &[]),
    unit("psi", 6_894.757_293_168, PRESSURE, &[]),
    unit("mmHg", 133.322_387_415, PRESSURE, &["torr"]),
    unit("inHg", 3_386.388_640_341, PRESSURE, &[]),
    prefixed("T", 1.0, FIELD, &["tesla"]),
    prefixed("gauss", 1e-4, FIELD, &["G", "Gs"]),
    prefixed("A", 1.0, [0, 0, 0, 2, 0, 0], &["amp", "ampere"]),
    prefixed("V", 1.0, [4, 2, -6, -2, 0, 0], &["volt"]),
    prefixed("K", 1.0, [0, 0, 0, 0, 2, 0], &["degC", "°C", "kelvin", "celsius"]),
];

const PREFIXES: [(&str, f64); 13] = [
    ("p", 1e-12),
    ("n", 1e-9),
    ("u", 1e-6),
    ("µ", 1e-6), // U+00B5, micro sign
    ("μ", 1e-6), // U+03BC, Greek mu
    ("m", 1e-3),
    ("c", 1e-2),
    ("d", 1e-1),
    ("h", 1e2),
    ("k", 1e3),
    ("M", 1e6),
    ("G", 1e9),
    ("T", 1e12),
];

/// SI factor and dimension of one symbol. A unit has priority over a prefixed unit: `min` is a minute.
pub(super) fn find(symbol: &str) -> Option<(f64, Dimension)> {
    if let Some(unit) = UNITS.iter().find(|unit| unit.symbol == symbol) {
        return Some((unit.factor, unit.dimension));
    }
    PREFIXES.iter().find_map(|(prefix, scale)| {
        let rest = symbol.strip_prefix(prefix)?;
        let unit = UNITS.iter().find(|unit| unit.prefixed && unit.symbol == rest)?;
        Some((scale * unit.factor, unit.dimension))
    })
}

/// The meaning of a manufacturer's `G` or `g`, with any prefix: gauss for a magnetic field, standard gravity for a
/// specific force. `None` for other letters and other dimensions.
#[must_use]
pub fn by_letter(symbol: &str, wanted: Dimension) -> Option<String> {
    let prefix = ["Gs", "G", "g"].into_iter().find_map(|letter| symbol.strip_suffix(letter))?;
    let units = ["gauss", "g"].map(|unit| format!("{prefix}{unit}"));
    units
        .into_iter()
        .find(|unit| find(unit).is_some_and(|(_, dimension)| dimension == wanted))
}

/// The known unit that was probably meant; of several units, a unit of dimension `wanted`.
pub(super) fn suggest(symbol: &str, wanted: Option<Dimension>) -> Option<String> {
    let lower = symbol.to_lowercase();
    let spelt = |text: &str, unit: &Unit| unit.also.contains(&text) || unit.also.contains(&text.to_lowercase().as_str());
    if let Some(unit) = UNITS.iter().find(|unit| spelt(symbol, unit)) {
        return Some(unit.symbol.to_owned());
    }
    let bare = || UNITS.iter().map(|unit| unit.symbol.to_owned());
    let scaled = || {
        let prefixed = UNITS.iter().filter(|unit| unit.prefixed);
        prefixed.flat_map(|unit| {
            PREFIXES
                .iter()
                .map(move |(prefix, _)| (*prefix, unit, format!("{prefix}{}", unit.symbol)))
        })
    };
    // A difference in case alone does not count; otherwise a third of the letters may differ.
    let near = bare()
        .chain(scaled().map(|(.., known)| known))
        .map(|known| (strsim::osa_distance(&lower, &known.to_lowercase()), known))
        .filter(|(distance, _)| distance * 3 <= lower.chars().count())
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, known)| known);
    // `mG` is a milligauss for a field, and otherwise probably a milli-g.
    let of_prefix = scaled().find(|(prefix, unit, _)| symbol.strip_prefix(prefix).is_some_and(|rest| spelt(rest, unit)));
    let of_prefix = of_prefix.map(|(.., known)| known);
    let fits = |known: &&String| find(known).is_some_and(|(_, dimension)| wanted == Some(dimension));
    let all = [near, of_prefix];
    all.iter().flatten().find(fits).or_else(|| all.iter().flatten().next()).cloned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_symbol_means_itself_and_only_kg_hides_a_prefixed_unit() {
        let mut seen = std::collections::BTreeSet::new();
        for unit in UNITS {
            assert_eq!(find(unit.symbol), Some((unit.factor, unit.dimension)), "{}", unit.symbol);
            assert!(seen.insert(unit.symbol.to_owned()), "{} twice", unit.symbol);
        }
        for unit in UNITS.iter().filter(|unit| unit.prefixed) {
            for (prefix, _) in PREFIXES {
                let symbol = format!("{prefix}{}", unit.symbol);
                assert!(symbol == "kg" || seen.insert(symbol.clone()), "{symbol} has two meanings");
            }
        }
    }

    #[test]
    fn factors_agree_with_decimals_worked_out_by_hand() {
        // From the defining ratios: 1 nmi = 1852 m, 1 ft = 0.3048 m, 1 turn = 2π rad
        let worked_out = [
            ("kn", 0.514_444_4),
            ("mph", 0.447_04),
            ("kph", 0.277_777_8),
            ("fps", 0.3048),
            ("nmi", 1852.0),
            ("arcsec", 4.848_137e-6),
            ("arcmin", 2.908_882e-4),
            ("deg", 1.745_329e-2),
            ("rpm", 0.104_719_8),
            ("day", 86_400.0),
            ("mGal", 1e-5),
            ("mgauss", 1e-7),
            ("mbar", 100.0),
            ("atm", 101_325.0),
            // 0.45359237 kg · 9.80665 m/s² / (0.0254 m)²; 13 595.1 kg/m³ of mercury, 1 mm and 25.4 mm high.
            ("psi", 6_894.757),
            ("mmHg", 133.322_4),
            ("inHg", 3_386.389),
            ("g", 9.806_65),
        ];
        for (symbol, factor) in worked_out {
            let (found, _) = find(symbol).unwrap();
            // 5e-7: written to 7 digits
            assert!((found / factor - 1.0).abs() < 5e-7, "{symbol}: {found}");
        }
    }

    #[test]
    fn customary_units_take_no_prefix() {
        for symbol in ["mft", "kmin", "kh", "mkg", "k%", "k"] {
            assert_eq!(find(symbol), None, "{symbol}");
        }
    }

    #[test]
    fn a_letter_is_gauss_of_a_field_and_gravity_of_a_force() {
        let (field, force) = (Dimension::from_halves(FIELD), Dimension::from_halves([2, 0, -4, 0, 0, 0]));
        for (symbol, of_field, of_force) in [
            ("G", Some("gauss"), Some("g")),
            ("g", Some("gauss"), Some("g")),
            ("mG", Some("mgauss"), Some("mg")),
            ("Gs", Some("gauss"), Some("g")),
            ("uT", None, None),
            ("xG", None, None),
        ] {
            assert_eq!(by_letter(symbol, field).as_deref(), of_field, "{symbol}");
            assert_eq!(by_letter(symbol, force).as_deref(), of_force, "{symbol}");
            assert_eq!(by_letter(symbol, Dimension::from_halves(ANGLE)), None, "{symbol}");
        }
    }

    #[test]
    fn spellings_and_slips_lead_to_the_symbol() {
        let cases = [
            ("sec", "s"),
            ("degrees", "deg"),
            ("hz", "Hz"),
            ("KM", "km"),
            ("degs", "deg"),
            ("arcsecs", "arcsec"),
            ("knots", "kn"),
            ("G", "gauss"),
        ];
        for (slip, meant) in cases {
            assert_eq!(suggest(slip, None).as_deref(), Some(meant), "{slip}");
        }
        assert_eq!(suggest("furlong", None), None);
        let field = Dimension::from_halves(FIELD);
        assert_eq!(suggest("mG", Some(field)).as_deref(), Some("mgauss"));
        assert_eq!(suggest("mG", None).as_deref(), Some("mg"));
        assert_eq!(suggest("millitesla", Some(field)), None);
    }
}
