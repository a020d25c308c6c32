//! The belief: a nominal state and the covariance of its error, as a value.

mod past;
mod written;

use alloc::vec::Vec;
pub(crate) use past::Past;
pub use past::own_dynamics;

use crate::covariance::{Covariance, Form};
use crate::memory::{Memory, Tape};
use crate::model::LastInput;
use crate::state::Layout;
use crate::time::Time;
use alloc::sync::Arc;

/// The filter's estimate at one instant. Clone it to save it, assign it to restore it.
#[derive(Clone, Debug, PartialEq)]
pub struct Belief {
    /// The instant it is valid at.
    pub time: Time,
    /// Nominal state, in storage order of the [`Layout`].
    pub x: Vec<f64>,
    /// Covariance of the error true ⊟ nominal in the canonical chart.
    pub covariance: Covariance,
    /// The process input that led to it. The process derives its signals, such as its attitude, from state and input.
    pub input: LastInput,
}

impl Memory for Belief {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.time.remember(tape);
        tape.numbers(&mut self.x);
        self.covariance.remember(tape);
        self.input.remember(tape);
    }
}

impl Belief {
    /// The initial belief a layout declares: initial values and variances, no correlation, no
    /// input; the covariance is stored in `form`.
    #[must_use]
    pub fn initial(layout: &Layout, form: &Arc<dyn Form>, time: Time) -> Self {
        let mut covariance = Covariance::zeros(layout.dim(), form.clone());
        for block in layout.blocks() {
            covariance.set_sigmas(block, &block.sigma);
        }
        Self {
            time,
            x: layout.initial().to_vec(),
            covariance,
            input: LastInput::default(),
        }
    }

    /// Whether no axis of the orientations has a greater 1σ \[rad\].
    pub(crate) fn is_aligned(&self, layout: &Layout, sigma: f64) -> bool {
        let mut variances = layout.orientations().flat_map(|b| self.covariance.variances(b));
        variances.all(|variance| variance <= sigma * sigma)
    }

    /// Whether every number of state and variance is finite and no variance negative.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.x.iter().all(|v| v.is_finite()) && self.covariance.is_sound()
    }
}
