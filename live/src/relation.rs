//! The relation of two clocks, from stamps by one and arrivals by the other.
//!
//! A message arrives after it was stamped, never before: arrival − stamp = offset + delay, delay ≥ 0. So the offset and
//! the drift are those of the line that no point lies below: the lower envelope of arrival − stamp over the stamp. The
//! envelope includes the shortest delay of the link, which no data show.
//!
//! The line is the edge of the lower convex hull above the mean stamp, which has the smallest sum of distances to all
//! points (S. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock skew from network delay measurements",
//! INFOCOM 1999).
//!
//! Memory   the lowest point of each of the latest [`BLOCKS`] blocks. Older points are forgotten, as
//!          the drift of a crystal changes with its temperature, within minutes
//! Jumps    of either clock: see [`Relation::add`]

use fusion::core::{math, memory};
use std::collections::VecDeque;

/// Length of a block \[ns\].
const BLOCK: i64 = 5_000_000_000;
/// Blocks that are kept: five minutes.
const BLOCKS: usize = 60;
/// A point below the envelope by more than this many mean delays is a jump of a clock. For delays that are exponential
/// above their minimum, a point of the same clock is that low once in 5 · 10⁸ times.
const JUMP: f64 = 20.0;
/// Points before the mean delay is known well enough to find jumps: to a quarter.
const KNOWN: u32 = 16;
/// Stamps in order after a stamp that went back: then a clock has jumped, and the message was not just late. A network
/// that changes the order of messages gives one or two of them.
const CONFIRMED: u32 = 5;

/// How the stamps of a clock relate to arrivals.
#[derive(Clone, Debug)]
pub struct Relation {
    /// The largest rate of arrival − stamp.
    most: f64,
    /// The lowest point of each block, by stamp; offsets are less `zero`.
    lowest: VecDeque<(i64, i64)>,
    /// The first point: numbers are relative to it, so that they are exact as `f64`.
    zero: Option<(i64, i64)>,
    /// The offset at `zero` \[ns\] and its rate.
    line: (f64, f64),
    latest: i64,
    /// The mean distance from the envelope \[ns\], of so many points. At first some lie below it.
    delay: f64,
    count: u32,
    /// Points since a stamp went back, which may be those of a clock that has jumped.
    doubtful: Vec<(i64, i64)>,
    jumps: u64,
}

memory!(Relation { lowest, zero, line, latest, delay, count, doubtful, jumps; most });

impl Relation {
    /// A relation whose rate is at most `most`, for example 10⁻⁴: 100 ppm.
    #[must_use]
    pub fn new(most: f64) -> Self {
        Self {
            most,
            lowest: VecDeque::with_capacity(BLOCKS + 1),
            zero: None,
            line: (0.0, 0.0),
            latest: i64::MIN,
            delay: 0.0,
            count: 0,
            doubtful: Vec::new(),
            jumps: 0,
        }
    }

    /// Takes the stamp and the arrival of a message \[ns\].
    ///
    /// A stamp that is later than its arrival by the envelope allows is a jump of a clock: the relation starts again. If
    /// a stamp goes back, the message was late or the clock has jumped back. If five messages in order follow it,
    /// none of them in the former order, it was the clock.
    pub fn add(&mut self, stamp: i64, arrival: i64) {
        if self.zero.is_none() {
            return self.begin(stamp, arrival);
        }
        if stamp < self.latest {
            let in_order = self.doubtful.last().is_none_or(|(last, _)| *last <= stamp);
            if !in_order {
                self.doubtful.clear();
            }
            self.doubtful.push((stamp, arrival));
            if self.doubtful.len() > CONFIRMED as usize {
                let points = core::mem::take(&mut self.doubtful);
                self.jumps += 1;
                self.forget();
                points.into_iter().for_each(|(stamp, arrival)| self.add(stamp, arrival));
            }
            return;
        }
        self.doubtful.clear();
        let excess = (arrival.saturating_sub(stamp) as f64) - self.offset(stamp) as f64;
        let span = self.line_spans(stamp);
        if self.count >= KNOWN && excess < -(JUMP * self.delay + self.most * span) {
            self.jumps += 1;
            self.forget();
            return self.begin(stamp, arrival);
        }
        self.count = self.count.saturating_add(1);
        // The mean of the latest messages, about 1,000 of them.
        let weight = 1.0 / f64::from(self.count.min(1000));
        self.delay += weight * (excess.abs() - self.delay);
        self.latest = stamp;
        if self.is_lowest(stamp, arrival - stamp) {
            self.fit(stamp);
        }
    }

