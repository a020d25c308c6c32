//! Φ and Q of one step, from the continuous error model or from the step itself.
//!
//! Errors as in [`error_model`](super::error_model): δr NED, δv, δφ_b.
//!
//! Series     Φ = I + FΔt, or + ½F²Δt², F at the start of the step
//! Exact      the derivative of the step itself. With φ = wΔt and Γ as in
//!            [`gamma`](fusion_core::geometry::gamma), over a plane:
//!            δφ⁺ = Γ₀ᵀ δφ + Γ₁ᵀ Δt δw
//!            δv⁺ = δv − C \[Γ₁fΔt ×\] δφ + C Γ₁Δt δf + C ∂(Γ₁f)/∂φ Δt² δw
//!            δr⁺ = δr + δvΔt − C \[Γ₂fΔt² ×\] δφ + C Γ₂Δt² δf + C ∂(Γ₂f)/∂φ Δt³ δw.
//!            Over the ellipsoid the chain rule through [`step`](super::mechanisation::step)
//! Noise      of the series: the trapezoid. Exact: the integral over the step of the effect of white noise on
//!            rate and force in the rest of the step. Van Loan's exponential gives it for constant F; here
//!            F turns with the body. Three Gauss nodes, with an error of 4e-6 if the body turns by 15° in a
//!            step; the Earth's terms, of 1e-4 Δt, are neglected
//! Source     Van Loan 1978; Hartley et al. 2020 (exact integration on SE₂(3))

use super::error_model::{Blocks, ByPlace, Linear};
use super::mechanisation::Nav;
use crate::earth::{Gravity, LocalEarth};
use crate::process::unicycle::carried;
use fusion_core::geometry::gamma::{gamma, gamma_derivative};
use fusion_core::geometry::so3::{self, skew};
use fusion_core::geometry::wgs84::radii_derivative;
use fusion_core::linear::Transition;
use fusion_core::model::{Literal, Order};
use fusion_core::state::{Attitude, Slot, Tangent, Velocity};
use nalgebra::{Matrix3, Vector3};

/// How Φ and Q of a step are computed.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq, Eq)]
#[cfg_attr(
    feature = "declare",
    derive(serde::Deserialize, schemars::JsonSchema),
    serde(rename_all = "snake_case")
)]
pub enum Discretisation {
    /// Φ = I + FΔt. For the attitude block alone, the exact turn of the body, Exp(−ωΔt): I − \[ωΔt ×\] would enlarge
    /// every attitude error by ½|ωΔt|² in each step.
    #[default]
    FirstOrder,
    /// Φ = I + FΔt + ½F²Δt².
    SecondOrder,
    /// Φ is the derivative of the step itself, including the turn of the body in it; Q is the integral of the noise
    /// through the step. An invariant filter needs this.
    Exact,
}

impl From<Discretisation> for Order {
    fn from(discretisation: Discretisation) -> Self {
        match discretisation {
            Discretisation::FirstOrder => Self::First,
            Discretisation::SecondOrder => Self::Second,
            Discretisation::Exact => Self::Exact,
        }
    }
}

type M = Matrix3<f64>;
type V = Vector3<f64>;

/// Exp(−φ), φ \[rad\], to fourth order. The error is |φ|⁵/120: 8e-8 for a body that turns by 5.7° in a step.
#[inline(always)]
fn turn_back(phi: &V) -> M {
    let y = phi.norm_squared();
    let (a, b) = (1.0 - y / 6.0, 0.5 - y / 24.0);
    // [φ×]² = φφᵀ − |φ|² I.
    phi * phi.transpose() * b + M::from_diagonal_element(1.0 - y * b) - so3::skew(&(phi * a))
}

/// `m · diag(d)`.
#[inline]
pub(crate) fn times_diagonal(m: &M, d: &V) -> M {
    #[rustfmt::skip]
    let product = M::new(
        m.m11 * d.x, m.m12 * d.y, m.m13 * d.z,
        m.m21 * d.x, m.m22 * d.y, m.m23 * d.z,
        m.m31 * d.x, m.m32 * d.y, m.m33 * d.z,
    );
    product
}

