//! The track of a log: metres north and east, velocity, scatter.

use super::log::Log;
use super::numbers::{Vec3, median, moments, quantile};
use super::signal::{Kind, factor};
use fusion_core::math;

/// Mean radius of the Earth \[m\]: accurate enough for a track.
const RADIUS: f64 = 6.371e6;

/// The 1σ that a receiver reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claim {
    /// Its median along north, east, down.
    pub median: Vec3,
    /// The ratio of the horizontal scatter about the line between neighbours to the reported 1σ. Errors that neighbours
    /// share are not visible. So the errors are at least this number of times as large as reported.
    pub times: f64,
}

/// Positions over time.
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Stamps \[s\], increasing.
    pub t: Vec<f64>,
    /// Metres north, east, down from the first position.
    pub position: Vec<Vec3>,
    /// Velocity north, east, down, as reported or by differences \[m/s\].
    pub velocity: Vec<Vec3>,
    /// Whether the velocity is reported.
    pub is_reported: bool,
    /// Latitude, longitude \[rad\], height \[m\] of the first position, if it is geodetic.
    pub origin: Option<Vec3>,
    /// The length of the path \[m\], by steps of a second.
    pub way: f64,
    /// The distance of a fix from the line between its neighbours, 1σ of one fix, horizontal \[m\].
    pub scatter: f64,
    /// The same for a reported velocity \[m/s\].
    pub velocity_scatter: f64,
    /// The distance \[m\] by which the fixes jump away and come back, if they do so often: two tracks in one file.
    pub apart: Option<f64>,
    /// Median of the reported 1σ, horizontal \[m\].
    pub claimed: Option<f64>,
    /// The reported 1σ of the position \[m\] and of the velocity \[m/s\], if every row has it.
    pub claims: [Option<Claim>; 2],
    /// Slope of the reported velocity over the differences of position, north, east, down; NaN down if it has no
    /// vertical part.
    pub agreement: Option<Vec3>,
}

impl Track {
    /// From a log with positions. Rows that repeat the row before, go back in time or hold no numbers are ignored.
    /// `other` is the log with its velocities, if they are in a separate file.
    pub(super) fn of(log: &Log, other: Option<&Log>) -> Option<Self> {
        let kind = [Kind::Geodetic, Kind::Local].into_iter().find(|k| log.has(*k))?;
        let values = log.values(kind)?;
        let reported = log.values(Kind::Velocity).or_else(|| nearest(other?, Kind::Velocity, log.stamps()));
        let own = |sigma, of| log.values(sigma).filter(|_| covers(log, sigma, of));
        let sigmas = [
            own(Kind::PositionSigma, kind),
            match other.filter(|_| !log.has(Kind::Velocity)) {
                Some(other) if covers(other, Kind::VelocitySigma, Kind::Velocity) => nearest(other, Kind::VelocitySigma, log.stamps()),
                Some(_) => None,
                None => own(Kind::VelocitySigma, Kind::Velocity),
            },
        ];
        let mut claims = [Vec::new(), Vec::new()];
        let is_geodetic = kind == Kind::Geodetic;
        let has_height = log.signal(kind)?.columns.len() > 2;
        // The height has its own unit.
        let height = |row: usize| {
            if has_height {
                log.signal(kind).map_or(0.0, |s| factor(s.of_height) * s.raw(&log.table, row)[2])
            } else {
                0.0
            }
        };
        let mut track = Self::default();
        let (mut origin, mut last) = (None::<Vec3>, None::<Vec3>);
        for (row, (t, v)) in log.stamps().iter().zip(&values).enumerate() {
            let is_new = track.t.last().is_none_or(|l| t > l) && last.is_none_or(|l| l[..2] != v[..2] || reported.is_some());
            let is_fix = v.iter().all(|x| x.is_finite()) && v[..2] != [0.0, 0.0];
            if !(is_new && is_fix) {
                continue;
            }
            last = Some(*v);
            let at = if is_geodetic { [v[0], v[1], height(row)] } else { *v };
            let o = *origin.get_or_insert(at);
            track.t.push(*t);
            track.position.push(if is_geodetic {
                [(at[0] - o[0]) * RADIUS, (at[1] - o[1]) * RADIUS * math::cos(o[0]), o[2] - at[2]]
            } else {
                at
            });
            if let Some(velocity) = &reported {
                track.velocity.push(velocity[row]);
            }
            for (claims, sigmas) in claims.iter_mut().zip(&sigmas) {
                claims.extend(sigmas.as_ref().map(|sigmas| sigmas[row]));
            }
        }
        track.origin = origin.filter(|_| is_geodetic);
        track.is_reported = reported.is_some();
        let differences = track.differences();
        if track.is_reported {
            let mut agreement = agreement(&differences, &track.velocity);
            if other.filter(|_| !log.has(Kind::Velocity)).unwrap_or(log).has_flat_velocity() {
                agreement[2] = f64::NAN;
            }
            track.agreement = Some(agreement);
        } else {
            track.velocity = differences;
        }
        let [of_position, of_velocity] = claims;
        track.claims = [
            track.claim(&track.position, &of_position),
            track.claim(&track.velocity, &of_velocity).filter(|_| track.is_reported),
        ];
        track.measure();
        track.part();
        track.claimed = log
            .values(Kind::PositionSigma)
            .map(|s| median(s.iter().map(|s| 0.5 * (s[0] + s[1]))))
            .filter(|claimed| claimed.is_finite());
        (track.t.len() > 2).then_some(track)
    }

