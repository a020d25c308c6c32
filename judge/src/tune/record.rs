//! The innovations of a run, row by row.

use crate::likelihood::Density;
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
}

impl Rows {
    pub(super) fn len(&self) -> usize {
        self.numbers.len()
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
#[derive(Debug)]
pub(super) struct Recorder {
    pub(super) sensors: Vec<Option<Rows>>,
}

impl Recorder {
    /// For the sensors of the design's own filter, by their densities.
    pub(super) fn new(densities: &[Option<Density>]) -> Self {
        let sensors = densities.iter().map(|d| d.is_some().then(Rows::default));
        Self {
            sensors: sensors.collect(),
        }
    }
}

impl RunObserver for Recorder {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter {
            filter,
            event: Event::Updated { sensor, update, time, .. },
        } = event
        else {
            return Ok(());
        };
        let Some(Some(rows)) = self.sensors.get_mut(*sensor).filter(|_| filter.is_outermost()) else {
            return Ok(());
        };
        rows.heard += 1;
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
