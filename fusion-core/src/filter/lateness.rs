//! A measurement that is used a little before or after it is valid.
//!
//! Assumed    valid at stamp − τ₀, the time of the belief
//! Valid      at stamp − τ, τ a state or a constant
//! Predicted  h(x̂) ⊟ c (τ̂ − τ₀),  c = dh/dt = H ẋ along the motion
//! Jacobian   ∂h/∂τ = −c
//! Rate       ẋ = (φ(x̂, u, Δt) ⊟ x̂)/Δt by the process's own step φ, for any process
//! Valid      to first order in τ̂ − τ₀, while the motion hardly changes over it
//! Not here   the rate of a signal, such as the angular acceleration; ∂c/∂x, of second order

use super::rule::Innovation;
use crate::model::{Input, Measurement, Process};
use crate::state::{Layout, Quantity, Scalar};

/// The step Δt over which the rate of the state is taken \[s\]. It is short enough to give the rate here, and so long
/// that rounding of positions (1 nm) is 1 µm/s.
const STEP: f64 = 1e-3;

/// The remaining time offset of a measurement.
#[derive(Clone, Copy, Debug)]
pub struct Lateness<'a> {
    /// Stamp minus time of validity \[s\]; a signal in it counts as the assumed value.
    pub offset: &'a Quantity<Scalar>,
    /// The offset by which the measurement would be valid now \[s\].
    pub assumed: f64,
    /// The input near this time, its rates averaged if they would be noise.
    pub input: Input<'a>,
}

impl Lateness<'_> {
    /// Moves the prediction in `work` by the offset, and adds the offset's column to H. All other columns of H are
    /// complete.
    pub(super) fn account(&self, model: &dyn Measurement, process: &dyn Process, layout: &Layout, x: &[f64], work: &mut Innovation) {
        let (moved, rate) = (&mut work.moved, &mut work.rate);
        moved.copy_from_slice(x);
        process.propagate(moved, &self.input, STEP);
        layout.minus(moved, x, rate);
        let beyond = self.offset.stored(x).map_or(0.0, |tau| tau - self.assumed);
        let size = model.size();
        for (row, shift) in work.shift[..size.residual].iter_mut().enumerate() {
            let h = work.jacobian.row(row);
            let c = h.iter().zip(rate.iter()).map(|(h, rate)| h * rate).sum::<f64>() / STEP;
            *shift = -c * beyond;
            if let Quantity::State(slot) = self.offset {
                work.jacobian.add_element(row, slot.tangent, -c);
            }
        }
        model.perturb(&mut work.predicted[..size.value], &work.shift[..size.residual]);
    }
}
