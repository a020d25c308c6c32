//! The law of compiled designs: with the rows of a run, the same estimates to the bit.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

use fusion::assembly::StreamLayout;
use fusion::config::{Diagnostics, Document};
use fusion::design::Design;
use fusion::models::block::Shape;
use fusion::models::solution::{Solution, sigmas};
use fusion::run::Options;
use fusion::run::examine::build;
use fusion::{Navigator, Selection};
use fusion_compile::{Meter, Needs, Target, compile, measure, record};
use fusion_core::Time;
use fusion_core::checkpoint::Fnv;
use fusion_core::covariance::Kernel;
use fusion_core::runner::Event;
use fusion_vehicle::Digest;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

#[global_allocator]
static METER: Meter = Meter;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
const CONFIGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs");

/// Different processes, gates, stages, charts and forms.
const DESIGNS: [&str; 5] = [
    "ins-gps-outlier.toml",
    "urban-canyon.toml",
    "utv-square.toml",
    "backends/large-heading.toml",
    "templates/person.toml",
];

/// The design with the kernel `portable`.
fn portable(design: &Path) -> Result<Design, Diagnostics> {
    portable_with(design, &[])
}

/// The same with other values.
fn portable_with(design: &Path, set: &[&str]) -> Result<Design, Diagnostics> {
    // A run that draws its start has another start than the design declares.
    let set = ["simulation.draw_start=false"].iter().chain(set);
    let selection = Selection {
        set: set.map(|&value| value.to_owned()).collect(),
        ..Selection::default()
    };
    let mut design = build(selection.load(design)?.document)?;
    design.filter.kernel = Some(Kernel::PORTABLE);
    Ok(design)
}

/// Writes the program of a design to a folder.
fn written(design: &Design, folder: &Path, target: Target, needs: Option<Needs>) -> Result<(), Diagnostics> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let program = compile(design, &name, &Path::new(ROOT).canonicalize().unwrap(), target, needs)?;
    program.write(folder).unwrap();
    Ok(())
}

/// The rows of a run of the design, and its estimates.
fn recorded(design: &Design) -> Result<(Vec<u8>, Digest), Diagnostics> {
    let mut rows = Vec::new();
    let digest = record(design, Options::default(), &mut rows)?;
    Ok((rows, digest))
}

/// Cargo in the folder of a written crate, with the mathematics of this program.
fn cargo(command: &str, folder: &Path) -> Command {
    let mathematics = if cfg!(feature = "libm") { "libm" } else { "std" };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args([command, "--quiet", "--release", "--offline"]);
    cargo.args(["--no-default-features", "--features", mathematics]);
    cargo.current_dir(folder).env("CARGO_TARGET_DIR", folder.with_file_name("target"));
    cargo
}

/// The output of the program of the host for these rows.
fn replayed(folder: &Path, rows: &[u8]) -> String {
    let mut cargo = cargo("run", folder);
    cargo.args(["--example", "replay"]);
    let mut program = cargo.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    program.stdin.take().unwrap().write_all(rows).unwrap();
    let out = program.wait_with_output().unwrap();
    assert!(out.status.success(), "{}", folder.display());
    String::from_utf8(out.stdout).unwrap()
}

fn folder(design: &str) -> PathBuf {
    let name = Path::new(design).file_stem().unwrap_or_default();
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("compiled").join(name)
}

/// Compares a compiled design with its run.
fn holds(design: &Path, folder: &Path) {
    let made = portable(design).and_then(|portable| {
        written(&portable, folder, Target::Rust, None)?;
        recorded(&portable)
    });
    let (rows, digest) = made.unwrap_or_else(|d| panic!("{}: {d}", design.display()));
    let (count, hash) = (digest.count, digest.hash());
    assert!(count > 10, "{}: {count}", design.display());
    assert_eq!(replayed(folder, &rows), format!("{count} {hash:016x}\n"), "{}", design.display());
}

/// A row of a record, and the bytes of it.
struct Recorded<'a> {
    stream: usize,
    time: Time,
    row: Vec<f64>,
    bytes: &'a [u8],
}

fn rows<'a>(mut bytes: &'a [u8], widths: &[usize]) -> Vec<Recorded<'a>> {
    let mut rows = Vec::new();
    while let Some((stream, rest)) = bytes.split_first_chunk() {
        let stream = u32::from_le_bytes(*stream) as usize;
        let (time, rest) = rest.split_first_chunk().unwrap();
        let (numbers, rest) = rest.split_at(8 * widths[stream]);
        let values = numbers.as_chunks::<8>().0.iter().map(|number| f64::from_le_bytes(*number));
        rows.push(Recorded {
            stream,
            time: Time::from_nanos(i64::from_le_bytes(*time)),
            row: values.collect(),
            bytes: &bytes[..bytes.len() - rest.len()],
        });
        bytes = rest;
    }
    rows
}

