//! A declaration put together from parts: `include = ["parts/imu/hg1700.toml"]`.
//!
//! The values of a file win over the values of its includes; a later include wins over an earlier one.
//! Tables merge entry by entry, everything else is replaced. A block of another `type` replaces the whole
//! included block. Entries keep their order, included ones first. Every value keeps its place.
//!
//! A variant may include too: its parts are laid under the variant's own values. A stage may include too:
//! the filter inside a stage is a design, and may be in a separate file.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::diagnostic::{Diagnostic, Diagnostics};
use super::document::{Document, Entry, Node, Value};
use super::edit::is_retyped;
use super::text::{Unread, read_text};

/// The key under which a file, a variant or a stage lists its parts.
pub(crate) const INCLUDE: &str = "include";

/// Values of a design with all that it includes. Filters in filters that include the same parts double them at each
/// level; the largest design of this project has a few thousand.
const MOST_VALUES: usize = 1 << 18;

const MISSING: &str = "there is no such file";

/// Where included files are.
#[derive(Clone, Copy, Debug)]
pub enum Files {
    /// In the file system.
    Disk,
    /// In the program: paths with their texts.
    Embedded(&'static [(&'static str, &'static str)]),
}

impl Files {
    fn read(self, path: &Path) -> Result<String, String> {
        match self {
            Self::Disk => read_text(path).map_err(|unread| match unread {
                Unread::Missing => MISSING.to_owned(),
                Unread::Because(why, _) => why,
            }),
            Self::Embedded(files) => {
                let path = self.identity(path);
                let found = files.iter().find(|(name, _)| Path::new(name) == path);
                found.map(|(_, text)| (*text).to_owned()).ok_or_else(|| MISSING.to_owned())
            }
        }
    }

    /// The same path for the same file.
    fn identity(self, path: &Path) -> PathBuf {
        match self {
            Self::Disk => std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()),
            Self::Embedded(_) => {
                let mut plain = PathBuf::new();
                for part in path.components() {
                    match part {
                        std::path::Component::CurDir => {}
                        std::path::Component::ParentDir => drop(plain.pop()),
                        other => plain.push(other),
                    }
                }
                plain
            }
        }
    }

    /// The names of the files in the folder of `path`.
    fn beside(self, path: &Path) -> Vec<String> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let name = |path: &Path| Some(path.file_name()?.to_string_lossy().into_owned());
        let mut names: Vec<String> = match self {
            Self::Disk => {
                let folder = if folder == Path::new("") { Path::new(".") } else { folder };
                let files = std::fs::read_dir(folder).into_iter().flatten();
                files.filter_map(|file| name(&file.ok()?.path())).collect()
            }
            Self::Embedded(files) => {
                let folder = self.identity(folder);
                let inside = files
                    .iter()
                    .map(|(path, _)| Path::new(path))
                    .filter(|path| path.parent() == Some(&folder));
                inside.filter_map(name).collect()
            }
        };
        names.retain(|name| name.ends_with(".toml"));
        names.sort_unstable();
        names
    }
}

impl Document {
    /// The file at `path` with the parts that it includes.
    ///
    /// # Errors
    /// That a file cannot be read, or mistakes of its syntax.
    pub fn load(path: &Path) -> Result<Self, Diagnostics> {
        let name = path.display().to_string();
        let text = Files::Disk.read(path);
        let text = text.map_err(|why| Diagnostic::error(format!("`{name}` cannot be read: {why}")))?;
        let mut d = Diagnostics::new();
        let (mut document, mistakes) = Self::parse(&name, &text);
        d.extend(mistakes);
        d.extend(document.compose(path, Files::Disk));
        d.unless_errors(document)
    }

    /// A text, which diagnostics call `design.toml`, with the parts that it includes: their paths start at `folder`.
    ///
    /// # Errors
    /// That a part cannot be read, or mistakes of the syntax.
    pub fn read_in(folder: &Path, text: &str) -> Result<Self, Diagnostics> {
        let (mut document, mistakes) = Self::parse("design.toml", text);
        let mut d = Diagnostics::new();
        d.extend(mistakes);
        d.extend(document.compose(&folder.join("design.toml"), Files::Disk));
        d.unless_errors(document)
    }

    /// Puts the included files under the document. `file` is the file of the document; paths start in its
    /// folder.
    ///
    /// Returns the mistakes. If there are syntax errors among them, the document holds the readable parts.
    pub fn compose(&mut self, file: &Path, files: Files) -> Vec<Diagnostic> {
        let mut composer = Composer {
            files,
            chain: vec![(files.identity(file), file.display().to_string())],
            done: HashMap::new(),
            values: 0,
            is_full: false,
            found: Vec::new(),
        };
        composer.compose(Arc::make_mut(&mut self.root), folder(file));
        composer.found
    }
}

struct Composer {
    files: Files,
    /// The files that are being read, each included by the one before: identity and name.
    chain: Vec<(PathBuf, String)>,
    /// The parts read so far.
    done: HashMap<PathBuf, Node>,
    /// How many values all parts have that were included so far.
    values: usize,
    is_full: bool,
    found: Vec<Diagnostic>,
}

impl Composer {
    fn compose(&mut self, root: &mut Node, folder: &Path) {
        if let Some(variants) = root.get_mut("variant") {
            for variant in variants.entries_mut() {
                self.compose_stages(&mut variant.node, folder);
                self.include(&mut variant.node, folder);
            }
        }
        self.compose_stages(root, folder);
        self.include(root, folder);
    }

