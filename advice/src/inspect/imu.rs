//! An inertial unit by its samples: its up axis, its rests, its vibration.

use super::log::Log;
use super::numbers::{Vec3, median, moments, norm, quantile, resolution};
use super::signal::Kind;
use super::size::GRAVITY;
use super::stance::Stances;
use super::standing::{Standing, TIMES};
use fusion_core::math;

/// The length of a window of the rest test \[s\].
const WINDOW: f64 = 1.0;
/// Gyros with a mean rate above `TURNING` at rest turn there, except if the mean of the whole log agrees with it within
/// `TURNING`. No bias is larger than `BIASED`: 5 deg/s is the 1σ per axis of consumer units at power-on \[rad/s\].
const TURNING: f64 = 0.1;
const BIASED: f64 = 0.35;
/// The limit between rest and motion if no speed is reported: this number of times the quietest windows.
const QUIET: f64 = 3.0;
/// The largest number of moving windows that look like rest, per window at rest, if vibration separates rest from
/// motion. Then hardly any window is between the two; slow motion has windows of every strength.
const VALLEY: f64 = 0.1;
/// Limits of rest accept at most this number of moving windows, per window at rest.
const LEAK: f64 = 0.02;
/// Windows that begin at any sample are shaken more than adjacent windows by this factor.
const SLIDING: f64 = 1.1;
/// A unit that turns faster for a twentieth of the time has far larger errors from gyro scale and axes than from noise
/// [rad/s].
const AGILE: f64 = 1.0;
/// No unit at rest is shaken more, not even by an idling engine \[m/s²\].
const SHAKEN: f64 = 1.0;
/// At rest the deviation of the rates is at most `QUIET` times this, and their mean over a second is within `UNSTEADY` of
/// the bias [rad/s].
const WAVERING: f64 = 0.05;
const UNSTEADY: f64 = 0.02;

/// Results from the samples.
#[derive(Clone, Debug)]
pub struct Imu {
    /// Mean specific force, at rest if it ever rests \[m/s²\].
    pub gravity: Vec3,
    /// The sensor axis that points up most, and whether its opposite points up.
    pub up: (usize, bool),
    /// The angle between that axis and the vertical \[rad\].
    pub tilt: f64,
    /// The readings at rest; `None` if it never rests.
    pub rest: Option<Rest>,
    /// How a standstill is separated from motion, if another source reports both.
    pub standing: Option<Standing>,
    /// Regular short rests of a foot.
    pub stances: Option<Stances>,
    /// The length of the angular rate, less the bias, that 95 % of the samples stay below \[rad/s\].
    pub turning: f64,
    /// For a unit that turns fast: the lengths of force and rate that all but one of a thousand samples stay below.
    pub agile: Option<(f64, f64)>,
    /// Strength \[T\] and dip \[rad\] of the magnetic field during the first rest.
    pub field: Option<(f64, f64)>,
}

/// Samples at rest.
#[derive(Clone, Debug)]
pub struct Rest {
    /// Its share of the log.
    pub share: f64,
    /// The start of the first rest of at least two windows, and its length \[s\].
    pub first: (f64, f64),
    /// The limits that the standard deviations of 95 % of the windows stay below \[m/s²\].
    pub accel_std: Vec3,
    /// The same limits for the rates \[rad/s\].
    pub gyro_std: Vec3,
    /// The limits of a rest test are this factor times the deviations above. It is the largest of a few factors that
    /// hardly any moving window passes, but all of the first rest has to pass.
    pub times: f64,
    /// The share of the windows in motion that pass these limits; NaN if it never moves.
    pub passing: f64,
    /// The mean rate: the bias of the gyros \[rad/s\].
    pub bias: Vec3,
    /// Noise densities from means of neighbouring seconds \[m/s²/√Hz\].
    pub accel_noise: f64,
    /// The noise density of the gyros \[rad/s/√Hz\].
    pub gyro_noise: f64,
}