    /// Forgets the relation: one of the clocks is another one from now on.
    pub fn forget(&mut self) {
        *self = Self {
            jumps: self.jumps,
            ..Self::new(self.most)
        };
    }

    fn begin(&mut self, stamp: i64, arrival: i64) {
        self.zero = Some((stamp, arrival - stamp));
        self.latest = stamp;
        self.lowest.clear();
        self.lowest.push_back((stamp, arrival - stamp));
        self.line = (0.0, 0.0);
        self.count = 1;
    }

    /// Seconds, in nanoseconds, from the last point of the envelope to a stamp.
    fn line_spans(&self, stamp: i64) -> f64 {
        self.lowest.back().map_or(0.0, |(last, _)| stamp.saturating_sub(*last) as f64)
    }

    /// Keeps the point if it is the lowest of its block, and returns whether it is.
    fn is_lowest(&mut self, stamp: i64, offset: i64) -> bool {
        let (_, rate) = self.line;
        let is_same_block = |last: i64| last.div_euclid(BLOCK) == stamp.div_euclid(BLOCK);
        match self.lowest.back_mut() {
            Some(last) if is_same_block(last.0) => {
                let drifted = rate * (stamp - last.0) as f64;
                let is_lower = (offset - last.1) as f64 <= drifted;
                if is_lower {
                    *last = (stamp, offset);
                }
                is_lower
            }
            _ => {
                self.lowest.push_back((stamp, offset));
                if self.lowest.len() > BLOCKS {
                    self.lowest.pop_front();
                }
                true
            }
        }
    }

    /// The line below all points that is closest to them.
    fn fit(&mut self, now: i64) {
        let Some((zero, first)) = self.zero else { return };
        let points = self.lowest.iter().map(|(s, d)| ((s - zero) as f64, (d - first) as f64));
        let mut hull: Vec<(f64, f64)> = Vec::with_capacity(self.lowest.len());
        for point in points {
            while let [.., a, b] = hull[..]
                && (b.1 - a.1) * (point.0 - a.0) >= (point.1 - a.1) * (b.0 - a.0)
            {
                hull.pop();
            }
            hull.push(point);
        }
        let mean = self.lowest.iter().map(|(s, _)| (s - zero) as f64).sum::<f64>() / self.lowest.len() as f64;
        let edge = hull.windows(2).find(|edge| edge[1].0 >= mean);
        let rate = edge.map_or(self.line.1, |edge| (edge[1].1 - edge[0].1) / (edge[1].0 - edge[0].0));
        let rate = rate.clamp(-self.most, self.most);
        let offset = hull.iter().map(|(s, d)| d - rate * s).fold(f64::INFINITY, f64::min);
        self.line = (offset, rate);
        // Far from the first point the difference of two large numbers would lose digits.
        if now - zero > 1000 * BLOCK
            && let Some((stamp, offset)) = self.lowest.back().copied()
        {
            let (old, rate) = self.line;
            let moved = old + rate * (stamp - zero) as f64 - (offset - first) as f64;
            (self.zero, self.line) = (Some((stamp, offset)), (moved, rate));
        }
    }

    /// Arrival − stamp of a message without delay, at this stamp \[ns\].
    #[must_use]
    pub fn offset(&self, stamp: i64) -> i64 {
        let Some((zero, first)) = self.zero else { return 0 };
        let (offset, rate) = self.line;
        first + math::round(offset + rate * (stamp.saturating_sub(zero)) as f64) as i64
    }

    /// The stamp of a message that would arrive without delay at this time \[ns\]; `None` before the first message.
    #[must_use]
    pub fn stamp_at(&self, arrival: i64) -> Option<i64> {
        let (zero, first) = self.zero?;
        let (offset, rate) = self.line;
        let since = (arrival.saturating_sub(zero).saturating_sub(first)) as f64 - offset;
        Some(zero + math::round(since / (1.0 + rate)) as i64)
    }

    /// Arrival − stamp of a message without delay, at the latest stamp \[ns\].
    #[must_use]
    pub fn now(&self) -> i64 {
        self.offset(self.latest)
    }

    /// The rate of arrival − stamp; positive if the clock of the stamps is slow.
    #[must_use]
    pub const fn rate(&self) -> f64 {
        self.line.1
    }

    /// The mean delay above the shortest one \[s\].
    #[must_use]
    pub fn mean_delay(&self) -> f64 {
        self.delay * 1e-9
    }

