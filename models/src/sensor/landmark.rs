//! Landmarks at known places, seen from the body: a camera, a laser scanner, a radar with reflectors.
//!
//! Seen       y_i = C_nbᵀ (r_i − r) − l, from the sensor at l to landmark i, body axes \[m\], where r is
//!            the position of the body, r_i that of the landmark
//! Measured   of each landmark `vector` z = y, or `bearing_range` z = \[α, ε, ρ\]: azimuth
//!            α = atan2(y_y, y_x), clockwise from ahead, elevation ε = atan2(−y_z, √(y_x² + y_y²)), up
//!            \[rad\], range ρ = |y| \[m\]; one landmark after the other, in one measurement
//! Jacobian   ∂y/∂δr = −C_nbᵀ (I + \[d×\] W), d = r_i − r in the axes n, W the turn of those axes by a
//!            move over the ellipsoid \[rad/m\], 0 on a plane; ∂y/∂δφ_b = \[C_nbᵀ d ×\], ∂y/∂l = −I;
//!            bearing and range by the chain rule
//! Residual   azimuth and elevation wrapped to (−π, π]
//! Valid      which landmark is which is known, and all of them are seen together: a landmark that is sometimes
//!            hidden is a separate sensor. At the sensor there is no bearing, straight above it no azimuth
//! Not here   refraction, the mounting of the sensor's axes
//! Source     the derivatives of C_nb ← C_nb Exp(δφ_b); Barrau and Bonnabel 2017, §V

use crate::earth::LocalEarth;
use crate::earth::frames::{ecef_from_geodetic, rotation_en};
use alloc::vec::Vec;
use fusion_core::geometry::so3::{rotation, skew};
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Geodetic, Param, Position, Quantity, Tangent, Vector, View, wrap};
use nalgebra::{Matrix3, RowVector3, SMatrix, Vector3};

/// The measured quantity of a landmark.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq, Eq)]
#[cfg_attr(
    feature = "declare",
    derive(serde::Deserialize, schemars::JsonSchema),
    serde(rename_all = "snake_case")
)]
pub enum Measures {
    /// The vector to it in body axes: channel `landmark`, three lengths each.
    #[default]
    Vector,
    /// Azimuth clockwise from ahead, elevation up, range: channel `bearing_range`, radians and metres.
    BearingRange,
}

/// The position from which the landmarks are seen.
#[derive(Debug, Literal)]
pub enum From {
    /// Landmarks are in local axes.
    Plane(Quantity<Position>),
    /// Landmarks are in Earth-centred axes.
    Ellipsoid(Quantity<Geodetic>),
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Landmarks {
    /// The places of the landmarks, in the axes of `place` \[m\].
    marks: Vec<Vector3<f64>>,
    place: From,
    attitude: Quantity<Attitude>,
    lever_arm: Param<Vector<3>>,
    measures: Measures,
}

/// The pose of the body: the axes n in those of the landmarks, and the position there. Also how the axes n turn per
/// metre north, east, down \[rad/m\].
struct Here {
    c: Matrix3<f64>,
    position: Vector3<f64>,
    turning: Matrix3<f64>,
}

impl Landmarks {
    fn here(&self, at: &View<'_>) -> Here {
        match &self.place {
            From::Plane(position) => Here {
                c: Matrix3::identity(),
                position: at.get(position),
                turning: Matrix3::zeros(),
            },
            From::Ellipsoid(position) => {
                let place = at.get(position);
                Here {
                    c: rotation_en(place.lat, place.lon),
                    position: ecef_from_geodetic(&place),
                    turning: LocalEarth::at(&place).transport_matrix(),
                }
            }
        }
    }

