//! ΦPΦᵀ for a Φ with a pattern that is known after the first step of the filter.
//!
//! P is symmetric and has n rows. The row length is a multiple of eight, with zeros after column n. Φ is stored
//! transposed, in rows of the same length: row k is column k of Φ. So both products below read Φ along rows.
//!
//! `end` is the first row from which Φ is diagonal, `whole` is the number of tiles of eight columns before it, and
//! `rest` the columns between these tiles and `end`:
//!
//! 1. A_i = Σ_k Φ_ik P_k for the rows before `end`, over the columns k that row i reads, three rows at a time,
//! 2. R_i = Σ_k A_ik (Φᵀ)_k for their columns up to the diagonal, over the columns k that those rows of Φ read,
//! 3. the lower triangle of R and its transpose replace these parts of P; from `end` a column is a scaled column of A.

use crate::Lines;
use crate::lanes::{Lanes, some, some_mut};
use alloc::vec::Vec;
use core::ops::Range;

/// Rows that are computed together because they read nearly the same columns.
#[derive(Clone, Debug)]
struct Group {
    rows: Range<usize>,
    /// The columns that they read, in order.
    reads: Vec<u16>,
}

/// The pattern of a Φ, and the order of its products.
#[derive(Clone, Debug)]
pub struct Plan {
    n: usize,
    /// Tiles of eight columns.
    tiles: usize,
    /// The first row from which Φ is diagonal: eight times `whole`, plus `rest`.
    end: usize,
    whole: usize,
    rest: usize,
    groups: Vec<Group>,
    /// For each tile before `end`, the groups of rows of R. They read the columns that the rows of Φ read, from the
    /// first row of the tile up to their own row.
    below: Vec<Vec<Group>>,
    /// True if Φ may differ from 1 on the diagonal from row `end`.
    is_scaled: bool,
}

/// The largest number of columns that a row reads only because its neighbours do: the others of a block of three.
const SPARE: usize = 2;

impl Plan {
    /// Makes a plan for a Φ with `rows`. For each row these are the ranges of columns in which it may differ from the
    /// identity, separate and in order.
    ///
    /// # Panics
    /// If a range ends after the last column, or begins before the end of the range to its left, or if there are more
    /// than 65535 rows. The products rely on these columns.
    #[must_use]
    pub fn new(rows: &[Vec<(u16, u16)>]) -> Self {
        let n = rows.len();
        check(rows);
        let of = |i: usize| {
            let mut columns: Vec<u16> = rows[i].iter().flat_map(|&(start, end)| start..end).collect();
            if let Err(place) = columns.binary_search(&(i as u16)) {
                columns.insert(place, i as u16);
            }
            columns
        };
        let end = (0..n).rfind(|&i| of(i).len() > 1).map_or(0, |i| i + 1);
        let mut groups = Vec::new();
        let mut i = 0;
        while i < end {
            let (first, mut reads) = (i, of(i));
            i += 1;
            while i < end && i - first < 3 {
                let next = of(i);
                let both = union(&reads, &next);
                if both.len() > reads.len().min(next.len()) + SPARE {
                    break;
                }
                reads = both;
                i += 1;
            }
            groups.push(Group { rows: first..i, reads });
        }
        Self {
            n,
            tiles: n.div_ceil(8),
            end,
            whole: end / 8,
            rest: end % 8,
            groups,
            below: (0..end.div_ceil(8)).map(|t| below(t, end, of)).collect(),
            is_scaled: rows[end..].iter().any(|ranges| !ranges.is_empty()),
        }
    }

    /// Row length of P and Φᵀ.
    #[inline(always)]
    const fn ld(&self) -> usize {
        8 * self.tiles
    }
}

/// Panics unless the ranges of every row are apart, in order and within the columns of a square matrix.
pub(crate) fn check(rows: &[Vec<(u16, u16)>]) {
    let n = rows.len();
    assert!(n <= usize::from(u16::MAX), "a transition of {n} rows: at most 65535 are possible");
    for (i, ranges) in rows.iter().enumerate() {
        let mut last = 0;
        for &(start, end) in ranges {
            let is_sound = last <= start && start <= end && usize::from(end) <= n;
            assert!(
                is_sound,
                "row {i} of {n} reads columns {start} to {end}: they must be in order and below {n}"
            );
            last = end;
        }
    }
}

