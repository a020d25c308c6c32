//! Consistency, one table for runs and campaigns.

use fusion::score::{BlockScore, Consistency};
use fusion_models::vocabulary::state;
use fusion_tables::{Cell, Column, Section, Table};

/// Each mean NEES or NIS with its band and verdict.
pub(super) fn consistency<'a>(statistics: impl IntoIterator<Item = (String, &'a Consistency)>) -> Section {
    let mut t = Table::new([
        Column::text("statistic"),
        Column::number("mean"),
        Column::number("expected"),
        Column::number("95 % band"),
        Column::number("errors / 1σ"),
        Column::text("verdict"),
    ]);
    for (name, c) in statistics {
        t.row([
            Cell::Text(name),
            Cell::Real(c.mean),
            Cell::from(c.dof),
            Cell::Band(c.band.0, c.band.1),
            Cell::Real(c.error_ratio()),
            Cell::verdict(c.verdict()),
        ]);
    }
    let section = Section::new("Consistency", [t]);
    if section.is_empty() {
        return section;
    }
    section.note(
        "The mean of a consistent filter lies in the band with a probability of 95 %. Above it the errors are larger \
         than the filter's covariance says (overconfident), below it they are smaller (conservative).",
    )
}

/// The names of the three NEES of a score.
pub(super) const NEES: [&str; 3] = ["NEES position", "NEES velocity", "NEES attitude"];

/// Returns true if the NEES of a block is shown in addition to those of position, velocity and attitude.
pub(super) fn is_judged_as_block(block: &BlockScore) -> bool {
    let solution = [state::POSITION.as_str(), state::VELOCITY.as_str(), state::ATTITUDE.as_str()];
    !solution.contains(&block.name.as_str())
}

/// `gyro_bias x`, or the block alone if it has one axis.
pub(super) fn axis_name(block: &BlockScore, axis: usize) -> String {
    match block.error.len() {
        1 => block.name.clone(),
        3 => format!("{} {}", block.name, ["x", "y", "z"][axis]),
        _ => format!("{} {}", block.name, axis + 1),
    }
}
