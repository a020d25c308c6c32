//! How a velocity log is turned against an inertial unit, from changes of velocity and forces.
//!
//! The unit gives the turn ψ and the change of velocity ∫ e^{iψ} (f − s) dt in level axes that do not turn: f is its
//! horizontal force, s gravity, which turns with its rates. Complex numbers are vectors in the horizontal plane. The log
//! gives the velocity u. Within a window,
//!
//! ```text
//! ∫ e^{iψ} (f − s) dt = c e^{iψ} u + a ∫ e^{iψ} dt + b ∬ e^{iψ} dt² + d₀ + d₁ t + d₂ t²
//! ```
//!
//! for a log that is turned by the angle of c. The bias a of the accelerometers is common to all windows, and so is b, the
//! tilt by the bias of the gyros times gravity. The d of each window contain the start, the error of the level, and the
//! noise of the gyros. Least squares give c. Its 1σ is from the scatter of the
//! windows, for errors are correlated within a window.
//!
//! Not here: a log and a unit that are not level to each other

use super::numbers::{Vec3, norm};
use super::pair::{cross, dot, horizontal};
use fusion_core::math;
use nalgebra::{Complex, DMatrix, Matrix3, Vector3};

/// The length of a window \[s\]: the tilt by random walk of consumer gyros stays below a tenth of a degree.
const WINDOW: f64 = 30.0;
/// Velocities in a window; fewer do not determine the parameters of the window and c.
const ENOUGH: usize = 12;
/// Fewer windows do not tell their scatter.
const WINDOWS: usize = 8;
/// A longer interval between two samples of the unit is a gap \[s\].
const GAP: f64 = 0.5;
/// A quarter turn is sure if the next one is more than twice this number of 1σ away: a chance of one in a million for
/// normal errors.
const SURE: f64 = 5.0;

/// The direction of x of a velocity log in the horizontal plane of a unit.
#[derive(Clone, Copy, Debug)]
pub struct Turned {
    /// The angle from the first horizontal axis of the unit to the second \[rad\].
    pub angle: f64,
    /// Its 1σ \[rad\].
    pub sigma: f64,
}

/// The plane of complex numbers for horizontal vectors.
struct Plane {
    first: Vec3,
    second: Vec3,
    down: Vec3,
}

impl Plane {
    fn of(&self, v: Vec3) -> Complex<f64> {
        Complex::new(dot(v, self.first), dot(v, self.second))
    }
}

/// The motion of a unit since the start of a window.
#[derive(Clone, Copy)]
struct Motion {
    /// The turn e^{iψ}.
    turn: Complex<f64>,
    /// The integral of the force less gravity, and the first and second integral of the turn.
    force: Complex<f64>,
    turns: [Complex<f64>; 2],
    /// The force of gravity, unit axes.
    gravity: Vec3,
}

/// A velocity of the log with the motion of the unit up to it.
struct Row {
    /// Since the start of the window \[s\].
    time: f64,
    /// The left side.
    force: Complex<f64>,
    /// The columns of c, a and b.
    columns: [Complex<f64>; 3],
}

/// Normal matrix and right side.
struct Equations {
    normal: Matrix3<Complex<f64>>,
    right: Vector3<Complex<f64>>,
}

/// The windows, each with its equations.
#[derive(Default)]
struct Sums {
    windows: Vec<Equations>,
}

impl Turned {
    /// From the samples of a unit with its mean force and up axis, and velocities x, y at stamps. `None` if the motion
    /// does not determine the quarter turn.
    pub(super) fn of(
        (t, force, rate): (&[f64], &[Vec3], &[Vec3]),
        gravity: Vec3,
        up: (usize, bool),
        (stamps, velocity): (&[f64], &[Vec3]),
    ) -> Option<Self> {
        let (first, second) = horizontal(up);
        let plane = Plane {
            first,
            second,
            down: cross(first, second),
        };
        let mut sums = Sums::default();
        let mut from = 0;
        while from < stamps.len() {
            let end = from + stamps[from..].partition_point(|s| *s < stamps[from] + WINDOW);
            let rows = moved(t, force, rate, gravity, &plane, &stamps[from..end]);
            let rows = rows
                .into_iter()
                .filter(|(k, _)| velocity[from + k][..2].iter().all(|v| v.is_finite()));
            let rows = rows.map(|(k, motion)| {
                let u = Complex::new(velocity[from + k][0], velocity[from + k][1]);
                Row {
                    time: stamps[from + k] - stamps[from],
                    force: motion.force,
                    columns: [motion.turn * u, motion.turns[0], motion.turns[1]],
                }
            });
            sums.add(&rows.collect::<Vec<_>>());
            from = end.max(from + 1);
        }
        sums.solve()
    }
}