/// Where position, velocity and attitude are.
#[derive(Debug, Literal)]
pub struct Slots<P> {
    pub(crate) position: Slot<P>,
    pub(crate) velocity: Slot<Velocity>,
    pub(crate) attitude: Slot<Attitude>,
}

impl<P> Clone for Slots<P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for Slots<P> {}

/// Φ in 3×3 blocks of position, velocity, attitude, `None` for a block of the identity; the last two are the responses
/// to an error of specific force and of rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Discrete {
    pub(crate) kinematic: [[Option<M>; 3]; 3],
    pub(crate) by_force: [Option<M>; 3],
    pub(crate) by_rate: [Option<M>; 3],
}

impl<P: Tangent<3>> Slots<P> {
    /// Writes Φ = I + FΔt over the ellipsoid, with the exact turn for the attitude block. Returns the responses to an
    /// error of force and of rate.
    #[inline(always)]
    pub(crate) fn write_first_order(&self, f: &Linear<'_>, dt: f64, out: &mut Transition) -> [[Option<M>; 3]; 2] {
        let (one, r, v, a) = (M::identity(), self.position, self.velocity, self.attitude);
        out.set(r, r, &(one + f.rr() * dt));
        out.set(r, v, &(one * dt));
        out.set(v, r, &(f.vr() * dt));
        out.set(v, v, &(one + f.vv() * dt));
        out.set(v, a, &(f.va() * dt));
        out.set(a, r, &(f.ar() * dt));
        out.set(a, v, &(f.av() * dt));
        out.set(a, a, &turn_back(&(f.w_ib_b * dt)));
        // Errors of force and rate act on velocity and attitude with the sign of +f and +w.
        [[None, Some(f.v_force() * dt), None], [None, None, Some(one * dt)]]
    }

    /// Writes the blocks of `phi` between position, velocity and attitude.
    pub(crate) fn write(&self, phi: &Discrete, out: &mut Transition) {
        let [r, v, a] = &phi.kinematic;
        self.write_row(self.position, r, out);
        self.write_row(self.velocity, v, out);
        self.write_row(self.attitude, a, out);
    }

    #[inline]
    fn write_row<B: Tangent<3>>(&self, row: Slot<B>, [r, v, a]: &[Option<M>; 3], out: &mut Transition) {
        if let Some(block) = r {
            out.set(row, self.position, block);
        }
        if let Some(block) = v {
            out.set(row, self.velocity, block);
        }
        if let Some(block) = a {
            out.set(row, self.attitude, block);
        }
    }

    /// Writes the response of the three blocks to an error of the state `of`. `effect` is its effect, per axis, on the
    /// force or rate to which `column` is the response.
    #[cfg_attr(not(target_pointer_width = "32"), inline(always))]
    pub(crate) fn write_column<B: Tangent<3>>(&self, of: Slot<B>, [r, v, a]: &[Option<M>; 3], effect: &V, out: &mut Transition) {
        if let Some(block) = r {
            out.set(self.position, of, &times_diagonal(block, effect));
        }
        if let Some(block) = v {
            out.set(self.velocity, of, &times_diagonal(block, effect));
        }
        if let Some(block) = a {
            out.set(self.attitude, of, &times_diagonal(block, effect));
        }
    }

    /// Writes Q of white noise on rate and force, of these densities per axis, by the trapezoid.
    #[inline]
    pub(crate) fn write_trapezoid(&self, c_nb: &M, gyro: &V, accel: &V, dt: f64, out: &mut Transition) {
        // Equal noise on all axes is the same in every frame.
        if accel.x == accel.y && accel.y == accel.z {
            out.noise_trapezoid_of_axes(self.velocity, &(accel * dt));
        } else {
            let in_n = times_diagonal(c_nb, accel) * c_nb.transpose();
            out.noise_trapezoid(self.velocity, self.velocity, &(in_n * dt));
        }
        out.noise_trapezoid_of_axes(self.attitude, &(gyro * dt));
    }

