//! An inertial unit with positions.

use super::Told;
use super::draft::{Draft, list};
use crate::inspect::page::{degrees, vector};
use crate::inspect::signal::Kind::{AngularRate, BodyVelocity, SpecificForce, Speed};
use crate::inspect::{Imu, Inspection, Rest, Stances, Track};
use fusion_core::math;

/// The factor from densities at rest to densities under vibration.
const SHAKEN: f64 = 3.0;
/// Motion changes the bias of the gyros by this, 1σ \[deg/s\].
const BIAS: f64 = 0.05;
/// No unit is assumed better in motion \[m/s²/√Hz\], \[rad/s/√Hz\].
const FLOOR: (f64, f64) = (8e-3, 2e-4);

impl Inspection {
    pub(super) fn strapdown(&self, draft: &mut Draft) {
        let Some((k, imu)) = &self.imu else { return };
        draft.part("strapdown");
        self.noise(draft, imu);
        self.apart(draft);
        if imu.stances.is_some() {
            draft.part("foot in motion");
        } else if let Some((force, rate)) = imu.agile {
            draft.part("fast turns");
            draft.set("agility.acceleration", format!("{:.0} m/s^2", 2.0 * force));
            draft.set("agility.angular_rate", format!("{:.0} deg/s", 2.0 * rate.to_degrees()));
        }
        self.start(draft, imu);
        let is_car = self.is_road_vehicle();
        draft.part("aids");
        self.position_sensors(draft, true, None);
        self.barometer(draft);
        self.compasses(draft);
        if is_car {
            self.road(draft, imu);
        }
        if let Some(stances) = &imu.stances {
            foot(draft, stances);
        }
        self.log_or_wheels(draft);
        self.water(draft, false);
        draft.part("data");
        draft.note(&format!(
            "guessed: mean force {} m/s² in sensor axes: {} is up",
            vector(imu.gravity, 2),
            crate::inspect::page::axis(imu.up)
        ));
        draft.note(&self.ahead());
        self.source(draft, "imu", *k, &[AngularRate, SpecificForce], None);
        self.position_source(draft);
    }

    /// An inertial unit on a foot, without positions: the path relative to its start.
    pub(super) fn walk(&self, draft: &mut Draft) {
        let Some((k, imu)) = &self.imu else { return };
        let Some(stances) = &imu.stances else { return };
        draft.part("strapdown");
        self.noise(draft, imu);
        self.apart(draft);
        draft.part("foot in motion");
        self.levelling(draft, imu);
        if self.told() == Told::Field {
            draft.part("heading by field");
        }
        draft.part("start of a walk");
        if self.told() != Told::Field {
            draft.part("heading of a walk");
        }
        draft.part("aids");
        self.compasses(draft);
        foot(draft, stances);
        draft.part("data");
        draft.note(&format!("guessed: {} is up", crate::inspect::page::axis(imu.up)));
        self.source(draft, "imu", *k, &[AngularRate, SpecificForce], None);
    }

    /// Whether the names of the unit's columns say forward, right, down.
    pub(super) fn is_named_unit(&self) -> bool {
        let unit = self.imu.as_ref().and_then(|(k, _)| self.logs[*k].signal(SpecificForce));
        unit.is_some_and(|s| s.is_body)
    }

    /// The reason for the forward axis.
    pub(super) fn ahead(&self) -> String {
        let found = self.pair.and_then(|p| p.ahead());
        found.map_or_else(
            || {
                if self.is_named_unit() {
                    return "by the names of the columns: forward, right, down".to_owned();
                }
                if let Some(turned) = self.turned {
                    return format!(
                        "guessed: ahead is x of the velocity log, {:.0} ± {:.0} deg from the first horizontal axis: its changes agree with the forces there",
                        turned.angle.to_degrees(),
                        turned.sigma.to_degrees()
                    );
                }
                "not decided: nothing here tells which axis is ahead, the first horizontal one is taken. For another one turn \
                 `rotation` about the vertical: of [\"x\", \"y\", \"z\"] to [\"y\", \"-x\", \"z\"] or [\"-x\", \"-y\", \"z\"]"
                    .to_owned()
            },
            |(angle, c)| {
                let rest = angle.to_degrees() - 90.0 * math::round(angle.to_degrees() / 90.0);
                format!("guessed: ahead by forces and accelerations of the track (correlation {c:.2}), to a quarter turn; {rest:.1} deg are left")
            },
        )
    }

