//! `input` of the process: what its samples may be like.

use fusion_models::units::{PerAxis, Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// What the samples that drive the process may be like; where they are not, or do not come, the process
/// goes on without.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputSpec {
    /// What the instruments measure at most, by channel, e.g. `angular_rate = "300 deg/s"`: a sample with
    /// a number beyond it is not used.
    #[serde(default)]
    pub range: BTreeMap<String, PerAxis>,
    /// The longest time that one sample stands for; by default ten times what is usual among the
    /// samples, and at least 0.1 s. Where the next one is later, the process coasts.
    pub longest_interval: Option<Positive<dim::Duration>>,
    /// The longest gap between samples that the process coasts through, 60 s by default; after that the
    /// filter starts anew by its initialisers.
    pub longest_gap: Option<Positive<dim::Duration>>,
}
