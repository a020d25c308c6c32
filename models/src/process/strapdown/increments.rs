//! Coning and sculling: the effects of a turning signal that the mean of one sample does not show.
//!
//! Two equivalent forms, body axes throughout:
//!
//! Rates        `w + coning_rate`, `f + sculling_rate`: corrections to the mean rates of *one*
//!              sample interval, so that the interval may afterwards be split anywhere and
//!              integrated piece by piece. The composition of the pieces already holds the
//!              `½ Δθ1 × Δθ2` of the classical formulas; the rest, `(⅔ − ½) Δθ1 × Δθ2 =
//!              ⅙ Δθ1 × Δθ2`, goes in halves to the two samples, `1/12` each. Sculling likewise.
//! Increments   the classical rotation vector and velocity of a whole update interval from
//!              one, two or three integrated samples Δθ \[rad\], Δv \[m/s\]
//!
//! Modes      *previous sample*: the neighbour is the sample before, every sample is
//!            corrected as the later sample of its pair; usable in real time without delay.
//!            *pairs*: samples 1 and 2 both get the correction of the pair (1, 2); needs
//!            the second sample before the first is used, and leaves a sixteenth of the drift
//! Valid      rates that are linear over the samples used; |Δθ| well below 1 rad
//! Source       Savage, RTO-SET-116; Miller 1983 for three samples; drift under coning
//!              motion from Titterton and Weston 2004, §11.3

use nalgebra::Vector3;

/// Rate form of the coning correction \[rad/s\], to be added to the mean rate of a sample:
/// `(1/12) w_earlier × w_later · dt_neighbour`.
///
/// `w_earlier`, `w_later`: mean `w_ib_b` \[rad/s\] of two adjoining samples, in time order.
/// `dt_neighbour`: duration \[s\] of the sample other than the one corrected. Where the two
/// durations differ, `2 T²/(T + T_neighbour)`, with T that of the sample corrected, is exact
/// for linear rates.
#[inline]
#[must_use]
pub fn coning_rate(w_earlier: &Vector3<f64>, w_later: &Vector3<f64>, dt_neighbour: f64) -> Vector3<f64> {
    w_earlier.cross(w_later) * (dt_neighbour * (1.0 / 12.0))
}

/// Rate form of the sculling correction \[m/s²\], to be added to the mean specific force of a
/// sample: `(1/12)(w_earlier × f_later + f_earlier × w_later) · dt_neighbour`.
///
/// Arguments as in [`coning_rate`], with the mean specific forces `f_ib_b` \[m/s²\].
#[inline]
#[must_use]
pub fn sculling_rate(
    w_earlier: &Vector3<f64>,
    f_earlier: &Vector3<f64>,
    w_later: &Vector3<f64>,
    f_later: &Vector3<f64>,
    dt_neighbour: f64,
) -> Vector3<f64> {
    (w_earlier.cross(f_later) + f_earlier.cross(w_later)) * (dt_neighbour * (1.0 / 12.0))
}

/// Rotation vector \[rad\] of one sample, corrected by the sample before it:
/// `Δθ + (1/12) Δθ_previous × Δθ`.
#[inline]
#[must_use]
pub fn rotation_vector_one_sample(dth_previous: &Vector3<f64>, dth: &Vector3<f64>) -> Vector3<f64> {
    dth + dth_previous.cross(dth) / 12.0
}

/// Rotation vector \[rad\] of an interval of two samples: `Δθ1 + Δθ2 + ⅔ Δθ1 × Δθ2`.
#[inline]
#[must_use]
pub fn rotation_vector_two_sample(dth1: &Vector3<f64>, dth2: &Vector3<f64>) -> Vector3<f64> {
    dth1 + dth2 + dth1.cross(dth2) * (2.0 / 3.0)
}

