//! The motion between two samples of a position, velocity or attitude.

use super::log::{Told, Track};
use fusion_core::geometry::so3::{log, rotation, to_rpy, wrap_angle};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::state::{Attitude, Manifold};
use nalgebra::{UnitQuaternion, Vector3};

/// The least horizontal speed for judging a course \[m/s\]: there 0.1 m/s of noise are 3°.
pub(super) const MIN_SPEED: f64 = 2.0;
/// Samples further apart do not determine the motion between them \[s\].
pub(super) const LONGEST: f64 = 3.0;
/// The largest rotation between two attitude samples \[rad\]. With a larger one, the attitude in between is unknown.
pub(super) const MUCH: f64 = 1.0;
/// Gravity \[m/s²\], as accurate as a comparison needs.
pub(super) const GRAVITY: f64 = 9.81;

/// The mean velocity between two positions, over intervals of at least `seconds`.
pub(super) fn slopes(track: &Track, seconds: f64) -> Vec<Told> {
    let (mut told, mut begun) = (Vec::new(), 0);
    for next in 1..track.times.len() {
        let [from, to] = [track.times[begun], track.times[next]];
        if to - track.times[next - 1] > LONGEST {
            begun = next;
        } else if to - from >= seconds {
            let [a, b] = [begun, next].map(|i| Geodetic::read(&track.values[i][..3]));
            told.push((from, to, b.difference(&a) / (to - from)));
            begun = next;
        }
    }
    told
}

/// Velocities north, east, down over time.
#[derive(Clone, Debug, Default)]
pub(super) struct Velocities {
    pub(super) times: Vec<f64>,
    pub(super) values: Vec<Vector3<f64>>,
    /// The distance up to some times, if it is known better than from these samples.
    way: Vec<(f64, Vector3<f64>)>,
}

/// The motion from one velocity to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) ends: [Vector3<f64>; 2],
}

impl Velocities {
    /// As measured.
    pub(super) fn of(track: &Track) -> Self {
        Self {
            times: track.times.clone(),
            values: track.values.iter().map(|v| Vector3::new(v[0], v[1], v[2])).collect(),
            way: track.way.clone(),
        }
    }

    /// The slope between positions, at the midpoint in time.
    pub(super) fn slope(track: &Track) -> Self {
        let slopes = slopes(track, 0.0);
        Self {
            times: slopes.iter().map(|(from, to, _)| (from + to) / 2.0).collect(),
            values: slopes.into_iter().map(|(_, _, v)| v).collect(),
            way: Vec::new(),
        }
    }

    /// The mean over an interval between two of its samples; `None` if there is a long gap.
    pub(super) fn mean(&self, from: f64, to: f64) -> Option<Vector3<f64>> {
        let [first, last] = [from, to].map(|t| self.times.partition_point(|s| *s <= t));
        let inside = self
            .times
            .get(first..last)?
            .iter()
            .copied()
            .zip(self.values[first..last].iter().copied());
        let (mut before, mut sum) = ((from, self.at(from)?), Vector3::zeros());
        for (t, v) in inside.chain([(to, self.at(to)?)]) {
            sum += (before.1 + v) * ((t - before.0) / 2.0);
            before = (t, v);
        }
        if let (Some(start), Some(end)) = (self.travelled(from), self.travelled(to)) {
            sum = end - start;
        }
        let is_whole = self.times[first.saturating_sub(1)..=last]
            .windows(2)
            .all(|t| t[1] - t[0] <= LONGEST);
        (is_whole && to > from).then(|| sum / (to - from))
    }

    /// The distance up to a time, if known.
    fn travelled(&self, time: f64) -> Option<Vector3<f64>> {
        let next = self.way.partition_point(|(t, _)| *t < time);
        let (after, there) = self.way.get(next)?;
        match next.checked_sub(1) {
            Some(last) => {
                let (before, here) = self.way[last];
                Some(here.lerp(there, (time - before) / (after - before)))
            }
            None => (*after == time).then_some(*there),
        }
    }

    /// The mean between its samples, over intervals of at least `seconds`.
    pub(super) fn means(&self, seconds: f64) -> Vec<Told> {
        let legs = self.strides(seconds);
        legs.filter_map(|leg| Some((leg.from, leg.to, self.mean(leg.from, leg.to)?)))
            .collect()
    }

    /// The gyro rates of a body that points along its course; roll and pitch rates are unknown.
    pub(super) fn course_rates(&self, seconds: f64) -> Vec<Told> {
        let legs = self.strides(seconds);
        legs.filter_map(|leg| Some((leg.from, leg.to, Vector3::new(f64::NAN, f64::NAN, leg.turn()?.0))))
            .collect()
    }

    /// The accelerometer values of such a body, forward and right.
    pub(super) fn course_forces(&self, seconds: f64) -> Vec<Told> {
        let legs = self.strides(seconds);
        let force = |leg: Leg| {
            leg.turn()
                .map(|(_, [ahead, right])| (leg.from, leg.to, Vector3::new(ahead, right, f64::NAN)))
        };
        legs.filter_map(force).collect()
    }

