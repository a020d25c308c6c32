//! Range, bearing and depression of a transponder, as an ultra-short-baseline transceiver measures them.
//!
//! Measured   z = slant range r \[m\], bearing β from the transceiver's x towards y, depression δ below its
//!            x-y plane towards z \[rad\]
//! Predicted  s = C_usᵀ [C_snᵀ (r_e + C_nb l_t − p_s) − l_u],  ρ = √(s₁² + s₂²)
//!            r = (1 + κ)|s|,  β = atan2(s₂, s₁),  δ = atan2(s₃, ρ)
//!            p_s, C_sn pose of the vessel that carries the transceiver, l_u, C_us its place and mounting in the
//!            vessel, l_t the transponder in the body; κ = assumed over true speed of sound, less one
//! Vessel     a state that a sensor `vessel_pose` measures, so that errors of its GPS and gyrocompass count;
//!            or a fixed pose, as on a quay
//! Jacobian   exact by dual numbers, differences in Earth-centred axes
//! Residual   angles wrapped to (−π, π]
//! Valid      a straight path of sound; a transponder straight below has no bearing
//! Source     error budget of USBL chains; the derivative is tested by the law of sensors

use super::range::earth_centred;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Exact, ExactModel, ExactView, Literal, Measurement, Real, Size, Undefined};
use fusion_core::state::{Attitude, Geodetic, Param, Quantity, Scalar, Vector, View, wrap};
use nalgebra::Matrix3;

/// The place and attitude of the transceiver's carrier.
type Carrier = (Quantity<Geodetic>, Quantity<Attitude>);

/// The quantities on which range and direction depend.
#[derive(Debug, Literal)]
pub struct Geometry {
    position: Quantity<Geodetic>,
    attitude: Option<Quantity<Attitude>>,
    lever_arm: Param<Vector<3>>,
    carrier: Carrier,
    transceiver: Param<Vector<3>>,
    mounting: Param<Attitude>,
    sound_speed: Param<Scalar>,
}

impl ExactModel for Geometry {
    fn dim(&self) -> usize {
        3
    }

    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
        let l_n = self
            .attitude
            .as_ref()
            .map(|attitude| x.rotate(attitude, &x.vector(&self.lever_arm)));
        let from = x.geodetic(&self.carrier.0);
        let d_e = earth_centred(x.geodetic(&self.position), l_n) - earth_centred(from, None);
        let ((sp, cp), (sl, cl)) = (from[0].sin_cos(), from[1].sin_cos());
        let zero = D::from(0.0);
        // Earth-centred axes to north, east, down at the carrier.
        #[rustfmt::skip]
        let c_ne = Matrix3::new(
            -sp * cl, -sp * sl, cp,
            -sl, cl, zero,
            -cp * cl, -cp * sl, -sp,
        );
        let in_vessel = x.matrix(&self.carrier.1).transpose() * (c_ne * d_e) - x.vector(&self.transceiver);
        let s = x.matrix(&self.mounting).transpose() * in_vessel;
        let flat = s.x * s.x + s.y * s.y;
        if flat.re() < 1e-6 {
            return Err(Undefined("the transponder is straight below the transceiver and has no bearing"));
        }
        z[0] = (flat + s.z * s.z).sqrt() * (x.scalar(&self.sound_speed) + 1.0);
        z[1] = s.y.atan2(s.x);
        z[2] = s.z.atan2(flat.sqrt());
        Ok(())
    }

    literal!();
}

/// The runtime model: the geometry, and angles that wrap.
#[derive(Debug, Literal)]
pub struct Usbl(Exact<Geometry>);

