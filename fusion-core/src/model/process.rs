//! The process model: how the state moves and what it tells the sensors.

use crate::covariance::Covariance;
use crate::linear::{Jacobian, Transition};
use crate::state::{Layout, Manifold, Quantity, Signal, Slot, Tangent, View};
use core::fmt::Debug;
use nalgebra::{Matrix3, SMatrix};

/// One sample of the process input, valid over the interval that ends at its stamp.
///
/// The numbers are *mean rates over the interval*, so that an interval may be split at a
/// measurement: the parts see the same rates over shorter times.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The sample, [`Process::input_dim`] numbers.
    pub sample: &'a [f64],
    /// The neighbour that the coning and sculling corrections pair the sample with; the sample
    /// itself where there is none.
    pub neighbour: &'a [f64],
    /// Whole length of the sample's interval \[s\], however short the step within it.
    pub interval: f64,
    /// Whole length of the neighbour's interval \[s\].
    pub neighbour_interval: f64,
    /// Whether the neighbour comes before the sample.
    pub neighbour_is_earlier: bool,
}

impl<'a> Input<'a> {
    /// A sample without a neighbour.
    #[must_use]
    pub const fn alone(sample: &'a [f64]) -> Self {
        Self {
            sample,
            neighbour: sample,
            interval: 0.0,
            neighbour_interval: 0.0,
            neighbour_is_earlier: true,
        }
    }
}

/// A process model: object-safe, immutable, allocation-free.
pub trait Process: Debug + Send + Sync {
    /// Numbers in one input sample; 0 for a process driven by time alone.
    fn input_dim(&self) -> usize;

    /// Whether a sample is paired with the next one (two-sample algorithms) rather than with
    /// the one before.
    fn pairs_samples(&self) -> bool {
        false
    }

    /// The longest step \[s\] one linearisation may cover.
    fn max_step(&self) -> f64 {
        f64::INFINITY
    }

    /// Moves the process's blocks of `x` by `dt` seconds.
    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64);

    /// Writes Φ and the discrete noise of the step that [`Process::propagate`] would take from
    /// `x`: the process's blocks only, in the canonical chart.
    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition);

    /// Writes the signals at `x`, and their Jacobians where `out` wants them.
    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        let _ = (x, input, out);
    }
}

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

/// Signals evaluated at one state: values and, on request, their Jacobian.
#[derive(Clone, Debug)]
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
            if kind == crate::state::Kind::Attitude {
                values[storage] = 1.0;
            }
        }
        Self {
            values,
            jacobian: Jacobian::new(layout, layout.signal_dim()),
        }
    }

    /// Evaluates the signals of `process` at `x`.
    pub fn evaluate(&mut self, process: &dyn Process, x: &[f64], input: &Input<'_>, with_jacobian: bool) {
        if self.values.is_empty() {
            return;
        }
        let rows = self.jacobian.rows();
        let jacobian = if with_jacobian {
            self.jacobian.reset(rows);
            Some(&mut self.jacobian)
        } else {
            None
        };
        process.signals(x, input, &mut SignalsOut::new(&mut self.values, jacobian));
    }

    /// J P Jᵀ of the three signal axes from `tangent`, as evaluated last with Jacobian.
    #[must_use]
    pub fn covariance(&self, tangent: usize, p: &Covariance) -> Matrix3<f64> {
        let n = p.dim();
        let rows: [&[f64]; 3] = core::array::from_fn(|i| self.jacobian.row(tangent + i));
        Matrix3::from_fn(|a, b| {
            let mut sum = 0.0;
            for i in (0..n).filter(|&i| rows[a][i] != 0.0) {
                for j in (0..n).filter(|&j| rows[b][j] != 0.0) {
                    sum += rows[a][i] * p.get(i, j) * rows[b][j];
                }
            }
            sum
        })
    }

    /// The view of `x` with these signals.
    #[must_use]
    pub fn view<'a>(&'a self, x: &'a [f64]) -> View<'a> {
        View::new(x, &self.values)
    }
}
