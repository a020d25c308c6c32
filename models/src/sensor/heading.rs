//! Heading from a compass, a dual-antenna receiver or a gyrocompass.
//!
//! Measured   z = heading \[rad\], clockwise from the sensor's north
//! Predicted  h(x) = ψ − D + b,  ψ = atan2(C21, C11), D declination, b deviation
//! Jacobian   ∂ψ/∂δφ_b = [0, C32, C33]/(C11² + C21²),  ∂h/∂b = 1;
//!            with an estimated heading ∂h/∂ψ = 1
//! Residual   wrapped to (−π, π]
//! Valid      away from gimbal lock, |C31| ≤ 0.9999
//! Not here   tilt compensation of raw magnetometers
//! Source     the derivative of atan2 with C ← C (I + [δφ_b ×])

use crate::block::{Build, BuildError, Reading, SensorSpec};
use crate::param::ScalarParam;
use crate::units::{self, Dimension, Dimensional, dim};
use crate::vocabulary::{channel, state};
use fusion_core::geometry::so3::{GIMBAL_LOCK_C31, rotation};
use fusion_core::linear::Jacobian;
use fusion_core::model::{Measurement, Size, Undefined};
use fusion_core::state::{Angle, Attitude, Param, Quantity, Scalar, View, wrap};
use nalgebra::{Matrix1, Matrix3, RowVector3};
use schemars::JsonSchema;
use serde::Deserialize;

/// ψ and ∂ψ/∂δφ_b of an attitude `c_nb`; undefined where the nose points straight up or down.
fn yaw(c_nb: &Matrix3<f64>) -> Result<(f64, RowVector3<f64>), Undefined> {
    if c_nb[(2, 0)].abs() > GIMBAL_LOCK_C31 {
        return Err(Undefined("the nose points straight up or down and has no heading"));
    }
    let (north, east) = (c_nb[(0, 0)], c_nb[(1, 0)]);
    let slope = RowVector3::new(0.0, c_nb[(2, 1)], c_nb[(2, 2)]) / (north * north + east * east);
    Ok((east.atan2(north), slope))
}

/// Heading, clockwise from north, with declination and deviation.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeadingSpec {
    /// Heading bias, clockwise positive: deviation, misalignment.
    #[serde(default)]
    bias: ScalarParam<dim::Angle>,
    /// Magnetic declination: direction of the sensor's north, clockwise from true north.
    #[serde(default)]
    declination: units::Angle,
}

crate::register!(
    Sensor,
    "heading",
    HeadingSpec,
    r#"
bias = { estimate = true, initial = 0, sigma = "2 deg", correlation_time = "300 s" }
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
        // A planar process that estimates its heading knows it best.
        let heading = match b.quantity(state::HEADING) {
            Ok(heading) => Source::Heading(heading),
            Err(_) => Source::Attitude(b.quantity(state::ATTITUDE)?),
        };
        Ok(Box::new(Heading {
            heading,
            bias: b.param("bias", &self.bias)?,
            declination: self.declination.si(),
        }))
    }
}

/// Where the heading comes from.
#[derive(Debug)]
enum Source {
    Attitude(Quantity<Attitude>),
    Heading(Quantity<Angle>),
}

/// The runtime model.
#[derive(Debug)]
struct Heading {
    heading: Source,
    bias: Param<Scalar>,
    declination: f64,
}

impl Measurement for Heading {
    fn size(&self) -> Size {
        Size::same(1)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let psi = match &self.heading {
            Source::Attitude(attitude) => yaw(&rotation(&at.get(attitude)))?.0,
            Source::Heading(heading) => at.get(heading),
        };
        value[0] = wrap(psi - self.declination + at.get(&self.bias));
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        match &self.heading {
            Source::Attitude(attitude) => h.add(0, attitude, &yaw(&rotation(&at.get(attitude)))?.1),
            Source::Heading(heading) => h.add(0, heading, &Matrix1::new(1.0)),
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
