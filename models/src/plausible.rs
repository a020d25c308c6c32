//! Values that no sensor can have measured: mistakes of units, or of the log.
//!
//! The limits are far beyond any vehicle; the user declares a sensor's own range separately. Values that are not finite
//! are left to the users of the numbers: the other numbers of the row may be good.

#[cfg(feature = "declare")]
use crate::block::{Channel, Shape};
#[cfg(feature = "declare")]
use crate::units::{Dimension, Dimensional, dim};
use core::f64::consts::{FRAC_PI_2, TAU};
use fusion_core::math;
use thiserror::Error;

/// How far the norm of a quaternion may be from 1: a few digits in a file.
const NORM_TOLERANCE: f64 = 1e-2;
/// Heights above the ellipsoid \[m\]: from the centre of the Earth to beyond the Moon.
const HEIGHTS: (f64, f64) = (-6.4e6, 1e9);

/// Why numbers cannot have been measured.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Impossible {
    /// A latitude \[rad\].
    #[error("the latitude {0} rad lies beyond a pole")]
    Latitude(f64),
    /// A longitude \[rad\].
    #[error("the longitude {0} rad is more than a turn")]
    Longitude(f64),
    /// A height \[m\].
    #[error("no place is {0:e} m above the ellipsoid")]
    Height(f64),
    /// The norm of a quaternion.
    #[error("the quaternion has norm {0}, not 1")]
    Norm(f64),
    /// A 1σ.
    #[error("a 1σ is above zero, not {0}")]
    Sigma(f64),
    /// A number beyond its limit, in SI.
    #[error("{value:e} cannot be: {name} [{unit}] is at most {largest:e}")]
    Size {
        /// The number.
        value: f64,
        /// The limit.
        largest: f64,
        /// Its quantity.
        name: &'static str,
        /// Its SI unit.
        unit: &'static str,
    },
}

impl Impossible {
    /// Whether degrees may have been used as radians.
    #[must_use]
    pub const fn may_be_degrees(&self) -> bool {
        matches!(self, Self::Latitude(_) | Self::Longitude(_))
    }
}

/// The numbers that a channel can have, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Possible {
    /// All numbers.
    All,
    /// Latitude, longitude \[rad\], and height \[m\] where there is a third number.
    Place,
    /// A quaternion of norm 1.
    Quaternion,
    /// Numbers of one quantity.
    Numbers {
        /// Their largest size.
        largest: f64,
        /// Their quantity.
        name: &'static str,
        /// Its SI unit.
        unit: &'static str,
        /// Whether they are 1σ: above zero.
        is_sigma: bool,
    },
}

/// The numbers that the channel of a row can have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The place of its first number.
    pub first: usize,
    /// How many numbers.
    pub width: usize,
    /// Its possible numbers.
    pub numbers: Possible,
}

impl Bounds {
    /// Checks the numbers of the channel in a row. A row that is too short is checked elsewhere.
    ///
    /// # Errors
    /// The value that is impossible.
    pub fn check(&self, row: &[f64]) -> Result<(), Impossible> {
        self.numbers.check(row.get(self.first..self.first + self.width).unwrap_or_default())
    }
}

impl Possible {
    /// Checks numbers.
    ///
    /// # Errors
    /// The first that is impossible.
    pub fn check(&self, values: &[f64]) -> Result<(), Impossible> {
        let too_large = |value: f64, largest: f64| value.is_finite() && value.abs() > largest;
        match (*self, values) {
            (Self::Place, [latitude, ..]) if too_large(*latitude, FRAC_PI_2) => Err(Impossible::Latitude(*latitude)),
            (Self::Place, [_, longitude, ..]) if too_large(*longitude, TAU) => Err(Impossible::Longitude(*longitude)),
            (Self::Place, [_, _, height]) if height.is_finite() && !(HEIGHTS.0..=HEIGHTS.1).contains(height) => {
                Err(Impossible::Height(*height))
            }
            (Self::Quaternion, [_, _, _, _]) => {
                let norm = math::sqrt(values.iter().map(|v| v * v).sum());
                match norm.is_finite() && (norm - 1.0).abs() > NORM_TOLERANCE {
                    true => Err(Impossible::Norm(norm)),
                    false => Ok(()),
                }
            }
            (
                Self::Numbers {
                    largest,
                    name,
                    unit,
                    is_sigma,
                },
                _,
            ) => values.iter().filter(|value| value.is_finite()).try_for_each(|&value| {
                if is_sigma && value <= 0.0 {
                    return Err(Impossible::Sigma(value));
                }
                match value.abs() > largest {
                    true => Err(Impossible::Size {
                        value,
                        largest,
                        name,
                        unit,
                    }),
                    false => Ok(()),
                }
            }),
            _ => Ok(()),
        }
    }
}

