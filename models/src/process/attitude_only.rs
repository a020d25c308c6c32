//! Attitude alone, from gyros: for a heading and attitude reference without position.
//!
//! Input      mean angular rate w_m \[rad/s\] over a sample, body axes
//! State      `attitude` q_nb; where estimated `gyro_bias` b,  w_ib_b = w_m − b
//! Discrete   q⁺ = Exp(−w_ie_n Δt) ⊗ q ⊗ Δq(w_ib_b Δt),  Φ_aa = C(Δq)ᵀ
//!            `exact`    Δq(v) = Exp(v),                Φ_ab = −Jr(v) Δt
//!            `literal`  Δq(v) = [1, ½v], normalised,   Φ_ab = −(I − ½[v ×]) Δt/(1 + ¼|v|²)
//!            Φ is exact for either: the literal step is q + q̇Δt, a turn of 2 atan(½|v|) about v
//! Q          trapezoid of white gyro noise on attitude
//! Signals    `angular_rate` w_ib_b \[rad/s\]
//! Valid      at a fixed latitude: the navigation frame turns with the Earth alone
//! Not here   coning: give the mean rate, or a sample rate far above the motion
//! Source     Sola, Deray, Atchuthan 2018 (arXiv 1812.01537), eqs. 139-145 for Jr; Shuster 1993,
//!            J. Astronaut. Sci. 41(4), for the rate of a Rodrigues vector

use crate::process::agility::Agility;
use crate::process::kinematic;
use alloc::vec::Vec;
use fusion_core::geometry::so3;
use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::model::{Gap, Input, Literal, Process, SignalsOut};
use fusion_core::state::{Attitude, Param, Signal, Slot, Vector};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// How a quaternion is integrated over a sample.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq, Eq)]
#[cfg_attr(
    feature = "declare",
    derive(serde::Deserialize, schemars::JsonSchema),
    serde(rename_all = "snake_case")
)]
pub enum Integration {
    /// q ⊗ Exp(wΔt).
    #[default]
    Exact,
    /// q + q̇Δt, normalised, as a paper prints it: a turn of 2 atan(½wΔt), too small by (wΔt)³/12.
    Literal,
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct AttitudeOnly {
    attitude: Slot<Attitude>,
    gyro_bias: Param<Vector<3>>,
    angular_rate: Signal<Vector<3>>,
    gyro_psd: Matrix3<f64>,
    w_ie_n: Vector3<f64>,
    integration: Integration,
    agility: Agility,
    /// By how much the numbers of a sample may change, and three that it does not have.
    changes: [f64; 6],
}

impl Integration {
    /// Δq of `turn` = wΔt \[rad\].
    fn step(self, turn: &Vector3<f64>) -> UnitQuaternion<f64> {
        match self {
            Self::Exact => so3::exp(turn),
            Self::Literal => so3::integrate_literal(&UnitQuaternion::identity(), turn, 1.0),
        }
    }

