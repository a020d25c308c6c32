//! An odometer, a turn rate and positions, in the plane.

use super::draft::Draft;
use crate::inspect::Inspection;
use crate::inspect::numbers::{Vec3, moments};
use crate::inspect::page::axis;
use crate::inspect::signal::Kind::{AngularRate, Speed, YawRate};
use fusion_core::math;

impl Inspection {
    pub(super) fn odometry(&self, draft: &mut Draft) {
        let (Some((k, track)), Some((odometer, speed))) = (&self.position, self.forward()) else {
            return;
        };
        draft.part("unicycle");
        let accelerates = acceleration(self.logs[odometer].stamps(), &speed);
        draft.set("speed_noise", format!("{:.2} m/s^2/sqrt(Hz)", accelerates.unwrap_or(0.0).max(0.1)));
        draft.set("position_sigma", format!("{:.2} m", self.whole(&self.logs[*k], track)));
        draft.set("speed_sigma", format!("{:.2} m/s", 0.3 * track.top_speed()));
        draft.part("fix");
        self.first_height(draft);
        self.first_sigma(draft, 1.0, "of a fix");
        draft.part("heading by baseline");
        // Ten times the 1σ of both ends is 8° of heading.
        let distance = 10.0 * self.whole(&self.logs[*k], track);
        if distance < 4.0 {
            draft.guess("min_distance", format!("{distance:.1} m"), "guessed: ten times the 1σ of a fix");
        }
        if !self.has_height() && !super::is_local(&self.logs[*k]) {
            draft.set("horizontal", true);
        }
        self.position_sensors(draft, false, None);
        let kinds = if self.with(Speed).is_some() {
            draft.part("odometer in the plane");
            self.with_reported(draft, odometer, Speed)
        } else {
            self.tracks(draft);
            Vec::new()
        };
        self.turning(draft);
        draft.part("data");
        self.position_source(draft);
        if !kinds.is_empty() {
            self.source(draft, "odometry", odometer, &kinds, None);
        }
    }

    /// The turn rate: from a gyro about the vertical, or as reported.
    fn turning(&self, draft: &mut Draft) {
        let Some((k, imu)) = &self.imu else {
            let Some(k) = self.with(YawRate) else { return };
            draft.part("turn");
            let kinds = self.with_reported(draft, k, YawRate);
            return self.source(draft, "turn", k, &kinds, None);
        };
        draft.part("turn");
        let Some(rates) = self.logs[*k].signal(AngularRate) else { return };
        // Clockwise means a turn about the down axis.
        let (column, is_against) = rates.columns[imu.up.0];
        let is_clockwise = imu.up.1 != is_against;
        let sign = if is_clockwise { "" } else { "-" };
        draft.note(&format!(
            "guessed: {} of the accelerometers points up, and turning right is the rate about down",
            axis(imu.up)
        ));
        self.source(draft, "turn", *k, &[], None);
        draft.reads(*k, [column]);
        draft.set("yaw_rate.column", format!("{sign}{}", self.logs[*k].table.columns[column].name));
        draft.set("yaw_rate.unit", rates.unit.as_str());
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
        changes.push((speed[to][0] - speed[from][0]) / math::sqrt(lasts.abs()));
        from = to;
    }
    let (mean, std) = moments(changes);
    Some(math::hypot(mean, std)).filter(|density| density.is_finite())
}