/// The rows of R from the first row of tile `t`, in groups of up to eight that need nearly the same columns.
fn below(t: usize, end: usize, reads_of: impl Fn(usize) -> Vec<u16>) -> Vec<Group> {
    let (mut groups, mut reads, mut least): (Vec<Group>, _, _) = (Vec::new(), Vec::new(), 0);
    for i in 8 * t..end {
        if i < 8 * t + 8 {
            reads = union(&reads, &reads_of(i));
        }
        match groups.last_mut() {
            Some(group) if group.rows.len() < 8 && reads.len() <= least + SPARE => {
                group.rows.end = i + 1;
                group.reads.clone_from(&reads);
            }
            _ => {
                least = reads.len();
                groups.push(Group {
                    rows: i..i + 1,
                    reads: reads.clone(),
                });
            }
        }
    }
    groups
}

fn union(a: &[u16], b: &[u16]) -> Vec<u16> {
    ascending(a.iter().chain(b).copied())
}

/// The columns in ascending order, each once.
pub(crate) fn ascending(columns: impl Iterator<Item = u16> + Clone) -> Vec<u16> {
    let end = columns.clone().max().map_or(0, |last| usize::from(last) + 1);
    let mut is_there = vec![false; end];
    columns.for_each(|column| is_there[usize::from(column)] = true);
    (0..end as u16).filter(|column| is_there[usize::from(*column)]).collect()
}

/// Working memory of a product, allocated once.
#[derive(Clone, Debug)]
pub struct Product {
    /// A with n rows, and R with as many as Φ changes, with the row length of P.
    a: Lines,
    r: Lines,
    /// The diagonal of Φ if it is scaled, otherwise 1.
    diagonal: Lines,
}

impl Product {
    /// For `n` rows. The first product by a plan takes more memory, unless one by a plan as large has done so.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let ld = n.next_multiple_of(8);
        Self {
            a: Lines::zeros(n * ld),
            r: Lines::default(),
            diagonal: Lines::zeros(ld),
        }
    }

    /// Room for a product by this plan.
    #[inline]
    fn reserve(&mut self, plan: &Plan) {
        let wanted = plan.end * plan.ld();
        if self.r.len() < wanted {
            self.r = Lines::zeros(wanted);
        }
    }

    /// Memory for n rows of P, which a product overwrites. A product has to be used up before.
    pub fn lend(&mut self) -> &mut [f64] {
        &mut self.a
    }

    /// (ΦPΦᵀ)_ii.
    #[must_use]
    #[inline]
    pub fn variance(&self, plan: &Plan, p: &[f64], i: usize) -> f64 {
        if i < plan.end {
            self.r[i * plan.ld() + i]
        } else if plan.is_scaled {
            p[i * plan.ld() + i] * (self.diagonal[i] * self.diagonal[i])
        } else {
            p[i * plan.ld() + i]
        }
    }
}

impl Product {
    /// Returns true if all variances are below `largest` and none is negative. It has no branches, because they nearly
    /// always are. Rows that Φ does not change count as sound.
    #[must_use]
    pub fn is_sound(&self, plan: &Plan, p: &[f64], largest: f64) -> bool {
        let next = plan.ld() + 1;
        let mut is_sound = true;
        for v in self.r.iter().step_by(next).take(plan.end) {
            is_sound &= (*v >= 0.0) & (*v < largest);
        }
        if plan.is_scaled {
            let behind = p[plan.end * next..].iter().step_by(next);
            for (v, d) in behind.zip(&self.diagonal[plan.end..plan.n]) {
                let v = v * (d * d);
                is_sound &= (v >= 0.0) & (v < largest);
            }
        }
        is_sound
    }
}

/// A and R of ΦPΦᵀ.
#[inline(always)]
pub(crate) fn product<L: Lanes>(plan: &Plan, phi: &[f64], p: &[f64], w: &mut Product) {
    let (n, ld) = (plan.n, plan.ld());
    w.reserve(plan);
    let is_large = p.len() >= n * ld && phi.len() >= n * ld;
    let has_room = w.a.len() >= n * ld && w.r.len() >= plan.end * ld && w.diagonal.len() >= ld;
    assert!(is_large && has_room, "matrices of {n} rows");
    if plan.is_scaled {
        for i in plan.end..n {
            w.diagonal[i] = phi[i * ld + i];
        }
    }
    let (p8, a8) = (p.as_chunks::<8>().0, w.a.as_chunks_mut::<8>().0);
    for group in &plan.groups {
        match group.rows.len() {
            1 => left::<L, 1>(plan, group, phi, p8, a8),
            2 => left::<L, 2>(plan, group, phi, p8, a8),
            _ => left::<L, 3>(plan, group, phi, p8, a8),
        }
    }
    let (phi, r8) = (phi.as_chunks::<8>().0, w.r.as_chunks_mut::<8>().0);
    for (t, groups) in plan.below.iter().enumerate() {
        for Group { rows, reads } in groups {
            let mut i = rows.start;
            while i < rows.end {
                i += match rows.end - i {
                    1 => right::<L, 1>(reads, phi, i, &w.a, plan.tiles, t, r8),
                    2 => right::<L, 2>(reads, phi, i, &w.a, plan.tiles, t, r8),
                    3 => right::<L, 3>(reads, phi, i, &w.a, plan.tiles, t, r8),
                    8.. if L::ROWS == 8 => right::<L, 8>(reads, phi, i, &w.a, plan.tiles, t, r8),
                    _ => right::<L, 4>(reads, phi, i, &w.a, plan.tiles, t, r8),
                };
            }
        }
    }
}

