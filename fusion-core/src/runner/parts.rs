//! The parts of a runner.

use super::StreamId;
use super::event::{Event, Halt, Observer};
use crate::Printed;
use crate::belief::Belief;
use crate::gate::Gate;
use crate::loss::Loss;
use crate::math;
use crate::memory::Memory;
use crate::model::{Literal, Measurement};
use crate::printed::role;
use crate::state::{Layout, Quantity, Scalar, View};
use crate::time::{Time, nanos};
use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt::Debug;

/// Which numbers of a stream's rows a consumer takes, in its own order.
#[derive(Clone, Debug, Default, Literal)]
#[literal(at = "fusion_core::runner")]
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

/// The limits of the input of the process.
#[derive(Clone, Debug, PartialEq, Literal)]
#[literal(at = "fusion_core::runner")]
pub struct InputLimits {
    /// The largest magnitude per number of a sample, as its instrument measures; empty: any.
    pub range: Vec<f64>,
    /// The longest time \[s\] that one sample covers. By default it is ten usual intervals between samples, and at
    /// least 0.1 s.
    pub longest_interval: Option<f64>,
    /// The longest gap \[s\] that is coasted through; after that the filter starts anew.
    pub longest_gap: f64,
}

impl Default for InputLimits {
    fn default() -> Self {
        Self {
            range: Vec::new(),
            longest_interval: None,
            longest_gap: 60.0,
        }
    }
}

/// The noise of a sensor: constant, or read from columns of its rows.
#[derive(Clone, Debug, Literal)]
#[literal(at = "fusion_core::runner")]
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
            r[i * m + i] += math::powi(row[c] * self.scale, 2);
        }
    }
}

/// The time offset of a sensor whose rows cannot simply be queued at their time of validity: stamp
/// minus validity \[s\].
#[derive(Clone, Debug, Literal)]
#[literal(at = "fusion_core::runner")]
pub struct Offset {
    /// Its value: a state, or a constant where rows come too late to be queued that early.
    pub value: Quantity<Scalar>,
    /// The least offset that is allowed for; a row with a smaller offset is served at this one.
    pub least: f64,
    /// The largest offset that is allowed for. [`Port::delay`] of its sensor contains it.
    pub most: f64,
}

/// Rows that switch a sensor while the filter runs. A row holds from its time of validity until the next one. A number
/// that is not finite changes nothing.
#[derive(Clone, Debug, Literal)]
#[literal(at = "fusion_core::runner")]
pub struct Switch {
    /// The columns that it reads: that of the use, then that of the noise, if it has both.
    pub port: Port,
    /// Whether the first column is zero while the sensor is not used.
    pub has_use: bool,
    /// Whether the last column is a factor on the 1σ of its noise. A factor that is not positive changes nothing, and is
    /// reported as out of range.
    pub has_noise: bool,
}

/// One sensor: a model fed by a stream, with its noise, gate and loss as siblings.
#[derive(Debug)]
pub struct Sensor {
    /// Unique name.
    pub name: String,
    /// The measurement model.
    pub model: Arc<dyn Measurement>,
    /// The source of its value; it has no columns if the value is `constant`.
    pub port: Port,
    /// Its time offset, if it is estimated.
    pub offset: Option<Offset>,
    /// The value of a pseudo-measurement.
    pub constant: Vec<f64>,
    /// Its noise.
    pub noise: Noise,
    /// The column with the quality of a row, such as HDOP, for gates that use it.
    pub quality: Option<usize>,
    /// Its gate.
    pub gate: Box<dyn Gate>,
    /// Its loss.
    pub loss: Arc<dyn Loss>,
    /// The rows that switch it, if there are any.
    pub switch: Option<Switch>,
}

impl Sensor {
    /// Its stream, and the columns that it reads.
    #[must_use]
    pub fn reads(&self) -> (StreamId, Vec<usize>) {
        let columns = self.port.columns.iter().chain(&self.noise.sigma_columns);
        (self.port.stream, columns.copied().collect())
    }

    /// The shortest delay its rows may have \[ns\].
    pub(super) fn least_delay(&self) -> i64 {
        let play = self.offset.as_ref().map_or(0, |o| nanos((o.most - o.least).max(0.0)));
        self.port.delay.saturating_sub(play)
    }

    /// When a row of this stamp is valid, by the offset in the state `x`; `None` without an offset.
    pub(super) fn aim(&self, stamp: Time, x: &[f64]) -> Option<Time> {
        let offset = self.offset.as_ref()?;
        let tau = offset.value.stored(x).unwrap_or(offset.most).max(offset.least).min(offset.most);
        Some(stamp.shifted(-self.port.delay).shifted(nanos(offset.most - tau)))
    }

    /// The offset by which a row of this stamp is valid at `time`; `None` without an offset.
    pub(super) fn assumed(&self, stamp: Time, time: Time) -> Option<f64> {
        let earliest = stamp.shifted(-self.port.delay);
        Some(self.offset.as_ref()?.most - time.seconds_since(earliest))
    }
}

/// The outcome of the tests of a stage.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tested {
    /// How often it tested.
    pub tests: u64,
    /// How often the tested condition held.
    pub held: u64,
    /// If it never held: the nearest case, with its figures and the limits that it missed.
    pub nearest: Option<String>,
}