/// The numbers that C reads of a solution.
fn numbers(solution: &Solution) -> Vec<f64> {
    let (place, p) = solution.position.unwrap_or_default();
    let (velocity, v) = solution.velocity.unwrap_or_default();
    let (attitude, a) = solution.attitude.unwrap();
    let mut all = vec![place.lat, place.lon, place.height];
    all.extend(velocity.iter());
    all.extend([attitude.w, attitude.i, attitude.j, attitude.k]);
    all.extend([p, v, a].iter().flat_map(|p| sigmas(p).iter().copied().collect::<Vec<_>>()));
    all
}

/// The output of a program in C or C++ that replays rows with the library of `folder`.
fn in_c(compiler: &str, source: &str, folder: &Path, arguments: &[&str], rows: &[u8]) -> String {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().replace('-', "_");
    let library = folder.with_file_name("target").join(format!("release/lib{name}.a"));
    let program = folder.join(format!("{compiler}.out"));
    let mut build = Command::new(compiler);
    build.args(["-O1", "-Wall", "-Wextra", "-Werror", "-I", "."]).arg(source);
    build.arg(library).arg("-lm").arg("-o").arg(&program).current_dir(folder);
    assert!(build.status().unwrap().success(), "{source}");
    let mut run = Command::new(program);
    run.args(arguments).current_dir(folder).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut program = run.spawn().unwrap();
    program.stdin.take().unwrap().write_all(rows).unwrap();
    let out = program.wait_with_output().unwrap();
    assert!(out.status.success(), "{source}: {:?}", out.status);
    String::from_utf8(out.stdout).unwrap()
}

