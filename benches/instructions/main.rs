//! How many instructions each step takes, counted by valgrind and held against `counts.toml`.
//!
//! `cargo bench --bench instructions`             fails where a count is more than 5 % above what stands there
//! `cargo bench --bench instructions -- --write`  writes what it has counted there
//!
//! Unlike times, counts are the same on a busy machine. They depend on the compiler, its options and the
//! processor's instructions (valgrind knows AVX2 and not AVX-512): the file names these, and where
//! another one runs, or there is no valgrind, a line that begins with `skipped` says so and nothing is
//! compared.

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

/// The options of a build that changes counts, where one is not as in Cargo.toml.
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

/// What the counts are, or why there are none.
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
