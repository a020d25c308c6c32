//! Range to beacons at known places, written as h alone: its Jacobian is exact by dual numbers.
//!
//! Measured   z = slant range from the transducer a to the beacon \[m\], or to each of several
//! Predicted  h(x) = (1 + κ) |r_beacon_e − r_eb_e − C_en C_nb l_ba_b| + b
//! Valid      at any distance, in Earth-centred axes; a straight path
//! Not here   travel time, refraction; a sound speed wrong by a factor is κ

use alloc::vec::Vec;
use fusion_core::geometry::wgs84::{ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS};
use fusion_core::literal;
use fusion_core::model::{ExactModel, ExactView, Literal, Real, Undefined};
use fusion_core::state::{Attitude, Param, Quantity, Scalar, Vector};
use nalgebra::Vector3;

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Range {
    /// In Earth-centred axes \[m\].
    beacons_e: Vec<Vector3<f64>>,
    position: Quantity<fusion_core::state::Geodetic>,
    attitude: Option<Quantity<Attitude>>,
    lever_arm: Param<Vector<3>>,
    scale: Param<Scalar>,
    bias: Param<Scalar>,
}

/// Earth-centred coordinates \[m\] of a point `l_n` north, east, down \[m\] of a geodetic position.
pub(super) fn earth_centred<D: Real>([lat, lon, height]: [D; 3], l_n: Option<Vector3<D>>) -> Vector3<D> {
    let ((sp, cp), (sl, cl)) = (lat.sin_cos(), lon.sin_cos());
    let normal = ((-sp * sp * ECCENTRICITY_SQUARED + 1.0).sqrt()).recip() * SEMI_MAJOR_AXIS;
    let across = (normal + height) * cp;
    let mut r_e = Vector3::new(across * cl, across * sl, (normal * (1.0 - ECCENTRICITY_SQUARED) + height) * sp);
    if let Some(l_n) = l_n {
        // C_en l_n: columns are north, east and down in Earth-centred axes.
        let outward = -sp * l_n.x - cp * l_n.z;
        r_e.x += outward * cl - sl * l_n.y;
        r_e.y += outward * sl + cl * l_n.y;
        r_e.z += cp * l_n.x - sp * l_n.z;
    }
    r_e
}

