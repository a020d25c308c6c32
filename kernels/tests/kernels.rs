//! Compares the kernels with plain loops, and with each other to the bit.

use fusion_kernels::{Kernel, Lines, Plan, Product};

/// Numbers in (−1, 1), the same on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64) / ((1_u64 << 52) as f64) - 1.0
    }
}

const fn padded(n: usize) -> usize {
    n.next_multiple_of(8)
}

/// Rows of `columns` random numbers, padded with zeros.
fn matrix(rows: usize, columns: usize, random: &mut Random) -> Lines {
    let mut m = Lines::zeros(rows * padded(columns));
    for row in m.chunks_exact_mut(padded(columns)) {
        row[..columns].iter_mut().for_each(|v| *v = random.next());
    }
    m
}

fn symmetric(n: usize, random: &mut Random) -> Lines {
    let mut p = matrix(n, n, random);
    for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
        p[i * padded(n) + j] = p[j * padded(n) + i];
    }
    p
}

/// A pattern of Φ: ranges of columns for each row.
type Rows = Vec<Vec<(u16, u16)>>;

/// Patterns of filters, and others: coupled blocks of three, with decays after, between and before them, scalar blocks,
/// full rows at the end, and an empty pattern.
fn patterns() -> Vec<Rows> {
    let mut all = Vec::new();
    let inertial = |n: usize, first: usize| {
        let mut rows: Rows = vec![Vec::new(); n];
        let f = first as u16;
        for i in 0..3 {
            rows[first + i] = vec![(f, f + 6)];
            rows[first + 3 + i] = vec![(f, f + 9), (f + 12, f + 15)];
            rows[first + 6 + i] = vec![(f, f + 12)];
        }
        rows
    };
    for (n, first) in [(15, 0), (16, 0), (21, 0), (21, 6), (30, 0), (33, 10), (60, 20)] {
        let plain = inertial(n, first);
        let mut decaying = plain.clone();
        for i in (0..n).filter(|i| plain[*i].is_empty()) {
            decaying[i] = vec![(i as u16, i as u16 + 1)];
        }
        all.extend([plain, decaying]);
    }
    for n in [1, 2, 7, 8, 9, 17, 24, 25] {
        all.push(vec![Vec::new(); n]);
        all.push((0..n).map(|i| vec![(i as u16, i as u16 + 1)]).collect());
        all.push(vec![vec![(0, n as u16)]; n]);
        let mut last = vec![Vec::new(); n];
        last[n - 1] = vec![(0, 1), (n as u16 - 1, n as u16)];
        if n > 1 {
            all.push(last);
        }
        let scattered = |i: usize| ((i * 5 + 1) % n) as u16;
        all.push((0..n).map(|i| vec![(scattered(i), scattered(i) + 1)]).collect());
    }
    all
}

/// Φ of a pattern, transposed and padded.
fn phi(rows: &Rows, random: &mut Random) -> Lines {
    let (n, ld) = (rows.len(), padded(rows.len()));
    let mut phi = Lines::zeros(n * ld);
    for (i, ranges) in rows.iter().enumerate() {
        phi[i * ld + i] = 1.0;
        for k in ranges.iter().flat_map(|&(start, end)| start..end) {
            phi[usize::from(k) * ld + i] = random.next();
        }
    }
    phi
}

fn congruence(kernel: Kernel, rows: &Rows, phi: &[f64], p: &Lines) -> Lines {
    let (plan, mut w, mut p) = (Plan::new(rows), Product::new(rows.len()), p.clone());
    kernel.product(&plan, phi, &p, &mut w);
    let variances: Vec<f64> = (0..rows.len()).map(|i| w.variance(&plan, &p, i)).collect();
    kernel.place(&plan, &w, &mut p);
    let diagonal = variances.iter().enumerate().map(|(i, v)| (v, p[i * (padded(rows.len()) + 1)]));
    assert!(diagonal.clone().all(|(v, p)| *v == p), "{diagonal:?}");
    p
}

/// Returns true if it is symmetric to the bit, with zero padding.
fn is_whole(n: usize, p: &[f64]) -> bool {
    let ld = padded(n);
    let mut pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    pairs.all(|(i, j)| p[i * ld + j].to_bits() == p[j * ld + i].to_bits())
        && (0..n).all(|i| p[i * ld + n..(i + 1) * ld].iter().all(|v| *v == 0.0))
}

fn bits(p: &[f64]) -> Vec<u64> {
    p.iter().map(|v| v.to_bits()).collect()
}

