//! Initial values written in the file.

use super::{write_attitude, write_position, write_velocity, write_yaw};
use alloc::string::String;
use fusion_core::belief::Belief;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::literal;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::Initialiser;
use fusion_core::state::Layout;
use fusion_core::time::Time;
use nalgebra::{UnitQuaternion, Vector3};

/// The runtime initialiser.
#[derive(Clone, Debug, Literal)]
pub struct Explicit {
    origin: Option<Geodetic>,
    place: Option<(Geodetic, [f64; 3])>,
    velocity: Option<(Vector3<f64>, [f64; 3])>,
    attitude: Option<(UnitQuaternion<f64>, [f64; 3])>,
    heading: Option<(f64, f64)>,
}
memory!(Explicit { ; origin, place, velocity, attitude, heading });

impl Initialiser for Explicit {
    fn row(&mut self, _: usize, _: Time, _: &[f64]) {}

    fn waits_for(&self) -> Option<String> {
        None
    }

    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        if let Some((place, sigma)) = &self.place {
            write_position(layout, belief, self.origin, place, sigma);
        }
        if let Some((v, sigma)) = &self.velocity {
            write_velocity(layout, belief, v, sigma);
        }
        if let Some((q, sigma)) = &self.attitude {
            write_attitude(layout, belief, q, sigma);
        }
        if let Some((yaw, sigma)) = self.heading {
            write_yaw(layout, belief, yaw, sigma);
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, InitialiserSpec, Listen};
    use crate::de::DeserializeSpec;
    use crate::param::Rpy;
    use crate::units::{Angle, Axes, NonNegative, Place, Vec3Of, dim, range};
    use crate::vocabulary::state;
    use schemars::JsonSchema;