impl ExactModel for Range {
    fn dim(&self) -> usize {
        self.beacons_e.len()
    }

    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
        let [lat, lon, height] = x.geodetic(&self.position);
        let l_n = self
            .attitude
            .as_ref()
            .map(|attitude| x.rotate(attitude, &x.vector(&self.lever_arm)));
        let r_e = earth_centred([lat, lon, height], l_n);
        let (scale, bias) = (x.scalar(&self.scale) + 1.0, x.scalar(&self.bias));
        for (beacon_e, z) in self.beacons_e.iter().zip(z) {
            let d = [r_e.x - beacon_e.x, r_e.y - beacon_e.y, r_e.z - beacon_e.z];
            let squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            if squared.re() < 1e-6 {
                return Err(Undefined("the transducer is at the beacon"));
            }
            *z = squared.sqrt() * scale + bias;
        }
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Reading, SensorSpec};
    use crate::de::DeserializeSpec;
    use crate::earth::frames::ecef_from_geodetic;
    use crate::param::{ScalarParam, VectorParam};
    use crate::units::{Dimension, Dimensional, Latitude, Length, Longitude, Place, dim};
    use crate::vocabulary::state;
    use fusion_core::geometry::wgs84::Geodetic;
    use fusion_core::model::{Exact, Measurement};
    use schemars::JsonSchema;

    /// Range to a beacon at a known place, or to several at once.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct RangeSpec {
        /// Latitude of the beacon, north positive.
        latitude: Option<Latitude>,
        /// Longitude of the beacon, east positive.
        longitude: Option<Longitude>,
        /// Height of the beacon above the ellipsoid, up positive.
        height: Option<Length>,
        /// Several beacons, measured together: one range each, in this order, in one measurement. Instead
        /// of `latitude`, `longitude` and `height`.
        beacons: Option<Vec<Place>>,
        /// Transducer position in body axes, from the body origin (the IMU).
        #[serde(default)]
        lever_arm: VectorParam<dim::Length>,
        /// Scale error κ: the sensor reads (1 + κ) of the range.
        #[serde(default)]
        scale: ScalarParam<dim::Ratio>,
        /// Range bias, independent of the range.
        #[serde(default)]
        bias: ScalarParam<dim::Length>,
    }

    crate::register!(
        Sensor,
        "range",
        RangeSpec,
        r#"
latitude = "36.0985 deg"
longitude = "129.4505 deg"
height = "-20 m"
lever_arm = { estimate = true, initial = [0.5, 0, "-20 cm"], sigma = "10 cm" }
scale = { estimate = true, initial = 0, sigma = "0.3 %", correlation_time = "1 h" }
bias = { estimate = true, initial = 0, sigma = "20 cm" }
"#
    );

    impl RangeSpec {
        /// How many ranges it measures at once.
        fn rows(&self) -> usize {
            self.beacons.as_ref().map_or(1, Vec::len)
        }

        /// Where the beacons are.
        pub(super) fn places(&self) -> Result<Vec<Geodetic>, BuildError> {
            let single = (self.latitude, self.longitude, self.height);
            match (&self.beacons, single) {
                (Some(beacons), (None, None, None)) if !beacons.is_empty() => Ok(beacons.iter().map(|b| (*b).into()).collect()),
                (Some(beacons), (None, None, None)) if beacons.is_empty() => Err(BuildError::at("beacons", "there is no beacon")),
                (None, (Some(lat), Some(lon), Some(height))) => Ok(vec![Geodetic::new(lat.si(), lon.si(), height.si())]),
                (None, _) => {
                    let help = "state `latitude`, `longitude` and `height`, or a list of `beacons`";
                    Err(BuildError::new("nothing says where the beacon is").help(help))
                }
                (Some(_), _) => {
                    let message = "`beacons` stand instead of `latitude`, `longitude` and `height`";
                    Err(BuildError::at("beacons", message).help("make the single beacon one of the list"))
                }
            }
        }
    }

    #[typetag::deserialize(name = "range")]
    impl SensorSpec for RangeSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(Channel::vector("range", self.rows(), dim::Length::KIND.dimension))
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::Length::KIND.dimension; self.rows()]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let lever_arm = b.param("lever_arm", &self.lever_arm)?;
            let at_the_body = matches!(&lever_arm, Param::Fixed(l) if *l == Vector3::zeros());
            Ok(Box::new(Exact(Range {
                beacons_e: self.places()?.iter().map(ecef_from_geodetic).collect(),
                position: b.quantity(state::POSITION)?,
                attitude: if at_the_body { None } else { Some(b.quantity(state::ATTITUDE)?) },
                lever_arm,
                scale: b.param("scale", &self.scale)?,
                bias: b.param("bias", &self.bias)?,
            })))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::frames::{ecef_from_geodetic, rotation_en};
    use fusion_core::geometry::so3::{rotation, skew};
    use fusion_core::geometry::wgs84::{Geodetic, Radii, radii};
    use fusion_core::linear::Jacobian;
    use fusion_core::model::{Exact, Measurement};
    use fusion_core::state::{Declaration, Dynamics, Layout, LayoutBuilder, Manifold, StateRole, View};
    use nalgebra::RowVector3;

    /// The same model with its Jacobian by hand.
    fn analytic(model: &Range, at: &View<'_>) -> (f64, [RowVector3<f64>; 3], f64) {
        let p = at.get(&model.position);
        let (c_en, c_nb) = (rotation_en(p.lat, p.lon), rotation(&at.get(model.attitude.as_ref().unwrap())));
        let (l, k) = (at.get(&model.lever_arm), 1.0 + at.get(&model.scale));
        let l_n = c_nb * l;
        let d = ecef_from_geodetic(&p) + c_en * l_n - model.beacons_e[0];
        let unit_n = (d.transpose() * c_en) * (k / d.norm());
        // Moving over the ellipsoid turns the axes n, and the lever arm with them.
        let Radii { meridian, normal } = radii(p.lat);
        let (rm, rn) = (meridian + p.height, normal + p.height);
        let turn = |w: Vector3<f64>| unit_n * w.cross(&l_n);
        let turning = RowVector3::new(
            turn(Vector3::new(0.0, -1.0 / rm, 0.0))[0],
            turn(Vector3::new(1.0 / rn, 0.0, -p.lat.tan() / rn))[0],
            0.0,
        );
        let by_attitude = -unit_n * c_nb * skew(&l);
        (
            k * d.norm() + at.get(&model.bias),
            [unit_n + turning, by_attitude, unit_n * c_nb],
            d.norm(),
        )
    }

    fn problem() -> (Layout, Range, Vec<f64>) {
        let mut b = LayoutBuilder::new();
        fn state<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value) -> Quantity<M> {
            let (sigma, dynamics) = (vec![1.0; M::KIND.dim()], Dynamics::Constant);
            let owner = "test".to_owned();
            Quantity::State(
                b.declare::<M>(Declaration {
                    name: name.to_owned(),
                    owner,
                    unit: "",
                    initial,
                    sigma,
                    role: StateRole::Calibration,
                    dynamics,
                })
                .unwrap(),
            )
        }
        let model = Range {
            beacons_e: vec![ecef_from_geodetic(&Geodetic::new(0.6301, 2.2594, -20.0))],
            position: state(&mut b, "position", Geodetic::new(0.63, 2.2593, 40.0)),
            attitude: Some(state(&mut b, "attitude", fusion_core::geometry::so3::from_rpy(0.2, -0.4, 2.0))),
            lever_arm: state(&mut b, "lever_arm", Vector3::new(1.0, -2.0, 0.5)),
            scale: state(&mut b, "scale", 0.02),
            bias: state(&mut b, "bias", 0.3),
        };
        let layout = b.finish();
        let x = layout.initial().to_vec();
        (layout, model, x)
    }

    #[test]
    fn exact_derivatives_equal_the_ones_by_hand() {
        let (layout, model, x) = problem();
        let view = View::new(&x, &[]);
        let (range, [position, attitude, lever_arm], distance) = analytic(&model, &view);
        let exact = Exact(model);
        let (mut z, mut h) = ([0.0], Jacobian::new(&layout, 1));
        exact.predict(&view, &mut z).unwrap();
        h.reset(1);
        exact.jacobian(&view, &mut h).unwrap();
        // 1e-8 m: differences of Earth-centred coordinates of 6e6 m.
        assert!((z[0] - range).abs() < 1e-8, "{} {range}", z[0]);
        let by_hand: Vec<f64> = position
            .iter()
            .chain(&attitude)
            .chain(&lever_arm)
            .copied()
            .chain([distance, 1.0])
            .collect();
        for (j, want) in by_hand.iter().enumerate() {
            // 1e-9 relative to the block: 1e-9 m of rounding over 1 km is 1e-12.
            assert!(
                (h.get(0, j) - want).abs() <= 1e-9 * want.abs().max(1.0),
                "{j}: {} {want}",
                h.get(0, j)
            );
        }
    }

    #[test]
    fn several_beacons_are_the_rows_of_one_measurement() {
        let (layout, mut model, x) = problem();
        let (near, far) = (model.beacons_e[0], ecef_from_geodetic(&Geodetic::new(0.6302, 2.2590, 5.0)));
        let single = |model: Range| {
            let (mut z, mut h) = (vec![0.0; model.dim()], Jacobian::new(&layout, model.dim()));
            h.reset(z.len());
            let exact = Exact(model);
            exact.predict(&View::new(&x, &[]), &mut z).unwrap();
            exact.jacobian(&View::new(&x, &[]), &mut h).unwrap();
            let rows = 0..z.len();
            let rows = rows.map(|i| (0..layout.dim()).map(|j| h.get(i, j)).collect::<Vec<_>>());
            z.iter().copied().zip(rows.collect::<Vec<_>>()).collect::<Vec<_>>()
        };
        let one = |beacon| {
            single(Range {
                beacons_e: vec![beacon],
                ..problem().1
            })
        };
        let apart = [one(near), one(far)].concat();
        model.beacons_e = vec![near, far];
        assert_eq!(single(model), apart);
        assert!(apart[0].0 != apart[1].0);
    }

    #[test]
    fn a_beacon_has_one_place() {
        let places = |toml: &str| toml::from_str::<RangeSpec>(toml).unwrap().places().map_err(|e| e.field);
        let (single, list) = (
            "latitude = 0.6\nlongitude = 2\nheight = 0",
            "beacons = [{ latitude = 0.6, longitude = 2 }]",
        );
        assert_eq!(places(single), places(list));
        assert_eq!(places(&format!("{single}\n{list}")).unwrap_err(), "beacons");
        assert_eq!(places("beacons = []").unwrap_err(), "beacons");
        assert!(places("latitude = 0.6").is_err() && places("").is_err());
    }

    #[test]
    fn at_the_beacon_there_is_no_direction() {
        let (layout, mut model, x) = problem();
        let at = Geodetic::new(x[0], x[1], x[2]);
        model.attitude = None;
        model.beacons_e = vec![ecef_from_geodetic(&at)];
        let mut h = Jacobian::new(&layout, 1);
        assert!(Exact(model).jacobian(&View::new(&x, &[]), &mut h).is_err());
    }
}
