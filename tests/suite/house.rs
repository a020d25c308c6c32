use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The crates in order of dependency, as ARCHITECTURE.md draws them: folder, package, and the packages that it may use.
const CRATES: [(&str, &str, &[&str]); 16] = [
    ("kernels", "fusion-kernels", &[]),
    ("derive", "fusion-derive", &[]),
    ("fusion-core", "fusion-core", &["fusion-derive", "fusion-kernels"]),
    ("models", "fusion-models", &["fusion-core", "fusion-derive"]),
    ("fusion", "fusion", &["fusion-core", "fusion-models"]),
    ("vehicle", "fusion-vehicle", &["fusion-core", "fusion-models"]),
    ("abi", "fusion-abi", &["fusion-vehicle"]),
    (
        "compile",
        "fusion-compile",
        &["fusion", "fusion-abi", "fusion-core", "fusion-models", "fusion-vehicle"],
    ),
    ("tables", "fusion-tables", &["fusion", "fusion-core"]),
    (
        "judge",
        "fusion-judge",
        &["fusion", "fusion-core", "fusion-models", "fusion-tables"],
    ),
    (
        "advice",
        "fusion-advice",
        &["fusion", "fusion-core", "fusion-models", "fusion-tables"],
    ),
    ("formats", "fusion-formats", &["fusion"]),
    ("live", "fusion-live", &["fusion", "fusion-formats"]),
    ("ros2", "fusion-ros2", &["fusion", "fusion-formats", "fusion-live"]),
    (
        "present",
        "fusion-present",
        &["fusion", "fusion-core", "fusion-judge", "fusion-models", "fusion-tables"],
    ),
    (
        ".",
        "fusion-cli",
        &[
            "fusion",
            "fusion-advice",
            "fusion-compile",
            "fusion-formats",
            "fusion-judge",
            "fusion-live",
            "fusion-present",
            "fusion-ros2",
            "fusion-tables",
        ],
    ),
];

/// Packages that only a command needs: a vehicle links none of them.
const OF_A_COMMAND: [&str; 7] = ["clap", "comfy-table", "indicatif", "maud", "rayon", "signal-hook", "terminal_size"];

/// The names of `[dependencies]` of a folder.
fn dependencies(folder: &str) -> Vec<String> {
    let text = fs::read_to_string(Path::new(ROOT).join(folder).join("Cargo.toml")).unwrap();
    let manifest: toml::Table = toml::from_str(&text).unwrap();
    let table = manifest.get("dependencies").and_then(toml::Value::as_table);
    table.map_or_else(Vec::new, |table| table.keys().cloned().collect())
}

#[test]
fn crates_depend_on_lower_ones_only_and_a_vehicle_links_no_command() {
    for (folder, package, may) in CRATES {
        let own: Vec<String> = dependencies(folder).into_iter().filter(|name| name.starts_with("fusion")).collect();
        assert!(own.iter().all(|name| may.contains(&name.as_str())), "{package} uses {own:?}");
    }
    for folder in ["kernels", "fusion-core", "models", "fusion"] {
        let found: Vec<String> = dependencies(folder);
        let wrong: Vec<_> = found.iter().filter(|name| OF_A_COMMAND.contains(&name.as_str())).collect();
        assert!(wrong.is_empty(), "{folder} uses {wrong:?}");
    }
}

/// The Rust files below a folder, without those of tests.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if stem == "tests" || stem.ends_with("_tests") {
            continue;
        }
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|end| end == "rs") {
            found.push(path);
        }
    }
}

/// The module of the crate that contains a file: the first part of its path.
fn module(file: &Path, folder: &Path) -> String {
    let inside = file.strip_prefix(folder).unwrap();
    let first = inside.components().next().unwrap().as_os_str();
    Path::new(first).file_stem().unwrap().to_str().unwrap().to_owned()
}

