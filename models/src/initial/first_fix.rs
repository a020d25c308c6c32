//! Position and velocity from the latest fix before the start, or the median of the latest few.

use super::{write_position, write_velocity};
use crate::block::{Build, BuildError, InitialiserSpec, Listen};
use crate::units::{Axes, dim, range};
use crate::vocabulary::{channel, state};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::runner::Initialiser;
use fusion_core::state::{Belief, Layout, Manifold};
use fusion_core::time::Time;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::VecDeque;
use std::num::NonZeroUsize;

/// Position, and velocity where declared, from the latest fix before the filter starts.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FirstFixSpec {
    /// A stream with a `position` channel.
    source: String,
    /// 1σ north, east, down of the initial position.
    position_sigma: Axes<dim::Length, range::NonNegative>,
    /// Takes the `velocity` channel too, with this 1σ; without it another initialiser must give the
    /// velocity.
    velocity_sigma: Option<Axes<dim::Speed, range::NonNegative>>,
    /// The position is the median of this many latest fixes, axis by axis: for a vehicle at rest
    /// whose fixes contain outliers.
    #[serde(default = "one")]
    median_of: NonZeroUsize,
}

const fn one() -> NonZeroUsize {
    NonZeroUsize::MIN
}

crate::register!(
    Initialiser,
    "first_fix",
    FirstFixSpec,
    r#"
source = "gnss"
position_sigma = ["2 m", "2 m", "4 m"]
velocity_sigma = "0.3 m/s"
median_of = 1
"#
);

#[typetag::deserialize(name = "first_fix")]
impl InitialiserSpec for FirstFixSpec {
    fn inputs(&self) -> Vec<Listen> {
        let listen = |channel| Listen {
            source: self.source.clone(),
            channels: vec![channel],
        };
        let mut inputs = vec![listen(channel::POSITION)];
        if self.velocity_sigma.is_some() {
            inputs.push(listen(channel::VELOCITY));
        }
        inputs
    }

    fn writes(&self) -> Vec<&'static str> {
        let mut blocks = vec![state::POSITION.as_str(), state::LOCAL_POSITION.as_str()];
        if self.velocity_sigma.is_some() {
            blocks.extend([state::VELOCITY.as_str(), state::SPEED.as_str()]);
        }
        blocks
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
        Ok(Box::new(FirstFix {
            origin: b.origin,
            position_sigma: self.position_sigma.si(),
            velocity_sigma: self.velocity_sigma.map(Axes::si),
            median_of: self.median_of.get(),
            fixes: VecDeque::new(),
            velocity: None,
        }))
    }
}

#[derive(Clone, Debug)]
struct FirstFix {
    origin: Option<Geodetic>,
    position_sigma: [f64; 3],
    velocity_sigma: Option<[f64; 3]>,
    median_of: usize,
    fixes: VecDeque<Geodetic>,
    velocity: Option<Vector3<f64>>,
}

impl FirstFix {
    fn position(&self) -> Option<Geodetic> {
        let middle = |coordinate: fn(&Geodetic) -> f64| {
            let mut values: Vec<f64> = self.fixes.iter().map(coordinate).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied()
        };
        Some(Geodetic {
            lat: middle(|g| g.lat)?,
            lon: middle(|g| g.lon)?,
            height: middle(|g| g.height)?,
        })
    }
}

impl Initialiser for FirstFix {
    fn row(&mut self, input: usize, _: Time, row: &[f64]) {
        if input == 0 {
            if self.fixes.len() == self.median_of {
                self.fixes.pop_front();
            }
            self.fixes.push_back(Geodetic::read(row));
        } else {
            self.velocity = Some(Vector3::new(row[0], row[1], row[2]));
        }
    }

    fn waits_for(&self) -> Option<String> {
        if self.fixes.len() < self.median_of {
            return Some(if self.median_of == 1 {
                "a position fix".to_owned()
            } else {
                format!("{} position fixes", self.median_of)
            });
        }
        (self.velocity_sigma.is_some() && self.velocity.is_none()).then(|| "a velocity".to_owned())
    }

    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        if let Some(place) = self.position() {
            write_position(layout, belief, self.origin, &place, &self.position_sigma);
        }
        if let (Some(v), Some(sigma)) = (&self.velocity, &self.velocity_sigma) {
            write_velocity(layout, belief, v, sigma);
        }
    }

    fn boxed_clone(&self) -> Box<dyn Initialiser> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_the_latest_fixes_is_not_moved_by_an_outlier() {
        let origin = Geodetic {
            lat: 0.6,
            lon: 2.2,
            height: 10.0,
        };
        let mut f = FirstFix {
            origin: None,
            position_sigma: [1.0; 3],
            velocity_sigma: None,
            median_of: 3,
            fixes: VecDeque::new(),
            velocity: None,
        };
        for (k, east) in [500.0, 0.1, 30.0, 0.2].into_iter().enumerate() {
            assert_eq!(f.waits_for().is_none(), k >= 3, "fix {k}");
            let mut row = [0.0; 3];
            Geodetic::write(&origin.offset(&Vector3::new(0.0, east, 0.0)), &mut row);
            f.row(0, Time::default(), &row);
        }
        let d = f.position().unwrap().difference(&origin);
        // Of 0.1, 30 and 0.2; 1e-6 m is the rounding of a longitude.
        assert!((d.y - 0.2).abs() < 1e-6, "{d}");
    }
}
