//! Rest, straight run, crooked run.

use super::super::profile::{Along, Jet, Wanted, step7};
use super::{Junction, Motion, Segment, SegmentSpec};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{NonNegative, Positive, Quantity, dim};
use core::f64::consts::TAU;
use fusion_core::math;
use nalgebra::Vector3;
use schemars::JsonSchema;

/// Default greatest acceleration \[m/s²\].
const ACCELERATION: f64 = 0.2;

/// Stands still.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RestSpec {
    /// How long.
    duration: Positive<dim::Duration>,
}

crate::register!(Segment, "rest", RestSpec, r#"duration = "60 s""#);

#[typetag::deserialize(name = "rest")]
impl SegmentSpec for RestSpec {
    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        from.at_rest()?;
        Ok(Box::new(Rest {
            from: *from,
            duration: self.duration.si(),
        }))
    }
}

#[derive(Debug)]
struct Rest {
    from: Junction,
    duration: f64,
}

impl Segment for Rest {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, _: f64) -> Motion {
        Motion {
            position: self.from.position,
            rpy: Vector3::new(0.0, 0.0, self.from.heading),
            ..Motion::default()
        }
    }
}

/// Runs straight ahead, changing speed at its start and, where declared, at its end.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StraightSpec {
    /// Duration; this or `distance`.
    duration: Option<Positive<dim::Duration>>,
    /// Distance; this or `duration`.
    distance: Option<Positive<dim::Length>>,
    /// Speed to run at; the present one by default.
    speed: Option<NonNegative<dim::Speed>>,
    /// Speed at the end; `speed` by default.
    end_speed: Option<NonNegative<dim::Speed>>,
    /// Greatest acceleration; 0.2 m/s² by default.
    acceleration: Option<Positive<dim::Acceleration>>,
}

crate::register!(
    Segment,
    "straight",
    StraightSpec,
    r#"
distance = "60 m"
speed = "1 m/s"
end_speed = 0
acceleration = "0.2 m/s^2"
"#
);

#[typetag::deserialize(name = "straight")]
impl SegmentSpec for StraightSpec {
    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        let along = Along::new(
            from.speed,
            Wanted {
                duration: self.duration.map(Quantity::si),
                distance: self.distance.map(Quantity::si),
                speed: self.speed.map(Quantity::si),
                end_speed: self.end_speed.map(Quantity::si),
                acceleration: self.acceleration.map_or(ACCELERATION, Quantity::si),
            },
        )?;
        Ok(Box::new(Straight { from: *from, along }))
    }
}

#[derive(Debug)]
struct Straight {
    from: Junction,
    along: Along,
}

impl Segment for Straight {
    fn duration(&self) -> f64 {
        self.along.duration()
    }

    fn at(&self, t: f64) -> Motion {
        let (ahead, _) = self.from.axes();
        let s = self.along.at(t);
        Motion {
            position: self.from.position + ahead * s.value,
            velocity: ahead * s.first,
            acceleration: ahead * s.second,
            rpy: Vector3::new(0.0, 0.0, self.from.heading),
            ..Motion::default()
        }
    }
}

/// Runs ahead while swinging from side to side, the nose along the path. Progress along the axis
/// is the same as in a straight run, so the speed over ground is slightly greater.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SineSpec {
    /// Greatest distance from the axis, first to the right; negative: first to the left.
    amplitude: Quantity<dim::Length>,
    /// Length of one swing along the axis. The swing fades in and out over a quarter of it.
    wavelength: Positive<dim::Length>,
    /// Duration; this or `distance`.
    duration: Option<Positive<dim::Duration>>,
    /// How far along the axis; this or `duration`.
    distance: Option<Positive<dim::Length>>,
    /// Speed along the axis; the present one by default.
    speed: Option<NonNegative<dim::Speed>>,
    /// Speed at the end; `speed` by default.
    end_speed: Option<NonNegative<dim::Speed>>,
    /// Greatest acceleration along the axis; 0.2 m/s² by default.
    acceleration: Option<Positive<dim::Acceleration>>,
}

crate::register!(
    Segment,
    "sine",
    SineSpec,
    r#"
distance = "20 m"
amplitude = "0.5 m"
wavelength = "20 m"
speed = "1 m/s"
end_speed = 0
"#
);

#[typetag::deserialize(name = "sine")]
impl SegmentSpec for SineSpec {
    fn build(&self, from: &Junction) -> Result<Box<dyn Segment>, BuildError> {
        let along = Along::new(
            from.speed,
            Wanted {
                duration: self.duration.map(Quantity::si),
                distance: self.distance.map(Quantity::si),
                speed: self.speed.map(Quantity::si),
                end_speed: self.end_speed.map(Quantity::si),
                acceleration: self.acceleration.map_or(ACCELERATION, Quantity::si),
            },
        )?;
        let (length, wavelength) = (along.distance(), self.wavelength.si());
        if length <= 0.0 {
            return Err(BuildError::at("speed", "a body at rest does not swing").help("state a `speed`"));
        }
        let fade = (0.25 * wavelength).min(0.5 * length);
        Ok(Box::new(Sine {
            from: *from,
            along,
            length,
            amplitude: self.amplitude.si(),
            wavelength,
            fade,
        }))
    }
}

#[derive(Debug)]
struct Sine {
    from: Junction,
    along: Along,
    length: f64,
    amplitude: f64,
    wavelength: f64,
    fade: f64,
}

impl Sine {
    /// Distance to the right of the axis and its derivatives with distance along it.
    fn right(&self, x: f64) -> Jet {
        let k = TAU / self.wavelength;
        let (s, c) = math::sin_cos(k * x);
        let swing = Jet {
            value: s,
            first: k * c,
            second: -k * k * s,
        };
        let fade = if x < 0.5 * self.length {
            step7(x / self.fade).stretched(1.0, self.fade)
        } else {
            step7((self.length - x) / self.fade).stretched(1.0, -self.fade)
        };
        Jet {
            value: self.amplitude * fade.value * swing.value,
            first: self.amplitude * (fade.first * swing.value + fade.value * swing.first),
            second: self.amplitude * (fade.second * swing.value + 2.0 * fade.first * swing.first + fade.value * swing.second),
        }
    }
}

impl Segment for Sine {
    fn duration(&self) -> f64 {
        self.along.duration()
    }

    fn at(&self, t: f64) -> Motion {
        let (ahead, right) = self.from.axes();
        let x = self.along.at(t);
        let y = self.right(x.value);
        let turned = y.second * x.first / (1.0 + y.first * y.first);
        Motion {
            position: self.from.position + ahead * x.value + right * y.value,
            velocity: (ahead + right * y.first) * x.first,
            acceleration: ahead * x.second + right * (x.second * y.first + x.first * x.first * y.second),
            rpy: Vector3::new(0.0, 0.0, self.from.heading + math::atan(y.first)),
            rpy_rate: Vector3::new(0.0, 0.0, turned),
        }
    }
}
