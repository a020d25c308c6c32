//! `[run]`: origin, time span and output.

use fusion_models::units::{Duration, NonNegative, Place, Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// Smoothing beside the estimates.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SmoothSpec {
    /// An estimate is smoothed by the data valid up to this long after it.
    pub lag: Positive<dim::Duration>,
}

/// What a run as a whole needs.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RunSpec {
    /// What this design is, in a line.
    pub description: String,
    /// Where relative source paths start, itself relative to the file; `--data` overrides it.
    pub data_dir: Option<PathBuf>,
    /// Origin of the local coordinates n, e, d; by default the filter's first position.
    pub origin: Option<Place>,
    /// Rows stamped earlier are not read.
    pub start: Option<Duration>,
    /// Rows stamped later are not read.
    pub stop: Option<Duration>,
    /// Rows of estimates.csv per second of log; every input sample where absent.
    pub output_rate: Option<Positive<dim::Frequency>>,
    /// Writes smoothed.csv too: estimates that know the data up to a fixed time after them, scored beside the
    /// others. `fusion run --smooth` smooths by all data of the log. Of a design with filters inside
    /// stages, the outermost one is smoothed.
    pub smooth: Option<SmoothSpec>,
    /// Seed of everything random: faults and simulated errors.
    pub seed: u64,
    /// How far ahead of all others a stamp may be, 10 s by default: a row whose stamp is further ahead
    /// waits until a second one confirms it, and is not used if none does.
    pub longest_jump: Option<Positive<dim::Duration>>,
    /// How far out of order live rows may arrive.
    pub reorder: NonNegative<dim::Duration>,
}
