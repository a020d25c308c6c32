//! Dead reckoning with an attitude reference.

use super::draft::{Draft, list};
use super::sensors::past_quarter;
use crate::inspect::signal::Kind::{BodyVelocity, Depth, Euler};
use crate::inspect::{Inspection, Yaw};
use fusion_core::math;
use toml_edit::Value;

/// How a vehicle with a velocity log changes its velocity \[m/s/√s\].
const NOISE: f64 = 0.1;
/// How long a diver keeps a speed \[s\].
const USUAL: f64 = 20.0;

impl Inspection {
    pub(super) fn reckoning(&self, draft: &mut Draft) {
        let (Some((p, track)), Some(attitude)) = (&self.position, self.with(Euler)) else {
            return;
        };
        let speed = track.top_speed();
        let has_log = self.with(BodyVelocity).is_some();
        // If fixes are further apart than this, a guess would decide what the filter estimates.
        let told = track.lasting().filter(|_| track.rate() * USUAL <= 1.0 && !has_log);
        let lasting = told.map_or(USUAL, |lasting| lasting.max(USUAL));
        if self.logs[attitude].is_estimate() {
            draft.note(&format!(
                "`{}` is by its name the estimate of another filter, which may have used the positions of this log too. Nothing else here",
                self.logs[attitude].name()
            ));
            draft.note("gives the attitude; replace it by an instrument if you have one.");
        }
        draft.part("dead reckoning");
        draft.set(
            "position_sigma",
            format!("{:.1} m", 2.0 * self.whole(&self.logs[*p], track).max(0.5)),
        );
        let wander = if has_log {
            let sigma = [1.0, 0.3, 0.2].map(|part| format!("{:.2} m/s", part * speed));
            draft.guess("velocity_sigma", list(sigma), "guessed: by the usual top speed");
            draft.set("velocity_noise", format!("{NOISE:.1} m/s/sqrt(s)"));
            NOISE
        } else {
            self.without_log(draft, speed, lasting, told.is_some());
            // White noise √(2/T) σ keeps a velocity with the 1σ σ and the correlation time T: here the velocity and the
            // drift.
            math::sqrt(2.0 / lasting) * math::hypot(0.5 * speed, core::f64::consts::SQRT_2 * 0.3 * speed)
        };
        self.heading_offset(draft);
        // The same limit as the gaps of the page.
        let longest = (3.5 / self.logs[attitude].rate()).max(0.2 * lasting).max(5.0);
        draft.set("input.longest_interval", format!("{longest:.1} s"));
        self.apart(draft);
        draft.part("fix");
        self.first_height(draft);
        self.first_sigma(draft, 1.0, "of a fix");
        draft.part("aids");
        self.position_sensors(draft, false, Some(wander));
        self.water(draft, true);
        draft.part("data");
        self.source(draft, "attitude_reference", attitude, &[Euler], None);
        self.position_source(draft);
    }

    /// The velocity of a process whose speed nothing measures: it lasts for the time `lasting` \[s\]. `is_told`: the fixes
    /// show this time.
    fn without_log(&self, draft: &mut Draft, speed: f64, lasting: f64, is_told: bool) {
        let ahead = [format!("{:.2} m/s", 0.5 * speed).into(), Value::from(0), Value::from(0)];
        draft.guess("velocity_sigma", list(ahead), "guessed: half the usual top speed, ahead only");
        let why = if is_told {
            "guessed: by how its velocity between fixes changes from one to the next"
        } else {
            "guessed: how long a diver keeps a speed; the fixes come more often, and nothing else tells it"
        };
        draft.guess("velocity_time", format!("{lasting:.0} s"), why);
        draft.set("position_noise", "5 cm/sqrt(s)");
        // Only a depth observes vertical motion that is not ahead.
        let level = Value::from(format!("{:.2} m/s", 0.3 * speed));
        let vertical = match self.with(Depth) {
            Some(_) => format!("{:.2} m/s", 0.15 * speed).into(),
            None => Value::from(0),
        };
        draft.set("drift.sigma", list([level.clone(), level, vertical]));
        draft.set("drift.correlation_time", format!("{:.0} s", 0.5 * lasting));
    }

    /// Course minus heading, as far as they agree.
    fn heading_offset(&self, draft: &mut Draft) {
        let is_known = self.yaw.is_some_and(|y| y.agreement > 0.8);
        let left = self
            .yaw
            .filter(Yaw::is_decided)
            .map_or(0.0, |y| past_quarter(y.offset.to_degrees()));
        draft.set("heading_offset.initial", format!("{left:.1} deg"));
        draft.set("heading_offset.sigma", if is_known { "10 deg" } else { "100 deg" });
        let why = self.yaw.map_or_else(
            || "guessed: nothing gives the course".to_owned(),
            |y| format!("guessed: course minus heading; they agree to {:.2} of 1", y.agreement),
        );
        draft.reason("heading_offset", &why);
    }
}
