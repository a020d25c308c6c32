//! Quantities whose dimension is part of the type: a field of type [`Length`] accepts lengths only.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer};
use serde::ser::{Serialize, Serializer};

use super::dimension::{Dimension, QuantityKind};
use super::error::UnitError;
use super::expression::parse;
use super::written::{Written, deserialize_written};

/// A dimension as a type: the markers in [`dim`].
pub trait Dimensional: Copy + Send + Sync + 'static {
    /// The dimension and its words.
    const KIND: QuantityKind;
    /// The name of the marker, for schemas.
    const NAME: &'static str;
}

/// A range as a type: the markers in [`range`].
pub trait Range: Copy + Send + Sync + 'static {
    /// The condition in the words of messages; empty if every finite value is allowed.
    const CONDITION: &'static str;
    /// The name of the marker, for schemas.
    const NAME: &'static str;
    /// Returns true if the finite value `si` is allowed.
    fn contains(si: f64) -> bool;
    /// The text that was probably meant by the bare number `si` outside the range.
    fn meant(_si: f64) -> Option<String> {
        None
    }
    /// States the range in the schema of the number.
    fn limit(_schema: &mut Schema) {}
}

/// `si` if it is finite and within `R`; `text` is its written form, `None` for a bare number.
pub(super) fn within<R: Range>(si: f64, text: Option<&str>, wanted: QuantityKind) -> Result<f64, UnitError> {
    let written = || text.map_or_else(|| si.to_string(), str::to_owned);
    if !si.is_finite() {
        Err(UnitError::Expected {
            why: Box::new(UnitError::Number { text: written() }),
            wanted,
        })
    } else if R::contains(si) {
        Ok(si)
    } else {
        Err(UnitError::OutOfRange {
            text: written(),
            wanted,
            range: R::CONDITION,
            meant: if text.is_none() { R::meant(si) } else { None },
        })
    }
}

/// A value of dimension `D` within the range `R`, in SI. Always finite when it was deserialised.
///
/// In TOML a bare number (SI) or text with a unit; serialised as the bare number.
pub struct Quantity<D, R = range::Finite> {
    si: f64,
    marker: PhantomData<(D, R)>,
}

/// A quantity greater than zero.
pub type Positive<D> = Quantity<D, range::Positive>;
/// A quantity of at least zero.
pub type NonNegative<D> = Quantity<D, range::NonNegative>;
/// A number from 0 to 1, both allowed; `"99 %"` too.
pub type Probability = Quantity<dim::Ratio, range::UnitInterval>;
/// A geodetic latitude \[rad\].
pub type Latitude = Quantity<dim::Angle, range::Latitude>;
/// A longitude \[rad\], counted from -180 degrees or from 0.
pub type Longitude = Quantity<dim::Angle, range::Longitude>;

impl<D, R> Quantity<D, R> {
    /// The value in SI units.
    #[must_use]
    pub const fn si(self) -> f64 {
        self.si
    }
}

impl<D: Dimensional> Quantity<D> {
    /// From a value in SI units.
    #[must_use]
    pub const fn from_si(si: f64) -> Self {
        Self { si, marker: PhantomData }
    }
}

impl<D: Dimensional, R: Range> Quantity<D, R> {
    /// From a value in SI units, checked.
    ///
    /// # Errors
    /// A value that is not finite or out of range.
    pub fn try_from_si(si: f64) -> Result<Self, UnitError> {
        Self::checked(si, None)
    }

    /// From text with a unit; a pure number needs no unit.
    ///
    /// # Errors
    /// Text that is not a quantity, has another dimension or is out of range.
    pub fn from_text(text: &str) -> Result<Self, UnitError> {
        let (si, found) = parse(text).map_err(|why| UnitError::Expected {
            why: Box::new(why),
            wanted: D::KIND,
        })?;
        if found == D::KIND.dimension {
            return Self::checked(si, Some(text));
        }
        Err(UnitError::WrongDimension {
            text: text.to_owned(),
            found,
            wanted: D::KIND,
        })
    }

