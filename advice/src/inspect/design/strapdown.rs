//! An inertial unit with positions.

use super::Told;
use super::toml::Text;
use crate::inspect::numbers::norm;
use crate::inspect::page::{degrees, vector};
use crate::inspect::signal::Kind::{AngularRate, BodyVelocity, SpecificForce, Speed};
use crate::inspect::{Imu, Inspection, Rest, Stances, Track};

/// The factor from densities at rest to densities under vibration.
const SHAKEN: f64 = 3.0;
/// No unit is assumed better in motion \[m/s²/√Hz\], \[rad/s/√Hz\].
const FLOOR: (f64, f64) = (8e-3, 2e-4);

impl Inspection {
    pub(super) fn strapdown(&self, text: &mut Text) {
        let Some((k, imu)) = &self.imu else { return };
        text.table("process");
        text.quoted("type", "strapdown");
        text.quoted("source", "imu");
        self.noise(text, imu);
        self.apart(text);
        if imu.stances.is_some() {
            on_foot(text);
        } else if let Some((force, rate)) = imu.agile {
            shaken(text, "scale and alignment of gyros that turn fast");
            text.line(
                &format!(
                    "agility = {{ acceleration = \"{:.0} m/s^2\", angular_rate = \"{:.0} deg/s\" }}",
                    2.0 * force,
                    2.0 * rate.to_degrees()
                ),
                "guessed: twice what all but one of a thousand samples stay below; what changes faster is a spike",
            );
        }
        self.start(text, imu);
        let is_car = self.is_road_vehicle();
        text.section("aids");
        self.position_sensors(text, true, None);
        self.barometer(text);
        self.compasses(text);
        if is_car {
            self.road(text, imu);
        }
        if let Some(stances) = &imu.stances {
            foot(text, stances);
        }
        self.log_or_wheels(text);
        self.water(text, false);
        text.section("data");
        text.comment(&format!(
            "guessed: mean force {} m/s² in sensor axes: {} is up",
            vector(imu.gravity, 2),
            crate::inspect::page::axis(imu.up)
        ));
        text.comment(&self.ahead());
        self.source(text, "imu", *k, &[AngularRate, SpecificForce], "");
        self.position_source(text);
    }

    /// An inertial unit on a foot, without positions: the path relative to its start.
    pub(super) fn walk(&self, text: &mut Text) {
        let Some((k, imu)) = &self.imu else { return };
        let Some(stances) = &imu.stances else { return };
        text.table("process");
        text.quoted("type", "strapdown");
        text.quoted("source", "imu");
        self.noise(text, imu);
        self.apart(text);
        on_foot(text);
        self.levelling(text, imu);
        if self.told() == Told::Field {
            by_field(text);
        }
        text.table("initial.start");
        text.quoted("type", "explicit");
        text.line("position_sigma = \"0.1 m\"", "the way is counted from here");
        text.line("velocity = [0, 0, 0]", "");
        text.line("velocity_sigma = \"0.1 m/s\"", "guessed: it starts at rest");
        if self.told() != Told::Field {
            text.line("heading = \"0 deg\"", "");
            text.line(
                "heading_sigma = \"0.1 deg\"",
                "by definition: no file tells north, so headings and the way count from where the unit's forward axis points at the start",
            );
            text.comment("Nothing gives the heading later: the way is relative to the start, and turns with the drift of the gyros.");
        }
        text.section("aids");
        self.compasses(text);
        foot(text, stances);
        text.section("data");
        text.comment(&format!("guessed: {} is up", crate::inspect::page::axis(imu.up)));
        self.source(text, "imu", *k, &[AngularRate, SpecificForce], "");
    }

