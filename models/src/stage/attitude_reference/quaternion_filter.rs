//! The orientation Kalman filter: its state is the quaternion itself, with a gyro bias beside it.
//!
//! State      x = [q; b],  q = `q_nb` scalar first, b the gyro bias \[rad/s\]
//! Predicted  q⁺ by the quaternion kinematics at w = w_m − b,  b⁺ = b
//!            Φ = [I₄ + ½Ω(w)Δt, −½Ξ(q)Δt; 0, I₃],  Ξ(q) = [−q_vᵀ; q0 I + [q_v ×]]
//!            Q = diag(¼Δt² Ξ Σ_g Ξᵀ, q_b Δt I₃),  Σ_g = N_g²/Δt I₃
//! Measured   z = a quaternion, H = [I₄ 0]; its sign is turned where z·q < 0
//!            a heading: H = 2 sᵀ Lᵀ, L(q) the columns [0, e_i] ⊗ q, s = ∂ψ/∂ε, of whose
//!            correction only the turn about down reaches q
//! Kept       q has length 1 after every step; P by Joseph's form, which holds for any gain
//! Without    P_bb = 0 and q_b = 0 the filter is that of the quaternion alone
//! Not here   the constraint |q| = 1 in P: its radial part is fed by R and bled by K alone
//! Source     Φ, Q: Sabatini 2006, IEEE Trans. Biomed. Eng. 53(7), eqs. 5-12

#![expect(non_snake_case, reason = "the letters of the Kalman filter, defined above")]

use fusion_core::geometry::so3;
use nalgebra::{Matrix3, Matrix4, Matrix4x3, SMatrix, SVector, UnitQuaternion, Vector3};

type Matrix7 = SMatrix<f64, 7, 7>;

/// Ξ(q), 4×3: q̇ = ½ Ξ(q) w.
#[inline]
#[must_use]
pub fn rate_columns(q: &UnitQuaternion<f64>) -> Matrix4x3<f64> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    #[rustfmt::skip]
    let xi = Matrix4x3::new(
        -x, -y, -z,
        w, -z, y,
        z, w, -x,
        -y, x, w,
    );
    xi
}

/// The columns [0, e_i] ⊗ q, 4×3: a turn ε \[rad\] in navigation axes gives δq = ½ columns ε.
#[inline]
#[must_use]
pub fn turn_columns(q: &UnitQuaternion<f64>) -> Matrix4x3<f64> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    #[rustfmt::skip]
    let columns = Matrix4x3::new(
        -x, -y, -z,
        w, z, -y,
        -z, w, x,
        y, -x, w,
    );
    columns
}

/// P_q, 4×4, of an attitude error covariance in body axes \[rad²\]: ¼ Ξ P_φ Ξᵀ.
#[inline]
#[must_use]
pub fn of_body_axes(q: &UnitQuaternion<f64>, p: &Matrix3<f64>) -> Matrix4<f64> {
    let xi = rate_columns(q);
    xi * p * xi.transpose() * 0.25
}

/// The radial variance of a measured quaternion: its length says nothing of the attitude, and
/// that z − q of a large turn has a radial part must not be believed.
const RADIAL: f64 = 1.0;

/// R, 4×4, of a measured attitude whose error covariance in body axes is `p` \[rad²\].
#[inline]
#[must_use]
pub fn measured_in_body_axes(q: &UnitQuaternion<f64>, p: &Matrix3<f64>) -> Matrix4<f64> {
    let v = so3::to_scalar_first(q);
    of_body_axes(q, p) + v * v.transpose() * RADIAL
}

/// How the quaternion is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kinematics {
    /// q + q̇Δt, normalised.
    Literal,
    /// q ⊗ Exp(wΔt).
    Exact,
}

/// The belief of the orientation filter.
#[derive(Clone, Debug)]
pub struct QuaternionFilter {
    /// Attitude, body to navigation.
    pub q: UnitQuaternion<f64>,
    /// Gyro bias \[rad/s\].
    pub bias: Vector3<f64>,
    P: Matrix7,
}

impl QuaternionFilter {
    /// From an attitude with its covariance about the body axes \[rad²\] and a bias with its 1σ
    /// \[rad/s\].
    #[must_use]
    pub fn new(q: UnitQuaternion<f64>, p_b: &Matrix3<f64>, bias: Vector3<f64>, bias_sigma: &Vector3<f64>) -> Self {
        let mut P = Matrix7::zeros();
        P.fixed_view_mut::<4, 4>(0, 0).copy_from(&of_body_axes(&q, p_b));
        P.fixed_view_mut::<3, 3>(4, 4)
            .copy_from(&Matrix3::from_diagonal(&bias_sigma.component_mul(bias_sigma)));
        Self { q, bias, P }
    }