/// The portable kernel, and the kernels with fused products.
fn kernels() -> (Kernel, Vec<Kernel>) {
    (Kernel::PORTABLE, Kernel::here().filter(|k| *k != Kernel::PORTABLE).collect())
}

/// The largest difference.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_kernel_is_found_by_its_name_where_the_processor_has_it() {
    assert!(Kernel::here().all(|k| Kernel::named(k.name()) == Some(k)));
    assert_eq!(Kernel::named("portable"), Some(Kernel::PORTABLE));
    assert_eq!(Kernel::here().last(), Some(Kernel::default()));
    assert_eq!(Kernel::named("abacus"), None);
}

#[test]
fn the_congruence_of_every_pattern_is_that_of_plain_loops() {
    let mut random = Random(1);
    for rows in patterns() {
        let (n, ld) = (rows.len(), padded(rows.len()));
        let (phi, p) = (phi(&rows, &mut random), symmetric(n, &mut random));
        let mut wanted = Lines::zeros(n * ld);
        for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
            let terms = (0..n * n).map(|k| (k / n, k % n));
            wanted[i * ld + j] = terms.map(|(k, l)| phi[k * ld + i] * p[k * ld + l] * phi[l * ld + j]).sum();
        }
        for kernel in Kernel::here() {
            let found = congruence(kernel, &rows, &phi, &p);
            // 1e-16 per term of sums of n² products of numbers below 1.
            let tolerance = 1e-16 * (n * n) as f64;
            assert!(
                apart(&found, &wanted) <= tolerance,
                "{} {rows:?}: {}",
                kernel.name(),
                apart(&found, &wanted)
            );
            assert!(is_whole(n, &found), "{} {rows:?}", kernel.name());
        }
    }
}

#[test]
fn kernels_with_fused_products_agree_on_a_congruence_to_the_bit() {
    let mut random = Random(2);
    for rows in patterns() {
        let (phi, p) = (phi(&rows, &mut random), symmetric(rows.len(), &mut random));
        let (_, fused) = kernels();
        let results: Vec<_> = fused.into_iter().map(|k| bits(&congruence(k, &rows, &phi, &p))).collect();
        assert!(results.windows(2).all(|pair| pair[0] == pair[1]), "{rows:?}");
    }
}

/// All operations of an update, one after the other.
fn update(kernel: Kernel, n: usize, m: usize, seed: u64) -> Vec<Lines> {
    let mut random = Random(seed);
    let (ld, h, mut p) = (padded(n), matrix(m, n, &mut random), symmetric(n, &mut random));
    let mut l = vec![0.0; m * m];
    for (i, j) in (0..m * m).map(|k| (k / m, k % m)).filter(|(i, j)| j <= i) {
        l[i * m + j] = if i == j { 2.0 } else { random.next() };
    }
    // A column that no row reads, and a column that is not requested.
    let columns = if n > 3 { vec![(0, 2), (3, n)] } else { vec![(0, n)] };
    let mut hp = Lines::zeros(m * ld);
    kernel.project(m, &h, &columns, &p, &mut hp, ld);
    let mut hph = Lines::zeros(m * m);
    kernel.inner(m, &h, &hp, &mut hph, ld);
    let (mut u, mut k, mut c) = (hp.clone(), hp.clone(), matrix(m, n, &mut random));
    kernel.gain(&l, m, &hp, &mut u, &mut k, ld);
    kernel.downdate(n, &u, m, &mut p);
    let less = p.clone();
    let r: Vec<f64> = (0..m * m).map(|_| random.next()).collect();
    kernel.subtract(&r, m, &k, &mut c, ld);
    kernel.refine(n, &c, &k, m, &mut p);
    vec![hp, hph, u, k, less, c, p]
}

