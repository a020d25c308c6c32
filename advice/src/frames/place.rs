//! Positions at a time, and their distances.

use super::log::Track;
use super::motion::LONGEST;
use crate::inspect::median;
use fusion_core::geometry::so3::wrap_angle;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::state::Manifold;
use nalgebra::Vector3;

/// The mean radius of the Earth \[m\].
const RADIUS: f64 = 6.371e6;

/// The great-circle distance \[m\].
pub(super) fn distance(a: &Geodetic, b: &Geodetic) -> f64 {
    let unit = |p: &Geodetic| {
        Vector3::new(
            math::cos(p.lat) * math::cos(p.lon),
            math::cos(p.lat) * math::sin(p.lon),
            math::sin(p.lat),
        )
    };
    2.0 * RADIUS * math::asin(((unit(a) - unit(b)).norm() / 2.0).min(1.0))
}

/// The median distance and height difference of a position from where it should be \[m\], with the number of samples.
pub(super) fn apart(track: &Track, should: impl Fn(f64) -> Option<Geodetic>) -> Option<(f64, f64, usize)> {
    let pairs = track.times.iter().zip(&track.values);
    let away = pairs.filter_map(|(t, v)| Some((Geodetic::read(&v[..3]), should(*t)?)));
    let (distances, heights): (Vec<f64>, Vec<f64>) = away.map(|(a, b)| (distance(&a, &b), (a.height - b.height).abs())).unzip();
    let count = distances.len();
    (count > 0).then(|| (median(distances), median(heights), count))
}

/// The position of a track at a time: interpolated between two samples, or the nearest sample within a second.
pub(super) fn at(track: &Track, time: f64) -> Option<Geodetic> {
    let place = |i: usize| Geodetic::read(&track.values[i][..3]);
    let next = track.times.partition_point(|t| *t < time);
    let (before, after) = (next.checked_sub(1), Some(next).filter(|i| *i < track.times.len()));
    if let (Some(i), Some(next)) = (before, after)
        && track.times[next] - track.times[i] <= LONGEST
    {
        let share = (time - track.times[i]) / (track.times[next] - track.times[i]);
        let (a, b) = (place(i), place(next));
        let of = |a: f64, b: f64| a + share * b;
        return Some(Geodetic::new(
            of(a.lat, b.lat - a.lat),
            of(a.lon, wrap_angle(b.lon - a.lon)),
            of(a.height, b.height - a.height),
        ));
    }
    let near = [before, after].into_iter().flatten();
    let i = near.min_by(|a, b| (track.times[*a] - time).abs().total_cmp(&(track.times[*b] - time).abs()))?;
    ((track.times[i] - time).abs() <= 1.0).then(|| place(i))
}

/// A distance in words.
pub(super) fn shown(metres: f64) -> String {
    if metres >= 1e4 {
        format!("{:.0} km", metres * 1e-3)
    } else {
        format!("{metres:.1} m")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_place_between_two_samples_lies_between_them() {
        let track = Track {
            source: 0,
            channel: "position",
            times: vec![0.0, 1.0, 9.0],
            values: vec![
                [0.8, PI - 1e-6, 100.0, 0.0],
                [0.8 + 2e-6, 1e-6 - PI, 104.0, 0.0],
                [0.8, 3.0, 0.0, 0.0],
            ],
            rate: 1.0,
            integrates: false,
            way: Vec::new(),
        };
        let middle = at(&track, 0.25).unwrap();
        assert!((middle.lat - 0.8 - 0.5e-6).abs() < 1e-12 && (middle.height - 101.0).abs() < 1e-9);
        // The shorter way, across the date line.
        assert!((middle.lon - (PI - 0.5e-6)).abs() < 1e-12, "{}", middle.lon);
        // In a long gap only nearby samples count.
        assert!(at(&track, 5.0).is_none());
        assert!((at(&track, 1.5).unwrap().height - 104.0).abs() < 1e-9);
    }
}
