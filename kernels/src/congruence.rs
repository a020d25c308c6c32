//! ΦPΦᵀ for a Φ whose pattern is known when the filter has run a step.
//!
//! P is symmetric, n rows of a multiple of eight numbers, zero behind n; Φ is stored transposed, in
//! rows of the same length, so that row k is column k of Φ: both products below read it along rows.
//!
//! With `end` the first row from which on Φ is diagonal, and A = ΦP of the rows before it,
//!
//! 1. A_i = Σ_k Φ_ik P_k over the columns k that row i reads, three rows at a time,
//! 2. (ΦPΦᵀ)_i = A_i ∘ m + Σ_k A_ik (Φᵀ)_k over the columns that any row reads; m has the diagonal of Φ
//!    where step 2 reads no column, 0 elsewhere; the upper triangle only, in tiles of eight,
//! 3. the tiles of the upper triangle, and their transposes, take their places in P.

use crate::Lines;
use crate::lanes::{Lanes, some};

/// Rows that are computed together: they read nearly the same columns.
#[derive(Clone, Copy, Debug)]
struct Group {
    first: usize,
    rows: usize,
    /// Where its columns lie in [`Plan::reads`].
    reads: (usize, usize),
}

/// The pattern of a Φ, and how its products go through it.
#[derive(Clone, Debug)]
pub struct Plan {
    n: usize,
    /// Tiles of eight columns.
    tiles: usize,
    /// The first row from which on Φ is diagonal, and the tiles up to it.
    end: usize,
    end_tiles: usize,
    groups: Vec<Group>,
    /// The columns that each group reads, in order.
    reads: Vec<u16>,
    /// The columns that any row before `end` reads, in order.
    columns: Vec<u16>,
    /// Whether Φ may have other numbers than 1 from row `end` on.
    is_scaled: bool,
}

/// The most columns that a row reads for its neighbours' sake: the others of a block of three.
const SPARE: usize = 2;

impl Plan {
    /// For a Φ of `rows`: per row, the ranges of columns in which it may differ from the identity,
    /// apart and in order.
    #[must_use]
    pub fn new(rows: &[Vec<(u16, u16)>]) -> Self {
        let n = rows.len();
        let of = |i: usize| {
            let mut columns: Vec<u16> = rows[i].iter().flat_map(|&(start, end)| start..end).collect();
            if let Err(place) = columns.binary_search(&(i as u16)) {
                columns.insert(place, i as u16);
            }
            columns
        };
        let end = (0..n).rfind(|&i| of(i).len() > 1).map_or(0, |i| i + 1);
        let mut plan = Self {
            n,
            tiles: n.div_ceil(8),
            end,
            end_tiles: end.div_ceil(8),
            groups: Vec::new(),
            reads: Vec::new(),
            columns: Vec::new(),
            is_scaled: rows[end..].iter().any(|ranges| !ranges.is_empty()),
        };
        let mut i = 0;
        while i < end {
            let (first, mut columns) = (i, of(i));
            i += 1;
            while i < end && i - first < 3 {
                let next = of(i);
                let both = union(&columns, &next);
                if both.len() > columns.len().min(next.len()) + SPARE {
                    break;
                }
                columns = both;
                i += 1;
            }
            plan.columns = union(&plan.columns, &columns);
            let start = plan.reads.len();
            plan.reads.extend(columns);
            plan.groups.push(Group {
                first,
                rows: i - first,
                reads: (start, plan.reads.len()),
            });
        }
        plan
    }

    /// Row length of P and Φᵀ.
    const fn ld(&self) -> usize {
        8 * self.tiles
    }
}

fn union(a: &[u16], b: &[u16]) -> Vec<u16> {
    let mut both = [a, b].concat();
    both.sort_unstable();
    both.dedup();
    both
}

/// Working memory of a product, sized once.
#[derive(Clone, Debug)]
pub struct Product {
    /// A of a group.
    a: Lines,
    /// ΦPΦᵀ: the upper triangle, as far as the tiles of `end`.
    r: Lines,
    /// The diagonal of Φ, and m.
    diagonal: Lines,
    m: Lines,
}

