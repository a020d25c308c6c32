//! GNSS position with an antenna lever arm and a slow error.
//!
//! Measured   z = geodetic position of the antenna a: latitude, longitude \[rad\], height \[m\]
//! Predicted  h(x) = r_eb ⊕ (C_nb l_ba_b + b), ⊕ in metres NED at r_eb
//! Jacobian   ∂h/∂δr = I₃,  ∂h/∂δφ_b = −C_nb [l_ba_b ×],  ∂h/∂δl = C_nb,
//!            ∂h/∂δb = I₃
//! Valid      rigid mount; metres at the antenna for metres at the body, 1 part in 10⁶ per metre
//! Not here   multipath (a gate or a loss), the receiver's clock
//! Source     Groves 2013, §14.3.1

use fusion_core::geometry::so3::{rotation, times_skew};
use fusion_core::geometry::wgs84::Geodetic as Place;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Geodetic, Manifold, Param, Quantity, Vector, View};
use nalgebra::{Matrix3, Vector3};

/// The runtime model: a fix of a point of the body, its first `rows` of north, east, down.
#[derive(Debug, Literal)]
pub struct Fix {
    position: Quantity<Geodetic>,
    attitude: Option<Quantity<Attitude>>,
    lever_arm: Param<Vector<3>>,
    bias: Param<Vector<3>>,
    rows: usize,
    /// Numbers of the measurement: latitude, longitude, and the height if it has one.
    values: usize,
}

impl Fix {
    /// A measured or predicted place; on the ellipsoid if its height is not known.
    fn place(&self, numbers: &[f64]) -> Place {
        let mut place = [0.0; 3];
        place[..self.values].copy_from_slice(&numbers[..self.values]);
        Geodetic::read(&place)
    }

    /// The factors north, east, down of a residual without a height: an arc on the ellipsoid below, divided by the same
    /// arc at the body.
    fn below(&self, at: &View<'_>) -> Option<Matrix3<f64>> {
        if self.values == 3 {
            return None;
        }
        let place = at.get(&self.position);
        let below = Place { height: 0.0, ..place };
        let ((north, east), (north_below, east_below)) = (place.metres_per_radian(), below.metres_per_radian());
        Some(Matrix3::from_diagonal(&Vector3::new(north_below / north, east_below / east, 1.0)))
    }

    /// Adds the blocks of H, each as `seen` in the residual.
    fn linearise(&self, at: &View<'_>, h: &mut Jacobian, seen: impl Fn(Matrix3<f64>) -> Matrix3<f64>) {
        h.add(0, &self.position, &seen(Matrix3::identity()));
        h.add(0, &self.bias, &seen(Matrix3::identity()));
        if let Some(attitude) = &self.attitude {
            let c_nb = rotation(&at.get(attitude));
            h.add(0, attitude, &seen(-times_skew(&c_nb, &at.get(&self.lever_arm))));
            h.add(0, &self.lever_arm, &seen(c_nb));
        }
    }

    fn write(&self, place: &Place, numbers: &mut [f64]) {
        let mut all = [0.0; 3];
        Geodetic::write(place, &mut all);
        numbers.copy_from_slice(&all[..self.values]);
    }
}

impl Measurement for Fix {
    fn size(&self) -> Size {
        Size {
            value: self.values,
            residual: self.rows,
        }
    }

    fn reads_signals(&self) -> bool {
        let attitude = self.attitude.as_ref().and_then(Quantity::place);
        let places = [self.position.place(), attitude, self.lever_arm.place(), self.bias.place()];
        places.into_iter().flatten().any(|(_, is_signal)| is_signal)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let mut offset = at.get(&self.bias);
        if let Some(attitude) = &self.attitude {
            offset += at.get(attitude) * at.get(&self.lever_arm);
        }
        self.write(&at.get(&self.position).offset(&offset), value);
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        match self.below(at) {
            None => self.linearise(at, h, |block| block),
            Some(below) => self.linearise(at, h, |block| below * block),
        }
        Ok(())
    }

    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        let d = self.place(z).difference(&self.place(predicted));
        r.copy_from_slice(&d.as_slice()[..self.rows]);
    }

    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        let mut d = Vector3::zeros();
        d.as_mut_slice()[..self.rows].copy_from_slice(e);
        self.write(&self.place(z).offset(&d), z);
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, NED, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::VectorParam;
    use crate::units::{Dimension, Dimensional, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// GNSS position with an antenna lever arm and a correlated error.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct GnssPositionSpec {
        /// Antenna position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Correlated position error, north east down; give it a `correlation_time`.
        #[serde(default)]
        bias: VectorParam<dim::Length>,
        /// Use north and east only.
        #[serde(default)]
        horizontal: bool,
    }

    crate::register!(
        Sensor,
        "gnss_position",
        GnssPositionSpec,
        r#"
lever_arm = { estimate = true, initial = [0.1, -0.2, "-1 m"], sigma = "20 cm" }
bias = { estimate = true, initial = [0, 0, 0], sigma = "1 m", correlation_time = "100 s" }
"#
    );

    #[typetag::deserialize(name = "gnss_position")]
    impl SensorSpec for GnssPositionSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::POSITION)
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Length::KIND.dimension; self.axes().len()]
        }

        fn axes(&self) -> &'static [&'static str] {
            if self.horizontal { &NED[..2] } else { NED }
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            Ok(Box::new(Fix::build(b, &self.lever_arm, &self.bias, self.axes().len())?))
        }
    }

    impl Fix {
        pub(crate) fn build(
            b: &mut Build<'_>,
            lever_arm: &VectorParam<dim::Length>,
            bias: &VectorParam<dim::Length>,
            rows: usize,
        ) -> Result<Self, BuildError> {
            let lever_arm = b.param("lever_arm", lever_arm)?;
            let fixed_at_the_body = matches!(&lever_arm, Param::Fixed(l) if *l == Vector3::zeros());
            Ok(Self {
                position: b.quantity(state::POSITION)?,
                // A process without an attitude serves an antenna at the body origin.
                attitude: if fixed_at_the_body {
                    None
                } else {
                    Some(b.quantity(state::ATTITUDE)?)
                },
                lever_arm,
                bias: b.param("bias", bias)?,
                rows,
                values: 3,
            })
        }

        /// For latitude and longitude alone.
        pub(crate) fn without_height(
            b: &mut Build<'_>,
            lever_arm: &VectorParam<dim::Length>,
            bias: &VectorParam<dim::Length>,
        ) -> Result<Self, BuildError> {
            let fix = Self::build(b, lever_arm, bias, 2)?;
            Ok(Self { values: 2, ..fix })
        }
    }
}
