//! A measured attitude: an attitude reference, a star tracker, a motion-capture system.
//!
//! Measured   z = q_ns, body to navigation, of the sensor's axes s
//! Predicted  h(x) = q_nb ⊗ q_bs, q_bs the mounting: x_b = C_bs x_s
//! Residual   `part = "all"`         r = Log(h⁻¹ z) \[rad\], about the sensor's axes
//!            `part = "navigation"`  ε = Log(z h⁻¹), about north, east, down
//!            `part = "tilt"`        its north and east rows
//!            `part = "heading"`     its down row: a turn about the vertical, at any pitch
//! Jacobian   of `all`: ∂r/∂δφ_b = C_bsᵀ,  ∂r/∂δμ = I₃ for the mounting C_bs Exp(δμ);
//!            for the other parts: their rows of C_nb and of C_ns; exact at r = 0, beyond it to first order in r
//! Parts      for an attitude that is measured only in part: an attitude made from the vertical contains
//!            no heading, an attitude made from the magnetic field no tilt
//! Valid      white errors of the source. The output of a filter is not white: its sigma must include
//!            the correlated part, and the second use of the same gyros
//! Source     Sola, Deray, Atchuthan 2018 (arXiv 1812.01537), eqs. 66-71

use core::ops::Range;
use fusion_core::geometry::so3;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Manifold, Param, Quantity, View};
use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector4};

/// The measured part of an attitude.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq, Eq)]
#[cfg_attr(
    feature = "declare",
    derive(serde::Deserialize, schemars::JsonSchema),
    serde(rename_all = "snake_case")
)]
pub enum Part {
    /// The whole attitude: three rows, about the sensor's axes.
    #[default]
    All,
    /// The whole attitude: three rows, about north, east and down. An attitude reference states its accuracy so: level
    /// axes, and the heading.
    Navigation,
    /// Only the tilt: two rows, about north and east.
    Tilt,
    /// Only the heading: one row, about down.
    Heading,
}

impl Part {
    /// The navigation axes of the rows; `None` if the rows are about the sensor's axes.
    fn navigation_axes(self) -> Option<Range<usize>> {
        match self {
            Self::All => None,
            Self::Navigation => Some(0..3),
            Self::Tilt => Some(0..2),
            Self::Heading => Some(2..3),
        }
    }

    fn rows(self) -> usize {
        self.navigation_axes().map_or(3, |axes| axes.len())
    }
}