/// The motion of a unit from the first of these stamps to each that its samples cover.
fn moved(t: &[f64], force: &[Vec3], rate: &[Vec3], gravity: Vec3, plane: &Plane, stamps: &[f64]) -> Vec<(usize, Motion)> {
    let Some(&start) = stamps.first() else { return Vec::new() };
    let mut k = t.partition_point(|t| *t <= start).max(1);
    let mut now = Motion {
        turn: Complex::new(1.0, 0.0),
        force: Complex::default(),
        turns: [Complex::default(); 2],
        gravity,
    };
    let mut all = Vec::new();
    let mut time = start;
    for (row, stamp) in stamps.iter().enumerate() {
        while time < *stamp {
            let (Some(at), Some(before)) = (t.get(k), t.get(k - 1)) else {
                return all;
            };
            let is_sample = force[k].iter().chain(&rate[k]).all(|x| x.is_finite());
            if at - before > GAP || !is_sample || *before > *at {
                return all;
            }
            // The sample covers the interval before it.
            let step = at.min(*stamp) - time;
            now.step(force[k], rate[k], plane, step.max(0.0));
            time += step.max(0.0);
            if *at > *stamp {
                break;
            }
            k += 1;
        }
        all.push((row, now));
    }
    all
}

impl Motion {
    fn step(&mut self, force: Vec3, rate: Vec3, plane: &Plane, dt: f64) {
        // A vector that is fixed in the world, in axes that turn: half a step before the force, and half a step after.
        let turned = |gravity: Vec3, dt: f64| {
            let change = cross(gravity, rate);
            [0, 1, 2].map(|i| gravity[i] + change[i] * dt)
        };
        let (sin, cos) = math::sin_cos(0.5 * dt * dot(plane.down, rate));
        let half = Complex::new(cos, sin);
        let (middle, gravity) = (self.turn * half, turned(self.gravity, 0.5 * dt));
        let moved = plane.of([0, 1, 2].map(|i| force[i] - gravity[i]));
        self.force += middle * moved * dt;
        self.turns[1] += (self.turns[0] + middle * (0.5 * dt)) * dt;
        self.turns[0] += middle * dt;
        self.turn = middle * half;
        // The length stays that of gravity.
        let (after, length) = (turned(gravity, 0.5 * dt), norm(self.gravity));
        self.gravity = after.map(|x| x * length / norm(after));
    }
}

impl Sums {
    /// Adds a window.
    fn add(&mut self, rows: &[Row]) {
        if rows.len() < ENOUGH {
            return;
        }
        // The part along an orthogonal base of 1, t, t² is taken off all columns.
        let base = DMatrix::from_fn(rows.len(), 3, |k, i| math::powi(rows[k].time / WINDOW, i as i32))
            .qr()
            .q();
        let rest = |column: &dyn Fn(usize) -> Complex<f64>| {
            let explained = |i: usize| (0..rows.len()).map(|k| column(k) * base[(k, i)]).sum::<Complex<f64>>();
            let explained = [0, 1, 2].map(explained);
            let left = |k: usize| column(k) - (0..3).map(|i| explained[i] * base[(k, i)]).sum::<Complex<f64>>();
            (0..rows.len()).map(left).collect::<Vec<_>>()
        };
        let columns = [0, 1, 2].map(|i| rest(&|k| rows[k].columns[i]));
        let left = rest(&|k| rows[k].force);
        let product = |a: &[Complex<f64>], b: &[Complex<f64>]| a.iter().zip(b).map(|(a, b)| a.conj() * b).sum::<Complex<f64>>();
        let normal = Matrix3::from_fn(|i, j| product(&columns[i], &columns[j]));
        let right = Vector3::from_fn(|i, _| product(&columns[i], &left));
        self.windows.push(Equations { normal, right });
    }