    /// Velocity from positions at least a second apart.
    fn differences(&self) -> Vec<Vec3> {
        /// The velocity changes between fixes that are further apart than `LONGEST` [s], or than `USUAL` usual
        /// intervals.
        const LONGEST: f64 = 10.0;
        const USUAL: f64 = 3.5;
        let longest = LONGEST.max(USUAL / self.rate());
        let (mut from, mut all) = (0, Vec::with_capacity(self.t.len()));
        for k in 0..self.t.len() {
            while from + 1 < k && self.t[k] - self.t[from + 1] >= 1.0 {
                from += 1;
            }
            let dt = self.t[k] - self.t[from];
            let v = [0, 1, 2].map(|i| (self.position[k][i] - self.position[from][i]) / dt);
            all.push(if dt > 0.5 && dt < longest { v } else { [f64::NAN; 3] });
        }
        all
    }

    fn measure(&mut self) {
        let mut from = 0;
        for k in 1..self.t.len() {
            if self.t[k] - self.t[from] >= 1.0 {
                let step = |i: usize| self.position[k][i] - self.position[from][i];
                self.way += math::hypot(step(0), step(1));
                from = k;
            }
        }
        // The median of these lengths is 1.177 σ.
        self.scatter = median(self.off(&self.position, |_| 1.0)) / 1.177;
        self.velocity_scatter = by_quarter(self.off(&self.velocity, |_| 1.0));
    }

    /// The reported 1σ of values, if each value has one.
    fn claim(&self, values: &[Vec3], sigmas: &[Vec3]) -> Option<Claim> {
        let is_sound = |(value, sigma): (&Vec3, &Vec3)| value.iter().any(|v| !v.is_finite()) || sigma.iter().all(|s| *s >= 0.0);
        let median = [0, 1, 2].map(|axis| median(sigmas.iter().map(|s| s[axis])));
        let is_whole = !sigmas.is_empty() && values.iter().zip(sigmas).all(is_sound);
        (is_whole && median[..2].iter().all(|m| *m > 0.0)).then(|| Claim {
            median,
            times: by_quarter(self.off(values, |k| 0.5 * (sigmas[k][0] + sigmas[k][1]))),
        })
    }

    /// Finds two tracks in one: fixes that jump away and come back. Path and scatter then use only the steps without a
    /// jump.
    fn part(&mut self) {
        /// A jump is longer than `JUMP` usual steps, and than `LEAST` [m].
        const JUMP: f64 = 10.0;
        const LEAST: f64 = 1.0;
        /// A fix comes back within this number of fixes.
        const BACK: usize = 20;
        /// At least the share `OFTEN` of all fixes comes back, and the share `MOST` of the jumps.
        const OFTEN: f64 = 0.05;
        const MOST: f64 = 0.75;
        let far = |a: usize, b: usize| math::hypot(self.position[a][0] - self.position[b][0], self.position[a][1] - self.position[b][1]);
        let steps: Vec<f64> = (1..self.t.len()).map(|k| far(k - 1, k)).collect();
        let jump = (JUMP * median(steps.iter().copied())).max(LEAST);
        let jumps: Vec<usize> = (1..self.t.len()).filter(|k| steps[k - 1] > jump).collect();
        let comes_back = |k: &&usize| (**k + 1..self.t.len().min(**k + 1 + BACK)).any(|other| far(other, **k - 1) < jump);
        let returns = jumps.iter().filter(comes_back).count() as f64;
        if returns < OFTEN * self.t.len() as f64 || returns < MOST * jumps.len() as f64 {
            return;
        }
        self.apart = Some(quantile(jumps.iter().map(|k| steps[k - 1]), 1.0));
        let usual = (JUMP * quantile(steps.iter().copied(), 0.25)).max(LEAST);
        let (mut way, mut jumped) = (0.0, vec![false; self.t.len()]);
        for (k, step) in steps.iter().enumerate() {
            jumped[k + 1] = *step > usual;
            way += if jumped[k + 1] { 0.0 } else { *step };
        }
        self.way = way;
        let jumped = self.velocity.iter_mut().zip(jumped).filter(|(_, jumped)| *jumped);
        jumped.for_each(|(v, _)| *v = [f64::NAN; 3]);
        self.scatter = by_quarter(self.off(&self.position, |_| 1.0));
    }

