//! The current sample, as the samples before it predict it: without its own noise.
//!
//! Expected   x̂_{k+1} = x̂_k + α (x_k − x̂_k) for each rate x. The α with the least mean of (x_k − x̂_k)² so far is used
//! Limits     without noise α = 1, the sample before; noise that hides the motion is averaged over up to 2/α samples
//! Valid      white noise. A part remains of noise that is correlated over several samples
//! Source     Muth 1960, Optimal properties of exponentially weighted forecasts, J. Am. Stat. Assoc. 55(290): the
//!            forecast is optimal for a random walk under white noise. The choice of α by its errors: Brown 1963,
//!            Smoothing, forecasting and prediction of discrete time series

use crate::model::Input;
use crate::time::Time;
use alloc::vec::Vec;
use core::ops::Range;

/// The values of α. If the best α is between two of them, the mean square is above the least: by 4 % at ⅛, by 14 %
/// at ½ (random walk under white noise).
const WEIGHTS: [f64; 4] = [1.0, 0.25, 0.0625, 0.015625];
/// Samples over which errors are averaged: twice the 2/α of the smallest α.
const MEMORY: f64 = 256.0;

/// One rate of the input: the next sample that each α expects, and the mean square of its errors.
#[derive(Clone, Copy, Debug, Default)]
struct Rate {
    expected: [f64; WEIGHTS.len()],
    square: [f64; WEIGHTS.len()],
}
crate::memory!(Rate { expected, square });

impl Rate {
    const fn starting(x: f64) -> Self {
        Self {
            expected: [x; WEIGHTS.len()],
            square: [0.0; WEIGHTS.len()],
        }
    }

    /// The expected next sample.
    fn best(&self) -> f64 {
        let mut best = 0;
        for k in 1..WEIGHTS.len() {
            if self.square[k] < self.square[best] {
                best = k;
            }
        }
        self.expected[best]
    }

    /// Takes the sample `x`; `forget` is its share in the means.
    fn take(&mut self, x: f64, forget: f64) {
        for ((expected, square), weight) in self.expected.iter_mut().zip(&mut self.square).zip(WEIGHTS) {
            let error = x - *expected;
            *square += (error * error - *square) * forget;
            *expected += weight * error;
        }
    }
}

/// The rates of the input as they are expected.
#[derive(Clone, Debug, Default)]
pub(super) struct Expectation {
    rates: Vec<Rate>,
    /// The number of samples taken, up to the averaging length.
    count: f64,
    /// The end of the latest sample.
    end: Time,
    /// The current sample, with the expected values of its rates.
    sample: Vec<f64>,
    interval: f64,
}

crate::memory!(Expectation {
    rates,
    count,
    end,
    sample,
    interval
});

impl Expectation {
    /// Takes the new current sample, and keeps the expected values of its `rates`.
    pub(super) fn take(&mut self, end: Time, input: &Input<'_>, rates: &Range<usize>) {
        if self.count > 0.0 && end <= self.end {
            return;
        }
        self.end = end;
        self.sample.clear();
        self.sample.extend_from_slice(input.sample);
        self.interval = input.interval;
        let measured = &input.sample[rates.clone()];
        if self.rates.len() != measured.len() {
            self.rates.clear();
            self.rates.extend(measured.iter().map(|&x| Rate::starting(x)));
            self.count = 1.0;
            return;
        }
        self.count = (self.count + 1.0).min(MEMORY);
        let forget = 1.0 / self.count;
        for ((rate, &x), expected) in self.rates.iter_mut().zip(measured).zip(&mut self.sample[rates.clone()]) {
            *expected = rate.best();
            rate.take(x, forget);
        }
    }

    /// Forgets the past: samples before a gap predict nothing after it.
    pub(super) fn forget(&mut self) {
        self.rates.clear();
        self.count = 0.0;
    }

