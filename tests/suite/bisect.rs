//! The first measurement that two runs treat differently.

use crate::support::{Workspace, stdout};

const DESIGN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps-outlier.toml");

#[test]
fn the_first_difference_of_two_variants_is_named_with_its_numbers() {
    let w = Workspace::new("bisect");
    let shown = stdout(&w.fusion(&["bisect", DESIGN, "--variant", "base,no-gate"]).code(3));
    // Without its gate the receiver's first outlier is used: until then all numbers are equal.
    assert!(shown.contains("measurements before it are equal, to the last bit"), "{shown}");
    assert!(shown.contains("verdict"), "{shown}");
    assert!(shown.contains("rejected") && shown.contains("accepted"), "{shown}");
}

#[test]
fn a_ledger_of_the_same_run_is_equal_and_the_last_digit_of_a_noise_is_found() {
    let w = Workspace::new("bisect-ledger");
    w.fusion(&["run", DESIGN, "--ledger", "old.ledger"]).success();
    let shown = stdout(&w.fusion(&["bisect", "old.ledger", DESIGN]).success());
    assert!(shown.contains("measurements are equal, to the last bit."), "{shown}");
    // A nanometre of height.
    let set = "run.origin.height=10.000000001 m";
    let shown = stdout(&w.fusion(&["bisect", "old.ledger", DESIGN, "--set", set]).code(3));
    // The compass does not see it: the first position does.
    assert!(
        shown.contains("In the second run follows") && shown.contains("`gps_position`"),
        "{shown}"
    );
    assert!(shown.contains("9.31e-10"), "{shown}");
}

#[test]
fn another_file_is_refused() {
    let w = Workspace::new("bisect-refused");
    std::fs::write(w.path("x.csv"), "t,x\n").unwrap();
    w.fusion(&["bisect", "x.csv", DESIGN]).code(2);
}
