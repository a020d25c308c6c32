//! Inverse mechanisation: the readings of perfect inertial sensors between two states.
//!
//! [`sample`] solves [`step`](crate::process::strapdown::mechanisation::step) for its inputs: given Nav and Nav⁺ it returns the `w_ib_b`, `f_ib_b`
//! for which `step(Nav, w, f, dt)` has the velocity and attitude of Nav⁺ up to rounding.
//!
//! Velocity   `Δv_n` from `v⁺ = v + Δv_n − ½ζ×Δv_n + [g − (2w_ie + w_en)×v_mid] dt` by fixed-point
//!            iteration; ζ and Coriolis depend on `Δv_n` by 1e-5 at most, so four turns suffice
//! Attitude   `φ = Log(q⁻¹ Exp(ζ) q⁺)`, then `f dt = (mean of Exp(sφ))⁻¹ C_nbᵀ Δv_n`
//! Position   is not free: `step` integrates velocity by the trapezoid, which differs from the
//!            truth by `dt²/12 · (a_end − a_start)` over a run, 8 µm for 1 m/s² at 100 Hz
//!
//! Over a plane ([`Gravity::Flat`]) ζ and Coriolis are zero, and so it is for `strapdown_local`.
//!
//! [`step`](crate::process::strapdown::mechanisation::step) takes rates with coning and sculling already in. A process that adds those itself
//! ([`Correction`]) gets samples from which its corrections lead to the same inputs.

use crate::block::imu_channels;
use crate::earth::{Gravity, LocalEarth};
use crate::process::strapdown::increments::{coning_rate, sculling_rate};
use crate::process::strapdown::mechanisation::Nav;
use fusion_core::geometry::so3;
use fusion_core::model::{Prepared, Process};
use nalgebra::Vector3;

/// Mean angular rate and specific force over an interval, body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// `w_ib_b` \[rad/s\].
    pub rate: Vector3<f64>,
    /// `f_ib_b` \[m/s²\].
    pub force: Vector3<f64>,
}

/// The inputs with which [`step`](crate::process::strapdown::mechanisation::step) leads from one state to the velocity and attitude of the next.
///
/// `dt` \[s\] greater than 0.
#[must_use]
pub fn sample(from: &Nav, to: &Nav, dt: f64, gravity: Gravity) -> Sample {
    let v = &from.v_eb_n;
    if let Gravity::Flat(g) = gravity {
        let dv_n = to.v_eb_n - v - Vector3::new(0.0, 0.0, g * dt);
        return between(from, &so3::log(&(from.q_nb.inverse() * to.q_nb)), &dv_n, dt);
    }
    let earth = LocalEarth::at(&from.position.offset(&(v * (0.5 * dt))));
    let w_ie = earth.earth_rate_n();
    let g = Vector3::new(0.0, 0.0, earth.gravity(gravity));
    let coriolis = (2.0 * w_ie + earth.transport_rate_n(v)).cross(v);
    let change = to.v_eb_n - v;

    let mut dv_n = change - g * dt;
    let mut zeta = Vector3::zeros();
    for _ in 0..4 {
        let v_mid = v + 0.5 * (dv_n + (g - coriolis) * dt);
        let w_en = earth.transport_rate_n(&v_mid);
        zeta = (w_ie + w_en) * dt;
        dv_n = change + 0.5 * zeta.cross(&dv_n) - (g - (2.0 * w_ie + w_en).cross(&v_mid)) * dt;
    }
    between(from, &so3::log(&(from.q_nb.inverse() * so3::exp(&zeta) * to.q_nb)), &dv_n, dt)
}

/// The rates under which the body turns by `phi` \[rad\] and its force adds `dv_n` \[m/s\].
fn between(from: &Nav, phi: &Vector3<f64>, dv_n: &Vector3<f64>, dt: f64) -> Sample {
    let dv_b = from.q_nb.inverse_transform_vector(dv_n);
    Sample {
        rate: phi / dt,
        force: so3::right_jacobian_inverse(&-phi) * dv_b / dt,
    }
}

/// Which neighbour a process corrects a sample by, for coning and sculling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Correction {
    /// None: the samples are used unchanged.
    #[default]
    None,
    /// The sample before.
    Previous,
    /// Samples one and two correct each other, then three and four, and so on.
    Pairs,
}