    /// The expected sample after the current one; `None` before the second sample. It overwrites the expectation of
    /// the current sample, so it is for the beginning of a gap.
    pub(super) fn next(&mut self, rates: &Range<usize>) -> Option<Input<'_>> {
        if self.count <= 1.0 {
            return None;
        }
        for (expected, rate) in self.sample[rates.clone()].iter_mut().zip(&self.rates) {
            *expected = rate.best();
        }
        Some(Input::held(&self.sample))
    }

    /// The current sample as it was expected; `None` before the second sample.
    pub(super) fn input(&self) -> Option<Input<'_>> {
        (self.count > 1.0).then_some(Input {
            sample: &self.sample,
            interval: self.interval,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Lcg;

    /// Takes `samples`, 10 ms each. Returns every sample after the first `from` with its expected value.
    fn expected(samples: impl Iterator<Item = f64>, from: usize) -> Vec<(f64, f64)> {
        let mut expectation = Expectation::default();
        let mut pairs = Vec::new();
        for (k, x) in samples.enumerate() {
            let end = Time::from_nanos(k as i64 * 10_000_000);
            let input = Input {
                sample: &[x],
                interval: 0.01,
            };
            expectation.take(end, &input, &(0..1));
            // The parts of a sample that is split are one sample.
            expectation.take(end, &input, &(0..1));
            if k >= from {
                pairs.push((x, expectation.input().unwrap().sample[0]));
            }
        }
        pairs
    }

    fn mean_square(values: impl Iterator<Item = f64>) -> f64 {
        let values: Vec<f64> = values.collect();
        values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64
    }

    #[test]
    fn noise_is_averaged_and_what_is_expected_has_none_of_that_of_its_own_sample() {
        let mut random = Lcg::new(3);
        let pairs = expected((0..20_000).map(|_| 1.0 + 0.1 * random.normal()), 1000);
        let error = mean_square(pairs.iter().map(|(_, e)| e - 1.0)).sqrt();
        // √(α/(2 − α)) of the noise is 0.0089 with the smallest α; at times the next larger α is used.
        assert!(error < 0.013, "{error}");
        let correlation = pairs.iter().map(|(x, e)| (x - 1.0) * (e - 1.0)).sum::<f64>() / pairs.len() as f64;
        // 4σ of a mean of 19000 products of independent numbers.
        assert!(correlation.abs() < 4.0 * 0.1 * error / 19_000_f64.sqrt(), "{correlation}");
    }

    #[test]
    fn a_motion_without_noise_is_expected_to_be_as_in_the_sample_before() {
        let motion = |k: usize| (0.05 * k as f64).sin();
        for (k, (_, expected)) in expected((0..500).map(motion), 100).into_iter().enumerate() {
            // α is 1. 4 ε: the change and the sum are rounded.
            assert!((expected - motion(k + 99)).abs() < 1e-15);
        }
    }

    #[test]
    fn a_motion_in_noise_is_expected_nearly_as_well_as_the_best_of_fixed_weights_does() {
        let mut random = Lcg::new(11);
        let samples: Vec<f64> = (0..20_000).map(|k| (0.02 * f64::from(k)).sin() + 0.1 * random.normal()).collect();
        let own = mean_square(expected(samples.iter().copied(), 1000).iter().map(|(x, e)| x - e));
        let fixed = |weight: f64| {
            let mut level = samples[0];
            let errors = samples.iter().map(move |x| {
                let error = x - level;
                level += weight * error;
                error
            });
            mean_square(errors.skip(1000))
        };
        let best = (1..20).map(|k| fixed(0.05 * f64::from(k))).fold(f64::INFINITY, f64::min);
        // 4 % between two weights, and another 4 % for a choice by 256 samples.
        assert!(own < 1.1 * best, "{own} {best}");
    }

    #[test]
    fn nothing_is_expected_after_a_gap() {
        let mut expectation = Expectation::default();
        let input = Input {
            sample: &[1.0],
            interval: 0.01,
        };
        (0..3).for_each(|k| expectation.take(Time::from_nanos(k), &input, &(0..1)));
        assert!(expectation.input().is_some());
        expectation.forget();
        assert!(expectation.input().is_none());
        expectation.take(Time::from_nanos(9), &input, &(0..1));
        assert!(expectation.input().is_none());
    }
}