    /// The same, exact for the constant rate `w` and force `f` of the step that begins at `c_nb`.
    pub(crate) fn write_exact_noise(&self, c_nb: &M, (w, f): (&V, &V), gyro: &V, accel: &V, dt: f64, out: &mut Transition) {
        let (gyro, accel) = (M::from_diagonal(gyro), M::from_diagonal(accel));
        let [mut rr, mut rv, mut ra, mut vv, mut va, mut aa] = [M::zeros(); 6];
        for (node, weight) in GAUSS {
            // Noise that acts when `rest` seconds of the step remain.
            let (rest, share) = (node * dt, weight * dt);
            let c = c_nb * gamma(0, &(w * (dt - rest)));
            let phi = w * rest;
            let a = gamma(0, &phi).transpose();
            let v = -c * skew(&(gamma(1, &phi) * f * rest));
            let r = -c * skew(&(gamma(2, &phi) * f * (rest * rest)));
            let by_gyro = gyro * share;
            let force = c * accel * c.transpose() * share;
            rr += r * by_gyro * r.transpose() + force * (rest * rest);
            rv += r * by_gyro * v.transpose() + force * rest;
            ra += r * by_gyro * a.transpose();
            vv += v * by_gyro * v.transpose() + force;
            va += v * by_gyro * a.transpose();
            aa += a * by_gyro * a.transpose();
        }
        out.noise(self.position, self.position, &rr);
        out.noise(self.position, self.velocity, &rv);
        out.noise(self.position, self.attitude, &ra);
        out.noise(self.velocity, self.velocity, &vv);
        out.noise(self.velocity, self.attitude, &va);
        out.noise(self.attitude, self.attitude, &aa);
    }
}

/// Nodes and weights of three-point Gauss-Legendre quadrature on \[0, 1\].
pub(crate) const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_31, 5.0 / 18.0),
    (0.5, 4.0 / 9.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Φ = I + FΔt + ½F²Δt² over the ellipsoid.
pub(crate) fn second_order(b: &Blocks, dt: f64) -> Discrete {
    let (zero, one) = (M::zeros(), M::identity());
    let (force, rate) = (-b.v_accel, -b.a_gyro);
    let f = [[b.rr, b.rv, zero], [b.vr, b.vv, b.va], [b.ar, b.av, b.aa]];
    let half = 0.5 * dt * dt;
    let kinematic = core::array::from_fn(|i| {
        core::array::from_fn(|j| {
            let squared = f[i][0] * f[0][j] + f[i][1] * f[1][j] + f[i][2] * f[2][j];
            Some(f[i][j] * dt + squared * half + if i == j { one } else { zero })
        })
    });
    Discrete {
        kinematic,
        by_force: [
            Some(f[0][1] * force * half),
            Some(force * dt + f[1][1] * force * half),
            Some(f[2][1] * force * half),
        ],
        by_rate: [None, Some(f[1][2] * rate * half), Some(rate * dt + f[2][2] * rate * half)],
    }
}

/// The velocity and position increments of a force that turns with the body by φ = wΔt, and their derivatives.
struct Turned {
    /// Γ₀ᵀ.
    back: M,
    /// Γ₁ fΔt \[m/s\] and Γ₂ fΔt² \[m\], body axes at the start.
    moved: [V; 2],
    by_force: [M; 2],
    by_rate: [M; 2],
    /// Γ₁ᵀ Δt.
    turned: M,
}

impl Turned {
    fn new(w: &V, f: &V, dt: f64) -> Self {
        let phi = w * dt;
        let (first, second) = (gamma(1, &phi), gamma(2, &phi));
        let square = dt * dt;
        Self {
            back: gamma(0, &phi).transpose(),
            moved: [first * f * dt, second * f * square],
            by_force: [first * dt, second * square],
            by_rate: [gamma_derivative(1, &phi, f) * square, gamma_derivative(2, &phi, f) * (square * dt)],
            turned: first.transpose() * dt,
        }
    }
}

/// Φ of a step over a plane, by `discretisation`: from attitude `c_nb` with the constant rate `w` and
/// force `f`, gravity constant and the plane at rest.
pub(crate) fn over_plane(discretisation: Discretisation, c_nb: &M, (w, f): (&V, &V), dt: f64) -> Discrete {
    let (one, c) = (M::identity(), c_nb);
    let (force, turn, half) = (skew(f), skew(w), 0.5 * dt * dt);
    let (ra, va, aa, by_force, by_rate) = match discretisation {
        Discretisation::FirstOrder => (
            None,
            -c * force * dt,
            one - turn * dt,
            [None, Some(c * dt), None],
            [None, None, Some(one * dt)],
        ),
        Discretisation::SecondOrder => (
            Some(-c * force * half),
            c * force * (turn * half - one * dt),
            one - turn * dt + turn * turn * half,
            [Some(c * half), Some(c * dt), None],
            [None, Some(-c * force * half), Some(one * dt - turn * half)],
        ),
        Discretisation::Exact => {
            let t = Turned::new(w, f, dt);
            (
                Some(-c * skew(&t.moved[1])),
                -c * skew(&t.moved[0]),
                t.back,
                [Some(c * t.by_force[1]), Some(c * t.by_force[0]), None],
                [Some(c * t.by_rate[1]), Some(c * t.by_rate[0]), Some(t.turned)],
            )
        }
    };
    Discrete {
        kinematic: [[None, Some(one * dt), ra], [None, None, Some(va)], [None, None, Some(aa)]],
        by_force,
        by_rate,
    }
}

/// The derivative of a quantity by the errors of position, velocity, attitude, force and rate.
#[derive(Clone, Copy)]
struct By([M; 5]);

impl core::ops::Add for By {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(core::array::from_fn(|k| self.0[k] + other.0[k]))
    }
}

