//! Reading the solution out of beliefs.

use super::Solution;
use crate::vocabulary::state;
use alloc::sync::Arc;
use fusion_core::belief::Belief;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::model::{Process, SignalBuffer};
use fusion_core::state::{Attitude, Layout, Manifold, Quantity, Tangent, Velocity};
use nalgebra::Matrix3;

/// Reads the solution out of beliefs of one layout.
#[derive(Debug)]
pub struct SolutionReader {
    process: Arc<dyn Process>,
    position: Option<Quantity<Geodetic>>,
    velocity: Option<Quantity<Velocity>>,
    attitude: Option<Quantity<Attitude>>,
    signals: SignalBuffer,
    from_signals: bool,
    /// The one read last; large, so that it is written in its place.
    solution: Solution,
}

impl SolutionReader {
    /// For beliefs of `layout` under `process`.
    #[must_use]
    pub fn new(layout: &Layout, process: Arc<dyn Process>) -> Self {
        let (position, velocity, attitude) = (
            layout.quantity(state::POSITION).ok(),
            layout.quantity(state::VELOCITY).ok(),
            layout.quantity(state::ATTITUDE).ok(),
        );
        let from_signals = matches!(position, Some(Quantity::Signal(_)))
            || matches!(velocity, Some(Quantity::Signal(_)))
            || matches!(attitude, Some(Quantity::Signal(_)));
        Self {
            process,
            position,
            velocity,
            attitude,
            signals: if from_signals {
                SignalBuffer::new(layout)
            } else {
                SignalBuffer::default()
            },
            from_signals,
            solution: Solution::default(),
        }
    }

    /// The solution of `belief`.
    pub fn read(&mut self, belief: &Belief) -> &Solution {
        // Derived quantities need the input, which a belief read from a file does not have.
        let is_derived = belief.input.fits(self.process.input_dim());
        if self.from_signals && is_derived {
            self.signals.evaluate(self.process.as_ref(), &belief.x, &belief.input.get(), true);
        }
        let (signals, solution) = (&self.signals, &mut self.solution);
        solution.time = belief.time;
        let position = known(self.position.as_ref(), is_derived);
        let velocity = known(self.velocity.as_ref(), is_derived);
        let attitude = known(self.attitude.as_ref(), is_derived);
        read(signals, belief, position, &mut solution.position);
        read(signals, belief, velocity, &mut solution.velocity);
        read(signals, belief, attitude, &mut solution.attitude);
        let [of_position, of_velocity] = &mut solution.with_attitude;
        between(signals, belief, position, attitude, of_position);
        between(signals, belief, velocity, attitude, of_velocity);
        &self.solution
    }
}

/// The quantity, unless it is a signal that is not derived.
fn known<M: Manifold>(quantity: Option<&Quantity<M>>, is_derived: bool) -> Option<&Quantity<M>> {
    quantity.filter(|q| is_derived || !matches!(q, Quantity::Signal(_)))
}

/// Value and covariance of a quantity; the covariance of a constant is zero.
fn read<M: Manifold>(signals: &SignalBuffer, belief: &Belief, of: Option<&Quantity<M>>, out: &mut Option<(M::Value, Matrix3<f64>)>) {
    let Some(quantity) = of else {
        *out = None;
        return;
    };
    let value = signals.view(&belief.x).get(quantity);
    let (found, p) = out.get_or_insert_with(|| (value.clone(), Matrix3::zeros()));
    *found = value;
    match quantity.place() {
        Some((tangent, false)) => belief.covariance.copy_to(tangent, tangent, p),
        Some(signal) => *p = signals.covariance(signal, signal, &belief.covariance),
        None => {}
    }
}

/// Covariance of the error of `of` (rows) with the error of `attitude`; zero if one of them is constant.
fn between<M: Tangent<3>>(
    signals: &SignalBuffer,
    belief: &Belief,
    of: Option<&Quantity<M>>,
    attitude: Option<&Quantity<Attitude>>,
    out: &mut Matrix3<f64>,
) {
    match (of.and_then(Quantity::place), attitude.and_then(Quantity::place)) {
        (Some((of, false)), Some((attitude, false))) => belief.covariance.copy_to(of, attitude, out),
        (Some(of), Some(attitude)) => *out = signals.covariance(of, attitude, &belief.covariance),
        _ => {}
    }
}
