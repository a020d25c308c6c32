//! How the errors of all sources spread through the steps of a filter.
//!
//! ```text
//! e    error of the estimate, x̂ ⊟ x, n axes;  t_j  a scalar error of the world, independent of all others
//! X_s  covariance of the part of e that comes from the source s
//! C_j  covariance of e with t_j: an error that changes;  R_j  response ∂e/∂t_j: an error that is drawn once
//!
//! step   e ← M e        X ← M X Mᵀ, C ← M C, R ← M R
//! acts   e ← e + l t_j  X ← X + C lᵀ + l Cᵀ + l T lᵀ, then C ← C + l T;  R ← R + l
//! ages   t ← a t + w    C ← a C, T ← a² T + q
//! ```
//!
//! M is I + D with few rows in D, or I − K H. With Z = D X, and X symmetric,
//!
//! ```text
//! (I + D) X (I + D)ᵀ       = X + Z + Zᵀ + Z Dᵀ
//! (I − K H) X (I − K H)ᵀ   = X − K U − Uᵀ Kᵀ,   U = H X − ½ (H X Hᵀ) Kᵀ
//! ```
//!
//! so a step costs each source about as much as the filter itself.

/// The covariances of all sources with the error of the estimate.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    n: usize,
    /// X of each source that has one, n×n, row by row.
    blocks: Vec<Vec<f64>>,
    /// C or R of each error: n rows.
    columns: Vec<f64>,
    /// T of each error.
    variances: Vec<f64>,
    /// The X of each error; `None` for an error that is drawn once.
    owners: Vec<Option<usize>>,
    /// Working memory.
    room: Vec<f64>,
}

impl Spread {
    /// Of no error yet: `n` axes, `blocks` covariances X, and for each error its X and its first variance.
    pub(super) fn new(n: usize, blocks: usize, errors: &[(Option<usize>, f64)]) -> Self {
        Self {
            n,
            blocks: vec![vec![0.0; n * n]; blocks],
            columns: vec![0.0; n * errors.len()],
            variances: errors.iter().map(|(_, variance)| *variance).collect(),
            owners: errors.iter().map(|(owner, _)| *owner).collect(),
            room: Vec::new(),
        }
    }

    /// e ← (I + D) e, D given by its elements, row by row.
    pub(super) fn carry(&mut self, changes: &[(u16, u16, f64)]) {
        let (n, width) = (self.n, self.variances.len());
        let rows: Vec<&[(u16, u16, f64)]> = changes.chunk_by(|a, b| a.0 == b.0).collect();
        let left = |x: &mut [f64], z: &mut [f64], width: usize| {
            z.fill(0.0);
            for (z, row) in z.chunks_exact_mut(width).zip(&rows) {
                for &(_, j, by) in *row {
                    axpy(by, &x[usize::from(j) * width..][..width], z);
                }
            }
            for (z, row) in z.chunks_exact(width).zip(&rows) {
                axpy(1.0, z, &mut x[usize::from(row[0].0) * width..][..width]);
            }
        };
        self.room.resize(rows.len() * n.max(width), 0.0);
        if width > 0 {
            left(&mut self.columns, &mut self.room[..rows.len() * width], width);
        }
        let z = &mut self.room[..rows.len() * n];
        for x in &mut self.blocks {
            left(x, z, n);
            for (z, row) in z.chunks_exact(n).zip(&rows) {
                let i = usize::from(row[0].0);
                x[i..].iter_mut().step_by(n).zip(z).for_each(|(x, z)| *x += z);
                for changed in &rows {
                    let more: f64 = changed.iter().map(|&(_, j, by)| by * z[usize::from(j)]).sum();
                    x[i * n + usize::from(changed[0].0)] += more;
                }
            }
        }
    }

