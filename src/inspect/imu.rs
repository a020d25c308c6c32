//! An inertial unit by its samples: which way is up, when it rests, how much it is shaken.

use super::log::Log;
use super::numbers::{Vec3, median, moments, norm, quantile};
use super::signal::Kind;

/// How long a window of the rest test is \[s\].
const WINDOW: f64 = 1.0;
/// Gyros whose mean rate is larger turn: 5 deg/s is the turn-on bias of consumer units \[rad/s\].
const TURNING: f64 = 0.1;
/// What separates rest from motion where nobody tells the speed: this many times the quietest windows.
const QUIET: f64 = 3.0;

/// What the samples say.
#[derive(Clone, Debug)]
pub struct Imu {
    /// Mean specific force, at rest where there is rest \[m/s²\].
    pub gravity: Vec3,
    /// The sensor axis that points up most, and whether its opposite does.
    pub up: (usize, bool),
    /// The angle between that axis and the vertical \[rad\].
    pub tilt: f64,
    /// What it reads at rest; `None` if it never rests.
    pub rest: Option<Rest>,
    /// Strength \[T\] and dip \[rad\] of the magnetic field during the first rest.
    pub field: Option<(f64, f64)>,
}

/// Samples at rest.
#[derive(Clone, Debug)]
pub struct Rest {
    /// Its share of the log.
    pub share: f64,
    /// When the first one that lasts begins, and how long it lasts \[s\].
    pub first: (f64, f64),
    /// 95 % of the windows have standard deviations below \[m/s²\].
    pub accel_std: Vec3,
    /// The same of the rates \[rad/s\].
    pub gyro_std: Vec3,
    /// 95 % of the windows in motion are above, norms \[m/s²\], \[rad/s\]; NaN if it never moves.
    pub motion: (f64, f64),
    /// The mean rate: the bias of the gyros \[rad/s\].
    pub bias: Vec3,
    /// Noise densities by neighbouring means of a second \[m/s²/√Hz\].
    pub accel_noise: f64,
    /// The same of the gyros \[rad/s/√Hz\].
    pub gyro_noise: f64,
}

struct Window {
    from: f64,
    force: [(f64, f64); 3],
    rate: [(f64, f64); 3],
    /// The speed that somebody else reports.
    speed: Option<f64>,
}

impl Window {
    fn shaking(&self) -> (f64, f64) {
        (norm(self.force.map(|m| m.1)), norm(self.rate.map(|m| m.1)))
    }
}

impl Imu {
    /// Of a log with specific force and angular rate; `speed` says how fast the vehicle is at a time.
    pub(super) fn of(log: &Log, speed: &dyn Fn(f64) -> Option<f64>) -> Option<Self> {
        let (force, rate) = (log.values(Kind::SpecificForce)?, log.values(Kind::AngularRate)?);
        let windows = windows(log.stamps(), &force, &rate, speed);
        let resting = resting(&windows);
        let rest = rest(&windows, &resting);
        let chosen: Vec<&Window> = windows
            .iter()
            .zip(&resting)
            .filter(|(_, r)| **r || rest.is_none())
            .map(|(w, _)| w)
            .collect();
        let gravity = [0, 1, 2].map(|i| median(chosen.iter().map(|w| w.force[i].0)));
        let up = [0, 1, 2]
            .into_iter()
            .max_by(|a, b| gravity[*a].abs().total_cmp(&gravity[*b].abs()))?;
        let field = rest.as_ref().and_then(|r| field(log, r.first, gravity));
        Some(Self {
            field,
            gravity,
            up: (up, gravity[up] < 0.0),
            tilt: (gravity[up].abs() / norm(gravity)).min(1.0).acos(),
            rest,
        })
    }
}

fn windows(t: &[f64], force: &[Vec3], rate: &[Vec3], speed: &dyn Fn(f64) -> Option<f64>) -> Vec<Window> {
    let (mut all, mut begin) = (Vec::new(), 0);
    for end in 0..t.len() {
        let elapsed = t[end] - t[begin];
        if (0.0..WINDOW).contains(&elapsed) {
            continue;
        }
        // A window with a gap in it, or one across a clock that went back, says nothing.
        if (WINDOW..1.5 * WINDOW).contains(&elapsed) && end - begin >= 4 {
            let axis = |v: &[Vec3], i: usize| moments(v[begin..end].iter().map(|v| v[i]));
            all.push(Window {
                from: t[begin],
                force: [0, 1, 2].map(|i| axis(force, i)),
                rate: [0, 1, 2].map(|i| axis(rate, i)),
                speed: speed(t[begin] + 0.5 * WINDOW),
            });
        }
        begin = end;
    }
    all
}

/// Which windows are at rest: by the speed where somebody reports it, else the quietest ones.
fn resting(windows: &[Window]) -> Vec<bool> {
    /// Receivers at rest report less \[m/s\].
    const SLOW: f64 = 0.2;
    let is_told = windows.iter().filter(|w| w.speed.is_some()).count() * 2 > windows.len();
    if is_told {
        return windows.iter().map(|w| w.speed.is_some_and(|s| s < SLOW)).collect();
    }
    let quiet = |of: fn(&Window) -> f64| quantile(windows.iter().map(of), 0.05);
    let (force, rate) = (quiet(|w| w.shaking().0), quiet(|w| w.shaking().1));
    let bias = [0, 1, 2].map(|i| median(windows.iter().filter(|w| w.shaking().1 <= QUIET * rate).map(|w| w.rate[i].0)));
    // A mean of a second at rest moves by less than 0.02 rad/s, 1 deg/s.
    let is_steady = |w: &Window| norm([0, 1, 2].map(|i| w.rate[i].0 - bias[i])) < 0.02 && norm(bias) < TURNING;
    let is_quiet = |w: &Window| w.shaking().0 <= QUIET * force && w.shaking().1 <= QUIET * rate.min(0.05) && is_steady(w);
    windows.iter().map(is_quiet).collect()
}

fn rest(windows: &[Window], resting: &[bool]) -> Option<Rest> {
    let at_rest = || windows.iter().zip(resting).filter(|(_, r)| **r).map(|(w, _)| w);
    let moving = || windows.iter().zip(resting).filter(|(_, r)| !**r).map(|(w, _)| w);
    let count = at_rest().count();
    let first = longest_first(windows, resting)?;
    let high = |of: &dyn Fn(&Window) -> f64| quantile(at_rest().map(of), 0.95);
    let low = |of: &dyn Fn(&Window) -> f64| quantile(moving().map(of), 0.05);
    // The Allan deviation of neighbouring means is the density, over a second.
    let density = |of: &dyn Fn(&Window) -> Vec3| {
        let pairs = windows.windows(2).zip(resting.windows(2)).filter(|(_, r)| r[0] && r[1]);
        let squares: Vec<f64> = pairs
            .map(|(w, _)| 0.5 * (0..3).map(|i| (of(&w[1])[i] - of(&w[0])[i]).powi(2)).sum::<f64>() / 3.0)
            .collect();
        // The median of a square of a normal variable is 0.455 of its mean; of three, 0.789.
        (median(squares) / 0.789).sqrt() * WINDOW.sqrt()
    };
    Some(Rest {
        share: count as f64 / windows.len() as f64,
        first,
        accel_std: [0, 1, 2].map(|i| high(&|w| w.force[i].1)),
        gyro_std: [0, 1, 2].map(|i| high(&|w| w.rate[i].1)),
        motion: (low(&|w| w.shaking().0), low(&|w| w.shaking().1)),
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
    Some((norm(mean), (down / norm(mean)).asin())).filter(|(s, _)| s.is_finite() && *s > 0.0)
}
