//! A speed through the water: its difference from the speed over ground gives the current.
//!
//! For the velocity v over ground, a current c and a log that reads s = |v − c| / κ: |v|² = 2 v·c − |c|² + κ² s², which
//! is linear in c, |c|² and κ². For wheels c is zero. Noise and waves add their mean square to |c|², which is estimated
//! as a free parameter.
//!
//! Not here: leeway, and a current that changes

use super::log::Log;
use super::numbers::median;
use super::signal::{Kind, factor};
use super::track::{Odometer, Track};
use fusion_core::math;
use nalgebra::{DMatrix, DVector};

/// The speed is through the water if the current explains at least this share of the part that a scale alone does not
/// explain.
const EXPLAINED: f64 = 0.75;
/// A weaker current does not count [m/s].
const CURRENT: f64 = 0.1;
/// Rows are averaged over this time, which removes the waves [s]; fewer means in motion are not enough.
const MEAN: f64 = 10.0;
const ENOUGH: usize = 15;

/// The medium against which a speed is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Water {
    /// The ground: no current explains the part that a scale does not explain.
    Ground,
    /// Water that flows north and east with this velocity \[m/s\].
    Through([f64; 2]),
}

impl Water {
    /// From a speed and a track; `None` if the path has only one direction, or is too short.
    pub(super) fn of(speed: &Odometer, track: &Track) -> Option<Self> {
        let (current, is_turning) = current(speed, track)?;
        is_turning.then(|| current.map_or(Self::Ground, Self::Through))
    }
}

/// The current, north and east \[m/s\], if there is one, and whether the path has several directions.
fn current(speed: &Odometer, track: &Track) -> Option<(Option<[f64; 2]>, bool)> {
    /// The sum of velocities in one direction is as long as the sum of their lengths.
    const TURNING: f64 = 0.7;
    let slowest = track.slowest();
    // For each row the velocity, its squared length, and the squared speed.
    let rows = track.t.iter().zip(&track.velocity).filter_map(|(t, v)| {
        let s = speed.at(*t)?;
        let row = [v[0], v[1], v[0] * v[0] + v[1] * v[1], s * s];
        (track.is_reported && row.iter().all(|x| x.is_finite())).then_some((math::floor(t / MEAN), row))
    });
    let rows: Vec<(f64, [f64; 4])> = rows.collect();
    let means = rows.chunk_by(|a, b| a.0 == b.0).map(|bin| {
        let mean = |i: usize| bin.iter().map(|(_, row)| row[i]).sum::<f64>() / bin.len() as f64;
        [0, 1, 2, 3].map(mean)
    });
    let means: Vec<[f64; 4]> = means.filter(|mean| math::hypot(mean[0], mean[1]) > slowest).collect();
    if means.len() < ENOUGH {
        return None;
    }
    let seen = DVector::from_iterator(means.len(), means.iter().map(|mean| mean[2]));
    let of_water = DMatrix::from_fn(means.len(), 4, |k, i| match i {
        0 | 1 => 2.0 * means[k][i],
        2 => -1.0,
        _ => means[k][3],
    });
    let of_ground = of_water.columns(2, 2).into_owned();
    let left = |h: &DMatrix<f64>| {
        let x = h.clone().svd(true, true).solve(&seen, 1e-9).ok()?;
        Some(((&seen - h * &x).norm_squared(), x))
    };
    let ((ground, _), (water, x)) = (left(&of_ground)?, left(&of_water)?);
    let c = [x[0], x[1]];
    let is_clear = water < (1.0 - EXPLAINED) * ground && math::hypot(c[0], c[1]) > CURRENT;
    let sum = means.iter().fold((0.0, 0.0, 0.0), |sum, v| {
        (sum.0 + v[0], sum.1 + v[1], sum.2 + math::hypot(v[0], v[1]))
    });
    Some((is_clear.then_some(c), math::hypot(sum.0, sum.1) < TURNING * sum.2))
}

/// Finds the unit of a speed without a named unit from the speed over ground, reported or between the positions. A
/// current averages out over turns, and no scale of a log or of wheels has such a large error.
pub(super) fn settle_speed(log: &mut Log, track: &Track) {
    let Some((unit, ratio)) = Odometer::of(log, Kind::Speed).and_then(|speed| speed.unit(track)) else {
        return;
    };
    if let Some(signal) = log.signals.iter_mut().find(|s| s.kind == Kind::Speed) {
        signal.take_unit(unit, &format!("{ratio:.2} times the speed over ground in m/s"));
    }
}

impl Odometer {
    /// The unit of speeds that were assumed to be m/s, and their ratio to the track; `None` if they are not correlated.
    pub(super) fn unit(&self, track: &Track) -> Option<(&'static str, f64)> {
        /// A ratio within this factor of a unit means an instrument with this unit; feet are near to km/h and need a
        /// closer ratio.
        const NEAR: [(&str, f64); 4] = [("ft/s", 1.03), ("m/s", 1.15), ("kn", 1.15), ("km/h", 1.15)];
        let ratios: Vec<f64> = track.moving().filter_map(|(t, _, ground)| Some(self.at(t)? / ground)).collect();
        let ratio = median(ratios.iter().copied());
        let is_near = |(unit, near): &&(&str, f64)| math::ln(ratio * factor(unit)).abs() < math::ln(*near);
        let (unit, _) = NEAR.iter().find(is_near).filter(|_| ratios.len() >= ENOUGH)?;
        Some((unit, ratio))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten minutes in circles at 2 m/s through water that flows with `c`, and a log that reads 3 % too little.
    fn circling(c: [f64; 2]) -> (Odometer, Track) {
        let t: Vec<f64> = (0..600).map(f64::from).collect();
        let noise = |k: f64| 0.05 * (12.9898 * k).sin();
        let track = Track {
            velocity: t
                .iter()
                .map(|t| {
                    [
                        2.0 * (0.03 * t).cos() + c[0] + noise(*t),
                        2.0 * (0.03 * t).sin() + c[1] - noise(*t),
                        0.0,
                    ]
                })
                .collect(),
            is_reported: true,
            t: t.clone(),
            ..Track::default()
        };
        let speed = t.iter().map(|t| 2.0 / 1.03 + noise(t + 0.3)).collect();
        (Odometer::new(t, speed), track)
    }

    #[test]
    fn a_current_is_found_and_wheels_have_none() {
        let (speed, track) = circling([0.4, -0.3]);
        let Some(Water::Through(c)) = Water::of(&speed, &track) else {
            panic!("no current")
        };
        // 5 cm/s of noise in 600 rows.
        assert!((c[0] - 0.4).abs() < 0.02 && (c[1] + 0.3).abs() < 0.02, "{c:?}");
        let (speed, track) = circling([0.0, 0.0]);
        assert_eq!(Water::of(&speed, &track), Some(Water::Ground));
        // One straight path with a constant current looks like another scale.
        let straight = Track {
            velocity: track.t.iter().map(|t| [2.0 + 0.05 * (12.9898 * t).sin(), 0.0, 0.0]).collect(),
            ..track
        };
        assert_eq!(Water::of(&speed, &straight), None);
    }
}