    /// The reason for the forward axis.
    pub(super) fn ahead(&self) -> String {
        let unit = self.imu.as_ref().and_then(|(k, _)| self.logs[*k].signal(SpecificForce));
        let is_named = unit.is_some_and(|s| s.is_body);
        let found = self.pair.and_then(|p| p.ahead());
        found.map_or_else(
            || {
                if is_named {
                    return "by the names of the columns: forward, right, down".to_owned();
                }
                "not decided: nothing here tells which axis is ahead, the first horizontal one is taken. For another one turn \
                 `rotation` about the vertical: of [\"x\", \"y\", \"z\"] to [\"y\", \"-x\", \"z\"] or [\"-x\", \"-y\", \"z\"]"
                    .to_owned()
            },
            |(angle, c)| {
                let rest = angle.to_degrees() - 90.0 * (angle.to_degrees() / 90.0).round();
                format!("guessed: ahead by forces and accelerations of the track (correlation {c:.2}), to a quarter turn; {rest:.1} deg are left")
            },
        )
    }

    /// Noise and biases.
    fn noise(&self, text: &mut Text, imu: &Imu) {
        let is_foot = imu.stances.is_some();
        // A foot at rest is never quite still: its readings there give neither the noise nor the bias.
        let rest = imu.rest.as_ref().filter(|_| !is_foot);
        let shaken = |of: fn(&Rest) -> f64, floor: f64| rest.map_or(floor, |r| (SHAKEN * of(r)).max(floor));
        let (force, rate) = (shaken(|r| r.accel_noise, FLOOR.0), shaken(|r| r.gyro_noise, FLOOR.1));
        let why = |measured: Option<f64>| match measured {
            Some(m) => format!("guessed: three times the {m:.1e} at rest, or the least that a shaken unit has"),
            None if is_foot => "guessed: a foot that rests is never quite still; what a shaken unit has".to_owned(),
            None => "guessed: no rest in this log; what a shaken unit has".to_owned(),
        };
        text.line(
            &format!("gyro.noise = \"{rate:.1e} rad/s/sqrt(Hz)\""),
            &why(rest.map(|r| r.gyro_noise)),
        );
        text.line(
            &format!("accelerometer.noise = \"{force:.1e} m/s^2/sqrt(Hz)\""),
            &why(rest.map(|r| r.accel_noise)),
        );
        let sigma = if rest.is_some() { "0.05 deg/s" } else { "0.5 deg/s" };
        let (initial, found) = self.gyro_bias(rest);
        text.line(
            &format!("gyro.bias = {{ estimate = true, initial = {initial}, sigma = \"{sigma}\", random_walk = \"1e-5 rad/s/sqrt(s)\" }}"),
            &format!("guessed: a micro-mechanical unit; see configs/parts/imu for data sheets{found}"),
        );
        text.line(
            "accelerometer.bias = { estimate = true, initial = [0, 0, 0], sigma = \"0.1 m/s^2\", random_walk = \"1e-4 m/s^2/sqrt(s)\" }",
            "guessed: the same",
        );
    }

    /// The gyro bias in body axes and its origin, if it is large enough.
    pub(super) fn gyro_bias(&self, rest: Option<&Rest>) -> (String, &'static str) {
        /// Ten times the 1σ of a bias found at rest [rad/s].
        const LARGE: f64 = 0.0087;
        match rest.filter(|r| norm(r.bias) > LARGE) {
            Some(r) => {
                let bias = degrees(self.in_body(r.bias)).map(|b| format!("\"{b:.2} deg/s\""));
                (format!("[{}]", bias.join(", ")), "; its mean rate at rest")
            }
            None => ("[0, 0, 0]".to_owned(), ""),
        }
    }

