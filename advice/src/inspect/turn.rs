//! Finds the unit of gyros without a named unit, from a direction that is fixed in the world. In the unit's axes, the
//! direction of the magnetic field or of gravity turns by the integral of the rates.
//!
//! Steps of the direction u over a short time are regressed on −ω × u Δt: the slope is 1 for rad/s, and π/180 for
//! deg/s.

use super::numbers::{Vec3, norm};
use super::pair::{cross, dot};
use fusion_core::math;

/// Fewer steps, or a smaller correlation, are not enough.
const ENOUGH: usize = 100;
const CLEAR: f64 = 0.5;

/// The ratio of the turn of a direction to the turn by `rate`, both sampled at `hertz`, in steps of `step` seconds.
/// `None` if the correlation is too small.
pub(super) fn slope(direction: &[Vec3], rate: &[Vec3], hertz: f64, step: f64) -> Option<f64> {
    let rows = math::round(step * hertz).max(1.0) as usize;
    let mean = |of: &[Vec3]| [0, 1, 2].map(|i| of.iter().map(|v| v[i]).sum::<f64>() / of.len() as f64);
    let steps: Vec<(Vec3, Vec3)> = direction
        .chunks_exact(rows)
        .zip(rate.chunks_exact(rows))
        .map(|(f, w)| (mean(f), mean(w)))
        .map(|(f, w)| (f.map(|x| x / norm(f)), w))
        .collect();
    let (mut count, mut both, mut told, mut seen) = (0, 0.0, 0.0, 0.0);
    for pair in steps.windows(2) {
        let [(before, w0), (after, w1)] = pair else { continue };
        let middle = [0, 1, 2].map(|i| 0.5 * (before[i] + after[i]));
        let turn = cross([0, 1, 2].map(|i| 0.5 * (w0[i] + w1[i])), middle).map(|x| -x * rows as f64 / hertz);
        let change = [0, 1, 2].map(|i| after[i] - before[i]);
        // A larger step is not a small angle, or is an acceleration.
        if norm(change) < 0.5 && norm(turn).is_finite() {
            count += 1;
            both += dot(turn, change);
            told += dot(turn, turn);
            seen += dot(change, change);
        }
    }
    (count >= ENOUGH && both > CLEAR * math::sqrt(told * seen)).then(|| both / told)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two minutes of tilting about x and y at 100 Hz, up to 3 rad/s, and gyro readings with `per` units a radian.
    fn tilting(per: f64, sign: f64) -> (Vec<Vec3>, Vec<Vec3>) {
        let roll = |t: f64| 1.5 * (2.0 * t).sin();
        let of = |k: i32| {
            let t = 0.01 * f64::from(k);
            let force = [0.2 * (7.0 * t).sin(), -9.81 * roll(t).sin(), -9.81 * roll(t).cos()];
            (force, [sign * per * 3.0 * (2.0 * t).cos(), 0.0, 0.0])
        };
        (0..12_000).map(of).unzip()
    }

    #[test]
    fn gravity_tells_degrees_from_radians() {
        for per in [1.0, 1_f64.to_degrees()] {
            let (force, rate) = tilting(per, 1.0);
            let slope = slope(&force, &rate, 100.0, 0.1).unwrap();
            // Means over a tenth of a second of turns of 3 rad/s: sin(x)/x of 0.15, 0.4 %; the shaking adds to it.
            assert!((slope * per - 1.0).abs() < 0.05, "{slope}");
        }
    }

    #[test]
    fn rates_that_have_nothing_to_do_with_the_force_say_nothing() {
        let (force, rate) = tilting(1.0, -1.0);
        assert_eq!(slope(&force, &rate, 100.0, 0.1), None);
        let still = vec![[0.0, 0.0, -9.81]; 12_000];
        assert_eq!(slope(&still, &rate, 100.0, 0.1), None);
    }
}
