//! An inertial unit compared with a track of positions: whether they turn alike, which axis points ahead, and the
//! offset of their clocks.

use super::numbers::{Integral, Vec3, line, median, norm, quantile};
use super::track::Track;
use fusion_core::math;

/// The largest offset that is tried, and the step \[s\].
const REACH: f64 = 1.5;
const STEP: f64 = 0.02;
/// Courses count above this speed \[m/s\], or above half of the usual top speed if that is less.
const MOVING: f64 = 2.0;
/// Fewer intervals of motion are not enough.
const ENOUGH: usize = 20;

/// Chance does not reach this correlation of turns over half of the intervals of a drive.
const AGREES: f64 = 0.8;

/// How unit and track agree.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// The rate about the down axis over the rate of the course, at the best offset.
    pub slope: f64,
    /// Their correlation at this offset.
    pub correlation: f64,
    /// The delay of the velocity stamps against the stamps of the unit \[s\].
    pub lag: f64,
    /// The median speed of the compared intervals \[m/s\].
    pub speed: f64,
    /// The delay in the first and in the last third of the log.
    pub lags: Option<(f64, f64)>,
    /// The direction of motion in the sensor's horizontal plane, as an angle from the first horizontal axis to the
    /// second \[rad\], and its correlation.
    pub forward: Option<(f64, f64)>,
    /// The usual change of the sideways velocity within a second: the speed times the difference of the turns of course
    /// and unit, 1σ \[m/s\]. It contains the noise of the velocity.
    pub slip: f64,
    /// The correlation of the force, less gravity, with the change of the climb rate.
    pub climb: f64,
    /// The delay of the velocity from the length of the force, which follows from the accelerations of the track for
    /// any attitude \[s\]. `None` if the thirds of the log disagree.
    pub by_force: Option<f64>,
}

impl Pair {
    /// Returns true if unit and track turn alike.
    pub(super) fn agrees(&self) -> bool {
        self.correlation.abs() > AGREES
    }

    /// Returns true if their turns agree at all.
    pub(super) fn is_related(&self) -> bool {
        self.correlation.abs() > 0.5
    }

    /// The angle of [`Pair::forward`] and its correlation, if the correlation is large enough.
    pub(super) fn ahead(&self) -> Option<(f64, f64)> {
        /// Forces that hardly depend on the accelerations of the track agree less.
        const DECIDED: f64 = 0.6;
        self.forward.filter(|(_, correlation)| *correlation > DECIDED)
    }
}

/// The horizontal axes of a sensor whose axis `up` points up or, with `is_down`, down. They are two unit vectors that
/// form a right-handed system with the down axis.
pub(super) fn horizontal((up, is_down): (usize, bool)) -> (Vec3, Vec3) {
    let mut first = [0.0; 3];
    first[if up == 0 { 1 } else { 0 }] = 1.0;
    let mut down = [0.0; 3];
    down[up] = if is_down { 1.0 } else { -1.0 };
    (first, cross(down, first))
}

pub(super) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// An interval between two fixes, in motion.
struct Interval {
    from: f64,
    to: f64,
    /// Rate of the course, clockwise \[rad/s\].
    turn: f64,
    /// Rate of change of the speed \[m/s²\].
    along: f64,
    /// The mean speed \[m/s\].
    speed: f64,
}

