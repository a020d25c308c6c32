//! `--ignore` and `--fix`: rules of advice that are not applied, and a copy of the design with the edits.

use super::inspect::write;
use super::{DesignArgs, Failure, read_text};
use clap::Args;
use fusion::config::{Diagnostic, Diagnostics, Document, Edit, Files};
use fusion::examine::{Missing, examine};
use fusion::run::Ignored;
use fusion_advice::rules::{Fixed, fix};
use fusion_tables::{Section, Table};
use std::path::{Path, PathBuf};

#[derive(Debug, Default, Args)]
pub(super) struct AdviceArgs {
    /// Ignores a rule of advice. A finding ends with the id of its rule, in brackets; a warning begins with it.
    #[arg(long, value_name = "ID")]
    ignore: Vec<String>,
    #[command(flatten)]
    pub(super) fix: FixArgs,
}

impl AdviceArgs {
    pub(super) fn ignored(&self) -> Result<Ignored, Diagnostic> {
        Ignored::new(&self.ignore)
    }
}

#[derive(Debug, Default, Args)]
pub(super) struct FixArgs {
    /// Writes a copy of the design with the edits that were found, and keeps its comments. The copy must be in the
    /// folder of the design, where relative paths start. Run it, and compare the two.
    #[arg(long, value_name = "COPY.toml")]
    fix: Option<PathBuf>,
}

impl FixArgs {
    /// Refuses a copy that cannot be written, before anything is run.
    pub(super) fn check(&self, design: &DesignArgs) -> Result<(), Diagnostic> {
        let Some(copy) = &self.fix else { return Ok(()) };
        let Some(config) = &design.config else {
            return Err(
                Diagnostic::error("`--fix` copies a file, and the built-in design has none").help("`fusion new` writes a design as a file")
            );
        };
        if copy.exists() {
            let there = Diagnostic::error(format!("`{}` is there already", copy.display()));
            return Err(there.help("name another file, or remove this one"));
        }
        let folder = |path: &Path| {
            let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
            folder.canonicalize().ok()
        };
        if folder(copy).is_none() || folder(copy) != folder(config) {
            let other = Diagnostic::error(format!("`{}` is not beside `{}`", copy.display(), config.display()));
            return Err(other.help("relative paths of the design start at its folder: name a file there"));
        }
        Ok(())
    }

    /// Writes the copy with `edits`. An edit with which the design has a mistake is left out.
    pub(super) fn write(&self, design: &DesignArgs, edits: &[Edit]) -> Result<Option<Section>, Failure> {
        let (Some(copy), Some(config)) = (&self.fix, &design.config) else {
            return Ok(None);
        };
        let text = read_text(config)?;
        let selection = design.selection();
        let with = |edits: &[Edit]| fix(&text, &selection.names(), edits);
        let (mut good, mut refused) = (Vec::new(), Vec::new());
        for edit in edits {
            let trial = with(&[&good[..], std::slice::from_ref(edit)].concat())?;
            match mistake(design, config, &trial) {
                None => good.push(edit.clone()),
                Some(mistake) => refused.push((edit.clone(), mistake)),
            }
        }
        let mut fixed = with(&good)?;
        fixed.left.extend(refused);
        if fixed.made.is_empty() {
            let mut section = Section::new("Edits", []).note("No edit was found that can be written, so no copy is written.");
            section.notes.extend(left(&fixed));
            return Ok(Some(section));
        }
        write(copy, &fixed.text)?;
        let mut list = Table::list();
        fixed.made.iter().for_each(|edit| list.row([edit.to_string()]));
        let name = copy.display();
        let mut section = Section::new(format!("Edits in {name}"), [list]);
        section.notes.extend(left(&fixed));
        let compared = format!(
            "Judge them on data that they were not found on: `fusion compare {} {name}`.",
            config.display()
        );
        Ok(Some(section.note(compared)))
    }
}

/// The edits that are not in the copy.
fn left(fixed: &Fixed) -> impl Iterator<Item = String> {
    fixed.left.iter().map(|(edit, reason)| format!("Not done: {edit}. {reason}."))
}

/// The first mistake of the design with these edits.
fn mistake(args: &DesignArgs, config: &Path, fixed: &Fixed) -> Option<String> {
    let name = config.display().to_string();
    let (mut document, found) = Document::parse(&name, &fixed.text);
    let mut d = Diagnostics::new();
    d.extend(found);
    d.extend(document.compose(config, Files::Disk));
    let (document, more) = args.selection().over(&document);
    d.extend(more.iter().cloned());
    let built = d.unless_errors(document);
    let errors = built
        .and_then(|document| examine(document, &args.options(), Missing::Excused))
        .err()?;
    errors.iter().next().map(|error| error.message.clone())
}
