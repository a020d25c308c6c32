//! Compares the operations on factors with plain loops, and the kernels with each other to the bit.

use fusion_kernels::{Kernel, Lines, Reach, Shape};

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

const SIZES: [usize; 9] = [1, 3, 7, 8, 9, 15, 16, 21, 40];

/// Columns with random elements where `is_there` is true, and zeros elsewhere.
fn columns(n: usize, count: usize, random: &mut Random, is_there: impl Fn(usize, usize) -> bool) -> Lines {
    let (ld, mut all) = (padded(n), Lines::zeros(count * padded(n)));
    for (k, i) in (0..count)
        .flat_map(|k| (0..n).map(move |i| (k, i)))
        .filter(|&(k, i)| is_there(k, i))
    {
        all[k * ld + i] = random.next();
    }
    all
}

/// U with a unit diagonal, followed by D.
fn factor(n: usize, random: &mut Random) -> Lines {
    let (ld, mut all) = (padded(n), columns(n, n + 1, random, |k, i| i < k));
    for k in 0..n {
        all[k * ld + k] = 1.0;
        all[n * ld + k] = 0.5 + random.next().abs();
    }
    all
}

/// Σ_k w_k c_k c_kᵀ.
fn sum(n: usize, columns: &[f64], weights: &[f64]) -> Vec<f64> {
    let ld = padded(n);
    let term = |i: usize, j: usize| (0..columns.len() / ld).map(move |k| weights[k] * columns[k * ld + i] * columns[k * ld + j]);
    (0..n * n).map(|at| term(at / n, at % n).sum()).collect()
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The result of `work` with each kernel; kernels with fused products agree to the bit.
fn each(what: &str, work: impl Fn(Kernel) -> Vec<f64>) -> Vec<f64> {
    let bits = |found: &[f64]| found.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let portable = work(Kernel::PORTABLE);
    let fused: Vec<_> = Kernel::here().filter(|k| *k != Kernel::PORTABLE).map(&work).collect();
    assert!(fused.windows(2).all(|pair| bits(&pair[0]) == bits(&pair[1])), "{what}");
    for found in &fused {
        // 1e-13: rounding of sums of up to a hundred products of numbers around one, through n steps.
        assert!(apart(found, &portable) < 1e-13, "{what}: {:e}", apart(found, &portable));
    }
    portable
}

/// Returns true if it is upper triangular with a non-negative diagonal and zero padding.
fn is_triangle(n: usize, f: &[f64]) -> bool {
    f.chunks_exact(padded(n))
        .enumerate()
        .all(|(k, column)| column[k + 1..].iter().all(|v| *v == 0.0) && column[k] >= 0.0)
}

/// An array of n states: a factor multiplied by a Φ whose rows from `end` are diagonal, followed by noise columns that
/// are zero in these rows.
fn array(shape: Shape, random: &mut Random) -> Lines {
    let Shape { n, len, end } = shape;
    columns(n, len, random, |k, i| {
        if k < n {
            i <= k || (i < end && k < end)
        } else {
            i < end && (i + k) % 3 > 0
        }
    })
}

fn shapes() -> impl Iterator<Item = Shape> {
    SIZES.into_iter().flat_map(|n| {
        [(0, 0), (n / 2, 1), (n, n), (n * 2 / 3, 2 * n)].map(|(end, more)| Shape {
            n,
            len: n + if end == 0 { 0 } else { more },
            end,
        })
    })
}

#[test]
fn a_factor_goes_through_a_transition_of_any_pattern_as_by_plain_loops() {
    let mut random = Random(1);
    for n in SIZES {
        let (ld, f) = (padded(n), factor(n, &mut random));
        let scattered = |i: usize| ((i * 5 + 1) % n) as u16;
        let (last, own) = (n as u16, |i: usize| (i as u16, i as u16 + 1));
        for rows in [
            vec![vec![]; n],
            vec![vec![(0, last)]; n],
            (0..n).map(|i| vec![own(i)]).collect(),
            (0..n).map(|i| vec![(scattered(i), scattered(i) + 1)]).collect(),
            (0..n).map(|i| if i < 3 { vec![(0, last.min(4))] } else { vec![] }).collect(),
        ] {
            let mut phi = Lines::zeros(n * ld);
            for (i, row) in rows.iter().enumerate() {
                phi[i * ld + i] = 1.0;
                row.iter()
                    .flat_map(|&(a, b)| a..b)
                    .for_each(|m| phi[usize::from(m) * ld + i] = random.next());
            }
            let reach = Reach::new(&rows);
            let end = (0..n)
                .rfind(|&i| (0..n).any(|m| m != i && phi[m * ld + i] != 0.0))
                .map_or(0, |i| i + 1);
            assert_eq!(reach.end(), end, "{rows:?}");
            let found = each("ΦF", |kernel| {
                let mut out = Lines::zeros(n * ld);
                kernel.through(&reach, &phi, &f[..n * ld], &mut out);
                out.to_vec()
            });
            let wanted = |at: usize| (0..n).map(|m| phi[m * ld + at % ld] * f[at / ld * ld + m]).sum();
            let wanted: Vec<f64> = (0..n * ld).map(wanted).collect();
            // 1e-14: sums of up to forty products of numbers below 1.
            assert!(apart(&found, &wanted) < 1e-14, "n = {n}, {rows:?}");
        }
    }
}

#[test]
fn an_array_is_made_a_factor_of_the_same_covariance() {
    let mut random = Random(2);
    for shape in shapes() {
        let Shape { n, len, .. } = shape;
        let (ld, a, what) = (padded(n), array(shape, &mut random), format!("{shape:?}"));
        let weights: Vec<f64> = (0..padded(len)).map(|_| 0.5 + random.next().abs()).collect();
        // 1e-13: sums of up to 120 products of numbers below 1, n times.
        let is_near = |found: &[f64], wanted: &[f64]| apart(found, wanted) < 1e-13;

        let (ones, mut variances) = (vec![1.0; len], vec![0.0; ld]);
        let found = each(&what, |kernel| {
            let mut factor = Lines::zeros((n + 1) * ld);
            kernel.orthogonalise(shape, &mut a.clone(), &weights, &mut factor, &mut vec![0.0; ld]);
            factor.to_vec()
        });
        let (u, d) = found.split_at(n * ld);
        let wanted = sum(n, &a, &weights);
        assert!(
            is_triangle(n, u) && d[..n].iter().all(|d| *d > 0.0) && d[n..].iter().all(|d| *d == 0.0),
            "{what}"
        );
        assert!((0..n).all(|k| u[k * ld + k] == 1.0), "{what}");
        assert!(is_near(&sum(n, u, d), &wanted), "{what}");

        each(&what, |kernel| {
            let mut sums = Lines::zeros(ld);
            kernel.squares(len, &a, &weights, &mut sums);
            sums.to_vec()
        })
        .iter()
        .zip(&mut variances)
        .for_each(|(found, v)| *v = *found);
        assert!((0..n).all(|i| (variances[i] - wanted[i * n + i]).abs() < 1e-13), "{what}");

        let root = each(&what, |kernel| {
            let mut root = Lines::zeros(n * ld);
            kernel.reflect(shape, &mut a.clone(), &mut root, &mut vec![0.0; ld]);
            root.to_vec()
        });
        assert!(
            is_triangle(n, &root) && is_near(&sum(n, &root, &ones), &sum(n, &a, &ones)),
            "{what}"
        );
    }
}

#[test]
fn an_array_without_anything_is_a_factor_of_nothing() {
    for n in SIZES {
        let (ld, shape) = (padded(n), Shape { n, len: n, end: n });
        for kernel in Kernel::here() {
            // The square of 1e-158 underflows, and 1 divided by it is not finite: it counts as zero.
            for value in [0.0, 1e-158] {
                let mut a = columns(n, n, &mut Random(3), |_, _| true);
                a.iter_mut().for_each(|v| *v *= value);
                let (mut factor, mut root) = (Lines::zeros((n + 1) * ld), Lines::zeros(n * ld));
                kernel.orthogonalise(shape, &mut a.clone(), &vec![1.0; ld], &mut factor, &mut vec![0.0; ld]);
                kernel.reflect(shape, &mut a, &mut root, &mut vec![0.0; ld]);
                assert!(factor.iter().chain(root.iter()).all(|v| v.is_finite()), "n = {n}");
                assert!(factor[n * ld..].iter().all(|d| *d < f64::MIN_POSITIVE), "n = {n}");
            }
        }
    }
}

#[test]
fn a_factor_given_a_row_is_that_of_the_textbook() {
    let mut random = Random(4);
    for n in SIZES {
        let (ld, udu) = (padded(n), factor(n, &mut random));
        let mut root = udu[..n * ld].to_vec();
        for k in 0..n {
            root[k * ld..(k + 1) * ld].iter_mut().for_each(|v| *v *= udu[n * ld + k].sqrt());
        }
        let p = sum(n, &root, &vec![1.0; n]);
        for (r, first) in [(0.0, 0), (1e-8, n / 2), (1.0, 0)] {
            let h = columns(n, 2, &mut random, |_, i| i >= first);
            let hp: Vec<f64> = (0..n).map(|j| (0..n).map(|i| h[i] * p[i * n + j]).sum()).collect();
            let s = r + (0..n).map(|j| h[j] * hp[j]).sum::<f64>();
            let wanted: Vec<f64> = (0..n * n).map(|at| p[at] - hp[at / n] * hp[at % n] / s).collect();
            let along = |kernel: Kernel, f: &[f64]| {
                let mut out = Lines::zeros(2 * ld);
                kernel.along(n, 2, &h, &[(first, n)], f, &mut out);
                out
            };
            let weighed = each("U, D", |kernel| {
                let (mut f, mut factor) = (along(kernel, &udu), udu.clone());
                kernel.weigh(n, r, &mut f[..ld], &mut factor, &mut vec![0.0; ld]);
                factor.to_vec()
            });
            let rotated = each("S", |kernel| {
                let (f, mut root) = (along(kernel, &root), root.clone());
                kernel.rotate(n, r, &f[..ld], &mut root, &mut vec![0.0; 2 * ld]);
                root
            });
            let (u, d) = weighed.split_at(n * ld);
            assert!(
                is_triangle(n, u) && is_triangle(n, &rotated) && d.iter().all(|d| *d >= 0.0),
                "n = {n}"
            );
            // 1e-12: the result is a difference of numbers up to twenty.
            assert!(apart(&sum(n, u, d), &wanted) < 1e-12, "n = {n}, r = {r}");
            assert!(apart(&sum(n, &rotated, &vec![1.0; n]), &wanted) < 1e-12, "n = {n}, r = {r}");
        }
    }
}

#[test]
fn sums_over_points_and_the_root_of_a_covariance_are_those_of_plain_loops() {
    let mut random = Random(5);
    for n in SIZES {
        let (ld, count) = (padded(n), n + 2);
        let x = columns(n, count, &mut random, |_, _| true);
        let start = sum(n, &columns(n, n, &mut random, |_, _| true), &vec![1.0; n]);
        let p = each("P", |kernel| {
            let mut p = Lines::zeros(n * ld);
            (0..n * n).for_each(|at| p[at / n * ld + at % n] = start[at]);
            kernel.outer(n, count, &x, 0.5, &mut p);
            p.to_vec()
        });
        let added = sum(n, &x, &vec![0.5; count]);
        for (i, j) in (0..n * n).map(|at| (at / n, at % n)) {
            // 1e-13: sums of up to eighty products of numbers below 1.
            assert!((p[i * ld + j] - start[i * n + j] - added[i * n + j]).abs() < 1e-13, "n = {n}");
            assert_eq!(p[i * ld + j].to_bits(), p[j * ld + i].to_bits(), "n = {n}");
        }

        // The last axis repeats the first: its remaining variance is zero.
        let mut twin = p.clone();
        for i in 0..n {
            twin[i * ld + n - 1] = p[i * ld];
            twin[(n - 1) * ld + i] = p[i];
        }
        twin[(n - 1) * (ld + 1)] = p[0];
        for (p, is_less) in [(&p, false), (&twin, n > 1)] {
            let l = each("L", |kernel| {
                let mut l = Lines::zeros(n * ld);
                kernel.root(n, p, &mut l);
                l.to_vec()
            });
            assert!((0..n).all(|j| l[j * ld..j * ld + j].iter().all(|v| *v == 0.0)), "n = {n}");
            assert_eq!(l[(n - 1) * ld..].iter().all(|v| *v == 0.0), is_less, "n = {n}");
            let product = sum(n, &l, &vec![1.0; n]);
            // 1e-12: sums of up to forty products of numbers up to ten.
            assert!(
                (0..n * n).all(|at| (product[at] - p[at / n * ld + at % n]).abs() < 1e-12),
                "n = {n}"
            );
        }
    }
}
