//! P = F W Fᵀ with an upper triangular factor: propagation by Φ, triangularisation, and a measurement update.
//!
//! A factor of n states has n columns, one after the other, each padded like a row of P. Below element k, column k is
//! zero. The weights W are a diagonal, stored as a padded row. An *array* has such columns, but is not triangular:
//! first the columns of ΦF, then those of a noise.
//!
//! [`orthogonalise`]  weighted Gram-Schmidt from the last state up (Thornton 1976): F has a unit diagonal
//! [`reflect`]        Householder's reflections from the last state up, without weights
//! [`weigh`]          Bierman's update by one row of H; [`rotate`] is Carlson's
//!
//! A state is a position in the columns. So each step acts on all states above it at once, and finished states cost
//! nothing.

use crate::congruence::ascending;
use crate::congruence::check;
use crate::lanes::{Lanes, size, some};
use crate::math;
use alloc::vec::Vec;
use core::ops::Range;

/// The columns of Φ that the rows of a tile read, and the row from which Φ is diagonal.
#[derive(Clone, Debug)]
pub struct Reach {
    n: usize,
    /// For each tile of eight rows the columns, in order, and the end of its list.
    columns: Vec<u16>,
    ends: Vec<usize>,
    /// The first row from which Φ is diagonal.
    end: usize,
}

impl Reach {
    /// For a Φ with `rows`, as in [`Plan::new`](crate::Plan::new).
    ///
    /// # Panics
    /// As [`Plan::new`](crate::Plan::new) does.
    #[must_use]
    pub fn new(rows: &[Vec<(u16, u16)>]) -> Self {
        let n = rows.len();
        check(rows);
        let is_diagonal = |i: usize| {
            rows[i]
                .iter()
                .all(|&(start, end)| (usize::from(start), usize::from(end)) == (i, i + 1))
        };
        let mut reach = Self {
            n,
            columns: Vec::new(),
            ends: Vec::new(),
            end: (0..n).rfind(|&i| !is_diagonal(i)).map_or(0, |i| i + 1),
        };
        for (t, rows) in rows.chunks(8).enumerate() {
            let own = (8 * t) as u16..(8 * t + rows.len()) as u16;
            let read = rows.iter().flatten().flat_map(|&(start, end)| start..end);
            reach.columns.extend(ascending(own.chain(read)));
            reach.ends.push(reach.columns.len());
        }
        reach
    }

    /// The first row from which Φ is diagonal.
    #[must_use]
    pub const fn end(&self) -> usize {
        self.end
    }

    /// The columns that the rows of a tile read.
    fn of(&self, tile: usize) -> &[u16] {
        let start = if tile == 0 { 0 } else { self.ends[tile - 1] };
        &self.columns[start..self.ends[tile]]
    }
}

/// The shape of an array.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// States n.
    pub n: usize,
    /// Columns, the first n those of the factor.
    pub len: usize,
    /// From this row, each row k is zero in all columns except column k.
    pub end: usize,
}

/// The number of columns computed at once.
const GROUP: usize = 4;

/// out ← ΦF; `phi` is Φᵀ, row by row, in rows as long as the columns of F.
#[inline(always)]
pub(crate) fn through<L: Lanes>(reach: &Reach, phi: &[f64], f: &[f64], out: &mut [f64]) {
    let (n, tiles) = (reach.n, reach.n.div_ceil(8));
    let mut k = 0;
    while k < n {
        match n - k {
            1 => through_some::<L, 1>(reach, phi, f, k, tiles, out),
            2 => through_some::<L, 2>(reach, phi, f, k, tiles, out),
            3 => through_some::<L, 3>(reach, phi, f, k, tiles, out),
            _ => through_some::<L, GROUP>(reach, phi, f, k, tiles, out),
        }
        k += GROUP;
    }
}