impl core::ops::Mul<By> for M {
    type Output = By;
    fn mul(self, by: By) -> By {
        By(by.0.map(|block| self * block))
    }
}

/// Φ of [`step`](super::mechanisation::step): its derivative by the chain rule, line by line.
pub(crate) fn over_ellipsoid(nav: &Nav, (w, f): (&V, &V), dt: f64, gravity: Gravity) -> Discrete {
    let (zero, one) = (M::zeros(), M::identity());
    let (c, v, t) = (so3::rotation(&nav.q_nb), &nav.v_eb_n, Turned::new(w, f, dt));
    let dv_n = c * t.moved[0];
    let by_v = By([zero, one, zero, zero, zero]);
    let by_dv = By([zero, zero, -c * skew(&t.moved[0]), c * t.by_force[0], c * t.by_rate[0]]);

    // The place of mid-step, in metres there.
    let to_middle = v * (0.5 * dt);
    let middle = nav.position.offset(&to_middle);
    let (by_place, factor) = carried(&nav.position, &middle, &to_middle.xy());
    let by_middle = By([by_place, M::from_diagonal(&factor.push(1.0)) * (0.5 * dt), zero, zero, zero]);
    let (earth, slopes) = (LocalEarth::at(&middle), radii_derivative(middle.lat));
    let gradient = gravity.gradient(middle.lat, middle.height);
    let g = V::new(0.0, 0.0, earth.gravity(gravity));
    let g_by_place = M::from_rows(&[
        nalgebra::RowVector3::zeros(),
        nalgebra::RowVector3::zeros(),
        nalgebra::RowVector3::new(gradient.per_latitude / earth.meridian, 0.0, -gradient.per_height),
    ]);
    let (w_ie, transport) = (earth.earth_rate_n(), earth.transport_matrix());

    // v_mid = v + ½(Δv + (g − (2w_ie + Tv) × v)Δt).
    let at_start = ByPlace::new(&earth, v, &slopes);
    let swirl = 2.0 * w_ie + transport * v;
    let v_mid = v + 0.5 * (dv_n + (g - swirl.cross(v)) * dt);
    let by_v_mid = (one - (skew(&swirl) - skew(v) * transport) * (0.5 * dt)) * by_v
        + (one * 0.5) * by_dv
        + ((g_by_place + skew(v) * (2.0 * at_start.earth_rate() + at_start.transport_rate())) * (0.5 * dt)) * by_middle;

    // ζ = (w_ie + w_en)Δt, w_en = T v_mid.
    let there = ByPlace::new(&earth, &v_mid, &slopes);
    let by_w_en = there.transport_rate() * by_middle + transport * by_v_mid;
    let by_zeta = (there.earth_rate() * dt) * by_middle + (one * dt) * by_w_en;
    let w_en = transport * v_mid;
    let zeta = (w_ie + w_en) * dt;

    // v⁺ = v + Δv − ½ζ × Δv + (g − (2w_ie + w_en) × v_mid)Δt.
    let by_v_new = by_v
        + (one - skew(&zeta) * 0.5) * by_dv
        + (skew(&dv_n) * 0.5) * by_zeta
        + ((g_by_place + skew(&v_mid) * 2.0 * there.earth_rate()) * dt) * by_middle
        + (skew(&v_mid) * dt) * by_w_en
        + (skew(&(2.0 * w_ie + w_en)) * -dt) * by_v_mid;
    let v_new = v + dv_n - 0.5 * zeta.cross(&dv_n) + (g - (2.0 * w_ie + w_en).cross(&v_mid)) * dt;

    let by_r_new = place_after(
        nav,
        &middle,
        &((v + v_new) * (0.5 * dt)),
        &((one * (0.5 * dt)) * (by_v + by_v_new)),
        &by_middle,
    );

    // q⁺ = Exp(−ζ) ⊗ q ⊗ Exp(φ).
    let to_body = -(t.back * c.transpose() * so3::right_jacobian(&-zeta));
    let by_a_new = By([zero, zero, t.back, zero, t.turned]) + to_body * by_zeta;

    let rows = [by_r_new, by_v_new, by_a_new];
    let column = |k: usize| rows.map(|row| Some(row.0[k]));
    Discrete {
        kinematic: rows.map(|row| [0, 1, 2].map(|k| Some(row.0[k]))),
        by_force: column(3),
        by_rate: column(4),
    }
}

