//! No call from safe code reaches behind a slice: patterns and sizes that do not fit are refused.

use core::panic::AssertUnwindSafe;
use fusion_kernels::{Kernel, Lines, Plan, Product, Reach, Shape};
use std::panic::catch_unwind;

/// Whole numbers below a bound, the same on every machine.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % bound
    }
}

/// The message of a panic; none where the work was done.
fn refusal(work: impl FnOnce()) -> Option<String> {
    let panic = catch_unwind(AssertUnwindSafe(work)).err()?;
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()))
}

type Rows = Vec<Vec<(u16, u16)>>;

/// Whether columns exist and are in order, by a list of them all.
fn is_sound(rows: &Rows) -> bool {
    rows.iter().all(|ranges| {
        let ends: Vec<u16> = ranges.iter().flat_map(|&(start, end)| [start, end]).collect();
        ends.is_sorted() && ends.iter().all(|end| usize::from(*end) <= rows.len())
    })
}

#[test]
fn a_pattern_with_columns_that_do_not_exist_is_refused() {
    let rows: [Rows; 5] = [
        vec![vec![(0, 1), (40000, 40008)]],
        vec![vec![(0, 2)]],
        vec![vec![(1, 2), (0, 1)], vec![]],
        vec![vec![(0, 2), (1, 2)], vec![]],
        vec![vec![(2, 1)], vec![]],
    ];
    for rows in rows {
        for refused in [refusal(|| drop(Plan::new(&rows))), refusal(|| drop(Reach::new(&rows)))] {
            assert!(refused.is_some_and(|why| why.contains("they must be in order")), "{rows:?}");
        }
    }
    let many = refusal(|| drop(Plan::new(&vec![Vec::new(); 65536])));
    assert!(many.is_some_and(|why| why.contains("65536 rows")));
}

/// Its products would be 0 in the arithmetic of the processor.
const WRAPS: usize = 1 << (usize::BITS / 2);

#[test]
fn a_size_that_wraps_around_is_refused() {
    for kernel in Kernel::here() {
        let downdate = refusal(|| kernel.downdate(WRAPS, &[], 0, &mut []));
        let project = refusal(|| kernel.project(WRAPS, &[], &[(0, WRAPS)], &[], &mut [], WRAPS));
        let inner = refusal(|| kernel.inner(WRAPS, &[], &[], &mut [], WRAPS));
        for refused in [downdate, project, inner] {
            // Builds with checks of overflow would panic in the product itself.
            assert!(refused.is_some_and(|why| !why.contains("overflow")), "{}", kernel.name());
        }
    }
}

fn pattern(n: usize, random: &mut Random) -> Rows {
    let is_wild = random.below(4) == 0;
    let mut row = || {
        let count = 2 * random.below(3);
        let mut ends: Vec<u16> = (0..count).map(|_| random.below(n + 1 + usize::from(is_wild)) as u16).collect();
        if !is_wild {
            ends.sort_unstable();
        }
        ends.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect()
    };
    (0..n).map(|_| row()).collect()
}

/// Slices of drawn lengths: whole, or a few numbers too short.
struct Slices {
    random: Random,
    is_cut: bool,
}

impl Slices {
    fn of<const N: usize>(&mut self, lengths: [usize; N]) -> [Lines; N] {
        lengths.map(|len| {
            let cut = if self.random.below(8) == 0 { self.random.below(20) } else { 0 };
            self.is_cut |= cut > 0 && len > 0;
            Lines::zeros(len.saturating_sub(cut))
        })
    }
}

/// Every operation once on slices as they are drawn: its name, and what refused it.
fn operations(kernel: Kernel, rows: &Rows, slices: &mut Slices) -> Vec<(&'static str, Option<String>)> {
    let (n, m) = (rows.len(), 1 + slices.random.below(7));
    let (ld, len) = (n.next_multiple_of(8), n + m);
    let (square, wide) = (n * ld, m * ld);
    let shape = Shape {
        n,
        len,
        end: slices.random.below(n + 1),
    };
    let (plan, reach, read) = (Plan::new(rows), Reach::new(rows), [(0, n)]);
    let less = usize::from(slices.random.below(8) == 0 && n > 0);
    slices.is_cut |= less > 0;
    let mut w = Product::new(n - less);
    let [phi, mut p, h, x, mut y, mut z] = slices.of([square, square, wide, wide, wide, wide]);
    let [l, mut small, mut out, mut row, mut two] = slices.of([m * m, m * m, square, ld, 2 * ld]);
    let [mut array, weights, mut factor, mut room] = slices.of([len * ld, len, square + ld, ld]);
    vec![
        ("product", refusal(|| kernel.product(&plan, &phi, &p, &mut w))),
        ("place", refusal(|| kernel.place(&plan, &w, &mut p))),
        ("project", refusal(|| kernel.project(m, &h, &read, &p, &mut y, ld))),
        ("inner", refusal(|| kernel.inner(m, &h, &x, &mut small, ld))),
        ("gain", refusal(|| kernel.gain(&l, m, &x, &mut y, &mut z, ld))),
        ("downdate", refusal(|| kernel.downdate(n, &x, m, &mut p))),
        ("refine", refusal(|| kernel.refine(n, &x, &h, m, &mut p))),
        ("subtract", refusal(|| kernel.subtract(&l, m, &x, &mut y, ld))),
        ("through", refusal(|| kernel.through(&reach, &phi, &p, &mut out))),
        ("squares", refusal(|| kernel.squares(len, &array, &weights, &mut row))),
        ("along", refusal(|| kernel.along(n, m, &h, &read, &p, &mut y))),
        (
            "orthogonalise",
            refusal(|| kernel.orthogonalise(shape, &mut array, &weights, &mut factor, &mut room)),
        ),
        ("reflect", refusal(|| kernel.reflect(shape, &mut array, &mut out, &mut room))),
        ("weigh", refusal(|| kernel.weigh(n, 1.0, &mut row, &mut factor, &mut room))),
        ("rotate", refusal(|| kernel.rotate(n, 1.0, &room, &mut out, &mut two))),
        ("root", refusal(|| kernel.root(n, &p, &mut out))),
        ("outer", refusal(|| kernel.outer(n, m, &x, 1.0, &mut p))),
    ]
}

#[test]
fn whatever_the_slices_an_operation_is_done_or_refused_at_its_door() {
    // Miri sees every access, and takes thousands of times as long.
    let draws = if cfg!(miri) { 40 } else { 2000 };
    let (mut patterns, mut whole, mut refused) = (0, 0, 0);
    for draw in 0..draws {
        let mut random = Random(draw);
        let rows = pattern(random.below(20), &mut random);
        let plan = refusal(|| drop(Plan::new(&rows)));
        assert_eq!(plan.is_none(), is_sound(&rows), "{rows:?}: {plan:?}");
        if plan.is_some() {
            patterns += 1;
            continue;
        }
        for kernel in Kernel::here() {
            let mut slices = Slices {
                random: Random(draw),
                is_cut: false,
            };
            let done = operations(kernel, &rows, &mut slices);
            for (operation, why) in &done {
                let what = || format!("{operation} by {} of {rows:?}, draw {draw}: {why:?}", kernel.name());
                // In the kernels' own loops builds with debug assertions look at what others trust.
                assert!(why.as_ref().is_none_or(|why| !why.contains("at + N")), "{}", what());
                assert!(slices.is_cut || why.is_none(), "{}", what());
                refused += usize::from(why.is_some());
            }
            whole += usize::from(!slices.is_cut);
        }
    }
    assert!(patterns > 0 && whole > 0 && refused > 0, "{patterns} {whole} {refused}");
}