impl Correction {
    /// The correction of `process`. It follows from the neighbours that its preparation waits for: a process driven by
    /// an inertial unit uses them for these corrections.
    #[must_use]
    pub fn of(process: &dyn Process) -> Self {
        let inertial = imu_channels().iter().map(|c| c.width).sum::<usize>();
        let Some(mut preparation) = process.preparation().filter(|_| process.input_dim() == inertial) else {
            return Self::None;
        };
        // Pairs wait for the second sample.
        let (sample, mut out) = (vec![0.0; inertial], Prepared::default());
        preparation.take(0.0, &sample, &mut out);
        preparation.take(1.0, &sample, &mut out);
        if out.samples().next().is_some() {
            Self::Previous
        } else {
            Self::Pairs
        }
    }
}

/// The length \[s\] for which the corrections are exact with linear rates, where a sample and its
/// neighbour differ in length: `2T²/(T + T_neighbour)`.
fn effective(own: f64, neighbour: f64) -> f64 {
    2.0 * own * own / (own + neighbour)
}

/// The sample that, corrected by `previous`, becomes `wanted`; both with their lengths \[s\].
#[must_use]
pub fn before_correction(previous: (&Sample, f64), wanted: (&Sample, f64)) -> Sample {
    let dt = effective(wanted.1, previous.1);
    let (previous, wanted) = (previous.0, wanted.0);
    let mut raw = *wanted;
    // Each turn gains the size of a correction, |w| dt/12 < 1e-2: eight reach rounding.
    for _ in 0..8 {
        raw = Sample {
            rate: wanted.rate - coning_rate(&previous.rate, &raw.rate, dt),
            force: wanted.force - sculling_rate(&previous.rate, &previous.force, &raw.rate, &raw.force, dt),
        };
    }
    raw
}

/// The pair of samples that, corrected by each other, become `wanted`; each with its length \[s\].
#[must_use]
pub fn pair_before_correction(wanted: [(&Sample, f64); 2]) -> [Sample; 2] {
    let [(a, a_dt), (b, b_dt)] = wanted;
    let [a_pair, b_pair] = [effective(a_dt, b_dt), effective(b_dt, a_dt)];
    let [mut first, mut second] = [*a, *b];
    for _ in 0..8 {
        let cone = |dt| coning_rate(&first.rate, &second.rate, dt);
        let scull = |dt| sculling_rate(&first.rate, &first.force, &second.rate, &second.force, dt);
        let one = Sample {
            rate: a.rate - cone(a_pair),
            force: a.force - scull(a_pair),
        };
        let two = Sample {
            rate: b.rate - cone(b_pair),
            force: b.force - scull(b_pair),
        };
        (first, second) = (one, two);
    }
    [first, second]
}

#[cfg(test)]
mod tests {
    use super::super::segment::{Junction, SegmentSpec};
    use super::super::trajectory::Trajectory;
    use super::super::world::{OpenLoop, Plane, World};
    use super::*;
    use crate::process::strapdown::mechanisation::step;
    use fusion_core::Time;
    use fusion_core::geometry::wgs84::Geodetic;

    const G: Gravity = Gravity::Somigliana;
    const DT: f64 = 0.01;

    #[derive(serde::Deserialize)]
    struct File {
        trajectory: Vec<Box<dyn SegmentSpec>>,
    }

    fn world(segments: &str) -> OpenLoop {
        let file: File = toml::from_str(&format!("trajectory = [{segments}]")).unwrap();
        let start = Junction {
            position: Vector3::new(1.0, 2.0, 3.0),
            heading: 0.4,
            speed: 0.0,
        };
        let trajectory = Trajectory::new(start, &file.trajectory).unwrap();
        OpenLoop::new(trajectory, Plane::new(Geodetic::new(0.63, 2.2593, -23.0), G))
    }

    const MOVING: &str = "{ rest = { duration = 10 } }, { straight = { distance = 60, speed = 3, acceleration = 1 } }, \
         { turn = { angle = -4, radius = 20, bank = true } }, { climb = { height = 5, distance = 40 } }, \
         { bump = { duration = 1, height = -0.05, pitch = '8 deg', heading = '5 deg', velocity = [0.6, 0, 0] } }, \
         { sine = { duration = 100, amplitude = 2, wavelength = 30 } }, { turn = { angle = 3, radius = 7 } }, \
         { straight = { duration = 105, end_speed = 0 } }, { rotate_in_place = { angle = 9, rate = 1 } }, { rest = { duration = 20 } }";

