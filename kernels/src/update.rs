//! A measurement of m rows: HP, its solutions with the factor of S, and the reduction of P.
//!
//! P as in [`congruence`](crate::congruence); HP and similar matrices have m rows of the same length.

use crate::lanes::{Lanes, size, some, some_mut};

/// Rows `rows` of HP, one after the other: Σ_k H_ik P_k over the columns in `columns`.
#[inline(always)]
pub(crate) fn project<L: Lanes>(rows: usize, h: &[f64], columns: &[(usize, usize)], p: &[f64], out: &mut [f64], ld: usize) {
    let last = columns.iter().fold(0, |last, range| last.max(range.1));
    assert!(
        last <= ld && p.len() >= size(last, ld) && h.len() >= size(rows, ld),
        "H of {rows} rows, {last} columns"
    );
    let (p, out) = (p.as_chunks::<8>().0, out.as_chunks_mut::<8>().0);
    let mut i = 0;
    while i < rows {
        let (h, out) = (&h[i * ld..], &mut out[i * (ld / 8)..]);
        i += match rows - i {
            1 => some_rows::<L, 1>(h, columns, p, out, ld / 8),
            2 => some_rows::<L, 2>(h, columns, p, out, ld / 8),
            6.. if L::ROWS == 8 => some_rows::<L, 6>(h, columns, p, out, ld / 8),
            _ => some_rows::<L, 3>(h, columns, p, out, ld / 8),
        };
    }
}

/// G of these rows; returns G.
#[inline(always)]
fn some_rows<L: Lanes, const G: usize>(h: &[f64], columns: &[(usize, usize)], p: &[[f64; 8]], out: &mut [[f64; 8]], tiles: usize) -> usize {
    let mut t = 0;
    while t < tiles {
        let wide = L::TILES.min(tiles - t);
        match wide {
            1 => some_tiles::<L, G, 1>(h, columns, p, t, out, tiles),
            2 => some_tiles::<L, G, 2>(h, columns, p, t, out, tiles),
            _ => some_tiles::<L, G, 3>(h, columns, p, t, out, tiles),
        }
        t += wide;
    }
    G
}

#[inline(always)]
fn some_tiles<L: Lanes, const G: usize, const W: usize>(
    h: &[f64],
    columns: &[(usize, usize)],
    p: &[[f64; 8]],
    t: usize,
    out: &mut [[f64; 8]],
    tiles: usize,
) {
    let mut sum = [[L::splat(0.0); W]; G];
    for &(start, end) in columns {
        for k in start..end {
            #[expect(unsafe_code, reason = "see `some`")]
            // SAFETY: `project` looks at the lengths of P, and t + W ≤ tiles.
            let row = unsafe { some::<_, W>(p, k * tiles + t) };
            for g in 0..G {
                #[expect(unsafe_code, reason = "see `some`")]
                // SAFETY: `project` looks at the length of H, which has G rows from here on.
                let [factor] = unsafe { some::<_, 1>(h, 8 * g * tiles + k) };
                let factor = L::splat(*factor);
                for w in 0..W {
                    sum[g][w] = factor.mul_add(L::load(&row[w]), sum[g][w]);
                }
            }
        }
    }
    for g in 0..G {
        let out = &mut out[g * tiles + t..][..W];
        for w in 0..W {
            sum[g][w].store(&mut out[w]);
        }
    }
}

/// Whether addresses have 32 bits, as on a microcontroller: there, most of the separate code for each number of rows
/// takes flash and saves no time.
const IS_SMALL: bool = cfg!(target_pointer_width = "32");

/// Calls a function with the number of rows as a constant for the usual numbers, so that its loops are unrolled; 0
/// means any other number.
macro_rules! by_rows {
    ($m:expr, $function:ident::<$lanes:ty>($($arg:expr),*)) => {
        match if IS_SMALL { 0 } else { $m } {
            1 => $function::<$lanes, 1>($($arg),*),
            2 => $function::<$lanes, 2>($($arg),*),
            3 => $function::<$lanes, 3>($($arg),*),
            6 => $function::<$lanes, 6>($($arg),*),
            _ => $function::<$lanes, 0>($($arg),*),
        }
    };
}