#[inline(always)]
fn through_some<L: Lanes, const G: usize>(reach: &Reach, phi: &[f64], f: &[f64], k: usize, tiles: usize, out: &mut [f64]) {
    let (phi, out) = (phi.as_chunks::<8>().0, out.as_chunks_mut::<8>().0);
    assert!(phi.len() >= reach.n * tiles && f.len() >= 8 * (k + G) * tiles);
    for t in 0..tiles {
        let mut sum = [L::splat(0.0); G];
        for &m in reach.of(t) {
            let m = usize::from(m);
            if m >= k + G {
                break;
            }
            #[expect(unsafe_code, reason = "see `some`")]
            // SAFETY: m < k + G ≤ n and t < tiles, those of n; the lengths are looked at above.
            let row = L::load(unsafe { &some::<_, 1>(phi, m * tiles + t)[0] });
            for g in 0..G {
                #[expect(unsafe_code, reason = "see `some`")]
                // SAFETY: as above, and g < G.
                let [factor] = unsafe { some::<_, 1>(f, 8 * (k + g) * tiles + m) };
                sum[g] = L::splat(*factor).mul_add(row, sum[g]);
            }
        }
        for g in 0..G {
            sum[g].store(&mut out[(k + g) * tiles + t]);
        }
    }
}

/// The columns of an array that a step acts on: some columns of the factor, and those of the noise.
#[inline(always)]
fn parts(factor: usize, n: usize, len: usize) -> [Range<usize>; 2] {
    [0..factor, n..len]
}

/// sums ← Σ_k w_k c_k ∘ c_k over the first `len` columns: the variances.
#[inline(always)]
pub(crate) fn squares<L: Lanes>(len: usize, columns: &[f64], weights: &[f64], sums: &mut [f64]) {
    let (columns, sums) = (columns.as_chunks::<8>().0, sums.as_chunks_mut::<8>().0);
    let (tiles, weights) = (sums.len(), &weights[..len]);
    assert!(columns.len() >= size(len, tiles));
    for t in 0..tiles {
        let mut sum = [L::splat(0.0); GROUP];
        let square = |k: usize| {
            #[expect(unsafe_code, reason = "see `some`")]
            // SAFETY: k < len and t < tiles; the length is looked at above.
            let column = L::load(unsafe { &some::<_, 1>(columns, k * tiles + t)[0] });
            (column.mul(L::splat(weights[k])), column)
        };
        let mut k = 0;
        while k + GROUP <= len {
            for g in 0..GROUP {
                let (weighed, column) = square(k + g);
                sum[g] = weighed.mul_add(column, sum[g]);
            }
            k += GROUP;
        }
        while k < len {
            let (weighed, column) = square(k);
            sum[0] = weighed.mul_add(column, sum[0]);
            k += 1;
        }
        together(sum).store(&mut sums[t]);
    }
}

#[inline(always)]
fn together<L: Lanes>(sum: [L; GROUP]) -> L {
    sum[0].add(sum[1]).add(sum[2].add(sum[3]))
}

/// `sum` plus w c_j times tile `t` of a column; `column` holds its tiles.
#[inline(always)]
fn add<L: Lanes>(column: &[[f64; 8]], weight: f64, j: usize, t: usize, sum: L) -> L {
    debug_assert!(j / 8 < column.len() && t < column.len());
    #[expect(unsafe_code, reason = "see `some`")]
    // SAFETY: both callers have t ≤ j / 8 < tiles, and columns of so many tiles.
    let (own, tile) = unsafe { (&some::<_, 1>(column, j / 8)[0], &some::<_, 1>(column, t)[0]) };
    let factor = own[j % 8];
    if is_zero(factor) {
        return sum;
    }
    L::splat(factor * weight).mul_add(L::load(tile), sum)
}

/// Tests the bits, because zeros are common.
#[inline(always)]
const fn is_zero(value: f64) -> bool {
    value.to_bits() << 1 == 0
}

/// Tile `t` of Σ_k w_k c_kj c_k over the columns in `parts`, t ≤ j / 8; without weights these are 1.
#[inline(always)]
fn along_row<L: Lanes, const WEIGHTED: bool>(
    parts: &[Range<usize>; 2],
    columns: &[[f64; 8]],
    weights: &[f64],
    tiles: usize,
    j: usize,
    t: usize,
) -> L {
    let mut sum = [L::splat(0.0); GROUP];
    assert!(j / 8 < tiles && t <= j / 8);
    for part in parts {
        let columns = &columns[part.start * tiles..part.end * tiles];
        let weights = if WEIGHTED { &weights[part.clone()] } else { &[] };
        let (mut groups, fours) = (columns.chunks_exact(GROUP * tiles), weights.as_chunks::<GROUP>());
        for (k, group) in groups.by_ref().enumerate() {
            let weights = if WEIGHTED { fours.0[k] } else { [1.0; GROUP] };
            for g in 0..GROUP {
                sum[g] = add(&group[g * tiles..][..tiles], weights[g], j, t, sum[g]);
            }
        }
        for (k, column) in groups.remainder().chunks_exact(tiles).enumerate() {
            let weight = if WEIGHTED { fours.1[k] } else { 1.0 };
            sum[0] = add(column, weight, j, t, sum[0]);
        }
    }
    together(sum)
}

