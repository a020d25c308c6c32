//! The pose of another vessel: the ship that carries a transceiver.
//!
//! Measured   z = its geodetic position, latitude, longitude \[rad\], height \[m\], and its attitude q_ns
//! States     `NAME.position` (geodetic) and `NAME.attitude`, random walks so wide that each measurement
//!            takes the place of what was known; other sensors read them, with the errors they are left with
//! Predicted  h(x) = the two states
//! Jacobian   I₆; the attitude about the vessel's axes, exact at r = 0
//! Order      it is used before the sensors that read it at a time that they share
//! Simulated  its true pose is that of the platform of its name, or of `[simulation.ship]`; the first 1σ only says that nothing is known yet
//! Not here   how the vessel moves between two of its rows: give its pose at the time of the ping

use super::attitude::unit;
use fusion_core::geometry::so3;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Geodetic, Manifold, Quantity, View};
use nalgebra::{Matrix3, Vector3};

/// Numbers of a geodetic position, before those of the quaternion.
const PLACE: usize = 3;

/// The runtime model.
#[derive(Debug, Literal)]
pub struct VesselPose {
    position: Quantity<Geodetic>,
    attitude: Quantity<Attitude>,
}

impl Measurement for VesselPose {
    fn size(&self) -> Size {
        Size { value: 7, residual: 6 }
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let (place, attitude) = value.split_at_mut(PLACE);
        Geodetic::write(&at.get(&self.position), place);
        Attitude::write(&at.get(&self.attitude), attitude);
        Ok(())
    }

    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add(0, &self.position, &Matrix3::identity());
        h.add(3, &self.attitude, &Matrix3::identity());
        Ok(())
    }

    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        let d = Geodetic::read(z).difference(&Geodetic::read(predicted));
        r[..3].copy_from_slice(d.as_slice());
        let turned = unit(&predicted[PLACE..]).inverse() * unit(&z[PLACE..]);
        r[3..6].copy_from_slice(so3::log(&turned).as_slice());
    }

    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        let (place, attitude) = z.split_at_mut(PLACE);
        Geodetic::write(&Geodetic::read(place).offset(&Vector3::from_column_slice(&e[..3])), place);
        let turned = unit(attitude) * so3::exp(&Vector3::from_column_slice(&e[3..6]));
        Attitude::write(&turned, attitude);
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
    use crate::units::{Dimension, Dimensional, NonNegative, dim};
    use crate::vocabulary::channel;
    use fusion_core::geometry::wgs84::Geodetic as Place;
    use fusion_core::state::{Declaration, Dynamics, StateRole};
    use nalgebra::UnitQuaternion;
    use schemars::JsonSchema;

    /// 1σ before the first row: anywhere in reach of acoustics \[m\], any attitude \[rad\].
    const UNKNOWN: (f64, f64) = (1e4, 2.0);

    /// Pose of another vessel, whose position and attitude become states: `NAME.position`, `NAME.attitude`. In a simulation
    /// it is the platform `[simulation.platform.NAME]`, or without one of this name the ship of `[simulation.ship]`.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct VesselPoseSpec {
        /// How far it may move between two rows.
        #[serde(default = "far")]
        position_walk: NonNegative<dim::PositionRandomWalk>,
        /// How far it may turn between two rows.
        #[serde(default = "freely")]
        attitude_walk: NonNegative<dim::AngleRandomWalk>,
    }

    /// A ship under way.
    fn far() -> NonNegative<dim::PositionRandomWalk> {
        NonNegative::try_from_si(10.0).unwrap_or_default()
    }

    /// A small boat in waves: 20°/√s.
    fn freely() -> NonNegative<dim::AngleRandomWalk> {
        NonNegative::try_from_si(20f64.to_radians()).unwrap_or_default()
    }

    crate::register!(
        Sensor,
        "vessel_pose",
        VesselPoseSpec,
        r#"
position_walk = "10 m/sqrt(s)"
attitude_walk = "20 deg/sqrt(s)"
"#
    );

    #[typetag::deserialize(name = "vessel_pose")]
    impl SensorSpec for VesselPoseSpec {
        fn reading(&self) -> Reading {
            Reading::Channels(vec![channel::SHIP_POSITION, channel::SHIP_ATTITUDE])
        }

        fn noise(&self) -> Vec<Dimension> {
            let (length, angle) = (dim::Length::KIND.dimension, dim::Angle::KIND.dimension);
            vec![length, length, length, angle, angle, angle]
        }

        fn axes(&self) -> &'static [&'static str] {
            &["north", "east", "down", "roll", "pitch", "yaw"]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let (far, turned) = UNKNOWN;
            let place = b.origin.unwrap_or(Place::new(0.0, 0.0, 0.0));
            Ok(Box::new(VesselPose {
                position: declare::<Geodetic>(b, ("position", "m"), place, far, self.position_walk.si())?,
                attitude: declare::<Attitude>(b, ("attitude", "rad"), UnitQuaternion::identity(), turned, self.attitude_walk.si())?,
            }))
        }
    }

    /// A state of the vessel: its part and unit, value and 1σ before the first row, and its walk.
    fn declare<M: Manifold>(
        b: &mut Build<'_>,
        (part, unit): (&str, &'static str),
        initial: M::Value,
        sigma: f64,
        walk: f64,
    ) -> Result<Quantity<M>, BuildError> {
        let owner = b.name.to_owned();
        let declared = Declaration {
            name: format!("{owner}.{part}"),
            owner,
            unit,
            initial,
            sigma: vec![sigma; 3],
            role: StateRole::Nuisance,
            dynamics: Dynamics::RandomWalk { psd: vec![walk * walk; 3] },
        };
        Ok(b.layout.declare::<M>(declared)?.into())
    }
}