/// A = ΦP for the G rows of a group.
#[inline(always)]
fn left<L: Lanes, const G: usize>(plan: &Plan, group: &Group, phi: &[f64], p: &[[f64; 8]], a: &mut [[f64; 8]]) {
    let mut t = 0;
    while t < plan.tiles {
        let wide = L::TILES.min(plan.tiles - t);
        match wide {
            1 => left_tiles::<L, G, 1>(plan, group, phi, p, t, a),
            2 => left_tiles::<L, G, 2>(plan, group, phi, p, t, a),
            _ => left_tiles::<L, G, 3>(plan, group, phi, p, t, a),
        }
        t += wide;
    }
}

/// Tiles `t` to `t + W` of these rows.
#[inline(always)]
fn left_tiles<L: Lanes, const G: usize, const W: usize>(
    plan: &Plan,
    group: &Group,
    phi: &[f64],
    p: &[[f64; 8]],
    t: usize,
    a: &mut [[f64; 8]],
) {
    let (tiles, first) = (plan.tiles, group.rows.start);
    let mut sum = [[L::splat(0.0); W]; G];
    for &k in &group.reads {
        let k = usize::from(k);
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: `check` has k < n, `Plan::new` first + G ≤ n; t + W ≤ tiles; `product` looks at the lengths.
        let (factors, row) = unsafe { (some::<_, G>(phi, 8 * k * tiles + first), some::<_, W>(p, k * tiles + t)) };
        for g in 0..G {
            let factor = L::splat(factors[g]);
            for w in 0..W {
                sum[g][w] = factor.mul_add(L::load(&row[w]), sum[g][w]);
            }
        }
    }
    for g in 0..G {
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: as above.
        let out = unsafe { some_mut::<_, W>(a, (first + g) * tiles + t) };
        for w in 0..W {
            sum[g][w].store(&mut out[w]);
        }
    }
}

/// Tile `t` of R, for G rows from `first`; returns G.
#[inline(always)]
fn right<L: Lanes, const G: usize>(
    columns: &[u16],
    phi: &[[f64; 8]],
    first: usize,
    a: &[f64],
    tiles: usize,
    t: usize,
    r: &mut [[f64; 8]],
) -> usize {
    let mut sum = [L::splat(0.0); G];
    for &k in columns {
        let k = usize::from(k);
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: as in `left_tiles`.
        let [row] = unsafe { some::<_, 1>(phi, k * tiles + t) };
        let row = L::load(row);
        for g in 0..G {
            #[expect(unsafe_code, reason = "see `some`")]
            // SAFETY: as in `left_tiles`; A has as many rows as P, and R has `end`.
            let [factor] = unsafe { some::<_, 1>(a, 8 * (first + g) * tiles + k) };
            sum[g] = L::splat(*factor).mul_add(row, sum[g]);
        }
    }
    for g in 0..G {
        #[expect(unsafe_code, reason = "see `some`")]
        // SAFETY: as above.
        let [out] = unsafe { some_mut::<_, 1>(r, (first + g) * tiles + t) };
        sum[g].store(out);
    }
    G
}

/// Writes the result of [`product`] into P.
#[inline(always)]
pub(crate) fn place<L: Lanes>(plan: &Plan, w: &Product, p: &mut [f64]) {
    let (n, ld) = (plan.n, plan.ld());
    assert!(
        p.len() >= n * ld && w.a.len() >= n * ld && w.r.len() >= plan.end * ld && w.diagonal.len() >= ld,
        "matrices of {n} rows"
    );
    for i in 0..plan.whole {
        for j in i..plan.tiles {
            place_tile::<L>(plan, w, p, i, j);
        }
    }
    place_rest::<L>(plan, w, p);
    place_behind::<L>(plan, w, p);
}

