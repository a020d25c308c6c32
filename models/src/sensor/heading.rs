//! Heading from a compass, a dual-antenna receiver or a gyrocompass.
//!
//! Measured   z = heading \[rad\], clockwise from the sensor's north
//! Predicted  h(x) = μ + b + s₁ sin μ + c₁ cos μ + s₂ sin 2μ + c₂ cos 2μ,  μ = ψ − D the magnetic heading,
//!            ψ = atan2(C21, C11), D declination. b and the coefficients are the deviation of the compass with the
//!            sign of an error: hard iron causes s₁ and c₁, soft iron s₂ and c₂. The coefficients A … E of a
//!            deviation card, which is added to the compass, have the opposite sign
//! Jacobian   ∂h/∂ψ = k = 1 + s₁ cos μ − c₁ sin μ + 2 s₂ cos 2μ − 2 c₂ sin 2μ;
//!            ∂ψ/∂δφ_b = [0, C32, C33]/(C11² + C21²);  ∂h/∂b = 1,  ∂h/∂s₁ = sin μ and so on
//! Residual   wrapped to (−π, π]
//! Valid      away from gimbal lock, |C31| ≤ 0.9999
//! Not here   tilt compensation of raw magnetometers; deviation by heel, and by magnetic latitude
//! Source     the derivative of atan2 with C ← C (I + [δφ_b ×]); deviation: NGA, Handbook of Magnetic Compass
//!            Adjustment, 2004, ch. VI

use fusion_core::geometry::so3::{GIMBAL_LOCK_C31, rotation};
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Angle, Attitude, Param, Quantity, Scalar, View, wrap};
use nalgebra::{Matrix1, Matrix3, RowVector3};

/// ψ and ∂ψ/∂δφ_b of an attitude `c_nb`; undefined if the nose points straight up or down.
fn yaw(c_nb: &Matrix3<f64>) -> Result<(f64, RowVector3<f64>), Undefined> {
    if c_nb[(2, 0)].abs() > GIMBAL_LOCK_C31 {
        return Err(Undefined("the nose points straight up or down and has no heading"));
    }
    let (north, east) = (c_nb[(0, 0)], c_nb[(1, 0)]);
    let slope = RowVector3::new(0.0, c_nb[(2, 1)], c_nb[(2, 2)]) / (north * north + east * east);
    Ok((math::atan2(east, north), slope))
}

/// Where the heading comes from.
#[derive(Debug, Literal)]
pub enum Source {
    /// The yaw of an attitude.
    Attitude(Quantity<Attitude>),
    /// A heading.
    Heading(Quantity<Angle>),
}

/// Coefficients of sin μ, cos μ, sin 2μ, cos 2μ \[rad\].
#[derive(Debug, Literal)]
pub struct Deviation([Param<Scalar>; 4]);

impl Deviation {
    /// The factor of each coefficient at this magnetic heading.
    fn waves(magnetic: f64) -> [f64; 4] {
        let ((s, c), (s_2, c_2)) = (math::sin_cos(magnetic), math::sin_cos(2.0 * magnetic));
        [s, c, s_2, c_2]
    }

    /// The deviation, and its derivative by the heading.
    fn at(&self, at: &View<'_>, magnetic: f64) -> (f64, f64) {
        let [k_s, k_c, k_s_2, k_c_2] = self.0.each_ref().map(|k| at.get(k));
        let [s, c, s_2, c_2] = Self::waves(magnetic);
        let value = k_s * s + k_c * c + k_s_2 * s_2 + k_c_2 * c_2;
        (value, k_s * c - k_c * s + 2.0 * (k_s_2 * c_2 - k_c_2 * s_2))
    }
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Heading {
    heading: Source,
    bias: Param<Scalar>,
    deviation: Option<Deviation>,
    declination: f64,
}

impl Heading {
    /// The true heading.
    fn psi(&self, at: &View<'_>) -> Result<f64, Undefined> {
        match &self.heading {
            Source::Attitude(attitude) => Ok(yaw(&rotation(&at.get(attitude)))?.0),
            Source::Heading(heading) => Ok(at.get(heading)),
        }
    }
}

impl Measurement for Heading {
    fn size(&self) -> Size {
        Size::same(1)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let magnetic = self.psi(at)? - self.declination;
        let deviation = self.deviation.as_ref().map_or(0.0, |d| d.at(at, magnetic).0);
        value[0] = wrap(magnetic + at.get(&self.bias) + deviation);
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let mut slope = 1.0;
        if let Some(deviation) = &self.deviation {
            let magnetic = self.psi(at)? - self.declination;
            slope += deviation.at(at, magnetic).1;
            for (coefficient, wave) in deviation.0.iter().zip(Deviation::waves(magnetic)) {
                h.add(0, coefficient, &Matrix1::new(wave));
            }
        }
        match &self.heading {
            Source::Attitude(attitude) => h.add(0, attitude, &(yaw(&rotation(&at.get(attitude)))?.1 * slope)),
            Source::Heading(heading) => h.add(0, heading, &Matrix1::new(slope)),
        }
        h.add(0, &self.bias, &Matrix1::new(1.0));
        Ok(())
    }

    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        r[0] = wrap(z[0] - predicted[0]);
    }

    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        z[0] = wrap(z[0] + e[0]);
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::ScalarParam;
    use crate::units::{self, Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Heading, clockwise from north, with declination and deviation.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct HeadingSpec {
        /// Heading bias, clockwise positive: the constant part of the deviation, misalignment.
        #[serde(default)]
        bias: ScalarParam<dim::Angle>,
        /// Deviation that depends on the heading.
        #[serde(default)]
        deviation: DeviationSpec,
        /// Magnetic declination: direction of the sensor's north, clockwise from true north.
        #[serde(default)]
        declination: units::Angle,
    }

    /// The error of a compass, in addition to its bias, as a function of the magnetic heading: the effect of the vehicle's
    /// own field. It is identifiable if the vehicle turns through all headings.
    #[derive(Debug, Default, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct DeviationSpec {
        /// Factor of the sine of the heading: hard iron, and its part ahead.
        #[serde(default)]
        sin: ScalarParam<dim::Angle>,
        /// Factor of the cosine of the heading: hard iron to the right.
        #[serde(default)]
        cos: ScalarParam<dim::Angle>,
        /// Factor of the sine of twice the heading: soft iron.
        #[serde(default)]
        sin_2: ScalarParam<dim::Angle>,
        /// Factor of the cosine of twice the heading.
        #[serde(default)]
        cos_2: ScalarParam<dim::Angle>,
    }