    /// How often a clock has jumped.
    #[must_use]
    pub const fn jumps(&self) -> u64 {
        self.jumps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::core::testing::Lcg;

    const S: f64 = 1e9;

    /// An exponential delay with this mean \[s\].
    fn delay(random: &mut Lcg, mean: f64) -> f64 {
        -mean * (1.0 - random.unit()).max(1e-12).ln()
    }

    /// Takes `seconds` of messages at `rate` per second whose clock is `ppm` slow, with delays of 2 ms and more, and
    /// returns the largest error of the offset after ten seconds \[s\].
    fn worst(relation: &mut Relation, rate: f64, seconds: f64, ppm: f64, mean: f64, seed: u64) -> f64 {
        let mut random = Lcg::new(seed);
        let mut worst = 0.0_f64;
        for k in 0..(rate * seconds) as u64 {
            let true_time = k as f64 / rate;
            let stamp = true_time / (1.0 + ppm * 1e-6);
            let arrival = true_time + 1234.5 + 0.002 + delay(&mut random, mean);
            let stamp = (stamp * S) as i64;
            relation.add(stamp, (arrival * S) as i64);
            if true_time > 10.0 {
                let sure = true_time + 1234.5 + 0.002 - stamp as f64 / S;
                worst = worst.max((relation.offset(stamp) as f64 / S - sure).abs());
            }
        }
        worst
    }

    #[test]
    fn offset_and_drift_are_found_to_a_millisecond_under_jitter() {
        for seed in 0..20 {
            for (rate, mean) in [(200.0, 0.005), (200.0, 0.03), (50.0, 0.005)] {
                let mut relation = Relation::new(1e-4);
                let found = worst(&mut relation, rate, 600.0, 40.0, mean, seed);
                assert!(found < 1e-3, "seed {seed}, {rate} Hz, delays {mean} s: {found} s");
                assert!((relation.rate() - 40e-6).abs() < 3e-6, "{}", relation.rate());
                assert_eq!(relation.jumps(), 0);
            }
        }
    }

    #[test]
    fn a_clock_that_jumps_either_way_is_found() {
        for jump in [-3600.0, -2.0, 0.9, 2.0, 86_400.0] {
            let mut relation = Relation::new(1e-4);
            let mut random = Lcg::new(7);
            let (mut before, mut after) = (0, 0);
            for k in 0..40_000_i64 {
                let time = k as f64 * 0.01;
                let moved = if k >= 20_000 { jump } else { 0.0 };
                let stamp = ((5000.0 + time + moved) * S) as i64;
                relation.add(stamp, ((9000.0 + time + delay(&mut random, 0.004)) * S) as i64);
                let sure = ((4000.0 - moved) * S) as i64;
                let is_right = (relation.offset(stamp) - sure).abs() < 2_000_000;
                if k > 1000 && k < 20_000 {
                    before += u32::from(!is_right);
                }
                // Half a second after the jump it is right again.
                if k > 20_050 {
                    after += u32::from(!is_right);
                }
            }
            assert_eq!((before, relation.jumps()), (0, 1), "{jump} s");
            assert!(after < 200, "{jump} s: {after} of 20,000 wrong");
        }
    }

    #[test]
    fn late_and_exchanged_messages_are_no_jump() {
        let mut relation = Relation::new(1e-4);
        let mut random = Lcg::new(3);
        for k in 0..20_000_i64 {
            let stamp = (k as f64 * 0.01 * S) as i64;
            // A network that stands still for two seconds, every minute, and then delivers all at once.
            let stall = if k % 6000 < 200 { (200 - k % 6000) as f64 * 0.01 } else { 0.0 };
            let arrival = |s: i64| s + (S * (7.0 + stall)) as i64 + (delay(&mut Lcg::new(s as u64), 0.002) * S) as i64;
            if random.unit() < 0.01 {
                // The message before comes after this one.
                relation.add(stamp, arrival(stamp));
                relation.add(stamp - 10_000_000, arrival(stamp));
            } else {
                relation.add(stamp, arrival(stamp));
            }
        }
        assert_eq!(relation.jumps(), 0);
        assert!((relation.offset(200 * 1_000_000_000) - 7_000_000_000).abs() < 1_000_000);
    }

    #[test]
    fn a_day_keeps_its_digits_and_its_memory() {
        let mut relation = Relation::new(1e-4);
        let found = worst(&mut relation, 10.0, 86_400.0, -25.0, 0.003, 1);
        assert!(found < 1e-3, "{found}");
        assert!(relation.lowest.len() <= BLOCKS);
    }

    #[test]
    fn the_inverse_is_the_stamp() {
        let mut relation = Relation::new(1e-4);
        worst(&mut relation, 100.0, 100.0, 60.0, 0.003, 5);
        let stamp = 99 * 1_000_000_000;
        // 2 ns: two roundings.
        assert!((relation.stamp_at(stamp + relation.offset(stamp)).unwrap() - stamp).abs() <= 2);
    }
}