impl Product {
    /// For `n` rows.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let ld = n.next_multiple_of(8);
        Self {
            a: Lines::zeros(3 * ld),
            r: Lines::zeros(ld * ld),
            diagonal: Lines::zeros(ld),
            m: Lines::zeros(ld),
        }
    }

    /// (ΦPΦᵀ)_ii.
    #[must_use]
    pub fn variance(&self, plan: &Plan, p: &[f64], i: usize) -> f64 {
        if i < 8 * plan.end_tiles {
            self.r[i * plan.ld() + i]
        } else if plan.is_scaled {
            p[i * plan.ld() + i] * (self.diagonal[i] * self.diagonal[i])
        } else {
            p[i * plan.ld() + i]
        }
    }

    /// The diagonal of Φ, and m.
    fn scales(&mut self, plan: &Plan, phi: &[f64]) {
        let ld = plan.ld();
        for i in 0..plan.n {
            self.diagonal[i] = phi[i * ld + i];
        }
        self.m.copy_from_slice(&self.diagonal);
        for &k in plan.columns.iter().filter(|&&k| usize::from(k) < 8 * plan.end_tiles) {
            self.m[usize::from(k)] = 0.0;
        }
    }
}

/// The rows of ΦPΦᵀ that are not a scaling of those of P.
#[inline(always)]
pub(crate) fn product<L: Lanes>(plan: &Plan, phi: &[f64], p: &[f64], w: &mut Product) {
    let (tiles, n, ld) = (plan.tiles, plan.n, plan.ld());
    let is_large = p.len() >= n * ld && phi.len() >= n * ld;
    let has_room = w.a.len() >= 3 * ld && w.m.len() >= ld;
    assert!(is_large && has_room, "matrices of {n} rows");
    w.scales(plan, phi);
    for group in &plan.groups {
        match group.rows {
            1 => rows::<L, 1>(plan, group, phi, p, w),
            2 => rows::<L, 2>(plan, group, phi, p, w),
            _ => rows::<L, 3>(plan, group, phi, p, w),
        }
    }
    // The rows that share a tile with the last of these.
    let (p, r) = (p.as_chunks::<8>().0, w.r.as_chunks_mut::<8>().0);
    let diagonal = w.diagonal.as_chunks::<8>().0;
    for i in plan.end..plan.n.min(8 * plan.end_tiles) {
        for t in i / 8..tiles {
            let at = i * tiles + t;
            let mut v = L::load(&p[at]);
            if plan.is_scaled {
                v = v.mul(L::load(&diagonal[t]).mul(L::splat(diagonal[i / 8][i % 8])));
            }
            v.store(&mut r[at]);
        }
    }
}

#[inline(always)]
fn rows<L: Lanes, const G: usize>(plan: &Plan, group: &Group, phi: &[f64], p: &[f64], w: &mut Product) {
    let tiles = plan.tiles;
    let reads = &plan.reads[group.reads.0..group.reads.1];
    let p = p.as_chunks::<8>().0;
    let a = w.a.as_chunks_mut::<8>().0;
    let mut t = 0;
    while t < tiles {
        let wide = L::TILES.min(tiles - t);
        match wide {
            1 => left::<L, G, 1>(reads, phi, group.first, p, tiles, t, a),
            2 => left::<L, G, 2>(reads, phi, group.first, p, tiles, t, a),
            _ => left::<L, G, 3>(reads, phi, group.first, p, tiles, t, a),
        }
        t += wide;
    }
    let phi = phi.as_chunks::<8>().0;
    let (m, r) = (w.m.as_chunks::<8>().0, w.r.as_chunks_mut::<8>().0);
    let mut t = group.first / 8;
    while t < plan.end_tiles {
        let wide = L::TILES.min(plan.end_tiles - t);
        match wide {
            1 => right::<L, G, 1>(&plan.columns, phi, group.first, &w.a, m, tiles, t, r),
            2 => right::<L, G, 2>(&plan.columns, phi, group.first, &w.a, m, tiles, t, r),
            _ => right::<L, G, 3>(&plan.columns, phi, group.first, &w.a, m, tiles, t, r),
        }
        t += wide;
    }
    let a = w.a.as_chunks::<8>().0;
    for t in plan.end_tiles..tiles {
        for g in 0..G {
            let v = L::load(&a[g * tiles + t]).mul(L::load(&m[t]));
            v.store(&mut r[(group.first + g) * tiles + t]);
        }
    }
}

