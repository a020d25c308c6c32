//! The channel that a fault disturbs, and how a displacement is added to it.

use super::{FaultContext, ProvidedChannel, all_columns};
use crate::block::{BuildError, Shape};
use crate::units::{Dimension, Dimensional, dim};
use core::ops::Range;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use nalgebra::{Vector3, Vector4};

/// A channel within the rows of its source.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    offset: usize,
    width: usize,
    degrees: usize,
    shape: Shape,
    dimension: Dimension,
}

impl Target {
    /// The channel `name`; without a name, the only one.
    pub(super) fn find(context: &FaultContext<'_>, name: Option<&str>) -> Result<Self, BuildError> {
        let known = || {
            context
                .channels
                .iter()
                .map(|c| format!("`{}`", c.channel.name))
                .collect::<Vec<_>>()
                .join(", ")
        };
        let found = match (name, context.channels) {
            (None, [one]) => one,
            (None, _) => {
                let error = BuildError::new("this fault does not say which channel it disturbs");
                return Err(error.help(format!("add `channel = …`, one of {}", known())));
            }
            (Some(name), channels) => channels.iter().find(|c| c.channel.name == name).ok_or_else(|| {
                let error = BuildError::at("channel", format!("the source has no channel `{name}`"));
                error.help(format!("its channels: {}", known()))
            })?,
        };
        Ok(Self::of(found))
    }

    /// The numbers of the channel `name`; without a name, those of the whole row.
    pub(super) fn columns_of(context: &FaultContext<'_>, name: Option<&str>) -> Result<Range<usize>, BuildError> {
        match name {
            Some(name) => Ok(Self::find(context, Some(name))?.columns()),
            None => Ok(all_columns(context.channels)),
        }
    }

    fn of(provided: &ProvidedChannel) -> Self {
        let c = &provided.channel;
        Self {
            offset: provided.offset,
            width: c.width,
            degrees: c.degrees(),
            shape: c.shape,
            dimension: c.dimension,
        }
    }

    /// How many numbers a displacement has.
    pub(super) const fn degrees(&self) -> usize {
        self.degrees
    }

    /// How many of them an outlier moves: a position errs in the horizontal plane.
    pub(super) const fn outlier_degrees(&self) -> usize {
        match self.shape {
            Shape::Geodetic => 2,
            _ => self.degrees,
        }
    }

    /// The dimension of a displacement.
    pub(super) const fn dimension(&self) -> Dimension {
        match self.shape {
            Shape::Geodetic => dim::Length::KIND.dimension,
            Shape::Quaternion => dim::Angle::KIND.dimension,
            Shape::Vector | Shape::Angle => self.dimension,
        }
    }

    /// Its numbers in a row.
    pub(super) const fn columns(&self) -> Range<usize> {
        self.offset..self.offset + self.width
    }

    /// The shape of its channel.
    pub(super) const fn shape(&self) -> Shape {
        self.shape
    }

    /// Whether its numbers can be multiplied: those of a position or an attitude cannot.
    pub(super) const fn has_scale(&self) -> bool {
        matches!(self.shape, Shape::Vector | Shape::Angle)
    }

    /// Multiplies its numbers, which [have a scale](Self::has_scale), by a factor per axis; says
    /// whether one has changed.
    pub(super) fn stretch(&self, row: &mut [f64], factors: &[f64]) -> bool {
        let mut is_other = false;
        for (z, factor) in row[self.columns()].iter_mut().zip(factors) {
            let product = match self.shape {
                Shape::Angle => so3::wrap_angle(*z * factor),
                _ => *z * factor,
            };
            is_other |= product != *z;
            *z = product;
        }
        is_other
    }

    /// Adds a displacement; axes that it does not reach stay.
    pub(super) fn displace(&self, row: &mut [f64], by: &[f64]) {
        let axis = |i: usize| by.get(i).copied().unwrap_or(0.0);
        let by = Vector3::new(axis(0), axis(1), axis(2));
        let z = &mut row[self.columns()];
        match self.shape {
            Shape::Geodetic => {
                let moved = Geodetic {
                    lat: z[0],
                    lon: z[1],
                    height: z[2],
                }
                .offset(&by);
                z.copy_from_slice(&[moved.lat, moved.lon, moved.height]);
            }
            Shape::Quaternion => {
                let q = so3::from_scalar_first(&Vector4::from_column_slice(z)) * so3::exp(&by);
                z.copy_from_slice(so3::to_scalar_first(&q).as_slice());
            }
            Shape::Vector => z.iter_mut().enumerate().for_each(|(i, z)| *z += by_axis(&by, i)),
            Shape::Angle => z
                .iter_mut()
                .enumerate()
                .for_each(|(i, z)| *z = so3::wrap_angle(*z + by_axis(&by, i))),
        }
    }
}

fn by_axis(by: &Vector3<f64>, i: usize) -> f64 {
    by.get(i).copied().unwrap_or(0.0)
}
