//! An inertial unit alone: attitude by gyros and gravity.

use super::toml::Text;
use crate::inspect::signal::Kind::{AngularRate, MagneticField, Quaternion, SpecificForce};
use crate::inspect::{Imu, Inspection, Rest};

impl Inspection {
    pub(super) fn attitude(&self, text: &mut Text) {
        let Some((k, imu)) = &self.imu else { return };
        let field = self.compass(*k, imu);
        let has_field = field.is_some();
        let compass = if field.is_some_and(|field| field.log != *k) {
            "magnetometer"
        } else {
            "imu"
        };
        text.table("process");
        text.line("type = \"attitude_only\"\nsource = \"imu\"", "");
        text.line(
            "gyro_noise = \"0.3 deg/sqrt(s)\"",
            "guessed: scale and axes of small gyros in fast turns; far more than their white noise",
        );
        let (initial, found) = self.gyro_bias(imu.rest.as_ref());
        text.line(
            &format!("gyro_bias = {{ estimate = true, initial = {initial}, sigma = \"0.5 deg/s\", random_walk = \"1e-4 deg/s/sqrt(s)\" }}"),
            &format!("guessed: a micro-mechanical unit{found}"),
        );
        self.apart(text);
        self.levelling(text, imu);
        text.table("initial.heading");
        if has_field {
            text.line("type = \"compass\"\nsource = \"compass\"", "");
            text.line("sigma = \"10 deg\"", "guessed: iron nearby");
        } else {
            text.line("type = \"explicit\"\nheading = \"0 deg\"", "");
            text.line(
                "heading_sigma = \"0.1 deg\"",
                "by definition: no file tells north, so headings count from where the unit's forward axis points at the start",
            );
        }
        text.table("stage.vertical");
        text.line("type = \"steady_force\"\nsource = \"imu\"\nrate = \"10 Hz\"", "");
        text.line(
            "time_constant = \"1.5 s\"",
            "guessed: accelerations of a moving hand or vehicle last less",
        );
        text.table("sensor.gravity");
        text.line("type = \"gravity_direction\"\nsource = \"vertical\"", "");
        text.line(
            "noise = { sigma = \"0.5 m/s^2\" }",
            "guessed: rows within the time constant share their error",
        );
        if let Some(rest) = &imu.rest {
            self.resting(text, rest);
        }
        if has_field {
            text.table("stage.compass");
            text.line(&format!("type = \"compass\"\nsource = \"{compass}\"\nlevel_source = \"imu\""), "");
            text.line("rate = \"30 Hz\"", "");
            text.line(
                "gate = { magnitude = \"12 %\", dip = \"6 deg\", smooth_over = \"0.2 s\", hold_off = \"1 s\" }",
                "guessed: fields in a room",
            );
            text.line(
                "noise = { sigma = \"0.8 uT\", difference = 10 }",
                "guessed: a field that differs is believed less",
            );
        }
        if let Some(field) = field {
            earth(text, field);
        }
        text.section("data");
        text.comment(&format!("guessed: {} is up", crate::inspect::page::axis(imu.up)));
        let field = field.filter(|field| field.log == *k).map(|_| MagneticField);
        let kinds: Vec<_> = [Some(AngularRate), Some(SpecificForce), field].into_iter().flatten().collect();
        self.source(text, "imu", *k, &kinds, "");
        if let Some(compass) = self.compass(*k, imu).filter(|field| field.log != *k) {
            self.source(text, "magnetometer", compass.log, &[MagneticField], "");
        }
    }

    /// The magnetometer: in the unit's own file, or in another one whose field turns as the gyros do.
    fn compass(&self, unit: usize, imu: &Imu) -> Option<Compass> {
        let is_known = self.logs[unit].signal(MagneticField).is_some_and(|s| !s.unit.is_empty());
        let own = imu.field.filter(|_| is_known).map(|(strength, dip)| Compass {
            log: unit,
            strength,
            dip,
            why: "guessed: as during the first rest",
        });
        let other = || {
            let (log, field) = self.earth_field()?;
            Some(Compass {
                log,
                strength: field.strength,
                dip: field.dip,
                why: "guessed: its median",
            })
        };
        own.or_else(other)
    }

    /// While it rests, gyros show their bias.
    fn resting(&self, text: &mut Text, rest: &Rest) {
        text.table("stage.still");
        text.line("type = \"stationarity\"\nsource = \"imu\"\nrate = \"1 Hz\"", "");
        text.line(
            &format!("still = {}", super::strapdown::still(rest, "1 s")),
            &super::strapdown::limits(rest),
        );
        text.table("sensor.still");
        text.line("type = \"zero_angular_rate\"\nsource = \"still\"", "");
        text.line(
            "noise = { sigma = \"0.01 deg/s\" }",
            "guessed: means of a second at rest differ by about that",
        );
    }

    /// The attitude that another system recorded.
    pub(super) fn judge_attitude(&self, text: &mut Text) {
        let Some(k) = self.with(Quaternion) else {
            text.section("judge");
            text.comment("No reference: nothing here looks like a ground truth.");
            return;
        };
        text.section("judge");
        text.comment("guessed: the quaternion comes from a separate system; it only scores the estimate.");
        text.comment("guessed: it turns sensor axes into east, north, up.");
        self.source(text, "truth", k, &[Quaternion], "");
        text.table("reference");
        text.quoted("source", "truth");
    }
}

/// A magnetometer and the Earth's field that it reads.
#[derive(Clone, Copy)]
struct Compass {
    log: usize,
    /// \[T\]
    strength: f64,
    /// Below the horizon \[rad\].
    dip: f64,
    why: &'static str,
}

/// The Earth's field.
fn earth(text: &mut Text, field: Compass) {
    text.table("sensor.field");
    text.line(
        "type = \"magnetometer\"\nsource = \"compass\"\ndeclination = 0",
        "north is that of the field",
    );
    text.line(
        &format!(
            "strength = {{ estimate = true, initial = \"{:.1} uT\", sigma = \"5 uT\", random_walk = \"0.2 uT/sqrt(s)\" }}",
            1e6 * field.strength
        ),
        field.why,
    );
    text.line(
        &format!(
            "inclination = {{ estimate = true, initial = \"{:.1} deg\", sigma = \"3 deg\", random_walk = \"0.3 deg/sqrt(s)\" }}",
            field.dip.to_degrees()
        ),
        "guessed: the same",
    );
    text.line("noise = { from_source = true }", "");
}
