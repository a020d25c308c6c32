//! Many complete runs of one design: simulating sensors, filtering, scoring.
//!
//! The design is `configs/ins-gps.toml`: 15 states, an inertial unit at 100 Hz, GNSS at 1 Hz, a reference at 10 Hz.
//! The benchmark times one campaign on one thread, one on two threads, and two independent campaigns at once. The
//! last shows what the machine allows. The three take turns, and the best time of each counts.

#![expect(clippy::expect_used, clippy::print_stdout, reason = "a benchmark")]

#[path = "measure/once.rs"]
mod once;

use fusion::config::Document;
use fusion::design::Design;
use fusion::run::Options;
use fusion_judge::campaign::monte_carlo;
use std::path::Path;
use std::time::Instant;

const DESIGN: &str = "configs/ins-gps.toml";
/// Runs per campaign, and how often each campaign is timed.
const RUNS: u64 = 40;
const ROUNDS: usize = 12;

/// Epochs per second of a campaign.
fn campaign(design: &Design, runs: u64, threads: usize) -> f64 {
    let campaign = monte_carlo(design, &Options::default(), 0..runs, 1, threads, &|_| {}).expect("the design is sound");
    campaign.campaign.pace.per_second()
}

/// Epochs per second of two campaigns at once.
fn side_by_side(design: &Design, runs: u64) -> f64 {
    let begun = Instant::now();
    let epochs: u64 = std::thread::scope(|scope| {
        let one = || monte_carlo(design, &Options::default(), 0..runs / 2, 1, 1, &|_| {}).expect("the design is sound");
        let both = [scope.spawn(one), scope.spawn(one)];
        both.map(|thread| thread.join().expect("it does not panic").campaign.pace.epochs)
            .iter()
            .sum()
    });
    epochs as f64 / begun.elapsed().as_secs_f64()
}

fn main() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(DESIGN);
    let document = Document::load(&file).expect("the design is in the repository");
    let design = Design::read(document).expect("the design is sound");
    let (mut one, mut two, mut apart) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (rounds, runs) = if once::is_test() { (1, 2) } else { (ROUNDS, RUNS) };
    for _ in 0..rounds {
        one = one.max(campaign(&design, runs, 1));
        two = two.max(campaign(&design, runs, 2));
        apart = apart.max(side_by_side(&design, runs));
    }
    println!(
        "montecarlo/n=15: {:.2} M filter-epochs/s/core, {:.2} x on two threads ({:.2} x by two campaigns apart)",
        one * 1e-6,
        two / one,
        apart / one
    );
}
