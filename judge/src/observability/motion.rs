//! Parts of a log by the motion in them, and words for it.
//!
//! The log is cut into blocks of a second. Neighbours with the most alike motion become one, as Ward's method joins
//! clusters, so that never more than [`MOST_BLOCKS`] are kept. Blocks and their figures add up.

use fusion::solution::Solution;
use fusion_core::geometry::so3;
use fusion_core::math;
use fusion_core::time::Time;
use nalgebra::UnitQuaternion;
use std::f64::consts::PI;

/// The shortest block \[s\]: a manoeuvre of a vehicle is longer.
const SHORTEST: f64 = 1.0;

/// Blocks that are kept while the log is read: several for each segment of the result, so that its borders are found.
pub(super) const MOST_BLOCKS: usize = 96;

/// Segments of the result: as many as a table of one page holds.
pub(super) const MOST_SEGMENTS: usize = 16;

/// The motion between two times.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Motion {
    /// Begin and end \[s\].
    pub(super) from: f64,
    pub(super) to: f64,
    /// The filter starts again here: there are no data.
    pub(super) is_gap: bool,
    /// Whether velocity, and heading or course, are known.
    has_velocity: bool,
    has_heading: bool,
    /// Way \[m\], climb \[m\], turn clockwise \[rad\], and the sum of all rotations \[rad\].
    way: f64,
    climb: f64,
    turn: f64,
    rotation: f64,
    /// The sum of all turns of either direction that are faster than [`RATE`] \[rad\].
    turning: f64,
    /// Speed at both ends \[m/s\].
    speeds: (f64, f64),
    /// The σ of the velocity, summed over time \[m\].
    sigma: f64,
}

/// The name of a motion. It decides words only, and which neighbours become one segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Gap,
    Unknown,
    Rest,
    Right,
    Left,
    Winding,
    Faster,
    Slower,
    Climb,
    Descent,
    Rotation,
    Straight,
}

/// A turn has at least this angle \[rad\]: it mixes two axes by a quarter, sin 15°.
const TURN: f64 = 15.0 * PI / 180.0;

/// Or it is part of one: at this rate \[rad/s\], three seconds make a turn.
const RATE: f64 = TURN / 3.0;

/// A motion of one direction has at least this share of all its turns in it.
const ONE_WAY: f64 = 0.8;

/// A change of speed is at least this share of the larger speed: less is what a driver calls a constant speed.
const CHANGE: f64 = 0.2;

/// A climb has at least this slope: steeper than roads.
const SLOPE: f64 = 0.12;

/// A speed below this number of σ may be zero: 0.3 % of normal errors are larger.
const SIGMAS: f64 = 3.0;

impl Motion {
    /// A gap in which the filter starts again.
    pub(super) fn gap(from: f64, to: f64) -> Self {
        Self {
            from,
            to,
            is_gap: true,
            ..Self::default()
        }
    }

    pub(super) const fn duration(&self) -> f64 {
        self.to - self.from
    }

    /// This motion and then `next`.
    pub(super) fn then(&self, next: &Self) -> Self {
        Self {
            from: self.from,
            to: next.to,
            is_gap: self.is_gap,
            has_velocity: self.has_velocity && next.has_velocity,
            has_heading: self.has_heading && next.has_heading,
            way: self.way + next.way,
            climb: self.climb + next.climb,
            turn: self.turn + next.turn,
            rotation: self.rotation + next.rotation,
            turning: self.turning + next.turning,
            speeds: (self.speeds.0, next.speeds.1),
            sigma: self.sigma + next.sigma,
        }
    }

    fn kind(&self) -> Kind {
        let (before, after) = self.speeds;
        if self.is_gap {
            Kind::Gap
        } else if !(self.has_velocity || self.has_heading) {
            Kind::Unknown
        } else if self.turning >= TURN && self.turn.abs() < ONE_WAY * self.turning {
            Kind::Winding
        } else if self.turn.abs() >= TURN.min(RATE * self.duration()) {
            if self.turn > 0.0 { Kind::Right } else { Kind::Left }
        } else if self.rotation >= TURN && !self.is_moving() {
            Kind::Rotation
        } else if !self.is_moving() {
            Kind::Rest
        } else if self.is_ramp() {
            if after > before { Kind::Faster } else { Kind::Slower }
        } else if self.climb.abs() > SLOPE * self.way {
            if self.climb > 0.0 { Kind::Climb } else { Kind::Descent }
        } else {
            Kind::Straight
        }
    }

    /// Whether the speed changes, and its mean is between those at both ends.
    fn is_ramp(&self) -> bool {
        let (before, after) = self.speeds;
        let mean = self.way / self.duration();
        let least = (CHANGE * before.max(after)).max(SIGMAS * self.sigma / self.duration());
        (after - before).abs() > least && (mean - before) * (after - mean) > 0.0
    }

    fn is_moving(&self) -> bool {
        self.has_velocity && self.way > SIGMAS * self.sigma
    }