/// The derivative of the position at the end of a step, in metres there. Latitude and longitude change by `travelled`
/// \[m\] over the radii of `middle`, height by the down part of `travelled`.
fn place_after(nav: &Nav, middle: &fusion_core::geometry::wgs84::Geodetic, travelled: &V, by_travelled: &By, by_middle: &By) -> By {
    let (start, earth, slopes) = (LocalEarth::at(&nav.position), LocalEarth::at(middle), radii_derivative(middle.lat));
    let (rm, rn_cos) = (earth.meridian, earth.normal * earth.cos_lat);
    let end = fusion_core::geometry::wgs84::Geodetic {
        lat: nav.position.lat + travelled.x / rm,
        lon: nav.position.lon,
        height: nav.position.height - travelled.z,
    };
    let (north, east) = end.metres_per_radian();
    // The radii of mid-step change with its position: by metres north there, and down.
    let rm_by_place = (slopes.meridian / rm, -1.0);
    let rn_cos_by_place = ((slopes.normal * earth.cos_lat - earth.normal * earth.sin_lat) / rm, -earth.cos_lat);
    let (lat, lon) = (-travelled.x / (rm * rm), -travelled.y / (rn_cos * rn_cos));
    #[rustfmt::skip]
    let by_radii = M::new(
        north * lat * rm_by_place.0, 0.0, north * lat * rm_by_place.1,
        east * lon * rn_cos_by_place.0, 0.0, east * lon * rn_cos_by_place.1,
        0.0, 0.0, 0.0,
    );
    let kept = M::from_diagonal(&V::new(north / start.meridian, east / (start.normal * start.cos_lat), 1.0));
    let zero = M::zeros();
    By([kept, zero, zero, zero, zero]) + M::from_diagonal(&V::new(north / rm, east / rn_cos, 1.0)) * *by_travelled + by_radii * *by_middle
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_keeps_the_length_of_an_attitude_error_at_any_rate_of_a_foot() {
        for degrees in [0.01, 0.5, 2.5, 5.0, 20.0_f64] {
            let phi = V::new(0.6, -0.48, 0.64) * degrees.to_radians();
            let (turn, exact) = (turn_back(&phi), so3::rotation(&so3::exp(&-phi)));
            // The next terms of both series, |φ|⁵/120 and |φ|⁶/720, and rounding.
            let bound = phi.norm().powi(5) / 100.0 + 1e-15;
            assert!((turn - exact).amax() < bound, "{degrees}°: {}", (turn - exact).amax());
            // I − [φ ×] alone makes it longer by half of |φ|² across the axis.
            let grown = (M::identity() - so3::skew(&phi)) * phi.cross(&V::x()).normalize();
            assert!((grown.norm() - 1.0 - 0.5 * phi.norm_squared()).abs() < 0.2 * phi.norm().powi(4) + 1e-15);
        }
    }
}
