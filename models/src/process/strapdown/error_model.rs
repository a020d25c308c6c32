//! Linear error dynamics of the strapdown mechanisation in the canonical chart.
//!
//! Error = true ⊟ estimate, in this order and in these units:
//!
//! δr     position, north-east-down metres in the geodetic chart at the estimate,
//!        `δr = D δ(φ, λ, h)`, `D = diag(RM+h, (RN+h) cos φ, −1)` taken at the estimate
//! δv     velocity `v_eb_n` \[m/s\]
//! δφ_b   attitude, right perturbation in body axes \[rad\]: `C_nb = Ĉ_nb Exp(δφ_b)`
//! δb_a, δb_g  biases, with `f = f_m − b_a` \[m/s²\] and `w = w_m − b_g` \[rad/s\]
//!
//! ```text
//! δṙ    = rr δr + rv δv
//! δv̇    = vr δr + vv δv + va δφ_b + v_accel δb_a      va = −C_nb [f ×],  v_accel = −C_nb
//! δφ̇_b  = ar δr + av δv + aa δφ_b + a_gyro δb_g       aa = −[w_ib_b ×],  a_gyro = −I
//! ```
//!
//! White noise of accelerometers and gyros enters like their biases.
//!
//! Position   `δr = D δp` gives `δṙ = (D F_pp D⁻¹ + Ḋ D⁻¹) δr + D F_pv δv`, and `D F_pv = I`.
//!            `Ḋ D⁻¹` is the chart moving along with the estimate: `(−vD + R'_M φ̇)/(RM+h)`
//!            north, `(−vD + R'_N φ̇)/(RN+h) − φ̇ tan φ` east, 0 down, with R' = dR/dφ. In the
//!            north-north entry R'_M cancels
//! Velocity   `−(2δw_ie + δw_en) × v = [v×](2δw_ie + δw_en)`; W = ∂w_en/∂v
//! Attitude   `δφ̇_b = δw_nb_b − [w_nb_b×] δφ_b` and
//!            `δw_nb_b = −δb_g − [C_nbᵀ w_in ×] δφ_b − C_nbᵀ δw_in`, whose two cross products
//!            add up to `[w_ib_b ×]`
//! Kept       the change of both radii with latitude, and gravity's change with latitude and height,
//!            which printed error models freeze or round; so the blocks are the exact
//!            derivative of the mechanisation
//! Source     derived as above; equals Titterton and Weston 2004, eqs. 12.19-12.28, and the
//!            east-north-up form of Noureldin et al. 2013, ch. 6, after the change of
//!            coordinates (tested)

use fusion_core::geometry::{so3, wgs84};
use nalgebra::{Matrix3, Vector3};

use super::mechanisation::{Nav, Start};
use crate::earth::{Gravity, LocalEarth, gravity::Gradient};

/// The 3×3 blocks of the error dynamics F; see the module's equations. The first letter names
/// the row, the second the column: r position, v velocity, a attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocks {
    /// Position on position \[1/s\].
    pub rr: Matrix3<f64>,
    /// Position on velocity: the identity.
    pub rv: Matrix3<f64>,
    /// Velocity on position \[1/s²\].
    pub vr: Matrix3<f64>,
    /// Velocity on velocity \[1/s\].
    pub vv: Matrix3<f64>,
    /// Velocity on attitude \[m/s² per rad\].
    pub va: Matrix3<f64>,
    /// Attitude on attitude \[1/s\].
    pub aa: Matrix3<f64>,
    /// Attitude on position \[rad/(m s)\].
    pub ar: Matrix3<f64>,
    /// Attitude on velocity \[rad/m\].
    pub av: Matrix3<f64>,
    /// Velocity on accelerometer bias (and noise): −C_nb.
    pub v_accel: Matrix3<f64>,
    /// Attitude on gyro bias (and noise): −I.
    pub a_gyro: Matrix3<f64>,
}

