//! `fusion compile`.

use super::run::written;
use super::{DesignArgs, Failure, OutputArgs};
use clap::{Args, ValueEnum};
use fusion::config::Diagnostic;
use fusion::core::covariance::Kernel;
use fusion::provenance::Provenance;
use fusion_compile::{Needs, Target, compile as compiled, measure, record};
use fusion_tables::{Page, Section, Table};
use std::fs::{self, File};
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct CompileArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// The folder of the crate; it is created if necessary, and its files are replaced.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The folder with the crates of this framework, on which the written crate depends. Without it: where this program
    /// was built.
    #[arg(long, value_name = "DIR")]
    crates: Option<PathBuf>,
    /// Also runs the design with the kernel `portable`, and writes the rows that reach its filter to `rows.bin`. The
    /// program `replay` of the crate reads them, and prints the hash of the same estimates. The crate then states the
    /// memory that the filter needs for these rows.
    #[arg(long)]
    rows: bool,
    /// The use of the crate: a program in Rust, or a library and a header for C and C++.
    #[arg(long, value_enum, default_value = "rust")]
    target: Language,
    #[command(flatten)]
    output: OutputArgs,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Language {
    Rust,
    C,
}

pub(super) fn compile(args: &CompileArgs) -> Result<(), Failure> {
    let mut design = args.design.read()?;
    design.filter.kernel = Some(Kernel::PORTABLE);
    let crates = args.crates.clone().unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")));
    let crates = std::path::absolute(&crates).unwrap_or(crates);
    if !crates.join("vehicle/Cargo.toml").exists() {
        let missing = Diagnostic::error(format!("`{}` has no crate `vehicle`", crates.display()));
        return Err(missing.help("name the folder of the framework by `--crates`").into());
    }
    let target = match args.target {
        Language::Rust => Target::Rust,
        Language::C => Target::C,
    };
    let compile = |needs: Option<Needs>| compiled(&design, &name(&args.out), &crates, target, needs);
    let mut program = compile(None)?;
    let unwritable = |e: std::io::Error| Diagnostic::error(format!("`{}` cannot be written: {e}", args.out.display()));
    fs::create_dir_all(&args.out).map_err(unwritable)?;
    let (mut files, mut sections, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    if args.rows {
        let path = args.out.join("rows.bin");
        let mut out = File::create(&path).map(BufWriter::new).map_err(unwritable)?;
        // Half of the rows would look like all of them.
        let digest = record(&design, args.design.options(), &mut out).inspect_err(|_| {
            let _ = fs::remove_file(&path);
        })?;
        let mathematics = if cfg!(feature = "libm") { "libm" } else { "std" };
        let mut list = Table::list();
        list.row([format!("{} {:016x}, with `{mathematics}`", digest.count, digest.hash())]);
        sections.push(Section::new("Number and hash of the estimates of these rows", [list]));
        let mut rows = File::open(&path).map(BufReader::new).map_err(unwritable)?;
        match measure(&design, &mut rows)? {
            Some(needs) => {
                sections.push(memory(needs));
                program = compile(Some(needs))?;
            }
            None => warnings.push(UNMEASURED.to_owned()),
        }
        files.push(path);
    }
    program.write(&args.out).map_err(unwritable)?;
    files.splice(0..0, program.files.iter().map(|(path, _)| args.out.join(path)));
    sections.push(written(files));
    args.output.print(&Page {
        title: design.run.description.clone(),
        provenance: Provenance::of(&design, None),
        warnings,
        sections,
    })
}

const UNMEASURED: &str =
    "the crate does not state its memory, because this program does not measure it: make `fusion_cli::Meter` its `#[global_allocator]`";

/// The memory of the compiled filter.
fn memory(Needs { feed, all }: Needs) -> Section {
    let mut list = Table::list();
    list.row([format!("{feed} bytes to be fed with these rows")]);
    list.row([format!("{all} bytes also to predict and for checkpoints")]);
    Section::new("Memory of the filter, at most", [list])
}

/// The name of the crate: that of its folder, of letters, digits and hyphens.
fn name(out: &Path) -> String {
    let name = std::path::absolute(out).unwrap_or_else(|_| out.to_owned());
    let name = name
        .file_name()
        .map(|name| name.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    let name: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    match name.trim_matches('-') {
        name if name.starts_with(|c: char| c.is_ascii_alphabetic()) => name.to_owned(),
        name => format!("filter-{name}"),
    }
}
