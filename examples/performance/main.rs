//! Measures and writes the page of the book on speed: `cargo run --release --example performance`.
//!
//! It runs the benches. It writes the lines of figures that they print to `benches/figures.txt`, with facts about
//! the machine and the build, and makes the section from them. `-- --again` makes it from the existing file.

#![expect(clippy::print_stdout, reason = "an example prints")]

mod section;

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::{env, fs};

/// The benches whose lines are figures.
const BENCHES: [&str; 4] = ["filter", "models", "montecarlo", "scenario"];

/// Build options that apply if Cargo.toml does not set them: the defaults of cargo's release profile.
const DEFAULTS: [(&str, &str); 3] = [("opt-level", "3"), ("lto", "false"), ("codegen-units", "16")];

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (file, page) = (root.join("benches/figures.txt"), root.join("book/src/speed.md"));
    if !env::args().any(|argument| argument == "--again") {
        let mut text = format!("# Written by `cargo run --release --example performance`.\n{}", facts(root)?);
        for bench in BENCHES {
            text += &lines(root, bench)?;
        }
        fs::write(&file, text)?;
    }
    let section = section::render(&fs::read_to_string(&file)?)?;
    fs::write(&page, section::replaced(&fs::read_to_string(&page)?, &section)?)?;
    println!("{section}");
    Ok(())
}

/// The machine of the measurement, and the build options.
fn facts(root: &Path) -> Result<String, Failure> {
    let mut text = String::new();
    let today = Command::new("date").args(["-u", "+%F"]).output()?;
    writeln!(text, "measured: {}", String::from_utf8(today.stdout)?.trim())?;
    let cores = std::thread::available_parallelism()?;
    let (system, architecture) = (env::consts::OS, env::consts::ARCH);
    writeln!(text, "processor: {}, {cores} cores, {system} {architecture}", processor())?;
    let compiler = Command::new("rustc").arg("--version").output()?;
    writeln!(text, "compiler: {}", String::from_utf8(compiler.stdout)?.trim())?;
    writeln!(text, "profile: {}", profile(&fs::read_to_string(root.join("Cargo.toml"))?)?)?;
    Ok(text)
}

/// The processor's name as the system reports it, or `unknown`.
fn processor() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    name.map_or_else(|| "unknown".to_owned(), |(_, name)| name.trim().to_owned())
}

/// The options of `cargo bench`: of Cargo.toml, and of the environment, which has the last word.
fn profile(manifest: &str) -> Result<String, Failure> {
    let manifest: toml::Table = toml::from_str(manifest)?;
    let of = |name: &str| manifest.get("profile").and_then(|p| p.get(name)).and_then(|p| p.as_table());
    let own = || ["bench", "release"].into_iter().filter_map(of);
    let mut options: Vec<String> = DEFAULTS
        .iter()
        .map(|(key, default)| {
            let declared = own().find_map(|table| table.get(*key));
            format!("{key} = {}", declared.map_or_else(|| (*default).to_owned(), ToString::to_string))
        })
        .collect();
    for (package, table) in own().filter_map(|table| table.get("package")?.as_table()).flatten() {
        let keys = table.as_table().into_iter().flatten();
        options.extend(keys.map(|(key, value)| format!("{key} = {value} of {package}")));
    }
    let is_option =
        |name: &str| name == "RUSTFLAGS" || name.starts_with("CARGO_PROFILE_RELEASE_") || name.starts_with("CARGO_PROFILE_BENCH_");
    options.extend(
        env::vars()
            .filter(|(name, _)| is_option(name))
            .map(|(name, value)| format!("{name} = {value}")),
    );
    Ok(format!("bench, {}", options.join(", ")))
}

/// The lines of figures that a bench prints. The filter `nothing` skips criterion's own timings, which take longer.
fn lines(root: &Path, bench: &str) -> Result<String, Failure> {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(root).args(["bench", "--bench", bench, "--", "nothing"]);
    println!("cargo bench --bench {bench} -- nothing");
    let out = cargo.stderr(Stdio::inherit()).output()?;
    if !out.status.success() {
        return Err(format!("the bench {bench} failed").into());
    }
    let text = String::from_utf8(out.stdout)?;
    let is_figure = |line: &&str| {
        line.split_once(": ")
            .is_some_and(|(name, _)| name == "kernel" || name.contains('/'))
    };
    Ok(text.lines().filter(is_figure).map(|line| format!("{line}\n")).collect())
}