struct Window {
    from: f64,
    force: [(f64, f64); 3],
    rate: [(f64, f64); 3],
    /// Whether another source reports that it stands, or moves.
    stands: Option<bool>,
}

impl Window {
    fn shaking(&self) -> (f64, f64) {
        (norm(self.force.map(|m| m.1)), norm(self.rate.map(|m| m.1)))
    }

    /// How much faster it turns than a unit with this bias at rest \[rad/s\].
    fn turns(&self, bias: Vec3) -> f64 {
        norm([0, 1, 2].map(|i| self.rate[i].0 - bias[i]))
    }
}

impl Imu {
    /// From a log with specific force and angular rate; `stands` returns whether the vehicle stands at a time.
    pub(super) fn of(log: &Log, stands: &dyn Fn(f64) -> Option<bool>) -> Option<Self> {
        let (force, rate) = (log.values(Kind::SpecificForce)?, log.values(Kind::AngularRate)?);
        let windows = windows(log.stamps(), &force, &rate, stands);
        let resting = resting(&windows);
        let rest = rest(
            &windows,
            &resting,
            [&force, &rate].map(|v| [0, 1, 2].map(|i| resolution(v.iter().map(|v| v[i])))),
        );
        let chosen: Vec<&Window> = windows
            .iter()
            .zip(&resting)
            .filter(|(_, r)| **r || rest.is_none())
            .map(|(w, _)| w)
            .collect();
        let gravity = [0, 1, 2].map(|i| median(chosen.iter().map(|w| w.force[i].0)));
        if gravity.iter().any(|g| !g.is_finite()) {
            return None;
        }
        let up = [0, 1, 2]
            .into_iter()
            .max_by(|a, b| gravity[*a].abs().total_cmp(&gravity[*b].abs()))?;
        let field = rest.as_ref().and_then(|r| field(log, r.first, gravity));
        let standing = rest
            .as_ref()
            .filter(|_| is_told(&windows))
            .and_then(|r| Standing::of(log.stamps(), [&force, &rate], [r.accel_std, r.gyro_std], stands));
        let bias = rest.as_ref().map_or([0.0; 3], |r| r.bias);
        let lengths = |v: &[Vec3], less: Vec3, share| quantile(v.iter().map(|v| norm([0, 1, 2].map(|i| v[i] - less[i]))), share);
        let turning = lengths(&rate, bias, 0.95);
        let agile = (turning > AGILE).then(|| (lengths(&force, [0.0; 3], 0.999), lengths(&rate, bias, 0.999)));
        Some(Self {
            field,
            standing,
            turning,
            agile,
            stances: Stances::of(
                log.stamps(),
                &force,
                &rate,
                // Without a rest, the mean also contains the swings.
                rest.as_ref().map_or(GRAVITY, |_| norm(gravity)),
                rest.as_ref().map(|r| r.bias),
            ),
            gravity,
            up: (up, gravity[up] < 0.0),
            tilt: math::acos((gravity[up].abs() / norm(gravity)).min(1.0)),
            rest,
        })
    }
}

fn windows(t: &[f64], force: &[Vec3], rate: &[Vec3], stands: &dyn Fn(f64) -> Option<bool>) -> Vec<Window> {
    let (mut all, mut begin) = (Vec::new(), 0);
    for end in 0..t.len() {
        let elapsed = t[end] - t[begin];
        if (0.0..WINDOW).contains(&elapsed) {
            continue;
        }
        // Ignore a window with a gap, or one across a clock that went back.
        if (WINDOW..1.5 * WINDOW).contains(&elapsed) && end - begin >= 4 {
            let axis = |v: &[Vec3], i: usize| moments(v[begin..end].iter().map(|v| v[i]));
            all.push(Window {
                from: t[begin],
                force: [0, 1, 2].map(|i| axis(force, i)),
                rate: [0, 1, 2].map(|i| axis(rate, i)),
                stands: [0.0, 0.5, 1.0]
                    .map(|share| stands(t[begin] + share * WINDOW))
                    .into_iter()
                    .reduce(|a, b| Some(a? && b?))
                    .flatten(),
            });
        }
        begin = end;
    }
    all
}