/// A program in C has the solutions of a navigator, row by row. One in C++ that continues from a checkpoint of the
/// navigator ends with the same solution, and with the same checkpoint.
#[test]
#[ignore = "it builds a library: `.ci/run` runs it"]
fn compiled_designs_have_their_solutions_in_c() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("compiled/in-c");
    let design = portable(&Path::new(CONFIGS).join("ins-gps.toml")).unwrap();
    let (record, _) = recorded(&design).unwrap();
    // The programs have exactly the memory that was measured: with less, they end.
    let needs = measure(&design, &mut Cursor::new(&record)).unwrap().unwrap();
    written(&design, &folder, Target::C, Some(needs)).unwrap();
    assert!(cargo("build", &folder).status().unwrap().success());

    let mut navigator = Navigator::of(&design).unwrap();
    let widths: Vec<usize> = navigator.streams().iter().map(StreamLayout::width).collect();
    let rows = rows(&record, &widths);
    let (mut count, mut hash) = (0_u64, Fnv::default());
    for (number, Recorded { stream, time, row, .. }) in rows.iter().enumerate() {
        navigator.feed_stream(*stream, *time, row, &mut |_: &Event<'_>| {}).unwrap();
        if let Some(solution) = navigator.solution() {
            count += 1;
            hash.bytes(&solution.time.nanos().to_le_bytes());
            numbers(&solution).iter().for_each(|number| hash.bytes(&number.to_le_bytes()));
        }
        if number + 1 == rows.len() / 2 {
            std::fs::write(folder.join("half.bin"), navigator.checkpoint()).unwrap();
        }
    }
    assert!(count > 1000);
    // A latitude in degrees: both refuse the row, and nothing has changed.
    let is_place = |stream: &StreamLayout| stream.channels.iter().any(|channel| channel.shape == Shape::Geodetic);
    let place = navigator.streams().iter().position(is_place).unwrap();
    let half = &rows[rows.len() / 2];
    let degrees = vec![36.1; widths[place]];
    let told = navigator
        .feed_stream(place, half.time, &degrees, &mut |_: &Event<'_>| {})
        .unwrap_err();
    assert!(told.to_string().contains("beyond a pole; angles are in radians"), "{told}");
    let degrees = degrees.iter().flat_map(|number| number.to_le_bytes());
    let stamp = half.time.nanos().to_le_bytes();
    let wrong = (place as u32).to_le_bytes().into_iter().chain(stamp).chain(degrees);
    let mut disturbed: Vec<u8> = rows[..rows.len() / 2].iter().flat_map(|row| row.bytes).copied().collect();
    disturbed.extend(wrong);
    disturbed.extend(rows[rows.len() / 2..].iter().flat_map(|row| row.bytes));
    let found = in_c("cc", "examples/replay.c", &folder, &[], &disturbed);
    assert_eq!(found, format!("{count} {:016x}\n", hash.value()));

    let last = navigator.solution().unwrap();
    let numbers = numbers(&last);
    let bits = [0, 3, 6, 18].map(|k| format!("{:016x}", numbers[k].to_bits()));
    let mut saved = Fnv::default();
    saved.bytes(&navigator.checkpoint());
    let expected = format!("0 {} {} {:016x}\n", last.time.nanos(), bits.join(" "), saved.value());
    let second: Vec<u8> = rows[rows.len() / 2..].iter().flat_map(|row| row.bytes).copied().collect();
    assert_eq!(in_c("c++", "examples/replay.cpp", &folder, &["half.bin"], &second), expected);
}

/// Compiled, a design has the estimates of its run, to the bit.
#[test]
#[ignore = "it builds a program for each design: `.ci/run` runs it"]
fn compiled_designs_have_the_estimates_of_their_runs() {
    for design in DESIGNS {
        holds(&Path::new(CONFIGS).join(design), &folder(design));
    }
}

/// The same for every shipped design that simulates its data, or that has no file to read.
#[test]
#[ignore = "it builds a program for each of twenty designs"]
fn every_shipped_design_that_can_be_compiled_has_the_estimates_of_its_run() {
    for part in [".", "backends", "published", "templates"] {
        for entry in std::fs::read_dir(Path::new(CONFIGS).join(part)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            if path.extension().is_some_and(|e| e == "toml") && !["after-outage", "uri-r-sea-trial"].contains(&&*name) {
                println!("{part}/{name}");
                holds(&path, &folder(&name));
            }
        }
    }
}

/// Rows that are held back are in the memory of the filter: 100 samples of 6 numbers in a second, of 8 bytes each.
#[test]
fn a_filter_that_holds_rows_back_needs_memory_for_them() {
    let needs = |reorder: &str| {
        let set = [reorder, "simulation.longest=20"];
        let design = portable_with(&Path::new(CONFIGS).join("ins-gps.toml"), &set).unwrap();
        measure(&design, &mut Cursor::new(recorded(&design).unwrap().0)).unwrap().unwrap()
    };
    let (at_once, later) = (needs("run.reorder=0"), needs("run.reorder='1 s'"));
    assert!(later.feed > at_once.feed + 100 * 6 * 8, "{at_once:?} {later:?}");
    // A checkpoint is written next to the filter.
    assert!(at_once.all > at_once.feed + 15 * 16 * 8, "{at_once:?}");
}

/// A part that cannot be compiled is refused, with its place and a remedy.
#[test]
fn a_bank_and_rewinding_are_refused_at_their_places() {
    let refused = |design: &str, set: &[&str]| {
        let selection = Selection {
            set: set.iter().map(|&value| value.to_owned()).collect(),
            ..Selection::default()
        };
        let design = build(selection.load(Path::new(CONFIGS).join(design)).unwrap().document).unwrap();
        compile(&design, "refused", Path::new(ROOT), Target::Rust, None)
            .unwrap_err()
            .to_string()
    };
    let bank = refused("after-outage.toml", &[]);
    assert!(bank.contains("a bank of hypotheses cannot be compiled"), "{bank}");
    assert!(bank.contains("after-outage.toml:19"), "{bank}");
    let rewind = refused("ins-gps.toml", &["run.order=\"rewind\""]);
    assert!(
        rewind.contains("a filter that goes back for late rows cannot be compiled"),
        "{rewind}"
    );
}

/// A filter inside a stage has no literal: the error is at its table.
#[test]
fn a_filter_inside_a_stage_is_refused_at_its_place() {
    let text = "[process]
type = 'attitude_only'
source = 'inner'
gyro_noise = 1e-2
[initial.start]
type = 'explicit'
attitude = [0, 0, 0]
attitude_sigma = 1
[stage.inner]
type = 'filter'
[stage.inner.process]
type = 'attitude_only'
source = 'imu'
gyro_noise = 1e-3
[stage.inner.initial.start]
type = 'explicit'
attitude = [0, 0, 0]
attitude_sigma = 1
";
    let (document, _) = Document::parse("nested.toml", text);
    let refused = compile(&build(document).unwrap(), "nested", Path::new(ROOT), Target::Rust, None)
        .unwrap_err()
        .to_string();
    assert!(refused.contains("the model of `stage.inner` cannot be compiled"), "{refused}");
    assert!(refused.contains("nested.toml:9"), "{refused}");
}

/// A description of several lines stays a comment.
#[test]
fn a_description_of_several_lines_is_no_code() {
    let selection = Selection {
        set: vec!["run.description=\"\"\"one\nmod two;\"\"\"".to_owned()],
        ..Selection::default()
    };
    let document = selection.load(Path::new(CONFIGS).join("ins-gps.toml")).unwrap().document;
    let program = compile(&build(document).unwrap(), "lines", Path::new(ROOT), Target::Rust, None).unwrap();
    let (_, library) = program.files.iter().find(|(path, _)| *path == "src/lib.rs").unwrap();
    assert!(library.starts_with("//! one\n//! mod two;\n"), "{library}");
}