/// The largest plausible number of a dimension, in SI; `None` if no limit is known.
#[cfg(feature = "declare")]
fn largest(dimension: Dimension) -> Option<f64> {
    [
        // Light in vacuum.
        (dim::Speed::KIND.dimension, 299_792_458.0),
        // A million revolutions per minute: ten times a turbocharger.
        (dim::AngularRate::KIND.dimension, 1e5),
        // Five times the acceleration of a shell in its barrel.
        (dim::Acceleration::KIND.dimension, 1e6),
        // The size of the planetary system.
        (dim::Length::KIND.dimension, 1e13),
        // The strongest lasting magnets have 45 T.
        (dim::MagneticField::KIND.dimension, 100.0),
        // Thirty times the pressure at the centre of the Earth.
        (dim::Pressure::KIND.dimension, 1e13),
    ]
    .into_iter()
    .find_map(|(of, largest)| (of == dimension).then_some(largest))
}

#[cfg(feature = "declare")]
impl Possible {
    /// The possible numbers of the channel `name`.
    #[must_use]
    pub fn of(name: &str, shape: Shape, dimension: Dimension) -> Self {
        let is_sigma = Channel::is_sigma(name);
        match (shape, largest(dimension)) {
            (Shape::Geodetic, _) => Self::Place,
            (Shape::Quaternion, _) => Self::Quaternion,
            (Shape::Angle, _) => Self::All,
            (Shape::Vector, None) if !is_sigma => Self::All,
            (Shape::Vector, largest) => Self::Numbers {
                largest: largest.unwrap_or(f64::MAX),
                name: dimension.kind().name,
                unit: dimension.kind().symbol,
                is_sigma,
            },
        }
    }
}

#[cfg(all(test, feature = "declare"))]
mod tests {
    use super::*;

    const SPEED: Dimension = dim::Speed::KIND.dimension;

    fn said(shape: Shape, dimension: Dimension, is_sigma: bool, values: &[f64]) -> Option<String> {
        let name = if is_sigma { "velocity_sigma" } else { "velocity" };
        Possible::of(name, shape, dimension).check(values).err().map(|e| e.to_string())
    }

    #[test]
    fn what_cannot_be_is_refused_up_to_its_limit() {
        let place = |values: [f64; 3]| said(Shape::Geodetic, Dimension::NONE, false, &values);
        assert_eq!(place([FRAC_PI_2, -TAU, -400.0]), None);
        assert_eq!(place([45.0, 0.1, 0.0]).unwrap(), "the latitude 45 rad lies beyond a pole");
        assert_eq!(place([0.8, 8.0, 0.0]).unwrap(), "the longitude 8 rad is more than a turn");
        assert_eq!(place([0.8, 0.1, 1e38]).unwrap(), "no place is 1e38 m above the ellipsoid");
        assert_eq!(place([0.8, 0.1, -7e6]).unwrap(), "no place is -7e6 m above the ellipsoid");
        let turn = |values: [f64; 4]| said(Shape::Quaternion, Dimension::NONE, false, &values);
        assert_eq!(turn([0.5, -0.5, 0.5, 0.499]), None);
        assert_eq!(turn([0.0; 4]).unwrap(), "the quaternion has norm 0, not 1");
        assert_eq!(said(Shape::Vector, SPEED, false, &[0.0, -299_792_458.0]), None);
        let light = said(Shape::Vector, SPEED, false, &[0.0, -3e8]).unwrap();
        assert!(light.starts_with("-3e8 cannot be: a speed [m/s] is at most"), "{light}");
        assert_eq!(said(Shape::Vector, Dimension::NONE, false, &[1e38]), None);
    }

    #[test]
    fn a_sigma_is_above_zero() {
        assert_eq!(said(Shape::Vector, SPEED, true, &[0.1, 1e-9]), None);
        for wrong in [0.0, -0.1] {
            let told = said(Shape::Vector, SPEED, true, &[0.1, wrong]).unwrap();
            assert_eq!(told, format!("a 1σ is above zero, not {wrong}"));
        }
    }

    #[test]
    fn what_is_not_finite_is_judged_by_its_user() {
        let nan = f64::NAN;
        assert_eq!(said(Shape::Geodetic, Dimension::NONE, false, &[nan, f64::INFINITY, nan]), None);
        assert_eq!(said(Shape::Quaternion, Dimension::NONE, false, &[nan; 4]), None);
        assert_eq!(said(Shape::Vector, SPEED, true, &[nan, f64::NEG_INFINITY]), None);
    }
}
