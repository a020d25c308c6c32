//! A bank of hypotheses, as designs declare it.

use crate::support::{Workspace, stderr};
use fusion::config::Document;
use fusion::design::Design;
use fusion::run::Options;
use fusion_judge::campaign::{Pooled, monte_carlo};
use std::path::Path;

fn ten_runs(file: &str, variants: &[&str], sets: &[&str]) -> Pooled {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
    let mut document = Document::load(&file).unwrap_or_else(|d| panic!("{d}"));
    for variant in variants {
        document.overlay(&format!("variant.{variant}")).unwrap_or_else(|d| panic!("{d:?}"));
    }
    sets.iter().for_each(|set| document.set(set).unwrap());
    let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
    let campaign = monte_carlo(&design, &Options::default(), 0..10, 1, 0, &|_| {});
    campaign.unwrap_or_else(|d| panic!("{d}")).campaign.pooled()
}

/// Of 100 runs all are right 20 s after the first true fix, and none with `nis`, 1 with `two_condition`.
#[test]
fn false_fixes_after_an_outage_capture_gates_and_no_bank() {
    let bank = ten_runs("after-outage.toml", &[], &[]);
    assert_eq!(bank.converged, Some(1.0), "{bank:?}");
    // 1σ of a fix is 0.7 m per axis.
    assert!(bank.position.is_some_and(|rms| rms < 1.0), "{bank:?}");
    for gate in ["nis", "two-condition", "student-t", "no-gate"] {
        let pooled = ten_runs("after-outage.toml", &[gate], &[]);
        assert!(pooled.converged.unwrap() <= 0.1, "{gate}: {pooled:?}");
    }
}

/// Of 50 runs whose heading is 170° wrong 70 % converge with one start, and all with twelve.
#[test]
fn twelve_headings_find_the_true_one() {
    let heading = |bank: &str| {
        let set = format!("filter.bank={bank}");
        ten_runs("backends/large-heading.toml", &["wrong-by-170"], &[&set])
            .converged
            .unwrap()
    };
    let (one, twelve) = (heading("{ hypotheses = 12 }"), heading("{ hypotheses = 12, headings = 12 }"));
    assert!(one < 1.0 && twelve == 1.0, "{one} {twelve}");
}

#[test]
fn a_bank_that_cannot_be_is_refused_at_its_place() {
    let w = Workspace::new("bank-mistakes");
    let refused = |set: &str, command: &[&str], wanted: &str| {
        let args = [command, &["design.toml", "--set", set]].concat();
        let told = stderr(&w.fusion(&args).failure());
        assert!(told.contains(wanted), "{told}");
    };
    refused(
        "sensor.gnss.gate={ type = 'hypotheses', reach = '1 km' }",
        &["check"],
        "this design has none",
    );
    refused(
        "filter.bank={ hypotheses = 3, headings = 5 }",
        &["check"],
        "a bank of 3 hypotheses cannot begin with 5 headings",
    );
    refused("filter.bank={ hypotheses = 0 }", &["check"], "1 to 100 hypotheses");
    refused(
        "filter.bank={}",
        &["run", "--smooth=memory"],
        "a bank of hypotheses cannot be smoothed",
    );
}
