//! Strapdown mechanisation: position, velocity and attitude from rate and specific force.
//!
//! Continuous   `φ̇ = vN/(RM+h)`, `λ̇ = vE/((RN+h) cos φ)`, `ḣ = −vD`
//!              `v̇_eb_n = C_nb f_ib_b − (2 w_ie_n + w_en_n) × v_eb_n + g_n`
//!              `Ċ_nb = C_nb [w_nb_b ×]`, `w_nb_b = w_ib_b − C_nbᵀ (w_ie_n + w_en_n)`
//! Inputs       *mean* rate \[rad/s\] and specific force \[m/s²\] of the interval, body axes,
//!              free of known errors, coning and sculling already added ([`coning_rate`],
//!              [`sculling_rate`]). So an interval can be split anywhere, and the pieces give
//!              the whole to the order of the step
//! Axes         n north-east-down, b forward-right-down, position geodetic on WGS-84
//! Valid        everywhere but within metres of a pole, where all stays finite
//! Not here     sensor errors, height aiding: the free vertical channel diverges with an
//!              e-fold of 570 s
//! Source       Savage 1998 (J. Guid. Control Dyn. 21); Groves 2013, §5.4; Titterton and
//!              Weston 2004, §3.5 for the first-order integrator

use fusion_core::geometry::{so3, wgs84::Geodetic};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

pub use super::increments::{
    coning_rate, rotation_vector_one_sample, rotation_vector_three_sample, rotation_vector_two_sample, sculling_rate, velocity_one_sample,
    velocity_two_sample,
};
use crate::earth::{Gravity, LocalEarth};

/// Position, velocity and attitude of body b relative to the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nav {
    /// Geodetic position of b.
    pub position: Geodetic,
    /// Velocity of b relative to the Earth in n \[m/s\].
    pub v_eb_n: Vector3<f64>,
    /// Attitude, body to navigation.
    pub q_nb: UnitQuaternion<f64>,
}

/// The state at the start of a step: the common terms of the step and its derivative, from one sine and cosine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub(crate) nav: Nav,
    pub(crate) earth: LocalEarth,
    pub(crate) c_nb: Matrix3<f64>,
}

impl Start {
    #[inline]
    pub(crate) fn of(nav: &Nav) -> Self {
        Self {
            nav: *nav,
            earth: LocalEarth::at(&nav.position),
            c_nb: so3::rotation(&nav.q_nb),
        }
    }
}

/// Time derivative of a [`Nav`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NavRate {
    /// `[φ̇, λ̇, ḣ]` \[rad/s, rad/s, m/s\].
    pub position: Vector3<f64>,
    /// `v̇_eb_n` \[m/s²\].
    pub v_eb_n: Vector3<f64>,
    /// Body rate relative to n, `w_nb_b` \[rad/s\].
    pub w_nb_b: Vector3<f64>,
}

/// The continuous navigation equations at one instant.
#[inline]
#[must_use]
pub fn derivative(nav: &Nav, w_ib_b: &Vector3<f64>, f_ib_b: &Vector3<f64>, gravity: Gravity) -> NavRate {
    let earth = LocalEarth::at(&nav.position);
    let v = &nav.v_eb_n;
    let w_ie = earth.earth_rate_n();
    let w_en = earth.transport_rate_n(v);
    let mut acceleration = nav.q_nb * f_ib_b - (2.0 * w_ie + w_en).cross(v);
    acceleration.z += earth.gravity(gravity);
    NavRate {
        position: Vector3::new(v.x * earth.per_meridian, v.y * (earth.per_normal * earth.per_cos), -v.z),
        v_eb_n: acceleration,
        w_nb_b: w_ib_b - nav.q_nb.inverse_transform_vector(&(w_ie + w_en)),
    }
}

