//! A quantity whose dimension is known only when the block is built.
//!
//! Unreadable text is also rejected then, so that the message can name the required quantity.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer};
use serde::ser::{Serialize, Serializer};

use super::dimension::Dimension;
use super::error::UnitError;
use super::expression::parse;
use super::quantity::{Range, range, within};
use super::written::{Written, deserialize_written};

/// A quantity of any dimension, such as the sigma of a sensor that is not built yet.
///
/// A bare number is SI of the dimension that is required later; text states its own dimension.
#[derive(Clone, Debug, PartialEq)]
pub struct AnyQuantity {
    si: f64,
    /// The text, and its dimension or its error; `None` for a bare number.
    stated: Option<(String, Result<Dimension, UnitError>)>,
}

impl AnyQuantity {
    /// From text with a unit. Invalid text is rejected by [`expect`](Self::expect).
    #[must_use]
    pub fn from_text(text: &str) -> Self {
        let (si, found) = match parse(text) {
            Ok((si, dimension)) => (si, Ok(dimension)),
            Err(why) => (f64::NAN, Err(why)),
        };
        Self {
            si,
            stated: Some((text.to_owned(), found)),
        }
    }

    /// The dimension of the text; `None` for a bare number, and for invalid text.
    #[must_use]
    pub fn dimension(&self) -> Option<Dimension> {
        self.stated.as_ref().and_then(|(_, found)| found.clone().ok())
    }

    /// The value in SI, if it can have the dimension `wanted`.
    ///
    /// # Errors
    /// Text that is not a quantity, or a quantity with another dimension.
    pub fn expect(&self, wanted: Dimension) -> Result<f64, UnitError> {
        match &self.stated {
            Some((text, Ok(found))) if *found != wanted => Err(UnitError::WrongDimension {
                text: text.clone(),
                found: *found,
                wanted: wanted.kind(),
            }),
            Some((_, Err(why))) => Err(UnitError::Expected {
                why: Box::new(why.clone()),
                wanted: wanted.kind(),
            }),
            _ => within::<range::Finite>(self.si, None, wanted.kind()),
        }
    }

    /// The value in SI, if it is also within the range `R`.
    ///
    /// # Errors
    /// Another dimension, or a value out of range.
    pub fn within<R: Range>(&self, wanted: Dimension) -> Result<f64, UnitError> {
        let text = self.stated.as_ref().map(|(text, _)| text.as_str());
        within::<R>(self.expect(wanted)?, text, wanted.kind())
    }
}

/// Written like the original: the bare number, or the text.
impl Serialize for AnyQuantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.stated {
            Some((text, _)) => serializer.serialize_str(text),
            None => serializer.serialize_f64(self.si),
        }
    }
}

impl Written for AnyQuantity {
    fn expecting(f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number in SI, or text with a unit, e.g. \"0.5 m\"")
    }

    fn number(si: f64) -> Result<Self, UnitError> {
        Ok(Self { si, stated: None })
    }

    fn text(text: &str) -> Result<Self, UnitError> {
        Ok(Self::from_text(text))
    }
}

impl<'de> Deserialize<'de> for AnyQuantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserialize_written(deserializer)
    }
}

impl JsonSchema for AnyQuantity {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "AnyQuantity".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": ["number", "string"],
            "description": "a number in SI, or text with a unit of the right dimension",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Dimensional, dim};
    use super::*;

    const LENGTH: Dimension = <dim::Length as Dimensional>::KIND.dimension;

    fn read(json: &str) -> Result<AnyQuantity, String> {
        serde_json::from_str(json).map_err(|error| error.to_string())
    }

    #[test]
    fn a_bare_number_has_whatever_dimension_is_wanted() {
        let sigma = read("3").unwrap();
        assert_eq!((sigma.expect(LENGTH), sigma.expect(Dimension::NONE)), (Ok(3.0), Ok(3.0)));
        assert_eq!(sigma.dimension(), None);
    }

    #[test]
    fn text_is_held_to_the_dimension_it_states() {
        let sigma = read(r#""50 cm""#).unwrap();
        assert_eq!(sigma.expect(LENGTH), Ok(0.5));
        let error = read(r#""2 deg""#).unwrap().expect(LENGTH).unwrap_err().to_string();
        assert_eq!(error, r#""2 deg" is an angle [rad]; a length [m] is expected here, e.g. "0.5 m""#);
        let volume = LENGTH.power(6).unwrap();
        let error = sigma.expect(volume).unwrap_err().to_string();
        assert_eq!(
            error,
            r#""50 cm" is a length [m]; a quantity [m^3] is expected here, e.g. "0.1 m^3""#
        );
    }

    #[test]
    fn what_is_no_quantity_is_refused_with_what_is_wanted() {
        let error = read(r#""5 lenghts""#).unwrap().expect(LENGTH).unwrap_err().to_string();
        assert_eq!(
            error,
            r#"unknown unit `lenghts` in "5 lenghts"; a length [m] is expected here, e.g. "0.5 m""#
        );
        let nan = AnyQuantity::number(f64::NAN).unwrap().expect(LENGTH).unwrap_err().to_string();
        assert!(nan.starts_with(r#""NaN" is not a finite number"#), "{nan}");
    }

    #[test]
    fn it_is_serialised_as_it_was_written() {
        for json in ["3.0", r#""50 cm""#] {
            assert_eq!(serde_json::to_string(&read(json).unwrap()).unwrap(), json);
        }
    }
}