impl Pair {
    /// From samples and a track; `None` if the vehicle moves too little or too slowly.
    pub(super) fn of(t: &[f64], force: &[Vec3], rate: &[Vec3], gravity: Vec3, up: (usize, bool), track: &Track) -> Option<Self> {
        let intervals = intervals(track);
        if intervals.len() < ENOUGH {
            return None;
        }
        let (rates, forces) = (Integral::of(t, rate), Integral::of(t, force));
        let down = gravity.map(|g| -g / norm(gravity));
        let Lag {
            by: lag,
            slope,
            correlation,
        } = best(&intervals, &rates, down)?;
        let third = intervals.len() / 3;
        let lags = (third >= 3 * ENOUGH).then(|| {
            let [first, last] = [&intervals[..third], &intervals[intervals.len() - third..]].map(|part| best(part, &rates, down));
            let is_clear = |lag: &Lag| lag.correlation.abs() > AGREES;
            Some((first.filter(is_clear)?.by, last.filter(is_clear)?.by))
        });
        Some(Self {
            slope,
            correlation,
            lag,
            speed: median(intervals.iter().map(|i| i.speed)),
            lags: lags.flatten(),
            forward: forward(&intervals, &forces, gravity, up, lag),
            slip: slip(&intervals, &rates, down, lag, slope.signum()),
            climb: climb(track, &forces, norm(gravity)),
            by_force: by_force(t, force, norm(gravity), track),
        })
    }
}

/// The delay of a unit's clock against the clock of a track, if their turns do not agree within [`REACH`]: two files
/// with different time origins. `None` if there is not exactly one offset at which the turns agree.
pub(super) fn apart(t: &[f64], rate: &[Vec3], gravity: Vec3, track: &Track) -> Option<f64> {
    /// The coarse step \[s\]: turns of a vehicle last seconds.
    const COARSE: f64 = 0.25;
    /// No turn lasts longer; offsets further apart are different ones \[s\].
    const TURN: f64 = 15.0;
    /// Another offset is possible, too, if its unexplained part is at most `ALIKE` times as large. An unexplained part
    /// below `NOTHING` counts as none.
    const ALIKE: f64 = 2.0;
    const NOTHING: f64 = 1e-3;
    /// Longer logs are not compared: fourteen hours in all.
    const MOST: f64 = 2e5;
    let intervals = intervals(track);
    let (first, last) = span(t)?;
    let (begin, end) = span(&track.t)?;
    let (rates, down) = (Integral::of(t, rate), gravity.map(|g| -g / norm(gravity)));
    let enough = ENOUGH.max(intervals.len() / 2);
    let steps = (last - first + end - begin) / COARSE;
    if steps.is_nan() || steps > MOST {
        return None;
    }
    let steps = steps as usize;
    let lags = (0..=steps).map(|k| begin - last + COARSE * k as f64);
    let tried: Vec<Lag> = tried(lags, enough, |lag| turns(&intervals, &rates, down, lag)).collect();
    let size = |lag: &Lag| lag.correlation.abs();
    let best = *tried.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    // A path that repeats itself, round a block or up and down, agrees nearly as well a leg later.
    let left = |lag: &Lag| 1.0 - size(lag) * size(lag);
    let is_other = |other: &Lag| (other.by - best.by).abs() > TURN && left(other) < ALIKE * left(&best) + NOTHING;
    (size(&best) > AGREES && !tried.iter().any(is_other)).then_some(best.by)
}

/// Returns the first and the last stamp of a log without its outliers. The limits are the quantiles of 5 and 95 % of the
/// stamps, widened by a tenth of their distance.
fn span(t: &[f64]) -> Option<(f64, f64)> {
    let (early, late) = (quantile(t.iter().copied(), 0.05), quantile(t.iter().copied(), 0.95));
    let margin = 0.1 * (late - early);
    let inside = || t.iter().copied().filter(|t| (early - margin..=late + margin).contains(t));
    Some((inside().reduce(f64::min)?, inside().reduce(f64::max)?))
}

fn intervals(track: &Track) -> Vec<Interval> {
    let slowest = MOVING.min(track.slowest());
    // At least a second: shorter intervals differ by the noise of the velocity.
    let stride = (math::round(track.rate()) as usize).max(1);
    let mut all = Vec::new();
    for k in stride..track.t.len() {
        let (a, b) = (track.velocity[k - stride], track.velocity[k]);
        let dt = track.t[k] - track.t[k - stride];
        let (before, after) = (math::hypot(a[0], a[1]), math::hypot(b[0], b[1]));
        if !(before.min(after) > slowest && dt < 3.0) {
            continue;
        }
        let turn = math::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]) / dt;
        all.push(Interval {
            from: track.t[k - stride],
            to: track.t[k],
            turn,
            along: (after - before) / dt,
            speed: 0.5 * (before + after),
        });
    }
    all
}

