//! Flight of a multicopter: take-off, landing, any way through the air, hovering.
//!
//! The nose does not follow the velocity: the body leans so that its thrust, along its own vertical, gives the
//! acceleration. With the acceleration a in level axes along the nose and to its right,
//!
//! ```text
//! pitch = atan2(−aₓ, g − a_z),   roll = asin(a_y / |a − g|)
//! ```
//!
//! so that an accelerometer feels nothing ahead and nothing sideways. Air drag is left out: at a constant speed the
//! body is level.

use super::super::profile::{step7, step7_third};
use super::{Junction, Motion, Segment, SegmentSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{NonNegative, Positive, Quantity, STANDARD_GRAVITY, Vec3Of, dim};
use core::f64::consts::TAU;
use fusion_core::math;
use nalgebra::Vector3;
use schemars::JsonSchema;

/// The greatest slope of [`step7`].
const STEP7_SLOPE: f64 = 2.1875;

/// Flies from rest to rest along a straight line in any direction: straight up, it takes off. The body leans into
/// its accelerations; the nose turns to another heading on the way, or stays.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlySpec {
    /// Where to, from where it is: north, east, down.
    by: Vec3Of<dim::Length>,
    /// Greatest speed on the way, reached halfway.
    speed: Positive<dim::Speed>,
    /// How far the nose turns meanwhile, right positive.
    #[serde(default)]
    turn: Quantity<dim::Angle>,
}

crate::register!(
    Segment,
    "fly",
    FlySpec,
    r#"
by = [0, 0, "-10 m"]
speed = "2 m/s"
turn = "90 deg"
"#
);

#[typetag::deserialize(name = "fly")]
impl SegmentSpec for FlySpec {
    fn is_afloat(&self) -> bool {
        false
    }

    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        from.at_rest()?;
        let by = Vector3::from(self.by.si());
        let duration = STEP7_SLOPE * by.norm() / self.speed.si();
        if duration <= 0.0 {
            let help = "`hover` stays, `rotate_in_place` turns on the spot";
            return Err(BuildError::at("by", "a flight of 0 m takes no time").help(help));
        }
        Ok(Box::new(Fly {
            from: *from,
            by,
            turn: self.turn.si(),
            duration,
        }))
    }
}

#[derive(Debug)]
struct Fly {
    from: Junction,
    by: Vector3<f64>,
    turn: f64,
    duration: f64,
}

impl Segment for Fly {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> Motion {
        let u = t / self.duration;
        let way = step7(u).stretched(1.0, self.duration);
        let jerk = self.by * (step7_third(u) / math::powi(self.duration, 3));
        let nose = (self.from.heading + self.turn * way.value, self.turn * way.first);
        leaning(
            self.from.position + self.by * way.value,
            [self.by * way.first, self.by * way.second, jerk],
            nose,
        )
    }

    fn end(&self) -> Junction {
        Junction {
            position: self.from.position + self.by,
            heading: self.from.heading + self.turn,
            speed: 0.0,
        }
    }
}

/// Holds its place in the air, swaying round it in circles that grow from nothing and end there.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HoverSpec {
    /// How long.
    duration: Positive<dim::Duration>,
    /// Greatest distance from the place.
    #[serde(default)]
    sway: NonNegative<dim::Length>,
    /// Seconds of one circle, which is fitted so that a whole number of them is flown.
    period: Option<Positive<dim::Duration>>,
}

crate::register!(
    Segment,
    "hover",
    HoverSpec,
    r#"
duration = "20 s"
sway = "0.3 m"
period = "4 s"
"#
);

#[typetag::deserialize(name = "hover")]
impl SegmentSpec for HoverSpec {
    fn is_afloat(&self) -> bool {
        false
    }

    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        from.at_rest()?;
        let (duration, sway) = (self.duration.si(), self.sway.si());
        let circles = match self.period {
            Some(period) => math::round(duration / period.si()),
            None if sway > 0.0 => return Err(BuildError::at("period", "how long does it sway round once?").help("add `period = \"4 s\"`")),
            None => 0.0,
        };
        if sway > 0.0 && circles < 1.0 {
            return Err(BuildError::at("period", "the hover ends before one circle").help("a shorter `period`, or a longer `duration`"));
        }
        Ok(Box::new(Hover {
            from: *from,
            duration,
            sway,
            circles,
        }))
    }
}

#[derive(Debug)]
struct Hover {
    from: Junction,
    duration: f64,
    sway: f64,
    circles: f64,
}

/// sin⁴ πu as a Fourier series: the harmonic of 2πu and its weight. Three derivatives vanish at both ends.
const FADE: [(f64, f64); 5] = [(-2.0, 0.0625), (-1.0, -0.25), (0.0, 0.375), (1.0, -0.25), (2.0, 0.0625)];

impl Segment for Hover {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> Motion {
        // The circle times the fade is a sum of circles, whose derivatives are turned by a quarter each.
        let mut derivatives = [Vector3::zeros(); 4];
        for (harmonic, weight) in FADE {
            let rate = TAU * (self.circles + harmonic) / self.duration;
            let (s, c) = math::sin_cos(rate * t);
            let (mut along, mut size) = (Vector3::new(s, c, 0.0), self.sway * weight);
            for derivative in &mut derivatives {
                *derivative += along * size;
                along = Vector3::new(along.y, -along.x, 0.0);
                size *= rate;
            }
        }
        let [moved, rest @ ..] = derivatives;
        leaning(self.from.position + moved, rest, (self.from.heading, 0.0))
    }

