//! The innovations of a run, row by row.

use crate::likelihood::Density;
use fusion::config::Node;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion_core::runner::{Event, Halt};

/// The innovations of one sensor.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    /// The number of each measurement among all of its sensor: a shift of time does not change it.
    pub(super) numbers: Vec<u32>,
    /// When each is valid \[s\].
    pub(super) times: Vec<f64>,
    /// r and L of each, S = L Lᵀ: m + m² numbers.
    values: Vec<f64>,
    /// Rows of the residual.
    pub(super) m: usize,
    heard: u32,
    /// When the latest row was valid, counted or not \[s\].
    latest: Option<f64>,
}

impl Rows {
    pub(super) fn len(&self) -> usize {
        self.numbers.len()
    }

    /// How many rows of the sensor reached the filter, those that do not count too.
    pub(super) fn heard(&self) -> u32 {
        self.heard
    }

    /// The place of the measurement with a number.
    pub(super) fn at(&self, number: u32) -> Option<usize> {
        self.numbers.binary_search(&number).ok()
    }

    /// r and L of row `k`.
    pub(super) fn innovation(&self, k: usize) -> (&[f64], &[f64]) {
        let size = self.m + self.m * self.m;
        self.values[k * size..(k + 1) * size].split_at(self.m)
    }
}

/// Keeps the innovations of the sensors that are judged, those that a gate rejected too.
///
/// Rows of a vehicle at rest do not count. A receiver that holds its output at rest is a better instrument than the same
/// receiver in motion, and one noise cannot describe both. With outages, only the first row after each of them counts.
#[derive(Debug)]
pub(super) struct Recorder {
    pub(super) sensors: Vec<Option<Rows>>,
    /// Whether a sensor has its rows from a stage that finds rest.
    rests: Vec<bool>,
    /// When a stage last found rest \[s\], and the shortest time between two of its rows; infinite after one row.
    rest: Option<(f64, f64)>,
    /// The length of the outages, if the run has some \[s\].
    outage: Option<f64>,
}

impl Recorder {
    /// For the sensors of the design's own filter, by their densities.
    pub(super) fn new(design: &Design, densities: &[Option<Density>], outage: Option<f64>) -> Self {
        let is_rest = |source: &String| {
            let stage = design.stages.iter().find(|stage| stage.name == *source);
            stage.is_some_and(|stage| stage.node.get("type").and_then(Node::as_str) == Some(REST))
        };
        Self {
            sensors: densities.iter().map(|d| d.is_some().then(Rows::default)).collect(),
            rests: design.sensors.iter().map(|s| is_rest(&s.block.common.source)).collect(),
            rest: None,
            outage,
        }
    }

    fn hear_rest(&mut self, time: f64) {
        self.rest = Some(match self.rest {
            None => (time, f64::INFINITY),
            Some((last, shortest)) if time > last => (time, shortest.min(time - last)),
            Some(same) => same,
        });
    }

    /// Whether the stage has found rest no longer ago than it takes to find it again.
    fn is_at_rest(&self, time: f64) -> bool {
        self.rest
            .is_some_and(|(last, shortest)| shortest.is_finite() && time - last <= shortest)
    }
}

/// The type of the stage that finds rest.
const REST: &str = "stationarity";

impl RunObserver for Recorder {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter {
            filter,
            event: Event::Updated { sensor, update, time, .. },
        } = event
        else {
            return Ok(());
        };
        if !filter.is_outermost() {
            return Ok(());
        }
        let sensor = filter.sensors[*sensor].design;
        if self.rests[sensor] {
            self.hear_rest(time.seconds());
        }
        let is_at_rest = self.is_at_rest(time.seconds());
        let Some(rows) = &mut self.sensors[sensor] else {
            return Ok(());
        };
        rows.heard += 1;
        let silent = rows.latest.replace(time.seconds()).map_or(0.0, |latest| time.seconds() - latest);
        // A latency moves the times by far less than half of an outage. A gap of the log that is as long counts as well.
        let is_expected = self.outage.is_some_and(|outage| silent < 0.5 * outage);
        if is_at_rest || is_expected {
            return Ok(());
        }
        let (r, l) = (update.residual, update.innovation_factor);
        if l.is_empty() || !r.iter().chain(l).all(|v| v.is_finite()) {
            return Ok(());
        }
        rows.m = r.len();
        rows.numbers.push(rows.heard);
        rows.times.push(time.seconds());
        rows.values.extend(r.iter().chain(l));
        Ok(())
    }
}