    crate::register!(
        Sensor,
        "heading",
        HeadingSpec,
        r#"
bias = { estimate = true, initial = 0, sigma = "2 deg", correlation_time = "300 s" }
deviation = { sin = { estimate = true, initial = 0, sigma = "3 deg" }, cos = { estimate = true, initial = 0, sigma = "3 deg" }, cos_2 = "0.5 deg" }
declination = "-8 deg"
"#
    );

    #[typetag::deserialize(name = "heading")]
    impl SensorSpec for HeadingSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::HEADING)
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Angle::KIND.dimension]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            // A planar process that estimates its heading provides it directly.
            let heading = match b.quantity(state::HEADING) {
                Ok(heading) => Source::Heading(heading),
                Err(_) => Source::Attitude(b.quantity(state::ATTITUDE)?),
            };
            Ok(Box::new(Heading {
                heading,
                bias: b.param("bias", &self.bias)?,
                deviation: Deviation::build(b, &self.deviation)?,
                declination: self.declination.si(),
            }))
        }
    }

    impl Deviation {
        /// `None` if there is no deviation.
        fn build(b: &mut Build<'_>, spec: &DeviationSpec) -> Result<Option<Self>, BuildError> {
            let all = [
                b.param("deviation.sin", &spec.sin)?,
                b.param("deviation.cos", &spec.cos)?,
                b.param("deviation.sin_2", &spec.sin_2)?,
                b.param("deviation.cos_2", &spec.cos_2)?,
            ];
            let is_none = |p: &Param<Scalar>| matches!(p, Param::Fixed(c) if *c == 0.0);
            Ok((!all.iter().all(is_none)).then_some(Self(all)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;

    fn compass(roll: f64, pitch: f64, yaw: f64) -> Heading {
        let attitude = Source::Attitude(Quantity::Fixed(from_rpy(roll, pitch, yaw)));
        Heading {
            heading: attitude,
            bias: Param::Fixed(0.02),
            deviation: None,
            declination: -0.1,
        }
    }

    #[test]
    fn the_magnetic_heading_lacks_the_declination() {
        let mut z = [0.0];
        compass(0.3, -0.4, 1.0).predict(&View::new(&[], &[]), &mut z).unwrap();
        assert!((z[0] - 1.12).abs() < 1e-15); // rounding
    }

    #[test]
    fn hard_iron_ahead_shows_on_east_and_west_and_to_the_right_on_north_and_south() {
        let read = |magnetic: f64, iron: [f64; 4]| {
            let mut compass = compass(0.0, 0.0, magnetic - 0.1);
            compass.deviation = Some(Deviation(iron.map(Param::Fixed)));
            let mut z = [0.0];
            compass.predict(&View::new(&[], &[]), &mut z).unwrap();
            wrap(z[0] - magnetic - 0.02)
        };
        let (quarter, pi) = (core::f64::consts::FRAC_PI_2, core::f64::consts::PI);
        // 1e-15: rounding.
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        let (ahead, right, soft) = ([0.03, 0.0, 0.0, 0.0], [0.0, 0.04, 0.0, 0.0], [0.0, 0.0, 0.0, 0.01]);
        near(read(quarter, ahead), 0.03);
        near(read(-quarter, ahead), -0.03);
        near(read(0.0, right), 0.04);
        near(read(pi, right), -0.04);
        near(read(quarter, soft), -0.01);
        near(read(pi, soft), 0.01);
    }

    #[test]
    fn the_residual_takes_the_short_way_round() {
        let mut r = [0.0];
        compass(0.0, 0.0, 0.0).residual(&[-3.1], &[3.1], &mut r);
        assert!((r[0] - (core::f64::consts::TAU - 6.2)).abs() < 1e-15); // rounding
    }

    #[test]
    fn straight_up_there_is_no_heading() {
        let up = compass(0.0, 1.57, 0.5);
        assert!(up.predict(&View::new(&[], &[]), &mut [0.0]).is_err());
    }

    #[test]
    fn the_slope_is_that_of_the_navigation_frame_error_form() {
        // ψ̂ − ψ = H_ε ε, H_ε = [C31 C11, C31 C21, −ρ²]/ρ², for Ĉ = (I − [ε×])C, so ε = C δφ_b.
        let c = rotation(&from_rpy(0.4, -0.9, 2.5));
        let rho2 = c[(0, 0)].powi(2) + c[(1, 0)].powi(2);
        let by_epsilon = RowVector3::new(c[(2, 0)] * c[(0, 0)], c[(2, 0)] * c[(1, 0)], -rho2) / rho2;
        // 1e-15: products of direction cosines.
        assert!((yaw(&c).unwrap().1 - by_epsilon * -c).amax() < 1e-15);
    }
}
