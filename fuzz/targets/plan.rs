//! Patterns of a transition, and slices of any lengths, given to the products of a covariance.

#![no_main]

use core::panic::AssertUnwindSafe;
use fusion_kernels::{Kernel, Lines, Plan, Product, Reach};
use libfuzzer_sys::fuzz_target;
use std::panic::{catch_unwind, set_hook, take_hook};

/// Bytes as numbers: zero behind the last.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn next(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        *first
    }

    /// Of each ten columns one may be far behind the last.
    fn column(&mut self) -> u16 {
        let byte = self.next();
        if byte >= 230 {
            u16::from(byte) << 8 | u16::from(self.next())
        } else {
            u16::from(byte % 40)
        }
    }

    /// Zeros: `len` of them, or a few less.
    fn slice(&mut self, len: usize) -> Lines {
        let byte = self.next();
        Lines::zeros(len.saturating_sub(if byte > 200 { usize::from(byte - 200) } else { 0 }))
    }
}

/// Whether the work was done; otherwise a panic has refused it.
fn is_done(work: impl FnOnce()) -> bool {
    let hook = take_hook();
    set_hook(Box::new(|_| {}));
    let done = catch_unwind(AssertUnwindSafe(work));
    set_hook(hook);
    if let Err(panic) = &done {
        let text = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or(panic.downcast_ref::<&str>().copied());
        assert!(
            !text.is_some_and(|text| text.contains("at + N")),
            "a loop looked at what its door has to look at"
        );
    }
    done.is_ok()
}

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let n = usize::from(bytes.next() % 40);
    let mut row = |_| (0..bytes.next() % 3).map(|_| (bytes.column(), bytes.column())).collect::<Vec<_>>();
    let rows: Vec<Vec<(u16, u16)>> = (0..n).map(&mut row).collect();
    let is_sound = rows.iter().all(|ranges| {
        let ends: Vec<u16> = ranges.iter().flat_map(|(start, end)| [*start, *end]).collect();
        ends.is_sorted() && ends.last().is_none_or(|end| usize::from(*end) <= n)
    });
    assert_eq!(is_done(|| drop(Plan::new(&rows))), is_sound, "{rows:?}");
    assert_eq!(is_done(|| drop(Reach::new(&rows))), is_sound, "{rows:?}");
    if !is_sound {
        return;
    }
    let square = n * n.next_multiple_of(8);
    let (plan, reach, other) = (Plan::new(&rows), Reach::new(&rows), usize::from(bytes.next() % 8 == 1));
    for kernel in Kernel::here() {
        let (phi, mut p, mut out) = (bytes.slice(square), bytes.slice(square), bytes.slice(square));
        let mut w = Product::new(n.saturating_sub(other));
        let is_whole = [&phi, &p].iter().all(|m| m.len() == square) && (other == 0 || n == 0);
        assert!(is_done(|| kernel.product(&plan, &phi, &p, &mut w)) || !is_whole, "{rows:?}");
        assert!(is_done(|| kernel.place(&plan, &w, &mut p)) || !is_whole, "{rows:?}");
        let is_whole = [&phi, &p, &out].iter().all(|m| m.len() == square);
        assert!(is_done(|| kernel.through(&reach, &phi, &p, &mut out)) || !is_whole, "{rows:?}");
    }
});
