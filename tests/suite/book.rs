//! The book: its commands are run, its designs are checked, its links are followed.
//!
//! | block | what is done |
//! |---|---|
//! | `console` | each line after `$` is run; the lines below it have to be printed, in that order |
//! | `console,exit=2` | the same, with that exit code |
//! | `console,data` | the same, where the recorded logs are |
//! | `toml,design=FILE` | is written as FILE, and has to pass `fusion check` |
//! | `toml,append=FILE` | is appended to FILE, which has to pass then |
//! | `toml,extends=DESIGN` | has to pass together with DESIGN, which it includes |
//! | `text`, `rust,ignore` | nothing |
//!
//! Each chapter has its own folder, in which `configs`, `examples` and `book` are those of the repository.

use crate::real::data;
use crate::support::{Workspace, squeezed};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// A test for each chapter.
macro_rules! chapters {
    ($($name:ident: $file:literal,)*) => {
        const CHAPTERS: &[&str] = &[$($file),*];
        $(
            #[test]
            fn $name() {
                try_out($file);
            }
        )*
    };
}

chapters! {
    about_the_book: "README.md",
    a_first_filter: "first-filter.md",
    logs: "logs.md",
    formats: "formats.md",
    from_ros: "from-ros.md",
    from_px4: "from-px4.md",
    inspecting: "inspecting.md",
    simulation: "simulation.md",
    designs: "designs.md",
    allan: "allan.md",
    backends: "backends.md",
    hypotheses: "hypotheses.md",
    latency_and_lever_arms: "latency-lever-arms.md",
    consistency: "consistency.md",
    reading_the_report: "report.md",
    budget: "budget.md",
    slow_errors: "slow-errors.md",
    outages_and_late_data: "outages-late-data.md",
    health: "health.md",
    false_fixes: "spoofing.md",
    usbl_and_dvl: "usbl-dvl.md",
    raw_gnss: "raw-gnss.md",
    live_links: "live.md",
    embedding: "embedding.md",
    microcontroller: "microcontroller.md",
    in_python: "python.md",
    blocks: "blocks.md",
    equations: "equations.md",
    ins_gps: "paper-ins-gps.md",
    chna: "paper-chna.md",
    backends_measured: "backends-measured.md",
    recorded_logs: "recorded-logs.md",
    beside_others: "beside-others.md",
    speed: "speed.md",
    glossary: "glossary.md",
    files: "files.md",
    rules: "rules.md",
    which_q_and_r: "tuning.md",
    observability: "observability.md",
}

fn source(file: &str) -> PathBuf {
    Path::new(ROOT).join("book/src").join(file)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A fenced block: the words after the fence, the line where it begins, its text.
struct Block {
    words: Vec<String>,
    line: usize,
    text: String,
}

impl Block {
    /// The value of `key=` after the fence.
    fn option(&self, key: &str) -> Option<&str> {
        self.words.iter().find_map(|word| word.strip_prefix(key)?.strip_prefix('='))
    }

    fn is(&self, word: &str) -> bool {
        self.words.iter().any(|w| w == word)
    }
}

/// The fenced blocks of a chapter, the files that mdBook includes among their lines.
fn fenced(chapter: &Path) -> Vec<Block> {
    let (mut blocks, mut open) = (Vec::new(), None::<Block>);
    for (number, line) in read(chapter).lines().enumerate() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(words), None) => {
                let words = words.split(',').map(str::to_owned).collect();
                let (line, text) = (number + 1, String::new());
                open = Some(Block { words, line, text });
            }
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some(block)) => {
                let included = line.strip_prefix("{{#include ").and_then(|l| l.strip_suffix("}}"));
                block.text += &included.map_or_else(|| format!("{line}\n"), |path| read(&chapter.with_file_name(path)));
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "{}: a block is not closed", chapter.display());
    blocks
}

/// A command with the lines that it has to print.
fn commands(text: &str) -> Vec<(&str, Vec<&str>)> {
    let mut commands: Vec<(&str, Vec<&str>)> = Vec::new();
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        match (line.strip_prefix("$ "), commands.last_mut()) {
            (Some(command), _) => commands.push((command, Vec::new())),
            (None, Some((_, printed))) => printed.push(line),
            (None, None) => panic!("nothing printed {line:?}"),
        }
    }
    commands
}

