//! What the processes of inertial navigation have in common.

use super::strapdown::mechanisation::Nav;
use crate::block::{Build, BuildError};
use crate::vocabulary::state;
use fusion_core::geometry::wgs84::Geodetic as Place;
use fusion_core::state::{Attitude, Dynamics, Geodetic, Param, Slot, Vector, Velocity};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// The states `position`, `velocity` and `attitude`, which the process moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kinematic {
    pub(super) position: Slot<Geodetic>,
    pub(super) velocity: Slot<Velocity>,
    pub(super) attitude: Slot<Attitude>,
}

impl Kinematic {
    /// Declares the three; initialisers write them and their variances.
    pub(super) fn declare(b: &mut Build<'_>) -> Result<Self, BuildError> {
        let place = b.origin.unwrap_or(Place {
            lat: 0.0,
            lon: 0.0,
            height: 0.0,
        });
        let unset = vec![0.0; 3];
        Ok(Self {
            position: b.declare(state::POSITION, "m", place, unset.clone(), Dynamics::Process)?,
            velocity: b.declare(state::VELOCITY, "m/s", Vector3::zeros(), unset.clone(), Dynamics::Process)?,
            attitude: b.declare(state::ATTITUDE, "rad", UnitQuaternion::identity(), unset, Dynamics::Process)?,
        })
    }

    /// Reads them from state storage.
    pub(super) fn read(&self, x: &[f64]) -> Nav {
        Nav {
            position: self.position.read(x),
            v_eb_n: self.velocity.read(x),
            q_nb: self.attitude.read(x),
        }
    }

    /// Writes them into state storage.
    pub(super) fn write(&self, nav: &Nav, x: &mut [f64]) {
        self.position.write(&nav.position, x);
        self.velocity.write(&nav.v_eb_n, x);
        self.attitude.write(&nav.q_nb, x);
    }
}

/// The value of a parameter of a process. It is no signal: signals are what the process makes of
/// its parameters.
pub(super) fn value(param: &Param<Vector<3>>, x: &[f64]) -> Vector3<f64> {
    param.stored(x).unwrap_or_default()
}

/// The power spectral density of white noise given as 1σ densities per axis.
pub(super) fn psd(densities: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(densities.map(|n| n * n)))
}
