//! From the cells of a channel to its numbers.

use super::plan::ChannelPlan;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_models::block::{Channel, Shape};
use fusion_models::earth::LocalFrame;
use fusion_models::plausible::{self, Impossible};
use fusion_models::units::Dimension;
use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector4};

/// What the numbers become.
#[derive(Clone, Debug)]
pub(super) enum Conversion {
    Vector {
        rotation: Option<Matrix3<f64>>,
    },
    Geodetic,
    /// North, east, down; the frame is given when the source is opened.
    Local {
        frame: Option<LocalFrame>,
    },
    Quaternion {
        /// Whether the numbers are roll, pitch and heading.
        is_euler: bool,
        navigation: UnitQuaternion<f64>,
        sensor: UnitQuaternion<f64>,
        inverse: bool,
    },
}

/// What is wrong with the values of a row.
pub(in super::super) struct Wrong {
    pub(in super::super) message: String,
    pub(in super::super) help: Option<&'static str>,
}

impl Wrong {
    const fn new(message: String) -> Self {
        Self { message, help: None }
    }
}

impl From<Impossible> for Wrong {
    fn from(impossible: Impossible) -> Self {
        Self {
            message: impossible.message,
            help: impossible
                .may_be_degrees
                .then_some("if the columns are in degrees, write `unit = \"deg\"`"),
        }
    }
}

impl ChannelPlan {
    /// Whether a local position needs its origin.
    pub(in super::super) const fn needs_origin(&self) -> bool {
        matches!(self.conversion, Conversion::Local { frame: None })
    }

    /// Gives a local position its origin.
    pub(in super::super) fn set_origin(&mut self, origin: Geodetic) {
        if let Conversion::Local { frame } = &mut self.conversion {
            *frame = Some(LocalFrame::new(origin));
        }
    }

    /// Makes the channel's numbers of its cells; `interval` \[s\] is what increments cover.
    pub(in super::super) fn convert(&mut self, cells: &[f64], interval: f64, out: &mut [f64]) -> Result<(), Wrong> {
        self.scale(cells, interval, out)?;
        self.conversion.apply(out)?;
        let Channel {
            name, dimension, shape, ..
        } = &self.channel;
        plausible::check(*shape, *dimension, Channel::is_sigma(name), out)?;
        if self.average {
            let previous = self.previous.get_or_insert_with(|| out.to_vec());
            for (out, previous) in out.iter_mut().zip(previous) {
                let now = core::mem::replace(out, 0.5 * (*out + *previous));
                *previous = now;
            }
        }
        Ok(())
    }

    /// Number by number: unit and scale, root of a variance, offset, increment to rate.
    fn scale(&self, cells: &[f64], interval: f64, out: &mut [f64]) -> Result<(), Wrong> {
        for (i, (out, cell)) in out.iter_mut().zip(cells).enumerate() {
            let mut number = self.factor[i] * cell;
            if self.variance {
                if number < 0.0 {
                    let column = &self.columns[i].1;
                    return Err(Wrong::new(format!("the variance {cell} in column `{column}` is negative")));
                }
                number = number.sqrt();
            }
            number += self.add[i];
            *out = if self.increment { number / interval } else { number };
        }
        Ok(())
    }
}

impl Conversion {
    /// Turns the numbers as a whole, in place.
    fn apply(&self, out: &mut [f64]) -> Result<(), Wrong> {
        match self {
            Self::Vector { rotation: None } | Self::Geodetic | Self::Local { frame: None } => {}
            Self::Vector { rotation: Some(rotation) } => {
                let turned = rotation * Vector3::new(out[0], out[1], out[2]);
                out.copy_from_slice(turned.as_slice());
            }
            Self::Local { frame: Some(frame) } => {
                let p = frame.to_geodetic(&Vector3::new(out[0], out[1], out[2]));
                out.copy_from_slice(&[p.lat, p.lon, p.height]);
            }
            Self::Quaternion {
                is_euler,
                navigation,
                sensor,
                inverse,
            } => {
                let read = if *is_euler {
                    so3::to_scalar_first(&so3::from_rpy(out[0], out[1], out[2]))
                } else {
                    Vector4::from_column_slice(out)
                };
                out.copy_from_slice(read.as_slice());
                plausible::check(Shape::Quaternion, Dimension::NONE, false, out)?;
                let q = so3::from_scalar_first(&read);
                let q = navigation * if *inverse { q.inverse() } else { q } * sensor;
                out.copy_from_slice(so3::to_scalar_first(&q).as_slice());
            }
        }
        Ok(())
    }
}