    /// Adds the rows of landmark `i`; `by_seen` is the derivative by the seen vector.
    fn add<M: Tangent<3>>(h: &mut Jacobian, i: usize, of: &Quantity<M>, by_seen: &Matrix3<f64>, seen: &Matrix3<f64>) {
        let block: SMatrix<f64, 3, 3> = by_seen * seen;
        h.add(3 * i, of, &block);
    }
}

/// Azimuth, elevation \[rad\] and range \[m\] of the seen vector, and their derivative by it.
fn bearing_range(y: &Vector3<f64>) -> Result<(Vector3<f64>, Matrix3<f64>), Undefined> {
    let (level, range) = (y.xy().norm(), y.norm());
    // Within a millimetre of the vertical, a bearing has no meaning.
    if level < 1e-3 {
        return Err(Undefined("the landmark is at the sensor, or straight above or below it"));
    }
    let (level2, range2) = (level * level, range * range);
    let by_seen = Matrix3::from_rows(&[
        RowVector3::new(-y.y / level2, y.x / level2, 0.0),
        RowVector3::new(y.x * y.z / (level * range2), y.y * y.z / (level * range2), -level / range2),
        (y / range).transpose(),
    ]);
    Ok((Vector3::new(math::atan2(y.y, y.x), math::atan2(-y.z, level), range), by_seen))
}

impl Measurement for Landmarks {
    fn size(&self) -> Size {
        Size::same(3 * self.marks.len())
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let (here, q, l) = (self.here(at), at.get(&self.attitude), at.get(&self.lever_arm));
        for (mark, z) in self.marks.iter().zip(value.chunks_exact_mut(3)) {
            let y = q.inverse_transform_vector(&here.c.tr_mul(&(mark - here.position))) - l;
            let z_i = match self.measures {
                Measures::Vector => y,
                Measures::BearingRange => bearing_range(&y)?.0,
            };
            z.copy_from_slice(z_i.as_slice());
        }
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let (here, l) = (self.here(at), at.get(&self.lever_arm));
        let c_bn = rotation(&at.get(&self.attitude)).transpose();
        for (i, mark) in self.marks.iter().enumerate() {
            let d = here.c.tr_mul(&(mark - here.position));
            let d_b = c_bn * d;
            let by_seen = match self.measures {
                Measures::Vector => Matrix3::identity(),
                Measures::BearingRange => bearing_range(&(d_b - l))?.1,
            };
            // A constant vector turns relative to axes that turn by W δr: by d × W δr.
            let by_position = c_bn * (skew(&d) * here.turning - Matrix3::identity());
            match &self.place {
                From::Plane(position) => Self::add(h, i, position, &by_seen, &by_position),
                From::Ellipsoid(position) => Self::add(h, i, position, &by_seen, &by_position),
            }
            Self::add(h, i, &self.attitude, &by_seen, &skew(&d_b));
            Self::add(h, i, &self.lever_arm, &by_seen, &-Matrix3::identity());
        }
        Ok(())
    }

    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        for (k, ((r, z), p)) in r.iter_mut().zip(z).zip(predicted).enumerate() {
            let is_angle = self.measures == Measures::BearingRange && k % 3 < 2;
            *r = if is_angle { wrap(z - p) } else { z - p };
        }
    }

    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        for (k, (z, e)) in z.iter_mut().zip(e).enumerate() {
            let is_angle = self.measures == Measures::BearingRange && k % 3 < 2;
            *z = if is_angle { wrap(*z + e) } else { *z + e };
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Reading, SensorSpec, XYZ};
    use crate::de::DeserializeSpec;
    use crate::earth::LocalFrame;
    use crate::param::VectorParam;
    use crate::units::{Dimension, Dimensional, Place, Vec3Of, dim};
    use crate::vocabulary::state;
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Landmarks at known places, each as a vector or as bearing and range, all of them seen together.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct LandmarkSpec {
        /// The places of the landmarks: geodetic, or north, east, down of the origin of the run.
        landmarks: Vec<Mark>,
        /// The measured quantity of each landmark.
        #[serde(default)]
        measures: Measures,
        /// Sensor position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
    }