    /// The body-axes rotation that Δq gains by a change of `turn`, per unit of it.
    fn slope(self, turn: &Vector3<f64>) -> Matrix3<f64> {
        match self {
            Self::Exact => so3::right_jacobian(turn),
            Self::Literal => (Matrix3::identity() - so3::skew(turn) * 0.5) / (1.0 + 0.25 * turn.norm_squared()),
        }
    }
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
        let mut q = so3::exp(&(self.w_ie_n * -dt)) * self.attitude.read(x) * self.integration.step(&turn);
        q.renormalize();
        self.attitude.write(&q, x);
    }

    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let (a, turn) = (self.attitude, self.rate(x, input) * dt);
        out.set(a, a, &so3::rotation(&self.integration.step(&turn)).transpose());
        if let Param::State(bias) = &self.gyro_bias {
            out.set(a, *bias, &(self.integration.slope(&turn) * -dt));
        }
        out.noise_trapezoid(a, a, &(self.gyro_psd * dt));
    }

    fn agility(&self) -> &[f64] {
        &self.changes[..3]
    }

    fn motion(&self, x: &[f64], input: &Input<'_>, motion: &mut Vec<f64>) {
        let steady = self.attitude.read(x).inverse_transform_vector(&self.w_ie_n);
        motion.extend_from_slice((self.rate(x, input) - steady).as_slice());
    }

    fn coast(&self, x: &mut [f64], gap: &Gap, motion: &[f64], sample: &mut [f64], out: &mut Transition) -> bool {
        let (variance, bound) = self.agility.attitude(gap);
        out.noise_up_to(self.attitude, &variance, &bound);
        let fading = self.agility.fading(gap, motion);
        out.set(self.attitude, self.attitude, &so3::rotation(&fading.turn.inverse()));
        let q = self.attitude.read(x) * fading.turn;
        self.attitude.write(&q, x);
        let rate = q.inverse_transform_vector(&self.w_ie_n) + fading.w + kinematic::value(&self.gyro_bias, x);
        sample.copy_from_slice(rate.as_slice());
        true
    }

    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        out.set(self.angular_rate, &self.rate(x, input));
        out.add_quantity(self.angular_rate, &self.gyro_bias, &-Matrix3::identity());
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, ProcessSpec};
    use crate::de::DeserializeSpec;
    use crate::earth::rates::earth_rate_n;
    use crate::param::VectorParam;
    use crate::process::agility::AgilitySpec;
    use crate::units::{Axes, Latitude, dim, range};
    use crate::vocabulary::{channel, state};
    use fusion_core::state::Dynamics;
    use schemars::JsonSchema;

    /// Attitude alone, from gyros: states attitude and, where declared, gyro bias; driven by the
    /// channel `angular_rate` of its source.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct AttitudeOnlySpec {
        /// White noise of the rate: the angle random walk, e.g. "0.1 deg/sqrt(s)".
        gyro_noise: Axes<dim::AngleRandomWalk, range::NonNegative>,
        /// Gyro bias; estimated as the state `gyro_bias`.
        #[serde(default)]
        gyro_bias: VectorParam<dim::AngularRate>,
        /// Latitude, for the Earth's rotation; that of the origin, or no rotation, where absent.
        latitude: Option<Latitude>,
        /// How the quaternion is integrated.
        #[serde(default)]
        integration: Integration,
        /// How fast the vehicle can change its motion, for gaps and spikes of the samples.
        #[serde(default)]
        agility: AgilitySpec,
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
                gyro_bias: b.body_param(state::GYRO_BIAS, "gyro_bias", &self.gyro_bias)?,
                angular_rate: b.signal(state::ANGULAR_RATE)?,
                gyro_psd: kinematic::psd(self.gyro_noise.si()),
                w_ie_n: lat.map_or_else(Vector3::zeros, earth_rate_n),
                integration: self.integration,
                agility: (&self.agility).into(),
                changes: Agility::from(&self.agility).changes(),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, ProcessSpec};
    use crate::earth::rates::earth_rate_n;
    use fusion_core::state::{Layout, LayoutBuilder};
    use fusion_core::testing::check_process;
    use nalgebra::Vector4;

    fn built(toml: &str) -> (Layout, Box<dyn Process>) {
        let mut layout = LayoutBuilder::new();
        let spec: AttitudeOnlySpec = toml::from_str(toml).unwrap();
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin: None,
            gravity: crate::earth::Gravity::default(),
        };
        let process = spec.build(&mut build).unwrap();
        (layout.finish(), process)
    }

    #[test]
    fn a_body_at_rest_on_the_earth_keeps_its_attitude() {
        let (_, process) = built("gyro_noise = 0\nlatitude = \"36 deg\"");
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

    #[test]
    fn literal_integration_is_the_printed_step_and_linearised_as_exactly_as_the_other() {
        let bias = "gyro_bias = { estimate = true, initial = [0.1, 0, 0], sigma = 0.01 }";
        let (layout, process) = built(&format!("gyro_noise = 1e-3\nintegration = \"literal\"\n{bias}"));
        let (q, dt) = (so3::from_rpy(0.4, -0.3, 2.0), 0.1);
        // Half a radian per step: Exp would be 0.01 rad away.
        let rate = Vector3::new(3.1, -2.0, 4.0);
        let input = Input::held(rate.as_slice());
        let mut x = [q.w, q.i, q.j, q.k, 0.1, 0.0, 0.0];
        check_process(&layout, process.as_ref(), &x, &input, dt).unwrap();
        process.propagate(&mut x, &input, dt);
        let after = so3::from_scalar_first(&Vector4::new(x[0], x[1], x[2], x[3]));
        let printed = so3::integrate_literal(&q, &Vector3::new(3.0, -2.0, 4.0), dt);
        assert!(so3::log(&(printed.inverse() * after)).norm() < 1e-15); // rounding
    }
}
