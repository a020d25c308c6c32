//! The progress that a run reports over recorded files.

use super::support::{DESIGN, Workspace};
use fusion::config::Document;
use fusion::design::Design;
use fusion::run::{Options, run};
use std::fmt::Write;

/// Rows of each file: some 800 kB. Readers read less than a quarter of it ahead.
const ROWS: u32 = 20_000;

/// Fixes of a vehicle at rest.
fn rest() -> String {
    (0..ROWS).fold("t,lat,lon,h,vn,ve,vd\n".to_owned(), |mut text, k| {
        let _ = writeln!(text, "{k}.0,47.0000000,8.0000000,400.0,0.0,0.0,0.0");
        text
    })
}

/// The progress shares that a run of `design` reports.
fn shares(workspace: &Workspace, design: &str) -> Vec<f64> {
    let (document, found) = Document::parse("design.toml", design);
    assert!(found.is_empty(), "{found:?}");
    let design = Design::read(document).unwrap_or_else(|e| panic!("{e}"));
    let options = Options {
        data: Some(workspace.path("")),
        ..Options::default()
    };
    let mut told = Vec::new();
    run(&design, &options, &mut |to| told.push(to.share.unwrap())).unwrap_or_else(|e| panic!("{e}"));
    told
}

/// Each report covers up to a quarter of the rows, and a reader reads up to a quarter ahead.
fn grow_to_the_end(told: &[f64]) {
    assert!(told.len() >= 4, "{told:?}");
    assert!(told.is_sorted(), "{told:?}");
    assert!(told[0] > 0.0 && told[0] < 0.45, "{told:?}");
    assert!(told[told.len() - 1] > 0.8 && told[told.len() - 1] <= 1.0, "{told:?}");
}

#[test]
fn the_share_that_is_read_grows_to_the_end_of_the_files() {
    let workspace = Workspace::new("progress");
    workspace.write("gnss.csv", rest());
    grow_to_the_end(&shares(&workspace, DESIGN));
}

#[test]
fn a_reference_that_is_read_ahead_is_no_progress() {
    let workspace = Workspace::new("progress-reference");
    for file in ["gnss.csv", "truth.csv"] {
        workspace.write(file, rest());
    }
    let truth = DESIGN.split_once("[source.gnss]").unwrap().1.split_once("[variant").unwrap().0;
    let truth = truth.replace("source.gnss", "source.truth").replace("gnss.csv", "truth.csv");
    let design = format!("{DESIGN}\n[source.truth]{truth}\n[reference]\nsource = \"truth\"\n");
    grow_to_the_end(&shares(&workspace, &design));
}

#[test]
fn what_is_left_out_before_the_start_is_progress() {
    let workspace = Workspace::new("progress-start");
    workspace.write("gnss.csv", rest());
    let late = DESIGN.replacen("[run]", "[run]\nstart = \"19990 s\"", 1);
    grow_to_the_end(&shares(&workspace, &late));
}
