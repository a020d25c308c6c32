//! Compares works with each other: every figure of a benchmark is a line from which README's table is made.

mod once;

use once::is_test;
use std::time::{Duration, Instant};

/// The number of turns of the works; one in a test.
const TURNS: usize = 500;
/// A long work gets fewer, though never less than eight.
const BUDGET: Duration = Duration::from_secs(2);

/// A work to time: its name, and one run of it.
pub type Work<'a> = (&'a str, &'a mut dyn FnMut());

/// The least time of each work in ns. The works run in turns; each turn does the work `per_run` times.
pub fn least<const N: usize>(per_run: usize, works: &mut [Work<'_>; N]) -> [f64; N] {
    let mut least = [Duration::MAX; N];
    let begun = Instant::now();
    let turns = if is_test() { 1 } else { TURNS };
    for turn in 0..turns {
        if turn >= 8 && begun.elapsed() > BUDGET {
            break;
        }
        for (least, (_, work)) in least.iter_mut().zip(works.iter_mut()) {
            let clock = Instant::now();
            work();
            *least = (*least).min(clock.elapsed());
        }
    }
    least.map(|d| d.as_nanos() as f64 / per_run as f64)
}

/// Prints a line for each work after the first: both times and their ratio.
pub fn compare<const N: usize>(what: &str, per_run: usize, mut works: [Work<'_>; N]) {
    let times = least(per_run, &mut works);
    for ((rival, _), time) in works.iter().zip(times).skip(1) {
        let ratio = times[0] / time;
        println!("{what}: {} {:.0} ns, {rival} {time:.0} ns, ratio {ratio:.2}", works[0].0, times[0]);
    }
}
