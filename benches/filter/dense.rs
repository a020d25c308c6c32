//! The filter that an engineer would write by hand.

use crate::composed::{DT, fix, sample};
use fusion::core::belief::Belief;
use fusion::core::geometry::so3;
use fusion::core::state::{Attitude, Geodetic, Manifold};
use fusion::models::earth::Gravity;
use fusion::models::process::strapdown::{error_model, increments, mechanisation};
use mechanisation::Nav;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use std::hint::black_box;

/// The samples of the inertial unit, enough for every run here.
pub fn samples() -> Vec<[f64; 6]> {
    (0..2000).map(sample).collect()
}

const LEVER_ARM: Vector3<f64> = Vector3::new(0.4, -0.2, -1.1);

pub type P15 = SMatrix<f64, 15, 15>;

/// The filter that an engineer would write by hand for this one design.
#[derive(Clone)]
pub struct Dense {
    pub nav: Nav,
    pub gyro_bias: Vector3<f64>,
    pub accel_bias: Vector3<f64>,
    pub covariance: P15,
    q_white: P15,
    q_walk: P15,
    r: Matrix3<f64>,
}

impl Dense {
    pub fn new(start: &Belief, noise: &[f64; 9]) -> Self {
        let x = &start.x;
        let three = |i: usize| Vector3::new(x[i], x[i + 1], x[i + 2]);
        let psd = |noise: f64| noise * noise * DT;
        let diagonal = |at: [usize; 2], q: [f64; 2]| {
            P15::from_fn(|i, j| {
                if i == j {
                    (0..2).map(|k| if i / 3 == at[k] { q[k] } else { 0.0 }).sum()
                } else {
                    0.0
                }
            })
        };
        let gyro = 0.2_f64.to_radians() / 60.0;
        Self {
            nav: Nav {
                position: Geodetic::read(x),
                v_eb_n: three(3),
                q_nb: Attitude::read(&x[6..]),
            },
            gyro_bias: three(10),
            accel_bias: three(13),
            covariance: P15::from_row_slice(&start.covariance.to_dense()),
            q_white: diagonal([1, 2], [psd(70e-6 * 9.80665), psd(gyro)]),
            q_walk: diagonal([3, 4], [psd(1e-6), psd(1e-4)]),
            r: Matrix3::from_row_slice(noise),
        }
    }

    pub fn predict(&mut self, now: &[f64; 6], before: &[f64; 6]) {
        let rate = |s: &[f64; 6]| Vector3::new(s[0], s[1], s[2]) - self.gyro_bias;
        let force = |s: &[f64; 6]| Vector3::new(s[3], s[4], s[5]) - self.accel_bias;
        let (w, f, w0, f0) = (rate(now), force(now), rate(before), force(before));
        let b = error_model::continuous(&self.nav, &w, &f, Gravity::Somigliana);
        let mut phi = P15::identity();
        let mut add = |row: usize, column: usize, block: &Matrix3<f64>| {
            let mut view = phi.fixed_view_mut::<3, 3>(3 * row, 3 * column);
            view += block * DT;
        };
        add(0, 0, &b.rr);
        add(0, 1, &b.rv);
        add(1, 0, &b.vr);
        add(1, 1, &b.vv);
        add(1, 2, &b.va);
        add(1, 4, &b.v_accel);
        add(2, 0, &b.ar);
        add(2, 1, &b.av);
        add(2, 3, &b.a_gyro);
        // The attitude block is the exact turn of the body: I − [ωΔt ×] would enlarge every attitude error.
        phi.fixed_view_mut::<3, 3>(6, 6).copy_from(&so3::rotation(&so3::exp(&(w * -DT))));
        let half = self.q_white * 0.5;
        self.covariance = phi * (self.covariance + half) * phi.transpose() + half + self.q_walk;
        let (wc, fc) = (
            w + increments::coning_rate(&w0, &w, DT),
            f + increments::sculling_rate(&w0, &f0, &w, &f, DT),
        );
        self.nav = mechanisation::step(&self.nav, &wc, &fc, DT, Gravity::Somigliana);
    }

    /// Makes `steps` predictions from here.
    pub fn predictions(&self, samples: &[[f64; 6]], steps: usize) {
        let mut all = self.clone();
        (501..501 + steps).for_each(|k| all.predict(&samples[k], &samples[k - 1]));
        black_box(&all);
    }

    /// Makes `steps` predictions from here, and one update by a fix.
    pub fn second(&self, samples: &[[f64; 6]], steps: usize) {
        let mut all = self.clone();
        for k in 501..501 + steps {
            if k == 600 {
                all.update(&fix(k));
            }
            all.predict(&samples[k], &samples[k - 1]);
        }
        black_box(&all);
    }

    /// Makes `updates` updates from here, all by the same fix.
    pub fn updates(&self, updates: usize) {
        let (mut all, z) = (self.clone(), fix(500));
        (0..updates).for_each(|_| all.update(black_box(&z)));
        black_box(&all);
    }

    pub fn update(&mut self, z: &[f64; 3]) {
        let c_nb = so3::rotation(&self.nav.q_nb);
        let predicted = self.nav.position.offset(&(c_nb * LEVER_ARM));
        let residual = Geodetic::read(z).difference(&predicted);
        let mut h = SMatrix::<f64, 3, 15>::zeros();
        h.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        h.fixed_view_mut::<3, 3>(0, 6).copy_from(&(-c_nb * so3::skew(&LEVER_ARM)));
        let hp = h * self.covariance;
        let s = hp * h.transpose() + self.r;
        let gain = s.cholesky().expect("positive").solve(&hp).transpose();
        let keep = P15::identity() - gain * h;
        self.covariance = keep * self.covariance * keep.transpose() + gain * self.r * gain.transpose();
        let d: SVector<f64, 15> = gain * residual;
        let three = |i: usize| d.fixed_rows::<3>(i).into_owned();
        self.nav.position = self.nav.position.offset(&three(0));
        self.nav.v_eb_n += three(3);
        self.nav.q_nb *= so3::exp(&three(6));
        self.nav.q_nb.renormalize();
        self.gyro_bias += three(9);
        self.accel_bias += three(12);
    }
}
