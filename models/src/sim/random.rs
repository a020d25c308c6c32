//! Randomness: one generator per purpose, seeded by the run's seed and the purpose's name, so
//! that adding one purpose leaves all others as they were.

use crate::seed::fnv1a;
use fusion_core::math;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The generator of one purpose.
#[derive(Clone, Debug)]
pub(super) struct Random(ChaCha8Rng);

impl Random {
    /// The generator of `purpose` in the run of that `seed`.
    pub(super) fn new(seed: u64, purpose: &str) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&fnv1a(purpose.bytes()).to_le_bytes());
        Self(ChaCha8Rng::from_seed(key))
    }

    /// A standard normal number.
    pub(super) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        self.0.random()
    }
}

/// First-order Gauss-Markov processes of one correlation time, discretised exactly:
/// `x⁺ = e^{−Δt/τ} x + w`, variance of w `σ²(1 − e^{−2Δt/τ})`.
#[derive(Clone, Debug)]
pub(super) struct Markov {
    sigma: Vec<f64>,
    tau: f64,
    /// The last interval \[s\], e^{−Δt/τ}, and √(1 − e^{−2Δt/τ}).
    step: (f64, f64, f64),
    /// Whether it is zero and stays so.
    is_still: bool,
    state: Vec<f64>,
    random: Random,
}

impl Markov {
    /// Starts in its stationary distribution.
    pub(super) fn new(sigma: Vec<f64>, tau: f64, mut random: Random) -> Self {
        let state = sigma.iter().map(|s| s * random.normal()).collect();
        Self {
            is_still: sigma.iter().all(|s| *s == 0.0),
            sigma,
            tau,
            step: (0.0, 1.0, 0.0),
            state,
            random,
        }
    }

    /// Moves on by `dt` seconds.
    pub(super) fn advance(&mut self, dt: f64) {
        if self.is_still {
            return;
        }
        if self.step.0 != dt {
            self.step = (dt, math::exp(-dt / self.tau), math::sqrt(-math::exp_m1(-2.0 * dt / self.tau)));
        }
        let (_, decay, fresh) = self.step;
        for (x, sigma) in self.state.iter_mut().zip(&self.sigma) {
            *x = decay * *x + fresh * sigma * self.random.normal();
        }
    }

    pub(super) fn state(&self) -> &[f64] {
        &self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_generator_is_a_function_of_seed_and_purpose() {
        let draw = |seed, purpose| Random::new(seed, purpose).normal();
        assert_eq!(draw(1, "a"), draw(1, "a"));
        assert_ne!(draw(1, "a"), draw(2, "a"));
        assert_ne!(draw(1, "a"), draw(1, "b"));
    }

    #[test]
    fn gauss_markov_of_60_s_has_phi_0_98347_and_q_0_032784_of_its_variance_at_1_hz() {
        let (tau, dt, n) = (60.0, 1.0, 400_000);
        let mut x = Markov::new(vec![2.0], tau, Random::new(3, "markov"));
        let (mut square, mut product, mut fresh, mut previous) = (0.0, 0.0, 0.0, x.state()[0]);
        for _ in 0..n {
            x.advance(dt);
            let now = x.state()[0];
            square += now * now;
            product += now * previous;
            fresh += (now - 0.983_47 * previous).powi(2);
            previous = now;
        }
        // 6 %: independent samples n/2τ = 3333, so √(2/3333) = 2.4 % of 1σ in the variance.
        assert!((square / f64::from(n) / 4.0 - 1.0).abs() < 0.06, "{}", square / f64::from(n));
        // 1.5e-3: √((1 − φ²)/n) = 2.9e-4 of 1σ; φ = 0.98347.
        assert!((product / square - 0.983_47).abs() < 1.5e-3, "{}", product / square);
        // 1 %: √(2/n) = 0.22 % of 1σ.
        let q = fresh / f64::from(n) / 4.0;
        assert!((q / 0.032_784 - 1.0).abs() < 0.01, "{q}");
    }

    #[test]
    fn gauss_markov_split_in_two_has_the_same_variance() {
        let mut sums = [0.0; 2];
        for (sum, parts) in sums.iter_mut().zip([1, 4]) {
            let mut x = Markov::new(vec![1.0], 1.0, Random::new(5, "split"));
            for _ in 0..20_000 {
                (0..parts).for_each(|_| x.advance(4.0 / f64::from(parts)));
                *sum += x.state()[0].powi(2) / 20_000.0;
            }
        }
        // 4 %: √(2/20000) = 1 % of 1σ.
        assert!(sums.iter().all(|s| (s - 1.0).abs() < 0.04), "{sums:?}");
    }
}
