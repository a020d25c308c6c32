//! Gait: the foot of a person who walks.

use super::super::profile::{pulse, step7};
use super::{Junction, Motion, Segment, SegmentSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Dimensional, NonNegative, Positive, Quantity, dim};
use core::f64::consts::PI;
use fusion_core::math;
use nalgebra::Vector3;
use schemars::JsonSchema;

/// Walks, seen from a foot with an inertial unit on it: in every stride the foot first stands still on the ground, and
/// then swings ahead, lifted, toes down and then up. Velocity and angular rate are exactly 0 while it stands.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WalkSpec {
    /// Strides of this foot: two steps of the person each.
    strides: u32,
    /// How far the foot swings in a stride.
    #[serde(default = "length")]
    length: Positive<dim::Length>,
    /// Time of a stride.
    #[serde(default = "period")]
    period: Positive<dim::Duration>,
    /// The share of the stride for which the foot stands: 0.4 by default, less when running.
    #[serde(default = "stance")]
    stance: f64,
    /// How high the foot is lifted.
    #[serde(default)]
    lift: NonNegative<dim::Length>,
    /// Greatest pitch of the foot in its swing, toes down first.
    #[serde(default)]
    pitch: Quantity<dim::Angle>,
    /// How far it turns over all strides, right positive.
    #[serde(default)]
    turn: Quantity<dim::Angle>,
}

/// A default, as it is written in a design.
fn positive<D: Dimensional>(text: &str) -> Positive<D> {
    #[expect(clippy::expect_used, reason = "constants, and a test reads them")]
    Positive::from_text(text).expect("a quantity")
}

/// The stride of a person of average height at 1.3 m/s.
fn length() -> Positive<dim::Length> {
    positive("1.4 m")
}

fn period() -> Positive<dim::Duration> {
    positive("1.1 s")
}

const fn stance() -> f64 {
    0.4
}

crate::register!(
    Segment,
    "walk",
    WalkSpec,
    r#"
strides = 10
length = "60 cm"
period = "2 s"
stance = 0.4
lift = "8 cm"
pitch = "20 deg"
turn = "90 deg"
"#
);

/// The most strides of one segment: a day's walk.
const MOST_STRIDES: u32 = 100_000;

#[typetag::deserialize(name = "walk")]
impl SegmentSpec for WalkSpec {
    fn is_afloat(&self) -> bool {
        false
    }

    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        from.at_rest()?;
        if !(1..=MOST_STRIDES).contains(&self.strides) {
            return Err(BuildError::at(
                "strides",
                format!("a walk has from 1 to {MOST_STRIDES} strides, not {}", self.strides),
            ));
        }
        if !(self.stance > 0.0 && self.stance < 1.0) {
            return Err(BuildError::at(
                "stance",
                "a share between 0 and 1 of the stride is expected, such as 0.4",
            ));
        }
        let turn = self.turn.si() / f64::from(self.strides);
        let (mut places, mut position) = (vec![from.position], from.position);
        for stride in 0..self.strides {
            position += ahead(from.heading + turn * (f64::from(stride) + 0.5)) * self.length.si();
            places.push(position);
        }
        Ok(Box::new(Walk {
            heading: from.heading,
            turn,
            places,
            period: self.period.si(),
            stands: self.stance * self.period.si(),
            lift: self.lift.si(),
            pitch: self.pitch.si(),
        }))
    }
}

fn ahead(heading: f64) -> Vector3<f64> {
    let (s, c) = math::sin_cos(heading);
    Vector3::new(c, s, 0.0)
}

#[derive(Debug)]
struct Walk {
    heading: f64,
    /// In each stride \[rad\].
    turn: f64,
    /// The places of the foot before each stride, and after the last.
    places: Vec<Vector3<f64>>,
    period: f64,
    /// The part of it before the swing \[s\].
    stands: f64,
    lift: f64,
    pitch: f64,
}

impl Segment for Walk {
    fn duration(&self) -> f64 {
        (self.places.len() - 1) as f64 * self.period
    }

    fn at(&self, t: f64) -> Motion {
        let last = self.places.len() - 2;
        let stride = ((t / self.period).max(0.0) as usize).min(last);
        let swing = self.period - self.stands;
        let u = ((t - stride as f64 * self.period - self.stands) / swing).clamp(0.0, 1.0);
        let way = step7(u).stretched(1.0, swing);
        // sin⁴ πu and its derivatives: three of them vanish at both ends.
        let (s, c) = math::sin_cos(PI * u);
        let [up, rising, lifting] = [
            math::powi(s, 4),
            4.0 * PI * math::powi(s, 3) * c,
            4.0 * PI * PI * s * s * (3.0 * c * c - s * s),
        ];
        let (from, by) = (self.places[stride], self.places[stride + 1] - self.places[stride]);
        let height = -Vector3::z() * self.lift;
        let toes = pulse(u).1.stretched(-self.pitch, swing);
        Motion {
            position: from + by * way.value + height * up,
            velocity: by * way.first + height * (rising / swing),
            acceleration: by * way.second + height * (lifting / (swing * swing)),
            rpy: Vector3::new(0.0, toes.value, self.heading + self.turn * (stride as f64 + way.value)),
            rpy_rate: Vector3::new(0.0, toes.first, self.turn * way.first),
        }
    }

    fn end(&self) -> Junction {
        let strides = self.places.len() - 1;
        Junction {
            position: self.places[strides],
            heading: self.heading + self.turn * strides as f64,
            speed: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FROM: Junction = Junction {
        position: Vector3::new(3.0, -2.0, 1.0),
        heading: 0.7,
        speed: 0.0,
    };

    fn walk(text: &str) -> Result<Box<dyn Segment>, BuildError> {
        toml::from_str::<WalkSpec>(text).unwrap().build(&FROM)
    }

    #[test]
    fn the_foot_stands_still_in_every_stance_and_swings_over_the_whole_stride() {
        let walk = walk("strides = 10\nlift = '12 cm'\npitch = '40 deg'\nturn = '90 deg'").unwrap();
        assert!((walk.duration() - 11.0).abs() < 1e-12); // rounding
        for stride in 0..10 {
            let start = 1.1 * f64::from(stride);
            let stood = walk.at(start + 0.01);
            for t in [0.1, 0.2, 0.3, 0.43] {
                let m = walk.at(start + t);
                assert_eq!((m.velocity, m.acceleration, m.rpy_rate), Default::default());
                assert_eq!((m.position, m.rpy), (stood.position, stood.rpy));
            }
            let end = if stride < 9 {
                walk.at(start + 1.101).position
            } else {
                walk.end().position
            };
            assert!(((end - stood.position).norm() - 1.4).abs() < 1e-12); // rounding
            // Half way through the swing it is highest.
            let highest = walk.at(start + 0.44 + 0.33).position.z;
            assert!((highest - (FROM.position.z - 0.12)).abs() < 1e-9, "{highest}"); // rounding of the instant
        }
        assert!((walk.end().heading - FROM.heading - core::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn its_motion_is_the_integral_of_its_derivatives() {
        super::super::tests::assert_derivatives(
            walk("strides = 3\nlift = '12 cm'\npitch = '40 deg'\nturn = '90 deg'")
                .unwrap()
                .as_ref(),
        );
    }

    #[test]
    fn a_walk_without_strides_or_without_a_swing_names_the_field() {
        assert_eq!(walk("strides = 0").unwrap_err().field, "strides");
        assert_eq!(walk("strides = 2\nstance = 1.0").unwrap_err().field, "stance");
    }
}