    /// Errors at the end \[m, m, m/s, rad\]: horizontal, vertical, velocity, attitude; and the time.
    fn error(nav: &Nav, truth: &Nav) -> [f64; 4] {
        let d = nav.position.difference(&truth.position);
        let turned = so3::log(&(truth.q_nb.inverse() * nav.q_nb)).norm();
        [d.x.hypot(d.y), d.z.abs(), (nav.v_eb_n - truth.v_eb_n).norm(), turned]
    }

    #[test]
    fn one_step_gives_the_next_velocity_and_attitude_to_rounding() {
        let mut world = world(MOVING);
        let mut before = world.truth().nav;
        for k in 1..=28_000 {
            let truth = world.advance(Time::from_nanos(k * 10_000_000));
            let next = step(&before, &truth.imu.rate, &truth.imu.force, DT, G);
            let [.., velocity, attitude] = error(&next, &truth.nav);
            // 20 ε of 3 m/s, and of 1.
            assert!(velocity < 2e-14 && attitude < 4e-15, "{k}: {velocity:e} {attitude:e}");
            before = truth.nav;
        }
    }

    #[test]
    fn noise_free_navigation_at_rest_drifts_less_than_a_micrometre_in_a_minute() {
        let mut world = world("{ rest = { duration = 60 } }");
        let mut nav = world.truth().nav;
        for k in 1..=6000 {
            let imu = world.advance(Time::from_nanos(k * 10_000_000)).imu;
            nav = step(&nav, &imu.rate, &imu.force, DT, G);
        }
        let e = error(&nav, &world.truth().nav);
        assert!(e[0] < 1e-6 && e[1] < 1e-6, "{e:?}"); // the required figure
    }

    #[test]
    fn noise_free_navigation_reproduces_a_moving_run() {
        let mut world = world(MOVING);
        let mut nav = world.truth().nav;
        let (mut worst, mut k) = ([0.0_f64; 4], 0);
        while k < 30_000 && world.truth().time < world.end() {
            k += 1;
            let imu = world.advance(Time::from_nanos(k * 10_000_000)).imu;
            nav = step(&nav, &imu.rate, &imu.force, DT, G);
            for (w, e) in worst.iter_mut().zip(error(&nav, &world.truth().nav)) {
                *w = w.max(e);
            }
        }
        assert!(k >= 30_000, "300 s, not {k} steps");
        // 1e-4 m horizontally: the required figure, of which dt²/12·Δa is 3e-5 m in the turn;
        // 1e-10 rad: 3e4 roundings of 1e-15.
        assert!(worst[0] < 1e-4 && worst[1] < 1e-4 && worst[3] < 1e-10, "{worst:?}");
    }

    #[test]
    fn samples_before_correction_lead_to_what_is_wanted() {
        let a = Sample {
            rate: Vector3::new(0.4, -0.7, 0.3),
            force: Vector3::new(1.0, 2.0, -9.0),
        };
        let b = Sample {
            rate: Vector3::new(-0.2, 0.5, 2.0),
            force: Vector3::new(6.0, -4.0, -12.0),
        };
        let corrected = |earlier: &Sample, later: &Sample, which: &Sample, dt| Sample {
            rate: which.rate + coning_rate(&earlier.rate, &later.rate, dt),
            force: which.force + sculling_rate(&earlier.rate, &earlier.force, &later.rate, &later.force, dt),
        };
        // 4 ε of 12 m/s².
        let near = |x: &Sample, y: &Sample| (x.rate - y.rate).norm() < 2e-15 && (x.force - y.force).norm() < 2e-14;
        let raw = before_correction((&a, DT), (&b, DT));
        assert!(near(&corrected(&a, &raw, &raw, DT), &b) && !near(&raw, &b));
        let [one, two] = pair_before_correction([(&a, DT), (&b, 2.0 * DT)]);
        assert!(near(&corrected(&one, &two, &one, 2.0 / 3.0 * DT), &a));
        assert!(near(&corrected(&one, &two, &two, 8.0 / 3.0 * DT), &b));
    }
}
