//! The written form of a quantity: a bare number, or text with a unit.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserializer, Error, Visitor};

use super::error::UnitError;

/// A type that can be read from a bare number or from text.
pub(super) trait Written: Sized {
    /// Describes the expected input.
    fn expecting(f: &mut fmt::Formatter<'_>) -> fmt::Result;
    /// From a bare number in SI.
    fn number(si: f64) -> Result<Self, UnitError>;
    /// From text with a unit.
    fn text(text: &str) -> Result<Self, UnitError>;
}

/// Reads a number or text.
pub(super) fn deserialize_written<'de, T: Written, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    struct WrittenVisitor<T>(PhantomData<T>);

    impl<T: Written> Visitor<'_> for WrittenVisitor<T> {
        type Value = T;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            T::expecting(f)
        }

        fn visit_f64<E: Error>(self, si: f64) -> Result<T, E> {
            T::number(si).map_err(E::custom)
        }

        fn visit_i64<E: Error>(self, si: i64) -> Result<T, E> {
            self.visit_f64(si as f64)
        }

        fn visit_u64<E: Error>(self, si: u64) -> Result<T, E> {
            self.visit_f64(si as f64)
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
            T::text(text).map_err(E::custom)
        }
    }

    deserializer.deserialize_any(WrittenVisitor(PhantomData))
}
