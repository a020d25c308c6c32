//! Lines of JSON.

use super::{About, Outgoing, Output, OutputSpec};
use crate::link::Sender;
use fusion::models::register;
use fusion::output::EstimateClock;
use fusion::solution::{rpy_of, sigmas};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io::{self, ErrorKind};

/// One line of JSON for each estimate: time, position, velocity, attitude, their 1σ, age and health. Angles are in
/// degrees, everything else in SI.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JsonSpec {
    /// The link by which it is sent.
    link: String,
}

register! { Output, "json", JsonSpec, r#"link = "console""# }

#[typetag::deserialize(name = "json")]
impl OutputSpec for JsonSpec {
    fn link(&self) -> Option<&str> {
        Some(&self.link)
    }

    fn open(&self, about: &About) -> io::Result<Box<dyn Output>> {
        Ok(Box::new(Lines {
            clock: about.clock,
            line: Vec::new(),
        }))
    }
}

struct Lines {
    clock: EstimateClock,
    line: Vec<u8>,
}

/// A line.
#[derive(Serialize)]
struct Line<'a> {
    /// Time of the filter \[s\].
    time: f64,
    /// Seconds since 1970-01-01 UTC.
    #[serde(skip_serializing_if = "Option::is_none")]
    unix: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    latitude: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    longitude: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<f64>,
    /// North, east, down \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    position_sigma: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    velocity: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    velocity_sigma: Option<[f64; 3]>,
    /// Roll, pitch, yaw \[deg\].
    #[serde(skip_serializing_if = "Option::is_none")]
    attitude: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    attitude_sigma: Option<[f64; 3]>,
    /// How old the newest row is \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    age: Option<f64>,
    health: &'a str,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    reasons: &'a [String],
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    waits_for: &'a [String],
}

impl Output for Lines {
    fn send(&mut self, estimate: &Outgoing, to: Option<&mut dyn Sender>) -> io::Result<()> {
        let solution = estimate.solution.unwrap_or_default();
        let position = solution.position.as_ref();
        let attitude = solution.attitude.as_ref().map(|(q, p)| rpy_of(q, p));
        let degrees = |v: nalgebra::Vector3<f64>| v.map(f64::to_degrees).into();
        let line = Line {
            time: estimate.time.seconds(),
            unix: self.clock.time_zero.map(|_| self.clock.unix_nanos(estimate.time) as f64 * 1e-9),
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
        };
        self.line.clear();
        serde_json::to_writer(&mut self.line, &line)?;
        self.line.push(b'\n');
        let to = to.ok_or_else(|| io::Error::new(ErrorKind::NotConnected, "the link is not open"))?;
        to.send(&self.line)
    }
}
