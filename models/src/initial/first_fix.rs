//! Position and velocity from the latest fix before the start.

use super::{write_position, write_velocity};
use crate::block::{Build, BuildError, Channel, InitialiserSpec, Listen};
use crate::units::{Axes, Dimensional, dim, range};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::Initialiser;
use fusion_core::state::{Belief, Layout, Manifold};
use fusion_core::time::Time;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

/// Position, and velocity where declared, from the latest fix before the filter starts.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FirstFixSpec {
    /// A stream with a `position` channel.
    source: String,
    /// 1σ north, east, down of the initial position.
    position_sigma: Axes<dim::Length, range::NonNegative>,
    /// Takes the `velocity` channel too, with this 1σ; without it the start is at rest only if
    /// another initialiser says so.
    velocity_sigma: Option<Axes<dim::Speed, range::NonNegative>>,
}

crate::register!(Initialiser, "first_fix", FirstFixSpec, r#"
source = "gnss"
position_sigma = ["2 m", "2 m", "4 m"]
velocity_sigma = "0.3 m/s"
"#);

#[typetag::deserialize(name = "first_fix")]
impl InitialiserSpec for FirstFixSpec {
    fn inputs(&self) -> Vec<Listen> {
        let listen = |channel| Listen { source: self.source.clone(), channels: vec![channel] };
        let mut inputs = vec![listen(Channel::geodetic("position"))];
        if self.velocity_sigma.is_some() {
            inputs.push(listen(Channel::vector("velocity", 3, dim::Speed::KIND.dimension)));
        }
        inputs
    }

    fn writes(&self) -> Vec<&'static str> {
        let mut blocks = vec!["position", "local_position"];
        if self.velocity_sigma.is_some() {
            blocks.extend(["velocity", "speed"]);
        }
        blocks
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
        Ok(Box::new(FirstFix {
            origin: b.origin,
            position_sigma: self.position_sigma.si(),
            velocity_sigma: self.velocity_sigma.map(Axes::si),
            position: None,
            velocity: None,
        }))
    }
}

#[derive(Debug)]
struct FirstFix {
    origin: Option<Geodetic>,
    position_sigma: [f64; 3],
    velocity_sigma: Option<[f64; 3]>,
    position: Option<Geodetic>,
    velocity: Option<Vector3<f64>>,
}

impl Initialiser for FirstFix {
    fn row(&mut self, input: usize, _: Time, row: &[f64]) {
        if input == 0 {
            self.position = Some(Geodetic::read(row));
        } else {
            self.velocity = Some(Vector3::new(row[0], row[1], row[2]));
        }
    }

    fn waits_for(&self) -> Option<String> {
        match (self.position, self.velocity_sigma, self.velocity) {
            (None, _, _) => Some("a position fix".to_owned()),
            (Some(_), Some(_), None) => Some("a velocity".to_owned()),
            _ => None,
        }
    }

    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        if let Some(place) = &self.position {
            write_position(layout, belief, self.origin, place, &self.position_sigma);
        }
        if let (Some(v), Some(sigma)) = (&self.velocity, &self.velocity_sigma) {
            write_velocity(layout, belief, v, sigma);
        }
    }
}