    fn checked(si: f64, text: Option<&str>) -> Result<Self, UnitError> {
        let si = within::<R>(si, text, D::KIND)?;
        Ok(Self { si, marker: PhantomData })
    }
}

// Written out, because a derive would require the same traits of the markers.
impl<D, R> Clone for Quantity<D, R> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<D, R> Copy for Quantity<D, R> {}

impl<D, R> PartialEq for Quantity<D, R> {
    fn eq(&self, other: &Self) -> bool {
        self.si == other.si
    }
}

impl<D, R> PartialOrd for Quantity<D, R> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        self.si.partial_cmp(&other.si)
    }
}

impl<D: Dimensional> Default for Quantity<D> {
    fn default() -> Self {
        Self::from_si(0.0)
    }
}

impl<D: Dimensional> Default for NonNegative<D> {
    fn default() -> Self {
        Self {
            si: 0.0,
            marker: PhantomData,
        }
    }
}

/// `0.05 m`.
impl<D: Dimensional, R> fmt::Display for Quantity<D, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.si, f)?;
        match D::KIND.symbol {
            "1" => Ok(()),
            symbol => write!(f, " {symbol}"),
        }
    }
}

impl<D: Dimensional, R> fmt::Debug for Quantity<D, R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl<D, R> Serialize for Quantity<D, R> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.si)
    }
}

impl<D: Dimensional, R: Range> Written for Quantity<D, R> {
    fn expecting(f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, e.g. {:?}", D::KIND, D::KIND.example)
    }

    fn number(si: f64) -> Result<Self, UnitError> {
        Self::try_from_si(si)
    }

    fn text(text: &str) -> Result<Self, UnitError> {
        Self::from_text(text)
    }
}

impl<'de, D: Dimensional, R: Range> Deserialize<'de> for Quantity<D, R> {
    fn deserialize<A: Deserializer<'de>>(deserializer: A) -> Result<Self, A::Error> {
        deserialize_written(deserializer)
    }
}

impl<D: Dimensional, R: Range> JsonSchema for Quantity<D, R> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("{}{}", R::NAME, D::NAME).into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let QuantityKind { name, symbol, example, .. } = D::KIND;
        let condition = R::CONDITION;
        let space = if condition.is_empty() { "" } else { " " };
        let mut schema = json_schema!({
            "type": ["number", "string"],
            "description": format!(
                "{name}{space}{condition}: a number in SI [{symbol}], or text with a unit, e.g. {example:?}"
            ),
            "examples": [example],
        });
        R::limit(&mut schema);
        schema
    }
}

/// The ranges for quantities.
pub mod range {
    use schemars::Schema;

    use super::Range;

    /// Every finite value.
    #[derive(Clone, Copy, Debug)]
    pub enum Finite {}
    /// Greater than zero.
    #[derive(Clone, Copy, Debug)]
    pub enum Positive {}
    /// Zero or greater.
    #[derive(Clone, Copy, Debug)]
    pub enum NonNegative {}
    /// From 0 to 1, both included.
    #[derive(Clone, Copy, Debug)]
    pub enum UnitInterval {}
    /// An angle from the equator: -90 to 90 degrees.
    #[derive(Clone, Copy, Debug)]
    pub enum Latitude {}
    /// An angle from Greenwich: -180 to 360 degrees.
    #[derive(Clone, Copy, Debug)]
    pub enum Longitude {}

    impl Range for Finite {
        const CONDITION: &'static str = "";
        const NAME: &'static str = "";
        fn contains(_: f64) -> bool {
            true
        }
    }

    impl Range for Positive {
        const CONDITION: &'static str = "greater than 0";
        const NAME: &'static str = "Positive";
        fn contains(si: f64) -> bool {
            si > 0.0
        }
        fn limit(schema: &mut Schema) {
            schema.insert("exclusiveMinimum".to_owned(), 0.into());
        }
    }