    /// Initial values written in the file: any of position, velocity, attitude or heading, each with
    /// its 1σ.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct ExplicitSpec {
        /// Initial position; without it the origin where `position_sigma` is given.
        position: Option<Place>,
        /// 1σ north, east, down.
        position_sigma: Option<Axes<dim::Length, range::NonNegative>>,
        /// Initial velocity north, east, down, given with `velocity_sigma`.
        velocity: Option<Vec3Of<dim::Speed>>,
        /// 1σ north, east, down.
        velocity_sigma: Option<Axes<dim::Speed, range::NonNegative>>,
        /// Initial roll, pitch, yaw.
        attitude: Option<Rpy>,
        /// 1σ about the body axes.
        attitude_sigma: Option<Axes<dim::Angle, range::NonNegative>>,
        /// Initial heading alone; roll and pitch as other initialisers find them.
        heading: Option<Angle>,
        /// 1σ of the heading.
        heading_sigma: Option<NonNegative<dim::Angle>>,
    }

    crate::register!(
        Initialiser,
        "explicit",
        ExplicitSpec,
        r#"
position = { latitude = "36.098 deg", longitude = "129.45 deg", height = "10 m" }
position_sigma = ["2 m", "2 m", "3 m"]
velocity = [0, 0, 0]
velocity_sigma = "0.1 m/s"
attitude = [0, 0, "30 deg"]
attitude_sigma = ["0.1 deg", "0.1 deg", "1 deg"]
"#
    );

    #[typetag::deserialize(name = "explicit")]
    impl InitialiserSpec for ExplicitSpec {
        fn inputs(&self) -> Vec<Listen> {
            Vec::new()
        }

        fn writes(&self) -> Vec<&'static str> {
            let mut blocks = Vec::new();
            if self.position_sigma.is_some() {
                blocks.extend([state::POSITION.as_str(), state::LOCAL_POSITION.as_str()]);
            }
            if self.velocity_sigma.is_some() {
                blocks.extend([state::VELOCITY.as_str(), state::SPEED.as_str()]);
            }
            if self.attitude_sigma.is_some() {
                blocks.push(state::ATTITUDE.as_str());
            }
            if self.heading_sigma.is_some() {
                blocks.push(state::HEADING.as_str());
            }
            blocks
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
            let sigma = |what: &str, given: bool, sigma: bool| match (given, sigma) {
                (true, false) => Err(BuildError::new(format!("`{what}` is given without `{what}_sigma`, its 1σ"))),
                // A place has the origin for a default; nothing says how fast or which way the body starts.
                (false, true) if what != "position" => {
                    let message = format!("`{what}_sigma` is given without `{what}`, the value that it is the 1σ of");
                    Err(BuildError::at(format!("{what}_sigma"), message)
                        .help(format!("add `{what}`: zeros, if that is what it starts from")))
                }
                _ => Ok(()),
            };
            sigma("position", self.position.is_some(), self.position_sigma.is_some())?;
            sigma("velocity", self.velocity.is_some(), self.velocity_sigma.is_some())?;
            sigma("attitude", self.attitude.is_some(), self.attitude_sigma.is_some())?;
            sigma("heading", self.heading.is_some(), self.heading_sigma.is_some())?;
            if self.attitude.is_some() && self.heading.is_some() {
                return Err(BuildError::at("heading", "`attitude` gives the heading already"));
            }
            let place = match (self.position, self.position_sigma) {
                (Some(p), _) => Some(p.into()),
                (None, Some(_)) => Some(b.origin()?),
                (None, None) => None,
            };
            Ok(Box::new(Explicit {
                origin: b.origin,
                place: place.zip(self.position_sigma.map(Axes::si)),
                velocity: self.velocity.map(|v| v.si().into()).zip(self.velocity_sigma.map(Axes::si)),
                attitude: self.attitude.map(|rpy| rpy.rotation()).zip(self.attitude_sigma.map(Axes::si)),
                heading: self.heading.map(Angle::si).zip(self.heading_sigma.map(|s| s.si())),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, InitialiserSpec};
    use crate::earth::Gravity;
    use crate::vocabulary::state;
    use fusion_core::geometry::so3;
    use fusion_core::state::{Attitude, Dynamics, Geodetic as Position, LayoutBuilder, Manifold};

    fn refused(toml: &str) -> Option<String> {
        let spec: ExplicitSpec = toml::from_str(toml).unwrap();
        let mut build = Build {
            name: "start",
            layout: &mut LayoutBuilder::new(),
            origin: Some(Geodetic::new(0.6, 2.2, 0.0)),
            gravity: Gravity::default(),
        };
        spec.build(&mut build).err().map(|e| format!("{}: {e}", e.field))
    }

    #[test]
    fn a_value_and_its_sigma_come_together_but_for_the_position_which_has_the_origin() {
        for (what, value) in [("velocity", "[1, 0, 0]"), ("attitude", "[0, 0, 1]"), ("heading", "1")] {
            let lacks_value = refused(&format!("{what}_sigma = 0.1")).unwrap();
            assert!(lacks_value.starts_with(&format!("{what}_sigma: ")), "{lacks_value}");
            let lacks_sigma = refused(&format!("{what} = {value}")).unwrap();
            assert!(lacks_sigma.contains(&format!("without `{what}_sigma`")), "{lacks_sigma}");
            assert_eq!(refused(&format!("{what} = {value}\n{what}_sigma = 0.1")), None);
        }
        assert_eq!(refused("position_sigma = 2"), None);
        let twice = refused("attitude = [0, 0, 1]\nattitude_sigma = 0.1\nheading = 1\nheading_sigma = 0.1").unwrap();
        assert!(twice.starts_with("heading: "), "{twice}");
    }

    #[test]
    fn what_is_declared_is_written_and_a_position_without_a_value_is_the_origin() {
        let mut layout = LayoutBuilder::new();
        let origin = Geodetic::new(0.6, 2.2, 30.0);
        let mut b = Build {
            name: "start",
            layout: &mut layout,
            origin: Some(origin),
            gravity: Gravity::default(),
        };
        let unset = || vec![0.0; 3];
        b.declare(state::POSITION, "m", Geodetic::new(0.0, 0.0, 0.0), unset(), Dynamics::Process)
            .unwrap();
        b.declare(state::ATTITUDE, "rad", so3::from_rpy(0.1, 0.2, 0.0), unset(), Dynamics::Process)
            .unwrap();
        let toml = "position_sigma = [1, 2, 3]\nheading = '40 deg'\nheading_sigma = 0.1";
        let start = toml::from_str::<ExplicitSpec>(toml).unwrap().build(&mut b).unwrap();
        let layout = layout.finish();
        let form = fusion_core::filter::Backend::default().form.form();
        let mut belief = Belief::initial(&layout, &form, Time::default());
        start.write(Time::default(), &layout, &mut belief);
        let [position, attitude] = layout.blocks() else {
            panic!("two blocks")
        };
        let place = Position::read(&belief.x[position.storage_range()]);
        assert_eq!((place.lat, place.lon, place.height), (0.6, 2.2, 30.0));
        assert_eq!(belief.covariance.sigmas(position).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
        let rpy = so3::to_rpy(&Attitude::read(&belief.x[attitude.storage_range()]));
        let wanted = Vector3::new(0.1, 0.2, 40_f64.to_radians());
        assert!((rpy - wanted).norm() < 1e-14, "{rpy}"); // trigonometric functions
        // About down, seen from a body that leans.
        let sigma = belief.covariance.marginal::<3>(attitude).trace().sqrt();
        assert!((sigma - 0.1).abs() < 1e-15, "{sigma}"); // rounding
    }
}
