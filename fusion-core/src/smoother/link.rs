//! One step of the filter as the backward pass needs it.

use super::record::{Reader, Unreadable, put};
use crate::covariance::{axpy, cholesky, solve_lower};
use crate::filter::Step;
use crate::linear::{BlockMatrix, Jacobian};
use crate::time::Time;
use alloc::vec::Vec;

/// A step of the filter as a smoother takes it: how it carries errors, M = (I + D)(I − K̃H̃), and what it learns.
///
/// D is Φ − I or J − I. H̃ = L⁻¹H, r̃ = L⁻¹r and K̃ = K L with S = L Lᵀ: the measurement as one of unit
/// innovations, so that KH = K̃H̃, HᵀS⁻¹H = H̃ᵀH̃ and HᵀS⁻¹r = H̃ᵀr̃.
#[derive(Clone, Debug, Default)]
pub struct Link {
    /// When the step ends.
    pub(super) time: Time,
    /// Elements of D: row, column, value.
    changes: Vec<(u16, u16, f64)>,
    /// Rows m of the measurement; 0 for a prediction.
    rows: usize,
    /// H̃, m×n, row by row.
    h: Vec<f64>,
    /// K̃ᵀ, m×n, row by row.
    k: Vec<f64>,
    /// r̃.
    r: Vec<f64>,
}

crate::memory!(Link {
    time,
    changes,
    rows,
    h,
    k,
    r
});

impl Link {
    /// That of `step`; none of one that carries errors as they are and says nothing of them.
    #[must_use]
    pub fn of(step: &Step) -> Option<Self> {
        let mut link = Self::default();
        match step {
            Step::Inflated { .. } => {}
            Step::Predicted { transition, posterior, .. } => {
                link.time = posterior.time;
                link.changed(&transition.phi);
            }
            Step::Corrected { posterior, .. } => {
                link.time = posterior.time;
                link.measured(step);
            }
        }
        (link.rows > 0 || !link.changes.is_empty()).then_some(link)
    }

    /// Whether it is one of `n` dimensions.
    pub(super) fn fits(&self, n: usize) -> bool {
        let size = self.rows.saturating_mul(n);
        let is_inside = |&(i, j, _): &(u16, u16, f64)| usize::from(i.max(j)) < n;
        self.changes.iter().all(is_inside) && [self.h.len(), self.k.len(), self.r.len()] == [size, size, self.rows]
    }

    pub(super) fn changed(&mut self, matrix: &BlockMatrix) {
        self.changes.extend(matrix.changes());
    }

    fn measured(&mut self, step: &Step) {
        let Step::Corrected {
            jacobian,
            innovation,
            gain,
            residual,
            reset,
            ..
        } = step
        else {
            return;
        };
        let m = residual.len();
        let mut l = vec![0.0; m * m];
        // Only what had a factor corrects anything.
        if !cholesky(innovation, &mut l, m) {
            return;
        }
        self.learn(jacobian, &l, gain, residual);
        reset.iter().for_each(|reset| self.changed(reset));
    }

    /// A measurement with the factor `l` of S and Kᵀ in `gain`, m×n, row by row.
    pub(super) fn learn(&mut self, jacobian: &Jacobian, l: &[f64], gain: &[f64], residual: &[f64]) {
        let (m, n) = (residual.len(), gain.len() / residual.len().max(1));
        self.rows = m;
        for i in 0..m {
            self.h.extend_from_slice(&jacobian.row(i)[..n]);
            let column = |c: usize| (i..m).map(|j| gain[j * n + c] * l[j * m + i]).sum::<f64>();
            self.k.extend((0..n).map(column));
        }
        // H̃ = L⁻¹ H, row by row.
        for i in 0..m {
            let (done, rest) = self.h.split_at_mut(i * n);
            let row = &mut rest[..n];
            for (j, above) in done.chunks_exact(n).enumerate() {
                axpy(-l[i * m + j], above, row);
            }
            row.iter_mut().for_each(|v| *v /= l[i * m + i]);
        }
        self.r.extend_from_slice(residual);
        solve_lower(l, &mut self.r, m);
    }