/// The unit quaternion of four numbers, of any length.
pub(super) fn unit(z: &[f64]) -> UnitQuaternion<f64> {
    so3::from_scalar_first(&Vector4::new(z[0], z[1], z[2], z[3]))
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct MeasuredAttitude {
    attitude: Quantity<Attitude>,
    mounting: Param<Attitude>,
    part: Part,
}

impl Measurement for MeasuredAttitude {
    fn size(&self) -> Size {
        Size {
            value: 4,
            residual: self.part.rows(),
        }
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        Attitude::write(&(at.get(&self.attitude) * at.get(&self.mounting)), value);
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let (q_nb, q_bs) = (at.get(&self.attitude), at.get(&self.mounting));
        match self.part {
            Part::All => {
                h.add(0, &self.attitude, &so3::rotation(&q_bs).transpose());
                h.add(0, &self.mounting, &Matrix3::identity());
            }
            Part::Navigation => {
                h.add(0, &self.attitude, &so3::rotation(&q_nb));
                h.add(0, &self.mounting, &so3::rotation(&(q_nb * q_bs)));
            }
            Part::Tilt => {
                h.add(0, &self.attitude, &so3::rotation(&q_nb).fixed_rows::<2>(0).into_owned());
                h.add(0, &self.mounting, &so3::rotation(&(q_nb * q_bs)).fixed_rows::<2>(0).into_owned());
            }
            Part::Heading => {
                h.add(0, &self.attitude, &so3::rotation(&q_nb).fixed_rows::<1>(2).into_owned());
                h.add(0, &self.mounting, &so3::rotation(&(q_nb * q_bs)).fixed_rows::<1>(2).into_owned());
            }
        }
        Ok(())
    }

    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        let (z, h) = (unit(z), unit(predicted));
        match self.part.navigation_axes() {
            None => r[..3].copy_from_slice(so3::log(&(h.inverse() * z)).as_slice()),
            Some(axes) => r[..axes.len()].copy_from_slice(&so3::log(&(z * h.inverse())).as_slice()[axes]),
        }
    }

    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        let mut turn = Vector3::zeros();
        let turned = match self.part.navigation_axes() {
            None => {
                turn.as_mut_slice().copy_from_slice(&e[..3]);
                unit(z) * so3::exp(&turn)
            }
            Some(axes) => {
                let rows = axes.len();
                turn.as_mut_slice()[axes].copy_from_slice(&e[..rows]);
                so3::exp(&turn) * unit(z)
            }
        };
        Attitude::write(&turned, z);
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, NED, Reading, SensorSpec, XYZ};
    use crate::de::DeserializeSpec;
    use crate::param::RotationParam;
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// Attitude as a quaternion, from an attitude reference or a motion-capture system.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct AttitudeSpec {
        /// Roll, pitch, yaw of the sensor's axes in the body: x_body = C(mounting) x_sensor.
        #[serde(default)]
        mounting: RotationParam,
        /// Which part of the attitude is measured.
        #[serde(default)]
        part: Part,
    }

    crate::register!(
        Sensor,
        "attitude",
        AttitudeSpec,
        r#"
mounting = { estimate = true, initial = [0, "1 deg", "30 deg"], sigma = "2 deg" }
"#
    );

    impl Part {
        fn axes(self) -> &'static [&'static str] {
            match self {
                Self::All => XYZ,
                Self::Navigation => NED,
                Self::Tilt => &["north", "east"],
                Self::Heading => &[],
            }
        }

        /// The channel with the 1σ of its rows.
        fn sigma(self) -> &'static str {
            match self {
                Self::All | Self::Navigation => "attitude_sigma",
                Self::Tilt => "tilt_sigma",
                Self::Heading => "heading_sigma",
            }
        }
    }

    #[typetag::deserialize(name = "attitude")]
    impl SensorSpec for AttitudeSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::ATTITUDE)
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Angle::KIND.dimension; self.part.rows()]
        }

        fn axes(&self) -> &'static [&'static str] {
            self.part.axes()
        }

        fn reported_sigma(&self) -> Option<Channel> {
            Some(Channel::vector(self.part.sigma(), self.part.rows(), dim::Angle::KIND.dimension))
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            Ok(Box::new(MeasuredAttitude {
                attitude: b.quantity(state::ATTITUDE)?,
                mounting: b.param("mounting", &self.mounting)?,
                part: self.part,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;
    use fusion_core::model::Input;
    use fusion_core::state::{Declaration, Dynamics, LayoutBuilder, StateRole};
    use fusion_core::testing::check_measurement;

    #[test]
    fn the_residual_is_the_turn_of_the_body_whatever_the_sign_of_the_quaternion() {
        let q = from_rpy(0.2, -0.4, 2.8);
        let model = MeasuredAttitude {
            attitude: Quantity::Fixed(q),
            mounting: Param::Fixed(from_rpy(0.0, 0.0, 1.0)),
            part: Part::All,
        };
        let (mut h, mut z, mut r) = ([0.0; 4], [0.0; 4], [0.0; 3]);
        model.predict(&View::new(&[], &[]), &mut h).unwrap();
        let turn = Vector3::new(0.1, -0.3, 0.2);
        Attitude::write(&(q * so3::exp(&turn) * from_rpy(0.0, 0.0, 1.0)), &mut z);
        for sign in [1.0, -1.0] {
            model.residual(&z.map(|v| sign * v), &h, &mut r);
            // As the sensor sees it, with axes a yaw of 1 rad away; 1e-15: rounding.
            let seen = from_rpy(0.0, 0.0, 1.0).inverse() * turn;
            assert!((Vector3::from(r) - seen).norm() < 1e-15, "{r:?}");
        }
    }

    #[test]
    fn a_part_of_an_attitude_obeys_the_laws_of_the_whole() {
        let mut layout = LayoutBuilder::new();
        let mut state = |name: &str| {
            let declared = Declaration {
                name: name.to_owned(),
                owner: String::new(),
                unit: "rad",
                initial: from_rpy(0.3, -1.2, 2.0),
                sigma: vec![0.1; 3],
                role: StateRole::Kinematic,
                dynamics: Dynamics::Constant,
            };
            layout.declare::<Attitude>(declared).unwrap()
        };
        let (attitude, mounting) = (Quantity::State(state("attitude")), Param::State(state("mounting")));
        let layout = layout.finish();
        for part in [Part::All, Part::Navigation, Part::Tilt, Part::Heading] {
            let model = MeasuredAttitude {
                attitude: attitude.clone(),
                mounting: mounting.clone(),
                part,
            };
            check_measurement(&layout, None, &model, layout.initial(), &Input::held(&[])).unwrap();
        }
    }

    #[test]
    fn a_tilt_says_nothing_of_the_heading_and_a_heading_nothing_of_the_tilt() {
        let q = from_rpy(0.2, -1.5, 2.8);
        let rows = |part, turn: Vector3<f64>| {
            let (mut h, mut z, mut r) = ([0.0; 4], [0.0; 4], [0.0; 3]);
            Attitude::write(&q, &mut h);
            Attitude::write(&(so3::exp(&turn) * q), &mut z);
            let model = MeasuredAttitude {
                attitude: Quantity::Fixed(q),
                mounting: Param::Fixed(UnitQuaternion::identity()),
                part,
            };
            model.residual(&z, &h, &mut r);
            r
        };
        // 1e-15: rounding; close to straight up, where only the sum of roll and yaw is defined.
        assert!(Vector3::from(rows(Part::Heading, Vector3::new(0.1, -0.2, 0.0))).amax() < 1e-15);
        assert!(Vector3::from(rows(Part::Tilt, Vector3::new(0.0, 0.0, 0.3))).amax() < 1e-15);
        assert!((Vector3::from(rows(Part::Tilt, Vector3::new(0.1, -0.2, 0.0))) - Vector3::new(0.1, -0.2, 0.0)).amax() < 1e-15);
        assert!((rows(Part::Heading, Vector3::new(0.0, 0.0, 0.3))[0] - 0.3).abs() < 1e-15);
        let turn = Vector3::new(0.1, -0.2, 0.3);
        assert!((Vector3::from(rows(Part::Navigation, turn)) - turn).amax() < 1e-15);
        assert_eq!(
            [Part::All, Part::Navigation, Part::Tilt, Part::Heading].map(Part::rows),
            [3, 3, 2, 1]
        );
    }
}
