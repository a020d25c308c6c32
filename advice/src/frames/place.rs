//! Finds positions that disagree with all other data in place or motion, and the likely mistakes in their declaration.

use super::log::Track;
use super::mistake::Remedy;
use super::motion::LONGEST;
use fusion::config::Node;
use fusion_core::geometry::so3::wrap_angle;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::state::Manifold;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// The mean radius of the Earth \[m\].
const RADIUS: f64 = 6.371e6;

/// A mistake in the declaration of latitude, longitude and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Change {
    /// One coordinate has the other sign.
    Sign(usize),
    /// Latitude and longitude are exchanged.
    Exchanged,
    /// Angles in degrees are read as radians, or the reverse.
    Factor(f64),
}

const KEYS: [&str; 3] = ["latitude", "longitude", "height"];

impl Change {
    pub(super) const ALL: [Self; 6] = [
        Self::Sign(0),
        Self::Sign(1),
        Self::Sign(2),
        Self::Exchanged,
        Self::Factor(180.0 / PI),
        Self::Factor(PI / 180.0),
    ];

    /// Corrects a position.
    fn apply(self, [lat, lon, height, rest]: [f64; 4]) -> [f64; 4] {
        match self {
            Self::Sign(0) => [-lat, lon, height, rest],
            Self::Sign(1) => [lat, -lon, height, rest],
            Self::Sign(_) => [lat, lon, -height, rest],
            Self::Exchanged => [lon, lat, height, rest],
            Self::Factor(k) => [k * lat, k * lon, height, rest],
        }
    }

    /// Corrects all positions; `None` if a result is not a valid position.
    pub(super) fn of(self, track: &Track) -> Option<Track> {
        let values: Vec<_> = track.values.iter().map(|v| self.apply(*v)).collect();
        let is_place = |v: &[f64; 4]| v[0].abs() <= PI / 2.0 && v[1].abs() <= 2.0 * PI;
        values.iter().all(is_place).then(|| Track { values, ..track.clone() })
    }

    pub(super) fn words(self) -> String {
        match self {
            Self::Sign(i) => format!("the {} has the wrong sign", KEYS[i]),
            Self::Exchanged => "latitude and longitude are exchanged".to_owned(),
            Self::Factor(k) => format!("the columns are {}", Self::unit(k)),
        }
    }

    /// The same, as a condition.
    pub(super) fn condition(self) -> String {
        match self {
            Self::Sign(i) => format!("if the {} had the other sign", KEYS[i]),
            Self::Exchanged => "if latitude and longitude were exchanged".to_owned(),
            Self::Factor(k) => format!("if the columns were {}", Self::unit(k)),
        }
    }

    fn unit(factor: f64) -> &'static str {
        if factor > 1.0 {
            "radians, not degrees"
        } else {
            "degrees, not radians"
        }
    }

    /// The correction; `None` if the position is not declared by latitude and longitude.
    pub(super) fn remedy(self, channel: Option<&Node>) -> Option<Remedy> {
        let column = |i: usize| channel?.get(KEYS[i])?.as_str();
        let latitude = column(0)?;
        Some(Remedy::write(&match self {
            Self::Sign(i) => {
                let name = column(i)?;
                let other = name.strip_prefix('-').map_or_else(|| format!("-{name}"), str::to_owned);
                vec![(KEYS[i], format!("{other:?}"))]
            }
            Self::Exchanged => vec![("latitude", format!("{:?}", column(1)?)), ("longitude", format!("{latitude:?}"))],
            Self::Factor(k) => vec![("unit", format!("{:?}", if k > 1.0 { "rad" } else { "deg" }))],
        }))
    }
}

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
    let (mut distances, mut heights): (Vec<f64>, Vec<f64>) = away.map(|(a, b)| (distance(&a, &b), (a.height - b.height).abs())).unzip();
    distances.sort_by(f64::total_cmp);
    heights.sort_by(f64::total_cmp);
    let middle = distances.len() / 2;
    Some((*distances.get(middle)?, heights[middle], distances.len()))
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