/// The same with plain loops.
fn plain_update(n: usize, m: usize, seed: u64) -> Vec<Lines> {
    let mut random = Random(seed);
    let (ld, h, mut p) = (padded(n), matrix(m, n, &mut random), symmetric(n, &mut random));
    let mut l = vec![0.0; m * m];
    for (i, j) in (0..m * m).map(|k| (k / m, k % m)).filter(|(i, j)| j <= i) {
        l[i * m + j] = if i == j { 2.0 } else { random.next() };
    }
    let is_asked = |k: usize| n <= 3 || k != 2;
    let mut hp = Lines::zeros(m * ld);
    for (i, j) in (0..m * n).map(|k| (k / n, k % n)) {
        hp[i * ld + j] = (0..n).filter(|k| is_asked(*k)).map(|k| h[i * ld + k] * p[k * ld + j]).sum();
    }
    let mut hph = Lines::zeros(m * m);
    for (i, j) in (0..m * m).map(|k| (k / m, k % m)) {
        // The element up to the diagonal; the other element is a copy of it.
        let (i, j) = (i.max(j), i.min(j));
        hph[i * m + j] = (0..n).map(|k| hp[i * ld + k] * h[j * ld + k]).sum();
        hph[j * m + i] = hph[i * m + j];
    }
    let (mut u, mut c) = (hp.clone(), matrix(m, n, &mut random));
    for (i, j) in (0..m * n).map(|k| (k / n, k % n)) {
        let known: f64 = (0..i).map(|k| l[i * m + k] * u[k * ld + j]).sum();
        u[i * ld + j] = (u[i * ld + j] - known) / l[i * m + i];
    }
    let mut k = u.clone();
    for (i, j) in (0..m).rev().flat_map(|i| (0..n).map(move |j| (i, j))) {
        let known: f64 = (i + 1..m).map(|a| l[a * m + i] * k[a * ld + j]).sum();
        k[i * ld + j] = (k[i * ld + j] - known) / l[i * m + i];
    }
    for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
        p[i * ld + j] -= (0..m).map(|a| u[a * ld + i] * u[a * ld + j]).sum::<f64>();
    }
    let less = p.clone();
    let r: Vec<f64> = (0..m * m).map(|_| random.next()).collect();
    for (i, j) in (0..m * n).map(|k| (k / n, k % n)) {
        c[i * ld + j] -= (0..m).map(|a| r[i * m + a] * k[a * ld + j]).sum::<f64>();
    }
    for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
        let both = |a: usize| c[a * ld + i] * k[a * ld + j] + k[a * ld + i] * c[a * ld + j];
        p[i * ld + j] -= (0..m).map(both).sum::<f64>();
    }
    vec![hp, hph, u, k, less, c, p]
}

#[test]
fn every_operation_of_an_update_is_that_of_plain_loops_and_fused_kernels_agree_to_the_bit() {
    for (n, m) in [1, 3, 8, 9, 15, 21, 26, 40]
        .into_iter()
        .flat_map(|n| [1, 2, 3, 4, 6, 7].map(|m| (n, m)))
    {
        let seed = (n * 10 + m) as u64;
        let wanted = plain_update(n, m, seed);
        let (portable, fused) = kernels();
        let found: Vec<_> = core::iter::once(portable).chain(fused).map(|k| update(k, n, m, seed)).collect();
        for result in &found {
            for (found, wanted) in result.iter().zip(&wanted) {
                let size = wanted.iter().map(|v| v.abs()).fold(1.0, f64::max);
                // 1e-13 of the largest: sums of up to 40 products, through two solutions with L.
                assert!(apart(found, wanted) <= 1e-13 * size, "n = {n}, m = {m}: {}", apart(found, wanted));
            }
            assert!(is_whole(n, &result[4]) && is_whole(n, &result[6]), "n = {n}, m = {m}");
        }
        let fused = found[1..].iter().map(|r| r.iter().map(|x| bits(x)).collect::<Vec<_>>());
        let fused: Vec<_> = fused.collect();
        assert!(fused.windows(2).all(|pair| pair[0] == pair[1]), "n = {n}, m = {m}");
    }
}

/// FNV-1a of the bits.
fn print_of<'a>(results: impl Iterator<Item = &'a Lines>) -> u64 {
    let bytes = results.flat_map(|r| bits(r)).flat_map(u64::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    })
}

/// The inputs come from integers, so they are the same on every machine. NEON must give the same results as AVX2 and
/// AVX-512.
#[test]
fn fused_kernels_of_all_architectures_agree_to_the_bit() {
    for kernel in kernels().1 {
        let mut random = Random(3);
        let products: Vec<Lines> = patterns()
            .iter()
            .map(|rows| {
                let (phi, p) = (phi(rows, &mut random), symmetric(rows.len(), &mut random));
                congruence(kernel, rows, &phi, &p)
            })
            .collect();
        let updates = [(15, 3), (21, 6), (40, 7)].map(|(n, m)| update(kernel, n, m, 5));
        let found = [print_of(products.iter()), print_of(updates.iter().flatten())];
        assert_eq!(found, [0xa85c_a323_010e_20df, 0xb373_0b6b_23f8_2c7b], "{}", kernel.name());
    }
}