/// How the Earth's rate and the transport rate change with the place, per metre north and down; they do
/// not change to the east \[rad/(m s)\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ByPlace {
    /// ∂w_ie_n/∂north; it does not change with height.
    earth_rate: Vector3<f64>,
    /// ∂w_en_n/∂north and ∂w_en_n/∂down for a constant velocity.
    transport_rate: [Vector3<f64>; 2],
}

impl ByPlace {
    /// At `earth`, with velocity `v` \[m/s\]; `slopes` are the derivatives of the radii by latitude.
    #[inline]
    pub(crate) fn new(earth: &LocalEarth, v: &Vector3<f64>, slopes: &wgs84::Radii) -> Self {
        let (per_rm, per_rn) = (earth.per_meridian, earth.per_normal);
        let (lat_rate, east) = (v.x * per_rm, v.y * per_rn);
        let shrink = slopes.normal * per_rn;
        let north = Vector3::new(
            -east * shrink,
            lat_rate * (slopes.meridian * per_rm),
            east * (earth.tan_lat() * shrink - earth.per_cos * earth.per_cos),
        );
        let w_en = earth.transport_rate_n(v);
        Self {
            earth_rate: Vector3::new(-earth.sin_lat, 0.0, -earth.cos_lat) * (wgs84::EARTH_RATE * per_rm),
            transport_rate: [north * per_rm, Vector3::new(w_en.x * per_rn, w_en.y * per_rm, w_en.z * per_rn)],
        }
    }

    /// The change of `share` times the Earth's rate and of the transport rate, by metres north and down.
    #[inline]
    fn columns(&self, share: f64) -> [Vector3<f64>; 2] {
        let [north, down] = self.transport_rate;
        [self.earth_rate * share + north, down]
    }

    /// ∂w_ie_n/∂r, 3×3.
    pub(crate) fn earth_rate(&self) -> Matrix3<f64> {
        from_north_and_down(&[self.earth_rate, Vector3::zeros()])
    }

    /// ∂w_en_n/∂r, 3×3.
    pub(crate) fn transport_rate(&self) -> Matrix3<f64> {
        from_north_and_down(&self.transport_rate)
    }
}

/// The matrix of these first and third columns, whose second is zero.
#[inline]
fn from_north_and_down([north, down]: &[Vector3<f64>; 2]) -> Matrix3<f64> {
    Matrix3::new(north.x, 0.0, down.x, north.y, 0.0, down.y, north.z, 0.0, down.z)
}

/// F at the estimate `nav`, with corrected `w_ib_b` \[rad/s\] and `f_ib_b` \[m/s²\].
#[inline]
#[must_use]
pub fn continuous(nav: &Nav, w_ib_b: &Vector3<f64>, f_ib_b: &Vector3<f64>, gravity: Gravity) -> Blocks {
    continuous_at(&Start::of(nav), w_ib_b, f_ib_b, gravity)
}

/// F at the start of a step.
#[inline]
#[must_use]
pub(crate) fn continuous_at(start: &Start, w_ib_b: &Vector3<f64>, f_ib_b: &Vector3<f64>, gravity: Gravity) -> Blocks {
    Linear::at(start, w_ib_b, f_ib_b, gravity).blocks()
}

/// The terms of the blocks of F, so that each block is computed only where it is used: all of them at once exceed the
/// registers. Products by the zeros of a block are left out, because the compiler would have to keep them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linear<'a> {
    start: &'a Start,
    pub(crate) w_ib_b: &'a Vector3<f64>,
    f_ib_b: &'a Vector3<f64>,
    /// dRN/dφ \[m/rad\].
    slope: f64,
    gradient: Gradient,
    by_place: ByPlace,
    /// The elements of W = ∂w_en_n/∂v_eb_n: north by east, east by north, down by east \[1/m\].
    transport: [f64; 3],
}

impl<'a> Linear<'a> {
    #[inline(always)]
    pub(crate) fn at(start: &'a Start, w_ib_b: &'a Vector3<f64>, f_ib_b: &'a Vector3<f64>, gravity: Gravity) -> Self {
        let earth = &start.earth;
        let gradient = gravity.gradient_of(earth.sin_lat, earth.cos_lat, earth.height);
        Self::of(start, w_ib_b, f_ib_b, &earth.radii_slopes(), gradient)
    }