/// Turns streams into a stream: a detector, a clock, a separate filter.
pub trait Stage: Memory + Printed + Send {
    /// Sees a row of its input number `input`; `view` is the estimate once there is one.
    fn row(&mut self, input: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter<'_>);

    /// Hears that the stream that drives the process is silent, and that the estimate has moved to `time` without it.
    /// Only stages that listen to that stream hear it. The rows emitted here are valid at `time` or later.
    fn silence(&mut self, time: Time, view: &View<'_>, out: &mut Emitter<'_>) {
        let _ = (time, view, out);
    }

    /// The data that a filter inside it still waits for before it can start: names and reasons.
    fn waits_for(&self) -> Vec<(String, String)> {
        Vec::new()
    }

    /// The outcome of its tests since the filter has run, for a stage that tests a condition.
    fn tested(&self) -> Option<Tested> {
        None
    }

    /// Hears that no row follows: the end of the log.
    fn finish(&mut self, out: &mut Emitter<'_>) {
        let _ = out;
    }

    /// The stage as a Rust expression, by [`literal!`](crate::literal!); `None` if it cannot write itself.
    fn literal(&self) -> Option<&dyn Literal> {
        None
    }
}

role!(Stage);

/// Takes the output of a stage: rows for its stream, events of a filter inside.
#[derive(Default)]
pub struct Emitter<'a> {
    pub(super) emitted: Emitted,
    told: Option<(&'a str, &'a mut dyn Observer)>,
    halt: Option<Halt>,
    number: u64,
    disturbed: bool,
}

/// Rows that a stage has emitted.
#[derive(Clone, Debug, Default)]
pub(super) struct Emitted {
    rows: Vec<(Time, usize)>,
    data: Vec<f64>,
}

impl Emitted {
    /// Room for a row of `width` numbers.
    pub(super) fn reserve(&mut self, width: usize) {
        self.rows.reserve(1);
        self.data.reserve(width);
    }

    pub(super) const fn count(&self) -> u64 {
        self.rows.len() as u64
    }

    pub(super) fn rows(&self) -> impl Iterator<Item = (Time, &[f64])> {
        let mut start = 0;
        self.rows.iter().map(move |&(t, len)| {
            let row = &self.data[start..start + len];
            start += len;
            (t, row)
        })
    }
}

impl Debug for Emitter<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.emitted.fmt(f)
    }
}

impl<'a> Emitter<'a> {
    /// An emitter whose events `observer` hears as events of `stage`; `emitted` lends its memory.
    pub(super) fn new(mut emitted: Emitted, stage: &'a str, observer: &'a mut dyn Observer) -> Self {
        emitted.rows.clear();
        emitted.data.clear();
        Self {
            emitted,
            told: Some((stage, observer)),
            halt: None,
            number: 0,
            disturbed: false,
        }
    }

    /// The same emitter while the stage sees the row `number`; `disturbed` says whether a declared fault changed it.
    pub(super) const fn seeing(mut self, number: u64, disturbed: bool) -> Self {
        self.number = number;
        self.disturbed = disturbed;
        self
    }

    /// The number within its source of the row that the stage sees.
    #[must_use]
    pub const fn row_number(&self) -> u64 {
        self.number
    }

    /// Whether a declared fault changed a number of the row that the stage sees.
    #[must_use]
    pub const fn is_disturbed(&self) -> bool {
        self.disturbed
    }

    /// Emits a row valid at `time`, which is not before the row that the stage has just seen.
    pub fn emit(&mut self, time: Time, row: &[f64]) {
        self.emitted.rows.push((time, row.len()));
        self.emitted.data.extend_from_slice(row);
    }

    /// Reports an event of the filter inside the stage, as [`Event::Nested`].
    pub fn tell(&mut self, event: &Event<'_>) {
        if let (None, Some((stage, observer))) = (&self.halt, &mut self.told) {
            self.halt = observer.on(&Event::Nested { stage, event }).err();
        }
    }

    /// Whether an observer wants the steps of the filter inside.
    #[must_use]
    pub fn wants_steps(&self) -> bool {
        self.told.as_ref().is_some_and(|(_, observer)| observer.wants_steps())
    }

    /// The rows emitted so far.
    pub fn rows(&self) -> impl Iterator<Item = (Time, &[f64])> {
        self.emitted.rows()
    }

    /// The rows, unless an observer has stopped the run.
    pub(super) fn finish(self) -> Result<Emitted, Halt> {
        match self.halt {
            Some(halt) => Err(halt),
            None => Ok(self.emitted),
        }
    }
}

/// A stage with its ports and the stream it feeds.
#[derive(Debug)]
pub struct StageUnit {
    /// Unique name.
    pub name: String,
    /// The stage.
    pub stage: Box<dyn Stage>,
    /// Its inputs.
    pub inputs: Vec<Port>,
    /// The stream that it feeds.
    pub output: StreamId,
}

/// Finds part of the initial belief from the first data.
pub trait Initialiser: Memory + Printed + Send {
    /// Sees a row of its input number `input`.
    fn row(&mut self, input: usize, time: Time, row: &[f64]);

    /// `None` once it can write; until then, what it waits for.
    fn waits_for(&self) -> Option<String>;

    /// Writes its part of the belief at `time`; earlier initialisers have written theirs.
    fn write(&self, time: Time, layout: &Layout, belief: &mut Belief);

    /// The initialiser as a Rust expression, by [`literal!`](crate::literal!); `None` if it cannot write itself.
    fn literal(&self) -> Option<&dyn Literal> {
        None
    }
}

role!(Initialiser);

/// An initialiser with its ports.
#[derive(Debug)]
pub struct InitialiserUnit {
    /// Unique name.
    pub name: String,
    /// The initialiser.
    pub initialiser: Box<dyn Initialiser>,
    /// Its inputs.
    pub inputs: Vec<Port>,
}
