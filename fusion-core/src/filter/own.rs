//! What blocks of the state do by themselves: random walks and Gauss-Markov decay.

use crate::linear::{BlockMatrix, Transition};
use crate::state::{Dynamics, Layout};

/// The dynamics of a tangent coordinate.
#[derive(Clone, Copy, Debug)]
enum Own {
    Walk {
        axis: usize,
        psd: f64,
    },
    Markov {
        axis: usize,
        storage: usize,
        variance: f64,
        tau: f64,
        /// exp(−Δt/τ) and the variance that comes in over the latest length of a step.
        decay: f64,
        noise: f64,
    },
}

/// Those that the blocks of a layout declare.
#[derive(Clone, Debug)]
pub(super) struct OwnDynamics {
    all: Vec<Own>,
    /// The length of a step \[s\] that decays are computed for: most steps are equally long.
    dt: f64,
}

impl OwnDynamics {
    pub(super) fn of(layout: &Layout) -> Self {
        let mut all = Vec::new();
        for b in layout.blocks() {
            for (k, axis) in b.tangent_range().enumerate() {
                match &b.dynamics {
                    Dynamics::RandomWalk { psd } if psd[k] > 0.0 => all.push(Own::Walk { axis, psd: psd[k] }),
                    Dynamics::GaussMarkov { sigma, tau } => all.push(Own::Markov {
                        axis,
                        storage: b.storage + k,
                        variance: sigma[k] * sigma[k],
                        tau: *tau,
                        decay: 1.0,
                        noise: 0.0,
                    }),
                    _ => {}
                }
            }
        }
        Self { all, dt: 0.0 }
    }

    /// Writes Φ and the noise of a step into `out`.
    pub(super) fn write(&mut self, dt: f64, out: &mut Transition) {
        if self.dt.to_bits() != dt.to_bits() {
            self.dt = dt;
            self.all.iter_mut().for_each(|own| own.set_step(dt));
        }
        for own in &self.all {
            match *own {
                Own::Walk { axis, psd } => out.after.diagonal(axis, psd * dt),
                Own::Markov { axis, decay, noise, .. } => {
                    out.phi.set_element(axis, axis, decay);
                    out.after.diagonal(axis, noise);
                }
            }
        }
    }

    /// Gauss-Markov decay of the state over a step whose Φ, `phi`, has it already.
    pub(super) fn decay(&self, x: &mut [f64], phi: &BlockMatrix) {
        for own in &self.all {
            if let Own::Markov { axis, storage, .. } = *own {
                x[storage] *= phi.get(axis, axis);
            }
        }
    }
}

impl Own {
    /// Computes what depends on the length of a step.
    fn set_step(&mut self, dt: f64) {
        if let Self::Markov {
            variance,
            tau,
            decay,
            noise,
            ..
        } = self
        {
            *decay = (-dt / *tau).exp();
            *noise = *variance * (1.0 - *decay * *decay);
        }
    }
}
