//! The fields that all links and outputs share. The crate of live links reads the tables.

use fusion_models::units::{Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;

/// The fields of every link, in addition to those of its type.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinkCommon {
    /// The sources that read its bytes, as they would read their file. A link without sources only sends.
    #[serde(default)]
    pub sources: Vec<String>,
    /// The time of its rows.
    #[serde(default)]
    pub clock: LinkClock,
    /// With `clock = "related"`: how far the rate of its clock may differ from that of this computer.
    /// `"100 ppm"` by default: a poor crystal.
    pub drift: Option<Positive<dim::Ratio>>,
    /// Bytes that wait for the filter have at most this number; further ones are dropped and counted. 4 MiB by default.
    pub most_waiting: Option<u64>,
}

/// The time of the rows of a link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LinkClock {
    /// Their stamps, as the source declares them.
    #[default]
    Own,
    /// Their stamps, moved to the clock of this computer: offset and drift are found from the shortest delays.
    Related,
    /// Their arrival.
    Arrival,
}

/// The fields of every output, in addition to those of its type.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutputCommon {
    /// How many estimates leave in a second.
    pub rate: Positive<dim::Frequency>,
    /// If no estimate left within this time, a line says so. Ten intervals by default.
    pub watchdog: Option<Positive<dim::Duration>>,
}