    /// The initialisers.
    fn start(&self, text: &mut Text, imu: &Imu) {
        let Some((_, track)) = &self.position else { return };
        self.levelling(text, imu);
        text.table("initial.fix");
        text.quoted("type", "first_fix");
        text.quoted("source", "gnss");
        self.first_height(text);
        self.first_sigma(text, 1.5, "one and a half of the 1σ guessed below");
        let told = self.told();
        // A first fix uses a velocity only if it has a vertical part.
        let takes_velocity = self.velocity.is_none() && !self.has_flat_velocity();
        if told == Told::Course && takes_velocity {
            text.line("velocity_sigma = \"1 m/s\"", "guessed: it is late while the vehicle pulls away");
        }
        match told {
            Told::Course => self.by_course(text, track),
            Told::Heading => {
                text.table("initial.heading");
                text.line("type = \"compass\"\nsource = \"heading\"", "");
                text.line("sigma = \"10 deg\"", "guessed: deviation, declination, and how it is mounted");
            }
            Told::Field => {
                by_field(text);
            }
            Told::Nobody => {}
        }
        if told != Told::Course || !takes_velocity {
            text.table("initial.start");
            text.quoted("type", "explicit");
            text.line("velocity = [0, 0, 0]", "");
            if told == Told::Course {
                let fast = track.top_speed();
                text.line(&format!("velocity_sigma = \"{fast:.1} m/s\""), "guessed: the usual top speed");
            } else {
                text.line("velocity_sigma = \"0.5 m/s\"", "guessed: it starts slowly");
            }
        }
        if told == Told::Nobody {
            text.line("heading = \"0 deg\"", "");
            text.line("heading_sigma = \"180 deg\"", "nothing gives it");
        }
    }

    /// Heading by the course.
    fn by_course(&self, text: &mut Text, track: &Track) {
        text.table("initial.heading");
        text.quoted("type", "course");
        text.quoted("source", self.velocity_source());
        if self.has_flat_velocity() {
            text.line("horizontal = true", "a velocity without a vertical");
        }
        let speed = (0.3 * track.top_speed()).clamp(1.0, 3.0);
        text.line(
            &format!("min_speed = \"{speed:.1} m/s\""),
            "guessed: a third of the usual top speed, 3 m/s at most",
        );
        text.line(
            "sigma = \"10 deg\"",
            "guessed: noise of the course, and how the unit sits in the vehicle",
        );
    }

    /// Roll and pitch at rest.
    pub(super) fn levelling(&self, text: &mut Text, imu: &Imu) {
        text.table("initial.level");
        text.quoted("type", "levelling");
        text.quoted("source", "imu");
        // A foot that walks before it rests for long starts at its first stance.
        let is_late = |s: &Stances| imu.rest.as_ref().is_none_or(|r| self.local(r.first.0) > 2.0 * s.period);
        if let Some(stances) = imu.stances.as_ref().filter(|s| is_late(s)) {
            text.line(
                &format!("duration = \"{:.2} s\"", Stances::WINDOW),
                "guessed: the first stance; no longer rest comes before the walk",
            );
            text.line(
                "tilt_sigma = \"3 deg\"",
                "guessed: a foot is never quite still, and the accelerometer has a bias",
            );
            text.line(&format!("still = {}", standing(stances)), "as of the stances below");
            return;
        }
        match &imu.rest {
            Some(r) => {
                let duration = (0.5 * r.first.1).clamp(1.0, 10.0);
                text.line(
                    &format!("duration = \"{duration:.1} s\""),
                    &format!(
                        "guessed: half of the first rest, and 10 s at most; it is from {:.1} s for {:.1} s",
                        self.local(r.first.0),
                        r.first.1
                    ),
                );
                text.line("tilt_sigma = \"1 deg\"", "guessed: 0.1 m/s² of accelerometer bias is 0.6 deg");
                if imu.stances.is_some() {
                    text.line("gyro_bias_sigma = \"0.5 deg/s\"", "guessed: a foot that rests is never quite still");
                } else {
                    text.line(
                        "gyro_bias_sigma = \"0.05 deg/s\"",
                        "guessed: the mean at rest, less what motion changes",
                    );
                }
                text.line(&format!("still = {}", still(r, "1 s")), &limits(r));
            }
            None => {
                text.line("duration = \"1 s\"", "guessed: no rest in this log differs from motion");
                text.line("tilt_sigma = \"5 deg\"", "guessed: the force of motion");
            }
        }
    }