/// The correlation of the length of the force with the change of the vertical velocity, over a second each.
fn climb(track: &Track, forces: &Integral, gravity: f64) -> f64 {
    let stride = (math::round(track.rate()) as usize).max(1);
    let pairs = (stride..track.t.len()).filter_map(|k| {
        let (from, to) = (track.t[k - stride], track.t[k]);
        let faster = (track.velocity[k - stride][2] - track.velocity[k][2]) / (to - from);
        let force = norm(forces.mean(from, to)?) - gravity;
        (faster.is_finite() && to - from < 3.0).then_some((faster, force))
    });
    line(&pairs.collect::<Vec<_>>()).1
}

/// The offset at which the length of the force best matches that of the track accelerations plus gravity.
fn by_force(t: &[f64], force: &[Vec3], gravity: f64, track: &Track) -> Option<f64> {
    /// The shortest time over which accelerations change [s].
    const LEAST: f64 = 0.4;
    /// A force with other causes, such as vibration, agrees less.
    const CERTAIN: f64 = 0.9;
    /// Thirds of the log agree if they differ by at most this [s].
    const ALIKE: f64 = 2.5 * STEP;
    if !track.is_reported {
        return None;
    }
    let lengths: Vec<Vec3> = force.iter().map(|f| [norm(*f), 0.0, 0.0]).collect();
    let lengths = Integral::of(t, &lengths);
    let stride = (math::round(LEAST * track.rate()) as usize).max(1);
    let longest = 1.5 * stride as f64 / track.rate();
    let steps: Vec<(f64, f64, f64)> = (stride..track.t.len())
        .filter_map(|k| {
            let (from, to) = (track.t[k - stride], track.t[k]);
            let (a, b) = (track.velocity[k - stride], track.velocity[k]);
            let mut needed = [0, 1, 2].map(|i| (b[i] - a[i]) / (to - from));
            needed[2] -= gravity;
            let length = norm(needed);
            (to - from < longest && length.is_finite()).then_some((from, to, length))
        })
        .collect();
    let late = |steps: &[(f64, f64, f64)]| {
        let pairs = |lag: f64| {
            let means = steps
                .iter()
                .filter_map(|(from, to, length)| Some((*length, lengths.mean(from - lag, to - lag)?[0])));
            means.collect()
        };
        let best = tried(near(), ENOUGH, pairs).max_by(|a, b| a.correlation.total_cmp(&b.correlation));
        best.filter(|best| best.correlation > CERTAIN).map(|best| best.by)
    };
    let lag = late(&steps)?;
    let third = (steps.len() / 3).max(1);
    let is_alike = |part: &[(f64, f64, f64)]| late(part).is_some_and(|other| (other - lag).abs() < ALIKE);
    steps.chunks_exact(third).take(3).all(is_alike).then_some(lag)
}

/// The pairs of the rate of the course and of the unit, `lag` earlier.
fn turns(intervals: &[Interval], rates: &Integral, down: Vec3, lag: f64) -> Vec<(f64, f64)> {
    let pairs = intervals
        .iter()
        .filter_map(|i| Some((i.turn, dot(down, rates.mean(i.from - lag, i.to - lag)?))));
    pairs.collect()
}