    impl Range for NonNegative {
        const CONDITION: &'static str = "of at least 0";
        const NAME: &'static str = "NonNegative";
        fn contains(si: f64) -> bool {
            si >= 0.0
        }
        fn limit(schema: &mut Schema) {
            schema.insert("minimum".to_owned(), 0.into());
        }
    }

    impl Range for UnitInterval {
        const CONDITION: &'static str = "from 0 to 1";
        const NAME: &'static str = "UnitInterval";
        fn contains(si: f64) -> bool {
            (0.0..=1.0).contains(&si)
        }
        fn limit(schema: &mut Schema) {
            schema.insert("minimum".to_owned(), 0.into());
            schema.insert("maximum".to_owned(), 1.into());
        }
    }

    /// A range of angles, in degrees: its conversion rounds in the same way as that of the text.
    macro_rules! degrees {
        ($Name:ident, $least:literal, $most:literal, $condition:literal) => {
            impl Range for $Name {
                const CONDITION: &'static str = $condition;
                const NAME: &'static str = stringify!($Name);
                fn contains(si: f64) -> bool {
                    (f64::to_radians($least)..=f64::to_radians($most)).contains(&si)
                }
                fn meant(si: f64) -> Option<String> {
                    ($least..=$most).contains(&si).then(|| format!("{si} deg"))
                }
                fn limit(schema: &mut Schema) {
                    schema.insert("minimum".to_owned(), f64::to_radians($least).into());
                    schema.insert("maximum".to_owned(), f64::to_radians($most).into());
                }
            }
        };
    }
    degrees!(Latitude, -90.0, 90.0, "from -90 to 90 degrees");
    degrees!(Longitude, -180.0, 360.0, "from -180 to 360 degrees");
}

