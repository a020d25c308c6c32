//! The common part of the processes of inertial navigation.

use super::agility::{Agility, Fading};
use super::strapdown::discrete::Slots;
use super::strapdown::error_model;
use super::strapdown::mechanisation::Nav;
use crate::earth::{Gravity, LocalEarth};
use alloc::vec::Vec;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic as Place;
use fusion_core::linear::Transition;
use fusion_core::model::{Gap, Literal};
use fusion_core::state::{Geodetic, Manifold, Param, Vector};
use nalgebra::{Matrix3, Vector3};

/// The states `position`, `velocity` and `attitude`, which the process moves over the ellipsoid.
#[derive(Clone, Copy, Debug, Literal)]
pub struct Kinematic {
    pub(super) slots: Slots<Geodetic>,
}

impl Kinematic {
    /// The motion for [`Kinematic::coast`]: `felt` minus the rate and force of a vehicle at constant velocity and
    /// attitude.
    pub(super) fn motion(&self, x: &[f64], felt: &Felt, gravity: Gravity, motion: &mut Vec<f64>) {
        let steady = Felt::unmoved(&self.read(x), gravity);
        motion.extend_from_slice((felt.w_ib_b - steady.w_ib_b).as_slice());
        motion.extend_from_slice((felt.f_ib_b - steady.f_ib_b).as_slice());
    }

    /// Moves them through a part of a gap in the input: the `motion` at its beginning fades away, and the vehicle's
    /// agility is the noise. Returns the rate and force that ideal inertial sensors would measure.
    pub(super) fn coast(
        &self,
        x: &mut [f64],
        gap: &Gap,
        motion: &[f64],
        agility: &Agility,
        gravity: Gravity,
        out: &mut Transition,
    ) -> Felt {
        let (nav, dt) = (self.read(x), gap.duration());
        let steady = Felt::unmoved(&nav, gravity);
        let fading = agility.fading(gap, motion);
        let b = error_model::continuous(&nav, &steady.w_ib_b, &steady.f_ib_b, gravity);
        let one = Matrix3::identity();
        out.set(self.slots.position, self.slots.position, &(one + b.rr * dt));
        out.set(self.slots.position, self.slots.velocity, &(b.rv * dt));
        let c_nb = so3::rotation(&nav.q_nb);
        self.slots.fade(&fading, &c_nb, out);
        out.set(self.slots.position, self.slots.attitude, &(-b.rv * c_nb * so3::skew(&fading.path)));
        out.noise_trapezoid(self.slots.velocity, self.slots.velocity, &agility.velocity(gap, &c_nb));
        agility.turn(gap, self.slots.attitude, self.slots.velocity, nav.v_eb_n.xy().norm(), out);
        // The radii of mid-step, as in the mechanisation.
        let travelled = nav.v_eb_n * dt + c_nb * fading.path;
        let earth = LocalEarth::at(&nav.position.offset(&(travelled * 0.5)));
        let position = Place {
            lat: nav.position.lat + travelled.x / earth.meridian,
            lon: so3::wrap_angle(nav.position.lon + travelled.y / (earth.normal * earth.cos_lat)),
            height: nav.position.height - travelled.z,
        };
        let next = Nav {
            position,
            v_eb_n: nav.v_eb_n + c_nb * fading.velocity,
            q_nb: nav.q_nb * fading.turn,
        };
        self.write(&next, x);
        Felt {
            w_ib_b: steady.w_ib_b + fading.w,
            f_ib_b: Felt::unmoved(&next, gravity).f_ib_b + fading.f,
        }
    }

    /// Reads them from state storage.
    #[inline]
    pub(super) fn read(&self, x: &[f64]) -> Nav {
        Nav {
            position: self.slots.position.read(x),
            v_eb_n: self.slots.velocity.read(x),
            q_nb: self.slots.attitude.read(x),
        }
    }

    /// Writes them into state storage.
    #[inline]
    pub(super) fn write(&self, nav: &Nav, x: &mut [f64]) {
        self.slots.position.write(&nav.position, x);
        self.slots.velocity.write(&nav.v_eb_n, x);
        self.slots.attitude.write(&nav.q_nb, x);
    }
}

impl<P: Manifold> Slots<P> {
    /// Writes Φ of velocity and attitude over a part of a gap in which a motion fades away.
    pub(super) fn fade(&self, fading: &Fading, c_nb: &Matrix3<f64>, out: &mut Transition) {
        out.set(self.velocity, self.attitude, &(-c_nb * so3::skew(&fading.velocity)));
        out.set(self.attitude, self.attitude, &so3::rotation(&fading.turn.inverse()));
    }
}

/// The measurements of ideal inertial sensors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Felt {
    /// Angular rate \[rad/s\].
    pub(super) w_ib_b: Vector3<f64>,
    /// Specific force \[m/s²\].
    pub(super) f_ib_b: Vector3<f64>,
}

impl Felt {
    /// For a body that keeps its velocity and attitude relative to the Earth.
    fn unmoved(nav: &Nav, gravity: Gravity) -> Self {
        let earth = LocalEarth::at(&nav.position);
        let (w_ie, w_en) = (earth.earth_rate_n(), earth.transport_rate_n(&nav.v_eb_n));
        let mut f_n = (2.0 * w_ie + w_en).cross(&nav.v_eb_n);
        f_n.z -= earth.gravity(gravity);
        Self {
            w_ib_b: nav.q_nb.inverse_transform_vector(&(w_ie + w_en)),
            f_ib_b: nav.q_nb.inverse_transform_vector(&f_n),
        }
    }
}

/// The value of a parameter of a process. Parameters are not signals: the process computes signals from its parameters.
#[inline]
pub(super) fn value(param: &Param<Vector<3>>, x: &[f64]) -> Vector3<f64> {
    param.stored(x).unwrap_or_default()
}

#[cfg(feature = "declare")]
pub(super) use spec::psd;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError};
    use crate::vocabulary::state;
    use fusion_core::state::{Dynamics, QuantityName};
    use nalgebra::UnitQuaternion;

    impl Kinematic {
        /// Declares the three; initialisers write them and their variances.
        pub(crate) fn declare(b: &mut Build<'_>) -> Result<Self, BuildError> {
            let place = b.origin.unwrap_or(Place {
                lat: 0.0,
                lon: 0.0,
                height: 0.0,
            });
            let slots = Slots::declare(b, state::POSITION, place)?;
            Ok(Self { slots })
        }
    }

    impl<P: Manifold> Slots<P> {
        /// Declares the position under this name, `velocity` and `attitude`; initialisers write them and
        /// their variances.
        pub(crate) fn declare(b: &mut Build<'_>, position: QuantityName<'_, P>, at: P::Value) -> Result<Self, BuildError> {
            let unset = vec![0.0; 3];
            Ok(Self {
                position: b.declare(position, "m", at, unset.clone(), Dynamics::Process)?,
                velocity: b.declare(state::VELOCITY, "m/s", Vector3::zeros(), unset.clone(), Dynamics::Process)?,
                attitude: b.declare(state::ATTITUDE, "rad", UnitQuaternion::identity(), unset, Dynamics::Process)?,
            })
        }
    }

    /// The power spectral density of white noise given as 1σ densities per axis.
    pub(crate) fn psd(densities: [f64; 3]) -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vector3::from(densities.map(|n| n * n)))
    }
}
