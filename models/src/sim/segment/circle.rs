//! A circle from the first instant on.

use super::{Junction, Motion, Segment, SegmentSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Positive, Quantity, dim};
use nalgebra::Vector3;
use schemars::JsonSchema;

/// Goes round a circle at the present speed, at a constant rate: unlike a `turn` it begins and ends
/// turning, so acceleration and turn rate jump at its ends. For a body that starts with a speed.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CircleSpec {
    /// How far to turn, right positive; 360 degrees is once round.
    angle: Quantity<dim::Angle>,
    /// How long that takes: the radius is the present speed times this over the angle.
    duration: Positive<dim::Duration>,
}

crate::register!(
    Segment,
    "circle",
    CircleSpec,
    r#"
angle = "360 deg"
duration = "40 s"
"#
);

#[typetag::deserialize(name = "circle")]
impl SegmentSpec for CircleSpec {
    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        from.moving()?;
        let (angle, duration) = (self.angle.si(), self.duration.si());
        if angle == 0.0 {
            let help = "a `straight` goes straight on";
            return Err(BuildError::at("angle", "a circle turns").help(help));
        }
        Ok(Box::new(Circle {
            from: *from,
            rate: angle / duration,
            duration,
        }))
    }
}

#[derive(Debug)]
struct Circle {
    from: Junction,
    rate: f64,
    duration: f64,
}

impl Segment for Circle {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn is_smooth(&self) -> bool {
        false
    }

    fn at(&self, t: f64) -> Motion {
        let Junction { position, heading, speed } = self.from;
        let now = Junction {
            heading: heading + self.rate * t,
            ..self.from
        };
        let ((ahead, right), (_, right_0)) = (now.axes(), self.from.axes());
        Motion {
            // From the centre out.
            position: position + (right_0 - right) * (speed / self.rate),
            velocity: ahead * speed,
            acceleration: right * (speed * self.rate),
            rpy: Vector3::new(0.0, 0.0, now.heading),
            rpy_rate: Vector3::new(0.0, 0.0, self.rate),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(toml: &str) -> Result<Box<dyn Segment>, BuildError> {
        let from = Junction {
            position: Vector3::zeros(),
            heading: 0.0,
            speed: 1.0,
        };
        toml::from_str::<CircleSpec>(toml).unwrap().build(&from)
    }

    #[test]
    fn once_round_is_where_it_began_and_half_of_it_a_diameter_to_the_right() {
        let whole = circle("angle = '360 deg'\nduration = 40").unwrap();
        let diameter = 40.0 / core::f64::consts::PI;
        // 1e-14: rounding of 12 m.
        assert!((whole.at(20.0).position - Vector3::new(0.0, diameter, 0.0)).norm() < 1e-14);
        assert!(whole.at(40.0).position.norm() < 1e-14);
        let field = |toml: &str| circle(toml).unwrap_err().field;
        assert_eq!(field("angle = 0\nduration = 40"), "angle");
    }
}
