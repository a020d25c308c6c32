//! Reading the solution out of beliefs.

use super::{Solution, Solved};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::model::{Input, Process, SignalBuffer};
use fusion_core::state::{Attitude, Belief, Layout, Quantity, Tangent, Velocity};
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
    pub fn read(&mut self, belief: &Belief) -> Solution {
        if self.from_signals {
            // Derived position, velocity and attitude do not depend on the input.
            self.signals
                .evaluate(self.process.as_ref(), &belief.x, &Input::held(&self.input), true);
        }
        let view = self.signals.view(&belief.x);
        let spread = |place: Option<(usize, bool)>| match place {
            Some((tangent, false)) => belief.covariance.marginal_at(tangent),
            Some((tangent, true)) => self.signals.covariance(tangent, &belief.covariance),
            None => Matrix3::zeros(),
        };
        Solution {
            time: belief.time,
            position: self.position.as_ref().map(|q| (view.get(q), spread(q.place()))),
            velocity: self.velocity.as_ref().map(|q| (view.get(q), spread(q.place()))),
            attitude: self.attitude.as_ref().map(|q| (view.get(q), spread(q.place()))),
            with_attitude: [
                between(belief, self.position.as_ref(), self.attitude.as_ref()),
                between(belief, self.velocity.as_ref(), self.attitude.as_ref()),
            ],
        }
    }
}

/// Covariance of the error of `of` (rows) with that of `attitude`; zero where one of them is no state.
fn between<M: Tangent<3>>(belief: &Belief, of: Option<&Quantity<M>>, attitude: Option<&Quantity<Attitude>>) -> Matrix3<f64> {
    match (of, attitude) {
        (Some(Quantity::State(of)), Some(Quantity::State(attitude))) => belief.covariance.between(*of, *attitude),
        _ => Matrix3::zeros(),
    }
}
