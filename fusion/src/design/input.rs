//! `input` of the process: the limits of its samples.

use fusion_models::units::{PerAxis, Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// The limits of the samples that drive the process. If a sample exceeds them or is missing, the process
/// continues without it.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputSpec {
    /// The measuring range of the instruments, by channel, e.g. `angular_rate = "300 deg/s"`: a sample with
    /// a number beyond it is not used.
    #[serde(default)]
    pub range: BTreeMap<String, PerAxis>,
    /// The longest time that one sample is valid for. By default it is ten times the usual interval of the
    /// samples, and at least 0.1 s. If the next sample is later, the process coasts.
    pub longest_interval: Option<Positive<dim::Duration>>,
    /// The longest gap between samples that the process coasts through, 60 s by default. After a longer gap,
    /// the filter starts anew with its initialisers.
    pub longest_gap: Option<Positive<dim::Duration>>,
}
