//! The tables on speed.

#[path = "../../examples/performance/section.rs"]
mod section;

use section::{BEGIN, END, FACTS, render, replaced};
use std::path::Path;

fn read(file: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap()
}

const MEASURED: &str = "\
# A comment.
measured: 1980-01-01
processor: 8088, 1 cores, dos x86
kernel: portable
compiler: rustc 1.0.0
profile: bench, lto = false
other/step: 2.0 s user, 2.1 s by the clock
filter/predict/n=15: composed 50 ns, dense 100 ns, ratio 0.50
filter/predict/n=21: composed 60 ns, dense 100 ns, ratio 0.60
filter/predict/n=21, Gauss-Markov: composed 70 ns, dense 100 ns, ratio 0.70
filter/unused/gate: 3 ns
filter/predict/n=15: composed 50 ns, sparse 80 ns, ratio 0.63
";

#[test]
fn the_section_on_speed_is_made_of_the_figures_that_were_measured() {
    let (figures, page) = (read("benches/figures.txt"), read("book/src/speed.md"));
    let section = render(&figures).unwrap();
    let is_made = replaced(&page, &section).unwrap() == page;
    assert!(
        is_made,
        "`cargo run --example performance -- --again` makes the tables of benches/figures.txt"
    );
    for (name, value) in figures.lines().filter_map(|line| line.split_once(": ")) {
        if FACTS.contains(&name) {
            assert!(section.contains(value), "{name}");
        }
    }
    // The steps whose ratios describe a filter.
    for name in [
        "filter/predict/n=15",
        "filter/predict/n=21",
        "kernel/predict/n=15",
        "kernel/update/m=6/n=21",
    ] {
        assert!(figures.contains(&format!("\n{name}: composed ")), "{name}");
    }
}

#[test]
fn a_line_of_figures_becomes_a_row_in_the_column_of_its_states() {
    let section = render(MEASURED).unwrap();
    let cells = |row: &str| row.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let rows: Vec<Vec<String>> = section.lines().filter(|line| line.starts_with('|')).map(cells).collect();
    let is = |k: usize, wanted: &[&str]| assert_eq!(rows[k][1..=wanted.len()], *wanted, "row {k}");
    is(0, &["step", "beside", "15 states", "21 states"]);
    is(2, &["predict", "dense", "50 ns / 100 ns = **0.50**", "60 ns / 100 ns = **0.60**"]);
    is(3, &["predict, Gauss-Markov", "dense", "", "70 ns / 100 ns = **0.70**"]);
    is(4, &["predict", "sparse", "50 ns / 80 ns = **0.63**", ""]);
    // If two groups match, the longer group is used.
    is(7, &["gate", "3 ns"]);
    // Another group is last, under its own name.
    is(10, &["step", "2.0 s user, 2.1 s by the clock"]);
    assert!(section.contains("\nother:\n"), "{section}");
    assert!(
        section
            .contains("Measured: 1980-01-01; processor: 8088, 1 cores, dos x86; kernel: portable; compiler: rustc 1.0.0; profile: bench")
    );
}

#[test]
fn what_a_section_cannot_be_made_of_is_named() {
    let without = MEASURED.replace("compiler: rustc 1.0.0\n", "");
    assert_eq!(render(&without).unwrap_err(), "there is no line `compiler: …`");
    assert_eq!(render("kernel").unwrap_err(), "this is no `name: value`: kernel");
    let text = format!("before\n{BEGIN}\nold\n{END}\nafter");
    assert_eq!(replaced(&text, "new").unwrap(), "before\nnew\nafter");
    assert!(replaced("no marks", "new").unwrap_err().contains(BEGIN));
    assert!(replaced(BEGIN, "new").unwrap_err().contains(END));
}