/// One strapdown step of `dt` \[s\] with mean `w_ib_b` \[rad/s\] and `f_ib_b` \[m/s²\].
///
/// 1. Body turn `φ = w dt`; velocity in the body axes of the start, `Δv_b = mean of
///    Exp(sφ) f dt`: rotation compensation to all orders, `½ Δθ × Δv` being the first.
/// 2. Position, then velocity, extrapolated to mid-step; `w_ie`, `w_en`, g there.
/// 3. `ζ = (w_ie + w_en) dt`; `v⁺ = v + (I − ½[ζ×]) C_nb Δv_b + [g − (2w_ie + w_en) × v_mid] dt`.
/// 4. Position by the trapezoid of velocity over the mid-step radii.
/// 5. `q⁺ = Exp(−ζ) ⊗ q ⊗ Exp(φ)`, brought back to unit length.
///
/// Error per step O(dt³), over a fixed time O(dt²). Body rotation and the response to
/// specific force alone are exact for constant inputs and any `dt`.
#[inline]
#[must_use]
pub fn step(nav: &Nav, w_ib_b: &Vector3<f64>, f_ib_b: &Vector3<f64>, dt: f64, gravity: Gravity) -> Nav {
    step_from(&Start::of(nav), w_ib_b, f_ib_b, dt, gravity)
}

/// The same, from the precomputed start of a step.
#[inline]
#[must_use]
pub(crate) fn step_from(start: &Start, w_ib_b: &Vector3<f64>, f_ib_b: &Vector3<f64>, dt: f64, gravity: Gravity) -> Nav {
    let (nav, v) = (&start.nav, &start.nav.v_eb_n);
    let phi = w_ib_b * dt;
    let dv_n = start.c_nb * so3::mean_rotated(&phi, &(f_ib_b * dt));

    let middle = start.earth.offset(&nav.position, &(v * (0.5 * dt)));
    let earth = start.earth.near(&middle, &nav.position);
    let w_ie = earth.earth_rate_n();
    let g = Vector3::new(0.0, 0.0, earth.gravity(gravity));
    let coriolis = (2.0 * w_ie + earth.transport_rate_n(v)).cross(v);
    let v_mid = v + 0.5 * (dv_n + (g - coriolis) * dt);

    let w_en = earth.transport_rate_n(&v_mid);
    let zeta = (w_ie + w_en) * dt;
    let v_new = v + dv_n - 0.5 * zeta.cross(&dv_n) + (g - (2.0 * w_ie + w_en).cross(&v_mid)) * dt;

    let travelled = (v + v_new) * (0.5 * dt);
    let mut q_new = so3::exp(&-zeta) * nav.q_nb * so3::exp(&phi);
    q_new.renormalize_fast();
    Nav {
        position: earth.offset(&nav.position, &travelled),
        v_eb_n: v_new,
        q_nb: q_new,
    }
}

