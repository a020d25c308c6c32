//! The process model: how the state moves, and the signals that sensors read from it.

use super::literal::Literal;
use crate::Printed;
use crate::covariance::Covariance;
use crate::linear::{Jacobian, Transition};
use crate::memory::Memory;
use crate::printed::role;
use crate::state::{Layout, Manifold, Quantity, Signal, Slot, Tangent, View};
use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt::Debug;
use core::ops::Range;
use nalgebra::{Matrix3, SMatrix};

/// One sample of the process input, valid over the interval that ends at its stamp.
///
/// The numbers are *mean rates over the interval*, so that an interval may be split at a
/// measurement: the parts see the same rates over shorter times.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The sample: [`Process::input_dim`] numbers as the stream has them, then the numbers that the
    /// process's [`Preparation`] has added.
    pub sample: &'a [f64],
    /// Whole length of the sample's interval \[s\], even if the step within it is shorter. It is 0 if the
    /// sample is missing, or held beyond its interval.
    pub interval: f64,
}

impl<'a> Input<'a> {
    /// A sample as the stream has it, held beyond its interval.
    #[must_use]
    pub const fn held(sample: &'a [f64]) -> Self {
        Self { sample, interval: 0.0 }
    }
}

/// The input of the last step, kept with the belief that it led to: a process may derive signals from it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LastInput {
    pub(crate) sample: Vec<f64>,
    pub(crate) interval: f64,
    /// The result of [`Process::motion`] at the beginning of a gap.
    motion: Vec<f64>,
}
crate::memory!(LastInput { sample, interval, motion });

impl LastInput {
    /// Of `dim` zeros: no step was taken.
    #[must_use]
    pub fn zeros(dim: usize) -> Self {
        Self {
            sample: vec![0.0; dim],
            interval: 0.0,
            motion: Vec::new(),
        }
    }

    /// Becomes `input`.
    pub fn take(&mut self, input: &Input<'_>) {
        self.motion.clear();
        self.sample.clear();
        self.sample.extend_from_slice(input.sample);
        self.interval = input.interval;
    }

    /// The input itself.
    #[must_use]
    pub fn get(&self) -> Input<'_> {
        Input {
            sample: &self.sample,
            interval: self.interval,
        }
    }

    /// This input at the beginning of a step through a gap, with the motion that is known at its end.
    pub(crate) fn with_motion_of(&self, later: &Self) -> Self {
        Self {
            motion: later.motion.clone(),
            ..self.clone()
        }
    }

    /// Whether the motion at the beginning of a gap is known.
    pub(crate) const fn is_coasting(&self) -> bool {
        !self.motion.is_empty()
    }

    /// For a step without input: the motion at the beginning of the gap, which `process` evaluates at `x`, and the
    /// sample, which is held from now on and may be changed.
    pub(crate) fn coast(&mut self, process: &dyn Process, x: &[f64]) -> (&[f64], &mut [f64]) {
        let dim = process.input_dim();
        if self.motion.is_empty() && self.fits(dim) {
            let Self { sample, interval, motion } = self;
            process.motion(
                x,
                &Input {
                    sample,
                    interval: *interval,
                },
                motion,
            );
        }
        self.interval = 0.0;
        self.sample.resize(self.sample.len().max(dim), 0.0);
        (&self.motion, &mut self.sample)
    }

    /// Whether a process that reads `dim` numbers can do with it.
    #[must_use]
    pub fn fits(&self, dim: usize) -> bool {
        self.sample.len() >= dim
    }
}

/// A part of a gap in the input: it lasts from `from` to `to` seconds after the input was lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Its beginning \[s\].
    pub from: f64,
    /// Its end \[s\].
    pub to: f64,
}

impl Gap {
    /// How long it lasts \[s\].
    #[must_use]
    pub const fn duration(&self) -> f64 {
        self.to - self.from
    }
}

/// Extends the samples of the input stream by further numbers that the process needs, such as neighbouring
/// samples. Unlike a process it has a memory.
pub trait Preparation: Memory + Printed + Send {
    /// Takes the sample of an interval of `interval` seconds. It is 0 for the first sample of a stream or
    /// after a gap: this sample covers no time, no step uses it, and earlier samples no longer
    /// count. Writes to `out` the samples that are now complete: every interval once, in
    /// order.
    fn take(&mut self, interval: f64, sample: &[f64], out: &mut Prepared);

    /// Writes the samples that it has held back: no sample follows.
    fn finish(&mut self, out: &mut Prepared);
}

role!(Preparation);

/// Samples that a preparation has made.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    data: Vec<f64>,
    ends: Vec<usize>,
}

