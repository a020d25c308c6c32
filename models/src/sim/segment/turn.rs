//! Turns: along an arc, and on the spot.

use super::super::profile::Turn as Profile;
use super::{Junction, Motion, Segment, SegmentSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Positive, Quantity, STANDARD_GRAVITY, dim};
use core::f64::consts::PI;
use fusion_core::math;
use nalgebra::{Vector2, Vector3};
use schemars::JsonSchema;

/// Turns at the present speed on a level plane. The turn rate ramps up in the first quarter of the time and
/// down in the last quarter. The path ends exactly at the end of the arc with `radius`.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TurnSpec {
    /// How far to turn, right positive, at most 270 degrees; two half turns make a full circle.
    angle: Quantity<dim::Angle>,
    /// Radius of the arc with the same ends; the path is tighter by a fifth to a quarter at its tightest
    /// point. This or `rate`.
    radius: Option<Positive<dim::Length>>,
    /// Turn rate on the arc with the same ends; this or `radius`.
    rate: Option<Positive<dim::AngularRate>>,
    /// Whether the body leans into the turn, so that it feels no side force.
    #[serde(default)]
    bank: bool,
}

crate::register!(
    Segment,
    "turn",
    TurnSpec,
    r#"
angle = "90 deg"
radius = "5 m"
bank = true
"#
);

#[typetag::deserialize(name = "turn")]
impl SegmentSpec for TurnSpec {
    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        let (speed, angle) = (from.moving()?, self.angle.si());
        // 1e-9: a rounding beyond the limit is allowed.
        if angle == 0.0 || angle.abs() > 1.5 * PI + 1e-9 {
            let help = "two turns of 180 degrees make a full circle";
            return Err(BuildError::at("angle", "a turn is of 270 degrees at most, and not 0").help(help));
        }
        let radius = match (self.radius, self.rate) {
            (Some(radius), None) => radius.si(),
            (None, Some(rate)) => speed / rate.si(),
            _ => return Err(BuildError::at("radius", "state either `radius` or `rate`")),
        };
        let mut turn = Turn {
            from: *from,
            angle,
            duration: 1.0,
            bank: self.bank,
        };
        let chord = speed * turn.displacement(1.0).norm();
        turn.duration = 2.0 * radius * math::sin(0.5 * angle).abs() / chord;
        Ok(Box::new(turn))
    }
}

#[derive(Debug)]
struct Turn {
    from: Junction,
    angle: f64,
    duration: f64,
    bank: bool,
}

/// Positive nodes on \[−1, 1\] and weights of 16-point Gauss-Legendre quadrature.
const GAUSS: [(f64, f64); 8] = [
    (0.095_012_509_837_637_44, 0.189_450_610_455_068_5),
    (0.281_603_550_779_258_9, 0.182_603_415_044_923_58),
    (0.458_016_777_657_227_37, 0.169_156_519_395_002_54),
    (0.617_876_244_402_643_8, 0.149_595_988_816_576_73),
    (0.755_404_408_355_003, 0.124_628_971_255_533_88),
    (0.865_631_202_387_831_8, 0.095_158_511_682_492_79),
    (0.944_575_023_073_232_6, 0.062_253_523_938_647_894),
    (0.989_400_934_991_649_9, 0.027_152_459_411_754_096),
];

impl Turn {
    /// ∫ (cos, sin) of the angle turned, over \[0, u\]: exact to rounding, since each of the three
    /// parts of the profile is a polynomial that turns by less than π.
    fn displacement(&self, u: f64) -> Vector2<f64> {
        let direction = |u: f64| {
            let (s, c) = math::sin_cos(self.angle * Profile::at(u).value);
            Vector2::new(c, s)
        };
        let mut sum = Vector2::zeros();
        for (from, to) in [
            (0.0, Profile::RAMP),
            (Profile::RAMP, 1.0 - Profile::RAMP),
            (1.0 - Profile::RAMP, 1.0),
        ] {
            let (half, middle) = (0.5 * (u.min(to) - from), 0.5 * (u.min(to) + from));
            if half <= 0.0 {
                break;
            }
            for (node, weight) in GAUSS {
                sum += (direction(middle - half * node) + direction(middle + half * node)) * (half * weight);
            }
        }
        sum
    }
}

impl Segment for Turn {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> Motion {
        let u = t / self.duration;
        let turned = Profile::at(u).stretched(self.angle, self.duration);
        let heading = self.from.heading + turned.value;
        let (ahead, right) = Junction { heading, ..self.from }.axes();
        let (ahead_0, right_0) = self.from.axes();
        let (speed, d) = (self.from.speed, self.displacement(u) * self.duration);
        let lean = speed * turned.first / STANDARD_GRAVITY;
        let lean_rate = speed * turned.second / STANDARD_GRAVITY / (1.0 + lean * lean);
        let (roll, roll_rate) = if self.bank { (math::atan(lean), lean_rate) } else { (0.0, 0.0) };
        Motion {
            position: self.from.position + (ahead_0 * d.x + right_0 * d.y) * speed,
            velocity: ahead * speed,
            acceleration: right * (speed * turned.first),
            rpy: Vector3::new(roll, 0.0, heading),
            rpy_rate: Vector3::new(roll_rate, 0.0, turned.first),
        }
    }
}

/// Turns on the spot, at rest.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotateInPlaceSpec {
    /// How far to turn, right positive; any number of turns.
    angle: Quantity<dim::Angle>,
    /// Greatest turn rate.
    rate: Positive<dim::AngularRate>,
}

crate::register!(
    Segment,
    "rotate_in_place",
    RotateInPlaceSpec,
    r#"
angle = "90 deg"
rate = "20 deg/s"
"#
);

#[typetag::deserialize(name = "rotate_in_place")]
impl SegmentSpec for RotateInPlaceSpec {
    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        from.at_rest()?;
        let duration = Profile::PEAK * self.angle.si().abs() / self.rate.si();
        if duration <= 0.0 {
            return Err(BuildError::at("angle", "a turn of 0 takes no time"));
        }
        Ok(Box::new(RotateInPlace {
            from: *from,
            angle: self.angle.si(),
            duration,
        }))
    }
}

#[derive(Debug)]
struct RotateInPlace {
    from: Junction,
    angle: f64,
    duration: f64,
}

impl Segment for RotateInPlace {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> Motion {
        let turned = Profile::at(t / self.duration).stretched(self.angle, self.duration);
        Motion {
            position: self.from.position,
            rpy: Vector3::new(0.0, 0.0, self.from.heading + turned.value),
            rpy_rate: Vector3::new(0.0, 0.0, turned.first),
            ..Motion::default()
        }
    }
}