    fn end(&self) -> Junction {
        self.from
    }
}

/// The motion of a body that leans into its acceleration: from its position, the velocity, acceleration and jerk, all
/// north-east-down, and the heading with its rate.
fn leaning(position: Vector3<f64>, [velocity, acceleration, jerk]: [Vector3<f64>; 3], (heading, turning): (f64, f64)) -> Motion {
    let (s, c) = math::sin_cos(heading);
    let level = |v: &Vector3<f64>| Vector3::new(c * v.x + s * v.y, c * v.y - s * v.x, v.z);
    // Thrust per mass, upside down, in level axes that turn with the nose, and its derivative there.
    let down = Vector3::z() * STANDARD_GRAVITY - level(&acceleration);
    let change = -level(&jerk) + Vector3::new(-down.y, down.x, 0.0) * -turning;
    let (size, plane) = (down.norm(), math::hypot(down.x, down.z));
    let lean = -down.y / size;
    let lean_rate = -(change.y - down.y * down.dot(&change) / (size * size)) / size;
    Motion {
        position,
        velocity,
        acceleration,
        rpy: Vector3::new(math::asin(lean), math::atan2(down.x, down.z), heading),
        rpy_rate: Vector3::new(
            lean_rate * size / plane,
            (change.x * down.z - down.x * change.z) / (plane * plane),
            turning,
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    const FROM: Junction = Junction {
        position: Vector3::new(3.0, -2.0, 1.0),
        heading: 0.7,
        speed: 0.0,
    };

    fn fly(text: &str) -> Result<Box<dyn Segment>, BuildError> {
        toml::from_str::<FlySpec>(text).unwrap().build(&FROM)
    }

    fn hover(text: &str) -> Result<Box<dyn Segment>, BuildError> {
        toml::from_str::<HoverSpec>(text).unwrap().build(&FROM)
    }

    fn flights() -> [Box<dyn Segment>; 4] {
        [
            fly("by = [0, 0, '-10 m']\nspeed = '2 m/s'").unwrap(),
            fly("by = [20, -5, -3]\nspeed = '8 m/s'").unwrap(),
            fly("by = [20, -5, -3]\nspeed = '8 m/s'\nturn = '200 deg'").unwrap(),
            hover("duration = 20\nsway = '0.5 m'\nperiod = '4 s'").unwrap(),
        ]
    }

    #[test]
    fn its_motion_is_the_integral_of_its_derivatives() {
        flights()
            .iter()
            .for_each(|flight| super::super::tests::assert_derivatives(flight.as_ref()));
    }

    #[test]
    fn an_accelerometer_feels_the_thrust_along_its_own_vertical_alone() {
        for flight in flights() {
            for k in 0..=100 {
                let m = flight.at(flight.duration() * f64::from(k) / 100.0);
                let force = m.attitude().inverse() * (m.acceleration - Vector3::z() * STANDARD_GRAVITY);
                assert!(force.xy().norm() < 1e-12 && force.z < 0.0, "{force}"); // rounding at 10 m/s²
            }
        }
    }

    #[test]
    fn take_off_is_vertical_and_its_greatest_speed_is_the_one_declared() {
        let flight = &flights()[0];
        let speeds = (0..=1000).map(|k| flight.at(flight.duration() * f64::from(k) / 1000.0));
        let greatest = speeds.map(|m| {
            assert_eq!((m.position.xy(), m.rpy.xy()), (FROM.position.xy(), Vector2::zeros()));
            -m.velocity.z
        });
        assert!((greatest.fold(0.0, f64::max) - 2.0).abs() < 1e-12); // rounding
        let end = flight.at(flight.duration());
        assert!((end.position - flight.end().position).norm() < 1e-12 && end.velocity.norm() < 1e-12);
    }

    #[test]
    fn a_hover_stays_within_its_sway_and_leans_as_far_as_that_asks_for() {
        let flight = &flights()[3];
        let (mut away, mut lean) = (0.0_f64, 0.0_f64);
        for k in 0..=2000 {
            let m = flight.at(20.0 * f64::from(k) / 2000.0);
            away = away.max((m.position - FROM.position).norm());
            lean = lean.max((m.rpy.x.cos() * m.rpy.y.cos()).acos());
        }
        assert!((away - 0.5).abs() < 1e-6, "{away}"); // grid
        // ω² r over g in the middle; 5 %: the fade.
        let expected = ((TAU / 4.0).powi(2) * 0.5 / STANDARD_GRAVITY).atan();
        assert!((lean / expected - 1.0).abs() < 0.05, "{lean} {expected}");
        let (start, end) = (flight.at(0.0), flight.at(20.0));
        assert!((end.position - start.position).norm() < 1e-12 && start.velocity.norm() < 1e-12); // rounding
    }

    #[test]
    fn what_cannot_be_flown_names_the_field() {
        assert_eq!(fly("by = [0, 0, 0]\nspeed = 2").unwrap_err().field, "by");
        assert_eq!(hover("duration = 2\nsway = 1").unwrap_err().field, "period");
        assert_eq!(hover("duration = 2\nsway = 1\nperiod = 9").unwrap_err().field, "period");
    }
}