/// out ← XHᵀ, m×m, row by row, for a symmetric result. The elements up to the diagonal are computed, eight at once.
#[inline(always)]
pub(crate) fn inner<L: Lanes>(m: usize, h: &[f64], x: &[f64], out: &mut [f64], ld: usize) {
    let tiles = ld / 8;
    let (h, x, out) = (
        &h.as_chunks::<8>().0[..size(m, tiles)],
        &x.as_chunks::<8>().0[..size(m, tiles)],
        &mut out[..size(m, m)],
    );
    match m {
        1 => eight::<L, 0, 1>(m, h, x, out, tiles),
        2 => eight::<L, 0, 3>(m, h, x, out, tiles),
        3 => eight::<L, 0, 6>(m, h, x, out, tiles),
        6 if !IS_SMALL => {
            eight::<L, 0, 8>(m, h, x, out, tiles);
            eight::<L, 8, 8>(m, h, x, out, tiles);
            eight::<L, 16, 5>(m, h, x, out, tiles);
        }
        _ => {
            for i in 0..m {
                for first in (0..=i).step_by(8) {
                    let mut places = [(i, first); 8];
                    let count = (i + 1 - first).min(8);
                    for k in 0..count {
                        places[k].1 = first + k;
                    }
                    elements::<L>(places, count, m, h, x, out, tiles);
                }
            }
        }
    }
}

/// The positions in a lower triangle, row by row.
const PLACES: [(usize, usize); 21] = {
    let mut places = [(0, 0); 21];
    let (mut k, mut i) = (0, 0);
    while i < 6 {
        let mut j = 0;
        while j <= i {
            places[k] = (i, j);
            (k, j) = (k + 1, j + 1);
        }
        i += 1;
    }
    places
};

/// COUNT elements, at most eight, from FIRST: the compiler knows their positions.
#[inline(always)]
fn eight<L: Lanes, const FIRST: usize, const COUNT: usize>(m: usize, h: &[[f64; 8]], x: &[[f64; 8]], out: &mut [f64], tiles: usize) {
    let mut places = [PLACES[FIRST]; 8];
    places[..COUNT].copy_from_slice(&PLACES[FIRST..FIRST + COUNT]);
    elements::<L>(places, COUNT, m, h, x, out, tiles);
}

/// `count` elements of XHᵀ, at most eight; unused positions repeat the first one.
#[inline(always)]
fn elements<L: Lanes>(places: [(usize, usize); 8], count: usize, m: usize, h: &[[f64; 8]], x: &[[f64; 8]], out: &mut [f64], tiles: usize) {
    let mut terms = [L::splat(0.0); 8];
    for t in 0..tiles {
        for k in 0..8 {
            if k < count {
                let (i, j) = places[k];
                #[expect(unsafe_code, reason = "see `some`")]
                // SAFETY: the callers have i < m and j < m; X and H have m rows.
                let ([x], [h]) = unsafe { (some::<_, 1>(x, i * tiles + t), some::<_, 1>(h, j * tiles + t)) };
                terms[k] = L::load(x).mul_add(L::load(h), terms[k]);
            }
        }
    }
    let mut sums = [0.0; 8];
    L::sums(terms).store(&mut sums);
    for k in 0..8 {
        if k < count {
            let (i, j) = places[k];
            out[i * m + j] = sums[k];
            out[j * m + i] = sums[k];
        }
    }
}

/// U ← L⁻¹X and K ← L⁻ᵀU; L lower, m×m, row by row.
#[inline(always)]
pub(crate) fn gain<L: Lanes>(l: &[f64], m: usize, x: &[f64], u: &mut [f64], k: &mut [f64], ld: usize) {
    by_rows!(m, gain_of::<L>(l, m, x, u, k, ld / 8));
}

#[inline(always)]
fn gain_of<L: Lanes, const M: usize>(l: &[f64], m: usize, x: &[f64], u: &mut [f64], k: &mut [f64], tiles: usize) {
    let m = if M == 0 { m } else { M };
    let (l, x) = (&l[..m * m], &x.as_chunks::<8>().0[..m * tiles]);
    let (u, k) = (
        &mut u.as_chunks_mut::<8>().0[..m * tiles],
        &mut k.as_chunks_mut::<8>().0[..m * tiles],
    );
    // Divisions take longest: there is one per row, not one per tile, if M is known.
    let mut inverses = [0.0; M];
    for i in 0..M {
        inverses[i] = 1.0 / l[i * m + i];
    }
    for t in 0..tiles {
        for i in 0..m {
            let inverse = L::splat(if M == 0 { 1.0 / l[i * m + i] } else { inverses[i] });
            let mut sum = L::load(&x[i * tiles + t]);
            for j in 0..i {
                sum = L::splat(l[i * m + j]).mul_sub_from(L::load(&u[j * tiles + t]), sum);
            }
            sum.mul(inverse).store(&mut u[i * tiles + t]);
        }
        for i in (0..m).rev() {
            let inverse = L::splat(if M == 0 { 1.0 / l[i * m + i] } else { inverses[i] });
            let mut sum = L::load(&u[i * tiles + t]);
            for j in i + 1..m {
                sum = L::splat(l[j * m + i]).mul_sub_from(L::load(&k[j * tiles + t]), sum);
            }
            sum.mul(inverse).store(&mut k[i * tiles + t]);
        }
    }
}