/// Whether another source reports on most windows, and also reports rest.
fn is_told(windows: &[Window]) -> bool {
    let has_rest = windows.iter().any(|w| w.stands == Some(true));
    has_rest && windows.iter().filter(|w| w.stands.is_some()).count() * 2 > windows.len()
}

/// The windows at rest. They come from the reported speed if there is one, without windows that turn, or are shaken far
/// more than most of them, as in a hover or a take-off. Without a speed, they are the quietest windows in which no
/// other source reports motion.
fn resting(windows: &[Window]) -> Vec<bool> {
    if is_told(windows) {
        let told = || windows.iter().filter(|w| w.stands == Some(true));
        let usual = |of: fn(&Window) -> f64| median(told().map(of));
        let (force, rate) = (usual(|w| w.shaking().0), usual(|w| w.shaking().1));
        let bias = [0, 1, 2].map(|i| median(told().map(|w| w.rate[i].0)));
        let limits = ((QUIET * force).min(SHAKEN), QUIET * rate.min(WAVERING));
        let is_usual = |w: &Window| w.shaking().0 <= limits.0 && w.shaking().1 <= limits.1 && w.turns(bias) < UNSTEADY;
        return windows.iter().map(|w| w.stands == Some(true) && is_usual(w)).collect();
    }
    let quiet = |of: fn(&Window) -> f64| quantile(windows.iter().map(of), 0.05);
    let (force, rate) = (quiet(|w| w.shaking().0), quiet(|w| w.shaking().1));
    let bias = [0, 1, 2].map(|i| median(windows.iter().filter(|w| w.shaking().1 <= QUIET * rate).map(|w| w.rate[i].0)));
    // A vehicle that turns one way later turns the other way: the mean of a log is the mean of its bias.
    let mean = [0, 1, 2].map(|i| moments(windows.iter().map(|w| w.rate[i].0)).0);
    let is_lasting = norm([0, 1, 2].map(|i| bias[i] - mean[i])) < TURNING && norm(bias) < BIASED;
    let is_bias = norm(bias) < TURNING || is_lasting;
    let is_steady = |w: &Window| w.turns(bias) < UNSTEADY && is_bias;
    let limit = (QUIET * force).min(SHAKEN);
    let is_quiet = |w: &Window| w.shaking().0 <= limit && w.shaking().1 <= QUIET * rate.min(WAVERING) && is_steady(w);
    windows.iter().map(|w| w.stands != Some(false) && is_quiet(w)).collect()
}

/// Deviations that are positive, so that samples can be below them. An axis that is constant at rest may still change
/// by half of `step`, the distance of two neighbouring numbers. One that is constant throughout gives no information
/// and takes the largest of the others.
fn positive(deviations: Vec3, step: Vec3) -> Vec3 {
    let own = [0, 1, 2].map(|i| if deviations[i] > 0.0 { deviations[i] } else { 0.5 * step[i] });
    let largest = own.into_iter().fold(f64::NAN, f64::max);
    own.map(|deviation| if deviation > 0.0 { deviation } else { largest })
}

