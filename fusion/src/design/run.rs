//! `[run]`: origin, time span and output.

use fusion_models::units::{Axes, Duration, NonNegative, Place, Positive, dim, range};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::PathBuf;

/// Smoothing in addition to the estimates.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SmoothSpec {
    /// An estimate is smoothed by the data valid up to this long after it.
    pub lag: Positive<dim::Duration>,
}

/// How rows that come out of order are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OrderSpec {
    /// All rows are held back by `reorder` and the longest delay, and used once, in order.
    #[default]
    Hold,
    /// Rows are used as they arrive. If a row is valid earlier than the rows already used, the filter
    /// goes back and uses all rows since then again.
    Rewind,
}

/// How far a filter goes back.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RewindSpec {
    /// How much later than its stamp a row may come, 5 s by default; declared delays are added. A later row is
    /// reported and not used. Estimates older than this are final.
    pub horizon: Positive<dim::Duration>,
    /// Time between two snapshots to go back to, 0.1 s by default: the longest time that is repeated without need.
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

/// The settings of the whole run.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RunSpec {
    /// A description of this design in one line.
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
    /// Writes smoothed.csv too: estimates that use the data up to a fixed time after them, with their own score.
    /// `fusion run --smooth` uses all data of the log. If a design has filters inside stages, only the
    /// outermost filter is smoothed.
    pub smooth: Option<SmoothSpec>,
    /// Parts of the map that report.html shows enlarged.
    pub map_details: Vec<MapDetailSpec>,
    /// Seed of everything random: faults and simulated errors.
    pub seed: u64,
    /// How far ahead of all others a stamp may be, 10 s by default. Rows whose stamps are further ahead wait
    /// until 20 more confirm them. A row that is not ahead, or the end of the log, discards them.
    pub longest_jump: Option<Positive<dim::Duration>>,
    /// A silence of all rows longer than this separates one recording from the next: the filter starts anew with
    /// its initialisers and keeps its calibration. It is for a process without input; for a process with input, use
    /// `process.input.longest_gap`.
    pub restart_after: Option<Positive<dim::Duration>>,
    /// How long the filter may be lost; after that it starts anew with its initialisers and keeps the calibration of
    /// before. 30 s by default; a filter with an initialiser that reads no stream never starts anew.
    pub restart_lost: Option<Positive<dim::Duration>>,
    /// How far out of order live rows may arrive: every row waits this long for others. With
    /// `order = "rewind"`, a few milliseconds avoid going back for rows that are a little late.
    pub reorder: NonNegative<dim::Duration>,
    /// How rows that come out of order are used.
    pub order: OrderSpec,
    /// How far back `order = "rewind"` goes.
    pub rewind: RewindSpec,
}