/// The 1σ of the sideways change of the velocity that no turn of the unit explains. Its rates have this `sign`.
fn slip(intervals: &[Interval], rates: &Integral, down: Vec3, lag: f64, sign: f64) -> f64 {
    let changes = intervals.iter().filter_map(|i| {
        let turn = sign * dot(down, rates.mean(i.from - lag, i.to - lag)?);
        Some((i.speed * (i.turn - turn) * (i.to - i.from)).abs())
    });
    // Half of all normal values are within 0.674 σ.
    median(changes) / 0.674
}

/// The offset at which the turns agree best.
fn best(intervals: &[Interval], rates: &Integral, down: Vec3) -> Option<Lag> {
    let tried = tried(near(), ENOUGH, |lag| turns(intervals, rates, down, lag));
    tried.max_by(|a, b| a.correlation.abs().total_cmp(&b.correlation.abs()))
}

/// Two series with an offset: the slope of one over the other, and their correlation.
#[derive(Clone, Copy)]
struct Lag {
    /// The offset \[s\].
    by: f64,
    slope: f64,
    correlation: f64,
}

/// The offsets up to [`REACH`].
fn near() -> impl Iterator<Item = f64> {
    let steps = math::round(REACH / STEP) as i32;
    (-steps..=steps).map(|k| STEP * f64::from(k))
}

/// Two series at each offset that leaves `enough` pairs.
fn tried(lags: impl Iterator<Item = f64>, enough: usize, pairs: impl Fn(f64) -> Vec<(f64, f64)>) -> impl Iterator<Item = Lag> {
    let at = move |by: f64| {
        let pairs = pairs(by);
        let (slope, correlation) = line(&pairs);
        (pairs.len() >= enough && correlation.is_finite()).then_some(Lag { by, slope, correlation })
    };
    lags.filter_map(at)
}