    fn solve(&self) -> Option<Turned> {
        if self.windows.len() < WINDOWS {
            return None;
        }
        let normal: Matrix3<Complex<f64>> = self.windows.iter().map(|window| window.normal).sum();
        let right: Vector3<Complex<f64>> = self.windows.iter().map(|window| window.right).sum();
        let inverse = normal.try_inverse()?;
        let solution = inverse * right;
        // The scatter of the windows about the common solution.
        let scatter = self.windows.iter().fold(Matrix3::zeros(), |sum, window| {
            let off = window.right - window.normal * solution;
            sum + off * off.adjoint()
        });
        let covariance = inverse * scatter * inverse.adjoint();
        let c = solution[0];
        // Half of the variance of a complex number is along it, and half across it.
        let sigma = math::sqrt(0.5 * covariance[(0, 0)].re) / c.norm();
        let quarter = core::f64::consts::FRAC_PI_2;
        (sigma * SURE < 0.5 * quarter).then(|| Turned { angle: c.arg(), sigma })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::so3::wrap_angle;
    use fusion_core::testing::Lcg;

    /// Ten minutes at 50 Hz: a vehicle turns and changes its speed, tilts by waves, and its unit has biases. The first
    /// horizontal axis of the unit is at `angle` to the left of the x axis of the log.
    fn found(angle: f64, moves: f64) -> Option<Turned> {
        let speed = |t: f64| 1.0 + 0.4 * moves * (0.11 * t).sin();
        let heading = |t: f64| moves * (1.2 * (0.07 * t).sin() + 0.5 * (0.19 * t).cos());
        let roll = |t: f64| 0.03 * (1.1 * t).sin();
        let slope = |of: &dyn Fn(f64) -> f64, t: f64| (of(t + 1e-4) - of(t - 1e-4)) / 2e-4;
        let mut random = Lcg::new(5);
        let mut noise = || 0.07 * (random.unit() - 0.5);
        let mut sample = |k: i32| {
            let t = 0.02 * f64::from(k);
            let (turn, ahead) = (slope(&heading, t), slope(&speed, t));
            // Forward, right, down of the vehicle; a roll by a small angle.
            let force = [ahead, speed(t) * turn - 9.81 * roll(t), -9.81];
            let rate = [slope(&roll, t), 0.0, turn];
            // The unit's x is turned by -angle from forward.
            let (s, c) = angle.sin_cos();
            let own = |v: Vec3| [c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]];
            let (f, w) = (own(force), own(rate));
            let f = [f[0] + 0.05 + noise(), f[1] - 0.03 + noise(), f[2]];
            (t, (f, [w[0] + 5e-4, w[1] - 3e-4, w[2] + 1e-3]))
        };
        let (t, samples): (Vec<f64>, Vec<_>) = (0..30_000).map(&mut sample).unzip();
        let (force, rate): (Vec<Vec3>, Vec<Vec3>) = samples.into_iter().unzip();
        let stamps: Vec<f64> = (1..2_900).map(|k| 0.2 * f64::from(k)).collect();
        let velocity: Vec<Vec3> = stamps.iter().map(|t| [speed(*t) + noise(), noise(), 0.0]).collect();
        Turned::of((&t, &force, &rate), [0.05, -0.03, -9.81], (2, true), (&stamps, &velocity))
    }

    #[test]
    fn the_angle_between_log_and_unit_is_found() {
        for angle in [0.0, 0.8, 1.57, -3.0, -1.2] {
            let turned = found(angle, 1.0).unwrap();
            let off = wrap_angle(turned.angle - angle);
            assert!(off.abs() < 5.0 * turned.sigma && turned.sigma < 0.1, "{angle} {turned:?}");
        }
    }

    #[test]
    fn a_straight_way_at_one_speed_tells_nothing() {
        assert!(found(0.8, 0.0).is_none());
    }
}
