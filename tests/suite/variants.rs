//! Variants of the shipped designs, alone and two at a time.

use fusion::assembly::{assemble, declared_streams};
use fusion::config::{Diagnostics, Document, Node};
use fusion::design::Design;
use fusion::examine::{Missing, build, opening};
use fusion::run::Options;
use fusion::world::SimulatedRows;
use std::path::{Path, PathBuf};

/// The shipped designs, in a fixed order.
fn designs() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let mut files: Vec<PathBuf> = ["", "real", "templates", "published", "backends"]
        .iter()
        .flat_map(|folder| std::fs::read_dir(root.join(folder)).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    files
}

/// Checks a design with these variants laid over it, as `fusion check` does; a recorded one is opened where its data are.
fn check(file: &Document, variants: &[&str]) -> Result<Design, Diagnostics> {
    let mut document = file.clone();
    for variant in variants {
        document.overlay(&format!("variant.{variant}"))?;
    }
    let design = build(document)?;
    opening(&design, &Options::default(), Missing::Excused).unless_errors(())?;
    let assembly = assemble(&design, declared_streams(&design)?)?;
    // One that another variant steers runs that first.
    if let Some(simulation) = design.simulation.as_ref().filter(|s| s.block.world.steered_by.is_none()) {
        SimulatedRows::new(&design, simulation, &assembly, None)?;
    }
    Ok(design)
}

/// Two that exclude each other: a fix that is held has no attitude, which range and bearing of a USBL need.
const APART: [&str; 2] = ["usbl-only", "raw-usbl"];

#[test]
fn every_two_variants_of_a_shipped_design_go_together_in_one_order_at_least() {
    let mut failures = Vec::new();
    let mut pairs = 0;
    for path in designs() {
        let file = Document::load(&path).unwrap_or_else(|d| panic!("{d}"));
        let variants = file.root().get("variant").map_or(&[][..], Node::entries);
        let names: Vec<&str> = variants.iter().map(|v| v.key.as_str()).collect();
        for (k, first) in names.iter().enumerate() {
            for second in &names[k + 1..] {
                if APART.contains(first) && APART.contains(second) {
                    continue;
                }
                pairs += 1;
                // Of two that exchange the same block, the second may have figures that mean nothing to that of the first.
                let orders = [[*first, *second], [*second, *first]].map(|pair| (pair, check(&file, &pair).err()));
                let is_wrong = orders.iter().all(|(_, mistakes)| mistakes.is_some());
                for (pair, mistakes) in orders {
                    let text = mistakes.map(|d| d.to_string()).unwrap_or_default();
                    // Where a table cannot be read, its streams are not known either.
                    let lacks_stream = text.contains("no source or stage") && !text.contains("unknown field");
                    if is_wrong || lacks_stream {
                        failures.push(format!("{} {}: {text}", path.display(), pair.join("+")));
                    }
                }
            }
        }
    }
    assert!(
        failures.is_empty() && pairs > 300,
        "{} of {pairs}:\n{}",
        failures.len(),
        failures.join("\n")
    );
}

/// A shipped design of navigators, its first minute.
fn minute(variants: &[&str], sets: &[&str]) -> Result<Design, Diagnostics> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/tracked-navigators.toml");
    let mut document = Document::load(&path).unwrap_or_else(|d| panic!("{d}"));
    for variant in variants {
        document.overlay(&format!("variant.{variant}"))?;
    }
    for set in sets.iter().chain(&["run.stop=60"]) {
        document.set(set)?;
    }
    build(document)
}

#[test]
fn a_sensor_that_is_left_out_still_times_what_another_block_reads() {
    let counts = |variants: &[&str], sets: &[&str]| -> Vec<(String, u64)> {
        let design = minute(variants, sets).unwrap_or_else(|d| panic!("{d}"));
        let summary = fusion::run::run(&design, &Options::default(), &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
        summary.sensors().iter().map(|s| (s.name.clone(), s.accepted)).collect()
    };
    let of = |counts: &[(String, u64)], name: &str| counts.iter().find(|(n, _)| n == name).map(|(_, n)| *n);
    let all = counts(&["chna-literal"], &[]);
    let without = counts(&["chna-literal"], &["sensor.usbl.enabled=false"]);
    // 0.8 Hz for a minute; depth and attitude come once per fix.
    assert!(of(&all, "depth").is_some_and(|n| n > 40), "{all:?}");
    assert_eq!(of(&without, "usbl"), None);
    assert_eq!(of(&without, "depth"), of(&all, "depth"), "{without:?}");
    assert_eq!(of(&without, "tracks"), of(&all, "tracks"));
    // A stage that only the sensor has use of is left out with it.
    let design = minute(&["chna-literal", "no-velocity"], &[]).unwrap_or_else(|d| panic!("{d}"));
    assert!(design.stages.iter().all(|stage| stage.name != "speed_at_fix"));
    assert_eq!(of(&counts(&["chna-literal", "no-velocity"], &[]), "tracks"), None);
}