/// c_k ← c_k − c_kj s for the columns in `parts`, in the states up to j.
#[inline(always)]
fn subtract<L: Lanes>(parts: &[Range<usize>; 2], columns: &mut [[f64; 8]], tiles: usize, j: usize, s: &[[f64; 8]]) {
    let s = &s[..=j / 8];
    for part in parts {
        for column in columns[part.start * tiles..part.end * tiles].chunks_exact_mut(tiles) {
            let column = &mut column[..s.len()];
            let factor = column[s.len() - 1][j % 8];
            if is_zero(factor) {
                continue;
            }
            let factor = L::splat(factor);
            for t in 0..s.len() {
                factor.mul_sub_from(L::load(&s[t]), L::load(&column[t])).store(&mut column[t]);
            }
        }
    }
}

/// Keeps the lanes of the states before `j`, sets the others to zero.
#[inline(always)]
fn before<L: Lanes>(j: usize, t: usize, value: L) -> L {
    if t < j / 8 { value } else { L::splat(0.0).after(j % 8, value) }
}

/// U, followed by D, from an array and its weights. The rows of the array are made orthogonal under the weights, the
/// last row first. Their squared norms are D; the components of the rows above along them are the columns of U. `s` has
/// space for one column.
#[inline(always)]
pub(crate) fn orthogonalise<L: Lanes>(shape: Shape, columns: &mut [f64], weights: &[f64], factor: &mut [f64], s: &mut [f64]) {
    let Shape { n, len, end } = shape;
    let tiles = n.div_ceil(8);
    let (u, d) = factor.split_at_mut(8 * n * tiles);
    let (columns, u, s) = (columns.as_chunks_mut::<8>().0, u.as_chunks_mut::<8>().0, s.as_chunks_mut::<8>().0);
    for j in end..n {
        let (own, out) = (&columns[j * tiles..(j + 1) * tiles], &mut u[j * tiles..(j + 1) * tiles]);
        let element = own[j / 8][j % 8];
        d[j] = weights[j] * element * element;
        let inverse = if d[j] == 0.0 { 0.0 } else { 1.0 / element };
        for t in 0..=j / 8 {
            before(j, t, L::load(&own[t]).mul(L::splat(inverse))).store(&mut out[t]);
        }
        out[j / 8][j % 8] = 1.0;
    }
    let live = parts(end, n, len);
    for j in (0..end).rev() {
        let out = &mut u[j * tiles..(j + 1) * tiles];
        let own = along_row::<L, true>(&live, columns, weights, tiles, j, j / 8);
        own.store(&mut s[j / 8]);
        d[j] = s[j / 8][j % 8];
        let is_none = d[j].abs() < f64::MIN_POSITIVE;
        let inverse = L::splat(if is_none { 0.0 } else { 1.0 / d[j] });
        for t in 0..=j / 8 {
            let sum = if t == j / 8 {
                own
            } else {
                along_row::<L, true>(&live, columns, weights, tiles, j, t)
            };
            let projection = sum.mul(inverse);
            projection.store(&mut s[t]);
            before(j, t, projection).store(&mut out[t]);
        }
        out[j / 8 + 1..].fill([0.0; 8]);
        out[j / 8][j % 8] = 1.0;
        if !is_none {
            subtract::<L>(&live, columns, tiles, j, s);
        }
    }
}

