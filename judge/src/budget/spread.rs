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
//! All sources have the same M: an element X_ij is kept as a row of numbers, one for each source, and one pass over the
//! elements of M carries all of them.

/// The covariances of all sources with the error of the estimate.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    n: usize,
    /// Sources that have a covariance X, and errors, both up to a multiple of [`LANES`].
    blocks: usize,
    width: usize,
    /// X: rows, columns, sources.
    x: Vec<f64>,
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
        let [blocks, width] = [blocks, errors.len()].map(|count| count.next_multiple_of(LANES));
        Self {
            n,
            blocks,
            width,
            x: vec![0.0; n * n * blocks],
            columns: vec![0.0; n * width],
            variances: errors.iter().map(|(_, variance)| *variance).collect(),
            owners: errors.iter().map(|(owner, _)| *owner).collect(),
            room: Vec::new(),
        }
    }

    /// The axes of e.
    pub(super) const fn dim(&self) -> usize {
        self.n
    }

    /// Covariances X.
    pub(super) const fn blocks(&self) -> usize {
        self.blocks
    }

    /// Errors t.
    pub(super) fn errors(&self) -> usize {
        self.owners.len()
    }

    /// The X of an error; `None` for an error that is drawn once.
    pub(super) fn owner(&self, error: usize) -> Option<usize> {
        self.owners[error]
    }

    /// e ← (I + D) e, D given by its elements, row by row.
    pub(super) fn carry(&mut self, changes: &[(u16, u16, f64)]) {
        let (n, s) = (self.n, self.blocks);
        let rows: Vec<&[(u16, u16, f64)]> = changes.chunk_by(|a, b| a.0 == b.0).collect();
        let left = |x: &mut [f64], z: &mut [f64]| {
            let width = x.len() / n;
            z.fill(0.0);
            for (z, row) in z.chunks_exact_mut(width.max(1)).zip(&rows) {
                combine(row, x, width, z);
            }
            for (z, row) in z.chunks_exact(width.max(1)).zip(&rows) {
                axpy(1.0, z, part_mut(x, row[0].0.into(), width));
            }
        };
        self.room.resize(rows.len() * (n * s).max(self.width), 0.0);
        left(&mut self.columns, &mut self.room[..rows.len() * self.width]);
        let z = &mut self.room[..rows.len() * n * s];
        left(&mut self.x, z);
        for (z, row) in z.chunks_exact((n * s).max(1)).zip(&rows) {
            let i = usize::from(row[0].0);
            // Zᵀ, then Z Dᵀ below the diagonal.
            (0..n).for_each(|a| axpy(1.0, part(z, a, s), part_mut(&mut self.x, a * n + i, s)));
            for changed in rows.iter().take_while(|changed| changed[0].0 <= row[0].0) {
                let to = part_mut(&mut self.x, i * n + usize::from(changed[0].0), s);
                combine(changed, z, s, to);
            }
        }
        for (k, row) in rows.iter().enumerate() {
            rows[..k].iter().for_each(|other| self.mirror(row[0].0.into(), other[0].0.into()));
        }
    }

    /// Makes the element (j, i) that below the diagonal, (i, j): to the last bit, because Zᵀ replaces X Dᵀ.
    fn mirror(&mut self, i: usize, j: usize) {
        let (n, s) = (self.n, self.blocks);
        let (upper, lower) = self.x.split_at_mut((i * n + j) * s);
        part_mut(upper, j * n + i, s).copy_from_slice(&lower[..s]);
    }

    /// e ← (I − K H) e. H and Kᵀ have m rows of n numbers.
    pub(super) fn correct(&mut self, h: &[f64], kt: &[f64]) {
        let (n, s, m) = (self.n, self.blocks, h.len() / self.n);
        let seen = |x: &[f64], out: &mut [f64]| {
            let width = x.len() / n;
            out.fill(0.0);
            for (h, out) in h.chunks_exact(n).zip(out.chunks_exact_mut(width.max(1))) {
                let terms = h.iter().enumerate().filter(|(_, by)| **by != 0.0);
                terms.for_each(|(i, by)| axpy(*by, part(x, i, width), out));
            }
        };
        let take = |x: &mut [f64], u: &[f64]| {
            let width = x.len() / n;
            for (k, u) in kt.chunks_exact(n).zip(u.chunks_exact(width.max(1))) {
                k.iter().enumerate().for_each(|(i, by)| axpy(-by, u, part_mut(x, i, width)));
            }
        };
        self.room.resize(m * (n * s).max(self.width), 0.0);
        let room = &mut self.room[..m * self.width];
        seen(&self.columns, room);
        take(&mut self.columns, room);
        let u = &mut self.room[..m * n * s];
        seen(&self.x, u);
        let mut half = vec![0.0; m * m * s];
        for (q, h) in h.chunks_exact(n).enumerate() {
            for r in 0..m {
                let to = part_mut(&mut half, r * m + q, s);
                let terms = h.iter().enumerate().filter(|(_, by)| **by != 0.0);
                terms.for_each(|(a, by)| axpy(0.5 * by, part(u, r * n + a, s), to));
            }
        }
        for r in 0..m {
            for (q, k) in kt.chunks_exact(n).enumerate() {
                (0..n).for_each(|a| axpy(-k[a], part(&half, r * m + q, s), part_mut(u, r * n + a, s)));
            }
        }
        take(&mut self.x, u);
        // Uᵀ Kᵀ.
        for (r, k) in kt.chunks_exact(n).enumerate() {
            for i in 0..n {
                (0..n).for_each(|j| axpy(-k[j], part(u, r * n + i, s), part_mut(&mut self.x, i * n + j, s)));
            }
        }
        (0..n).for_each(|i| (0..i).for_each(|j| self.mirror(i, j)));
    }

    /// The error `error` acts on e: e ← e + l t.
    pub(super) fn act(&mut self, error: usize, l: &[f64]) {
        let (n, width, t) = (self.n, self.width, self.variances[error]);
        let touched = || l.iter().enumerate().filter(|(_, l)| **l != 0.0);
        let column = |i: usize| i * width + error;
        let Some(block) = self.owners[error] else {
            touched().for_each(|(i, l)| self.columns[column(i)] += l);
            return;
        };
        // (C + ½ l T) lᵀ and its transpose.
        let half: Vec<f64> = (0..n).map(|i| self.columns[column(i)] + 0.5 * l[i] * t).collect();
        for (i, by) in touched() {
            for (a, c) in half.iter().enumerate() {
                self.x[(i * n + a) * self.blocks + block] += by * c;
                self.x[(a * n + i) * self.blocks + block] += by * c;
            }
        }
        touched().for_each(|(i, l)| self.columns[column(i)] += l * t);
    }

    /// The error ages: t ← a t + w, with the variance `fresh` of w.
    pub(super) fn age(&mut self, error: usize, a: f64, fresh: f64) {
        if a != 1.0 {
            let own = self.columns.iter_mut().skip(error).step_by(self.width);
            own.for_each(|c| *c *= a);
        }
        self.variances[error] = a * a * self.variances[error] + fresh;
    }

    /// Noise that moved e and the error moved both: their covariance.
    pub(super) fn covary(&mut self, error: usize, with: &[f64]) {
        let own = self.columns.iter_mut().skip(error).step_by(self.width);
        own.zip(with).for_each(|(c, with)| *c += with);
    }

    /// Adds white noise to e: a covariance for each X, in rows of `ld` numbers, read from its diagonal on.
    pub(super) fn add_all(&mut self, noise: &[f64], ld: usize) {
        let n = self.n;
        for (block, noise) in noise.chunks_exact(n * ld).enumerate() {
            for (i, row) in noise.chunks_exact(ld).enumerate() {
                for (j, value) in row[..n].iter().enumerate().skip(i).filter(|(_, value)| **value != 0.0) {
                    self.add(block, i, j, *value);
                    if i != j {
                        self.add(block, j, i, *value);
                    }
                }
            }
        }
    }

    /// Adds white noise to e: an element of its covariance.
    pub(super) fn add(&mut self, block: usize, i: usize, j: usize, value: f64) {
        self.x[(i * self.n + j) * self.blocks + block] += value;
    }

    /// The axes `axes` get a new value, without error.
    pub(super) fn forget(&mut self, axes: core::ops::Range<usize>) {
        let (n, s, width) = (self.n, self.blocks, self.width);
        self.columns[axes.start * width..axes.end * width].fill(0.0);
        for (i, j) in axes.flat_map(|i| (0..n).map(move |j| (i, j))) {
            part_mut(&mut self.x, i * n + j, s).fill(0.0);
            part_mut(&mut self.x, j * n + i, s).fill(0.0);
        }
    }

    /// aᵀ X a of one X.
    pub(super) fn variance(&self, block: usize, a: &[(usize, f64)]) -> f64 {
        let x = |i: usize, j: usize| self.x[(i * self.n + j) * self.blocks + block];
        let of = |(i, by): &(usize, f64)| by * a.iter().map(|(j, other)| x(*i, *j) * other).sum::<f64>();
        a.iter().map(of).sum()
    }

    /// aᵀ C or aᵀ R of an error, and its T.
    pub(super) fn along(&self, error: usize, a: &[(usize, f64)]) -> (f64, f64) {
        let along = a.iter().map(|(i, by)| by * self.columns[i * self.width + error]).sum();
        (along, self.variances[error])
    }
}