impl Prepared {
    /// The sample of the next interval in order: `sample` as the stream has it, then `added`.
    pub fn push(&mut self, sample: &[f64], added: &[&[f64]]) {
        self.data.extend_from_slice(sample);
        added.iter().for_each(|part| self.data.extend_from_slice(part));
        self.ends.push(self.data.len());
    }

    /// The samples, in order.
    pub fn samples(&self) -> impl Iterator<Item = &[f64]> {
        let mut start = 0;
        self.ends.iter().map(move |&end| {
            let sample = &self.data[start..end];
            start = end;
            sample
        })
    }

    /// Forgets them.
    pub fn clear(&mut self) {
        self.data.clear();
        self.ends.clear();
    }
}

/// How Φ of a step of Δt is computed. F is the continuous error model at the start of the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The series of exp(FΔt) up to FΔt at least.
    First,
    /// The series of exp(FΔt) up to ½F²Δt² at least.
    Second,
    /// The derivative of [`Process::propagate`] itself, for every step. It includes changes within the
    /// step, such as a change of the attitude; no series with one F includes them.
    Exact,
}

/// A process model: object-safe, immutable, allocation-free.
pub trait Process: Printed + Send + Sync {
    /// Numbers in one sample of the input stream; 0 for a process driven by time alone.
    fn input_dim(&self) -> usize;

    /// The preparation that extends the samples before use. If `None`, they are used unchanged.
    fn preparation(&self) -> Option<Box<dyn Preparation>> {
        None
    }

    /// The longest step \[s\] one linearisation may cover.
    fn max_step(&self) -> f64 {
        f64::INFINITY
    }

    /// How far Φ agrees with the step. The law of processes holds it to this.
    fn order(&self) -> Order {
        Order::First
    }

    /// Which numbers of a sample are rates that may be averaged over several samples; the others, such as
    /// an attitude at the end of the interval, may not.
    fn rates(&self) -> Range<usize> {
        0..self.input_dim()
    }

    /// Moves the process's blocks of `x` by `dt` seconds.
    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64);

    /// Writes Φ and the discrete noise of the step that [`Process::propagate`] would take from
    /// `x`: the process's blocks only, in the canonical chart.
    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition);

    /// Both for one step, with the same bits: first [`Process::linearise`], then [`Process::propagate`]. A process
    /// overrides it if the two have much in common.
    fn step(&self, x: &mut [f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        self.linearise(x, input, dt, out);
        self.propagate(x, input, dt);
    }

    /// How much each number of an input sample may change from one sample to the next without being
    /// suspect, in the units of the sample. A sample beyond this change waits for further samples to confirm it.
    /// Empty if no limit is known, infinite for a number that may change freely.
    fn agility(&self) -> &[f64] {
        &[]
    }

    /// Adds the vehicle's motion at `x` to `motion`, for [`Process::coast`]: the latest sample minus the sample of a
    /// vehicle at constant velocity and attitude. Adds nothing where coasting does not depend on the motion.
    fn motion(&self, x: &[f64], input: &Input<'_>, motion: &mut Vec<f64>) {
        let _ = (x, input, motion);
    }

    /// Moves the process's blocks of `x` through a part of a gap in the input, along the most likely path after the
    /// `motion` at the beginning of the gap. Writes Φ of that step to `out`, and as noise the changes of motion that
    /// the vehicle may have made. Writes to `sample` the input that belongs to this path: the signals are evaluated
    /// with it. Returns false, with nothing changed, if the process cannot move without input.
    fn coast(&self, x: &mut [f64], gap: &Gap, motion: &[f64], sample: &mut [f64], out: &mut Transition) -> bool {
        let _ = (x, gap, motion, sample, out);
        false
    }

    /// Writes the signals at `x`, and their Jacobians where `out` wants them.
    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        let _ = (x, input, out);
    }

    /// The model as a Rust expression, by [`literal!`](crate::literal!); `None` if it cannot write itself.
    fn literal(&self) -> Option<&dyn Literal> {
        None
    }
}

role!(Process);

/// Where a process writes its signals.
#[derive(Debug)]
pub struct SignalsOut<'a> {
    values: &'a mut [f64],
    jacobian: Option<&'a mut Jacobian>,
}

impl<'a> SignalsOut<'a> {
    /// Over signal storage `values`; `jacobian` has been reset to [`Layout::signal_dim`] rows.
    pub fn new(values: &'a mut [f64], jacobian: Option<&'a mut Jacobian>) -> Self {
        Self { values, jacobian }
    }

    /// Sets a signal's value.
    pub fn set<M: Manifold>(&mut self, signal: Signal<M>, value: &M::Value) {
        M::write(value, &mut self.values[signal.storage..]);
    }