    /// The motion in words.
    pub(super) fn words(&self) -> String {
        let speed = |v: f64| fusion_tables::short(math::round(v * 10.0) / 10.0);
        let whole = |v: f64| math::round(v.abs());
        let degrees = whole(self.turn.to_degrees());
        match self.kind() {
            Kind::Gap => "the filter starts again".to_owned(),
            Kind::Unknown => String::new(),
            Kind::Rest => "at rest".to_owned(),
            Kind::Right => format!("turns right by {degrees} deg"),
            Kind::Left => format!("turns left by {degrees} deg"),
            Kind::Winding => format!("turns both ways, by {} deg in all", whole(self.turning.to_degrees())),
            Kind::Faster => format!("speeds up from {} to {} m/s", speed(self.speeds.0), speed(self.speeds.1)),
            Kind::Slower => format!("slows down from {} to {} m/s", speed(self.speeds.0), speed(self.speeds.1)),
            Kind::Climb => format!("climbs by {} m", whole(self.climb)),
            Kind::Descent => format!("descends by {} m", whole(self.climb)),
            Kind::Rotation => "rotates on the spot".to_owned(),
            Kind::Straight => format!("straight, {} m/s", speed(self.way / self.duration())),
        }
    }

    /// The motions of which it is one; `None` if it has no name.
    pub(super) fn group(&self) -> Option<&'static str> {
        Some(match self.kind() {
            Kind::Gap | Kind::Unknown => return None,
            Kind::Rest => "rest",
            Kind::Right | Kind::Left | Kind::Winding => "turns",
            Kind::Faster | Kind::Slower => "changes of speed",
            Kind::Climb | Kind::Descent => "climbs and descents",
            Kind::Rotation => "rotations on the spot",
            Kind::Straight => "straight motion",
        })
    }

    /// Velocities, accelerations and rates, each group in one unit.
    fn features(&self) -> [[f64; 2]; 3] {
        let duration = self.duration();
        let (speed, turn) = (self.way / duration, self.turn / duration);
        let forward = (self.speeds.1 - self.speeds.0) / duration;
        [
            [speed, self.climb / duration],
            [forward, speed * turn],
            [turn, self.rotation / duration],
        ]
    }
}

/// Follows the solutions of a run.
#[derive(Debug, Default)]
pub(super) struct Follower {
    block: Option<Motion>,
    last: Option<Last>,
}

#[derive(Debug)]
struct Last {
    time: Time,
    /// Heading or course, and its variance.
    heading: Option<(f64, f64)>,
    attitude: Option<UnitQuaternion<f64>>,
}

impl Follower {
    /// Forgets the solutions before a start.
    pub(super) fn start(&mut self, time: Time) {
        let at = time.seconds();
        *self = Self {
            block: Some(Motion {
                from: at,
                to: at,
                ..Motion::default()
            }),
            last: None,
        };
    }

    /// Takes the solution of an estimate. Returns the block that ends there, if one does.
    pub(super) fn take(&mut self, time: Time, solution: &Solution) -> Option<Motion> {
        let block = self.block.as_mut()?;
        let is_first = self.last.is_none();
        let velocity = solution.velocity.as_ref();
        let (speed, sigma) = velocity.map_or((0.0, 0.0), |(v, p)| (v.norm(), math::sqrt(p.trace())));
        let attitude = solution.attitude.map(|(q, _)| q);
        let course = velocity.filter(|_| speed > SIGMAS * sigma).map(|(v, _)| {
            let across = sigma / speed;
            (math::atan2(v.y, v.x), across * across)
        });
        let heading = solution.rpy().map(|(rpy, sigma)| (rpy.z, sigma.z * sigma.z)).or(course);
        block.to = time.seconds();
        block.has_velocity = velocity.is_some();
        block.has_heading = heading.is_some();
        block.speeds.1 = speed;
        if is_first {
            block.speeds.0 = speed;
        }
        if let Some(last) = &self.last {
            let dt = time.seconds_since(last.time);
            block.way += speed * dt;
            block.sigma += sigma * dt;
            block.climb -= velocity.map_or(0.0, |(v, _)| v.z) * dt;
            if let (Some(now), Some(before)) = (heading, last.heading) {
                let turn = so3::wrap_angle(now.0 - before.0);
                // A correction has the variance that it takes away: the estimate turns, and the vehicle does not.
                let is_correction = turn * turn <= SIGMAS * SIGMAS * (before.1 - now.1);
                if !is_correction {
                    block.turn += turn;
                    let rotation = attitude.zip(last.attitude).map(|(now, before)| so3::log(&(before.inverse() * now)));
                    block.rotation += rotation.map_or(0.0, |rotation| rotation.norm());
                }
            }
        }
        self.last = Some(Last { time, heading, attitude });
        // The difference of two times is rounded, by less than a microsecond.
        if block.duration() < SHORTEST - 1e-6 {
            return None;
        }
        if block.turn.abs() >= RATE * block.duration() {
            block.turning = block.turn.abs();
        }
        self.cut()
    }