impl Measurement for Usbl {
    fn size(&self) -> Size {
        self.0.size()
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        self.0.predict(at, value)
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        self.0.jacobian(at, h)
    }

    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        r[0] = z[0] - predicted[0];
        r[1] = wrap(z[1] - predicted[1]);
        r[2] = wrap(z[2] - predicted[2]);
    }

    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        z[0] += e[0];
        z[1] = wrap(z[1] + e[1]);
        z[2] = wrap(z[2] + e[2]);
    }

    literal!(0);
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::param::{RotationParam, ScalarParam, VectorParam};
    use crate::units::{Dimension, Dimensional, Place, dim};
    use crate::vocabulary::{channel, state};
    use fusion_core::state::QuantityName;
    use nalgebra::Vector3;
    use schemars::JsonSchema;

    /// Range, bearing and depression of a transponder on the body, from a transceiver on another vessel or at
    /// a fixed place.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct UsblSpec {
        /// The sensor `vessel_pose` of the vessel that carries the transceiver.
        vessel: Option<String>,
        /// The place of a fixed carrier of the transceiver, instead of `vessel`.
        position: Option<Place>,
        /// Roll, pitch, yaw of a fixed carrier.
        #[serde(default)]
        attitude: RotationParam,
        /// The transceiver in the axes of its carrier, from the carrier's position.
        #[serde(default)]
        transceiver: VectorParam<dim::Length>,
        /// Roll, pitch, yaw of the transceiver's axes in its carrier: x_carrier = C(mounting) x_transceiver.
        #[serde(default)]
        mounting: RotationParam,
        /// Transponder position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Scale error κ of the range: speed of sound assumed over that in the water, less one.
        #[serde(default)]
        sound_speed: ScalarParam<dim::Ratio>,
    }

    crate::register!(
        Sensor,
        "usbl",
        UsblSpec,
        r#"
position = { latitude = "36.0985 deg", longitude = "129.4505 deg", height = "2 m" }
attitude = [0, 0, "60 deg"]
transceiver = ["4 m", "-2 m", "3 m"]
mounting = { estimate = true, initial = [0, 0, "45 deg"], sigma = "1 deg" }
lever_arm = { estimate = true, initial = ["20 cm", 0, "-80 cm"], sigma = "5 cm" }
sound_speed = { estimate = true, initial = 0, sigma = "0.3 %", correlation_time = "1 h" }
"#
    );

    impl UsblSpec {
        pub(super) fn carrier(&self, b: &mut Build<'_>) -> Result<Carrier, BuildError> {
            match (&self.vessel, self.position) {
                (None, Some(place)) => Ok((Quantity::Fixed(place.into()), b.param("attitude", &self.attitude)?)),
                (Some(vessel), None) => {
                    let of = |part: &str| format!("{vessel}.{part}");
                    let missing = |e: BuildError| BuildError {
                        field: "vessel".to_owned(),
                        help: Some("name a sensor of type `vessel_pose` of this design".to_owned()),
                        ..e
                    };
                    let position = b.quantity(QuantityName::new(&of("position"))).map_err(missing)?;
                    Ok((position, b.quantity(QuantityName::new(&of("attitude"))).map_err(missing)?))
                }
                _ => {
                    let message = "the transceiver is carried by a `vessel`, or it stands at a `position`";
                    Err(BuildError::new(message).help("write one of the two"))
                }
            }
        }
    }

    #[typetag::deserialize(name = "usbl")]
    impl SensorSpec for UsblSpec {
        fn reading(&self) -> Reading {
            Reading::Channels(vec![channel::RANGE, channel::BEARING, channel::DEPRESSION])
        }

        fn noise(&self) -> Vec<Dimension> {
            let angle = dim::Angle::KIND.dimension;
            vec![dim::Length::KIND.dimension, angle, angle]
        }

        fn axes(&self) -> &'static [&'static str] {
            &["range", "bearing", "depression"]
        }

        fn follows(&self) -> Option<&str> {
            self.vessel.as_deref()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let carrier = self.carrier(b)?;
            let lever_arm = b.param("lever_arm", &self.lever_arm)?;
            let at_the_body = matches!(&lever_arm, Param::Fixed(l) if *l == Vector3::zeros());
            Ok(Box::new(Usbl(Exact(Geometry {
                position: b.quantity(state::POSITION)?,
                attitude: if at_the_body { None } else { Some(b.quantity(state::ATTITUDE)?) },
                lever_arm,
                carrier,
                transceiver: b.param("transceiver", &self.transceiver)?,
                mounting: b.param("mounting", &self.mounting)?,
                sound_speed: b.param("sound_speed", &self.sound_speed)?,
            }))))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::Build;
    use fusion_core::geometry::so3::from_rpy;
    use fusion_core::geometry::wgs84::Geodetic as At;
    use nalgebra::Vector3;

    /// The ship of a published chain: at its antenna, the transceiver (7, −3, 11) m from it.
    fn geometry(position: At, sound_speed: f64) -> Geometry {
        let ship = from_rpy(2f64.to_radians(), -1f64.to_radians(), 60f64.to_radians());
        Geometry {
            position: Quantity::Fixed(position),
            attitude: None,
            lever_arm: Param::Fixed(Vector3::zeros()),
            carrier: (
                Quantity::Fixed(At::new(36.098_277_778f64.to_radians(), 129.449_944_444f64.to_radians(), 10.0)),
                Quantity::Fixed(ship),
            ),
            transceiver: Param::Fixed(Vector3::new(7.0, -3.0, 11.0)),
            mounting: Param::Fixed(from_rpy(0.0, 0.0, 45f64.to_radians())),
            sound_speed: Param::Fixed(sound_speed),
        }
    }

    #[test]
    fn range_and_angles_are_those_of_the_worked_example() {
        // Spherical coordinates 40 m, 30°, 35° there: antenna to target (−16.33596, 26.60041, 35.18709) m.
        let target = At::new(36.098_130_555f64.to_radians(), 129.450_239_834f64.to_radians(), -25.187_09);
        let mut z = [0.0; 3];
        Exact(geometry(target, 0.0)).predict(&View::new(&[], &[]), &mut z).unwrap();
        // The example has 9 decimals of a degree, 1e-4 m, and a plane of the Earth, 2e-4 m at 50 m.
        let close = |a: f64, b: f64, tolerance: f64| assert!((a - b).abs() < tolerance, "{a} {b}");
        close(z[0], 40.0, 4e-4);
        close(z[1].to_degrees(), 30.0, 1e-3);
        close(z[2].to_degrees(), 35.0, 1e-3);
        let assumed = z[0];
        Exact(geometry(target, 0.005)).predict(&View::new(&[], &[]), &mut z).unwrap();
        close(z[0], 1.005 * assumed, 1e-12);
    }

    #[test]
    fn straight_below_there_is_no_bearing() {
        let mut below = geometry(At::new(36.098_277_778f64.to_radians(), 129.449_944_444f64.to_radians(), -20.0), 0.0);
        below.carrier.1 = Quantity::Fixed(from_rpy(0.0, 0.0, 1.0));
        below.transceiver = Param::Fixed(Vector3::zeros());
        assert!(Exact(below).predict(&View::new(&[], &[]), &mut [0.0; 3]).is_err());
    }

    #[test]
    fn the_transceiver_has_one_carrier() {
        let build = |text: &str| {
            let mut layout = fusion_core::state::LayoutBuilder::new();
            let mut build = Build {
                name: "usbl",
                layout: &mut layout,
                origin: None,
                gravity: crate::earth::Gravity::default(),
            };
            let built = toml::from_str::<UsblSpec>(text).unwrap().carrier(&mut build);
            built.map(|_| ()).map_err(|e| e.field)
        };
        assert_eq!(build("position = { latitude = 0.6, longitude = 2 }"), Ok(()));
        assert_eq!(build(""), Err(String::new()));
        assert_eq!(
            build("vessel = 'ship'\nposition = { latitude = 0.6, longitude = 2 }"),
            Err(String::new())
        );
        assert_eq!(build("vessel = 'ship'"), Err("vessel".to_owned()));
    }
}
