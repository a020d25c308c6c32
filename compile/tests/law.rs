//! The law of compiled designs: with the rows of a run, the same estimates to the bit.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

use fusion::Selection;
use fusion::config::{Diagnostics, Document};
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::examine::build;
use fusion::run::{Options, run_sharing};
use fusion_compile::compile;
use fusion_core::covariance::Kernel;
use fusion_core::runner::Halt;
use fusion_models::sim::SharedCourse;
use fusion_vehicle::Digest;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

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

/// The rows that went to a filter, as a compiled one reads them, and its estimates.
#[derive(Default)]
struct Recorded {
    rows: Vec<u8>,
    digest: Digest,
}

impl std::fmt::Debug for Recorded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bytes, {:?}", self.rows.len(), self.digest)
    }
}

impl RunObserver for Recorded {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Row(row) => {
                let stream = u32::try_from(row.stream)?;
                self.rows.extend(stream.to_le_bytes());
                self.rows.extend(row.time.nanos().to_le_bytes());
                self.rows.extend(row.values.iter().flat_map(|value| value.to_le_bytes()));
            }
            RunEvent::Estimate { filter, belief, .. } if filter.number == 0 => self.digest.add(belief),
            _ => {}
        }
        Ok(())
    }
}

/// A run of the design with the kernel `portable`, after its program was written to `folder`.
fn recorded(design: &Path, folder: &Path) -> Result<Recorded, Diagnostics> {
    // A run that draws its start has another start than the design declares.
    let selection = Selection {
        set: vec!["simulation.draw_start=false".to_owned()],
        ..Selection::default()
    };
    let mut design = build(selection.load(design)?.document)?;
    design.filter.kernel = Some(Kernel::PORTABLE);
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let program = compile(&design, &name, &Path::new(ROOT).canonicalize().unwrap())?;
    program.write(folder).unwrap();
    let mut recorded = Recorded::default();
    run_sharing(&design, &Options::default(), &SharedCourse::default(), &mut [&mut recorded])?;
    Ok(recorded)
}

/// What the program of the host prints for these rows.
fn replayed(folder: &Path, rows: &[u8]) -> String {
    let mathematics = if cfg!(feature = "libm") { "libm" } else { "std" };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args([
        "run",
        "--quiet",
        "--release",
        "--offline",
        "--no-default-features",
        "--features",
        mathematics,
        "--example",
        "replay",
    ]);
    cargo.current_dir(folder).env("CARGO_TARGET_DIR", folder.with_file_name("target"));
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
    let recorded = recorded(design, folder).unwrap_or_else(|d| panic!("{}: {d}", design.display()));
    std::fs::write(folder.join("rows.bin"), &recorded.rows).unwrap();
    let Digest { count, hash } = recorded.digest;
    assert!(count > 10, "{}: {count}", design.display());
    assert_eq!(
        replayed(folder, &recorded.rows),
        format!("{count} {hash:016x}\n"),
        "{}",
        design.display()
    );
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

/// What cannot be compiled is refused, with its place and what to do.
#[test]
fn a_bank_and_rewinding_are_refused_at_their_places() {
    let refused = |design: &str, set: &[&str]| {
        let selection = Selection {
            set: set.iter().map(|&value| value.to_owned()).collect(),
            ..Selection::default()
        };
        let design = build(selection.load(Path::new(CONFIGS).join(design)).unwrap().document).unwrap();
        compile(&design, "refused", Path::new(ROOT)).unwrap_err().to_string()
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
    let refused = compile(&build(document).unwrap(), "nested", Path::new(ROOT))
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
    let program = compile(&build(document).unwrap(), "lines", Path::new(ROOT)).unwrap();
    let (_, library) = program.files.iter().find(|(path, _)| *path == "src/lib.rs").unwrap();
    assert!(library.starts_with("//! one\n//! mod two;\n"), "{library}");
}
