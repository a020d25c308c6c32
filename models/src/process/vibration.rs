//! Accelerometer noise that follows the vibration of the vehicle.
//!
//! Density    N_a² ← max(N_a², var f · Δt) per axis, var f the variance of the specific force about its mean over
//!            the last seconds, Δt the interval of the sample. If the force scatters from sample to sample,
//!            it averages out like noise of this density; if it swings, this density is an upper bound
//! Sample     the three densities [(m/s²)²/Hz] after the numbers of other preparations
//! Valid      for vehicles whose own accelerations change slowly in the window

use super::inertial::IMU;
use alloc::boxed::Box;
use alloc::collections::VecDeque;
use fusion_core::memory::{Memory, Tape};
use fusion_core::model::{Input, Preparation, Prepared};
use nalgebra::Vector3;

/// The number of values that it adds to a sample.
const ADDED: usize = 3;
/// The index of the specific force in an inertial sample.
const FORCE: usize = 3;

/// The densities that the preparation has added to a sample; `None` if the sample is held beyond its interval.
pub(super) fn density(input: &Input<'_>) -> Option<Vector3<f64>> {
    let (_, added) = input.sample.get(IMU..)?.split_last_chunk::<ADDED>()?;
    Some(Vector3::from(*added))
}

/// Watches the specific force over a window.
#[derive(Debug)]
pub(super) struct Vibration {
    /// The preparation that also extends the samples.
    inner: Option<Box<dyn Preparation>>,
    prepared: Prepared,
    /// Length of the window \[s\].
    window: f64,
    /// The samples in it, with their intervals.
    seen: VecDeque<(f64, Vector3<f64>)>,
    length: f64,
}

impl Memory for Vibration {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        if let Some(inner) = &mut self.inner {
            inner.remember(tape);
        }
        self.seen.remember(tape);
        self.length.remember(tape);
    }
}

impl Vibration {
    pub(super) fn new(window: f64, inner: Option<Box<dyn Preparation>>) -> Self {
        Self {
            inner,
            prepared: Prepared::default(),
            window,
            seen: VecDeque::new(),
            length: 0.0,
        }
    }

    fn see(&mut self, interval: f64, sample: &[f64]) {
        if interval == 0.0 {
            self.seen.clear();
            self.length = 0.0;
        }
        self.seen
            .push_back((interval, Vector3::from_column_slice(&sample[FORCE..FORCE + 3])));
        self.length += interval;
        while self.length > self.window && self.seen.len() > 2 {
            self.length -= self.seen.pop_front().map_or(0.0, |(interval, _)| interval);
        }
    }

    /// Variance over the window times the mean interval.
    fn density(&self) -> Vector3<f64> {
        let n = self.seen.len() as f64;
        let mean = self.seen.iter().map(|(_, f)| f).sum::<Vector3<f64>>() / n;
        let squares = self.seen.iter().map(|(_, f)| (f - mean).map(|d| d * d)).sum::<Vector3<f64>>();
        squares / (n - 1.0).max(1.0) * (self.length / n)
    }

    /// Passes on the output of the inner preparation, followed by the densities.
    fn pass_on(&mut self, out: &mut Prepared) {
        let density = self.density();
        for sample in self.prepared.samples() {
            out.push(sample, &[density.as_slice()]);
        }
        self.prepared.clear();
    }
}

impl Preparation for Vibration {
    fn take(&mut self, interval: f64, sample: &[f64], out: &mut Prepared) {
        self.see(interval, sample);
        match &mut self.inner {
            Some(inner) => inner.take(interval, sample, &mut self.prepared),
            None if interval > 0.0 => self.prepared.push(sample, &[]),
            None => {}
        }
        self.pass_on(out);
    }

    fn finish(&mut self, out: &mut Prepared) {
        if let Some(inner) = &mut self.inner {
            inner.finish(&mut self.prepared);
        }
        self.pass_on(out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::strapdown::pairing::{Mode, Pairing, neighbour};

    /// The densities of the last of `seconds` of 100 Hz samples, and whether it has a neighbour.
    fn after(seconds: f64, inner: Option<Box<dyn Preparation>>, force: impl Fn(f64) -> f64) -> (Vector3<f64>, bool) {
        let (mut vibration, mut out) = (Vibration::new(1.0, inner), Prepared::default());
        let mut last = None;
        for k in 0..(seconds * 100.0) as u32 {
            let t = f64::from(k) * 0.01;
            out.clear();
            let sample = [0.0, 0.0, 0.0, force(t), 0.1, -9.8];
            vibration.take(if k == 0 { 0.0 } else { 0.01 }, &sample, &mut out);
            last = out.samples().last().map(<[f64]>::to_vec).or(last);
        }
        let sample = last.unwrap();
        let input = Input {
            sample: &sample,
            interval: 0.01,
        };
        (density(&input).unwrap(), neighbour(&input, IMU).is_some())
    }

    #[test]
    fn a_swing_of_known_amplitude_has_half_its_square_as_variance_and_rest_has_none() {
        let swing = |t: f64| 0.35 * (core::f64::consts::TAU * 10.0 * t).sin();
        let (found, has_neighbour) = after(3.0, Some(Box::new(Pairing::new(Mode::Previous))), swing);
        // A²/2 Δt; n/(n − 1) of 100 samples is 1 %, and a sample more than whole periods another one.
        assert!((found.x / (0.35 * 0.35 / 2.0 * 0.01) - 1.0).abs() < 0.025, "{found}");
        // Rounding of a mean of 9.8.
        assert!(found.y < 1e-20 && found.z < 1e-20 && has_neighbour, "{found}");
        // One second after the swing has ended it has no effect; without other preparations there is no neighbour.
        let (found, has_neighbour) = after(3.2, None, |t| if t < 2.0 { swing(t) } else { 0.0 });
        assert!(found.x == 0.0 && !has_neighbour, "{found}");
    }
}