/// S, with a positive diagonal, from an array. Reflections make one row after another zero in all columns except its
/// own, the last row first. `s` has space for one column.
#[inline(always)]
pub(crate) fn reflect<L: Lanes>(shape: Shape, columns: &mut [f64], root: &mut [f64], s: &mut [f64]) {
    let Shape { n, len, end } = shape;
    let tiles = n.div_ceil(8);
    let (columns, root, s) = (
        columns.as_chunks_mut::<8>().0,
        root.as_chunks_mut::<8>().0,
        s.as_chunks_mut::<8>().0,
    );
    for j in (0..n).rev() {
        let out = &mut root[j * tiles..(j + 1) * tiles];
        let own = columns[j * tiles + j / 8][j % 8];
        let others = if j < end { parts(j, n, len) } else { parts(0, 0, 0) };
        let last = along_row::<L, false>(&others, columns, &[], tiles, j, j / 8);
        last.store(&mut s[j / 8]);
        let rest = s[j / 8][j % 8];
        let (norm, sign) = (math::sqrt(own * own + rest), if own < 0.0 { -1.0 } else { 1.0 });
        // The square of a smaller value underflows.
        if rest >= f64::MIN_POSITIVE {
            // I − v vᵀ/scale with v = x + sign |x| e_j takes x to −sign |x| e_j; scale = |v|²/2. The column of S is the
            // component of the rows above along x, with a sign that makes the diagonal of S positive.
            let (v, inverse) = (own + sign * norm, L::splat(1.0 / (norm * (norm + own.abs()))));
            for t in 0..=j / 8 {
                let sum = if t == j / 8 {
                    last
                } else {
                    along_row::<L, false>(&others, columns, &[], tiles, j, t)
                };
                let column = L::load(&columns[j * tiles + t]);
                L::splat(v).mul_add(column, sum).mul(inverse).store(&mut s[t]);
                let along = L::splat(own).mul_add(column, sum).mul(L::splat(1.0 / norm));
                before(j, t, along).store(&mut out[t]);
            }
            subtract::<L>(&others, columns, tiles, j, s);
        } else {
            for t in 0..=j / 8 {
                let column = L::load(&columns[j * tiles + t]).mul(L::splat(sign));
                before(j, t, column).store(&mut out[t]);
            }
        }
        out[j / 8 + 1..].fill([0.0; 8]);
        out[j / 8][j % 8] = norm;
    }
}

/// out ← HF, for `rows` rows with the length of the factor's columns; H is zero outside `read`.
#[inline(always)]
pub(crate) fn along<L: Lanes>(n: usize, rows: usize, h: &[f64], read: &[(usize, usize)], f: &[f64], out: &mut [f64]) {
    let tiles = n.div_ceil(8);
    let (h, f, out) = (h.as_chunks::<8>().0, f.as_chunks::<8>().0, out.as_chunks_mut::<8>().0);
    // A bit for each tile that is read; the last bit is for all later tiles.
    let mut wanted = 0_u64;
    for &(start, end) in read {
        for t in start / 8..end.div_ceil(8) {
            wanted |= 1 << t.min(63);
        }
    }
    for r in 0..rows {
        let row = &h[r * tiles..(r + 1) * tiles];
        for block in 0..tiles {
            let some = (n - 8 * block).min(8);
            let columns = &f[8 * block * tiles..(8 * block + some) * tiles];
            let mut sum = [L::splat(0.0); 8];
            // A column of the factor is zero below its diagonal.
            for t in 0..=block {
                if wanted >> t.min(63) & 1 == 0 {
                    continue;
                }
                let row = L::load(&row[t]);
                for c in 0..8 {
                    if c < some {
                        sum[c] = row.mul_add(L::load(&columns[c * tiles + t]), sum[c]);
                    }
                }
            }
            L::sums(sum).store(&mut out[r * tiles + block]);
        }
    }
}

/// `start` plus the partial sums of the terms: α after each column. Every sum needs few additions.
#[inline(always)]
fn running(start: f64, terms: &[f64; 8]) -> [f64; 8] {
    let [a, b, c, d, e, f, g, h] = *terms;
    let (ab, cd, ef, gh) = (a + b, c + d, e + f, g + h);
    let abcd = ab + cd;
    let sums = [a, ab, ab + c, abcd, abcd + e, abcd + ef, abcd + (ef + g), abcd + (ef + gh)];
    let mut all = [0.0; 8];
    for k in 0..8 {
        all[k] = start + sums[k];
    }
    all
}