    /// Ends the block at the latest solution; `None` if it is empty.
    pub(super) fn cut(&mut self) -> Option<Motion> {
        let block = self.block.as_mut().filter(|block| block.duration() > 0.0)?;
        let next = Motion {
            from: block.to,
            to: block.to,
            speeds: (block.speeds.1, block.speeds.1),
            ..Motion::default()
        };
        Some(core::mem::replace(block, next))
    }
}

/// The number of the block whose motion is most alike that of the next; `None` if no two blocks can be joined.
pub(super) fn most_alike(blocks: &[Motion]) -> Option<usize> {
    let features: Vec<_> = blocks.iter().map(Motion::features).collect();
    let total: f64 = blocks.iter().map(Motion::duration).sum();
    let moving = || blocks.iter().zip(&features).filter(|(block, _)| !block.is_gap);
    // The mean square of each group around its mean.
    let spread: [f64; 3] = core::array::from_fn(|group| {
        (0..2)
            .map(|k| {
                let moment = |power: i32| {
                    let each = moving().map(|(block, f)| block.duration() * math::powi(f[group][k], power));
                    each.sum::<f64>() / total
                };
                moment(2) - moment(1) * moment(1)
            })
            .sum()
    });
    let cost = |i: usize| {
        let (one, other) = (blocks[i].duration(), blocks[i + 1].duration());
        let square = |group: usize| {
            let off = (0..2).map(|k| features[i][group][k] - features[i + 1][group][k]);
            off.map(|d| d * d).sum::<f64>() / spread[group]
        };
        let groups = (0..3).filter(|group| spread[*group] > 0.0);
        one * other / (one + other) * groups.map(square).sum::<f64>()
    };
    let pairs = (0..blocks.len().saturating_sub(1)).filter(|i| !(blocks[*i].is_gap || blocks[i + 1].is_gap));
    // Among equals, the shortest: a filter without any motion gets parts of equal length.
    let seconds = |i: usize| blocks[i].duration() + blocks[i + 1].duration();
    let order = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1).then(seconds(a.0).total_cmp(&seconds(b.0)));
    pairs.map(|i| (i, cost(i))).min_by(order).map(|(i, _)| i)
}

/// The number of a block that has the same name as the next.
pub(super) fn same_name(blocks: &[Motion]) -> Option<usize> {
    let pairs = blocks.windows(2);
    let mut kinds = pairs.map(|pair| (pair[0].kind(), pair[1].kind()));
    kinds.position(|(one, other)| one == other && one != Kind::Gap && one != Kind::Unknown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    /// The names of the parts of a drive by speed and rate of turn, each for some seconds, at 10 Hz.
    fn names(drive: &[(f64, f64, f64)]) -> Vec<String> {
        let (mut follower, mut blocks) = (Follower::default(), Vec::new());
        follower.start(Time::from_seconds(0.0));
        let (mut heading, mut step, mut speed) = (0.0, 0, 0.0);
        for (seconds, end, rate) in drive {
            let steps = (seconds * 10.0) as i32;
            let gain = (end - speed) / f64::from(steps);
            for _ in 0..steps {
                step += 1;
                speed += gain;
                heading += rate.to_radians() * 0.1;
                let time = Time::from_seconds(0.1 * f64::from(step));
                let solution = Solution {
                    time,
                    velocity: Some((
                        Vector3::new(speed * heading.cos(), speed * heading.sin(), 0.0),
                        Matrix3::identity() * 1e-4,
                    )),
                    attitude: Some((UnitQuaternion::from_euler_angles(0.0, 0.0, heading), Matrix3::identity() * 1e-6)),
                    ..Solution::default()
                };
                blocks.extend(follower.take(time, &solution));
            }
        }
        blocks.extend(follower.cut());
        while blocks.len() > 8 {
            let pair = most_alike(&blocks).unwrap();
            let next = blocks.remove(pair + 1);
            blocks[pair] = blocks[pair].then(&next);
        }
        while let Some(pair) = same_name(&blocks) {
            let next = blocks.remove(pair + 1);
            blocks[pair] = blocks[pair].then(&next);
        }
        blocks.iter().map(Motion::words).collect()
    }

    #[test]
    fn parts_of_a_drive_are_named_by_their_motion() {
        let drive = [
            (20.0, 0.0, 0.0),
            (10.0, 8.0, 0.0),
            (10.0, 8.0, 9.0),
            (40.0, 8.0, 0.0),
            (10.0, 8.0, -6.0),
        ];
        let told = names(&drive);
        assert_eq!(
            told,
            [
                "at rest",
                "speeds up from 0 to 8 m/s",
                "turns right by 90 deg",
                "straight, 8 m/s",
                "turns left by 60 deg"
            ]
        );
    }

    #[test]
    fn a_turn_across_south_is_as_long_as_it_is() {
        let told = names(&[(10.0, 0.0, 0.0), (20.0, 5.0, 10.0)]);
        assert_eq!(told, ["at rest", "turns right by 200 deg"]);
    }
}