/// P ← P − UᵀU, U of m rows: symmetric to the bit.
#[inline(always)]
pub(crate) fn downdate<L: Lanes>(n: usize, u: &[f64], m: usize, p: &mut [f64]) {
    by_rows!(m, less::<L>(n, u, m, p));
}

#[inline(always)]
fn less<L: Lanes, const M: usize>(n: usize, u: &[f64], m: usize, p: &mut [f64]) {
    let (m, tiles) = (if M == 0 { m } else { M }, n.div_ceil(8));
    let ld = size(8, tiles);
    assert!(u.len() >= size(m, ld) && p.len() >= size(n, ld), "U of {m} rows, P of {n}");
    let p = p.as_chunks_mut::<8>().0;
    let mut t = 0;
    while t < tiles {
        let wide = L::TILES.min(tiles - t);
        let mut i = 0;
        while i < n {
            i += match (wide, n - i) {
                (1, 1 | 2) => less_tiles::<L, M, 1, 1>(u, m, i, p, tiles, t),
                (2, 1 | 2) => less_tiles::<L, M, 1, 2>(u, m, i, p, tiles, t),
                (_, 1 | 2) => less_tiles::<L, M, 1, 3>(u, m, i, p, tiles, t),
                (1, _) => less_tiles::<L, M, 3, 1>(u, m, i, p, tiles, t),
                (2, _) => less_tiles::<L, M, 3, 2>(u, m, i, p, tiles, t),
                (_, _) => less_tiles::<L, M, 3, 3>(u, m, i, p, tiles, t),
            };
        }
        t += wide;
    }
}

/// Tiles `t` to `t + W` of G rows from `i`; returns G.
#[inline(always)]
fn less_tiles<L: Lanes, const M: usize, const G: usize, const W: usize>(
    u: &[f64],
    m: usize,
    i: usize,
    p: &mut [[f64; 8]],
    tiles: usize,
    t: usize,
) -> usize {
    let m = if M == 0 { m } else { M };
    let mut sum = [[L::splat(0.0); W]; G];
    for g in 0..G {
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: `less` has i + G ≤ n, t + W ≤ tiles, and looks at the lengths.
        let own = unsafe { some::<_, W>(p, (i + g) * tiles + t) };
        for w in 0..W {
            sum[g][w] = L::load(&own[w]);
        }
    }
    let rows = u.as_chunks::<8>().0;
    for l in 0..m {
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: as above; l < m.
        let (factors, row) = unsafe { (some::<_, G>(u, 8 * l * tiles + i), some::<_, W>(rows, l * tiles + t)) };
        for g in 0..G {
            let factor = L::splat(factors[g]);
            for w in 0..W {
                sum[g][w] = factor.mul_sub_from(L::load(&row[w]), sum[g][w]);
            }
        }
    }
    for g in 0..G {
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: as above.
        let own = unsafe { some_mut::<_, W>(p, (i + g) * tiles + t) };
        for w in 0..W {
            sum[g][w].store(&mut own[w]);
        }
    }
    G
}

/// P ← P − DᵀK − KᵀD, with m rows each. Both products are rounded before the addition, so P stays symmetric to the bit.
#[inline(always)]
pub(crate) fn refine<L: Lanes>(n: usize, d: &[f64], k: &[f64], m: usize, p: &mut [f64]) {
    let tiles = n.div_ceil(8);
    let (p, d8, k8) = (p.as_chunks_mut::<8>().0, d.as_chunks::<8>().0, k.as_chunks::<8>().0);
    for i in 0..n {
        for t in 0..tiles {
            let mut sum = L::load(&p[i * tiles + t]);
            for l in 0..m {
                let (di, ki) = (L::splat(d[8 * l * tiles + i]), L::splat(k[8 * l * tiles + i]));
                let both = di.mul(L::load(&k8[l * tiles + t])).add(ki.mul(L::load(&d8[l * tiles + t])));
                sum = both.sub_from(sum);
            }
            sum.store(&mut p[i * tiles + t]);
        }
    }
}

/// X ← X − R Y, R m×m, row by row.
#[inline(always)]
pub(crate) fn subtract<L: Lanes>(r: &[f64], m: usize, y: &[f64], x: &mut [f64], ld: usize) {
    let (x, y, tiles) = (x.as_chunks_mut::<8>().0, y.as_chunks::<8>().0, ld / 8);
    for i in 0..m {
        for t in 0..tiles {
            let mut sum = L::load(&x[i * tiles + t]);
            for k in 0..m {
                sum = L::splat(r[i * m + k]).mul_sub_from(L::load(&y[k * tiles + t]), sum);
            }
            sum.store(&mut x[i * tiles + t]);
        }
    }
}