/// `steps` are the resolutions of force and rate.
fn rest(windows: &[Window], resting: &[bool], steps: [Vec3; 2]) -> Option<Rest> {
    let at_rest = || windows.iter().zip(resting).filter(|(_, r)| **r).map(|(w, _)| w);
    let moving = || windows.iter().zip(resting).filter(|(_, r)| !**r).map(|(w, _)| w);
    let count = at_rest().count();
    let first = longest_first(windows, resting)?;
    let high = |of: &dyn Fn(&Window) -> f64| quantile(at_rest().map(of), 0.95);
    let (accel_std, gyro_std) = (
        positive([0, 1, 2].map(|i| high(&|w| w.force[i].1)), steps[0]),
        positive([0, 1, 2].map(|i| high(&|w| w.rate[i].1)), steps[1]),
    );
    // The number of moving windows that pass limits of `times` the deviations.
    let is_below = |of: &[(f64, f64); 3], limits: Vec3, times: f64| (0..3).all(|i| of[i].1 <= times * limits[i]);
    let passes = |w: &Window, times: f64| is_below(&w.force, accel_std, times) && is_below(&w.rate, gyro_std, times);
    let passing = |times: f64| moving().filter(|w| passes(w, times)).count() as f64;
    // A window next to a window at rest is partly at rest, so it does not count as motion.
    let is_beside = |k: usize| resting[k.saturating_sub(1)..(k + 2).min(resting.len())].contains(&true);
    let away = (0..windows.len())
        .filter(|k| !is_beside(*k) && passes(&windows[*k], TIMES[0]))
        .count();
    if !is_told(windows) && away as f64 > VALLEY * count as f64 {
        return None;
    }
    let is_tight = |times: &f64| passing(*times) <= LEAK * count as f64;
    let tight = TIMES.into_iter().find(is_tight).unwrap_or(TIMES[TIMES.len() - 1]);
    // All of the first rest has to pass: a start waits for a rest without a break, and 95 % limits on six axes break it
    // often.
    let is_first = |w: &&Window| (first.0..first.0 + first.1).contains(&w.from);
    let largest = |w: &Window| {
        let ratios = (0..3).map(|i| (w.force[i].1 / accel_std[i]).max(w.rate[i].1 / gyro_std[i]));
        ratios.fold(0.0, f64::max)
    };
    let needed = at_rest().filter(is_first).map(largest).fold(0.0, f64::max);
    let times = tight.max(math::ceil(needed * 100.0 * SLIDING) / 100.0).min(TIMES[0]);
    // The Allan deviation of neighbouring means over a second is the density.
    let density = |of: &dyn Fn(&Window) -> Vec3| {
        let pairs = windows.windows(2).zip(resting.windows(2)).filter(|(_, r)| r[0] && r[1]);
        let squares: Vec<f64> = pairs
            .map(|(w, _)| 0.5 * (0..3).map(|i| math::powi(of(&w[1])[i] - of(&w[0])[i], 2)).sum::<f64>() / 3.0)
            .collect();
        // The median of a square of a normal variable is 0.455 of its mean; of three, 0.789.
        math::sqrt(median(squares) / 0.789) * math::sqrt(WINDOW)
    };
    Some(Rest {
        share: count as f64 / windows.len() as f64,
        first,
        accel_std,
        gyro_std,
        times,
        passing: passing(times) / moving().count() as f64,
        bias: [0, 1, 2].map(|i| median(at_rest().map(|w| w.rate[i].0))),
        accel_noise: density(&|w| w.force.map(|m| m.0)),
        gyro_noise: density(&|w| w.rate.map(|m| m.0)),
    })
}

/// The first rest of at least two windows.
fn longest_first(windows: &[Window], resting: &[bool]) -> Option<(f64, f64)> {
    let begin = (1..resting.len()).find(|k| resting[*k] && resting[k - 1])? - 1;
    let end = (begin..resting.len()).find(|k| !resting[*k]).unwrap_or(resting.len());
    Some((windows[begin].from, windows[end - 1].from + WINDOW - windows[begin].from))
}

/// Strength and dip of the field from `begin` on.
fn field(log: &Log, (begin, duration): (f64, f64), gravity: Vec3) -> Option<(f64, f64)> {
    let values = log.values(Kind::MagneticField)?;
    let during = log.stamps().iter().map(|t| (begin..begin + duration).contains(t));
    let chosen: Vec<&Vec3> = values.iter().zip(during).filter(|(_, is)| *is).map(|(v, _)| v).collect();
    let mean = [0, 1, 2].map(|i| median(chosen.iter().map(|v| v[i])));
    let down: f64 = (0..3).map(|i| -mean[i] * gravity[i]).sum::<f64>() / norm(gravity);
    Some((norm(mean), math::asin(down / norm(mean)))).filter(|(s, _)| s.is_finite() && *s > 0.0)
}
