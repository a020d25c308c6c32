//! Channels: named groups of numbers in the rows of a stream.

#![cfg(feature = "declare")]

use crate::units::{Dimension, Dimensional, dim};
use std::borrow::Cow;

/// The kind of the numbers in a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Numbers of one dimension.
    Vector,
    /// Angles that wrap.
    Angle,
    /// Latitude, longitude \[rad\] and height \[m\].
    Geodetic,
    /// Unit quaternion w x y z, body to navigation.
    Quaternion,
}

/// A named group of numbers in the rows of a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its name; consumers find it by this.
    pub name: Cow<'static, str>,
    /// How many numbers.
    pub width: usize,
    /// Their dimension; without meaning for geodetic positions and quaternions.
    pub dimension: Dimension,
    /// Their kind.
    pub shape: Shape,
}

/// Ends the name of a channel of 1σ.
const SIGMA: &str = "_sigma";

impl Channel {
    /// The name of the channel that reports the 1σ of the channel `name`.
    #[must_use]
    pub fn sigma_name(name: &str) -> String {
        format!("{name}{SIGMA}")
    }

    /// Whether a channel of this name reports 1σ.
    #[must_use]
    pub fn is_sigma(name: &str) -> bool {
        name.ends_with(SIGMA)
    }

    const fn new(name: &'static str, width: usize, dimension: Dimension, shape: Shape) -> Self {
        Self {
            name: Cow::Borrowed(name),
            width,
            dimension,
            shape,
        }
    }

    /// `width` numbers of `dimension`.
    #[must_use]
    pub const fn vector(name: &'static str, width: usize, dimension: Dimension) -> Self {
        Self::new(name, width, dimension, Shape::Vector)
    }

    /// A geodetic position.
    #[must_use]
    pub const fn geodetic(name: &'static str) -> Self {
        Self::new(name, 3, Dimension::NONE, Shape::Geodetic)
    }

    /// An angle \[rad\].
    #[must_use]
    pub const fn angle(name: &'static str) -> Self {
        Self::new(name, 1, dim::Angle::KIND.dimension, Shape::Angle)
    }

    /// `width` angles \[rad\].
    #[must_use]
    pub const fn angles(name: &'static str, width: usize) -> Self {
        Self::new(name, width, dim::Angle::KIND.dimension, Shape::Angle)
    }

    /// An attitude.
    #[must_use]
    pub const fn quaternion(name: &'static str) -> Self {
        Self::new(name, 4, Dimension::NONE, Shape::Quaternion)
    }

    /// How many numbers a displacement of it has, and so its reported 1σ: a quaternion turns
    /// about three axes.
    #[must_use]
    pub const fn degrees(&self) -> usize {
        match self.shape {
            Shape::Geodetic | Shape::Quaternion => 3,
            Shape::Vector | Shape::Angle => self.width,
        }
    }
}
