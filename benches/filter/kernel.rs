//! The covariance alone.

use crate::dense::P15;
use fusion::core::covariance::{Form, FormKind, Lines, Workspace, cholesky};
use fusion::core::linear::{Jacobian, Transition};
use fusion::core::state::{Declaration, Dynamics, LayoutBuilder, Quantity, Slot, StateRole, Vector};
use nalgebra::{Matrix3, SMatrix, Vector3};
use std::hint::black_box;
use std::sync::Arc;

/// Rows of the measurement: a position and a velocity.
const ROWS: usize = 6;

/// The blocks of I + FΔt of an inertial filter: position, velocity, attitude, gyro bias, accelerometer
/// bias, and their scales.
const PATTERN: [(usize, usize); 13] = [
    (0, 0),
    (0, 1),
    (1, 0),
    (1, 1),
    (1, 2),
    (1, 4),
    (1, 6),
    (2, 0),
    (2, 1),
    (2, 2),
    (2, 3),
    (2, 5),
    (0, 2),
];

/// The blocks of H.
const READ: [(usize, usize); 5] = [(0, 0), (0, 2), (1, 1), (1, 2), (1, 3)];

/// A block of Φ − I or of H: small numbers, none of which is another.
fn block(i: usize, j: usize) -> Matrix3<f64> {
    Matrix3::from_fn(|a, b| 0.01 * ((7 * i + 5 * j + 3 * a + 2 * b) as f64).sin())
}

fn phi(i: usize, j: usize) -> Matrix3<f64> {
    block(i, j) + if i == j { Matrix3::identity() } else { Matrix3::zeros() }
}

fn noise(of: usize) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 3e-4)) * (of + 1) as f64
}

/// P_ij of a filter in the middle of a run.
fn start(i: usize, j: usize) -> f64 {
    let own = if i == j { 1.0 } else { 0.0 };
    own + 0.3 * ((i + j) as f64).cos() * ((i * j) as f64).sin()
}

/// The form that filters have, on blocks of three.
pub struct Composed {
    n: usize,
    form: Arc<dyn Form>,
    start: Lines,
    p: Lines,
    transition: Transition,
    jacobian: Jacobian,
    work: Workspace,
    r: [f64; ROWS * ROWS],
}

impl Composed {
    pub fn new(blocks: usize) -> Self {
        let mut b = LayoutBuilder::new();
        let declare = |k: usize| {
            let declaration = Declaration {
                name: format!("x{k}"),
                owner: String::new(),
                unit: "",
                initial: Vector3::zeros(),
                sigma: vec![1.0; 3],
                dynamics: Dynamics::Process,
                role: StateRole::Kinematic,
            };
            b.declare::<Vector<3>>(declaration).unwrap()
        };
        let slots: Vec<Slot<Vector<3>>> = (0..blocks).map(declare).collect();
        let (layout, n, form) = (b.finish(), 3 * blocks, FormKind::Joseph.form());
        let mut transition = Transition::new(&layout);
        for (i, j) in PATTERN.into_iter().filter(|(i, j)| *i.max(j) < blocks) {
            transition.set(slots[i], slots[j], &phi(i, j));
        }
        (1..3).for_each(|k| transition.noise_trapezoid(slots[k], slots[k], &noise(k)));
        let mut jacobian = Jacobian::new(&layout, ROWS);
        jacobian.reset(ROWS);
        for (i, j) in READ {
            jacobian.add(3 * i, &Quantity::State(slots[j]), &phi(i, j));
        }
        let mut p = Lines::zeros(form.storage(n));
        let numbers: Vec<f64> = (0..n * n).map(|k| start(k / n, k % n)).collect();
        form.set_block(n, &mut p, 0..n, &numbers);
        Self {
            n,
            work: Workspace::new(form.as_ref(), n, ROWS),
            form,
            start: p.clone(),
            p,
            transition,
            jacobian,
            r: std::array::from_fn(|k| if k / ROWS == k % ROWS { 1.0 } else { 0.0 }),
        }
    }

    pub fn predict(&mut self, steps: usize) {
        self.p.copy_from_slice(&self.start);
        for _ in 0..steps {
            assert!(self.form.predict(self.n, &mut self.p, &self.transition, &mut self.work));
        }
        black_box(&self.p);
    }

    pub fn update(&mut self, updates: usize) {
        self.p.copy_from_slice(&self.start);
        for _ in 0..updates {
            let w = &mut self.work;
            self.form.project(self.n, &self.p, &self.jacobian, w);
            w.s.iter_mut().zip(&w.hph).zip(&self.r).for_each(|((s, p), r)| *s = p + r);
            assert!(cholesky(&w.s, &mut w.l, ROWS));
            w.gain(ROWS);
            self.form.condition(self.n, &mut self.p, &self.jacobian, &self.r, w);
        }
        black_box(&self.p);
    }

    /// The first 15 states of both, after a prediction and after an update; scales of a sensor do not
    /// move these where there are none.
    pub fn agrees(&mut self, rival: &Dense) {
        if self.n != 15 {
            return;
        }
        let apart = |p: &[f64], wanted: &P15| {
            (0..225)
                .map(|k| (p[k / 15 * 16 + k % 15] - wanted[(k / 15, k % 15)]).abs())
                .fold(0.0, f64::max)
        };
        self.predict(1);
        // 1e-14: sums of fifteen products of numbers of one.
        assert!(apart(&self.p, &rival.predict(1)) < 1e-14);
        self.update(1);
        assert!(apart(&self.p, &rival.update(1)) < 1e-14);
    }
}

/// The same of 15 states on dense matrices.
pub struct Dense {
    start: P15,
    phi: P15,
    half: P15,
    h: SMatrix<f64, ROWS, 15>,
    r: SMatrix<f64, ROWS, ROWS>,
}

impl Dense {
    pub fn new() -> Self {
        let mut all = Self {
            start: P15::from_fn(start),
            phi: P15::identity(),
            half: P15::zeros(),
            h: SMatrix::zeros(),
            r: SMatrix::identity(),
        };
        for (i, j) in PATTERN.into_iter().filter(|(i, j)| *i.max(j) < 5) {
            all.phi.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&phi(i, j));
        }
        for k in 1..3 {
            all.half.fixed_view_mut::<3, 3>(3 * k, 3 * k).copy_from(&(noise(k) * 0.5));
        }
        for (i, j) in READ {
            all.h.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&phi(i, j));
        }
        all
    }

    pub fn predict(&self, steps: usize) -> P15 {
        let mut p = self.start;
        for _ in 0..steps {
            p = black_box(self.phi) * (p + self.half) * self.phi.transpose() + self.half;
        }
        black_box(p)
    }

    pub fn update(&self, updates: usize) -> P15 {
        let mut p = self.start;
        for _ in 0..updates {
            let h = black_box(self.h);
            let hp = h * p;
            let s = hp * h.transpose() + self.r;
            let gain = s.cholesky().expect("positive").solve(&hp).transpose();
            let keep = P15::identity() - gain * h;
            p = keep * p * keep.transpose() + gain * self.r * gain.transpose();
        }
        black_box(p)
    }
}