/// Tile (i, j) and its transpose; i is less than `whole`, j is not less than i.
#[inline(always)]
fn place_tile<L: Lanes>(plan: &Plan, w: &Product, p: &mut [f64], i: usize, j: usize) {
    let (tiles, n, whole) = (plan.tiles, plan.n, plan.whole);
    let mut tile = [L::splat(0.0); 8];
    if j < whole {
        for k in 0..8 {
            tile[k] = row(&w.r, tiles, 8 * j + k, i);
        }
        let across = L::transpose(tile);
        for k in 0..8 {
            if i == j {
                put(across[k].after(k, tile[k]), p, tiles, 8 * i + k, i);
            } else {
                put(across[k], p, tiles, 8 * i + k, j);
                put(tile[k], p, tiles, 8 * j + k, i);
            }
        }
        return;
    }
    for k in 0..8 {
        tile[k] = plan.scaled(w, 8 * i + k, j);
    }
    let across = L::transpose(tile);
    let rest = if j == whole { plan.rest } else { 0 };
    for k in 0..8 {
        if k < rest {
            put(row::<L>(&w.r, tiles, 8 * j + k, i), p, tiles, 8 * j + k, i);
        } else if 8 * j + k < n {
            put(across[k], p, tiles, 8 * j + k, i);
        }
    }
    for k in 0..8 {
        let own = plan.mirrored(&w.r, tile[k], rest, 8 * i + k);
        put(own, p, tiles, 8 * i + k, j);
    }
}

/// The rows between the whole tiles and `end`, from their diagonal.
#[inline(always)]
fn place_rest<L: Lanes>(plan: &Plan, w: &Product, p: &mut [f64]) {
    let (tiles, whole) = (plan.tiles, plan.whole);
    for c in 0..plan.rest {
        let i = 8 * whole + c;
        let own = plan.mirrored(&w.r, plan.scaled::<L>(w, i, whole), plan.rest, i);
        put(own.after(c, row(&w.r, tiles, i, whole)), p, tiles, i, whole);
        for t in whole + 1..tiles {
            put(plan.scaled::<L>(w, i, t), p, tiles, i, t);
        }
    }
}

/// The rows from `end`, where Φ is diagonal.
#[inline(always)]
fn place_behind<L: Lanes>(plan: &Plan, w: &Product, p: &mut [f64]) {
    let (tiles, whole) = (plan.tiles, plan.whole);
    if plan.rest == 0 && !plan.is_scaled {
        return;
    }
    let last = if plan.is_scaled { tiles } else { whole + 1 };
    for t in whole..last {
        let scales: L = row(&w.diagonal, tiles, 0, t);
        for i in plan.end..plan.n {
            let mut own = row::<L>(p, tiles, i, t);
            if plan.is_scaled {
                #[expect(unsafe_code, reason = "see `some`")]
                // SAFETY: i is below n; `place` looks at the length.
                let [scale] = unsafe { some::<_, 1>(&w.diagonal, i) };
                // The product of both scales first: it is the same on both sides of the diagonal.
                own = own.mul(scales.mul(L::splat(*scale)));
            }
            if t == whole {
                own = plan.mirrored(p, own, plan.rest, i);
            }
            put(own, p, tiles, i, t);
        }
    }
}

impl Plan {
    /// Tile `t` of row `i` of A, with the scale of the columns from `end`.
    #[inline(always)]
    fn scaled<L: Lanes>(&self, w: &Product, i: usize, t: usize) -> L {
        let own: L = row(&w.a, self.tiles, i, t);
        if self.is_scaled {
            own.mul(row(&w.diagonal, self.tiles, 0, t))
        } else {
            own
        }
    }

    /// `own`, with its first `count` lanes replaced by column `i` of the rows after the last whole tile.
    #[inline(always)]
    fn mirrored<L: Lanes>(&self, m: &[f64], mut own: L, count: usize, i: usize) -> L {
        for c in (0..count).rev() {
            #[expect(unsafe_code, reason = "see `some`")]
            // SAFETY: `count` rows from there on are below `end`, i < ld; `place` looks at the lengths.
            let [value] = unsafe { some::<_, 1>(m, (8 * self.whole + c) * self.ld() + i) };
            own = own.after(c + 1, L::splat(*value));
        }
        own
    }
}

/// Tile `t` of row `i` of `m`.
#[inline(always)]
fn row<L: Lanes>(m: &[f64], tiles: usize, i: usize, t: usize) -> L {
    #[expect(unsafe_code, reason = "see `some`")]
    // SAFETY: only for i < n, i < `end` in R, or i = 0 of the diagonal, and t < tiles; `place` looks at the lengths.
    L::load(unsafe { some::<_, 8>(m, 8 * (i * tiles + t)) })
}

/// Writes this tile.
#[inline(always)]
fn put<L: Lanes>(own: L, m: &mut [f64], tiles: usize, i: usize, t: usize) {
    #[expect(unsafe_code, reason = "see `some`")]
    // SAFETY: as in `row`.
    own.store(unsafe { some_mut::<_, 8>(m, 8 * (i * tiles + t)) });
}
