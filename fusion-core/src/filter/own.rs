//! The own dynamics of state blocks: random walks, Gauss-Markov decay and integrals.
//!
//! Integral   x⁺ = x + r Δt; noise S_x Δt + S_r Δt³/3 of x, S_r Δt²/2 of x with r (Brown and Hwang 2012, §9.3, for a clock)

use crate::linear::Transition;
use crate::math;
use crate::state::{Dynamics, Layout};
use alloc::vec::Vec;

/// A tangent coordinate that walks: its axis, and the density of its noise.
#[derive(Clone, Copy, Debug)]
struct Walk {
    axis: usize,
    psd: f64,
}

/// A tangent coordinate that decays.
#[derive(Clone, Copy, Debug)]
struct Markov {
    axis: usize,
    storage: usize,
    variance: f64,
    /// Which correlation time it has.
    time: usize,
    /// exp(−Δt/τ) over the latest length of a step.
    decay: f64,
}

/// A tangent coordinate that integrates another.
#[derive(Clone, Copy, Debug)]
struct Integral {
    axis: usize,
    storage: usize,
    psd: f64,
    /// Axis and place of the rate, and the density of its noise.
    rate_axis: usize,
    rate_storage: usize,
    rate_psd: f64,
}

/// The own dynamics that the blocks of a layout declare.
#[derive(Clone, Debug)]
pub(super) struct OwnDynamics {
    walks: Vec<Walk>,
    markovs: Vec<Markov>,
    integrals: Vec<Integral>,
    /// The different correlation times τ \[s\], each with its exp(−Δt/τ). If steps are not equally long, as in
    /// recorded logs, each exponential is computed once for all axes.
    times: Vec<(f64, f64)>,
    /// The process noise of a step, as entries of its matrix.
    noise: Vec<(u16, u16, f64)>,
    /// The length of a step \[s\] for which decays and noise are computed: most steps are equally long.
    dt: f64,
}

impl OwnDynamics {
    pub(super) fn of(layout: &Layout) -> Self {
        let mut own = Self {
            walks: Vec::new(),
            markovs: Vec::new(),
            integrals: Vec::new(),
            times: Vec::new(),
            noise: Vec::new(),
            dt: 0.0,
        };
        for b in layout.blocks() {
            for (k, axis) in b.tangent_range().enumerate() {
                match &b.dynamics {
                    Dynamics::RandomWalk { psd } if psd[k] > 0.0 => own.walks.push(Walk { axis, psd: psd[k] }),
                    Dynamics::GaussMarkov { sigma, tau } => {
                        let time = own.time(*tau);
                        own.markovs.push(Markov {
                            axis,
                            storage: b.storage + k,
                            variance: sigma[k] * sigma[k],
                            time,
                            decay: 1.0,
                        });
                    }
                    Dynamics::Integral { rate, psd } => own.integrals.extend(layout.block(rate).map(|rate| Integral {
                        axis,
                        storage: b.storage + k,
                        psd: psd[k],
                        rate_axis: rate.tangent + k,
                        rate_storage: rate.storage + k,
                        rate_psd: match &rate.dynamics {
                            Dynamics::RandomWalk { psd } => psd[k],
                            _ => 0.0,
                        },
                    })),
                    _ => {}
                }
            }
        }
        own.noise.reserve(own.walks.len() + own.markovs.len() + 3 * own.integrals.len());
        own
    }

    /// The index of a correlation time in the list.
    fn time(&mut self, tau: f64) -> usize {
        self.times.iter().position(|(t, _)| *t == tau).unwrap_or_else(|| {
            self.times.push((tau, 1.0));
            self.times.len() - 1
        })
    }

    /// Writes Φ and the noise of a step into `out`.
    pub(super) fn write(&mut self, dt: f64, out: &mut Transition) {
        if self.dt.to_bits() != dt.to_bits() {
            self.set_step(dt);
        }
        for markov in &self.markovs {
            out.phi.set_element(markov.axis, markov.axis, markov.decay);
        }
        for integral in &self.integrals {
            out.phi.set_element(integral.axis, integral.rate_axis, dt);
        }
        out.after.entries.extend_from_slice(&self.noise);
    }

    /// Computes everything that depends on the length of a step.
    fn set_step(&mut self, dt: f64) {
        self.dt = dt;
        self.times.iter_mut().for_each(|(tau, decay)| *decay = math::exp(-dt / *tau));
        for markov in &mut self.markovs {
            markov.decay = self.times[markov.time].1;
        }
        let walks = self.walks.iter().map(|walk| (walk.axis, walk.psd * dt));
        let markovs = self.markovs.iter().map(|m| (m.axis, m.variance * (1.0 - m.decay * m.decay)));
        let entry = |(axis, variance)| (axis as u16, axis as u16, variance);
        self.noise.clear();
        self.noise.extend(walks.chain(markovs).map(entry));
        for i in &self.integrals {
            let (own, rate) = (i.axis as u16, i.rate_axis as u16);
            let with_rate = i.rate_psd * dt * dt / 2.0;
            self.noise.push((own, own, i.psd * dt + i.rate_psd * dt * dt * dt / 3.0));
            self.noise.extend([(own, rate, with_rate), (rate, own, with_rate)]);
        }
    }

    /// Gauss-Markov decay and integrals of the state over the step that was written last.
    pub(super) fn decay(&self, x: &mut [f64]) {
        self.integrals.iter().for_each(|i| x[i.storage] += self.dt * x[i.rate_storage]);
        self.markovs.iter().for_each(|markov| x[markov.storage] *= markov.decay);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::tests::declare;
    use crate::state::{LayoutBuilder, Scalar};

    #[test]
    fn a_clock_moves_by_its_drift_with_the_noise_of_both() {
        let mut b = LayoutBuilder::new();
        let drift = declare::<Scalar>(&mut b, "drift", 3.0, &[1.0], Dynamics::RandomWalk { psd: vec![0.5] });
        let rate = "drift".to_owned();
        let offset = declare::<Scalar>(&mut b, "offset", 10.0, &[1.0], Dynamics::Integral { rate, psd: vec![2.0] });
        let layout = b.finish();
        let (mut own, mut transition, mut x) = (OwnDynamics::of(&layout), Transition::new(&layout), layout.initial().to_vec());
        own.write(2.0, &mut transition);
        own.decay(&mut x);
        assert_eq!((drift.read(&x), offset.read(&x)), (3.0, 16.0));
        assert_eq!(transition.phi.get(offset.tangent, drift.tangent), 2.0);
        // S_x Δt + S_r Δt³/3, S_r Δt²/2 and S_r Δt.
        let (o, d) = (offset.tangent, drift.tangent);
        let q = |i, j| {
            transition
                .noise_after()
                .filter(|(a, b, _)| (*a, *b) == (i, j))
                .map(|(.., v)| v)
                .sum::<f64>()
        };
        assert!((q(o, o) - (4.0 + 0.5 * 8.0 / 3.0)).abs() < 1e-15); // rounding
        assert_eq!([q(o, d), q(d, o), q(d, d)], [1.0, 1.0, 1.0]);
    }
}