    /// Noise and biases.
    fn noise(&self, draft: &mut Draft, imu: &Imu) {
        let is_foot = imu.stances.is_some();
        // A foot at rest is never quite still: its readings there give neither the noise nor the bias.
        let rest = imu.rest.as_ref().filter(|_| !is_foot);
        let shaken = |of: fn(&Rest) -> f64, floor: f64| rest.map_or(floor, |r| (SHAKEN * of(r)).max(floor));
        let (force, rate) = (shaken(|r| r.accel_noise, FLOOR.0), shaken(|r| r.gyro_noise, FLOOR.1));
        let why = |measured: Option<f64>| match measured {
            Some(m) => format!("guessed: three times the {m:.1e} at rest, or the least that a shaken unit has"),
            None if is_foot => "guessed: a foot at rest still moves a little; the noise of a shaken unit".to_owned(),
            None => "guessed: no rest in this log; the noise of a shaken unit".to_owned(),
        };
        draft.guess("gyro.noise", format!("{rate:.1e} rad/s/sqrt(Hz)"), &why(rest.map(|r| r.gyro_noise)));
        let of_force = why(rest.map(|r| r.accel_noise));
        draft.guess("accelerometer.noise", format!("{force:.1e} m/s^2/sqrt(Hz)"), &of_force);
        let sigma = if rest.is_some() { BIAS } else { 10.0 * BIAS };
        draft.set("gyro.bias.sigma", format!("{sigma} deg/s"));
        let unit = "guessed: a micro-mechanical unit; see configs/parts/imu for data sheets";
        self.gyro_bias(draft, "gyro.bias", rest, unit);
    }

    /// The gyro bias in body axes, if a rest shows it. `unit` is the reason for its 1σ.
    pub(super) fn gyro_bias(&self, draft: &mut Draft, key: &str, rest: Option<&Rest>, unit: &str) {
        let Some(rest) = rest else { return draft.reason(key, unit) };
        let bias = degrees(self.in_body(rest.bias)).map(|b| format!("{b:.2} deg/s"));
        draft.set(&format!("{key}.initial"), list(bias));
        draft.reason(key, &format!("{unit}; its mean rate at rest"));
    }

    /// The initialisers.
    fn start(&self, draft: &mut Draft, imu: &Imu) {
        let Some((_, track)) = &self.position else { return };
        self.levelling(draft, imu);
        draft.part("fix");
        self.first_height(draft);
        self.first_sigma(draft, 1.5, "one and a half of the 1σ guessed below");
        let told = self.told();
        // A first fix uses a velocity only if it has a vertical part.
        let takes_velocity = self.velocity.is_none() && !self.has_flat_velocity();
        if told == Told::Course && takes_velocity {
            draft.set("velocity_sigma", "1 m/s");
        }
        match told {
            Told::Course => self.by_course(draft, track),
            Told::Heading => draft.part("heading by compass"),
            Told::Field => draft.part("heading by field"),
            Told::Nobody => {}
        }
        if told != Told::Course || !takes_velocity {
            draft.part("start");
            if told == Told::Course {
                draft.guess(
                    "velocity_sigma",
                    format!("{:.1} m/s", track.top_speed()),
                    "guessed: the usual top speed",
                );
            } else if let Some(speed) = self.initial_speed() {
                let why = "guessed: the fixes move there at this speed";
                draft.guess("velocity_sigma", format!("{speed:.1} m/s"), why);
            }
        }
        if told == Told::Nobody {
            draft.part("any heading");
        }
    }