    /// The horizontal distance of values from the line between their neighbours, scaled to the 1σ of one value, in
    /// units of `unit`.
    fn off(&self, values: &[Vec3], unit: impl Fn(usize) -> f64) -> Vec<f64> {
        // For a, b, c with equal intervals, b - (a + c)/2 has the variance 1.5 σ² for white errors.
        let middle = values.windows(3).zip(self.t.windows(3)).enumerate().filter_map(|(k, (p, t))| {
            let even = (t[2] - t[1]) / (t[1] - t[0]);
            let off = |i: usize| p[1][i] - 0.5 * (p[0][i] + p[2][i]);
            (0.8..1.25)
                .contains(&even)
                .then(|| math::hypot(off(0), off(1)) / math::sqrt(1.5_f64) / unit(k + 1))
        });
        middle.collect()
    }

    /// The speed at a time, from the row before it, if that is recent \[m/s\]. The vertical speed counts if it is
    /// larger than its noise, as in a lift or a climb.
    pub(super) fn speed(&self, t: f64) -> Option<f64> {
        let k = self.t.partition_point(|s| *s <= t).checked_sub(1)?;
        let v = self.velocity[k];
        let noise = 5.0 * self.velocity_scatter;
        let vertical = if v[2].abs() > noise.max(0.5) { v[2] } else { 0.0 };
        (t - self.t[k] < 2.0)
            .then(|| math::hypot(math::hypot(v[0], v[1]), vertical))
            .filter(|s| s.is_finite())
    }

    /// The horizontal speed of the line through the fixes around a time \[m/s\], if it is no chance and no slow error of
    /// fixes at rest.
    pub(super) fn moves(&self, t: f64) -> Option<f64> {
        /// The fixes before and after the time that count [s].
        const REACH: f64 = 5.0;
        /// The 1σ of a slow error [m], and its correlation time [s]: a single-point receiver beside buildings.
        const SLOW: (f64, f64) = (1.5, 60.0);
        /// The probability of such a speed at rest, by chance. A long log has some thousands of such times.
        const CHANCE: f64 = 1e-6;
        let from = self.t.partition_point(|s| *s < t - REACH);
        let to = self.t.partition_point(|s| *s <= t + REACH);
        let (times, places) = (self.t.get(from..to)?, self.position.get(from..to)?);
        if times.len() < 3 || times[times.len() - 1] - times[0] < REACH {
            return None;
        }
        let middle = moments(times.iter().copied()).0;
        let spread: f64 = times.iter().map(|s| math::powi(s - middle, 2)).sum();
        let slope = |axis: usize| times.iter().zip(places).map(|(s, p)| (s - middle) * p[axis]).sum::<f64>() / spread;
        let speed = math::hypot(slope(0), slope(1));
        // A Gauss-Markov error changes by σ √(2 Δt / τ).
        let slow = SLOW.0 * math::sqrt(2.0 / (2.0 * REACH * SLOW.1));
        let variance = self.scatter * self.scatter / spread + slow * slow;
        // Two normal components of one variance are longer than this with that probability.
        (speed > math::sqrt(-2.0 * variance * math::ln(CHANCE))).then_some(speed)
    }

    /// The horizontal speed that 95 % of the rows stay below \[m/s\].
    #[must_use]
    pub fn top_speed(&self) -> f64 {
        let fast = quantile(self.velocity.iter().map(|v| math::hypot(v[0], v[1])), 0.95);
        let mean = || self.way / (self.t[self.t.len() - 1] - self.t[0]);
        // Fixes too far apart for differences: only the mean is known.
        if fast.is_nan() && self.t.len() > 1 { mean() } else { fast }
    }

    /// The speed above which the track counts as moving: half of the usual top speed \[m/s\].
    pub(super) fn slowest(&self) -> f64 {
        0.5 * self.top_speed()
    }

    /// The rows in motion: stamp, velocity north and east, and speed \[m/s\].
    pub(super) fn moving(&self) -> impl Iterator<Item = (f64, [f64; 2], f64)> {
        let slowest = self.slowest();
        let rows = self.t.iter().zip(&self.velocity);
        let speeds = rows.map(|(t, v)| (*t, [v[0], v[1]], math::hypot(v[0], v[1])));
        speeds.filter(move |(.., speed)| *speed > slowest && *speed > 0.0)
    }

