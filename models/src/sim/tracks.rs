//! Simulated speeds of the tracks of a vehicle, as its drives measure them.
//!
//! True       the speeds of the tracks themselves, on any ground: slip affects the motion of the
//!            vehicle and not these numbers
//! Measured   plus white noise
//! Not here   scale and bias of the encoders

use super::random::Random;
use crate::units::{NonNegative, Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;

/// The instrument that measures the speeds of a vehicle's tracks.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrackSpeedsSpec {
    /// Rows per second; at most 1e9 in a run.
    pub(super) rate: Positive<dim::Frequency>,
    /// 1σ of the white noise of each speed.
    #[serde(default)]
    white: NonNegative<dim::Speed>,
}

/// The instrument as it runs: seeded.
#[derive(Clone, Debug)]
pub(super) struct TrackSpeeds {
    white: f64,
    random: Random,
}

impl TrackSpeeds {
    pub(super) fn new(spec: &TrackSpeedsSpec, seed: u64) -> Self {
        Self {
            white: spec.white.si(),
            random: Random::new(seed, "track_speeds"),
        }
    }

    /// The measurement for these speeds of the left and the right track.
    pub(super) fn measure(&mut self, tracks: [f64; 2]) -> [f64; 2] {
        tracks.map(|speed| speed + self.white * self.random.normal())
    }
}
