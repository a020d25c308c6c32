//! An estimate as an object of JSON.

use super::Outgoing;
use fusion::output::EstimateClock;
use fusion::solution::{rpy_of, sigmas};
use schemars::JsonSchema;
use serde::Serialize;

/// An estimate: a line of the output `json`, and a message of the output `foxglove`. A number that is not known is absent.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Line<'a> {
    /// Time of the filter \[s\].
    time: f64,
    /// Seconds since 1970-01-01 UTC.
    #[serde(skip_serializing_if = "Option::is_none")]
    unix: Option<f64>,
    /// \[deg\].
    #[serde(skip_serializing_if = "Option::is_none")]
    latitude: Option<f64>,
    /// \[deg\].
    #[serde(skip_serializing_if = "Option::is_none")]
    longitude: Option<f64>,
    /// Above the ellipsoid \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<f64>,
    /// North, east, down \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    position_sigma: Option<[f64; 3]>,
    /// North, east, down \[m/s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    velocity: Option<[f64; 3]>,
    /// North, east, down \[m/s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    velocity_sigma: Option<[f64; 3]>,
    /// Roll, pitch, yaw \[deg\].
    #[serde(skip_serializing_if = "Option::is_none")]
    attitude: Option<[f64; 3]>,
    /// Roll, pitch, yaw \[deg\].
    #[serde(skip_serializing_if = "Option::is_none")]
    attitude_sigma: Option<[f64; 3]>,
    /// How old the newest row is \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    age: Option<f64>,
    /// `good`, `aligning`, `coasting`, `degraded` or `lost`.
    health: &'a str,
    /// Why the health is not good.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    reasons: &'a [String],
    /// The rows or sensors that the filter needs before it can start.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    waits_for: &'a [String],
}

impl<'a> Line<'a> {
    pub(super) fn of(estimate: &'a Outgoing, clock: EstimateClock) -> Self {
        let solution = estimate.solution.unwrap_or_default();
        let position = solution.position.as_ref();
        let attitude = solution.attitude.as_ref().map(|(q, p)| rpy_of(q, p));
        let degrees = |v: nalgebra::Vector3<f64>| v.map(f64::to_degrees).into();
        Self {
            time: estimate.time.seconds(),
            unix: clock.time_zero.map(|_| clock.unix_nanos(estimate.time) as f64 * 1e-9),
            latitude: position.map(|(place, _)| place.lat.to_degrees()),
            longitude: position.map(|(place, _)| place.lon.to_degrees()),
            height: position.map(|(place, _)| place.height),
            position_sigma: position.map(|(_, p)| sigmas(p).into()),
            velocity: solution.velocity.map(|(v, _)| v.into()),
            velocity_sigma: solution.velocity.map(|(_, p)| sigmas(&p).into()),
            attitude: attitude.map(|(rpy, _)| degrees(rpy)),
            attitude_sigma: attitude.map(|(_, sigma)| degrees(sigma)),
            age: estimate.age,
            health: estimate.health.word(),
            reasons: &estimate.reasons,
            waits_for: &estimate.waits_for,
        }
    }
}
