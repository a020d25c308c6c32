//! `fusion inspect`.

use super::{Failure, OutputArgs};
use clap::Args;
use fusion::config::{Diagnostic, Diagnostics, Document};
use fusion::examine::{Missing, examine, opening};
use fusion::run::Options;
use fusion_advice::inspect::{Inspection, files};
use fusion_tables::Section;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// The logs, or folders with logs.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Writes a first design made of what was guessed; a file that is there is not replaced.
    #[arg(long, value_name = "DESIGN.toml")]
    write: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn inspect(args: &InspectArgs) -> Result<(), Failure> {
    if let Some(path) = args.write.as_ref().filter(|path| path.exists()) {
        let there = Diagnostic::error(format!("`{}` is there already", path.display()));
        return Err(Diagnostics::from(there.help("name another file, or remove this one")).into());
    }
    let paths = files(&args.files)?;
    let inspection = Inspection::of(&paths)?;
    let mut page = inspection.page();
    for folder in args.files.iter().filter(|path| path.is_dir()) {
        let inner = paths
            .iter()
            .filter_map(|path| path.parent())
            .find(|inner| *inner != folder && inner.starts_with(folder));
        if let Some(inner) = inner.filter(|_| !paths.iter().any(|path| path.parent() == Some(folder))) {
            let taken = format!(
                "`{}` holds no log itself: its only folder is taken, `{}`",
                folder.display(),
                inner.display()
            );
            page.sections.insert(0, Section::new("", []).note(taken));
        }
    }
    let Some(path) = &args.write else {
        return args.output.print(&page);
    };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let design = inspection.design(folder);
    if let Ok(text) = &design {
        write(path, text)?;
        let name = path.display();
        let mistakes = checked(path);
        let next = if mistakes.is_ok() {
            format!("`{name}` is written: `fusion run {name}`")
        } else {
            format!("`{name}` is written, but `fusion check {name}` finds mistakes in it: correct them first")
        };
        page.sections.push(Section::new("", []).note(next));
        args.output.print(&page)?;
        return mistakes.map_err(Into::into);
    }
    args.output.print(&page)?;
    design.map(drop).map_err(|missing| Failure::Mistakes(missing.into()))
}

/// Reads the design that was written, as `fusion check` does.
fn checked(path: &Path) -> Result<(), Diagnostics> {
    let design = examine(Document::load(path)?, &Options::default(), Missing::Told)?;
    opening(&design, &Options::default(), Missing::Told).unless_errors(())
}

pub(super) fn write(path: &Path, text: &str) -> Result<(), Diagnostics> {
    let written = std::fs::File::create_new(path).and_then(|mut file| std::io::Write::write_all(&mut file, text.as_bytes()));
    written.map_err(|e| Diagnostic::error(format!("`{}` cannot be written: {e}", path.display())).into())
}
