//! How the estimate depends on the numbers of an input sample: the map of an instrument's errors into the state.
//!
//! Central differences of the process and of the measurements themselves, so that every process is covered, including those
//! of other crates. A number of the sample changes by [`SMALL`] over the length of the step. The curvature then adds 1e-7 to
//! a derivative, relative, and the rounding of a geodetic position adds 1e-6.

use fusion_core::model::{Input, Measurement, Process, SignalBuffer};
use fusion_core::state::Layout;
use std::sync::Arc;

/// The change of a number of the sample times the length of the step: a milliradian, a millimetre per second.
const SMALL: f64 = 1e-3;
/// The length of a step for a measurement, which takes no time \[s\].
const INSTANT: f64 = 0.01;

/// Derivatives by the numbers of a sample.
#[derive(Debug)]
pub(super) struct ByInput {
    layout: Arc<Layout>,
    process: Arc<dyn Process>,
    signals: SignalBuffer,
    sample: Vec<f64>,
    ends: [Vec<f64>; 2],
}

impl ByInput {
    pub(super) fn new(layout: &Arc<Layout>, process: &Arc<dyn Process>) -> Self {
        Self {
            signals: SignalBuffer::new(layout),
            layout: layout.clone(),
            process: process.clone(),
            sample: Vec::new(),
            ends: [Vec::new(), Vec::new()],
        }
    }

    /// ∂x⁺/∂u of number `channel` over a step of `dt` seconds from `x`, into `out`.
    pub(super) fn of_step(&mut self, x: &[f64], input: &Input<'_>, dt: f64, channel: usize, out: &mut [f64]) {
        let step = SMALL / dt;
        for (end, sign) in self.ends.iter_mut().zip([1.0, -1.0]) {
            let sample = moved(&mut self.sample, input, channel, sign * step);
            end.clear();
            end.extend_from_slice(x);
            self.process.propagate(end, &sample, dt);
        }
        self.layout.minus(&self.ends[0], &self.ends[1], out);
        out.iter_mut().for_each(|d| *d /= 2.0 * step);
    }

    /// ∂h/∂u of number `channel` at `x`, into `out`. Returns false where h has no value.
    pub(super) fn of_measurement(
        &mut self,
        model: &dyn Measurement,
        x: &[f64],
        input: &Input<'_>,
        channel: usize,
        out: &mut [f64],
    ) -> bool {
        let step = SMALL / INSTANT;
        for (end, sign) in self.ends.iter_mut().zip([1.0, -1.0]) {
            let sample = moved(&mut self.sample, input, channel, sign * step);
            self.signals.evaluate(self.process.as_ref(), x, &sample, false);
            end.clear();
            end.resize(model.size().value, 0.0);
            if model.predict(&self.signals.view(x).with_given(model.given()), end).is_err() {
                return false;
            }
        }
        model.residual(&self.ends[0], &self.ends[1], out);
        out.iter_mut().for_each(|d| *d /= 2.0 * step);
        true
    }
}

/// The sample with another number.
fn moved<'a>(sample: &'a mut Vec<f64>, input: &Input<'_>, channel: usize, by: f64) -> Input<'a> {
    sample.clear();
    sample.extend_from_slice(input.sample);
    sample[channel] += by;
    Input {
        sample,
        interval: input.interval,
    }
}
