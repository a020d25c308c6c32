//! Counts the instructions of each step with valgrind and compares them with `counts.toml`.
//!
//! `cargo bench --bench instructions`             fails if a count is more than 5 % above that file
//! `cargo bench --bench instructions -- --write`  writes the counts to that file
//!
//! Unlike times, counts are the same on a busy machine. They depend on the compiler, its options and the processor's
//! instructions (valgrind supports AVX2 but not AVX-512). The file names these. If they differ here, or if valgrind
//! is missing, the benchmark prints a line that begins with `skipped` and compares nothing.

#![expect(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a benchmark")]

#[path = "../filter/backends.rs"]
mod backends;
#[path = "../filter/composed.rs"]
mod composed;
mod counts;
#[path = "../filter/kernel.rs"]
mod kernel;
mod rows;
mod valgrind;
mod works;

use counts::{Counts, table};
use std::fs;
use std::process::{Command, ExitCode};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/instructions/counts.toml");

/// The first build option that changes counts and is not as in Cargo.toml.
fn other_options() -> Option<String> {
    let changes =
        |name: &str| name == "RUSTFLAGS" || name.starts_with("CARGO_PROFILE_RELEASE_") || name.starts_with("CARGO_PROFILE_BENCH_");
    std::env::vars().map(|(name, _)| name).find(|name| changes(name))
}

/// The compiler, and the system that it compiles for.
fn compiler() -> String {
    let out = Command::new("rustc").arg("-vV").output().expect("rustc, which cargo has called");
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    format!("{} on {}", text.lines().next().unwrap_or("?"), host.unwrap_or("?"))
}

/// The counts, or the reason why they are missing.
fn counted() -> Result<Counts, String> {
    if let Some(name) = other_options() {
        return Err(format!("{name} is set"));
    }
    let (kernel, instructions) = valgrind::count()?;
    Ok(Counts {
        compiler: compiler(),
        kernel,
        instructions,
    })
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let has = |name: &str| arguments.iter().any(|a| a == name);
    if has(valgrind::INSIDE) {
        works::run(valgrind::counted_call);
        return ExitCode::SUCCESS;
    }
    let now = match counted() {
        Ok(now) => now,
        Err(reason) => {
            println!("skipped: instructions are not counted: {reason}");
            return ExitCode::SUCCESS;
        }
    };
    if has("--write") {
        fs::write(FILE, now.text()).expect("counts.toml can be written");
        println!("{} counts with {} written to {FILE}", now.instructions.len(), now.kernel);
        return ExitCode::SUCCESS;
    }
    let before = Counts::read(&fs::read_to_string(FILE).expect("counts.toml is there")).expect("counts.toml is sound");
    if let Some(difference) = before.differs(&now) {
        println!("skipped: instructions are not compared: {difference}");
        return ExitCode::SUCCESS;
    }
    let (text, is_good) = table(&before, &now);
    println!("{text}");
    if is_good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
