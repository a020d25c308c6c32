//! Lengths of the errors, and the errors of the trajectory as a whole.

use fusion::score::trajectory::Statistics;
use fusion::score::{LengthSpread, Score, Trajectory};
use fusion_core::math;
use fusion_tables::Unit;
use fusion_tables::{Cell, Column, Section, Table};

/// The definitions of ATE and RPE, and the poses that they compare.
const NOTE: &str = "ATE: distance to the reference after alignment. RPE: error of the way and of the turn from one pose to another that far \
                    along. Both as evo_ape and evo_rpe compute them.";

/// Median and 95 % of each error; absolute and relative errors of the trajectory.
pub(super) fn section(score: &Score) -> Section {
    let section = Section::new("Lengths of the errors", [spreads(score)]);
    let Some(trajectory) = score.trajectory.as_ref().filter(|t| !t.absolute.is_empty()) else {
        return section;
    };
    Section {
        tables: section.tables.into_iter().chain([errors(trajectory)]).collect(),
        ..section
    }
    .note(NOTE)
}

/// The columns of both tables.
fn columns(first: &str) -> impl Iterator<Item = Column> {
    let numbers = ["RMS", "median", "95 %"].map(Column::number);
    [Column::text(first)].into_iter().chain(numbers)
}

/// RMS, median and 95 % of the lengths.
fn spreads(score: &Score) -> Table {
    let mut t = Table::new(columns("length of the error"));
    let horizontal = score.spread.horizontal.map(|_| score.horizontal_rms);
    let speed = score.velocity.map(|a| math::sqrt(a.rms.iter().map(|rms| rms * rms).sum::<f64>()));
    let rows: [(&str, &str, Option<f64>, Option<LengthSpread>); 5] = [
        ("position", "m", score.position_rmse_m, score.spread.position),
        ("position horizontal", "m", horizontal, score.spread.horizontal),
        ("velocity", "m/s", speed, score.spread.velocity),
        ("attitude", "deg", score.rotation_rmse_deg, score.spread.rotation_deg),
        ("heading", "deg", score.heading_rmse_deg, score.spread.heading_deg),
    ];
    for (name, unit, rms, spread) in rows {
        let Some(spread) = spread else { continue };
        let numbers = [Cell::real(rms), Cell::Real(spread.median), Cell::Real(spread.p95)];
        t.row_in(Unit::shown(unit), [Cell::text(name)].into_iter().chain(numbers));
    }
    t
}

fn errors(trajectory: &Trajectory) -> Table {
    let mut t = Table::new(columns("trajectory").chain(["max", "count"].map(Column::number)));
    let mut add = |name: String, unit: &str, s: Option<&Statistics>| {
        let Some(s) = s else { return };
        let numbers = [s.rmse, s.median, s.p95, s.max].map(Cell::Real);
        let cells = [Cell::Text(name)].into_iter().chain(numbers).chain([Cell::from(s.count)]);
        t.row_in(Unit::shown(unit), cells);
    };
    let horizontal = if trajectory.horizontal { "horizontal, " } else { "" };
    for a in trajectory.absolute.iter().filter(|a| a.align == trajectory.shown) {
        let name = format!("ATE, {horizontal}{}", a.align);
        add(name.clone(), "m", Some(&a.position));
        add(name, "deg", a.rotation_deg.as_ref());
    }
    for r in &trajectory.relative {
        let name = format!("RPE over {} m", fusion_tables::short(r.distance));
        add(name.clone(), "m", Some(&r.position));
        add(name, "deg", r.rotation_deg.as_ref());
    }
    t
}
