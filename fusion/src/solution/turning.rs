//! How the body turns between two estimates.

use fusion_core::belief::Belief;
use fusion_core::geometry::so3;
use fusion_core::model::{Input, Process, SignalBuffer};
use fusion_core::state::{Attitude, Layout, Quantity};
use fusion_core::time::Time;
use fusion_models::vocabulary::state;
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::Arc;

/// Gives the mean angular rate w_nb_b from one estimate to the next, as the process moves the attitude under
/// its input: by measured rates minus their estimated errors, if it has them. A correction by a measurement
/// is not a rotation of the body. So the difference of two estimates is a rotation only if they were smoothed.
#[derive(Debug)]
pub(crate) struct Turning {
    process: Arc<dyn Process>,
    attitude: Option<Quantity<Attitude>>,
    signals: SignalBuffer,
    /// The estimate before.
    previous: Option<Time>,
    x: Vec<f64>,
    /// Where the process takes it.
    moved: Vec<f64>,
}

fusion_core::memory!(Turning { previous, x; process, attitude, signals, moved });

impl Turning {
    /// For the beliefs of `layout` under `process`.
    pub fn new(layout: &Layout, process: Arc<dyn Process>) -> Self {
        Self {
            process,
            attitude: layout.quantity(state::ATTITUDE).ok(),
            signals: SignalBuffer::new(layout),
            previous: None,
            x: Vec::new(),
            moved: Vec::new(),
        }
    }

    /// The filter begins anew: the next belief is its first.
    pub fn begin(&mut self) {
        self.previous = None;
    }

    /// The rate \[rad/s\] since the previous belief, by the input of `belief`; `None` for the first belief, and without
    /// an attitude. If `belief` does not have its input, the rate follows from the two attitudes.
    pub fn rate(&mut self, belief: &Belief) -> Option<Vector3<f64>> {
        let attitude = self.attitude.as_ref()?;
        let dt = self
            .previous
            .map(|previous| belief.time.seconds_since(previous))
            .filter(|dt| *dt > 0.0);
        let is_known = belief.input.fits(self.process.input_dim());
        let input = if is_known { belief.input.get() } else { Input::held(&[]) };
        let rate = dt.map(|dt| {
            self.moved.clone_from(if is_known { &self.x } else { &belief.x });
            if is_known {
                self.process.propagate(&mut self.moved, &input, dt);
            }
            let mut at = |x: &[f64]| -> UnitQuaternion<f64> {
                if let Quantity::Signal(_) = attitude {
                    self.signals.evaluate(self.process.as_ref(), x, &input, false);
                }
                self.signals.view(x).get(attitude)
            };
            let from = at(&self.x);
            so3::log(&(from.inverse() * at(&self.moved))) / dt
        });
        self.previous = Some(belief.time);
        self.x.clone_from(&belief.x);
        rate
    }
}