/// The angle at which the horizontal force matches the acceleration of the track.
fn forward(intervals: &[Interval], forces: &Integral, gravity: Vec3, up: (usize, bool), lag: f64) -> Option<(f64, f64)> {
    let (first, second) = horizontal(up);
    let pairs: Vec<_> = intervals
        .iter()
        .filter_map(|i| {
            let f = forces.mean(i.from - lag, i.to - lag)?;
            let f = [0, 1, 2].map(|k| f[k] - gravity[k]);
            Some(((i.along, i.speed * i.turn), (dot(f, first), dot(f, second))))
        })
        .collect();
    let n = pairs.len() as f64;
    let mean = pairs.iter().fold((0.0, 0.0), |m, p| (m.0 + p.1.0 / n, m.1 + p.1.1 / n));
    let (mut re, mut im, mut mm, mut ff) = (0.0, 0.0, 0.0, 0.0);
    for ((along, across), (x, y)) in pairs {
        let (x, y) = (x - mean.0, y - mean.1);
        re += along * x + across * y;
        im += along * y - across * x;
        mm += along * along + across * across;
        ff += x * x + y * y;
    }
    let correlation = math::hypot(re, im) / math::sqrt(mm * ff);
    correlation.is_finite().then(|| (math::atan2(im, re), correlation))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vehicle on a winding path, and the measurements of a unit on it. The clock of the unit is `lag` ahead of the
    /// track's. Its x axis is at the angle `ahead` from the first horizontal axis for z up, and its rates are
    /// multiplied by `sign`.
    fn winding(lag: f64, ahead: f64, sign: f64) -> (Vec<f64>, Vec<Vec3>, Vec<Vec3>, Track) {
        let turn = |t: f64| 0.3 * (0.2 * t).sin() + 0.1 * (0.53 * t).sin();
        let course = |t: f64| 1.5 * (1.0 - (0.2 * t).cos()) + 0.1 / 0.53 * (1.0 - (0.53 * t).cos());
        let speed = |t: f64| 8.0 + 3.0 * (0.11 * t).sin();
        let t: Vec<f64> = (0..30_000).map(|k| 0.01 * f64::from(k)).collect();
        let force = t.iter().map(|&t| {
            let (along, across) = (0.33 * (0.11 * t).cos(), speed(t) * turn(t));
            // With z up, x is the first axis, and the second axis, to the right of it, is minus the sensor's y.
            let (x, right) = (
                along * ahead.cos() - across * ahead.sin(),
                along * ahead.sin() + across * ahead.cos(),
            );
            [x, -right, 9.8]
        });
        let rate = t.iter().map(|&t| [0.0, 0.0, -sign * turn(t)]);
        let stamps: Vec<f64> = (2..295).map(f64::from).collect();
        let velocity = stamps.iter().map(|&s| {
            let t = s - lag;
            [speed(t) * course(t).cos(), speed(t) * course(t).sin(), 0.0]
        });
        let track = Track {
            velocity: velocity.collect(),
            position: vec![[0.0; 3]; stamps.len()],
            t: stamps,
            ..Track::default()
        };
        (t.clone(), force.collect(), rate.collect(), track)
    }

    fn pair(lag: f64, ahead: f64, sign: f64) -> Pair {
        let (t, force, rate, track) = winding(lag, ahead, sign);
        Pair::of(&t, &force, &rate, [0.0, 0.0, 9.8], (2, false), &track).unwrap()
    }

    #[test]
    fn turns_agree_and_the_lag_is_found() {
        let p = pair(0.3, 0.0, 1.0);
        // Steps of 20 ms; the samples hold for 10 ms.
        assert!((p.lag - 0.3).abs() < 0.021, "{p:?}");
        assert!((p.slope - 1.0).abs() < 0.01 && p.correlation > 0.999, "{p:?}");
        let (first, last) = p.lags.unwrap();
        assert!((first - last).abs() < 0.041, "one clock: {p:?}");
    }

    #[test]
    fn a_vehicle_that_slips_has_sideways_changes_that_its_unit_does_not_explain() {
        // Both are in steps of 20 ms: at 10 m/s, a turn of 0.4 rad/s changes by less than 0.1 m/s within them.
        assert!(pair(0.0, 0.5, 1.0).slip < 0.1 && pair(0.3, 0.0, -1.0).slip < 0.1);
        let (t, force, rate, mut track) = winding(0.0, 0.0, 1.0);
        for (t, v) in track.t.iter().zip(&mut track.velocity) {
            let (sin, cos) = (0.3 * (0.9 * t).sin()).sin_cos();
            *v = [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1], v[2]];
        }
        let slipping = Pair::of(&t, &force, &rate, [0.0, 0.0, 9.8], (2, false), &track).unwrap();
        // 8 m/s × 0.3 × 0.9 /s × 0.7 for a sine is 1.5 m/s; half of its values are below 0.7 of the amplitude.
        assert!((1.0..3.0).contains(&slipping.slip), "{slipping:?}");
    }

    #[test]
    fn clocks_that_drift_apart_are_seen_from_the_first_third_to_the_last() {
        let (t, force, rate, mut track) = winding(0.0, 0.0, 1.0);
        // 2 ms/s: 0.4 s between the middles of the thirds, which are 195 s apart.
        track.t.iter_mut().for_each(|t| *t *= 1.002);
        let p = Pair::of(&t, &force, &rate, [0.0, 0.0, 9.8], (2, false), &track).unwrap();
        let (first, last) = p.lags.unwrap();
        // Two steps of 20 ms, and the drift within a third.
        assert!((last - first - 0.39).abs() < 0.06, "{p:?}");
    }

    #[test]
    fn clocks_with_beginnings_of_their_own_are_brought_together() {
        let (t, _, rate, track) = winding(0.0, 0.0, 1.0);
        let begun: Vec<f64> = t.iter().map(|t| t + 261.9).collect();
        let lag = apart(&begun, &rate, [0.0, 0.0, 9.8], &track).unwrap();
        // Half a coarse step.
        assert!((lag + 261.9).abs() <= 0.125, "{lag}");
        let other: Vec<Vec3> = t.iter().map(|t| [0.0, 0.0, (1.7 * t).sin()]).collect();
        assert_eq!(apart(&begun, &other, [0.0, 0.0, 9.8], &track), None);
    }

    #[test]
    fn a_way_that_repeats_itself_tells_no_beginning() {
        // Round a block: a turn of 90 degrees in 5 s, once in 40 s.
        let turn = |t: f64| {
            if t.rem_euclid(40.0) < 5.0 {
                core::f64::consts::FRAC_PI_2 / 5.0
            } else {
                0.0
            }
        };
        let course = |t: f64| core::f64::consts::FRAC_PI_2 * ((t / 40.0).floor() + (t.rem_euclid(40.0) / 5.0).min(1.0));
        let t: Vec<f64> = (0..30_000).map(|k| 0.01 * f64::from(k)).collect();
        let rate: Vec<Vec3> = t.iter().map(|&t| [0.0, 0.0, -turn(t)]).collect();
        let stamps: Vec<f64> = (2..295).map(f64::from).collect();
        let track = Track {
            velocity: stamps
                .iter()
                .map(|&t| [5.0 * course(t).cos(), 5.0 * course(t).sin(), 0.0])
                .collect(),
            position: vec![[0.0; 3]; stamps.len()],
            t: stamps,
            ..Track::default()
        };
        assert_eq!(apart(&t, &rate, [0.0, 0.0, 9.8], &track), None);
    }

    #[test]
    fn a_nose_that_does_not_follow_the_way_leaves_the_length_of_the_force() {
        let (t, force, _, mut track) = winding(0.3, 0.0, 1.0);
        // Fixes four times a second, and a force with the same length as before, along an axis of any direction.
        let stamps: Vec<f64> = (8..1180).map(|k| 0.25 * f64::from(k)).collect();
        let speed = |t: f64| 8.0 + 3.0 * (0.11 * t).sin();
        let course = |t: f64| 1.5 * (1.0 - (0.2 * t).cos()) + 0.1 / 0.53 * (1.0 - (0.53 * t).cos());
        let at = |s: &f64| [speed(s - 0.3) * course(s - 0.3).cos(), speed(s - 0.3) * course(s - 0.3).sin(), 0.0];
        track.velocity = stamps.iter().map(at).collect();
        (track.t, track.is_reported) = (stamps, true);
        let lag = |force: &[Vec3], track: &Track| by_force(&t, force, 9.8, track);
        let turned: Vec<Vec3> = force.iter().map(|f| [0.0, norm(*f), 0.0]).collect();
        // A step of 20 ms, and half of a sample.
        assert!((lag(&turned, &track).unwrap() - 0.3).abs() < 0.026, "{:?}", lag(&turned, &track));
        // The vibration is much larger than the acceleration, and the clocks drift apart by 0.3 s from the first third
        // to the last.
        let shaken: Vec<Vec3> = turned
            .iter()
            .zip(&t)
            .map(|(f, t)| [0.0, f[1] + 3.0 * (1.7 * t).sin(), 0.0])
            .collect();
        assert_eq!(lag(&shaken, &track), None);
        track.t.iter_mut().for_each(|t| *t *= 1.0015);
        assert_eq!(lag(&turned, &track), None);
    }

    #[test]
    fn gyros_that_count_the_other_way_are_seen() {
        let p = pair(0.0, 0.0, -1.0);
        assert!((p.slope + 1.0).abs() < 0.01 && p.correlation < -0.999, "{p:?}");
    }

    #[test]
    fn the_axis_ahead_is_found() {
        for ahead in [0.0, 1.5, 3.0, -1.6] {
            let (angle, correlation) = pair(0.1, ahead, 1.0).forward.unwrap();
            // Means over a second of a winding path: within a degree.
            assert!((angle - ahead).abs() < 0.02 && correlation > 0.99, "{ahead} {angle} {correlation}");
        }
    }
}