/// The names behind `crate::` in a text: `crate::a::B`, `crate::{a::B, c}`.
fn used(text: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for (at, _) in text.match_indices("crate::") {
        let rest = &text[at + "crate::".len()..];
        let list = rest.strip_prefix('{').and_then(|list| list.split_once("};")).map(|(list, _)| list);
        let word = |part: &str| part.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        match list {
            Some(list) => names.extend(list.split([',', '{', '}']).map(|part| word(part.trim_start()))),
            None => names.extend([word(rest)]),
        }
    }
    names
}

/// For each module, the other modules of its crate that it uses.
fn arrows(folder: &Path) -> BTreeMap<String, BTreeSet<String>> {
    let mut files = Vec::new();
    sources(folder, &mut files);
    let mut arrows: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for file in &files {
        arrows.entry(module(file, folder)).or_default();
    }
    let known: BTreeSet<String> = arrows.keys().cloned().collect();
    for file in &files {
        let own = module(file, folder);
        if own == "lib" || own == "main" {
            continue;
        }
        let text = fs::read_to_string(file).unwrap();
        // Tests are at the end of a file.
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        let code: String = text
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .map(|line| format!("{line}\n"))
            .collect();
        let others = used(&code).into_iter().filter(|name| *name != own && known.contains(name));
        arrows.entry(own.clone()).or_default().extend(others);
    }
    arrows
}

/// Repeatedly removes modules that use no remaining module. The rest are modules in cycles, and modules that use them.
fn tied(mut arrows: BTreeMap<String, BTreeSet<String>>) -> BTreeMap<String, BTreeSet<String>> {
    loop {
        let free: BTreeSet<String> = arrows
            .iter()
            .filter(|(_, uses)| uses.is_empty())
            .map(|(name, _)| name.clone())
            .collect();
        if free.is_empty() {
            return arrows;
        }
        arrows.retain(|name, _| !free.contains(name));
        for uses in arrows.values_mut() {
            uses.retain(|name| !free.contains(name));
        }
    }
}

#[test]
fn no_circle_of_modules() {
    for folder in [
        "kernels",
        "fusion-core",
        "models",
        "fusion",
        "tables",
        "judge",
        "advice",
        "present",
        "formats",
        "ros2",
        ".",
    ] {
        let tied = tied(arrows(&Path::new(ROOT).join(folder).join("src")));
        assert!(tied.is_empty(), "{folder}: {tied:#?}");
    }
}

/// The parts of a runner, and the paths that they must not name: a part gets values from its driver.
const PARTS: [(&str, &[&str]); 3] = [
    (
        "queue",
        &[
            "runner::input",
            "runner::scheduler",
            "runner::driver",
            "crate::filter",
            "crate::model",
        ],
    ),
    (
        "input",
        &[
            "runner::queue",
            "runner::scheduler",
            "runner::driver",
            "crate::filter",
            "crate::belief",
        ],
    ),
    ("scheduler", &["runner::queue", "runner::input", "runner::driver"]),
];

#[test]
fn the_parts_of_a_runner_know_each_other_by_values() {
    for (part, others) in PARTS {
        let mut files = Vec::new();
        sources(&Path::new(ROOT).join("fusion-core/src/runner").join(part), &mut files);
        assert!(!files.is_empty(), "{part}");
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            let named: Vec<_> = others.iter().filter(|other| text.contains(**other)).collect();
            assert!(named.is_empty(), "{} names {named:?}", file.display());
        }
    }
}

#[test]
fn a_circle_of_modules_is_found() {
    let arrow = |from: &str, to: &str| (from.to_owned(), BTreeSet::from([to.to_owned()]));
    let circle = BTreeMap::from([arrow("a", "b"), arrow("b", "c"), arrow("c", "b"), ("d".to_owned(), BTreeSet::new())]);
    assert_eq!(tied(circle).keys().collect::<Vec<_>>(), ["a", "b", "c"]);
    let found = used("use crate::config::{Node, Value};\nuse crate::{design, rows::{Row, Feed}};\nlet x = crate::run::run;");
    assert!(
        ["config", "design", "rows", "run"].iter().all(|name| found.contains(*name)),
        "{found:?}"
    );
}
