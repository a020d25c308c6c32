//! `[health]`: the limits for the filter's health.

use crate::config::{Diagnostic, Diagnostics, Node};
use fusion_core::health::{Floor, Limits};
use fusion_models::units::{NonNegative, Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;

/// When the filter is no longer in good health.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HealthSpec {
    /// The filter is aligned once no axis of its attitude has a greater 1σ; 15 deg by default.
    pub aligned: Option<Positive<dim::Angle>>,
    /// Gaps of the process's input up to this length are ignored; 0.2 s by default.
    pub coasting: Option<NonNegative<dim::Duration>>,
    /// How large the innovations of a sensor may be.
    pub innovations: InnovationsSpec,
    /// How long a sensor may be rejected.
    pub rejected: RejectedSpec,
    /// How long the filter is degraded after it was corrected by a sensor that it had been rejecting,
    /// five measurements at least; 10 s by default.
    pub reacquired: Option<NonNegative<dim::Duration>>,
    /// How long a sensor may be silent.
    pub silent: SilentSpec,
    /// How long the filter may be without a measurement of position or velocity; 30 s by default, and at least three
    /// periods of the last sensor that measured them.
    pub unaided: Option<NonNegative<dim::Duration>>,
    /// How far an estimated calibration parameter may be from its initial value; 5 by default. The unit is its
    /// initial 1σ, together with its random walk since then. For a slow error it is the distance from zero, in
    /// units of its stationary 1σ.
    pub calibration: Option<Positive<dim::Ratio>>,
    /// How far a parameter may move while sensors contradict the estimate, in units of the change that its own
    /// covariance explains; 5 by default. It is reported until the parameter is back or is estimated anew.
    pub pulled: Option<Positive<dim::Ratio>>,
    /// How far a parameter may move within a minute in which no sensor contradicts the estimate, in units of the 1σ
    /// that it had; 8 by default.
    pub jumped: Option<Positive<dim::Ratio>>,
    /// The smallest plausible 1σ of the motion. An axis with a smaller 1σ from the start counts as known by
    /// declaration.
    pub floor: FloorSpec,
    /// How long a reason is still reported after it has ceased to hold; 5 s by default.
    pub hold: Option<NonNegative<dim::Duration>>,
}

/// Innovations of used measurements: their root mean square, in units of the σ that the filter
/// expects of them.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InnovationsSpec {
    /// Beyond it the filter is degraded; 2.5 by default.
    pub degraded: Option<Positive<dim::Ratio>>,
    /// Beyond it the filter is lost; 10 by default.
    pub lost: Option<Positive<dim::Ratio>>,
    /// The mean time until a filter without error calls one of its sensors biased; 100 h by default. The test
    /// checks the mean innovation of each axis; it must last for the window.
    pub false_alarm: Option<Positive<dim::Duration>>,
    /// The time that they are averaged over, at least ten measurements; 10 s by default.
    pub window: Option<Positive<dim::Duration>>,
}

/// Rejections in a row of residuals that the σ of the estimate does not explain.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RejectedSpec {
    /// After this time, and three measurements, the filter is degraded; 2 s by default. Two sensors that
    /// are rejected at the same time degrade it at once.
    pub degraded: Option<NonNegative<dim::Duration>>,
    /// After this time the filter is lost, if no sensor has been used meanwhile; 30 s by default.
    pub lost: Option<NonNegative<dim::Duration>>,
}

/// Pauses of a sensor that comes from a source. Both bounds must be exceeded.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SilentSpec {
    /// In units of the sensor's own mean period; 30 by default.
    pub periods: Option<Positive<dim::Ratio>>,
    /// As a time; 5 s by default.
    pub at_least: Option<NonNegative<dim::Duration>>,
}

/// A 1σ below it is a belief that nothing corrects any more.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FloorSpec {
    /// Of position; 0.1 mm by default.
    pub position: Option<NonNegative<dim::Length>>,
    /// Of velocity; 0.01 mm/s by default.
    pub velocity: Option<NonNegative<dim::Speed>>,
    /// Of attitude and heading; 1e-7 rad by default.
    pub attitude: Option<NonNegative<dim::Angle>>,
}

impl HealthSpec {
    /// The limits declared; the others as they are by default.
    #[must_use]
    pub fn limits(&self) -> Limits {
        let d = Limits::DEFAULT;
        Limits {
            aligned: self.aligned.map_or(d.aligned, |v| v.si()),
            coasting: self.coasting.map_or(d.coasting, |v| v.si()),
            innovations: self.innovations.degraded.map_or(d.innovations, |v| v.si()),
            innovations_lost: self.innovations.lost.map_or(d.innovations_lost, |v| v.si()),
            false_alarm: self.innovations.false_alarm.map_or(d.false_alarm, |v| v.si()),
            window: self.innovations.window.map_or(d.window, |v| v.si()),
            rejected: self.rejected.degraded.map_or(d.rejected, |v| v.si()),
            rejected_lost: self.rejected.lost.map_or(d.rejected_lost, |v| v.si()),
            reacquired: self.reacquired.map_or(d.reacquired, |v| v.si()),
            silent_periods: self.silent.periods.map_or(d.silent_periods, |v| v.si()),
            silent: self.silent.at_least.map_or(d.silent, |v| v.si()),
            unaided: self.unaided.map_or(d.unaided, |v| v.si()),
            calibration: self.calibration.map_or(d.calibration, |v| v.si()),
            pulled: self.pulled.map_or(d.pulled, |v| v.si()),
            jumped: self.jumped.map_or(d.jumped, |v| v.si()),
            floor: Floor {
                position: self.floor.position.map_or(d.floor.position, |v| v.si()),
                velocity: self.floor.velocity.map_or(d.floor.velocity, |v| v.si()),
                attitude: self.floor.attitude.map_or(d.floor.attitude, |v| v.si()),
            },
            hold: self.hold.map_or(d.hold, |v| v.si()),
        }
    }

    /// Reports limits by which a filter would be lost before it is degraded.
    pub(super) fn check(&self, node: &Node, d: &mut Diagnostics) {
        let limits = self.limits();
        let pairs = [
            ("innovations", limits.innovations, limits.innovations_lost, ""),
            ("rejected", limits.rejected, limits.rejected_lost, " s"),
        ];
        for (table, degraded, lost, unit) in pairs.into_iter().filter(|(_, degraded, lost, _)| degraded > lost) {
            let [written, default] = ["lost", "degraded"].map(|key| format!("{table}.{key}"));
            let path = if node.at(&written).is_some() { written } else { default };
            let message = format!("`lost` ({lost}{unit}) is smaller than `degraded` ({degraded}{unit})");
            let help = "write a `lost` that is at least `degraded`";
            d.push(Diagnostic::error(message).at(node.place_of(&path)).help(help));
        }
    }
}
