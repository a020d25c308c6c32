//! The documents quote the code and output that exist, and list the blocks that are registered.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

use fusion::models::registry::{self, Role};

const README: &str = include_str!("../../../README.md");
const DESIGNS: &str = include_str!("../../../book/src/designs.md");
const CONTRIBUTING: &str = include_str!("../../../CONTRIBUTING.md");

/// The text of the first code block that follows `mark`.
fn block<'a>(document: &'a str, mark: &str) -> &'a str {
    let (_, after) = document.split_once(mark).unwrap_or_else(|| panic!("no {mark:?}"));
    let (_, code) = after.split_once("```").and_then(|(_, code)| code.split_once('\n')).unwrap();
    code.split_once("```").unwrap().0
}

#[test]
fn contributing_quotes_the_block_as_it_is_compiled() {
    assert_eq!(
        block(CONTRIBUTING, "`examples/own-blocks/src/range_rate.rs`"),
        include_str!("../src/range_rate.rs")
    );
}

#[test]
fn the_quoted_block_is_as_short_as_contributing_says() {
    let code = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with("//");
    assert!(include_str!("../src/range_rate.rs").lines().filter(code).count() <= 40);
}

/// The lines of a design, without empty lines.
fn lines(design: &str) -> impl Iterator<Item = &str> {
    design.lines().filter(|line| !line.trim().is_empty())
}

#[test]
fn the_readme_quotes_a_part_of_the_embedded_design() {
    let mut whole = lines(include_str!("../../embed.toml"));
    for line in lines(block(README, "`examples/embed.toml`")) {
        assert!(whole.any(|other| other == line), "{line}");
    }
}

#[test]
fn the_book_quotes_a_diagnostic_as_it_is_printed() {
    let snapshot = include_str!("../../../tests/snapshots/unknown_key.snap");
    // After the header, which ends at the second line of dashes.
    let printed = snapshot.splitn(3, "---\n").nth(2).unwrap();
    assert!(block(DESIGNS, "## Mistakes").contains(printed.trim_end()), "{printed}");
}

#[test]
fn the_book_lists_the_registered_blocks_and_no_others() {
    fusion::models::link();
    // The chapter about live links lists links and outputs.
    for role in Role::ALL.into_iter().filter(|role| !matches!(role, Role::Link | Role::Output)) {
        let start = format!("| {} |", role.name());
        let row = DESIGNS
            .lines()
            .find(|line| line.starts_with(&start))
            .unwrap_or_else(|| panic!("no row {start:?}"));
        let mut listed: Vec<&str> = row.split('`').skip(1).step_by(2).collect();
        listed.sort_unstable();
        assert_eq!(listed, registry::names(role), "{}", role.name());
    }
}