    /// e ← (I − K H) e. H and Kᵀ have m rows of n numbers.
    pub(super) fn correct(&mut self, h: &[f64], kt: &[f64]) {
        let (n, width, m) = (self.n, self.variances.len(), h.len() / self.n);
        self.room.resize(m * n.max(width), 0.0);
        let seen = |x: &[f64], out: &mut [f64], width: usize| {
            out.fill(0.0);
            for (h, out) in h.chunks_exact(n).zip(out.chunks_exact_mut(width)) {
                for (by, row) in h.iter().zip(x.chunks_exact(width)).filter(|(by, _)| **by != 0.0) {
                    axpy(*by, row, out);
                }
            }
        };
        let take = |x: &mut [f64], u: &[f64], width: usize| {
            for (k, u) in kt.chunks_exact(n).zip(u.chunks_exact(width)) {
                k.iter().zip(x.chunks_exact_mut(width)).for_each(|(by, row)| axpy(-by, u, row));
            }
        };
        if width > 0 {
            let room = &mut self.room[..m * width];
            seen(&self.columns, room, width);
            take(&mut self.columns, room, width);
        }
        let u = &mut self.room[..m * n];
        for x in &mut self.blocks {
            seen(x, u, n);
            let half: Vec<f64> = u
                .chunks_exact(n)
                .flat_map(|hx| h.chunks_exact(n).map(|h| 0.5 * dot(hx, h)))
                .collect();
            for (u, half) in u.chunks_exact_mut(n).zip(half.chunks_exact(m)) {
                half.iter().zip(kt.chunks_exact(n)).for_each(|(by, k)| axpy(-by, k, u));
            }
            take(x, u, n);
            // − Uᵀ Kᵀ.
            for (k, u) in kt.chunks_exact(n).zip(u.chunks_exact(n)) {
                u.iter().zip(x.chunks_exact_mut(n)).for_each(|(by, row)| axpy(-by, k, row));
            }
        }
    }

    /// The error `error` acts on e: e ← e + l t.
    pub(super) fn act(&mut self, error: usize, l: &[f64]) {
        let (n, width, t) = (self.n, self.variances.len(), self.variances[error]);
        let touched = || l.iter().enumerate().filter(|(_, l)| **l != 0.0);
        let column = |i: usize| i * width + error;
        let Some(block) = self.owners[error] else {
            touched().for_each(|(i, l)| self.columns[column(i)] += l);
            return;
        };
        // (C + ½ l T) lᵀ and its transpose.
        let half: Vec<f64> = (0..n).map(|i| self.columns[column(i)] + 0.5 * l[i] * t).collect();
        let x = &mut self.blocks[block];
        for (i, by) in touched() {
            axpy(*by, &half, &mut x[i * n..(i + 1) * n]);
            x[i..].iter_mut().step_by(n).zip(&half).for_each(|(x, c)| *x += by * c);
        }
        touched().for_each(|(i, l)| self.columns[column(i)] += l * t);
    }

    /// The error ages: t ← a t + w, with the variance `fresh` of w.
    pub(super) fn age(&mut self, error: usize, a: f64, fresh: f64) {
        if a != 1.0 {
            let own = self.columns.iter_mut().skip(error).step_by(self.variances.len());
            own.for_each(|c| *c *= a);
        }
        self.variances[error] = a * a * self.variances[error] + fresh;
    }

    /// Adds white noise to e: an element of its covariance.
    pub(super) fn add(&mut self, block: usize, i: usize, j: usize, value: f64) {
        self.blocks[block][i * self.n + j] += value;
    }

    /// The axes `axes` get a new value, without error.
    pub(super) fn forget(&mut self, axes: core::ops::Range<usize>) {
        let width = self.variances.len();
        self.columns[axes.start * width..axes.end * width].fill(0.0);
        for x in &mut self.blocks {
            for (a, row) in x.chunks_exact_mut(self.n).enumerate() {
                if axes.contains(&a) {
                    row.fill(0.0);
                }
                row[axes.clone()].fill(0.0);
            }
        }
    }

    /// aᵀ X a of one X.
    pub(super) fn variance(&self, block: usize, a: &[(usize, f64)]) -> f64 {
        let of = |(i, by): &(usize, f64)| {
            let row = &self.blocks[block][i * self.n..];
            by * a.iter().map(|(j, other)| row[*j] * other).sum::<f64>()
        };
        a.iter().map(of).sum()
    }

    /// aᵀ C or aᵀ R of an error, and its T.
    pub(super) fn along(&self, error: usize, a: &[(usize, f64)]) -> (f64, f64) {
        let width = self.variances.len();
        let along = a.iter().map(|(i, by)| by * self.columns[i * width + error]).sum();
        (along, self.variances[error])
    }
}

fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