    /// For given derivatives of the radii with latitude and of gravity.
    #[inline(always)]
    fn of(start: &'a Start, w_ib_b: &'a Vector3<f64>, f_ib_b: &'a Vector3<f64>, slopes: &wgs84::Radii, gradient: Gradient) -> Self {
        let earth = &start.earth;
        Self {
            start,
            w_ib_b,
            f_ib_b,
            slope: slopes.normal,
            gradient,
            by_place: ByPlace::new(earth, &start.nav.v_eb_n, slopes),
            transport: [earth.per_normal, -earth.per_meridian, -earth.per_normal * earth.tan_lat()],
        }
    }

    #[inline(always)]
    pub(crate) fn rr(&self) -> Matrix3<f64> {
        let (earth, v) = (&self.start.earth, &self.start.nav.v_eb_n);
        let (per_rm, per_rn, tan) = (earth.per_meridian, earth.per_normal, earth.tan_lat());
        let (lat_rate, east) = (v.x * per_rm, v.y * per_rn);
        #[rustfmt::skip]
        let rr = Matrix3::new(
            -v.z * per_rm, 0.0, lat_rate,
            (v.y * tan - east * self.slope) * per_rm, (self.slope * lat_rate - v.z) * per_rn - lat_rate * tan, east,
            0.0, 0.0, 0.0,
        );
        rr
    }

    #[inline(always)]
    pub(crate) fn vr(&self) -> Matrix3<f64> {
        let v = &self.start.nav.v_eb_n;
        let mut vr = from_north_and_down(&self.by_place.columns(2.0).map(|column| v.cross(&column)));
        vr.m31 += self.gradient.per_latitude * self.start.earth.per_meridian;
        vr.m33 -= self.gradient.per_height;
        vr
    }

    /// \[v ×\] W − \[(2 w_ie + w_en) ×\].
    #[inline(always)]
    pub(crate) fn vv(&self) -> Matrix3<f64> {
        let (earth, v, [n, e, d]) = (&self.start.earth, &self.start.nav.v_eb_n, self.transport);
        let mut vv = -so3::skew(&(2.0 * earth.earth_rate_n() + earth.transport_rate_n(v)));
        vv.m11 -= v.z * e;
        vv.m31 += v.x * e;
        vv.m12 += v.y * d;
        vv.m22 += v.z * n - v.x * d;
        vv.m32 -= v.y * n;
        vv
    }

    #[inline(always)]
    pub(crate) fn va(&self) -> Matrix3<f64> {
        -so3::times_skew(&self.start.c_nb, self.f_ib_b)
    }

    #[inline(always)]
    pub(crate) fn ar(&self) -> Matrix3<f64> {
        let c_nb = &self.start.c_nb;
        -from_north_and_down(&self.by_place.columns(1.0).map(|column| so3::turn_back(c_nb, &column)))
    }

    /// −C_nbᵀ W.
    #[inline(always)]
    pub(crate) fn av(&self) -> Matrix3<f64> {
        let (c, [n, e, d]) = (&self.start.c_nb, self.transport);
        #[rustfmt::skip]
        let av = -Matrix3::new(
            c.m21 * e, c.m11 * n + c.m31 * d, 0.0,
            c.m22 * e, c.m12 * n + c.m32 * d, 0.0,
            c.m23 * e, c.m13 * n + c.m33 * d, 0.0,
        );
        av
    }

    #[inline(always)]
    pub(crate) fn aa(&self) -> Matrix3<f64> {
        -so3::skew(self.w_ib_b)
    }

    /// Velocity by force: C_nb.
    #[inline(always)]
    pub(crate) const fn v_force(&self) -> &Matrix3<f64> {
        &self.start.c_nb
    }

