//! Values that no sensor can have measured: mistakes of units, or of the log.
//!
//! The limits are far beyond any vehicle; the user declares a sensor's own range separately. Values that are not finite
//! are left to the users of the numbers: the other numbers of the row may be good.

#![cfg(feature = "declare")]

use crate::block::Shape;
use crate::units::{Dimension, Dimensional, dim};
use nalgebra::Vector4;
use std::f64::consts::{FRAC_PI_2, TAU};
use thiserror::Error;

/// How far the norm of a quaternion may be from 1: a few digits in a file.
const NORM_TOLERANCE: f64 = 1e-2;
/// Heights above the ellipsoid \[m\]: from the centre of the Earth to beyond the Moon.
const HEIGHTS: (f64, f64) = (-6.4e6, 1e9);

/// Why numbers cannot have been measured.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{message}")]
pub struct Impossible {
    /// The problem, as a message.
    pub message: String,
    /// True if degrees may have been used as radians.
    pub may_be_degrees: bool,
}

/// The largest plausible number of a dimension, in SI; `None` if no limit is known.
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

/// Checks the numbers of a channel, in SI; `is_sigma` if they are 1σ.
///
/// # Errors
/// The value that is impossible.
pub fn check(shape: Shape, dimension: Dimension, is_sigma: bool, values: &[f64]) -> Result<(), Impossible> {
    let fails = |message: String, may_be_degrees| Err(Impossible { message, may_be_degrees });
    match (shape, values) {
        (Shape::Geodetic, [lat, ..]) if lat.is_finite() && lat.abs() > FRAC_PI_2 => {
            fails(format!("the latitude {lat} rad lies beyond a pole"), true)
        }
        (Shape::Geodetic, [_, lon, ..]) if lon.is_finite() && lon.abs() > TAU => {
            fails(format!("the longitude {lon} rad is more than a turn"), true)
        }
        (Shape::Geodetic, [_, _, height]) if height.is_finite() && !(HEIGHTS.0..=HEIGHTS.1).contains(height) => {
            fails(format!("no place is {height:e} m above the ellipsoid"), false)
        }
        (Shape::Quaternion, [w, x, y, z]) => {
            let norm = Vector4::new(*w, *x, *y, *z).norm();
            if norm.is_finite() && (norm - 1.0).abs() > NORM_TOLERANCE {
                return fails(format!("the quaternion has norm {norm}, not 1"), false);
            }
            Ok(())
        }
        (Shape::Vector, _) => check_numbers(dimension, is_sigma, values),
        _ => Ok(()),
    }
}

fn check_numbers(dimension: Dimension, is_sigma: bool, values: &[f64]) -> Result<(), Impossible> {
    let fails = |message| {
        Err(Impossible {
            message,
            may_be_degrees: false,
        })
    };
    let mut finite = values.iter().filter(|value| value.is_finite());
    if is_sigma && let Some(sigma) = finite.clone().find(|sigma| **sigma <= 0.0) {
        return fails(format!("a 1σ is above zero, not {sigma}"));
    }
    let Some(largest) = largest(dimension) else { return Ok(()) };
    match finite.find(|value| value.abs() > largest) {
        Some(value) => fails(format!("{value:e} cannot be: {} is at most {largest:e}", dimension.kind())),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEED: Dimension = dim::Speed::KIND.dimension;

    fn said(shape: Shape, dimension: Dimension, is_sigma: bool, values: &[f64]) -> Option<String> {
        check(shape, dimension, is_sigma, values).err().map(|e| e.message)
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
