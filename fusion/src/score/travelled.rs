//! The position error relative to the distance travelled, as makers of underwater navigation systems state it.
//!
//! With p the position of the reference and e the horizontal error, both minus their values at the first epoch, and s
//! the distance travelled since then:
//!
//! from the origin     max |e| / s_end
//! reciprocal lines    max |e − A p| / s_end, A by least squares, or 0 if this gives a smaller error
//!
//! A = \[a −b; b a\] is a constant error of scale and heading. On two lines there and back, the second line cancels its
//! effect on the first. The rest of e adds up on any path.

use super::bounded::{Quantiles, Thinned};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use schemars::JsonSchema;
use serde::Serialize;

/// The distance is measured in chords of this length \[m\]: noise of the reference does not count as distance.
const CHORD: f64 = 5.0;
/// There is no result for a shorter distance \[m\]: the error of the reference itself would be a part of it.
const SHORTEST: f64 = 50.0;

/// The largest change of the horizontal position error, in % of the distance travelled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Travelled {
    /// The distance travelled by the reference since the first scored epoch, in chords of 5 m \[m\].
    pub distance: f64,
    /// From the origin: the whole change \[%\].
    pub from_origin_percent: f64,
    /// For reciprocal lines: without the part that scale and heading explain, which lines there and back cancel \[%\].
    pub reciprocal_percent: f64,
}

/// Follows the path.
#[derive(Clone, Debug, Default)]
pub(super) struct Way {
    origin: Option<(Geodetic, [f64; 2])>,
    distance: f64,
    /// The end of the last chord, relative to the origin \[m\].
    end: [f64; 2],
    /// Σ p·p, Σ p·e and Σ p×e over the ends of all chords.
    squares: f64,
    along: f64,
    across: f64,
    /// The largest |e|.
    largest: f64,
    /// At the end of each chord, the position p and the error e, both relative to the origin \[m\]. Above 2^16 chords
    /// every second, fourth, … is kept.
    points: Thinned<[[f64; 2]; 2]>,
}

fusion_core::memory!(Way {
    origin,
    distance,
    end,
    squares,
    along,
    across,
    largest,
    points
});

/// The horizontal errors of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Horizontal {
    /// The length of each \[m\].
    pub(super) lengths: Quantiles,
    /// The sum of their squares, and the largest.
    pub(super) squares: f64,
    largest: Option<f64>,
    way: Way,
}

fusion_core::memory!(Horizontal {
    lengths,
    squares,
    largest,
    way
});

impl Horizontal {
    /// Takes the next error, north and east \[m\], and the position of the reference.
    pub(super) fn add(&mut self, error: [f64; 2], place: Option<&Geodetic>) {
        let length = math::hypot(error[0], error[1]);
        self.lengths.add(length);
        self.squares += length * length;
        // NaN counts as larger than all numbers.
        let is_larger = self.largest.is_none_or(|largest| length.total_cmp(&largest).is_gt());
        self.largest = if is_larger { Some(length) } else { self.largest };
        if let Some(place) = place {
            self.way.add(place, error);
        }
    }

    /// The largest error; NaN without errors.
    pub(super) fn largest(&self) -> f64 {
        self.largest.unwrap_or(f64::NAN)
    }

    /// The error relative to the distance travelled.
    pub(super) fn travelled(&self) -> Option<Travelled> {
        self.way.finish()
    }
}

impl Way {
    /// Takes the next epoch: the position of the reference, and the error north and east there \[m\].
    pub(super) fn add(&mut self, place: &Geodetic, error: [f64; 2]) {
        let Some((origin, first)) = &self.origin else {
            self.origin = Some((*place, error));
            return;
        };
        let moved = place.difference(origin);
        let chord = math::hypot(moved.x - self.end[0], moved.y - self.end[1]);
        if chord >= CHORD {
            self.distance += chord;
            let (p, e) = ([moved.x, moved.y], [error[0] - first[0], error[1] - first[1]]);
            self.squares += p[0] * p[0] + p[1] * p[1];
            self.along += p[0] * e[0] + p[1] * e[1];
            self.across += p[0] * e[1] - p[1] * e[0];
            self.largest = self.largest.max(math::hypot(e[0], e[1]));
            self.end = p;
            self.points.push([p, e]);
        }
    }

    /// The error relative to the distance travelled; `None` for a short distance.
    pub(super) fn finish(&self) -> Option<Travelled> {
        if self.distance < SHORTEST {
            return None;
        }
        let (a, b) = (self.along / self.squares, self.across / self.squares);
        let left = |[p, e]: &[[f64; 2]; 2]| math::hypot(e[0] - a * p[0] + b * p[1], e[1] - b * p[0] - a * p[1]);
        let left = self.points.rows().iter().map(left).fold(0.0, f64::max);
        let percent = 100.0 / self.distance;
        let all = percent * self.largest;
        Some(Travelled {
            distance: self.distance,
            from_origin_percent: all,
            reciprocal_percent: all.min(percent * left),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A path of `length` steps to the north and back; `of` gives the error from the position and the distance so far.
    /// A step is slightly longer than a metre, so that rounding does not decide if five steps make a chord.
    fn there_and_back(length: u32, of: impl Fn(f64, f64) -> [f64; 2]) -> Option<Travelled> {
        let origin = Geodetic {
            lat: 0.6,
            lon: 0.1,
            height: 0.0,
        };
        let mut way = Way::default();
        for metre in 0..=2 * length {
            let [north, so_far] = [metre.min(2 * length - metre), metre].map(|steps| 1.001 * f64::from(steps));
            way.add(&origin.offset(&Vector3::new(north, 0.0, 0.0)), of(north, so_far));
        }
        way.finish()
    }

    #[test]
    fn lines_there_and_back_cancel_scale_and_heading_and_not_a_drift() {
        // 2 % of scale and 1 % of heading: √5 % of 100.1 m out, with a distance of 200.2 m. 1e-4: the curvature of the
        // Earth.
        let scale = there_and_back(100, |north, _| [3.0 + 0.02 * north, 7.0 + 0.01 * north]).unwrap();
        assert!((scale.distance - 200.2).abs() < 0.01, "{scale:?}");
        assert!((scale.from_origin_percent - 0.5 * 5.0_f64.sqrt()).abs() < 1e-4, "{scale:?}");
        assert!(scale.reciprocal_percent < 1e-4, "{scale:?}");
        // An error of 1 % of the distance to the east, in both directions of travel: most of it remains.
        let drift = there_and_back(100, |_, way| [0.0, 0.01 * way]).unwrap();
        assert!((drift.from_origin_percent - 1.0).abs() < 1e-4, "{drift:?}");
        assert!(drift.reciprocal_percent > 0.7, "{drift:?}");
    }

    #[test]
    fn noise_of_a_reference_is_no_way() {
        assert_eq!(there_and_back(2, |_, _| [0.0; 2]), None);
        assert_eq!(there_and_back(20, |_, _| [0.0; 2]), None);
    }
}
