//! The covariance alone.

use fusion::core::covariance::{Form, FormKind, Lines, Workspace, cholesky};
use fusion::core::linear::{Jacobian, Transition};
use fusion::core::state::{Declaration, Dynamics, LayoutBuilder, Quantity, Slot, StateRole, Vector};
use nalgebra::{Matrix3, Vector3};
use std::hint::black_box;
use std::sync::Arc;

/// The blocks of I + FΔt of an inertial filter: position, velocity, attitude, gyro bias, accelerometer
/// bias, and their scales.
pub const PATTERN: [(usize, usize); 13] = [
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

/// The blocks of H of a position and a velocity; the first two are those of the position.
pub const READ: [(usize, usize); 5] = [(0, 0), (0, 2), (1, 1), (1, 2), (1, 3)];

/// A block of Φ − I or of H: small numbers, none of which is another.
pub fn block(i: usize, j: usize) -> Matrix3<f64> {
    Matrix3::from_fn(|a, b| 0.01 * ((7 * i + 5 * j + 3 * a + 2 * b) as f64).sin())
}

pub fn phi(i: usize, j: usize) -> Matrix3<f64> {
    block(i, j) + if i == j { Matrix3::identity() } else { Matrix3::zeros() }
}

pub fn noise(of: usize) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 3e-4)) * (of + 1) as f64
}

/// P_ij of a filter in the middle of a run.
pub fn start(i: usize, j: usize) -> f64 {
    let own = if i == j { 1.0 } else { 0.0 };
    own + 0.3 * ((i + j) as f64).cos() * ((i * j) as f64).sin()
}

/// The form that filters have, on blocks of three.
pub struct Composed {
    n: usize,
    pub form: Arc<dyn Form>,
    start: Lines,
    /// After the latest run.
    pub p: Lines,
    transition: Transition,
    jacobian: Jacobian,
    pub work: Workspace,
    rows: usize,
    r: Vec<f64>,
}

impl Composed {
    /// So many blocks, and a measurement of so many rows: 3 of a position, or 6.
    pub fn new(blocks: usize, rows: usize) -> Self {
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
        let mut jacobian = Jacobian::new(&layout, rows);
        jacobian.reset(rows);
        for (i, j) in READ.into_iter().filter(|(i, _)| 3 * i < rows) {
            jacobian.add(3 * i, &Quantity::State(slots[j]), &phi(i, j));
        }
        let mut p = Lines::zeros(form.storage(n));
        let numbers: Vec<f64> = (0..n * n).map(|k| start(k / n, k % n)).collect();
        form.set_block(n, &mut p, 0..n, &numbers);
        Self {
            n,
            work: Workspace::new(form.as_ref(), n, rows),
            form,
            start: p.clone(),
            p,
            transition,
            jacobian,
            rows,
            r: (0..rows * rows).map(|k| if k / rows == k % rows { 1.0 } else { 0.0 }).collect(),
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
            assert!(cholesky(&w.s, &mut w.l, self.rows));
            w.gain(self.rows);
            self.form.condition(self.n, &mut self.p, &self.jacobian, &self.r, w);
        }
        black_box(&self.p);
    }
}