    /// out ← Mᵀ X; X and out have n rows of `ld`, `room` holds m of them.
    pub(super) fn pull(&self, x: &[f64], out: &mut [f64], room: &mut [f64], ld: usize) {
        out.copy_from_slice(x);
        for &(i, j, value) in &self.changes {
            axpy(value, part(x, i.into(), ld), part_mut(out, j.into(), ld));
        }
        // (I − H̃ᵀK̃ᵀ) of that.
        project_out(self.rows, &self.k, &self.h, out, room, ld);
    }

    /// out ← M X, as [`Link::pull`].
    pub(super) fn push(&self, x: &mut [f64], out: &mut [f64], room: &mut [f64], ld: usize) {
        // (I − K̃H̃) X first.
        project_out(self.rows, &self.h, &self.k, x, room, ld);
        out.copy_from_slice(x);
        for &(i, j, value) in &self.changes {
            axpy(value, part(x, j.into(), ld), part_mut(out, i.into(), ld));
        }
    }

    /// Elements of Φ − I: row, column, value.
    #[cfg(feature = "faer")]
    pub(super) fn changes(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.changes.iter().map(|&(i, j, change)| (i.into(), j.into(), change))
    }

    /// Rows m of the measurement; 0 for a prediction.
    pub(super) const fn rows(&self) -> usize {
        self.rows
    }

    /// The rows of H̃ with their r̃.
    pub(super) fn learnt(&self) -> impl Iterator<Item = (&[f64], f64)> {
        let n = self.h.len() / self.rows.max(1);
        self.h.chunks_exact(n.max(1)).zip(&self.r).take(self.rows).map(|(h, r)| (h, *r))
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        put::time(out, self.time);
        put::count(out, self.changes.len());
        for &(i, j, value) in &self.changes {
            put::index(out, i);
            put::index(out, j);
            put::numbers(out, &[value]);
        }
        put::count(out, self.rows);
        if self.rows > 0 {
            [&self.h, &self.k, &self.r].into_iter().for_each(|v| put::numbers(out, v));
        }
    }

    /// Becomes what was written, of `n` dimensions.
    pub(super) fn read(&mut self, from: &mut Reader<'_>, n: usize) -> Result<(), Unreadable> {
        self.time = from.time()?;
        self.changes.clear();
        for _ in 0..from.count()? {
            let (i, j) = (from.index(n)?, from.index(n)?);
            self.changes.push((i, j, from.number()?));
        }
        self.rows = from.count()?;
        let (m, n) = (self.rows, if self.rows > 0 { n } else { 0 });
        from.numbers(&mut self.h, m * n)?;
        from.numbers(&mut self.k, m * n)?;
        from.numbers(&mut self.r, m)
    }
}

/// X ← (I − BᵀA) X for A and B of `m` rows; `room` holds A X.
fn project_out(m: usize, a: &[f64], b: &[f64], x: &mut [f64], room: &mut [f64], ld: usize) {
    let n = x.len() / ld;
    let room = &mut room[..m * ld];
    room.fill(0.0);
    for (a, ax) in a.chunks_exact(n).zip(room.chunks_exact_mut(ld)) {
        let factors = a.iter().enumerate().filter(|(_, factor)| **factor != 0.0);
        factors.for_each(|(i, factor)| axpy(*factor, part(x, i, ld), ax));
    }
    for (b, ax) in b.chunks_exact(n).zip(room.chunks_exact(ld)) {
        let factors = b.iter().enumerate().filter(|(_, factor)| **factor != 0.0);
        factors.for_each(|(i, factor)| axpy(-factor, ax, part_mut(x, i, ld)));
    }
}

fn part(x: &[f64], row: usize, ld: usize) -> &[f64] {
    &x[row * ld..(row + 1) * ld]
}

fn part_mut(x: &mut [f64], row: usize, ld: usize) -> &mut [f64] {
    &mut x[row * ld..(row + 1) * ld]
}
