//! `[run]`: origin, time span and output.

use fusion_models::units::{Axes, Duration, NonNegative, Place, Positive, dim, range};
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

/// What becomes of rows that come out of order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OrderSpec {
    /// All rows are held back by `reorder` and the longest delay, and used once, in order.
    #[default]
    Hold,
    /// Rows are used as they arrive; for one that is valid earlier than what has been used, the filter
    /// goes back and uses everything since again.
    Rewind,
}

/// How far a filter goes back.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RewindSpec {
    /// How much later than stamped a row may come, 5 s by default; delays that are declared come on top. One
    /// that is later is told and not used. Estimates are final when they are so old.
    pub horizon: Positive<dim::Duration>,
    /// Time between two snapshots to go back to, 0.1 s by default: the longest that is done again in vain.
    pub spacing: Positive<dim::Duration>,
}

impl Default for RewindSpec {
    fn default() -> Self {
        let seconds = |s| Positive::try_from_si(s).unwrap_or_else(|_| unreachable!("{s} is positive"));
        Self {
            horizon: seconds(5.0),
            spacing: seconds(0.1),
        }
    }
}

/// A part of the map that a report shows enlarged.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapDetailSpec {
    /// Its title.
    pub title: String,
    /// Its middle: north, east of the origin.
    pub centre: Axes<dim::Length, range::Finite, 2>,
    /// Its extent, north and east.
    pub size: Positive<dim::Length>,
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
    /// Parts of the map that report.html shows enlarged.
    pub map_details: Vec<MapDetailSpec>,
    /// Seed of everything random: faults and simulated errors.
    pub seed: u64,
    /// How far ahead of all others a stamp may be, 10 s by default. Rows whose stamps are further ahead wait
    /// until 20 more confirm them. A row that is not ahead, or the end of the log, discards them.
    pub longest_jump: Option<Positive<dim::Duration>>,
    /// A silence of all rows longer than this separates one recording from the next: the filter starts anew by
    /// its initialisers and keeps its calibration. For a process without input; of one with input
    /// `process.input.longest_gap` says it.
    pub restart_after: Option<Positive<dim::Duration>>,
    /// How long the filter may be lost; after that it starts anew by its initialisers and keeps the calibration of
    /// before. 30 s by default; a filter with an initialiser that reads no stream never does.
    pub restart_lost: Option<Positive<dim::Duration>>,
    /// How far out of order live rows may arrive: so long every row waits for others. With
    /// `order = "rewind"` a few milliseconds of it save going back for rows that are a little late.
    pub reorder: NonNegative<dim::Duration>,
    /// What becomes of rows that come out of order.
    pub order: OrderSpec,
    /// How far back `order = "rewind"` goes.
    pub rewind: RewindSpec,
}