/// Rotation vector \[rad\] of an interval of three samples:
/// `Δθ1 + Δθ2 + Δθ3 + (9/20) Δθ1 × Δθ3 + (27/40) Δθ2 × (Δθ3 − Δθ1)`.
#[inline]
#[must_use]
pub fn rotation_vector_three_sample(dth1: &Vector3<f64>, dth2: &Vector3<f64>, dth3: &Vector3<f64>) -> Vector3<f64> {
    dth1 + dth2 + dth3 + dth1.cross(dth3) * (9.0 / 20.0) + dth2.cross(&(dth3 - dth1)) * (27.0 / 40.0)
}

/// Velocity increment \[m/s\] of one sample in the body axes of its start, corrected by the
/// sample before: `Δv + ½ Δθ × Δv + (1/12)(Δθ_previous × Δv + Δv_previous × Δθ)`.
#[inline]
#[must_use]
pub fn velocity_one_sample(dth_previous: &Vector3<f64>, dv_previous: &Vector3<f64>, dth: &Vector3<f64>, dv: &Vector3<f64>) -> Vector3<f64> {
    dv + dth.cross(dv) * 0.5 + (dth_previous.cross(dv) + dv_previous.cross(dth)) / 12.0
}

/// Velocity increment \[m/s\] of an interval of two samples in the body axes of its start:
/// `Δv + ½ Δθ × Δv + ⅔ (Δθ1 × Δv2 + Δv1 × Δθ2)`, Δθ = Δθ1 + Δθ2, Δv = Δv1 + Δv2.
#[inline]
#[must_use]
pub fn velocity_two_sample(dth1: &Vector3<f64>, dv1: &Vector3<f64>, dth2: &Vector3<f64>, dv2: &Vector3<f64>) -> Vector3<f64> {
    let (dth, dv) = (dth1 + dth2, dv1 + dv2);
    dv + dth.cross(&dv) * 0.5 + (dth1.cross(dv2) + dv1.cross(dth2)) * (2.0 / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use fusion_core::geometry::so3;
    use nalgebra::UnitQuaternion;

    type V = Vector3<f64>;

    const ALPHA: f64 = 1.0 / 180.0 * core::f64::consts::PI;
    const OMEGA: f64 = 5.0 * TAU;
    const T: f64 = 0.01;

    /// Integral of the body rate of the coning motion `φ = α(0, cos Ωt, sin Ωt)`, closed form.
    fn coning_increment(from: f64, to: f64) -> V {
        let at = |t: f64| {
            let (s, c) = (OMEGA * t).sin_cos();
            V::new(-2.0 * OMEGA * (ALPHA / 2.0).sin().powi(2) * t, ALPHA.sin() * c, ALPHA.sin() * s)
        };
        at(to) - at(from)
    }

    /// Drift \[deg/h\] about the cone axis when 10 s of coning (50 whole turns) are integrated
    /// by `update(q, t)`, one interval T at a time.
    fn drift(update: impl Fn(&UnitQuaternion<f64>, f64) -> UnitQuaternion<f64>) -> f64 {
        let truth = so3::exp(&V::new(0.0, ALPHA, 0.0));
        let mut q = truth;
        for k in 0..1000 {
            q = update(&q, f64::from(k) * T);
        }
        let error = so3::log(&(q * truth.inverse()));
        (error.x / 10.0).to_degrees() * 3600.0
    }

    /// 5 %: the closed forms are leading terms in x = ΩT = 0.31, the next is of order x².
    fn assert_residual(got: f64, deg_per_hour: f64) {
        assert!((got.abs() / deg_per_hour - 1.0).abs() < 0.05, "{got} against {deg_per_hour}");
    }

    /// Δθ of the part of the interval at `t` between these fractions.
    fn part(t: f64, from: f64, to: f64) -> V {
        coning_increment(t + from * T, t + to * T)
    }

    #[test]
    fn coning_residual_without_correction_is_16_15_deg_per_h() {
        assert_residual(drift(|q, t| q * so3::exp(&part(t, 0.0, 1.0))), 16.15);
    }

    #[test]
    fn coning_residual_of_previous_sample_is_0_317_deg_per_h() {
        let increments = drift(|q, t| q * so3::exp(&rotation_vector_one_sample(&part(t, -1.0, 0.0), &part(t, 0.0, 1.0))));
        assert_residual(increments, 0.317);
        let rates = drift(|q, t| {
            let w = part(t, 0.0, 1.0) / T;
            q * so3::exp(&((w + coning_rate(&(part(t, -1.0, 0.0) / T), &w, T)) * T))
        });
        assert_residual(rates, 0.317);
    }

    #[test]
    fn coning_residual_of_two_samples_is_0_0200_deg_per_h() {
        let increments = drift(|q, t| q * so3::exp(&rotation_vector_two_sample(&part(t, 0.0, 0.5), &part(t, 0.5, 1.0))));
        assert_residual(increments, 0.0200);
        let h = T / 2.0;
        let rates = drift(|q, t| {
            let (w1, w2) = (part(t, 0.0, 0.5) / h, part(t, 0.5, 1.0) / h);
            let c = coning_rate(&w1, &w2, h);
            // The first sample is split unevenly: a split must not change the result.
            q * so3::exp(&((w1 + c) * (0.3 * h))) * so3::exp(&((w1 + c) * (0.7 * h))) * so3::exp(&((w2 + c) * h))
        });
        assert_residual(rates, 0.0200);
    }

    #[test]
    fn coning_residual_of_three_samples_is_that_of_miller() {
        let third = 1.0 / 3.0;
        let increments = drift(|q, t| {
            let (a, b) = (part(t, 0.0, third), part(t, third, 2.0 * third));
            q * so3::exp(&rotation_vector_three_sample(&a, &b, &part(t, 2.0 * third, 1.0)))
        });
        let x = OMEGA * T;
        assert_residual(increments, (ALPHA * ALPHA * OMEGA * x.powi(6) / 204_120.0).to_degrees() * 3600.0);
    }

    /// Linear inputs `a + b t`: rate \[rad/s\] and specific force \[m/s²\].
    const W: [V; 2] = [V::new(0.4, -0.7, 0.3), V::new(-1.0, 0.5, 2.0)];
    const F: [V; 2] = [V::new(1.0, 2.0, -9.0), V::new(6.0, -4.0, 3.0)];

    fn integral(x: &[V; 2], from: f64, to: f64) -> V {
        x[0] * (to - from) + x[1] * ((to * to - from * from) / 2.0)
    }

    /// Attitude change and velocity increment over \[from, to\] by 400 Runge-Kutta steps.
    fn truth(from: f64, to: f64) -> (UnitQuaternion<f64>, V) {
        let (n, mut q, mut v) = (400, UnitQuaternion::identity(), V::zeros());
        let h = (to - from) / f64::from(n);
        for k in 0..n {
            let t = from + f64::from(k) * h;
            let w = |t: f64| W[0] + W[1] * t;
            let f = |t: f64| F[0] + F[1] * t;
            let slope = |y: &nalgebra::Vector4<f64>, t: f64| 0.5 * so3::rate_matrix(&w(t)) * y;
            let y = so3::to_scalar_first(&q);
            let k1 = slope(&y, t);
            let k2 = slope(&(y + k1 * (h / 2.0)), t + h / 2.0);
            let k3 = slope(&(y + k2 * (h / 2.0)), t + h / 2.0);
            let k4 = slope(&(y + k3 * h), t + h);
            let middle = so3::from_scalar_first(&(y + k1 * (h / 4.0) + k2 * (h / 4.0)));
            let end = so3::from_scalar_first(&(y + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0)));
            v += (q * f(t) + middle * f(t + h / 2.0) * 4.0 + end * f(t + h)) * (h / 6.0);
            q = end;
        }
        (q, v)
    }

    /// log2 of the ratio of the errors at `t` and `t/2`.
    fn order(error: impl Fn(f64) -> f64, t: f64) -> f64 {
        (error(t) / error(t / 2.0)).log2()
    }

    #[test]
    fn two_sample_coning_error_is_of_fifth_order_for_linear_rates() {
        let error = |t: f64| {
            let phi = rotation_vector_two_sample(&integral(&W, 0.0, t / 2.0), &integral(&W, t / 2.0, t));
            (phi - so3::log(&truth(0.0, t).0)).norm()
        };
        let p = order(error, 0.2);
        assert!(p > 4.8, "{p}"); // 0.2 short of 5: next order at T = 0.2 s
    }

    #[test]
    fn two_sample_sculling_error_is_of_third_order_for_linear_inputs() {
        let error = |t: f64| {
            let h = t / 2.0;
            let dv = velocity_two_sample(
                &integral(&W, 0.0, h),
                &integral(&F, 0.0, h),
                &integral(&W, h, t),
                &integral(&F, h, t),
            );
            (dv - truth(0.0, t).1).norm()
        };
        let p = order(error, 0.05);
        assert!(p > 2.8, "{p}"); // 0.2 short of 3: next order at T = 0.05 s
    }

    #[test]
    fn one_sample_velocity_error_is_of_third_order_for_linear_inputs() {
        let error = |t: f64| {
            let dv = velocity_one_sample(
                &integral(&W, -t, 0.0),
                &integral(&F, -t, 0.0),
                &integral(&W, 0.0, t),
                &integral(&F, 0.0, t),
            );
            (dv - truth(0.0, t).1).norm()
        };
        let p = order(error, 0.05);
        assert!(p > 2.8, "{p}"); // 0.2 short of 3, as above
    }

    /// Composes samples given as (rate, force, duration), corrections included.
    fn compose(samples: &[(V, V, f64)]) -> (UnitQuaternion<f64>, V) {
        let (mut q, mut v) = (UnitQuaternion::identity(), V::zeros());
        for (w, f, dt) in samples {
            v += q * so3::mean_rotated(&(w * *dt), &(f * *dt));
            q *= so3::exp(&(w * *dt));
        }
        (q, v)
    }

    #[test]
    fn pairs_in_rate_form_integrate_linear_inputs_one_order_better_than_without_correction() {
        let run = |t: f64, corrected: f64| {
            let h = t / 2.0;
            let mean = |x: &[V; 2], from: f64| integral(x, from, from + h) / h;
            let (w1, w2, f1, f2) = (mean(&W, 0.0), mean(&W, h), mean(&F, 0.0), mean(&F, h));
            let c = coning_rate(&w1, &w2, h) * corrected;
            let s = sculling_rate(&w1, &f1, &w2, &f2, h) * corrected;
            let (q, v) = compose(&[(w1 + c, f1 + s, h), (w2 + c, f2 + s, h)]);
            let (q_true, v_true) = truth(0.0, t);
            (so3::log(&(q_true.inverse() * q)).norm(), (v - v_true).norm())
        };
        // Orders 4 and more with the corrections, 3 without; 0.2: next order at T = 0.05 s.
        assert!(order(|t| run(t, 1.0).0, 0.05) > 3.8);
        assert!(order(|t| run(t, 1.0).1, 0.05) > 3.8);
        assert!((order(|t| run(t, 0.0).0, 0.05) - 3.0).abs() < 0.2);
        assert!((order(|t| run(t, 0.0).1, 0.05) - 3.0).abs() < 0.2);
    }

    #[test]
    fn unequal_neighbours_are_exact_with_the_documented_effective_duration() {
        let run = |t: f64, duration: fn(f64, f64) -> f64| {
            let before = 1.7 * t; // a late sample
            let w_before = integral(&W, -before, 0.0) / before;
            let w = integral(&W, 0.0, t) / t;
            let phi = (w + coning_rate(&w_before, &w, duration(t, before))) * t;
            so3::log(&(truth(0.0, t).0.inverse() * so3::exp(&phi))).norm()
        };
        let exact = order(|t| run(t, |t, before| 2.0 * t * t / (t + before)), 0.05);
        let plain = order(|t| run(t, |_, before| before), 0.05);
        // Third order is the size of the correction itself; one better when it is exact.
        assert!(exact > 3.8 && plain < 3.2, "{exact} {plain}");
    }
}