/// Returns true if a printed word matches the word in the book. `…` matches any word. A number may differ by one in its
/// last digit, since processors round differently.
fn is_word(shown: &str, printed: &str) -> bool {
    let digits = |word: &str| {
        let (mantissa, exponent) = word.split_once('e').unwrap_or((word, "0"));
        let decimals = mantissa.split_once('.').map_or(0, |(_, d)| d.len());
        Some(exponent.parse::<i32>().ok()? - i32::try_from(decimals).ok()?)
    };
    let is_near = || {
        let (a, b) = (shown.parse::<f64>().ok()?, printed.parse::<f64>().ok()?);
        // 1 %: rounding of the difference.
        Some((a - b).abs() <= 1.01 * 10_f64.powi(digits(shown)?))
    };
    shown == printed || shown == "…" || is_near() == Some(true)
}

fn is_line(shown: &str, printed: &str) -> bool {
    let (shown, printed) = (shown.split_whitespace(), printed.split_whitespace());
    shown.clone().count() == printed.clone().count() && shown.zip(printed).all(|(s, p)| is_word(s, p))
}

/// The shown lines that were not printed in this order, each with the most similar printed line.
fn missing<'a>(shown: &[&'a str], printed: &str) -> Vec<(&'a str, String)> {
    let printed = squeezed(printed);
    let (mut rest, mut missing) = (&printed[..], Vec::new());
    for line in shown {
        if let Some(at) = rest.iter().position(|p| is_line(line, p)) {
            rest = &rest[at + 1..];
            continue;
        }
        let alike = |p: &str| {
            p.split_whitespace()
                .zip(line.split_whitespace())
                .filter(|(p, s)| is_word(s, p))
                .count()
        };
        let nearest = rest.iter().rev().max_by_key(|p| alike(p));
        missing.push((*line, nearest.map_or_else(String::new, |p| p.as_str().to_owned())));
    }
    missing
}

/// The folder of a chapter, and its text.
struct Chapter {
    path: PathBuf,
    workspace: Workspace,
}

impl Chapter {
    /// Runs a shell line in this folder, with the recorded logs in `data`. Returns its exit code and its output.
    fn shell(&self, line: &str, data: &Path) -> (Option<i32>, String) {
        let binary = Path::new(env!("CARGO_BIN_EXE_fusion")).parent().unwrap();
        let path = std::env::var_os("PATH").unwrap_or_default();
        let path = std::env::join_paths(std::iter::once(binary.to_owned()).chain(std::env::split_paths(&path))).unwrap();
        let mut shell = Command::new("sh");
        shell.args(["-c", line]).current_dir(self.workspace.path(""));
        let out = shell.env("PATH", path).env("FUSION_DATA", data).output().unwrap();
        let text = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
        (out.status.code(), text)
    }

    /// The lines that the block shows but the command does not print.
    fn run(&self, block: &Block, place: &str) -> String {
        let data = if block.is("data") { data() } else { Some(PathBuf::new()) };
        let (Some(data), mut told) = (data, String::new()) else {
            return String::new();
        };
        let exit = block.option("exit").map_or(0, |code| code.parse().unwrap());
        for (command, shown) in commands(&block.text) {
            let (code, printed) = self.shell(command, &data);
            assert_eq!(code, Some(exit), "{place}: {command}\n{printed}");
            for (line, nearest) in missing(&shown, &printed) {
                told += &format!("{place}: {command}\n- {line}\n+ {nearest}\n");
            }
        }
        told
    }

    fn check(&self, block: &Block, place: &str) {
        let text = &block.text;
        let (file, text) = match ["design", "append", "extends"].map(|key| block.option(key)) {
            [Some(file), None, None] => (file, text.clone()),
            [None, Some(file), None] => (file, self.workspace.read(file) + "\n" + text),
            [None, None, Some(design)] => ("snippet.toml", format!("include = [\"{design}\"]\n{text}")),
            _ => panic!("{place}: nothing says what this is part of: `design=`, `append=` or `extends=`"),
        };
        std::fs::create_dir_all(self.workspace.path(file).parent().unwrap()).unwrap();
        self.workspace.write(file, text);
        let (code, printed) = self.shell(&format!("fusion check {file}"), Path::new(""));
        assert_eq!(code, Some(0), "{place}\n{printed}");
    }

    fn try_out(&self) {
        let mut told = String::new();
        for block in fenced(&self.path) {
            let place = format!("{}:{}", self.path.display(), block.line);
            match block.words[0].as_str() {
                "console" => told += &self.run(&block, &place),
                "toml" => self.check(&block, &place),
                // The tests of the Python package run its examples.
                "text" | "rust" | "python" => {}
                other => panic!("{place}: nobody tries out `{other}`"),
            }
        }
        assert!(told.is_empty(), "the page shows (-) what is not printed; nearest (+):\n{told}");
    }
}