    /// Whether it is a vehicle that does not slip sideways: fast, level, sometimes at rest.
    fn is_road_vehicle(&self) -> bool {
        let fits = |t: &crate::inspect::Track| t.top_speed() > 5.0 && self.has_course();
        let rests = self.imu.as_ref().and_then(|(_, i)| i.rest.as_ref()).is_some_and(|r| r.share > 0.01);
        let forward = self.pair.and_then(|p| p.forward).is_some_and(|(_, c)| c > 0.7);
        let is_dry =
            self.with(super::super::Kind::Depth).is_none() && ![Speed, BodyVelocity].iter().any(|kind| self.current(*kind).is_some());
        rests && forward && is_dry && self.position.as_ref().is_some_and(|(_, t)| fits(t))
    }

    /// The constraints of a road vehicle, as in configs/parts/vehicle/car.toml.
    fn road(&self, text: &mut Text, imu: &Imu) {
        let Some(rest) = &imu.rest else { return };
        text.section(
            "guessed: a road vehicle, for it is fast, rests, and accelerates along one axis; delete this for a boat or an aircraft",
        );
        text.table("stage.wheels");
        text.line("type = \"periodic\"\nsource = \"imu\"\nmin_speed = \"1 m/s\"", "");
        text.line("rate = \"2 Hz\"", "guessed: the error is correlated over half a second");
        text.table("sensor.wheels");
        text.line("type = \"nonholonomic\"\nsource = \"wheels\"", "");
        text.line(
            "mounting = { estimate = true, initial = [0, 0, 0], sigma = [0, \"5 deg\", \"8 deg\"] }",
            "guessed: mounted by hand",
        );
        text.line(
            "lever_arm = { estimate = true, initial = [0, 0, 0], sigma = \"1 m\" }",
            "guessed: from the unit to the rear axle",
        );
        text.line(
            "noise = { sigma = [\"0.1 m/s\", \"0.5 m/s\"] }",
            "guessed: slip, and a body on springs",
        );
        let Some(standing) = imu.standing else { return };
        let (longest, until) = standing.longest;
        if !standing.is_useful() {
            text.comment(&format!(
                "No test of a standstill: the car moves as quietly as it stands, for {:.1} s up to {:.1} s.",
                0.1 * longest as f64,
                self.local(until)
            ));
            return;
        }
        text.table("stage.standing");
        text.line("type = \"stationarity\"\nsource = \"imu\"\nrate = \"1 Hz\"", "");
        text.line(
            &format!("persist = {}", standing.persist),
            &match longest {
                0 => "guessed: no test passes in motion".to_owned(),
                _ => format!(
                    "guessed: in motion {longest} tests pass in a row, the last at {:.1} s; twice that, 5 at least",
                    self.local(until)
                ),
            },
        );
        text.line(
            &format!("still = {}", limited(rest, standing.times, "1 s")),
            &format!(
                "guessed: {} × what 95 % of the windows at rest stay below; {:.0} % of the tests at rest hold",
                standing.times,
                100.0 * standing.share
            ),
        );
        text.line("max_mean_acceleration = \"0.2 m/s^2\"", "guessed: braking is no rest");
        // The rest test reads a velocity only if it has a vertical part.
        if !self.has_flat_velocity() {
            text.line(
                &format!(
                    "gnss = {{ source = \"{}\", max_speed = \"0.2 m/s\", max_age = \"1.6 s\" }}",
                    self.velocity_source()
                ),
                "guessed: the noise of the reported speed",
            );
        }
        text.line("max_speed = \"2 m/s\"", "guessed: where GNSS is silent");
        text.table("sensor.standing");
        text.line("type = \"zero_velocity\"\nsource = \"standing\"", "");
        text.line(
            "noise = { sigma = \"0.1 m/s\" }",
            "guessed: soft, a car may creep more quietly than in this log",
        );
    }
}

