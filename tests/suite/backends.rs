//! Every combination of chart, update, form and reset that has a meaning, on a shipped design; and what
//! `check` says to those that have none.

use crate::support::{DESIGN, Workspace};
use fusion::config::{Diagnostic, Document};
use fusion::design::{Design, FilterSpec};
use fusion::run::{Options, Summary, run};
use predicates::str::contains;

const DESIGN_WITH_ALL: &str = "configs/ins-gps-outlier.toml";

fn of(words: &str) -> Summary {
    let mut document = Document::load(std::path::Path::new(DESIGN_WITH_ALL)).unwrap_or_else(|d| panic!("{d}"));
    document.set(&FilterSpec::table_of(words).unwrap()).unwrap();
    // Alignment, the first leg with its turn, and a few of the outliers.
    document.set("run.stop=150 s").unwrap();
    let design = Design::read(document).unwrap_or_else(|d| panic!("{words}: {d}"));
    run(&design, &Options::default(), &mut |_| {}).unwrap_or_else(|d| panic!("{words}: {d}"))
}

/// Position errors that are known as well as those of the design's own backend.
fn agrees(words: &str, wanted: &Summary) {
    let found = of(words);
    let errors = |s: &Summary| s.score().unwrap().position.unwrap().rms;
    for (found, wanted) in errors(&found).into_iter().zip(errors(wanted)) {
        // 1 %: the corrections of this design are small, where all backends are one filter to first order.
        assert!((found / wanted - 1.0).abs() < 0.01, "{words}: {found} m instead of {wanted} m");
    }
    let used = |s: &Summary| s.sensors().iter().map(|s| s.accepted).sum::<u64>();
    // Two of thousands: a NIS near its threshold.
    assert!(used(&found).abs_diff(used(wanted)) <= 2, "{words}");
}

#[test]
fn every_combination_that_has_a_meaning_runs_a_shipped_design() {
    let wanted = of("error_state");
    let charts = [
        "additive_euler",
        "additive_quaternion",
        "body",
        "navigation",
        "right_invariant",
        "left_invariant",
    ];
    let updates = ["single", "iterated", "unscented"];
    for chart in charts {
        for update in updates {
            agrees(&format!("{chart}+{update}"), &wanted);
        }
        agrees(&format!("{chart}+full"), &wanted);
    }
    for chart in ["right_invariant", "left_invariant"] {
        agrees(&format!("{chart}+two_frames"), &wanted);
        agrees(&format!("{chart}+two_frames+iterated"), &wanted);
    }
}

#[test]
fn combinations_without_a_meaning_are_refused_with_the_reason() {
    let w = Workspace::new("backends");
    let refused = |table: &str, what: &str| {
        w.write("design.toml", format!("{DESIGN}\n[filter]\n{table}\n"));
        let ran = w.fusion(&["check", "design.toml"]).code(2);
        ran.stderr(contains(what)).stderr(contains("design.toml:")).stderr(contains("help"));
    };
    refused("biases = \"two_frames\"", "`biases` belongs to an invariant chart");
    refused("iterations = 5", "`iterations` belongs to the iterated update");
    refused("tolerance = 0.1", "`tolerance` belongs to the iterated update");
    refused("spread = { alpha = 0.1 }", "`spread` belongs to the unscented update");
    refused("update = \"outright\"\nprotect_calibrations = true", "protects nothing");
    refused("update = \"iterated\"\niterations = 0", "at least 1 step");
    refused("update = \"iterated\"\ntolerance = -1.0", "must be finite and at least 0");
    refused("update = \"iterated\"\nreset = \"plain\"", "always carries the covariance");
    refused("update = \"unscented\"\nform = \"standard\"", "no meaning for sigma points");
    refused(
        "update = \"unscented\"\nspread = { alpha = 2.0, beta = 2.0 }",
        "may give a negative variance",
    );
    refused("backend = \"invariant\"", "needs an attitude or a heading");
    w.write(
        "design.toml",
        format!("{DESIGN}\n[filter]\nupdate = \"unscented\"\nspread = {{ alpha = 0.1 }}\n"),
    );
    w.fusion(&["check", "design.toml"]).success();
}

#[test]
fn a_backend_is_named_by_a_preset_and_its_axes() {
    assert_eq!(FilterSpec::table_of("ekf").unwrap(), r#"filter={ backend = "ekf" }"#);
    assert_eq!(
        FilterSpec::table_of("left_invariant+iterated+joseph+two_frames").unwrap(),
        r#"filter={ chart = "left_invariant", update = "iterated", form = "joseph", biases = "two_frames" }"#
    );
    let told = |e: Diagnostic| format!("{e:?}");
    let mistake = told(FilterSpec::table_of("ekf+iterrated").unwrap_err());
    assert!(
        mistake.contains("`iterrated`") && mistake.contains("did you mean `iterated`?"),
        "{mistake}"
    );
    assert!(told(FilterSpec::table_of("xyz").unwrap_err()).contains("right_invariant"));
}
