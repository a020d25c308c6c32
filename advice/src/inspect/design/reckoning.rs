//! Dead reckoning with an attitude reference.

use super::toml::Text;
use crate::inspect::Inspection;
use crate::inspect::signal::Kind::{BodyVelocity, Depth, Euler};

/// How a vehicle with a velocity log changes its velocity \[m/s/√s\].
const NOISE: f64 = 0.1;

impl Inspection {
    pub(super) fn reckoning(&self, text: &mut Text) {
        let (Some((p, track)), Some(attitude)) = (&self.position, self.with(Euler)) else {
            return;
        };
        let whole = self.whole(&self.logs[*p], track).max(0.5);
        let speed = track.top_speed();
        // If fixes are further apart than this, a guess would decide what the filter estimates.
        const USUAL: f64 = 20.0;
        let told = track
            .lasting()
            .filter(|_| track.rate() * USUAL <= 1.0 && self.with(BodyVelocity).is_none());
        let (lasting, is_told) = (told.map_or(USUAL, |lasting| lasting.max(USUAL)), told.is_some());
        if self.logs[attitude].is_estimate() {
            text.comment(&format!(
                "`{}` is by its name the estimate of another filter, which may have used the positions of this log too. Nothing else here",
                self.logs[attitude].name()
            ));
            text.comment("gives the attitude; replace it by an instrument if you have one.");
        }
        text.table("process");
        text.line("type = \"dead_reckoning\"\nsource = \"attitude_reference\"", "");
        text.line(&format!("position_sigma = \"{:.1} m\"", 2.0 * whole), "guessed: twice a fix");
        // White noise √(2/T) σ keeps a velocity with the 1σ σ and the correlation time T: here the velocity and the
        // drift.
        let wander = if self.with(BodyVelocity).is_some() {
            NOISE
        } else {
            (2.0 / lasting).sqrt() * (0.5 * speed).hypot(core::f64::consts::SQRT_2 * 0.3 * speed)
        };
        if self.with(BodyVelocity).is_some() {
            text.line(
                &format!(
                    "velocity_sigma = [\"{speed:.2} m/s\", \"{:.2} m/s\", \"{:.2} m/s\"]",
                    0.3 * speed,
                    0.2 * speed
                ),
                "guessed: by the usual top speed",
            );
            text.line(
                &format!("velocity_noise = \"{NOISE:.1} m/s/sqrt(s)\""),
                "guessed: how a vehicle of this speed changes it",
            );
        } else {
            text.line(
                &format!("velocity_sigma = [\"{:.2} m/s\", 0, 0]", 0.5 * speed),
                "guessed: half the usual top speed, ahead only",
            );
            text.line(
                &format!("velocity_time = \"{lasting:.0} s\""),
                if is_told {
                    "guessed: by how its velocity between fixes changes from one to the next"
                } else {
                    "guessed: how long a diver keeps a speed; the fixes come more often, and nothing else tells it"
                },
            );
            text.line("position_noise = \"5 cm/sqrt(s)\"", "guessed");
            // Only a depth observes vertical motion that is not ahead.
            let has_depth = self.with(Depth).is_some();
            let vertical = if has_depth {
                format!("\"{:.2} m/s\"", 0.15 * speed)
            } else {
                "0".to_owned()
            };
            text.line(
                &format!("drift = {{ estimate = true, initial = [0, 0, 0], sigma = [\"{0:.2} m/s\", \"{0:.2} m/s\", {vertical}], correlation_time = \"{1:.0} s\" }}", 0.3 * speed, 0.5 * lasting),
                "guessed: what is not ahead, and the current",
            );
        }
        let known = self.yaw.filter(|y| y.agreement > 0.8);
        let sigma = if known.is_some() { "10 deg" } else { "100 deg" };
        let left = self.yaw.filter(crate::inspect::Yaw::is_decided).map_or(0.0, |y| {
            let degrees = y.offset.to_degrees();
            degrees - 90.0 * (degrees / 90.0).round()
        });
        let why = self.yaw.map_or_else(
            || "guessed: nothing gives the course".to_owned(),
            |y| format!("guessed: course minus heading; they agree to {:.2} of 1", y.agreement),
        );
        text.line(
            &format!("heading_offset = {{ estimate = true, initial = \"{left:.1} deg\", sigma = \"{sigma}\", random_walk = \"0.05 deg/sqrt(s)\" }}"),
            &why,
        );
        // The same limit as the gaps of the page.
        let longest = (3.5 / self.logs[attitude].rate()).max(0.2 * lasting).max(5.0);
        text.line(
            &format!("input.longest_interval = \"{longest:.1} s\""),
            "guessed: three and a half of its usual intervals, a fifth of the time that a speed lasts, or 5 s; longer ones are gaps",
        );
        self.apart(text);
        text.table("initial.fix");
        text.line("type = \"first_fix\"\nsource = \"gnss\"", "");
        self.first_height(text);
        self.first_sigma(text, 1.0, "of a fix");
        text.section("aids");
        self.position_sensors(text, false, Some(wander));
        self.water(text, true);
        text.section("data");
        self.source(text, "attitude_reference", attitude, &[Euler], "");
        self.position_source(text);
    }
}