/// Bierman's update of U and D by one row h with noise variance r ≥ 0; `f` is Uᵀh. Afterwards the content of `f` and of
/// `lambda`, a padded row, is working memory.
///
/// v = D f; α grows from r to r + hPhᵀ, and D shrinks by the ratio of each step. Without noise, the first column that h
/// reads is known exactly, so its weight becomes zero.
#[inline(always)]
pub(crate) fn weigh<L: Lanes>(n: usize, r: f64, f: &mut [f64], factor: &mut [f64], lambda: &mut [f64]) {
    let (u, d) = factor.split_at_mut(n * n.next_multiple_of(8));
    // 1/α before each column, and after the last of eight.
    let (mut alpha, mut inverse) = (r, [1.0 / r; 9]);
    let tiles = f.as_chunks_mut::<8>().0.iter_mut().zip(d.as_chunks_mut::<8>().0);
    for ((f, d), lambda) in tiles.zip(lambda.as_chunks_mut::<8>().0) {
        let (mut v, mut old) = ([0.0; 8], [0.0; 8]);
        for c in 0..8 {
            v[c] = f[c] * d[c];
        }
        let mut terms = [0.0; 8];
        for c in 0..8 {
            terms[c] = f[c] * v[c];
        }
        let new = running(alpha, &terms);
        old[0] = alpha;
        old[1..].copy_from_slice(&new[..7]);
        alpha = new[7];
        inverse[0] = inverse[8];
        for c in 0..8 {
            inverse[c + 1] = 1.0 / new[c];
        }
        for c in 0..8 {
            d[c] = if v[c] == 0.0 { d[c] } else { d[c] * (old[c] * inverse[c + 1]) };
            lambda[c] = if old[c] == 0.0 { 0.0 } else { -f[c] * inverse[c] };
        }
        *f = v;
    }
    sweep::<L, false>(n, f, lambda, &[], u);
}

/// Carlson's update of S by one row h with noise variance r ≥ 0; `f` is Sᵀh. `scales` is working memory of two padded
/// rows. The columns are the result of rotations with the column of the noise.
///
/// ρ² grows from r to r + hPhᵀ; c_k ← (ρ c_k − f g/ρ)/ρ⁺, where g is the sum of f c over the columns before.
#[inline(always)]
pub(crate) fn rotate<L: Lanes>(n: usize, r: f64, f: &[f64], columns: &mut [f64], scales: &mut [f64]) {
    // ρ and 1/ρ before each column, and after the last of eight.
    let (mut alpha, mut root) = (r, [math::sqrt(r); 9]);
    let mut inverse = [1.0 / root[8]; 9];
    let (lambda, own) = scales.split_at_mut(n.next_multiple_of(8));
    let tiles = lambda.as_chunks_mut::<8>().0.iter_mut().zip(own.as_chunks_mut::<8>().0);
    for (f, (lambda, own)) in f.as_chunks::<8>().0.iter().zip(tiles) {
        let mut terms = [0.0; 8];
        for c in 0..8 {
            terms[c] = f[c] * f[c];
        }
        let new = running(alpha, &terms);
        alpha = new[7];
        (root[0], inverse[0]) = (root[8], inverse[8]);
        for c in 0..8 {
            root[c + 1] = math::sqrt(new[c]);
            inverse[c + 1] = 1.0 / root[c + 1];
        }
        for c in 0..8 {
            own[c] = root[c] * inverse[c + 1];
            lambda[c] = if root[c] == 0.0 { 0.0 } else { -f[c] * inverse[c] * inverse[c + 1] };
        }
    }
    sweep::<L, true>(n, f, lambda, own, columns);
}

/// g ← 0, then for each column c_k ← own_k c_k + λ_k g, g ← g + v_k c_k with the old c_k. own_k is 1 if not `SCALED`.
/// Columns with v_k = 0 do not change.
#[inline(always)]
fn sweep<L: Lanes, const SCALED: bool>(n: usize, v: &[f64], lambda: &[f64], own: &[f64], columns: &mut [f64]) {
    let tiles = n.div_ceil(8);
    let columns = columns.as_chunks_mut::<8>().0;
    for t in 0..tiles {
        let mut gain = L::splat(0.0);
        for k in 8 * t..n {
            if v[k] == 0.0 {
                continue;
            }
            let column = &mut columns[k * tiles + t];
            let old = L::load(column);
            let kept = if SCALED { old.mul(L::splat(own[k])) } else { old };
            L::splat(lambda[k]).mul_add(gain, kept).store(column);
            gain = L::splat(v[k]).mul_add(old, gain);
        }
    }
}
