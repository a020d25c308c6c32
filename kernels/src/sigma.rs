//! Sigma points: a square root of P, and sums of products over points.

use crate::lanes::Lanes;
use crate::math;

/// A variance remainder below this share of the variance is rounding.
const ROUNDING: f64 = 1e-14;

/// Row j of `l` ← column j of the lower L with P = L Lᵀ, row after row; zero if only rounding remains of its variance.
#[inline(always)]
pub(crate) fn root<L: Lanes>(n: usize, p: &[f64], l: &mut [f64]) {
    let tiles = n.div_ceil(8);
    let (p, l) = (p.as_chunks::<8>().0, l.as_chunks_mut::<8>().0);
    for j in 0..n {
        let (done, rest) = l.split_at_mut(j * tiles);
        let row = &mut rest[..tiles];
        row[..j / 8].fill([0.0; 8]);
        for t in j / 8..tiles {
            let mut sum = L::load(&p[j * tiles + t]);
            for above in done.chunks_exact(tiles) {
                sum = L::splat(above[j / 8][j % 8]).mul_sub_from(L::load(&above[t]), sum);
            }
            sum.store(&mut row[t]);
        }
        let (pivot, variance) = (row[j / 8][j % 8], p[j * tiles + j / 8][j % 8]);
        let inverse = if pivot > ROUNDING * variance {
            1.0 / math::sqrt(pivot)
        } else {
            0.0
        };
        for t in j / 8..tiles {
            let mut scaled = L::load(&row[t]).mul(L::splat(inverse));
            if t == j / 8 {
                scaled = scaled.after(j % 8, L::splat(0.0));
            }
            scaled.store(&mut row[t]);
        }
        if inverse == 0.0 {
            // Also if the remainder was NaN.
            row.fill([0.0; 8]);
        }
    }
}

/// P ← P + w Σ_k x_k x_kᵀ over `count` padded rows of n numbers; P stays symmetric to the bit.
#[inline(always)]
pub(crate) fn outer<L: Lanes>(n: usize, count: usize, x: &[f64], w: f64, p: &mut [f64]) {
    let tiles = n.div_ceil(8);
    let mut i = 0;
    while i < n {
        match n - i {
            1 => some_rows::<L, 1>(count, x, w, i, tiles, p),
            2 => some_rows::<L, 2>(count, x, w, i, tiles, p),
            3 => some_rows::<L, 3>(count, x, w, i, tiles, p),
            _ => some_rows::<L, 4>(count, x, w, i, tiles, p),
        }
        i += 4;
    }
}

/// Rows `i` to `i + G` of P.
#[inline(always)]
fn some_rows<L: Lanes, const G: usize>(count: usize, x: &[f64], w: f64, i: usize, tiles: usize, p: &mut [f64]) {
    let p = p.as_chunks_mut::<8>().0;
    for t in 0..tiles {
        let mut sum = [L::splat(0.0); G];
        for row in x.chunks_exact(8 * tiles).take(count) {
            let tile = L::load(&row.as_chunks::<8>().0[t]);
            let factors = &row[i..i + G];
            for g in 0..G {
                sum[g] = L::splat(factors[g]).mul_add(tile, sum[g]);
            }
        }
        for g in 0..G {
            let at = &mut p[(i + g) * tiles + t];
            sum[g].mul(L::splat(w)).add(L::load(at)).store(at);
        }
    }
}