/// Tiles `t` to `t + W` of A = ΦP, of G rows from `first` on.
#[inline(always)]
fn left<L: Lanes, const G: usize, const W: usize>(
    reads: &[u16],
    phi: &[f64],
    first: usize,
    p: &[[f64; 8]],
    tiles: usize,
    t: usize,
    a: &mut [[f64; 8]],
) {
    let mut sum = [[L::splat(0.0); W]; G];
    for &k in reads {
        let k = usize::from(k);
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: `Plan::new` has k < n, first + G ≤ n and t + W ≤ tiles; `product` looks at the lengths.
        let (factors, row) = unsafe { (some::<_, G>(phi, 8 * k * tiles + first), some::<_, W>(p, k * tiles + t)) };
        for g in 0..G {
            let factor = L::splat(factors[g]);
            for w in 0..W {
                sum[g][w] = factor.mul_add(L::load(&row[w]), sum[g][w]);
            }
        }
    }
    for g in 0..G {
        let out = &mut a[g * tiles + t..][..W];
        for w in 0..W {
            sum[g][w].store(&mut out[w]);
        }
    }
}

/// Tiles `t` to `t + W` of AΦᵀ, of G rows from `first` on.
#[expect(clippy::too_many_arguments, reason = "pieces of borrowed memory")]
#[inline(always)]
fn right<L: Lanes, const G: usize, const W: usize>(
    columns: &[u16],
    phi: &[[f64; 8]],
    first: usize,
    a: &[f64],
    m: &[[f64; 8]],
    tiles: usize,
    t: usize,
    r: &mut [[f64; 8]],
) {
    let mut sum = [[L::splat(0.0); W]; G];
    let own = a.as_chunks::<8>().0;
    for g in 0..G {
        for w in 0..W {
            sum[g][w] = L::load(&own[g * tiles + t + w]).mul(L::load(&m[t + w]));
        }
    }
    for &k in columns {
        let k = usize::from(k);
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: as in `left`; `a` has three rows.
        let row = unsafe { some::<_, W>(phi, k * tiles + t) };
        for g in 0..G {
            #[expect(unsafe_code, reason = "see `some`")]
            // SAFETY: as above.
            let [factor] = unsafe { some::<_, 1>(a, 8 * g * tiles + k) };
            let factor = L::splat(*factor);
            for w in 0..W {
                sum[g][w] = factor.mul_add(L::load(&row[w]), sum[g][w]);
            }
        }
    }
    for g in 0..G {
        let out = &mut r[(first + g) * tiles + t..][..W];
        for w in 0..W {
            sum[g][w].store(&mut out[w]);
        }
    }
}

/// Puts what [`product`] made into P.
#[inline(always)]
pub(crate) fn place<L: Lanes>(plan: &Plan, w: &Product, p: &mut [f64]) {
    let (tiles, n) = (plan.tiles, plan.n);
    let (p, r) = (p.as_chunks_mut::<8>().0, w.r.as_chunks::<8>().0);
    for i in 0..plan.end_tiles {
        let rows = (n - 8 * i).min(8);
        for j in i..tiles {
            let mut tile = [L::splat(0.0); 8];
            for k in 0..8 {
                tile[k] = L::load(&r[(8 * i + k) * tiles + j]);
            }
            let across = L::transpose(tile);
            if i == j {
                for k in 0..8 {
                    if k < rows {
                        tile[k].after(k, across[k]).store(&mut p[(8 * i + k) * tiles + i]);
                    }
                }
                continue;
            }
            let below = (n - 8 * j).min(8);
            for k in 0..8 {
                tile[k].store(&mut p[(8 * i + k) * tiles + j]);
                if k < below {
                    across[k].store(&mut p[(8 * j + k) * tiles + i]);
                }
            }
        }
    }
    if plan.is_scaled {
        let diagonal = w.diagonal.as_chunks::<8>().0;
        for i in 8 * plan.end_tiles..n {
            let own = L::splat(diagonal[i / 8][i % 8]);
            for t in plan.end_tiles..tiles {
                let at = &mut p[i * tiles + t];
                // The product of both scales first: it is the same on both sides of the diagonal.
                L::load(at).mul(L::load(&diagonal[t]).mul(own)).store(at);
            }
        }
    }
}