    /// The place of a landmark.
    #[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
    #[serde(
        untagged,
        expecting = "expected a place: `[\"10 m\", \"-3 m\", 0]`, north, east and down of the origin, or `{ latitude = \"47.1 deg\", longitude = \"8.2 deg\" }`"
    )]
    enum Mark {
        /// North, east, down of the origin of the run.
        Local(Vec3Of<dim::Length>),
        /// On or above the ellipsoid.
        Geodetic(Place),
    }

    crate::register!(
        Sensor,
        "landmark",
        LandmarkSpec,
        r#"
landmarks = [["700 m", "200 m", "-350 m"], [-900, 800, 500], { latitude = "36.0985 deg", longitude = "129.4605 deg", height = "400 m" }]
measures = "bearing_range"
lever_arm = { estimate = true, initial = [0.5, 0, "-20 cm"], sigma = "10 cm" }
"#
    );

    const ANGLES: &[&str] = &["azimuth", "elevation", "range"];

    #[typetag::deserialize(name = "landmark")]
    impl SensorSpec for LandmarkSpec {
        fn reading(&self) -> Reading {
            let width = 3 * self.landmarks.len();
            Reading::Channel(match self.measures {
                Measures::Vector => Channel::vector("landmark", width, dim::Length::KIND.dimension),
                Measures::BearingRange => Channel::vector("bearing_range", width, Dimension::NONE),
            })
        }

        fn noise(&self) -> Vec<Dimension> {
            let (length, angle) = (dim::Length::KIND.dimension, dim::Angle::KIND.dimension);
            let one = match self.measures {
                Measures::Vector => [length; 3],
                Measures::BearingRange => [angle, angle, length],
            };
            one.repeat(self.landmarks.len())
        }

        fn axes(&self) -> &'static [&'static str] {
            match self.measures {
                Measures::Vector => XYZ,
                Measures::BearingRange => ANGLES,
            }
        }

        fn reported_sigma(&self) -> Option<Channel> {
            let Reading::Channel(channel) = self.reading() else { return None };
            Some(Channel {
                name: Channel::sigma_name(&channel.name).into(),
                ..channel
            })
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            if self.landmarks.is_empty() {
                return Err(BuildError::at("landmarks", "there is no landmark")
                    .help("write where at least one is, e.g. `landmarks = [[\"10 m\", \"-3 m\", 0]]`"));
            }
            let lever_arm = b.param("lever_arm", &self.lever_arm)?;
            let attitude = b.quantity(state::ATTITUDE)?;
            let place = match b.quantity(state::LOCAL_POSITION) {
                Ok(position) => From::Plane(position),
                Err(_) => From::Ellipsoid(b.quantity(state::POSITION)?),
            };
            let marks = self.landmarks.iter().map(|mark| match (mark, &place) {
                (Mark::Local(ned), From::Plane(_)) => Ok(ned.si().into()),
                (Mark::Geodetic(place), From::Plane(_)) => Ok(LocalFrame::new(b.origin()?).to_ned(&(*place).into())),
                (Mark::Local(ned), From::Ellipsoid(_)) => {
                    let place = LocalFrame::new(b.origin()?).to_geodetic(&ned.si().into());
                    Ok(ecef_from_geodetic(&place))
                }
                (Mark::Geodetic(place), From::Ellipsoid(_)) => Ok(ecef_from_geodetic(&(*place).into())),
            });
            let marks = marks.collect::<Result<_, BuildError>>()?;
            Ok(Box::new(Landmarks {
                marks,
                place,
                attitude,
                lever_arm,
                measures: self.measures,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::from_rpy;

    fn seen(measures: Measures, marks: Vec<Vector3<f64>>) -> Vec<f64> {
        let model = Landmarks {
            place: From::Plane(Quantity::Fixed(Vector3::new(10.0, 20.0, -5.0))),
            attitude: Quantity::Fixed(from_rpy(0.0, 0.0, core::f64::consts::FRAC_PI_2)),
            lever_arm: Param::Fixed(Vector3::zeros()),
            measures,
            marks,
        };
        let mut z = vec![0.0; model.size().value];
        model.predict(&View::new(&[], &[]), &mut z).unwrap();
        z
    }

    #[test]
    fn a_body_that_heads_east_sees_what_is_north_to_its_left() {
        let marks = vec![Vector3::new(13.0, 20.0, -5.0), Vector3::new(10.0, 24.0, -8.0)];
        let both = seen(Measures::Vector, marks.clone());
        let expected = [0.0, -3.0, 0.0, 4.0, 0.0, -3.0];
        // 4 ε of 4.
        assert!(both.iter().zip(expected).all(|(z, e)| (z - e).abs() < 4e-15), "{both:?}");
        let bearings = seen(Measures::BearingRange, marks);
        let up = 3_f64.atan2(4.0);
        let expected = [-core::f64::consts::FRAC_PI_2, 0.0, 3.0, 0.0, up, 5.0];
        assert!(bearings.iter().zip(expected).all(|(z, e)| (z - e).abs() < 4e-15), "{bearings:?}");
    }

    #[test]
    fn straight_above_there_is_no_azimuth() {
        assert!(bearing_range(&Vector3::new(0.0, 0.0, -7.0)).is_err());
        assert!(bearing_range(&Vector3::new(0.0, 0.1, -7.0)).is_ok());
    }

    #[test]
    fn the_derivatives_of_a_bearing_match_central_differences() {
        let (y, h) = (Vector3::new(3.0, -4.0, 2.0), 1e-5);
        let by_seen = bearing_range(&y).unwrap().1;
        for k in 0..3 {
            let mut d = Vector3::zeros();
            d[k] = h;
            let numeric = (bearing_range(&(y + d)).unwrap().0 - bearing_range(&(y - d)).unwrap().0) / (2.0 * h);
            // 1e-9: h²/6 of the third derivative, rounding 1e-15/h.
            assert!((by_seen.column(k) - numeric).amax() < 1e-9, "{k}");
        }
    }
}