    /// The speed \[m/s\] at which the fixes move at the start of a filter that does not wait for a rest.
    fn initial_speed(&self) -> Option<f64> {
        let ((_, imu), (_, track)) = (self.imu.as_ref()?, self.position.as_ref()?);
        if self.early_rest(imu).is_some() || imu.stances.is_some() {
            return None;
        }
        track.moves(*track.t.first()?)
    }

    /// Heading by the course.
    fn by_course(&self, draft: &mut Draft, track: &Track) {
        draft.part("heading by course");
        draft.set("source", self.velocity_source());
        if self.has_flat_velocity() {
            draft.set("horizontal", true);
        }
        draft.set("min_speed", format!("{:.1} m/s", (0.3 * track.top_speed()).clamp(1.0, 3.0)));
    }

    /// Roll and pitch at rest.
    pub(super) fn levelling(&self, draft: &mut Draft, imu: &Imu) {
        // Waiting for a late rest would leave out the log before it. A foot that walks before it rests for long starts at its first stance.
        let is_late = |s: &Stances| imu.rest.as_ref().is_none_or(|r| self.local(r.first.0) > 2.0 * s.period);
        if let Some(stances) = imu.stances.as_ref().filter(|s| is_late(s)) {
            draft.part("level");
            let why = "guessed: the first stance; no longer rest comes before the walk";
            draft.guess("duration", format!("{:.2} s", Stances::WINDOW), why);
            let why = "guessed: a foot is never quite still, and the accelerometer has a bias";
            draft.guess("tilt_sigma", "3 deg", why);
            standing(draft, stances);
            draft.reason("still", "as of the stances below");
        } else if let Some(r) = self.early_rest(imu) {
            draft.part("level");
            let why = format!(
                "guessed: half of the first rest, and 10 s at most; it is from {:.1} s for {:.1} s",
                self.local(r.first.0),
                r.first.1
            );
            let duration = (0.5 * r.first.1).clamp(1.0, 10.0);
            draft.guess("duration", format!("{duration:.1} s"), &why);
            draft.guess("tilt_sigma", "1 deg", "guessed: 0.1 m/s² of accelerometer bias is 0.6 deg");
            let (sigma, why) = if imu.stances.is_some() {
                (0.5, "guessed: a foot that rests is never quite still")
            } else {
                let noise = (r.gyro_noise / math::sqrt(duration)).to_degrees();
                // A rest of two windows has no noise of its means.
                let noise = if noise.is_finite() { noise } else { 0.0 };
                (
                    math::hypot(BIAS, noise),
                    "guessed: motion changes the bias, and the mean over that time has noise",
                )
            };
            draft.guess("gyro_bias_sigma", format!("{sigma:.2} deg/s"), why);
            still(draft, r, r.times, &limits(r));
        } else {
            draft.part("level in motion");
            if let Some(r) = &imu.rest {
                let why = format!(
                    "guessed: in motion, because the first rest is as late as {:.1} s",
                    self.local(r.first.0)
                );
                draft.reason("duration", &why);
            }
        }
    }