/// Declares the marker, the alias and the catalogue entry of each dimension.
macro_rules! dimensions {
    ($($(#[$doc:meta])* $Name:ident $halves:tt $name:literal [$symbol:literal] $example:literal)*) => {
        /// The dimensions as types, for [`Quantity`] and related types: `Positive<dim::Length>`.
        pub mod dim {
            use super::{Dimension, Dimensional, QuantityKind};
            $(
                $(#[$doc])*
                #[derive(Clone, Copy, Debug)]
                pub enum $Name {}

                impl Dimensional for $Name {
                    const KIND: QuantityKind = QuantityKind {
                        dimension: Dimension::from_halves($halves),
                        name: $name,
                        symbol: $symbol,
                        example: $example,
                    };
                    const NAME: &'static str = stringify!($Name);
                }
            )*
        }
        $($(#[$doc])* pub type $Name = Quantity<dim::$Name>;)*

        /// Every dimension that has a name; of equal dimensions, the first gives the name.
        pub(super) static KINDS: &[QuantityKind] = &[$(<dim::$Name as Dimensional>::KIND),*];
    };
}

// Exponents in halves of m, kg, s, A, K, rad. A white noise density x/√Hz has the dimension x·√s, which is the
// dimension of the random walk that it integrates to.
dimensions! {
    /// A pure number.
    Ratio [0, 0, 0, 0, 0, 0] "a pure number" ["1"] "2 %"
    /// Metres.
    Length [2, 0, 0, 0, 0, 0] "a length" ["m"] "0.5 m"
    /// Square metres: also the variance of a length.
    Area [4, 0, 0, 0, 0, 0] "an area" ["m^2"] "9 m^2"
    /// Seconds.
    Duration [0, 0, 2, 0, 0, 0] "a duration" ["s"] "0.2 s"
    /// Hertz.
    Frequency [0, 0, -2, 0, 0, 0] "a frequency" ["Hz"] "100 Hz"
    /// Metres per second.
    Speed [2, 0, -2, 0, 0, 0] "a speed" ["m/s"] "10 km/h"
    /// Metres per second squared.
    Acceleration [2, 0, -4, 0, 0, 0] "an acceleration" ["m/s^2"] "1 mg"
    /// Metres per second cubed.
    Jerk [2, 0, -6, 0, 0, 0] "a jerk" ["m/s^3"] "0.5 m/s^3"
    /// Radians; a separate dimension.
    Angle [0, 0, 0, 0, 0, 2] "an angle" ["rad"] "5 deg"
    /// Radians per second.
    AngularRate [0, 0, -2, 0, 0, 2] "an angular rate" ["rad/s"] "1 deg/h"
    /// Radians per second squared.
    AngularAcceleration [0, 0, -4, 0, 0, 2] "an angular acceleration" ["rad/s^2"] "2 deg/s^2"
    /// Metres per root second: integrated velocity noise.
    PositionRandomWalk [2, 0, -1, 0, 0, 0] "a position random walk" ["m/sqrt(s)"] "0.1 m/sqrt(s)"
    /// Metres per second per root second: integrated accelerometer noise.
    VelocityRandomWalk [2, 0, -3, 0, 0, 0] "a velocity random walk" ["m/s/sqrt(s)"] "70 ug/sqrt(Hz)"
    /// Metres per second squared per root second: a wandering accelerometer bias.
    AccelerationRandomWalk [2, 0, -5, 0, 0, 0] "an acceleration random walk" ["m/s^2/sqrt(s)"] "1 ug/sqrt(s)"
    /// Radians per root second: integrated gyroscope noise.
    AngleRandomWalk [0, 0, -1, 0, 0, 2] "an angle random walk" ["rad/sqrt(s)"] "0.125 deg/sqrt(h)"
    /// Root seconds: white noise of a pure number.
    ScaleNoise [0, 0, 1, 0, 0, 0] "a noise of a scale factor" ["sqrt(s)"] "0.2 %/sqrt(Hz)"
    /// Radians per second per root second: a wandering gyroscope bias.
    RateRandomWalk [0, 0, -3, 0, 0, 2] "a rate random walk" ["rad/s/sqrt(s)"] "3.8e-5 deg/s^2/sqrt(Hz)"
    /// Pascals.
    Pressure [-2, 2, -4, 0, 0, 0] "a pressure" ["Pa"] "1013 hPa"
    /// Pascals per second: how fast the weather changes.
    PressureRate [-2, 2, -6, 0, 0, 0] "a pressure rate" ["Pa/s"] "1 hPa/h"
    /// Pascals per root second: a wandering pressure at sea level.
    PressureRandomWalk [-2, 2, -5, 0, 0, 0] "a pressure random walk" ["Pa/sqrt(s)"] "1.7 Pa/sqrt(s)"
    /// Teslas.
    MagneticField [0, 2, -4, -2, 0, 0] "a magnetic field" ["T"] "44 uT"
    /// Teslas per root second: a wandering magnetometer bias.
    MagneticFieldRandomWalk [0, 2, -5, -2, 0, 0] "a magnetic field random walk" ["T/sqrt(s)"] "1 nT/sqrt(s)"
    /// Kilograms.
    Mass [0, 2, 0, 0, 0, 0] "a mass" ["kg"] "30 kg"
    /// Kilograms per cubic metre.
    Density [-6, 2, 0, 0, 0, 0] "a density" ["kg/m^3"] "1025 kg/m^3"
    /// Kilogram square metres.
    MomentOfInertia [4, 2, 0, 0, 0, 0] "a moment of inertia" ["kg*m^2"] "3 kg*m^2"
    /// Newtons.
    Force [2, 2, -4, 0, 0, 0] "a force" ["N"] "40 N"
    /// Newton metres.
    Torque [4, 2, -4, 0, 0, 0] "a torque" ["N*m"] "2 N*m"
    /// Kelvins; differences too.
    Temperature [0, 0, 0, 0, 2, 0] "a temperature" ["K"] "288.15 K"
    /// Volts.
    Voltage [4, 2, -6, -2, 0, 0] "a voltage" ["V"] "12 V"
    /// Amperes.
    Current [0, 0, 0, 2, 0, 0] "a current" ["A"] "300 mA"
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::super::parse_unit;
    use super::*;

    #[derive(Debug, Deserialize)]
    struct One<T> {
        x: T,
    }

    fn read<T: for<'de> Deserialize<'de>>(value: &str) -> Result<T, String> {
        let read = toml::from_str::<One<T>>(&format!("x = {value}"));
        read.map(|one| one.x).map_err(|error| error.message().to_owned())
    }

    #[test]
    fn the_symbol_and_the_example_of_every_dimension_parse_to_it() {
        for kind in KINDS {
            assert_eq!(parse_unit(kind.symbol), Ok((1.0, kind.dimension)), "{kind}");
            assert_eq!(parse(kind.example).unwrap().1, kind.dimension, "{kind}");
            assert_eq!(kind.dimension.kind(), *kind, "{kind} has a double");
        }
    }

    #[test]
    fn a_bare_number_is_si_and_text_is_converted() {
        assert_eq!(read::<Length>("2").unwrap().si(), 2.0);
        assert_eq!(read::<Length>("2.5").unwrap().si(), 2.5);
        assert_eq!(read::<Length>("'5 cm'").unwrap().si(), 0.05);
        assert_eq!(read::<Ratio>("'0.5'").unwrap().si(), 0.5);
        assert_eq!(read::<Probability>("'99 %'").unwrap().si(), 0.99);
    }

    #[test]
    fn a_wrong_quantity_says_what_is_wanted() {
        let message = |read: Result<Length, String>| read.unwrap_err();
        assert_eq!(
            message(read("'5 deg'")),
            r#""5 deg" is an angle [rad]; a length [m] is expected here, e.g. "0.5 m""#
        );
        assert_eq!(
            message(read("'5 m*K'")),
            r#""5 m*K" is a quantity [m*K]; a length [m] is expected here, e.g. "0.5 m""#
        );
        assert_eq!(
            message(read("'5'")),
            r#""5" has no unit; a length [m] is expected here, e.g. "0.5 m""#
        );
        assert_eq!(
            message(read("inf")),
            r#""inf" is not a finite number followed by a unit; a length [m] is expected here, e.g. "0.5 m""#
        );
        assert_eq!(
            message(read("true")),
            r#"invalid type: boolean `true`, expected a length [m], e.g. "0.5 m""#
        );
    }

    #[test]
    fn a_value_out_of_range_says_the_range() {
        assert_eq!(
            read::<Positive<dim::Duration>>("0").unwrap_err(),
            r#"0 is out of range; a duration [s] greater than 0 is expected here, e.g. "0.2 s""#
        );
        assert_eq!(
            read::<NonNegative<dim::Length>>("'-5 cm'").unwrap_err(),
            r#""-5 cm" is out of range; a length [m] of at least 0 is expected here, e.g. "0.5 m""#
        );
        assert_eq!(
            read::<Probability>("1.5").unwrap_err(),
            r#"1.5 is out of range; a pure number [1] from 0 to 1 is expected here, e.g. "2 %""#
        );
        assert_eq!(read::<NonNegative<dim::Length>>("0").unwrap(), NonNegative::default());
    }

    #[test]
    fn serialised_it_is_the_bare_number() {
        assert_eq!(serde_json::to_string(&Length::from_si(0.05)).unwrap(), "0.05");
        assert_eq!(format!("{:?}", Length::from_si(0.05)), "0.05 m");
    }

    #[test]
    fn the_schema_states_unit_range_and_example() {
        let schema = schemars::schema_for!(Positive<dim::Length>);
        assert_eq!(
            schema.get("description").unwrap(),
            r#"a length greater than 0: a number in SI [m], or text with a unit, e.g. "0.5 m""#
        );
        assert_eq!(schema.get("exclusiveMinimum").unwrap(), 0);
        assert_eq!(schema.get("type").unwrap(), &serde_json::json!(["number", "string"]));
    }
}
