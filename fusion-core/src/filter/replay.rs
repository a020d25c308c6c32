//! The models behind a filter's steps, evaluated again at other states.

use super::lateness::Lateness;
use super::own::OwnDynamics;
use super::rule::Innovation;
use super::step::Offered;
use crate::covariance::{Covariance, Form, Kernel};
use crate::linear::Transition;
use crate::loss::Loss;
use crate::model::{Gap, Input, LastInput, Measurement, Process, SignalBuffer, Size, Undefined};
use crate::state::{Layout, Quantity, Scalar};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// The parts of a sensor that a measurement needs to be linearised at another state.
#[derive(Clone, Debug)]
pub struct SensorModel {
    /// h.
    pub model: Arc<dyn Measurement>,
    /// Its time offset, if it is estimated.
    pub offset: Option<Quantity<Scalar>>,
    /// Its robust loss.
    pub loss: Arc<dyn Loss>,
}

/// The process and the sensors of a filter, with the memory to evaluate them.
#[derive(Debug)]
pub(crate) struct Replay {
    pub(crate) layout: Arc<Layout>,
    process: Arc<dyn Process>,
    sensors: Vec<SensorModel>,
    own: OwnDynamics,
    signals: SignalBuffer,
    /// Φ and Q of the latest step.
    pub(crate) transition: Transition,
    /// Residual and H of the latest measurement.
    pub(crate) work: Innovation,
}

impl Replay {
    /// For steps of a filter of `process` over `layout`, whose sensors are `sensors` in order of their numbers.
    pub(crate) fn new(layout: Arc<Layout>, process: Arc<dyn Process>, sensors: Vec<SensorModel>, form: &dyn Form, kernel: Kernel) -> Self {
        let sizes = || sensors.iter().map(|s| s.model.size());
        let largest = Size {
            value: sizes().map(|s| s.value).max().unwrap_or(0),
            residual: sizes().map(|s| s.residual).max().unwrap_or(0),
        };
        let mut work = Innovation::new(&layout, form, largest);
        work.work.kernel = kernel;
        Self {
            own: OwnDynamics::of(&layout),
            signals: SignalBuffer::new(&layout),
            transition: Transition::new(&layout),
            work,
            layout,
            process,
            sensors,
        }
    }

    /// The loss of a sensor.
    pub(crate) fn loss(&self, sensor: usize) -> Option<&dyn Loss> {
        self.sensors.get(sensor).map(|s| s.loss.as_ref())
    }

    /// Moves `x` by a step of `duration` seconds under `input`, or through a `gap`. Φ and Q go into
    /// [`transition`](Self::transition); `covariance` is P before the step.
    pub(crate) fn advance(&mut self, x: &mut [f64], duration: f64, gap: Option<&Gap>, input: &LastInput, covariance: &Covariance) {
        let out = &mut self.transition;
        out.restart();
        match gap {
            None => self.process.step(x, &input.get(), duration, out),
            Some(gap) => coast(self.process.as_ref(), gap, x, &mut input.clone(), out),
        }
        self.own.write(duration, out);
        out.finish();
        self.own.decay(x);
        out.settle(|axis| covariance.variance(axis));
    }

    /// Residual z ⊟ h(x) and H at `x` into [`work`](Self::work); `input` is the input in force. H is the derivative of h
    /// in all parameters: at a smoothed state no earlier motion is needed.
    ///
    /// # Errors
    /// [`Undefined`] where h has no value.
    pub(crate) fn observe(&mut self, offered: &Offered, x: &[f64], input: &LastInput) -> Result<(), Undefined> {
        let Some(sensor) = self.sensors.get(offered.sensor) else {
            return Err(Undefined("there is no such sensor"));
        };
        let (model, work) = (sensor.model.as_ref(), &mut self.work);
        let Size { value, residual: m } = model.size();
        work.rows = m;
        work.jacobian.reset(m);
        if model.reads_signals() {
            let input = offered.derivative_input.as_ref().unwrap_or(input);
            self.signals.evaluate(self.process.as_ref(), x, &input.get(), true);
        }
        let view = self.signals.view(x).with_given(model.given_in(&offered.value));
        model.predict(&view, &mut work.predicted[..value])?;
        if !offered.input_change.is_empty() {
            model.perturb(&mut work.predicted[..value], &offered.input_change);
        }
        model.jacobian(&view, &mut work.jacobian)?;
        if work.jacobian.needs_signals() {
            work.jacobian.chain(&self.signals.jacobian);
        }
        if let Some((offset, (assumed, input))) = sensor.offset.as_ref().zip(offered.lateness.as_ref()) {
            let lateness = Lateness {
                offset,
                assumed: *assumed,
                input: input.get(),
            };
            lateness.account(model, self.process.as_ref(), &self.layout, x, work);
        }
        model.residual(&offered.value, &work.predicted[..value], &mut work.residual[..m]);
        work.noise[..m * m].copy_from_slice(&offered.noise);
        Ok(())
    }
}

/// Moves `x` through a part of a gap; a process that cannot coast holds its latest sample. `input` has the motion at the
/// beginning of the gap, and becomes the input on this path.
pub(super) fn coast(process: &dyn Process, gap: &Gap, x: &mut [f64], input: &mut LastInput, out: &mut Transition) {
    let (motion, sample) = input.coast(process, x);
    if !process.coast(x, gap, motion, sample, out) {
        let (held, dt) = (Input::held(sample), gap.duration());
        process.linearise(x, &held, dt, out);
        process.propagate(x, &held, dt);
    }
}