/// The noise of a unit in fast motion, as in configs/parts/vehicle/foot.toml.
fn shaken(text: &mut Text, why: &str) {
    text.line(
        "accelerometer.vibration = \"0.1 s\"",
        "guessed: the noise is at least what the forces of so short a time scatter by",
    );
    text.line(
        "gyro.scale_noise = \"0.1 %/sqrt(Hz)\"",
        &format!("guessed: {why}; far more than their noise at rest"),
    );
}

/// A foot moves faster than a vehicle, and shakes its unit at every step.
fn on_foot(text: &mut Text) {
    shaken(text, "scale and alignment of gyros in swings");
    text.line(
        "agility = { acceleration = \"200 m/s^2\", angular_rate = \"1000 deg/s\" }",
        "guessed: a foot that strikes the ground; what changes faster is a spike",
    );
}

/// Heading by a magnetometer.
fn by_field(text: &mut Text) {
    text.table("initial.heading");
    text.line("type = \"compass\"\nsource = \"compass\"", "");
    text.line("sigma = \"20 deg\"", "guessed: declination, and iron that is not yet known");
}

/// The foot is at rest in every stance, as in configs/templates/person.toml.
fn foot(text: &mut Text, s: &Stances) {
    text.section(&format!(
        "guessed: a foot, for it rests for {:.2} s every {:.2} s; delete this for a vehicle",
        s.duration, s.period
    ));
    text.table("stage.standing");
    text.line(
        "type = \"stationarity\"\nsource = \"imu\"\nrate = \"20 Hz\"\ntest_rate = \"50 Hz\"",
        "",
    );
    text.line(
        &format!("still = {}", standing(s)),
        "guessed: twice the medians in the middle of the stances; `mean_rate`: the bias, and three times its 1σ together with the rolling",
    );
    text.table("sensor.standing");
    text.line("type = \"zero_velocity\"\nsource = \"standing\"", "");
    text.line("noise = { sigma = \"3 cm/s\" }", "guessed: a foot that rolls while it stands");
    let rolling = s.rolling.to_degrees();
    if !s.tell_bias() {
        text.comment(&format!(
            "No `zero_angular_rate`: in the middle of the stances the foot rolls by up to {rolling:.1} deg/s, which would be taken for a"
        ));
        text.comment("bias of the gyros.");
        return;
    }
    text.table("sensor.resting_gyros");
    text.line("type = \"zero_angular_rate\"\nsource = \"standing\"", "");
    text.line(
        &format!("noise = {{ sigma = \"{:.2} deg/s\" }}", rolling.max(0.3)),
        &format!("guessed: 95 % of the mean rates of the stances are within {rolling:.2} deg/s of the bias; 0.3 deg/s at least"),
    );
}

/// The limits of the stance test.
fn standing(s: &Stances) -> String {
    format!(
        "{{ window = \"{:.2} s\", accel_std = \"{:.2} m/s^2\", gyro_std = \"{:.2} deg/s\", mean_rate = \"{:.2} deg/s\" }}",
        Stances::WINDOW,
        s.accel_std,
        s.gyro_std.to_degrees(),
        s.mean_rate.to_degrees()
    )
}

/// The origin of the limits of the rest test.
pub(super) fn limits(r: &Rest) -> String {
    let share = if r.passing.is_nan() { 0.0 } else { 100.0 * r.passing };
    format!(
        "guessed: {} × what 95 % of the windows at rest stay below; {share:.1} % of those in motion pass",
        r.times
    )
}

/// The limits of the rest test.
pub(super) fn still(r: &Rest, window: &str) -> String {
    limited(r, r.times, window)
}

/// Limits of `times` the deviations at rest.
fn limited(r: &Rest, times: f64, window: &str) -> String {
    let list = |v: [f64; 3], unit: &str| {
        let all = v.map(|x| format!("\"{:.5} {unit}\"", times * x));
        format!("[{}]", all.join(", "))
    };
    format!(
        "{{ window = \"{window}\", accel_std = {}, gyro_std = {} }}",
        list(r.accel_std, "m/s^2"),
        list(r.gyro_std, "rad/s")
    )
}