    fn blocks(&self) -> Blocks {
        Blocks {
            rr: self.rr(),
            rv: Matrix3::identity(),
            vr: self.vr(),
            vv: self.vv(),
            va: self.va(),
            aa: self.aa(),
            ar: self.ar(),
            av: self.av(),
            v_accel: -self.v_force(),
            a_gyro: -Matrix3::identity(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::frames::swap_matrix;
    use crate::process::strapdown::mechanisation::derivative;
    use fusion_core::geometry::wgs84::{EARTH_RATE, Geodetic, Radii, radii};
    use nalgebra::SMatrix;

    type V = Vector3<f64>;
    type M = Matrix3<f64>;
    type F9 = SMatrix<f64, 9, 9>;

    const MODELS: [Gravity; 3] = [Gravity::Somigliana, Gravity::TittertonWeston, Gravity::Noureldin];

    #[rustfmt::skip]
    fn cases() -> Vec<(Nav, V, V)> {
        let nav = |lat: f64, height, v, rpy: [f64; 3]| Nav {
            position: Geodetic::new(lat, 2.26, height),
            v_eb_n: v,
            q_nb: so3::from_rpy(rpy[0], rpy[1], rpy[2]),
        };
        vec![
            (
                nav(0.63, -23.0, V::new(150.0, -220.0, 30.0), [0.3, -0.2, 1.9]),
                V::new(0.3, -0.5, 0.8), V::new(2.0, -1.0, -11.0),
            ),
            (
                nav(-1.2, 9000.0, V::new(-200.0, 90.0, -15.0), [-2.0, 1.0, -0.7]),
                V::new(-0.1, 0.2, 0.05), V::new(-4.0, 6.0, -3.0),
            ),
            (
                nav(0.02, 100.0, V::new(50.0, 240.0, 5.0), [0.0, 0.0, 3.0]),
                V::new(0.0, 0.1, -0.3), V::new(0.5, 0.2, -9.8),
            ),
        ]
    }

    /// Time derivative of `truth ⊟ estimate`, both following the nonlinear mechanisation.
    fn error_rate(truth: (&Nav, &V, &V), estimate: (&Nav, &V, &V), gravity: Gravity) -> [V; 3] {
        let (a, b) = (
            derivative(truth.0, truth.1, truth.2, gravity),
            derivative(estimate.0, estimate.1, estimate.2, gravity),
        );
        // Position: central difference in time of ⊟ along both tangents, so that it includes the movement of the chart.
        // 10 s: truncation (v h/R)²/6 = 2e-8, rounding 3e-9 m/20 s.
        let at = |nav: &Nav, rate: &V, t: f64| {
            let p = nav.position;
            Geodetic::new(p.lat + rate.x * t, p.lon + rate.y * t, p.height + rate.z * t)
        };
        let gap = |t: f64| at(truth.0, &a.position, t).difference(&at(estimate.0, &b.position, t));
        let position = (gap(10.0) - gap(-10.0)) / 20.0;
        // Attitude: E = ĈᵀC turns at w − Eᵀŵ in its own axes, an identity.
        let e = estimate.0.q_nb.inverse() * truth.0.q_nb;
        let attitude = so3::right_jacobian_inverse(&so3::log(&e)) * (a.w_nb_b - e.inverse_transform_vector(&b.w_nb_b));
        [position, a.v_eb_n - b.v_eb_n, attitude]
    }

    /// All of F by central differences: rows r, v, a; columns r, v, a, b_a, b_g.
    fn numeric(nav: &Nav, w: &V, f: &V, gravity: Gravity) -> [[M; 5]; 3] {
        // 1 km, 1 m/s, 1e-4 rad, 1e-2 m/s², 1e-4 rad/s: third order over first is at most
        // (1 km/R tan φ)² = 2e-7, rounding less.
        let steps = [1000.0, 1.0, 1e-4, 1e-2, 1e-4];
        let mut out = [[M::zeros(); 5]; 3];
        for (block, size) in steps.into_iter().enumerate() {
            for axis in 0..3 {
                let side = |sign: f64| {
                    let mut d = V::zeros();
                    d[axis] = sign * size;
                    let (mut x, mut w_true, mut f_true) = (*nav, *w, *f);
                    match block {
                        0 => x.position = nav.position.offset(&d),
                        1 => x.v_eb_n += d,
                        2 => x.q_nb *= so3::exp(&d),
                        3 => f_true -= d,
                        _ => w_true -= d,
                    }
                    error_rate((&x, &w_true, &f_true), (nav, w, f), gravity)
                };
                let (plus, minus) = (side(1.0), side(-1.0));
                for row in 0..3 {
                    out[row][block].set_column(axis, &((plus[row] - minus[row]) / (2.0 * size)));
                }
            }
        }
        out
    }

    #[test]
    fn every_block_matches_central_differences_of_the_mechanisation() {
        for gravity in MODELS {
            for (case, (nav, w, f)) in cases().into_iter().enumerate() {
                let b = continuous(&nav, &w, &f, gravity);
                let n = numeric(&nav, &w, &f, gravity);
                let zero = M::zeros();
                #[rustfmt::skip]
                let analytic = [
                    [("rr", b.rr), ("rv", b.rv), ("ra", zero), ("r accel", zero), ("r gyro", zero)],
                    [("vr", b.vr), ("vv", b.vv), ("va", b.va), ("v accel", b.v_accel), ("v gyro", zero)],
                    [("ar", b.ar), ("av", b.av), ("aa", b.aa), ("a accel", zero), ("a gyro", b.a_gyro)],
                ];
                for (row, numeric_row) in analytic.iter().zip(&n) {
                    for ((name, block), numeric) in row.iter().zip(numeric_row) {
                        let error = (block - numeric).amax();
                        // 1e-6 of the block's largest entry: steps above. Zero blocks: rounding
                        // of 1e-16 over the step 1e-4.
                        let allowed = 1e-6 * block.amax() + if block.amax() == 0.0 { 1e-10 } else { 0.0 };
                        assert!(
                            error <= allowed,
                            "block {name}, case {case}, {gravity:?}: {error:e} > {allowed:e}\n{block}{numeric}"
                        );
                    }
                }
            }
        }
    }

    fn put(f: &mut F9, row: usize, column: usize, block: &M) {
        f.fixed_view_mut::<3, 3>(3 * row, 3 * column).copy_from(block);
    }

    #[rustfmt::skip]
    fn canonical(b: &Blocks) -> F9 {
        let mut f = F9::zeros();
        for (row, column, block) in [
            (0, 0, &b.rr), (0, 1, &b.rv), (1, 0, &b.vr), (1, 1, &b.vv),
            (1, 2, &b.va), (2, 0, &b.ar), (2, 1, &b.av), (2, 2, &b.aa),
        ] {
            put(&mut f, row, column, block);
        }
        f
    }

    /// The Earth of the printed model: radii frozen, gravity falling as 2g/(R0 + h).
    fn printed_earth(nav: &Nav) -> (Radii, Gradient) {
        let p = &nav.position;
        let r = radii(p.lat);
        let g = Gravity::TittertonWeston.magnitude(p.lat, p.height);
        let r0 = (r.meridian * r.normal).sqrt();
        (
            Radii {
                meridian: 0.0,
                normal: 0.0,
            },
            Gradient {
                per_latitude: 0.0,
                per_height: -2.0 * g / (r0 + p.height),
            },
        )
    }

    /// Titterton and Weston's F on \[δφ δλ δh | δv NED | ε NED\], error = estimate − truth,
    /// Ĉ = (I − \[ε×\])C, as printed.
    #[rustfmt::skip]
    fn printed_ned(nav: &Nav, f_b: &V, per_height: f64) -> F9 {
        let (e, v) = (LocalEarth::at(&nav.position), &nav.v_eb_n);
        let (rm, rn, s, c, t) = (e.meridian, e.normal, e.sin_lat, e.cos_lat, e.tan_lat());
        let (vn, ve, vd, o) = (v.x, v.y, v.z, EARTH_RATE);
        let mut f = F9::zeros();
        put(&mut f, 0, 0, &M::new(
            0.0, 0.0, -vn / (rm * rm), ve * t / (rn * c), 0.0, -ve / (rn * rn * c), 0.0, 0.0, 0.0,
        ));
        put(&mut f, 0, 1, &M::from_diagonal(&V::new(1.0 / rm, 1.0 / (rn * c), -1.0)));
        put(&mut f, 1, 0, &M::new(
            -ve * (2.0 * o * c + ve / (rn * c * c)), 0.0, ve * ve * t / (rn * rn) - vn * vd / (rm * rm),
            2.0 * o * (vn * c - vd * s) + vn * ve / (rn * c * c), 0.0, -ve * (vn * t + vd) / (rn * rn),
            2.0 * o * ve * s, 0.0, ve * ve / (rn * rn) + vn * vn / (rm * rm) + per_height,
        ));
        put(&mut f, 1, 1, &M::new(
            vd / rm, -2.0 * o * s - 2.0 * ve * t / rn, vn / rm,
            2.0 * o * s + ve * t / rn, (vn * t + vd) / rn, 2.0 * o * c + ve / rn,
            -2.0 * vn / rm, -2.0 * o * c - 2.0 * ve / rn, 0.0,
        ));
        put(&mut f, 1, 2, &so3::skew(&(nav.q_nb * f_b)));
        put(&mut f, 2, 0, &M::new(
            -o * s, 0.0, -ve / (rn * rn), 0.0, 0.0, vn / (rm * rm),
            -o * c - ve / (rn * c * c), 0.0, ve * t / (rn * rn),
        ));
        put(&mut f, 2, 1, &M::new(0.0, 1.0 / rn, 0.0, -1.0 / rm, 0.0, 0.0, 0.0, -t / rn, 0.0));
        put(&mut f, 2, 2, &-so3::skew(&(e.earth_rate_n() + e.transport_rate_n(v))));
        f
    }

    /// Noureldin's F on \[δφ δλ δh | δv ENU | ε ENU\], as printed.
    #[rustfmt::skip]
    fn printed_enu(nav: &Nav, f_b: &V, per_height: f64) -> F9 {
        let (e, v) = (LocalEarth::at(&nav.position), &nav.v_eb_n);
        let (rm, rn, s, c, t) = (e.meridian, e.normal, e.sin_lat, e.cos_lat, e.tan_lat());
        let (ve, vn, vu, o) = (v.y, v.x, -v.z, EARTH_RATE);
        let mut f = F9::zeros();
        put(&mut f, 0, 0, &M::new(
            0.0, 0.0, -vn / (rm * rm), ve * t / (rn * c), 0.0, -ve / (rn * rn * c), 0.0, 0.0, 0.0,
        ));
        put(&mut f, 0, 1, &M::new(0.0, 1.0 / rm, 0.0, 1.0 / (rn * c), 0.0, 0.0, 0.0, 0.0, 1.0));
        put(&mut f, 1, 0, &M::new(
            2.0 * o * (vn * c + vu * s) + ve * vn / (rn * c * c), 0.0, ve * (vu - vn * t) / (rn * rn),
            -2.0 * o * ve * c - ve * ve / (rn * c * c), 0.0, ve * ve * t / (rn * rn) + vn * vu / (rm * rm),
            -2.0 * o * ve * s, 0.0, -ve * ve / (rn * rn) - vn * vn / (rm * rm) - per_height,
        ));
        put(&mut f, 1, 1, &M::new(
            (vn * t - vu) / rn, 2.0 * o * s + ve * t / rn, -2.0 * o * c - ve / rn,
            -2.0 * o * s - 2.0 * ve * t / rn, -vu / rm, -vn / rm,
            2.0 * o * c + 2.0 * ve / rn, 2.0 * vn / rm, 0.0,
        ));
        put(&mut f, 1, 2, &so3::skew(&(swap_matrix() * (nav.q_nb * f_b))));
        put(&mut f, 2, 0, &M::new(
            0.0, 0.0, vn / (rm * rm), -o * s, 0.0, -ve / (rn * rn),
            o * c + ve / (rn * c * c), 0.0, -ve * t / (rn * rn),
        ));
        put(&mut f, 2, 1, &M::new(0.0, -1.0 / rm, 0.0, 1.0 / rn, 0.0, 0.0, t / rn, 0.0, 0.0));
        put(&mut f, 2, 2, &-so3::skew(&V::new(-vn / rm, o * c + ve / rn, o * s + ve * t / rn)));
        f
    }

    /// `x_printed = S x_canonical`, so `F_printed = (S F + Ṡ) S⁻¹`: position to radians and
    /// metres of height, attitude to the navigation frame, error sign turned. Ṡ holds the two
    /// terms that a moving chart adds: of D⁻¹ (radii frozen) and of C_nb.
    fn to_printed(f: &F9, nav: &Nav, w: &V) -> F9 {
        let e = LocalEarth::at(&nav.position);
        let (c_nb, v) = (so3::rotation(&nav.q_nb), &nav.v_eb_n);
        let d = V::new(e.meridian, e.normal * e.cos_lat, -1.0);
        let lat_rate = v.x / e.meridian;
        let d_dot = V::new(-v.z, -v.z * e.cos_lat - e.normal * e.sin_lat * lat_rate, 0.0);
        let w_nb = w - c_nb.tr_mul(&(e.earth_rate_n() + e.transport_rate_n(v)));
        let (mut s, mut s_inverse, mut s_dot) = (F9::zeros(), F9::zeros(), F9::zeros());
        put(&mut s, 0, 0, &M::from_diagonal(&d.map(|x| -1.0 / x)));
        put(&mut s, 1, 1, &-M::identity());
        put(&mut s, 2, 2, &c_nb);
        put(&mut s_inverse, 0, 0, &M::from_diagonal(&-d));
        put(&mut s_inverse, 1, 1, &-M::identity());
        put(&mut s_inverse, 2, 2, &c_nb.transpose());
        put(&mut s_dot, 0, 0, &M::from_diagonal(&d_dot.component_div(&d.component_mul(&d))));
        put(&mut s_dot, 2, 2, &(c_nb * so3::skew(&w_nb)));
        (s * f + s_dot) * s_inverse
    }

    fn assert_blocks_equal(got: &F9, expected: &F9, what: &str) {
        for (row, r) in ["position", "velocity", "attitude"].iter().enumerate() {
            for (column, c) in ["position", "velocity", "attitude"].iter().enumerate() {
                let g = got.fixed_view::<3, 3>(3 * row, 3 * column);
                let x = expected.fixed_view::<3, 3>(3 * row, 3 * column);
                // 1e-9 of the block: rounding where terms of 1 rad/s cancel to Earth rate.
                // 1e-15: zero blocks.
                let error = (g - x).amax();
                assert!(
                    error <= 1e-9 * x.amax() + 1e-15 * f64::from(x.amax() == 0.0),
                    "{what}: {r} on {c}: {error:e}\n{g}{x}"
                );
            }
        }
    }

    #[test]
    fn blocks_match_the_printed_navigation_frame_model_after_the_change_of_coordinates() {
        for (nav, w, f) in cases() {
            let (frozen, gradient) = printed_earth(&nav);
            let b = Linear::of(&Start::of(&nav), &w, &f, &frozen, gradient).blocks();
            let got = to_printed(&canonical(&b), &nav, &w);
            assert_blocks_equal(&got, &printed_ned(&nav, &f, gradient.per_height), "NED");
            // Inputs: printed states ∇ = δb_a enter through C, ε_g = δb_g through −C.
            let c_nb = so3::rotation(&nav.q_nb);
            assert_eq!(-b.v_accel, c_nb);
            assert_eq!(c_nb * b.a_gyro, -c_nb);
        }
    }

    #[test]
    fn blocks_match_the_printed_east_north_up_model_after_swapping_axes() {
        let mut t = F9::identity();
        put(&mut t, 1, 1, &swap_matrix());
        put(&mut t, 2, 2, &swap_matrix());
        for (nav, w, f) in cases() {
            let (frozen, gradient) = printed_earth(&nav);
            let b = Linear::of(&Start::of(&nav), &w, &f, &frozen, gradient).blocks();
            let got = t * to_printed(&canonical(&b), &nav, &w) * t;
            assert_blocks_equal(&got, &printed_enu(&nav, &f, gradient.per_height), "ENU");
        }
    }

    #[test]
    fn what_the_printed_model_leaves_out_is_small() {
        for (nav, w, f) in cases() {
            let (frozen, gradient) = printed_earth(&nav);
            let exact = continuous(&nav, &w, &f, Gravity::Somigliana);
            let printed = Linear::of(&Start::of(&nav), &w, &f, &frozen, gradient).blocks();
            // 2 %: 3 e² of the radii, 0.4 % of the gravity gradient; but not nothing.
            for (a, b) in [(exact.rr, printed.rr), (exact.vr, printed.vr), (exact.ar, printed.ar)] {
                assert!((a - b).amax() < 0.02 * b.amax() && a != b);
            }
        }
    }

    /// A body at rest at the site, with any heading, and the output of ideal sensors.
    fn at_rest(gravity: Gravity) -> (Nav, V, V) {
        let nav = Nav {
            position: Geodetic::new(36.098_277_778_f64.to_radians(), 2.26, 0.0),
            v_eb_n: V::zeros(),
            q_nb: so3::from_rpy(0.1, 0.2, 0.3),
        };
        let e = LocalEarth::at(&nav.position);
        let w = nav.q_nb.inverse_transform_vector(&e.earth_rate_n());
        let f = nav.q_nb.inverse_transform_vector(&V::new(0.0, 0.0, -e.gravity(gravity)));
        (nav, w, f)
    }

    #[test]
    fn schuler_period_is_84_4455_min_at_the_site() {
        let (nav, w, f) = at_rest(Gravity::Somigliana);
        let b = continuous(&nav, &w, &f, Gravity::Somigliana);
        // Velocity tilts, tilt accelerates: δv̈ = F_va F_av δv, −g/(RM+h) north, −g/(RN+h) east.
        let horizontal = (b.va * b.av).fixed_view::<2, 2>(0, 0).determinant();
        let rate = horizontal.powf(0.25); // √(g/R0), R0² = (RM+h)(RN+h)
        let minutes = core::f64::consts::TAU / rate / 60.0;
        // Half of the last digit printed.
        assert!((rate - 1.240_086e-3).abs() < 5e-10, "{rate}");
        assert!((minutes - 84.4455).abs() < 5e-5, "{minutes}");
    }

    #[test]
    fn static_eigenvalues_match_schuler_foucault_earth_rate_and_the_vertical_channel() {
        let gravity = Gravity::TittertonWeston;
        let (nav, w, f) = at_rest(gravity);
        let (frozen, gradient) = printed_earth(&nav);
        let printed = Linear::of(&Start::of(&nav), &w, &f, &frozen, gradient).blocks();
        // 5e-8 1/s: half of the last digit printed, four decimals of 1e-3. As much again for the
        // slope of gravity with latitude, which the printed model leaves out: it moves Schuler ±
        // Foucault by 4.9e-8.
        for (blocks, within) in [(printed, 5e-8), (continuous(&nav, &w, &f, gravity), 1e-7)] {
            let f9 = canonical(&blocks);
            assert!(f9.iter().all(|x| x.is_finite()), "the eigenvalue iteration would not end");
            let eigen = f9.complex_eigenvalues();
            let find = |re: f64, im: f64, within: f64| eigen.iter().any(|z| (z.re - re).hypot(z.im - im) < within);
            for (re, im) in [(0.0, 1.1988e-3), (0.0, 1.2848e-3), (1.7511e-3, 0.0)] {
                assert!(find(re, im, within) && find(-re, -im, within), "{re} {im}: {eigen}");
            }
            // 1e-12: these two are exact but for rounding, of an F of up to 10 m/s².
            assert!(find(0.0, 7.292_115e-5, 1e-12) && find(0.0, -7.292_115e-5, 1e-12), "{eigen}");
            assert!(find(0.0, 0.0, 1e-12), "{eigen}");
        }
    }
}