    /// The first rest, if it costs only a small part of the log to wait for it.
    fn early_rest<'a>(&self, imu: &'a Imu) -> Option<&'a Rest> {
        /// The largest share of the log before that rest.
        const WAIT: f64 = 0.05;
        let (k, _) = self.imu.as_ref()?;
        let (from, to) = self.logs[*k].clock.as_ref()?.span();
        imu.rest.as_ref().filter(|rest| rest.first.0 - from <= WAIT * (to - from))
    }

    /// Whether it is a vehicle that does not slip sideways: fast, level, sometimes at rest.
    fn is_road_vehicle(&self) -> bool {
        /// Five times the sideways 1σ of the constraint: noise of the velocity and the lever arm of the antenna are in it
        /// too [m/s].
        const SLIPPING: f64 = 0.5;
        let fits = |t: &crate::inspect::Track| t.top_speed() > 5.0 && self.has_course();
        let rests = self.imu.as_ref().and_then(|(_, i)| i.rest.as_ref()).is_some_and(|r| r.share > 0.01);
        let forward = self.pair.and_then(|p| p.forward).is_some_and(|(_, c)| c > 0.7);
        let holds = self.pair.is_some_and(|p| p.slip < SLIPPING);
        let is_dry =
            self.with(super::super::Kind::Depth).is_none() && ![Speed, BodyVelocity].iter().any(|kind| self.current(*kind).is_some());
        rests && forward && holds && is_dry && self.position.as_ref().is_some_and(|(_, t)| fits(t))
    }

    /// The constraints of a road vehicle, as in configs/parts/vehicle/car.toml.
    fn road(&self, draft: &mut Draft, imu: &Imu) {
        let Some(rest) = &imu.rest else { return };
        draft.part("road vehicle");
        let Some(standing) = imu.standing else { return };
        let (longest, until) = (standing.longest.0, self.local(standing.longest.1));
        if !standing.is_useful() {
            draft.note(&format!(
                "No test of a standstill: the car moves as quietly as it stands, for {:.1} s up to {until:.1} s.",
                0.1 * longest as f64,
            ));
            return;
        }
        draft.part("standstill of a car");
        let why = match longest {
            0 => "guessed: no test passes in motion".to_owned(),
            _ => format!("guessed: in motion {longest} tests pass in a row, the last at {until:.1} s; twice that, 5 at least"),
        };
        draft.guess("persist", standing.persist as i64, &why);
        let why = format!(
            "guessed: {} × what 95 % of the windows at rest stay below; {:.0} % of the tests at rest hold",
            standing.times,
            100.0 * standing.share
        );
        still(draft, rest, standing.times, &why);
        // The rest test reads a velocity only if it has a vertical part.
        if !self.has_flat_velocity() {
            draft.set("gnss.source", self.velocity_source());
        }
        draft.part("stop of a car");
    }
}

/// The foot is at rest in every stance, as in configs/templates/person.toml.
fn foot(draft: &mut Draft, s: &Stances) {
    draft.section(&format!(
        "guessed: a foot, for it rests for {:.2} s every {:.2} s; delete this for a vehicle",
        s.duration, s.period
    ));
    draft.part("standstill of a foot");
    standing(draft, s);
    draft.part("stop of a foot");
    let rolling = s.rolling.to_degrees();
    if !s.tell_bias() {
        draft.note(&format!(
            "No `zero_angular_rate`: in the middle of the stances the foot rolls by up to {rolling:.1} deg/s, which would be taken for a"
        ));
        draft.note("bias of the gyros.");
        return;
    }
    draft.part("resting gyros of a foot");
    draft.set("noise.sigma", format!("{:.2} deg/s", rolling.max(0.3)));
    draft.reason(
        "noise",
        &format!("guessed: 95 % of the mean rates of the stances are within {rolling:.2} deg/s of the bias; 0.3 deg/s at least"),
    );
}

/// The limits of the stance test.
fn standing(draft: &mut Draft, s: &Stances) {
    draft.set("still.window", format!("{:.2} s", Stances::WINDOW));
    draft.set("still.accel_std", format!("{:.2} m/s^2", s.accel_std));
    draft.set("still.gyro_std", format!("{:.2} deg/s", s.gyro_std.to_degrees()));
    draft.set("still.mean_rate", format!("{:.2} deg/s", s.mean_rate.to_degrees()));
}

/// The origin of the limits of the rest test.
pub(super) fn limits(r: &Rest) -> String {
    let share = if r.passing.is_nan() { 0.0 } else { 100.0 * r.passing };
    format!(
        "guessed: {} × what 95 % of the windows at rest stay below; {share:.1} % of those in motion pass",
        r.times
    )
}

/// The limits of the rest test: `times` the deviations at rest.
pub(super) fn still(draft: &mut Draft, r: &Rest, times: f64, why: &str) {
    let each = |v: [f64; 3], unit: &str| list(v.map(|x| format!("{:.5} {unit}", times * x)));
    draft.set("still.window", "1 s");
    draft.set("still.accel_std", each(r.accel_std, "m/s^2"));
    draft.set("still.gyro_std", each(r.gyro_std, "rad/s"));
    draft.reason("still", why);
}