    /// The correlation time of the velocity, from fixes and the next ones: the time after which its correlation is 1/e
    /// \[s\].
    pub(super) fn lasting(&self) -> Option<f64> {
        let usual = 1.0 / self.rate();
        let next = (1..self.t.len()).filter(|k| self.t[*k] - self.t[*k - 1] < 1.5 * usual);
        let sums = next.fold([0.0; 3], |[product, before, after], k| {
            let (a, b) = (self.velocity[k - 1], self.velocity[k]);
            let dot = |u: Vec3, v: Vec3| u[0] * v[0] + u[1] * v[1];
            if [a[0], a[1], b[0], b[1]].iter().all(|v| v.is_finite()) {
                [product + dot(a, b), before + dot(a, a), after + dot(b, b)]
            } else {
                [product, before, after]
            }
        });
        let alike = sums[0] / math::sqrt(sums[1] * sums[2]);
        (0.0..1.0).contains(&alike).then(|| -usual / math::ln(alike))
    }

    /// Fixes a second.
    #[must_use]
    pub fn rate(&self) -> f64 {
        1.0 / median(self.t.windows(2).map(|w| w[1] - w[0]))
    }
}

/// 1σ of a component, from the lengths of vectors of two equal normal components: a quarter is below
/// 0.759 σ. Changing accelerations affect the quarter less than the median.
fn by_quarter(lengths: Vec<f64>) -> f64 {
    quantile(lengths, 0.25) / 0.759
}

/// Returns true if the columns of a 1σ cover all axes of a quantity.
pub(super) fn covers(log: &Log, sigma: Kind, of: Kind) -> bool {
    let axes = |kind| log.signal(kind).map(|s| s.columns.len());
    axes(of).is_some() && axes(sigma) >= axes(of)
}

/// The values of a log at other stamps, from the nearest rows. NaN if the nearest row is further away than half of the
/// usual interval.
fn nearest(log: &Log, kind: Kind, at: &[f64]) -> Option<Vec<Vec3>> {
    let (t, values) = (log.stamps(), log.values(kind)?);
    let reach = 0.5 / log.rate();
    let nearest = |at: &f64| {
        let after = t.partition_point(|t| t < at);
        let rows = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|k| *k < t.len());
        let off = |k: &usize| (t[*k] - at).abs();
        let row = rows.min_by(|a, b| off(a).total_cmp(&off(b))).filter(|k| off(k) <= reach);
        row.map_or([f64::NAN; 3], |k| values[k])
    };
    t.is_sorted().then(|| at.iter().map(nearest).collect())
}

/// The speed of wheels or of a log.
#[derive(Debug)]
pub(super) struct Odometer {
    t: Vec<f64>,
    speed: Vec<f64>,
}

impl Odometer {
    /// From a log with a speed, or with a body velocity, whose horizontal length is used.
    pub(super) fn of(log: &Log, kind: Kind) -> Option<Self> {
        let speed = log.values(kind)?.iter().map(|v| math::hypot(v[0], v[1])).collect();
        let t = log.stamps().to_vec();
        let is_sound = t.len() > 2 && t.is_sorted();
        is_sound.then(|| Self::new(t, speed))
    }

    /// From speeds \[m/s\] at sorted stamps.
    pub(super) const fn new(t: Vec<f64>, speed: Vec<f64>) -> Self {
        Self { t, speed }
    }

    /// The speed at a time, from the row before.
    pub(super) fn at(&self, t: f64) -> Option<f64> {
        let k = self.t.partition_point(|s| *s <= t).checked_sub(1)?;
        Some(self.speed[k]).filter(|speed| t - self.t[k] < 2.0 && speed.is_finite())
    }

    /// Whether it stands at a time, from the row before.
    pub(super) fn stands(&self, t: f64) -> Option<bool> {
        /// Wheels at rest report at most one step of the encoder [m/s].
        const STILL: f64 = 0.02;
        self.at(t).map(|speed| speed < STILL)
    }
}

/// Slopes of one velocity over the other, axis by axis, while moving.
fn agreement(by_position: &[Vec3], reported: &[Vec3]) -> Vec3 {
    [0, 1, 2].map(|i| {
        let pairs = by_position
            .iter()
            .zip(reported)
            .filter(|(a, b)| a[i].is_finite() && b[i].is_finite());
        let (ab, aa) = pairs.fold((0.0, 0.0), |(ab, aa), (a, b)| (ab + a[i] * b[i], aa + a[i] * a[i]));
        ab / aa
    })
}
