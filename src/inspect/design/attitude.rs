//! An inertial unit alone: attitude by gyros and gravity.

use super::toml::Text;
use crate::inspect::Inspection;
use crate::inspect::signal::Kind::{AngularRate, MagneticField, Quaternion, SpecificForce};

impl Inspection {
    pub(super) fn attitude(&self, text: &mut Text) {
        let Some((k, imu)) = &self.imu else { return };
        let has_field = self.logs[*k].has(MagneticField);
        text.table("process");
        text.line("type = \"attitude_only\"\nsource = \"imu\"", "");
        text.line(
            "gyro_noise = \"0.3 deg/sqrt(s)\"",
            "guessed: scale and axes of small gyros in fast turns; far more than their white noise",
        );
        text.line(
            "gyro_bias = { estimate = true, initial = [0, 0, 0], sigma = \"0.5 deg/s\", random_walk = \"1e-4 deg/s/sqrt(s)\" }",
            "guessed: a micro-mechanical unit",
        );
        self.levelling(text, imu);
        text.table("initial.heading");
        if has_field {
            text.line("type = \"compass\"\nsource = \"compass\"", "");
            text.line("sigma = \"10 deg\"", "guessed: iron nearby");
        } else {
            text.line("type = \"explicit\"\nheading = \"0 deg\"", "");
            text.line("heading_sigma = \"5 deg\"", "no file tells the heading: it begins at zero");
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
        if has_field {
            text.table("stage.compass");
            text.line("type = \"compass\"\nsource = \"imu\"\nlevel_source = \"imu\"\nrate = \"30 Hz\"", "");
            text.line(
                "gate = { magnitude = \"12 %\", dip = \"6 deg\", smooth_over = \"0.2 s\", hold_off = \"1 s\" }",
                "guessed: fields in a room",
            );
            text.table("sensor.field");
            text.line("type = \"attitude\"\npart = \"heading\"\nsource = \"compass\"", "");
            text.line("noise = { sigma = \"20 deg\" }", "guessed: 30 rows a second share their error");
        }
        text.section("data");
        text.comment(&format!("guessed: {} is up", crate::inspect::page::axis(imu.up)));
        self.source(text, "imu", *k, &[AngularRate, SpecificForce, MagneticField], "");
    }

    /// The attitude that some other system recorded.
    pub(super) fn judge_attitude(&self, text: &mut Text) {
        let Some(k) = self.with(Quaternion) else {
            text.section("judge");
            text.comment("No reference: nothing here looks like a ground truth.");
            return;
        };
        text.section("judge");
        text.comment("guessed: the quaternion comes from a system of its own; it only scores the estimate.");
        text.comment("guessed: it turns sensor axes into east, north, up.");
        self.source(text, "truth", k, &[Quaternion], "");
        text.table("reference");
        text.quoted("source", "truth");
    }
}
