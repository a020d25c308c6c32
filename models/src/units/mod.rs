//! Physical quantities as they are written in TOML.
//!
//! A quantity is a bare number, taken as SI, or text that carries its unit:
//!
//! ```toml
//! rate = "100 Hz"
//! gyro_walk = "0.125 deg/sqrt(h)"
//! accelerometer_bias = "1 mg"
//! lever_arm = ["5 cm", 0, "-1 m"]
//! ```
//!
//! Grammar   number, optional blank, unit; units combine by `*`, `/`, `^`, `sqrt( )`, `√`, `( )`
//! Powers    whole or half: `s^2`, `s^-1`, `s^0.5`, `s^(3/2)`
//! Prefixes  p n u µ m c d h k M G T, on the units that take them
//! Angle     is a separate dimension (rad), so `"5 deg"` is not a length
//! g         is standard gravity, 9.80665 m/s²: `mg`, `ug` are milli- and micro-g.
//!           Grams are not available; mass is written in `kg`
//! Not here  temperature scales with an offset (°C), decibels, calendar time
//!
//! Three ways to read them: [`Quantity`] if the type fixes the dimension, [`AnyQuantity`] if the dimension is
//! known only when the block is built, [`parse_unit`] for the heading of a data column.

#![cfg(feature = "declare")]

mod any;
mod catalogue;
mod dimension;
mod error;
mod expression;
mod per_axis;
mod place;
mod quantity;
mod written;

pub use crate::earth::STANDARD_GRAVITY;
pub use any::AnyQuantity;
pub use catalogue::by_letter;
pub use dimension::{Dimension, QuantityKind};
pub use error::UnitError;
pub use expression::{parse, parse_unit};
pub use per_axis::{Axes, PerAxis, Vec3Of};
pub use place::Place;
pub use quantity::*;
