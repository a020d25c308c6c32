//! Rows of satellites in stages: the row, and the direction in which the satellite is seen.
//!
//! Row        pseudorange \[m\], satellite at transmission, Earth-centred Earth-fixed \[m\]
//! Direction  from the estimated position of the body; the turn of the Earth during the flight, 5e-6 rad, is neglected

use crate::earth::frames::{ecef_from_geodetic, rotation_en};
use fusion_core::geometry::wgs84::Geodetic as Place;
use fusion_core::math;
use fusion_core::model::Literal;
use fusion_core::state::{Geodetic, Quantity, View};
use nalgebra::Vector3;

/// Numbers of a row.
pub(super) const WIDTH: usize = 4;

/// Where a satellite is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Direction {
    /// The place of the body.
    pub(super) place: Place,
    /// Clockwise from north \[rad\].
    pub(super) azimuth: f64,
    /// Above the horizon \[rad\].
    pub(super) elevation: f64,
}

/// The estimated place of the body.
#[derive(Clone, Debug, Literal)]
pub struct Body(Quantity<Geodetic>);

impl Body {
    /// Where the satellite of `row` is seen; `None` before the filter has started, and for a row that is not finite.
    pub(super) fn sees(&self, row: &[f64], view: Option<&View<'_>>) -> Option<Direction> {
        let &[range, x, y, z] = row.first_chunk::<WIDTH>()?;
        let place = view?.get(&self.0);
        let d = rotation_en(place.lat, place.lon).tr_mul(&(Vector3::new(x, y, z) - ecef_from_geodetic(&place)));
        (range.is_finite() && d.iter().all(|d| d.is_finite())).then(|| Direction {
            place,
            azimuth: math::atan2(d.y, d.x),
            elevation: math::atan2(-d.z, math::hypot(d.x, d.y)),
        })
    }
}

#[cfg(feature = "declare")]
pub(super) use spec::{channels, listen};

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Listen};
    use crate::vocabulary::{channel, state};

    /// The channels of a row.
    pub(crate) fn channels() -> Vec<Channel> {
        vec![channel::PSEUDORANGE, channel::SATELLITE_POSITION]
    }

    /// Listens to the rows of `source`.
    pub(crate) fn listen(source: &str) -> Vec<Listen> {
        vec![Listen {
            source: source.to_owned(),
            channels: channels(),
        }]
    }

    impl Body {
        pub(crate) fn build(b: &Build<'_>) -> Result<Self, BuildError> {
            Ok(Self(b.quantity(state::POSITION)?))
        }
    }
}
