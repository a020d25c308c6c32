//! `fusion compile`.

use super::run::written;
use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use fusion::config::Diagnostic;
use fusion::provenance::Provenance;
use fusion_compile::compile as compiled;
use fusion_tables::Page;
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
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn compile(args: &CompileArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    let crates = args.crates.clone().unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")));
    let crates = std::path::absolute(&crates).unwrap_or(crates);
    if !crates.join("vehicle/Cargo.toml").exists() {
        let missing = Diagnostic::error(format!("`{}` has no crate `vehicle`", crates.display()));
        return Err(missing.help("name the folder of the framework by `--crates`").into());
    }
    let program = compiled(&design, &name(&args.out), &crates)?;
    let unwritable = |e: std::io::Error| Diagnostic::error(format!("`{}` cannot be written: {e}", args.out.display()));
    program.write(&args.out).map_err(unwritable)?;
    args.output.print(&Page {
        title: design.run.description.clone(),
        provenance: Provenance::of(&design, None),
        warnings: Vec::new(),
        sections: vec![written(program.files.iter().map(|(path, _)| args.out.join(path)))],
    })
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
