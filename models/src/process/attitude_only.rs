//! Attitude alone, from gyros: for a heading and attitude reference without position.
//!
//! Input      mean angular rate w_m \[rad/s\] over a sample, body axes
//! State      `attitude` q_nb; where estimated `gyro_bias` b,  w_ib_b = w_m − b
//! Discrete   q⁺ = Exp(−w_ie_n Δt) ⊗ q ⊗ Exp(w_ib_b Δt)
//!            Φ_aa = Exp(w_ib_b Δt)ᵀ,  Φ_ab = −Jr(w_ib_b Δt) Δt: exact
//! Q          trapezoid of white gyro noise on attitude
//! Signals    `angular_rate` w_ib_b \[rad/s\]
//! Valid      at a fixed latitude: the navigation frame turns with the Earth alone
//! Not here   coning: give the mean rate, or a sample rate far above the motion
//! Source     Sola, Deray, Atchuthan 2018 (arXiv 1812.01537), eqs. 139-145 for Jr

use crate::block::{Build, BuildError, Channel, ProcessSpec};
use crate::earth::rates::earth_rate_n;
use crate::param::VectorParam;
use crate::process::kinematic;
use crate::units::{Axes, Latitude, dim, range};
use crate::vocabulary::{channel, state};
use fusion_core::geometry::so3;
use fusion_core::linear::Transition;
use fusion_core::model::{Input, Process, SignalsOut};
use fusion_core::state::{Attitude, Dynamics, Param, Signal, Slot, Vector};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

/// Attitude alone, from gyros: states attitude and, where declared, gyro bias; driven by the
/// channel `angular_rate` of its source.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AttitudeOnlySpec {
    /// White noise of the rate: the angle random walk, e.g. "0.1 deg/sqrt(s)".
    gyro_noise: Axes<dim::AngleRandomWalk, range::NonNegative>,
    /// Gyro bias; estimated as the state `gyro_bias`.
    #[serde(default)]
    gyro_bias: VectorParam<dim::AngularRate>,
    /// Latitude, for the Earth's rotation; that of the origin, or no rotation, where absent.
    latitude: Option<Latitude>,
}

crate::register!(
    Process,
    "attitude_only",
    AttitudeOnlySpec,
    r#"
gyro_noise = "0.1 deg/sqrt(s)"
gyro_bias = { estimate = true, initial = [0.01, 0, 0], sigma = "0.5 deg/s", random_walk = "1e-4 deg/s/sqrt(s)" }
latitude = "36.1 deg"
"#
);

#[typetag::deserialize(name = "attitude_only")]
impl ProcessSpec for AttitudeOnlySpec {
    fn input(&self) -> Vec<Channel> {
        vec![channel::ANGULAR_RATE]
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
        let lat = self.latitude.map(|l| l.si()).or(b.origin.map(|o| o.lat));
        let unset = vec![0.0; 3];
        Ok(Box::new(AttitudeOnly {
            attitude: b.declare(state::ATTITUDE, "rad", UnitQuaternion::identity(), unset, Dynamics::Process)?,
            gyro_bias: b.param_named(state::GYRO_BIAS, "gyro_bias", &self.gyro_bias)?,
            angular_rate: b.signal(state::ANGULAR_RATE)?,
            gyro_psd: kinematic::psd(self.gyro_noise.si()),
            w_ie_n: lat.map_or_else(Vector3::zeros, earth_rate_n),
        }))
    }
}

/// The runtime model.
#[derive(Debug)]
struct AttitudeOnly {
    attitude: Slot<Attitude>,
    gyro_bias: Param<Vector<3>>,
    angular_rate: Signal<Vector<3>>,
    gyro_psd: Matrix3<f64>,
    w_ie_n: Vector3<f64>,
}

impl AttitudeOnly {
    /// w_ib_b.
    fn rate(&self, x: &[f64], input: &Input<'_>) -> Vector3<f64> {
        Vector3::from_column_slice(&input.sample[..3]) - kinematic::value(&self.gyro_bias, x)
    }
}

impl Process for AttitudeOnly {
    fn input_dim(&self) -> usize {
        3
    }

    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let turn = self.rate(x, input) * dt;
        let mut q = so3::exp(&(self.w_ie_n * -dt)) * self.attitude.read(x) * so3::exp(&turn);
        q.renormalize();
        self.attitude.write(&q, x);
    }

    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let (a, turn) = (self.attitude, self.rate(x, input) * dt);
        out.set(a, a, &so3::rotation(&so3::exp(&turn)).transpose());
        if let Param::State(bias) = &self.gyro_bias {
            out.set(a, *bias, &(so3::right_jacobian(&turn) * -dt));
        }
        out.noise_trapezoid(a, a, &(self.gyro_psd * dt));
    }

    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        out.set(self.angular_rate, &self.rate(x, input));
        out.add_quantity(self.angular_rate, &self.gyro_bias, &-Matrix3::identity());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::state::LayoutBuilder;

    #[test]
    fn a_body_at_rest_on_the_earth_keeps_its_attitude() {
        let mut layout = LayoutBuilder::new();
        let spec: AttitudeOnlySpec = toml::from_str("gyro_noise = 0\nlatitude = \"36 deg\"").unwrap();
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin: None,
            gravity: crate::earth::Gravity::default(),
        };
        let process = spec.build(&mut build).unwrap();
        let q = so3::from_rpy(0.4, -0.3, 2.0);
        let rate = q.inverse() * earth_rate_n(36_f64.to_radians());
        let mut x = [q.w, q.i, q.j, q.k];
        for _ in 0..3600 {
            process.propagate(&mut x, &Input::held(rate.as_slice()), 1.0);
        }
        let after = so3::from_scalar_first(&x.into());
        // An hour, 15° of the Earth's turning; 1e-12: rounding of 3600 steps.
        assert!(so3::log(&(q.inverse() * after)).norm() < 1e-12);
    }
}
