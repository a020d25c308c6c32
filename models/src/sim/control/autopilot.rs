//! Heading by a PID law, lines by a look-ahead law that gives a heading.
//!
//! Heading    e = wrap(ψd − ψ̂), r = sat(Kp e + Ki ∫e dt − Kd ψ̂'), the integral only for small |e|
//! Line       e = −(N−N0) sin χ + (E−E0) cos χ, ψd = χ − atan((e + κ I)/Δ), I' = Δ e/(Δ² + (e + κ I)²)
//! Speed      min(U, least + k · way to go) if a way to go is given
//! ψ̂'         from two estimates, one period apart: the estimator only needs to give a heading
//! Source     heading: textbook; line: Børhaug, Pavlov, Pettersen, IEEE CDC 2008 (integral line of sight)

use super::{Command, Control, ControlSpec, Goal, Seen};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{NonNegative, Positive, dim};
use core::f64::consts::FRAC_PI_2;
use fusion_core::geometry::so3::wrap_angle;
use fusion_core::math;
use schemars::JsonSchema;
use serde::Deserialize;

/// Holds headings and follows lines, by the filter's own estimate.
#[derive(Clone, Copy, Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AutopilotSpec {
    /// How often it runs.
    rate: Positive<dim::Frequency>,
    /// How it holds a heading.
    heading: HeadingSpec,
    /// How it follows a line; needed by tasks that do.
    line: Option<LineSpec>,
    /// How it slows down before the end of a way.
    #[serde(default)]
    approach: ApproachSpec,
}

/// Gains of the heading law.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct HeadingSpec {
    /// Rate of turn per error of the heading, Kp \[1/s\].
    proportional: Positive<dim::Frequency>,
    /// Rate of turn per integral of the error, Ki \[1/s²\].
    #[serde(default)]
    integral: NonNegative<dim::Ratio>,
    /// Rate of turn per rate of the heading, Kd.
    #[serde(default)]
    derivative: NonNegative<dim::Ratio>,
    /// The integral grows only while the error is smaller than this; 15 degrees without it.
    integral_within: Option<Positive<dim::Angle>>,
    /// Greatest commanded rate of turn.
    max_rate: Positive<dim::AngularRate>,
}

/// Parameters of the line law.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LineSpec {
    /// How far ahead on the line it aims, Δ.
    look_ahead: Positive<dim::Length>,
    /// Weight of the integral of the cross-track error, κ.
    #[serde(default)]
    integral: NonNegative<dim::Ratio>,
}

/// Speed before the end of a way.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ApproachSpec {
    /// Speed at the very end; 0.05 m/s without it.
    least: Option<Positive<dim::Speed>>,
    /// Speed per distance that is left; 0.25 1/s without it.
    gain: Option<Positive<dim::Frequency>>,
}

crate::register!(
    Control,
    "autopilot",
    AutopilotSpec,
    r#"
rate = "10 Hz"
heading = { proportional = 1.2, integral = 0.3, derivative = 0.2, max_rate = "0.4 rad/s" }
line = { look_ahead = "1.5 m", integral = 0.05 }
"#
);

#[typetag::deserialize(name = "autopilot")]
impl ControlSpec for AutopilotSpec {
    fn rate(&self) -> f64 {
        self.rate.si()
    }

    fn build(&self) -> Result<Box<dyn Control>, BuildError> {
        let (heading, line) = (self.heading, self.line);
        Ok(Box::new(Autopilot {
            gains: [heading.proportional.si(), heading.integral.si(), heading.derivative.si()],
            within: heading.integral_within.map_or(15_f64.to_radians(), |w| w.si()),
            max_rate: heading.max_rate.si(),
            // Without a control law for lines it aims infinitely far ahead, and so runs parallel to them.
            look_ahead: line.map_or(f64::INFINITY, |l| l.look_ahead.si()),
            line_integral: line.map_or(0.0, |l| l.integral.si()),
            least: self.approach.least.map_or(0.05, |v| v.si()),
            gain: self.approach.gain.map_or(0.25, |k| k.si()),
            sum: 0.0,
            line_sum: 0.0,
            last: None,
            aim: None,
        }))
    }

    fn follows_lines(&self) -> bool {
        self.line.is_some()
    }
}

#[derive(Clone, Debug)]
struct Autopilot {
    gains: [f64; 3],
    within: f64,
    max_rate: f64,
    look_ahead: f64,
    line_integral: f64,
    least: f64,
    gain: f64,
    /// ∫ of the heading error \[rad s\].
    sum: f64,
    /// I of the line law \[m\].
    line_sum: f64,
    last: Option<Seen>,
    /// The heading wanted \[rad\].
    aim: Option<f64>,
}

impl Autopilot {
    /// The heading that leads to the line; `dt` since the last time.
    fn aim(&mut self, across: f64, course: f64, dt: f64) -> f64 {
        let weighed = across + self.line_integral * self.line_sum;
        if self.look_ahead.is_finite() {
            let ahead = self.look_ahead;
            self.line_sum += ahead * across / (ahead * ahead + weighed * weighed) * dt;
        }
        course - math::atan(weighed / self.look_ahead)
    }

    fn turn(&mut self, heading: f64, seen: &Seen, before: Option<&Seen>, dt: f64) -> f64 {
        let [kp, ki, kd] = self.gains;
        let error = wrap_angle(heading - seen.heading);
        if error.abs() < self.within {
            self.sum += error * dt;
        }
        let rate = before.map_or(0.0, |b| wrap_angle(seen.heading - b.heading) / dt);
        (kp * error + ki * self.sum - kd * rate).clamp(-self.max_rate, self.max_rate)
    }

    fn slowed(&self, speed: f64, to_go: f64) -> f64 {
        speed.min(self.least + self.gain * to_go.max(0.0))
    }
}

impl Control for Autopilot {
    fn begin(&mut self) {
        (self.sum, self.line_sum, self.last, self.aim) = (0.0, 0.0, None, None);
    }

    fn command(&mut self, goal: &Goal, seen: &Seen) -> Command {
        let before = self.last.replace(*seen).filter(|b| b.time < seen.time);
        let dt = before.map_or(0.0, |b| seen.time.seconds_since(b.time));
        let (heading, speed) = match *goal {
            Goal::Stand => {
                self.aim = None;
                return Command::default();
            }
            Goal::Heading { heading, speed, to_go } => (heading, to_go.map_or(speed, |way| self.slowed(speed, way))),
            Goal::Line {
                from,
                course,
                speed,
                to_go,
            } => {
                let (sin, cos) = math::sin_cos(course);
                let off = seen.position - from;
                let heading = self.aim(off.y * cos - off.x * sin, course, dt);
                // A vehicle with another heading turns first.
                let faces = wrap_angle(heading - seen.heading).abs() < FRAC_PI_2 / 2.0;
                (heading, if faces { self.slowed(speed, to_go) } else { 0.0 })
            }
        };
        self.aim = Some(heading);
        Command {
            speed,
            turn: self.turn(heading, seen, before.as_ref(), dt),
        }
    }

    fn heading(&self) -> Option<f64> {
        self.aim
    }
}