/// Rows are multiples of this: short loops over them need no remainder.
pub(super) const LANES: usize = 4;

/// y ← y + a x.
#[inline]
pub(super) fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}

/// y ← y + D x for one row of D.
#[inline]
fn combine(row: &[(u16, u16, f64)], x: &[f64], width: usize, y: &mut [f64]) {
    // Four at a time: each number of y is then read and written less often.
    let (fours, rest) = row.as_chunks::<4>();
    for four in fours {
        let a = four.map(|(.., by)| by);
        let [x0, x1, x2, x3] = four.map(|(_, j, _)| part(x, j.into(), width));
        let x = x0.iter().zip(x1).zip(x2.iter().zip(x3));
        let sums = x.map(|((x0, x1), (x2, x3))| (a[0] * x0 + a[1] * x1) + (a[2] * x2 + a[3] * x3));
        y.iter_mut().zip(sums).for_each(|(y, sum)| *y += sum);
    }
    rest.iter().for_each(|&(_, j, by)| axpy(by, part(x, j.into(), width), y));
}

/// The row `row` of a matrix of this width.
pub(super) fn part(x: &[f64], row: usize, width: usize) -> &[f64] {
    &x[row * width..(row + 1) * width]
}

pub(super) fn part_mut(x: &mut [f64], row: usize, width: usize) -> &mut [f64] {
    &mut x[row * width..(row + 1) * width]
}