    /// The legs from each velocity to the next.
    pub(super) fn legs(&self) -> impl Iterator<Item = Leg> + '_ {
        self.strides(0.0)
    }

    /// Legs of at least `seconds`, each with the steps that it needs. Legs with a long gap are left out.
    pub(super) fn strides(&self, seconds: f64) -> impl Iterator<Item = Leg> + '_ {
        let steps = self.times.windows(2).zip(self.values.windows(2));
        let mut begun: Option<(f64, Vector3<f64>)> = None;
        steps.filter_map(move |(t, v)| {
            if t[1] - t[0] > LONGEST {
                begun = None;
                return None;
            }
            let (from, start) = *begun.get_or_insert((t[0], v[0]));
            (t[1] - from >= seconds).then(|| {
                begun = None;
                Leg {
                    from,
                    to: t[1],
                    ends: [start, v[1]],
                }
            })
        })
    }

    /// The interpolated value between two samples.
    pub(super) fn at(&self, time: f64) -> Option<Vector3<f64>> {
        let (i, share) = between(&self.times, time)?;
        Some(self.values[i].lerp(&self.values[i + 1], share))
    }
}

impl Leg {
    /// Mean acceleration \[m/s²\].
    pub(super) fn acceleration(&self) -> Vector3<f64> {
        (self.ends[1] - self.ends[0]) / (self.to - self.from)
    }

    /// Rate of the course \[rad/s\] and acceleration forward and right of it, if the speed is high enough.
    pub(super) fn turn(&self) -> Option<(f64, [f64; 2])> {
        let speeds = self.ends.map(|v| v.xy().norm());
        if speeds.iter().any(|s| *s < MIN_SPEED) {
            return None;
        }
        let dt = self.to - self.from;
        let [a, b] = self.ends.map(|v| course(&v));
        let rate = wrap_angle(b - a) / dt;
        let ahead = (speeds[1] - speeds[0]) / dt;
        Some((rate, [ahead, (speeds[0] + speeds[1]) / 2.0 * rate]))
    }
}

/// The course, clockwise from north \[rad\].
pub(super) fn course(v: &Vector3<f64>) -> f64 {
    math::atan2(v.y, v.x)
}

/// Attitudes, body to north-east-down, over time.
#[derive(Clone, Debug)]
pub(super) struct Attitudes {
    times: Vec<f64>,
    values: Vec<UnitQuaternion<f64>>,
}

impl Attitudes {
    pub(super) fn of(track: &Track) -> Self {
        Self {
            times: track.times.clone(),
            values: track.values.iter().map(|v| Attitude::read(v)).collect(),
        }
    }

    /// The mean rate of rotation between two samples \[rad/s\], body axes, with the interval.
    pub(super) fn turns(&self) -> impl Iterator<Item = Told> + '_ {
        let steps = self.times.windows(2).zip(self.values.windows(2));
        let turns = steps.map(|(t, q)| (t[0], t[1], log(&(q[0].inverse() * q[1])) / (t[1] - t[0])));
        // A rotation by 180° may also be one in the opposite direction. A fast rotation has no well-defined mean axis.
        turns.filter(|(from, to, w)| to - from <= LONGEST && w.norm() * (to - from) < MUCH)
    }

    pub(super) fn at(&self, time: f64) -> Option<UnitQuaternion<f64>> {
        let (i, share) = between(&self.times, time)?;
        let turn = log(&(self.values[i].inverse() * self.values[i + 1]));
        Some(self.values[i] * UnitQuaternion::from_scaled_axis(turn * share))
    }

    /// The mean specific force of a body with this motion, body axes \[m/s²\]. One mean covers a leg. Without
    /// velocities it covers an attitude step, for a body that does not accelerate for long.
    pub(super) fn forces(&self, velocities: Option<&Velocities>) -> Vec<Told> {
        let gravity = Vector3::new(0.0, 0.0, GRAVITY);
        let force = |from: f64, to: f64, acceleration: Vector3<f64>| {
            let q = self.at((from + to) / 2.0)?;
            Some((from, to, rotation(&q).transpose() * (acceleration - gravity)))
        };
        match velocities {
            Some(v) => v.legs().filter_map(|leg| force(leg.from, leg.to, leg.acceleration())).collect(),
            None => self.turns().filter_map(|(from, to, _)| force(from, to, Vector3::zeros())).collect(),
        }
    }
}

/// Headings of attitude or heading channels, as declared, clockwise from north \[rad\].
pub(super) fn headings(track: &Track) -> Vec<(f64, f64)> {
    let heading = |v: &[f64; 4]| {
        if track.channel == "heading" {
            v[0]
        } else {
            to_rpy(&Attitude::read(v)).z
        }
    };
    track.times.iter().copied().zip(track.values.iter().map(heading)).collect()
}

/// The sample before a time, and the fraction of the step to the next sample.
fn between(times: &[f64], time: f64) -> Option<(usize, f64)> {
    let next = times.partition_point(|t| *t <= time);
    let i = next.checked_sub(1)?;
    let step = times.get(next)? - times[i];
    (step <= LONGEST).then(|| (i, (time - times[i]) / step))
}
