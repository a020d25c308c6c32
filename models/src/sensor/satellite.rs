//! The line of sight from an antenna to a satellite, and models whose rows bring the place of a satellite.
//!
//! Given      r_s, the satellite at transmission in Earth-centred Earth-fixed axes of that time; ṙ_s in the same axes
//! Antenna    r_a = r_eb_e + C_en C_nb l_ba_b
//! Rotation   in the axes at reception the satellite was at C(θ) r_s, θ = ω_ie ρ/c the turn of the Earth while the signal
//!            flies, ρ = |r_s − r_a|
//! Source     Groves 2013, eq. 8.34 to 8.36

use super::range::earth_centred;
use crate::earth::SPEED_OF_LIGHT;
use fusion_core::geometry::wgs84::EARTH_RATE;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Exact, ExactModel, ExactView, Literal, Measurement, Real, Size, Undefined};
use fusion_core::state::{Attitude, Geodetic, Param, Quantity, Vector, View};
use nalgebra::Vector3;

/// An example: a satellite 20° from the zenith at 36° north, 129° east, in metres and metres per second.
pub(super) const EXAMPLE: [f64; 6] = [-2.0e7, 1.0e7, 1.4e7, -1500.0, -2000.0, 800.0];

/// The antenna of a receiver.
#[derive(Clone, Debug, Literal)]
pub struct Antenna {
    position: Quantity<Geodetic>,
    pub(super) attitude: Option<Quantity<Attitude>>,
    pub(super) lever_arm: Param<Vector<3>>,
}

impl Antenna {
    /// Latitude, longitude \[rad\] and height \[m\] of the body, and the antenna r_a \[m\].
    pub(super) fn place<D: Real>(&self, x: &ExactView<'_, D>) -> ([D; 3], Vector3<D>) {
        let body = x.geodetic(&self.position);
        let l_n = self
            .attitude
            .as_ref()
            .map(|attitude| x.rotate(attitude, &x.vector(&self.lever_arm)));
        (body, earth_centred(body, l_n))
    }
}

/// The given vector that begins at number `first` of the row.
pub(super) fn given<D: Real>(x: &ExactView<'_, D>, first: usize) -> Result<Vector3<D>, Undefined> {
    match x.given().get(first..first + 3) {
        Some(&[a, b, c]) => Ok(Vector3::new(D::from(a), D::from(b), D::from(c))),
        _ => Err(Undefined("the row has no satellite")),
    }
}

/// Turns a vector by `angle` \[rad\], from Earth-fixed axes at transmission to those at reception.
pub(super) fn turned<D: Real>(v: &Vector3<D>, angle: D) -> Vector3<D> {
    let (sin, cos) = angle.sin_cos();
    Vector3::new(v.x * cos + v.y * sin, v.y * cos - v.x * sin, v.z)
}

/// The angle θ by which the Earth turns during the flight of the signal \[rad\].
pub(super) fn turn<D: Real>(satellite: &Vector3<D>, antenna: &Vector3<D>) -> Result<D, Undefined> {
    let d = satellite - antenna;
    let squared = d.dot(&d);
    // A satellite is not within a kilometre of an antenna: the row has no place of one.
    if squared.re() < 1e6 {
        return Err(Undefined("the satellite is at the antenna"));
    }
    Ok(squared.sqrt() * (EARTH_RATE / SPEED_OF_LIGHT))
}

/// A model of one row whose last `given` numbers are those of a satellite.
#[derive(Debug, Literal)]
pub struct OfSatellite<M> {
    pub(super) model: Exact<M>,
    pub(super) given: usize,
    pub(super) reads_signals: bool,
}

impl<M: ExactModel> Measurement for OfSatellite<M> {
    fn size(&self) -> Size {
        Size {
            value: 1 + self.given,
            residual: 1,
        }
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let (predicted, given) = value.split_at_mut(1);
        if at.given().len() != given.len() {
            return Err(Undefined("the row has no satellite"));
        }
        given.copy_from_slice(at.given());
        self.model.predict(at, predicted)
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        self.model.jacobian(at, h)
    }

    fn reads_signals(&self) -> bool {
        self.reads_signals
    }

    fn given(&self) -> &'static [f64] {
        &EXAMPLE[..self.given]
    }

    literal!(model);
}

#[cfg(feature = "declare")]
pub(super) use spec::is_signal;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError};
    use crate::param::VectorParam;
    use crate::units::dim;
    use crate::vocabulary::state;
    use fusion_core::state::Manifold;

    impl Antenna {
        pub(crate) fn build(b: &mut Build<'_>, lever_arm: &VectorParam<dim::Length>) -> Result<Self, BuildError> {
            let lever_arm = b.param("lever_arm", lever_arm)?;
            let at_the_body = matches!(&lever_arm, Param::Fixed(l) if *l == Vector3::zeros());
            Ok(Self {
                position: b.quantity(state::POSITION)?,
                // A process without an attitude serves an antenna at the body origin.
                attitude: if at_the_body { None } else { Some(b.quantity(state::ATTITUDE)?) },
                lever_arm,
            })
        }

        pub(crate) fn reads_signals(&self) -> bool {
            self.attitude.as_ref().is_some_and(is_signal) || is_signal(&self.position) || is_signal(&self.lever_arm)
        }
    }

    pub(crate) fn is_signal<M: Manifold>(quantity: &Quantity<M>) -> bool {
        matches!(quantity, Quantity::Signal(_))
    }
}

#[cfg(test)]
impl Antenna {
    /// An antenna at a body that does not turn.
    pub(super) const fn fixed(position: Quantity<Geodetic>) -> Self {
        Self {
            position,
            attitude: None,
            lever_arm: Param::Fixed(Vector3::new(0.0, 0.0, 0.0)),
        }
    }
}
