//! A measurement of m rows: HP, its factors by that of S, and what P loses by it.
//!
//! P as in [`congruence`](crate::congruence); HP and its like are m rows of the same length.

use crate::lanes::Lanes;

/// Rows `rows` of HP, one after the other: Σ_k H_ik P_k over the columns in `columns`.
#[inline(always)]
pub(crate) fn project<L: Lanes>(rows: usize, h: &[f64], columns: &[(usize, usize)], p: &[f64], out: &mut [f64], ld: usize) {
    let (p, out) = (p.as_chunks::<8>().0, out.as_chunks_mut::<8>().0);
    let mut i = 0;
    while i < rows {
        match rows - i {
            1 => some_rows::<L, 1>(&h[i * ld..], columns, p, &mut out[i * (ld / 8)..], ld),
            2 => some_rows::<L, 2>(&h[i * ld..], columns, p, &mut out[i * (ld / 8)..], ld),
            _ => some_rows::<L, 3>(&h[i * ld..], columns, p, &mut out[i * (ld / 8)..], ld),
        }
        i += 3;
    }
}

#[inline(always)]
fn some_rows<L: Lanes, const G: usize>(h: &[f64], columns: &[(usize, usize)], p: &[[f64; 8]], out: &mut [[f64; 8]], ld: usize) {
    let tiles = ld / 8;
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
            let mut factors = [0.0; G];
            for g in 0..G {
                factors[g] = h[8 * g * tiles + k];
            }
            if factors == [0.0; G] {
                continue;
            }
            let row = &p[k * tiles + t..][..W];
            for g in 0..G {
                let factor = L::splat(factors[g]);
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

/// X ← L⁻¹X; L lower, m×m, row by row.
#[inline(always)]
pub(crate) fn forward<L: Lanes>(l: &[f64], m: usize, x: &mut [f64], ld: usize) {
    let (x, tiles) = (x.as_chunks_mut::<8>().0, ld / 8);
    for i in 0..m {
        let inverse = L::splat(1.0 / l[i * m + i]);
        for t in 0..tiles {
            let mut sum = L::load(&x[i * tiles + t]);
            for k in 0..i {
                sum = L::splat(l[i * m + k]).mul_sub_from(L::load(&x[k * tiles + t]), sum);
            }
            sum.mul(inverse).store(&mut x[i * tiles + t]);
        }
    }
}

/// X ← L⁻ᵀX.
#[inline(always)]
pub(crate) fn backward<L: Lanes>(l: &[f64], m: usize, x: &mut [f64], ld: usize) {
    let (x, tiles) = (x.as_chunks_mut::<8>().0, ld / 8);
    for i in (0..m).rev() {
        let inverse = L::splat(1.0 / l[i * m + i]);
        for t in 0..tiles {
            let mut sum = L::load(&x[i * tiles + t]);
            for k in i + 1..m {
                sum = L::splat(l[k * m + i]).mul_sub_from(L::load(&x[k * tiles + t]), sum);
            }
            sum.mul(inverse).store(&mut x[i * tiles + t]);
        }
    }
}

/// P ← P − UᵀU, U of m rows: symmetric to the bit.
#[inline(always)]
pub(crate) fn downdate<L: Lanes>(n: usize, u: &[f64], m: usize, p: &mut [f64]) {
    let tiles = n.div_ceil(8);
    let p = p.as_chunks_mut::<8>().0;
    let mut i = 0;
    while i < n {
        match n - i {
            1 => less::<L, 1>(u, m, i, p, tiles),
            2 => less::<L, 2>(u, m, i, p, tiles),
            _ => less::<L, 3>(u, m, i, p, tiles),
        }
        i += 3;
    }
}

#[inline(always)]
fn less<L: Lanes, const G: usize>(u: &[f64], m: usize, i: usize, p: &mut [[f64; 8]], tiles: usize) {
    let mut t = 0;
    while t < tiles {
        let wide = L::TILES.min(tiles - t);
        match wide {
            1 => less_tiles::<L, G, 1>(u, m, i, p, tiles, t),
            2 => less_tiles::<L, G, 2>(u, m, i, p, tiles, t),
            _ => less_tiles::<L, G, 3>(u, m, i, p, tiles, t),
        }
        t += wide;
    }
}

#[inline(always)]
fn less_tiles<L: Lanes, const G: usize, const W: usize>(u: &[f64], m: usize, i: usize, p: &mut [[f64; 8]], tiles: usize, t: usize) {
    let rows = u.as_chunks::<8>().0;
    let mut sum = [[L::splat(0.0); W]; G];
    for g in 0..G {
        let own = &p[(i + g) * tiles + t..][..W];
        for w in 0..W {
            sum[g][w] = L::load(&own[w]);
        }
    }
    for l in 0..m {
        let factors = &u[8 * l * tiles + i..][..G];
        let row = &rows[l * tiles + t..][..W];
        for g in 0..G {
            let factor = L::splat(factors[g]);
            for w in 0..W {
                sum[g][w] = factor.mul_sub_from(L::load(&row[w]), sum[g][w]);
            }
        }
    }
    for g in 0..G {
        let own = &mut p[(i + g) * tiles + t..][..W];
        for w in 0..W {
            sum[g][w].store(&mut own[w]);
        }
    }
}

/// P ← P − DᵀK − KᵀD, of m rows each: both products are rounded before they are added, which is
/// symmetric to the bit.
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