/// The same step by the first-order integrator that papers print: every derivative at the
/// start, `q + q̇ dt` normalised. For comparison only: error per step O(dt²).
#[inline]
#[must_use]
pub fn step_first_order(nav: &Nav, w_ib_b: &Vector3<f64>, f_ib_b: &Vector3<f64>, dt: f64, gravity: Gravity) -> Nav {
    let rate = derivative(nav, w_ib_b, f_ib_b, gravity);
    Nav {
        position: Geodetic {
            lat: nav.position.lat + rate.position.x * dt,
            lon: so3::wrap_angle(nav.position.lon + rate.position.y * dt),
            height: nav.position.height + rate.position.z * dt,
        },
        v_eb_n: nav.v_eb_n + rate.v_eb_n * dt,
        q_nb: so3::integrate_literal(&nav.q_nb, &rate.w_nb_b, dt),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, PI};

    type V = Vector3<f64>;
    type Step = fn(&Nav, &V, &V, f64, Gravity) -> Nav;

    const G: Gravity = Gravity::Somigliana;
    const MILLI_G: f64 = 9.80665e-3;

    fn site(roll: f64, pitch: f64, yaw: f64) -> Nav {
        Nav {
            position: Geodetic::new(36.098_277_778_f64.to_radians(), 2.259_327_747, -23.0),
            v_eb_n: V::zeros(),
            q_nb: so3::from_rpy(roll, pitch, yaw),
        }
    }

    /// The output of ideal sensors on a body at rest.
    fn at_rest(nav: &Nav) -> (V, V) {
        let earth = LocalEarth::at(&nav.position);
        let g = V::new(0.0, 0.0, earth.gravity(G));
        (
            nav.q_nb.inverse_transform_vector(&earth.earth_rate_n()),
            -nav.q_nb.inverse_transform_vector(&g),
        )
    }

    /// Runs at constant inputs with the height held, as a depth sensor would hold it, calling `see(t, nav)`.
    fn run_level(start: &Nav, (w, f): (V, V), dt: f64, steps: u32, mut see: impl FnMut(f64, &Nav)) {
        let mut nav = *start;
        for k in 1..=steps {
            nav = step(&nav, &w, &f, dt, G);
            nav.v_eb_n.z = 0.0;
            nav.position.height = start.position.height;
            see(f64::from(k) * dt, &nav);
        }
    }

    #[test]
    fn a_body_at_rest_stays_within_a_micrometre_for_a_minute() {
        let start = site(0.1, -0.2, 2.0);
        let (w, f) = at_rest(&start);
        let mut nav = start;
        for _ in 0..6000 {
            nav = step(&nav, &w, &f, 0.01, G);
        }
        // 1e-6 m: the required figure.
        assert!(nav.position.difference(&start.position).norm() < 1e-6);
        // 1e-11 rad: 6000 roundings, and the gyro reading itself to 1e-16.
        assert!(so3::log(&(start.q_nb.inverse() * nav.q_nb)).norm() < 1e-11);
        assert!((nav.q_nb.norm() - 1.0).abs() < 4.0 * f64::EPSILON);
    }

    #[test]
    fn free_drift_of_1_mg_swings_out_to_12_754_m() {
        let start = site(0.0, 0.0, 0.0);
        let (w, f) = at_rest(&start);
        let mut farthest = 0.0_f64;
        run_level(&start, (w, f + V::new(MILLI_G, 0.0, 0.0)), 1.0, 3000, |_, nav| {
            farthest = farthest.max(nav.position.difference(&start.position).x);
        });
        // The closed form is for a sphere that does not rotate. Along the meridian RM is 0.219 % less than R0.
        // Foucault's turn of Ω sin φ T/2 = 6.2° takes away (1 − cos 6.2°)/2 = 0.296 %.
        let expected = 12_754.0 * (1.0 - 0.002_19) * (1.0 - 0.002_96);
        // 1e-4: (Ω/ω_s)² of Foucault's turn, half a metre of digits.
        assert!((farthest / expected - 1.0).abs() < 1e-4, "{farthest} against {expected}");
    }

    #[test]
    fn horizontal_errors_swing_with_the_schuler_period_of_84_4455_min() {
        let rest = site(0.0, 0.0, 0.0);
        let start = Nav {
            v_eb_n: V::new(0.1, 0.0, 0.0),
            ..rest
        };
        let (mut minima, mut last) = (Vec::new(), [start.v_eb_n.norm(); 2]);
        run_level(&start, at_rest(&rest), 1.0, 9000, |t, nav| {
            let speed = nav.v_eb_n.norm();
            if last[1] < last[0] && last[1] <= speed {
                minima.push(t - 1.0);
            }
            last = [last[1], speed];
        });
        // Speed is least at ¼ and ¾ of a period.
        let minutes = 2.0 * (minima[1] - minima[0]) / 60.0;
        // 0.3 %: two radii of curvature (0.2 %), Foucault coupling (0.06 %), 1 s of resolution.
        assert!((minutes / 84.4455 - 1.0).abs() < 3e-3, "{minutes}");
    }

    #[test]
    fn the_free_vertical_channel_diverges_with_an_e_fold_of_570_s() {
        let rest = site(0.0, 0.0, 0.0);
        let (w, f) = at_rest(&rest);
        let mut nav = rest;
        nav.position.height += 1.0;
        let mut heights = Vec::new();
        for k in 1..=9000 {
            nav = step(&nav, &w, &f, 0.2, G);
            if k % 3000 == 0 {
                heights.push(nav.position.height - rest.position.height);
            }
        }
        let e_fold = 600.0 / (heights[2] / heights[1]).ln();
        // 1.5 %: cosh is not yet a pure exponential at 1200 s (e^-4.2 = 1.5 %).
        assert!((e_fold / 570.0 - 1.0).abs() < 0.015, "{e_fold}");
        assert!(heights[0] > 1.0);
    }

    /// A fast, turning, climbing start with constant inputs.
    fn dynamic() -> (Nav, V, V) {
        let mut nav = site(0.3, -0.2, 1.9);
        nav.v_eb_n = V::new(150.0, -220.0, 30.0);
        (nav, V::new(0.03, -0.05, 0.08), V::new(2.0, -1.0, -11.0))
    }

    /// Oracle: the continuous equations by 200 classical Runge-Kutta steps on the ten numbers
    /// \[φ, λ, h, v, q\], q free to leave unit length.
    fn runge_kutta(nav: &Nav, w: &V, f: &V, dt: f64) -> Nav {
        type Y = nalgebra::SVector<f64, 10>;
        let read = |y: &Y| Nav {
            position: Geodetic::new(y[0], y[1], y[2]),
            v_eb_n: V::new(y[3], y[4], y[5]),
            q_nb: so3::from_scalar_first(&y.fixed_rows::<4>(6).into_owned()),
        };
        let slope = |y: Y| {
            let rate = derivative(&read(&y), w, f, G);
            let mut k = Y::zeros();
            k.fixed_rows_mut::<3>(0).copy_from(&rate.position);
            k.fixed_rows_mut::<3>(3).copy_from(&rate.v_eb_n);
            let q_dot = 0.5 * so3::rate_matrix(&rate.w_nb_b) * y.fixed_rows::<4>(6);
            k.fixed_rows_mut::<4>(6).copy_from(&q_dot);
            k
        };
        let mut y = Y::zeros();
        let p = nav.position;
        y.fixed_rows_mut::<3>(0).copy_from(&V::new(p.lat, p.lon, p.height));
        y.fixed_rows_mut::<3>(3).copy_from(&nav.v_eb_n);
        y.fixed_rows_mut::<4>(6).copy_from(&so3::to_scalar_first(&nav.q_nb));
        let h = dt / 200.0;
        for _ in 0..200 {
            let k1 = slope(y);
            let k2 = slope(y + k1 * (h / 2.0));
            let k3 = slope(y + k2 * (h / 2.0));
            let k4 = slope(y + k3 * h);
            y += (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
        }
        read(&y)
    }

    /// Distance in attitude \[rad\], velocity \[m/s\], position \[m\].
    fn gaps(a: &Nav, b: &Nav) -> [f64; 3] {
        [
            so3::log(&(a.q_nb.inverse() * b.q_nb)).norm(),
            (a.v_eb_n - b.v_eb_n).norm(),
            a.position.difference(&b.position).norm(),
        ]
    }

    /// Orders of convergence of `error(dt)`, from dt = 4 s and 2 s.
    fn orders(error: impl Fn(f64) -> [f64; 3]) -> [f64; 3] {
        let (coarse, fine) = (error(4.0), error(2.0));
        core::array::from_fn(|i| (coarse[i] / fine[i]).log2())
    }

    #[test]
    fn one_step_matches_runge_kutta_to_third_order_and_the_literal_one_to_second() {
        let (nav, w, f) = dynamic();
        let against = |s: Step| orders(|dt| gaps(&s(&nav, &w, &f, dt, G), &runge_kutta(&nav, &w, &f, dt)));
        // 0.2: the next order at steps of 2 and 4 s.
        let exact = against(step);
        assert!(exact.iter().all(|p| *p > 2.8), "{exact:?}");
        let literal = against(step_first_order);
        assert!(literal[1..].iter().all(|p| (p - 2.0).abs() < 0.2), "{literal:?}");
        // Attitude: q + q̇dt is one order better than its name for a constant rate.
        assert!(literal[0] > 1.8, "{literal:?}");
    }

    #[test]
    fn a_split_step_equals_the_whole_to_third_order_and_exactly_in_body_rotation() {
        let (nav, w, f) = dynamic();
        let split = |dt: f64| {
            let middle = step(&nav, &w, &f, 0.3 * dt, G);
            gaps(&step(&middle, &w, &f, 0.7 * dt, G), &step(&nav, &w, &f, dt, G))
        };
        let p = orders(split);
        assert!(p.iter().all(|p| *p > 2.8), "{p:?}"); // 0.2: next order
        // At 100 Hz the split is far below any sensor: 1e-12 rad, 1e-8 m/s and m.
        let small = split(0.01);
        assert!(small[0] < 1e-12 && small[1] < 1e-8 && small[2] < 1e-7, "{small:?}");
    }

    #[test]
    fn pairs_of_corrected_samples_match_the_two_sample_formulas_to_third_order() {
        let (nav, ..) = dynamic();
        let gap = |t: f64| {
            let h = t / 2.0;
            let (w1, w2) = (V::new(0.3, -0.5, 0.8), V::new(0.5, 0.1, -0.2));
            let (f1, f2) = (V::new(2.0, -1.0, -11.0), V::new(-1.0, 3.0, -8.0));
            let c = coning_rate(&w1, &w2, h);
            let s = sculling_rate(&w1, &f1, &w2, &f2, h);
            let middle = step(&nav, &(w1 + c), &(f1 + s), h, G);
            let pieces = step(&middle, &(w2 + c), &(f2 + s), h, G);
            // The classical whole-interval step: steps 2, 3, 4 and 6 as Savage prints them.
            let phi = rotation_vector_two_sample(&(w1 * h), &(w2 * h));
            let dv = velocity_two_sample(&(w1 * h), &(f1 * h), &(w2 * h), &(f2 * h));
            let ahead = nav.position.offset(&(nav.v_eb_n * h));
            let earth = LocalEarth::at(&ahead);
            let w_ie = earth.earth_rate_n();
            let g = V::new(0.0, 0.0, earth.gravity(G));
            let v_mid = nav.v_eb_n + derivative(&nav, &w1, &f1, G).v_eb_n * h;
            let w_en = earth.transport_rate_n(&v_mid);
            let zeta = (w_ie + w_en) * t;
            let dv_n = nav.q_nb * dv;
            let v = nav.v_eb_n + dv_n - 0.5 * zeta.cross(&dv_n) + (g - (2.0 * w_ie + w_en).cross(&v_mid)) * t;
            let q = so3::exp(&-zeta) * nav.q_nb * so3::exp(&phi);
            [so3::log(&(q.inverse() * pieces.q_nb)).norm(), (v - pieces.v_eb_n).norm()]
        };
        let (coarse, fine) = (gap(0.1), gap(0.05));
        for i in 0..2 {
            let p = (coarse[i] / fine[i]).log2();
            assert!(p > 2.8, "{i} {p}"); // 0.2: next order
        }
    }

    #[test]
    fn literal_and_full_step_tell_the_same_story_at_a_high_rate() {
        let (nav, w, f) = dynamic();
        let (mut full, mut literal) = (nav, nav);
        for _ in 0..1000 {
            full = step(&full, &w, &f, 1e-3, G);
            literal = step_first_order(&literal, &w, &f, 1e-3, G);
        }
        let [attitude, velocity, position] = gaps(&full, &literal);
        // Global first order: v̈ dt t/2 = 6e-4 m/s, v̇ dt t/2 = 6e-3 m in one second.
        assert!(attitude < 1e-6 && velocity < 1e-3 && position < 1e-2);
        assert!(velocity > 1e-6, "the two integrators are different");
    }

    #[test]
    fn every_start_gives_a_finite_unit_result() {
        for lat in [-FRAC_PI_2, 0.0, FRAC_PI_2] {
            for s in [step as Step, step_first_order as Step] {
                let nav = Nav {
                    position: Geodetic::new(lat, PI, 0.0),
                    v_eb_n: V::new(1.0, 1.0, 1.0),
                    q_nb: UnitQuaternion::identity(),
                };
                let next = s(&nav, &V::new(1.0, 2.0, 3.0), &V::new(0.0, 0.0, -9.8), 0.01, G);
                assert!(next.v_eb_n.iter().all(|x| x.is_finite()));
                assert!((next.q_nb.norm() - 1.0).abs() < 1e-15);
                assert!(next.position.lat.is_finite() && next.position.lon.abs() <= PI);
            }
        }
    }
}