    /// Carries the belief over `dt` \[s\] at the rate `w_nb_b` \[rad/s\], free of the bias.
    pub fn predict(&mut self, w_nb_b: &Vector3<f64>, dt: f64, gyro_psd: &Matrix3<f64>, bias_psd: &Matrix3<f64>, kinematics: Kinematics) {
        let xi = rate_columns(&self.q);
        let mut F = Matrix7::identity();
        let turning = Matrix4::identity() + so3::rate_matrix(w_nb_b) * (0.5 * dt);
        F.fixed_view_mut::<4, 4>(0, 0).copy_from(&turning);
        F.fixed_view_mut::<4, 3>(0, 4).copy_from(&(xi * (-0.5 * dt)));
        self.P = F * self.P * F.transpose();
        // ¼Δt² Ξ (N²/Δt) Ξᵀ.
        let mut q_block = self.P.fixed_view_mut::<4, 4>(0, 0);
        q_block += xi * gyro_psd * xi.transpose() * (0.25 * dt);
        let mut b_block = self.P.fixed_view_mut::<3, 3>(4, 4);
        b_block += bias_psd * dt;
        self.q = match kinematics {
            Kinematics::Literal => so3::integrate_literal(&self.q, w_nb_b, dt),
            Kinematics::Exact => so3::integrate_exact(&self.q, w_nb_b, dt),
        };
        self.q.renormalize();
    }

    /// Takes the quaternion `z` with covariance `R`. Nothing changes where P + R is singular.
    pub fn update(&mut self, z: &UnitQuaternion<f64>, R: &Matrix4<f64>) {
        let x = so3::to_scalar_first(&self.q);
        let z = so3::to_scalar_first(z);
        let z = if z.dot(&x) < 0.0 { -z } else { z };
        let columns = self.P.fixed_columns::<4>(0).into_owned();
        let Some(S) = (columns.fixed_rows::<4>(0) + R).cholesky() else {
            return;
        };
        let K = S.solve(&columns.transpose()).transpose();
        let correction = K * (z - x);
        let mut I_KH = Matrix7::identity();
        let mut left = I_KH.fixed_columns_mut::<4>(0);
        left -= K;
        self.P = I_KH * self.P * I_KH.transpose() + K * R * K.transpose();
        self.correct(&correction);
    }

    /// Variance of the turn about down \[rad²\].
    #[must_use]
    pub fn heading_variance(&self) -> f64 {
        let axis = turn_columns(&self.q).column(2) * 2.0;
        (axis.transpose() * self.P.fixed_view::<4, 4>(0, 0) * axis)[0]
    }

    /// Takes a heading by which the attitude is wrong: `turn` = `slope`·ε \[rad\] of `variance`
    /// \[rad²\], ε the turn in navigation axes. Only the heading is corrected, and of the bias its
    /// part about the vertical, if `gate`, asked with turn² and its variance, lets it. Whether it did.
    pub fn update_heading(&mut self, turn: f64, slope: &Vector3<f64>, variance: f64, gate: impl FnOnce(f64, f64) -> bool) -> bool {
        let columns = turn_columns(&self.q);
        let mut H = SVector::<f64, 7>::zeros();
        H.fixed_rows_mut::<4>(0).copy_from(&(columns * slope * 2.0));
        let PH = self.P * H;
        let S = H.dot(&PH) + variance;
        if S.is_nan() || S <= 0.0 || !gate(turn * turn, S) {
            return false;
        }
        // Roll and pitch are the vertical's business: what a disturbed field would do to them is
        // worse than what an undisturbed one adds.
        let mut K = PH / S;
        let (axis, down) = (columns.column(2) * 0.5, self.q.inverse_transform_vector(&Vector3::z()));
        let heading = axis * (4.0 * axis.dot(&K.fixed_rows::<4>(0)));
        let bias = down * down.dot(&K.fixed_rows::<3>(4));
        K.fixed_rows_mut::<4>(0).copy_from(&heading);
        K.fixed_rows_mut::<3>(4).copy_from(&bias);
        let I_KH = Matrix7::identity() - K * H.transpose();
        self.P = I_KH * self.P * I_KH.transpose() + K * K.transpose() * variance;
        self.correct(&(K * turn));
        true
    }

    fn correct(&mut self, dx: &SVector<f64, 7>) {
        self.q = so3::from_scalar_first(&(so3::to_scalar_first(&self.q) + dx.fixed_rows::<4>(0)));
        self.bias += dx.fixed_rows::<3>(4);
        self.P = (self.P + self.P.transpose()) * 0.5;
    }