fn try_out(file: &str) {
    let workspace = Workspace::new(&format!("book-{file}"));
    for folder in ["configs", "examples", "book"] {
        std::os::unix::fs::symlink(Path::new(ROOT).join(folder), workspace.path(folder)).unwrap();
    }
    let path = source(file);
    Chapter { path, workspace }.try_out();
}

/// The targets of the links in a text, except in code.
fn links(text: &str) -> Vec<String> {
    let mut is_code = false;
    let prose = text.lines().filter(|line| {
        is_code ^= line.starts_with("```");
        !is_code
    });
    let targets = prose.flat_map(|line| line.split("](").skip(1).filter_map(|rest| rest.split_once(')')));
    targets.map(|(target, _)| target.to_owned()).collect()
}

/// The link names of headings, as mdBook and GitHub make them.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut is_code = false;
    let headings = text.lines().filter(|line| {
        is_code ^= line.starts_with("```");
        !is_code && line.starts_with('#')
    });
    let anchor = |heading: &str| {
        let kept = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings.map(anchor).collect()
}

/// The broken links of a page.
fn broken(page: &Path) -> Vec<String> {
    let is_wrong = |link: &String| {
        let (file, anchor) = link.split_once('#').unwrap_or((link.as_str(), ""));
        let target = if file.is_empty() {
            page.to_owned()
        } else {
            page.with_file_name(file)
        };
        let has_anchor = || anchor.is_empty() || anchors(&read(&target)).contains(anchor);
        let leads_somewhere = link.contains("://") || (target.exists() && has_anchor());
        !leads_somewhere
    };
    let named = |link: String| format!("{}: {link}", page.display());
    links(&read(page)).into_iter().filter(is_wrong).map(named).collect()
}

#[test]
fn every_link_of_the_documents_and_the_book_leads_somewhere() {
    let documents = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|file| Path::new(ROOT).join(file));
    let pages = documents.into_iter().chain(CHAPTERS.iter().map(|file| source(file)));
    let broken: Vec<String> = pages.flat_map(|page| broken(&page)).collect();
    assert!(broken.is_empty(), "{broken:#?}");
}

#[test]
fn the_summary_lists_every_chapter() {
    let listed: BTreeSet<String> = links(&read(&source("SUMMARY.md"))).into_iter().collect();
    let files = std::fs::read_dir(source(""))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let there: BTreeSet<String> = files.filter(|name| name.ends_with(".md") && name != "SUMMARY.md").collect();
    assert_eq!(listed, there);
    assert_eq!(listed, CHAPTERS.iter().map(|&file| file.to_owned()).collect());
}

#[test]
fn a_chapter_links_within_the_book() {
    // mdBook copies no files from outside.
    for file in CHAPTERS {
        let outside: Vec<String> = links(&read(&source(file)))
            .into_iter()
            .filter(|link| link.starts_with(".."))
            .collect();
        assert!(outside.is_empty(), "{file}: {outside:?}");
    }
}

#[test]
fn a_line_is_found_where_numbers_differ_by_one_in_the_last_digit() {
    let printed = "health   good\nposition north [m]   0.3047 1.189 2.84e-4\nlast 12 ms\n";
    let missing = |shown: &[&'static str]| missing(shown, printed).into_iter().map(|(line, _)| line).collect::<Vec<_>>();
    assert!(missing(&["position north [m] 0.3048 1.189 2.85e-4", "last … ms"]).is_empty());
    for wrong in [
        "position north [m] 0.3049 1.189 2.84e-4",
        "position north [m] 0.3047 1.189",
        "position south [m] 0.3047 1.189 2.84e-4",
    ] {
        assert_eq!(missing(&[wrong]), [wrong]);
    }
    // The order counts.
    assert_eq!(missing(&["last 12 ms", "health good"]), ["health good"]);
}

#[test]
fn an_anchor_is_made_as_github_makes_it() {
    let anchors = anchors("# The equations\n```console\n# no heading\n```\n## 6. Judge it\n### `usbl`: fixes or angles\n");
    let wanted = ["the-equations", "6-judge-it", "usbl-fixes-or-angles"].map(str::to_owned);
    assert_eq!(anchors, wanted.into());
}