    /// The stages of a design, those of the filters inside them first.
    fn compose_stages(&mut self, design: &mut Node, folder: &Path) {
        if let Some(stages) = design.get_mut("stage") {
            for stage in stages.entries_mut() {
                self.compose_stages(&mut stage.node, folder);
                self.include(&mut stage.node, folder);
            }
        }
    }

    fn include(&mut self, node: &mut Node, folder: &Path) {
        let Some(list) = node.take(INCLUDE) else { return };
        let wrong = |node: &Node| {
            let help = "write `include = [\"parts/imu.toml\"]`, with paths relative to this file";
            Diagnostic::error("an array of paths is expected here").at(&node.place).help(help)
        };
        let Value::Array(paths) = &list.value else {
            self.found.push(wrong(&list));
            return;
        };
        let mut under: Option<Node> = None;
        for at in paths {
            let Some(path) = at.as_str() else {
                self.found.push(wrong(at));
                continue;
            };
            let Some(mut part) = self.part(at, &folder.join(path)) else {
                continue;
            };
            self.values = self.values.saturating_add(part.count());
            if self.values > MOST_VALUES {
                // Reported once: all further includes are ignored.
                if !core::mem::replace(&mut self.is_full, true) {
                    let full = Diagnostic::error(format!("the included files have more than {MOST_VALUES} values together"));
                    self.found
                        .push(full.at(&at.place).help("include a part once, at the outermost place that needs it"));
                }
                return;
            }
            if let Some(earlier) = under.take() {
                underlay(&mut part, earlier);
            }
            under = Some(part);
        }
        if let Some(under) = under {
            underlay(node, under);
        }
    }

    /// The part at `path`, which is named at a node.
    fn part(&mut self, at: &Node, path: &Path) -> Option<Node> {
        let name = path.display().to_string();
        if self.is_full {
            return None;
        }
        // Lines of other files are not quoted in messages.
        if path.extension().is_none_or(|e| e != "toml") {
            let other = Diagnostic::error(format!("`{name}` cannot be included: its name does not end in `.toml`"));
            self.found.push(other.at(&at.place).help("a part is a TOML file"));
            return None;
        }
        let identity = self.files.identity(path);
        if let Some(start) = self.chain.iter().position(|(known, _)| *known == identity) {
            let names = self.chain[start..].iter().map(|(_, name)| format!("`{name}`"));
            let chain: Vec<String> = names.chain([format!("`{}`", self.chain[start].1)]).collect();
            let cycle = Diagnostic::error(format!("`{}` includes itself", self.chain[start].1)).at(&at.place);
            self.found.push(cycle.help(format!("remove one of these: {}", chain.join(" → "))));
            return None;
        }
        if let Some(done) = self.done.get(&identity) {
            return Some(done.clone());
        }
        let text = match self.files.read(path) {
            Ok(text) => text,
            Err(why) => {
                let unreadable = Diagnostic::error(format!("`{name}` cannot be included: {why}")).at(&at.place);
                let beside = self.files.beside(path);
                let beside: Vec<&str> = beside.iter().map(String::as_str).collect();
                let wanted = path.file_name().unwrap_or_default().to_string_lossy();
                let help = format!("the path starts at `{}`{}", folder_name(&self.chain), library(path));
                self.found.push(match why == MISSING {
                    true => unreadable.meant(&wanted, &beside).help(help),
                    false => unreadable,
                });
                return None;
            }
        };
        let (Document { root, .. }, mistakes) = Document::parse(&name, &text);
        let mut root = Arc::unwrap_or_clone(root);
        self.found.extend(mistakes);
        self.chain.push((identity.clone(), name));
        self.compose(&mut root, folder(path));
        self.chain.pop();
        self.done.insert(identity, root.clone());
        Some(root)
    }
}

/// Where a part of the library comes from, if the path could be that of one.
fn library(path: &Path) -> String {
    let mut names = path.iter().rev().map(|name| name.to_string_lossy());
    match (names.next(), names.next(), names.next().as_deref()) {
        (Some(file), Some(kind), Some("parts")) => {
            let name = file.strip_suffix(".toml").unwrap_or(&file);
            format!("; `fusion new --part {kind}/{name}` writes a part of the library, `fusion new --list` shows them")
        }
        _ => String::new(),
    }
}

fn folder(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

/// The folder of the file that is being read.
fn folder_name(chain: &[(PathBuf, String)]) -> String {
    let folder = chain.last().and_then(|(_, name)| Path::new(name).parent());
    match folder.map(|folder| folder.display().to_string()) {
        Some(name) if !name.is_empty() => name,
        _ => ".".to_owned(),
    }
}

/// Lays `under` under `own`, which wins.
fn underlay(own: &mut Node, under: Node) {
    if is_retyped(&under, own) {
        return;
    }
    let (Value::Table { entries, .. }, Value::Table { entries: below, .. }) = (&mut own.value, under.value) else {
        return;
    };
    let mut all = Vec::with_capacity(entries.len() + below.len());
    for Entry { key, node } in below {
        match entries.iter().position(|entry| entry.key == key) {
            Some(at) => {
                let mut entry = entries.remove(at);
                underlay(&mut entry.node, node);
                all.push(entry);
            }
            None => all.push(Entry { key, node }),
        }
    }
    all.append(entries);
    *entries = all;
}