    /// 1σ about the body axes \[rad\]: √diag(4 Ξᵀ P Ξ).
    #[must_use]
    pub fn attitude_sigma(&self) -> Vector3<f64> {
        let xi = rate_columns(&self.q);
        let p = xi.transpose() * self.P.fixed_view::<4, 4>(0, 0) * xi * 4.0;
        p.diagonal().map(|v| v.max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector4;

    const NO_BIAS: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

    fn filter(sigma: f64, bias_sigma: f64) -> QuaternionFilter {
        let q = so3::from_rpy(0.3, -0.4, 2.0);
        let p = Matrix3::identity() * sigma * sigma;
        QuaternionFilter::new(q, &p, NO_BIAS, &Vector3::repeat(bias_sigma))
    }

    fn difference(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> Vector4<f64> {
        so3::to_scalar_first(a) - so3::to_scalar_first(b)
    }

    #[test]
    fn both_sets_of_columns_are_derivatives_of_small_turns() {
        let (q, w) = (so3::from_rpy(0.3, -0.4, 2.0), Vector3::new(0.2, -0.5, 0.9));
        let v = so3::to_scalar_first(&q);
        assert!((rate_columns(&q) * w - so3::rate_matrix(&w) * v).norm() < 1e-15); // rounding
        let step = w * 1e-6;
        // Beyond first order ε² = 1e-12.
        assert!((difference(&(q * so3::exp(&step)), &q) - rate_columns(&q) * step * 0.5).norm() < 1e-12);
        assert!((difference(&(so3::exp(&step) * q), &q) - turn_columns(&q) * step * 0.5).norm() < 1e-12);
    }

    #[test]
    fn the_prediction_is_linearised_truly_in_attitude_and_bias() {
        let (dt, w) = (0.01, Vector3::new(0.2, -0.5, 0.9));
        let none = Matrix3::zeros();
        for kinematics in [Kinematics::Literal, Kinematics::Exact] {
            let run = |off: &Vector3<f64>, bias: &Vector3<f64>| {
                let mut f = filter(0.0, 0.0);
                f.q *= so3::exp(off);
                f.predict(&(w - bias), dt, &none, &none, kinematics);
                f.q
            };
            let h = 1e-6;
            for axis in 0..6 {
                let (mut off, mut bias) = (NO_BIAS, NO_BIAS);
                if axis < 3 {
                    off[axis] = h
                } else {
                    bias[axis - 3] = h
                }
                let slope = difference(&run(&off, &bias), &run(&-off, &-bias)) / (2.0 * h);
                // P of an error along one axis becomes slope slopeᵀ.
                let mut f = filter(0.0, 0.0);
                let mut p = Matrix7::zeros();
                let mut error = SVector::<f64, 7>::zeros();
                if axis < 3 {
                    error.fixed_rows_mut::<4>(0).copy_from(&(rate_columns(&f.q).column(axis) * 0.5));
                } else {
                    error[axis + 1] = 1.0;
                }
                p += error * error.transpose();
                f.P = p;
                f.predict(&w, dt, &none, &none, kinematics);
                let got = f.P.fixed_view::<4, 4>(0, 0).into_owned();
                // Φ is of first order: (wΔt)² = 1e-4 relative; by the bias also the half step.
                let tolerance = if axis < 3 { 1e-4 } else { 2e-2 * slope.norm_squared() };
                assert!((got - slope * slope.transpose()).norm() < tolerance, "{kinematics:?}, axis {axis}");
            }
        }
    }

    #[test]
    fn the_covariance_given_is_the_sigma_returned() {
        let p = Vector3::new(0.01, 0.02, 0.05);
        let q = so3::from_rpy(0.3, -0.4, 2.0);
        let f = QuaternionFilter::new(q, &Matrix3::from_diagonal(&p.component_mul(&p)), NO_BIAS, &NO_BIAS);
        assert!((f.attitude_sigma() - p).norm() < 1e-15); // rounding
        assert!((filter(0.03, 0.0).heading_variance() - 9e-4).abs() < 1e-15);
    }

    #[test]
    fn a_measured_quaternion_moves_the_estimate_by_its_gain_whatever_its_sign() {
        let turn = Vector3::new(1e-3, -2e-3, 3e-3);
        for sign in [1.0, -1.0] {
            let mut f = filter(0.03, 0.0);
            let before = f.q;
            let z = UnitQuaternion::new_unchecked((before * so3::exp(&turn)).into_inner() * sign);
            f.update(&z, &(Matrix4::identity() * (0.04 * 0.04 / 4.0)));
            // K = 9/(9 + 16) about every axis; 1e-5: second order in the turn.
            assert!((so3::log(&(before.inverse() * f.q)) - turn * 0.36).norm() < 1e-5 * turn.norm());
            assert!((f.attitude_sigma() - Vector3::repeat(0.03 * 0.8)).norm() < 1e-5); // √(1 − K) = 0.8
            assert!((f.q.norm() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn a_vertical_says_nothing_of_the_heading_however_wrong_it_is() {
        let mut f = filter(0.03, 0.0);
        let before = f.q;
        // Half a radian of tilt: z − q then has a radial part, too.
        let z = so3::exp(&Vector3::new(0.3, -0.4, 0.0)) * before;
        let c_nb = so3::rotation(&before);
        let p_b = c_nb.transpose() * Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 100.0)) * c_nb;
        f.update(&z, &measured_in_body_axes(&before, &p_b));
        let moved = so3::log(&(f.q * before.inverse()));
        // K = 0.9 along the tangent of the unit sphere and none along its radius.
        let turn = 2.0 * (0.9 * 0.25_f64.sin()).atan();
        assert!((moved - Vector3::new(0.6, -0.8, 0.0) * turn).norm() < 1e-6, "{moved}");
        // P is not turned along with q, a quarter of a radian on the unit sphere: cos² = 0.95.
        assert!((f.heading_variance() / 9e-4 - 1.0).abs() < 0.05, "{}", f.heading_variance() / 9e-4);
    }

    #[test]
    fn many_weak_verticals_bring_a_large_tilt_home() {
        let mut f = filter(0.03, 0.0);
        let vertical = |q: &UnitQuaternion<f64>, z: &UnitQuaternion<f64>, f: &mut QuaternionFilter| {
            let c_nb = so3::rotation(q);
            let p_b = c_nb.transpose() * Matrix3::from_diagonal(&Vector3::new(1e-2, 1e-2, 100.0)) * c_nb;
            f.update(z, &measured_in_body_axes(q, &p_b));
        };
        // Corrections, turns and a heading well known mix the radial part of P with the others.
        for k in 0..400 {
            f.predict(
                &Vector3::new(1.0, -2.0, 0.5),
                0.01,
                &(Matrix3::identity() * 1e-5),
                &Matrix3::zeros(),
                Kinematics::Exact,
            );
            let q = f.q;
            let wobble = so3::exp(&Vector3::new(0.3 * f64::from(k).sin(), 0.3 * f64::from(k).cos(), 0.0));
            vertical(&q, &(wobble * q), &mut f);
            f.update_heading(0.0, &Vector3::new(-1.0, 0.5, 1.0), 1e-2, |_, _| true);
        }
        let variance = f.attitude_sigma().norm_squared() / 3.0;
        let z = so3::exp(&Vector3::new(0.3, -0.4, 0.0)) * f.q;
        for _ in 0..300 {
            let q = f.q;
            vertical(&q, &z, &mut f);
        }
        let left = so3::log(&(z * f.q.inverse())).xy().norm();
        // The share of the prior of half a radian, a third more: the variance is a mean over axes. Were the radial
        // part of z − q believed, it would hold the tilt where it is.
        let share = 1.0 / (1.0 + 300.0 * variance / 1e-2);
        assert!(left < 1.3 * share * 0.5, "{left} {share}");
    }

    #[test]
    fn a_heading_corrects_the_heading_alone_and_the_bias_about_the_vertical() {
        let mut f = filter(0.03, 0.02);
        for _ in 0..100 {
            f.predict(&NO_BIAS, 0.01, &Matrix3::zeros(), &Matrix3::zeros(), Kinematics::Exact);
        }
        let (before, sigma2) = (f.q, f.heading_variance());
        assert!((sigma2 / (9e-4 + 4e-4) - 1.0).abs() < 1e-6, "a bias for a second: {sigma2}");
        let slope = Vector3::new(-0.5, 0.3, 1.0);
        assert!(!f.clone().update_heading(0.1, &slope, 1e-4, |_, _| false));
        assert!(f.update_heading(0.1, &slope, 1e-4, |_, _| true));
        let moved = so3::log(&(f.q * before.inverse()));
        // 1e-12: an additive step along a tangent, normalised, is a turn about the same axis.
        assert!(moved.xy().norm() < 1e-12 && moved.z > 0.05, "{moved}");
        let bias_n = before * f.bias;
        assert!(bias_n.xy().norm() < 1e-12 && bias_n.z < 0.0, "{bias_n}");
        assert!(f.heading_variance() < sigma2);
    }
}
