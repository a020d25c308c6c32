//! A path over the ground in bounded memory: the points that shape it.
//!
//! The distance of a point is taken from where the straight line between its neighbours would be at its time. So
//! corners stay, and the place at any time in between is that on the line.
//! Source: Douglas & Peucker (1973) for the order of the points, Meratnia & de By (EDBT 2004) for the distance.

use fusion_core::math;
use fusion_core::memory::{Memory, Tape};

/// A time \[s\], and north and east \[m\].
pub(super) type Point = (f64, [f64; 2]);

/// The points of a path.
#[derive(Clone, Debug)]
pub struct Path {
    capacity: usize,
    points: Vec<Point>,
}

impl Memory for Path {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let length = tape.length(self.points.len(), size_of::<Point>());
        self.points.resize(length, (0.0, [0.0; 2]));
        self.points.as_mut_slice().remember(tape);
        if self.points.len() > self.capacity {
            tape.refuse("a path has another size");
        }
    }
}

impl Path {
    /// At most `capacity` points.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self {
            capacity: capacity.max(4),
            points: Vec::new(),
        }
    }

    /// Adds a point, later than those before.
    pub fn push(&mut self, time: f64, point: [f64; 2]) {
        if self.points.len() == self.capacity {
            self.points = self.shaping(self.capacity / 2);
        }
        self.points.push((time, point));
    }

    /// Its points.
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Both ends and the points that shape it most, at most `most` in all, in order of time. No other point is farther from
    /// the lines between these than any of these weighs.
    #[must_use]
    pub(super) fn shaping(&self, most: usize) -> Vec<Point> {
        if self.points.len() <= most {
            return self.points.clone();
        }
        let weights = weights(&self.points);
        let mut sorted = weights.clone();
        let (_, limit, _) = sorted.select_nth_unstable_by(most, |a, b| b.total_cmp(a));
        let kept = self.points.iter().zip(&weights).filter(|(_, weight)| **weight > *limit);
        kept.map(|(point, _)| *point).collect()
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.points.capacity() * size_of::<Point>()
    }
}

/// How far the path would be from each point without it and those that matter less \[m\].
fn weights(points: &[Point]) -> Vec<f64> {
    let mut weights = vec![f64::INFINITY; points.len()];
    let mut stretches = vec![(0, points.len() - 1, f64::INFINITY)];
    while let Some((from, to, limit)) = stretches.pop() {
        if to - from < 2 {
            continue;
        }
        let (mut farthest, mut distance) = (from + (to - from) / 2, 0.0);
        for i in from + 1..to {
            let d = aside(&points[from], &points[i], &points[to]);
            if d > distance {
                (farthest, distance) = (i, d);
            }
        }
        let weight = f64::min(distance, limit);
        weights[farthest] = weight;
        stretches.extend([(from, farthest, weight), (farthest, to, weight)]);
    }
    weights
}

/// From a point to where the line between two others is at its time \[m\].
fn aside((t0, a): &Point, (t, p): &Point, (t1, b): &Point) -> f64 {
    let share = if t1 > t0 { (t - t0) / (t1 - t0) } else { 0.0 };
    let off = |k: usize| p[k] - a[k] - share * (b[k] - a[k]);
    math::hypot(off(0), off(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Round a square of 10 m at 1 m/s, a stop of 30 s in the middle of the second side, at `rate` points a second.
    fn square(rate: f64) -> Vec<Point> {
        let place = |t: f64| {
            let way = if t < 15.0 { t } else { f64::max(15.0, t - 30.0) };
            match way {
                ..10.0 => [way, 0.0],
                10.0..20.0 => [10.0, way - 10.0],
                20.0..30.0 => [30.0 - way, 10.0],
                _ => [0.0, 40.0 - way],
            }
        };
        let times = (0..=(70.0 * rate) as usize).map(|k| k as f64 / rate);
        times.map(|t| (t, place(t))).collect()
    }

    /// The place at a time, on the line between the points.
    fn at(points: &[Point], time: f64) -> [f64; 2] {
        let next = points.partition_point(|(t, _)| *t < time).clamp(1, points.len() - 1);
        let ((t0, a), (t1, b)) = (points[next - 1], points[next]);
        let share = (time - t0) / (t1 - t0);
        [0, 1].map(|k| a[k] + share * (b[k] - a[k]))
    }

    #[test]
    fn corners_and_stops_stay_however_long_the_path() {
        for rate in [10.0, 997.0] {
            let all = square(rate);
            let mut path = Path::new(64);
            all.iter().for_each(|(t, p)| path.push(*t, *p));
            assert!(path.points().len() <= 64 && path.bytes() <= 64 * 24);
            let kept = path.shaping(16);
            assert!(kept.len() <= 16);
            for (t, wanted) in &all {
                let found = at(&kept, *t);
                // Less than a sample's way on either side of a corner, which lies between two samples, and rounding.
                let most = 1.5 / rate + 1e-9;
                assert!(
                    (found[0] - wanted[0]).hypot(found[1] - wanted[1]) < most,
                    "{t}: {found:?} {wanted:?}"
                );
            }
        }
    }

    #[test]
    fn no_point_is_farther_from_what_remains_than_the_weight_of_what_went() {
        let mut noise = 7_u32;
        let mut next = || {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(noise >> 8) / f64::from(1 << 24)
        };
        let mut path = Path::new(4096);
        for k in 0..4096 {
            let t = f64::from(k) * 0.1;
            path.push(t, [10.0 * (0.03 * t).sin() + 0.1 * next(), 0.05 * t + 0.1 * next()]);
        }
        let weights = weights(path.points());
        for most in [1000, 100, 20] {
            let kept = path.shaping(most);
            let ends = [kept[0], kept[kept.len() - 1]];
            assert!((most / 2..=most).contains(&kept.len()) && ends == [path.points()[0], path.points()[4095]]);
            let gone = path.points().iter().zip(&weights).filter(|(p, _)| !kept.contains(p));
            let limit = gone.map(|(_, w)| *w).fold(0.0, f64::max);
            let worst = path.points().iter().map(|(t, p)| {
                let [n, e] = at(&kept, *t);
                (n - p[0]).hypot(e - p[1])
            });
            assert!(worst.fold(0.0, f64::max) <= limit + 1e-12, "{most}"); // rounding
        }
    }
}
