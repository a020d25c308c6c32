//! What a runner is put together from, and what it tells.

use crate::filter::{FilterError, Update};
use crate::gate::Gate;
use crate::loss::Loss;
use crate::model::Measurement;
use crate::state::{Belief, Layout, View};
use crate::time::Time;
use core::fmt::Debug;
use std::sync::Arc;

/// The number of a stream, as given by [`Runner::add_stream`](super::Runner::add_stream).
pub type StreamId = usize;

/// Which numbers of a stream's rows a consumer takes, in its own order.
#[derive(Clone, Debug, Default)]
pub struct Port {
    /// The stream.
    pub stream: StreamId,
    /// Columns of its rows.
    pub columns: Vec<usize>,
    /// Rows are valid this many nanoseconds before their stamp.
    pub delay: i64,
}

impl Port {
    pub(super) fn gather(&self, row: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.columns.iter().map(|&c| row[c]));
    }
}

/// The noise of a sensor: constant, or read from columns of its rows.
#[derive(Clone, Debug)]
pub struct Noise {
    /// R, m×m, row by row: the constant part.
    pub covariance: Vec<f64>,
    /// Columns with a 1σ per residual row, multiplied by `scale` and squared onto the diagonal.
    pub sigma_columns: Vec<usize>,
    /// Factor on the columns.
    pub scale: f64,
}

impl Noise {
    /// Constant and diagonal.
    #[must_use]
    pub fn diagonal(sigma: &[f64]) -> Self {
        let m = sigma.len();
        let mut covariance = vec![0.0; m * m];
        for (i, s) in sigma.iter().enumerate() {
            covariance[i * m + i] = s * s;
        }
        Self {
            covariance,
            sigma_columns: Vec::new(),
            scale: 1.0,
        }
    }

    pub(super) fn fill(&self, row: &[f64], r: &mut [f64]) {
        r.copy_from_slice(&self.covariance);
        let m = self.sigma_columns.len();
        for (i, &c) in self.sigma_columns.iter().enumerate() {
            r[i * m + i] += (row[c] * self.scale).powi(2);
        }
    }
}

/// One sensor: a model fed by a stream, with its noise, gate and loss as siblings.
#[derive(Debug)]
pub struct Sensor {
    /// Unique name.
    pub name: String,
    /// The measurement model.
    pub model: Arc<dyn Measurement>,
    /// Where its value comes from; no columns where the value is `constant`.
    pub port: Port,
    /// The value of a pseudo-measurement.
    pub constant: Vec<f64>,
    /// Its noise.
    pub noise: Noise,
    /// Its gate.
    pub gate: Box<dyn Gate>,
    /// Its loss.
    pub loss: Arc<dyn Loss>,
    /// The number of the sensor that it goes with, in no circle: a measurement is rejected, whatever
    /// the own gate would say, where the latest one of that sensor that is valid no later was not used.
    pub only_with: Option<usize>,
}

/// Turns streams into a stream: a detector, a clock, an attitude reference.
pub trait Stage: Debug + Send {
    /// Sees a row of its input number `input`; `view` is the estimate once there is one.
    fn row(&mut self, input: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter);
}

/// Collects the rows a stage emits.
#[derive(Debug, Default)]
pub struct Emitter {
    rows: Vec<(Time, usize)>,
    data: Vec<f64>,
}

impl Emitter {
    /// Emits a row valid at `time`.
    pub fn emit(&mut self, time: Time, row: &[f64]) {
        self.rows.push((time, row.len()));
        self.data.extend_from_slice(row);
    }

    /// The rows emitted so far.
    pub fn rows(&self) -> impl Iterator<Item = (Time, &[f64])> {
        let mut start = 0;
        self.rows.iter().map(move |&(t, len)| {
            let row = &self.data[start..start + len];
            start += len;
            (t, row)
        })
    }

    pub(super) fn clear(&mut self) {
        self.rows.clear();
        self.data.clear();
    }
}

/// A stage with its ports and the stream it feeds.
#[derive(Debug)]
pub struct StageUnit {
    /// Unique name.
    pub name: String,
    /// The stage.
    pub stage: Box<dyn Stage>,
    /// What it listens to.
    pub inputs: Vec<Port>,
    /// What it feeds.
    pub output: StreamId,
}

/// Finds part of the initial belief from the first data.
pub trait Initialiser: Debug + Send {
    /// Sees a row of its input number `input`.
    fn row(&mut self, input: usize, time: Time, row: &[f64]);

    /// `None` once it can write; until then, what it waits for.
    fn waits_for(&self) -> Option<String>;

    /// Writes its part of the belief at `time`; earlier initialisers have written theirs.
    fn write(&self, time: Time, layout: &Layout, belief: &mut Belief);
}

/// An initialiser with its ports.
#[derive(Debug)]
pub struct InitialiserUnit {
    /// Unique name.
    pub name: String,
    /// The initialiser.
    pub initialiser: Box<dyn Initialiser>,
    /// What it listens to.
    pub inputs: Vec<Port>,
}

/// What the runner tells its observer.
#[derive(Debug)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The filter starts from this belief.
    Started {
        /// The initial belief.
        belief: &'a Belief,
    },
    /// An input sample has been processed whole; for a process driven by time alone, a
    /// measurement.
    Predicted {
        /// The belief at its stamp.
        belief: &'a Belief,
    },
    /// A sensor's measurement has been offered.
    Updated {
        /// The sensor's number.
        sensor: usize,
        /// What became of it.
        update: Update<'a>,
        /// Time of validity.
        time: Time,
    },
    /// A row came too late for the buffer and was not used.
    Late {
        /// The consumer's name.
        consumer: &'a str,
        /// Its time of validity.
        time: Time,
        /// The estimate's time.
        now: Time,
    },
    /// A row held a number that is not finite and was not used.
    NotFinite {
        /// The consumer's name.
        consumer: &'a str,
        /// Its time of validity.
        time: Time,
    },
    /// The estimator could not go on; the belief is the last sound one.
    Failed {
        /// Why.
        error: FilterError,
    },
}

/// Receives typed events.
pub trait Observer {
    /// Called for every event, in order.
    fn on(&mut self, event: &Event<'_>);
}

impl<F: FnMut(&Event<'_>)> Observer for F {
    fn on(&mut self, event: &Event<'_>) {
        self(event);
    }
}
