//! An odometer, a turn rate and positions, in the plane.

use super::toml::Text;
use crate::inspect::Inspection;
use crate::inspect::numbers::{Vec3, moments};
use crate::inspect::page::axis;
use crate::inspect::signal::Kind::{AngularRate, Speed, YawRate};

impl Inspection {
    pub(super) fn odometry(&self, text: &mut Text) {
        let (Some((k, track)), Some(odometer)) = (&self.position, self.with(Speed)) else {
            return;
        };
        let whole = self.whole(&self.logs[*k], track);
        text.table("process");
        text.quoted("type", "unicycle");
        let accelerates = self.logs[odometer]
            .values(Speed)
            .and_then(|speed| acceleration(self.logs[odometer].stamps(), &speed));
        text.line(
            &format!("speed_noise = \"{:.2} m/s^2/sqrt(Hz)\"", accelerates.unwrap_or(0.0).max(0.1)),
            "guessed: by how much the speed changes within a second; 0.1 at least",
        );
        text.line("yaw_rate_noise = \"0.1 rad/s^2/sqrt(Hz)\"", "guessed: the same");
        text.line(
            "heading_noise = \"0.05 rad/sqrt(s)\"",
            "guessed: wheels that slip a little: course is not heading",
        );
        text.line("position_noise = \"1 mm/sqrt(s)\"", "");
        text.line(&format!("position_sigma = \"{whole:.2} m\""), "of a fix");
        text.line("heading_sigma = \"15 deg\"", "guessed: of the line between two fixes");
        text.line(
            &format!("speed_sigma = \"{:.2} m/s\"", 0.3 * track.top_speed()),
            "guessed: a third of the usual top speed",
        );
        text.line("yaw_rate_sigma = \"0.2 rad/s\"", "guessed");
        text.table("initial.fix");
        text.line("type = \"first_fix\"\nsource = \"gnss\"", "");
        self.first_height(text);
        self.first_sigma(text, 1.0, "of a fix");
        text.table("initial.heading");
        text.line("type = \"baseline\"\nsource = \"gnss\"", "");
        if !self.has_height() && !super::is_local(&self.logs[*k]) {
            text.line("horizontal = true", "fixes without a height");
        }
        text.line("min_distance = \"4 m\"", "guessed: several times the scatter of the fixes");
        text.line("max_age = \"15 s\"", "guessed: the vehicle turns meanwhile");
        text.line("sigma = \"15 deg\"", "guessed");
        self.position_sensors(text, false, None);
        text.table("sensor.odometer");
        text.line("type = \"odometer\"\nsource = \"odometry\"", "");
        text.line(
            "scale = { estimate = true, initial = 0, sigma = \"3 %\" }",
            "guessed: the radius of the wheels",
        );
        text.line("noise = { sigma = \"3 cm/s\" }", "guessed: quantisation and slip");
        self.turning(text);
        text.section("data");
        self.position_source(text);
        self.source(text, "odometry", odometer, &[Speed], "");
    }

    /// The turn rate: from a gyro about the vertical, or as reported.
    fn turning(&self, text: &mut Text) {
        text.table("sensor.turn");
        text.line("type = \"yaw_rate\"\nsource = \"turn\"", "");
        text.line(
            "bias = { estimate = true, initial = 0, sigma = \"0.01 rad/s\", random_walk = \"1e-5 rad/s/sqrt(s)\" }",
            "guessed: a small gyro",
        );
        text.line(
            "noise = { sigma = \"0.01 rad/s\" }",
            "guessed: a small gyro on a vehicle that shakes",
        );
        let Some((k, imu)) = &self.imu else {
            let Some(k) = self.with(YawRate) else { return };
            return self.source(text, "turn", k, &[YawRate], "");
        };
        let Some(rates) = self.logs[*k].signal(AngularRate) else { return };
        // Clockwise means a turn about the down axis.
        let (column, is_against) = rates.columns[imu.up.0];
        let is_clockwise = imu.up.1 != is_against;
        let sign = if is_clockwise { "" } else { "-" };
        text.comment(&format!(
            "guessed: {} of the accelerometers points up, and turning right is the rate about down",
            axis(imu.up)
        ));
        let name = format!("{sign}{}", self.logs[*k].table.columns[column].name);
        self.source(text, "turn", *k, &[], "");
        text.reads(*k, [column]);
        text.line(
            &format!(
                "yaw_rate = {{ column = {}, unit = \"{}\" }}",
                super::toml::quoted(&name),
                rates.unit
            ),
            "",
        );
    }
}

/// The density of the acceleration that explains how much a speed changes within a second \[m/s²/√Hz\].
fn acceleration(t: &[f64], speed: &[Vec3]) -> Option<f64> {
    let (mut from, mut changes) = (0, Vec::new());
    for to in 1..t.len() {
        let lasts = t[to] - t[from];
        if (0.0..1.0).contains(&lasts) {
            continue;
        }
        // The variance of a random walk is the density squared times the time.
        changes.push((speed[to][0] - speed[from][0]) / lasts.abs().sqrt());
        from = to;
    }
    let (mean, std) = moments(changes);
    Some(mean.hypot(std)).filter(|density| density.is_finite())
}