    /// Whether Jacobians are wanted; false lets a process skip their cost.
    #[must_use]
    pub const fn wants_jacobian(&self) -> bool {
        self.jacobian.is_some()
    }

    /// Adds ∂`signal`/∂`slot`.
    pub fn add<S, M, const R: usize, const C: usize>(&mut self, signal: Signal<S>, slot: Slot<M>, block: &SMatrix<f64, R, C>)
    where
        S: Tangent<R>,
        M: Tangent<C>,
    {
        if let Some(j) = self.jacobian.as_deref_mut() {
            j.add_slot(signal.tangent, slot, block);
        }
    }

    /// Adds ∂`signal`/∂`quantity`; a no-op where the quantity is fixed.
    pub fn add_quantity<S, M, const R: usize, const C: usize>(
        &mut self,
        signal: Signal<S>,
        quantity: &Quantity<M>,
        block: &SMatrix<f64, R, C>,
    ) where
        S: Tangent<R>,
        M: Tangent<C>,
    {
        if let (Some(j), Quantity::State(slot)) = (self.jacobian.as_deref_mut(), quantity) {
            j.add_slot(signal.tangent, *slot, block);
        }
    }
}

/// Writes the signals of `process` at `x`, and their Jacobian.
fn evaluate(values: &mut [f64], mut jacobian: Option<&mut Jacobian>, process: &dyn Process, x: &[f64], input: &Input<'_>) {
    if values.is_empty() {
        return;
    }
    if let Some(jacobian) = &mut jacobian {
        jacobian.reset(jacobian.rows());
    }
    process.signals(x, input, &mut SignalsOut::new(values, jacobian));
}

/// Signals evaluated at one state: values and, on request, their Jacobian.
#[derive(Clone, Debug, Default)]
pub struct SignalBuffer {
    pub(crate) values: Vec<f64>,
    pub(crate) jacobian: Jacobian,
}

impl SignalBuffer {
    /// Room for the signals of `layout`.
    #[must_use]
    pub fn new(layout: &Layout) -> Self {
        let mut values = vec![0.0; layout.signal_storage()];
        for (_, kind, storage, _) in layout.signals() {
            kind.write_origin(&mut values[storage..storage + kind.storage()]);
        }
        Self {
            values,
            jacobian: Jacobian::of_signals(layout),
        }
    }

    /// The same without room for the Jacobian.
    pub(crate) fn of_values(layout: &Layout) -> Self {
        Self {
            jacobian: Jacobian::default(),
            ..Self::new(layout)
        }
    }

    /// Evaluates the signals of `process` at `x`.
    pub fn evaluate(&mut self, process: &dyn Process, x: &[f64], input: &Input<'_>, with_jacobian: bool) {
        let jacobian = with_jacobian.then_some(&mut self.jacobian);
        evaluate(&mut self.values, jacobian, process, x, input);
    }

    /// The same, with the Jacobian in another place.
    pub(crate) fn evaluate_into(&mut self, jacobian: &mut Jacobian, process: &dyn Process, x: &[f64], input: &Input<'_>) {
        evaluate(&mut self.values, Some(jacobian), process, x, input);
    }

    /// J P Kᵀ, with J and K the derivatives of the three axes of `of` and of `with`. Each is given by its first axis,
    /// and true for a signal, as last evaluated with its Jacobian, or false for the state itself.
    #[must_use]
    pub fn covariance(&self, of: (usize, bool), with: (usize, bool), p: &Covariance) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| {
            let terms = self.terms(of, i).map(|(a, by)| {
                let row = self.terms(with, j).map(|(b, by)| p.element(a, b) * by);
                by * row.sum::<f64>()
            });
            terms.sum()
        })
    }

    /// The axes of the state on which the axis `i` of a quantity depends, each with its derivative.
    fn terms(&self, (tangent, is_signal): (usize, bool), i: usize) -> impl Iterator<Item = (usize, f64)> {
        let row = if is_signal { self.jacobian.row(tangent + i) } else { &[] };
        let columns = if is_signal { self.jacobian.columns() } else { &[] };
        let itself = (!is_signal).then_some((tangent + i, 1.0));
        let others = columns.iter().flat_map(|&(start, end)| (start..end).map(|k| (k, row[k])));
        itself.into_iter().chain(others.filter(|(_, by)| *by != 0.0))
    }

    /// The view of `x` with these signals.
    #[must_use]
    pub fn view<'a>(&'a self, x: &'a [f64]) -> View<'a> {
        View::new(x, &self.values)
    }
}
