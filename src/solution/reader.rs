//! Reading the solution out of beliefs.

use super::{Solution, Solved};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::model::{Input, Process, SignalBuffer};
use fusion_core::state::{Attitude, Belief, Layout, Manifold, Quantity, Tangent, Velocity};
use fusion_models::vocabulary::state;
use nalgebra::Matrix3;
use std::sync::Arc;

/// Reads the solution out of beliefs of one layout.
#[derive(Debug)]
pub struct SolutionReader {
    layout: Arc<Layout>,
    process: Arc<dyn Process>,
    position: Option<Quantity<Geodetic>>,
    velocity: Option<Quantity<Velocity>>,
    attitude: Option<Quantity<Attitude>>,
    signals: SignalBuffer,
    input: Vec<f64>,
    from_signals: bool,
    /// The one read last; large, so that it is written in its place.
    solution: Solution,
}

impl SolutionReader {
    /// For beliefs of `layout` under `process`.
    #[must_use]
    pub fn new(layout: &Arc<Layout>, process: Arc<dyn Process>) -> Self {
        let (position, velocity, attitude) = (
            layout.quantity(state::POSITION).ok(),
            layout.quantity(state::VELOCITY).ok(),
            layout.quantity(state::ATTITUDE).ok(),
        );
        let from_signals = matches!(position, Some(Quantity::Signal(_)))
            || matches!(velocity, Some(Quantity::Signal(_)))
            || matches!(attitude, Some(Quantity::Signal(_)));
        let input = vec![0.0; process.input_dim()];
        Self {
            layout: layout.clone(),
            process,
            position,
            velocity,
            attitude,
            signals: SignalBuffer::new(layout),
            input,
            from_signals,
            solution: Solution::default(),
        }
    }

    /// The layout of the beliefs.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The solution of `belief`, read when somebody looks at it.
    pub fn solved<'a>(&'a mut self, belief: &'a Belief) -> Solved<'a> {
        Solved::new(self, belief)
    }

    /// The solution of `belief`.
    pub fn read(&mut self, belief: &Belief) -> &Solution {
        if self.from_signals {
            // Derived position, velocity and attitude do not depend on the input.
            self.signals
                .evaluate(self.process.as_ref(), &belief.x, &Input::held(&self.input), true);
        }
        let (signals, solution) = (&self.signals, &mut self.solution);
        solution.time = belief.time;
        read(signals, belief, self.position.as_ref(), &mut solution.position);
        read(signals, belief, self.velocity.as_ref(), &mut solution.velocity);
        read(signals, belief, self.attitude.as_ref(), &mut solution.attitude);
        let [position, velocity] = &mut solution.with_attitude;
        between(belief, self.position.as_ref(), self.attitude.as_ref(), position);
        between(belief, self.velocity.as_ref(), self.attitude.as_ref(), velocity);
        &self.solution
    }
}

/// Value and covariance of a quantity; of one that is constant, zero.
fn read<M: Manifold>(signals: &SignalBuffer, belief: &Belief, of: Option<&Quantity<M>>, out: &mut Option<(M::Value, Matrix3<f64>)>) {
    let Some(quantity) = of else { return };
    let value = signals.view(&belief.x).get(quantity);
    let (found, p) = out.get_or_insert_with(|| (value.clone(), Matrix3::zeros()));
    *found = value;
    match quantity.place() {
        Some((tangent, false)) => belief.covariance.copy_to(tangent, tangent, p),
        Some((tangent, true)) => *p = signals.covariance(tangent, &belief.covariance),
        None => {}
    }
}

/// Covariance of the error of `of` (rows) with that of `attitude`; zero where one of them is no state.
fn between<M: Tangent<3>>(belief: &Belief, of: Option<&Quantity<M>>, attitude: Option<&Quantity<Attitude>>, out: &mut Matrix3<f64>) {
    let place = (of.and_then(Quantity::place), attitude.and_then(Quantity::place));
    if let (Some((of, false)), Some((attitude, false))) = place {
        belief.covariance.copy_to(of, attitude, out);
    }
}
