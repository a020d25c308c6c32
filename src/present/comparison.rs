//! Several runs beside each other.

use super::health;
use super::judged::NEES;
use super::run::NED;
use super::sensors::{count_columns, counts, sum};
use super::tree::{Cell, Column, Section, Table};
use super::unit::Unit;
use crate::run::Summary;
use crate::score::{Convergence, Score};

/// Errors per axis, drift, what the gates did, consistency and time per epoch: a row for each run
/// with its name.
#[must_use]
pub fn sections(runs: &[(&str, &Summary)]) -> Vec<Section> {
    let drift = if runs.iter().any(|(_, s)| s.score.as_ref().is_some_and(|s| s.drift_rms.is_some())) {
        "; drift is the RMS over declared outages"
    } else {
        ""
    };
    let of_score = |columns: Vec<Column>, cells: fn(&Score) -> Vec<Cell>| {
        let mut t = Table::new(columns);
        for (name, score) in scores(runs) {
            let cells = score.map_or_else(Vec::new, cells);
            t.row([Cell::text(name)].into_iter().chain(cells));
        }
        // Where nothing is scored, names alone are left.
        (t.columns().count() > 1).then_some(t)
    };
    let position = of_score(position_columns(), position);
    let velocity = of_score(axis_columns("RMS", NED, "m/s"), |s| {
        s.velocity.map_or_else(Vec::new, |a| a.rms.map(Cell::Real).into())
    });
    let attitude = of_score(attitude_columns(), attitude);
    let convergence = of_score(convergence_columns(), convergence);
    let healths = runs.iter().filter_map(|(name, s)| Some((*name, s.health.first()?)));
    vec![
        Section::new(format!("Position against the reference{drift}"), position),
        Section::new("Velocity against the reference", velocity),
        Section::new("Attitude against the reference", attitude),
        Section::new("Within the declared limits to the end, from when on after the start", convergence),
        Section::new("Measurements of all sensors together", [measurements(runs)]),
        Section::new("Health, share of the time", [health::shares("run", healths)]),
        Section::new("Consistency (3 is expected), filter time per epoch", [consistency(runs)]),
    ]
}

/// The scores of the runs; that of its smoothed estimates follows that of a run.
fn scores<'a>(runs: &[(&'a str, &'a Summary)]) -> impl Iterator<Item = (String, Option<&'a Score>)> {
    runs.iter().flat_map(|(name, summary)| {
        let own = ((*name).to_owned(), summary.score.as_ref());
        let smoothed = summary.smoothed.as_ref().map(|s| (format!("{name}, smoothed"), s.score.as_ref()));
        [own].into_iter().chain(smoothed)
    })
}

/// The name of the run, then `RMS north [m]`, `east`, `down`.
fn axis_columns(what: &str, names: [&str; 3], unit: &str) -> Vec<Column> {
    [Column::text("run")].into_iter().chain(axes(what, names, unit)).collect()
}

fn axes(what: &str, names: [&str; 3], unit: &str) -> [Column; 3] {
    names.map(|name| Column::with_unit(format!("{what} {name}"), Unit::shown(unit)))
}

fn position_columns() -> Vec<Column> {
    let mut columns = axis_columns("RMS", ["N", "E", "D"], "m");
    columns.extend(axes("max", ["N", "E", "D"], "m"));
    columns.push(Column::with_unit("drift", Unit::of_si("m")));
    columns
}

fn position(score: &Score) -> Vec<Cell> {
    let axis = |k: usize| {
        let axes = score.position.map(|a| [a.rms, a.max].concat());
        Cell::real(axes.map(|values| values[k]))
    };
    (0..6).map(axis).chain([Cell::real(score.drift_rms)]).collect()
}

fn attitude_columns() -> Vec<Column> {
    let mut columns = axis_columns("RMS", ["roll", "pitch", "yaw"], "deg");
    columns.extend(["heading", "inclination"].map(|name| Column::with_unit(name, Unit::shown("deg"))));
    columns
}

fn attitude(score: &Score) -> Vec<Cell> {
    let Some(a) = score.attitude_deg else { return Vec::new() };
    let rotation = [score.heading_rmse_deg, score.inclination_rmse_deg].map(Cell::real);
    a.rms.map(Cell::Real).into_iter().chain(rotation).collect()
}

fn convergence_columns() -> Vec<Column> {
    vec![
        Column::text("run"),
        Column::with_unit("after", Unit::of_si("s")),
        Column::text("converged"),
    ]
}

fn convergence(score: &Score) -> Vec<Cell> {
    let Some(Convergence { converged, after }) = score.convergence else {
        return Vec::new();
    };
    let verdict = if converged { "yes" } else { "no" };
    vec![after.map_or(Cell::Empty, Cell::Seconds), Cell::text(verdict)]
}

fn measurements(runs: &[(&str, &Summary)]) -> Table {
    let counts = counts(runs.iter().flat_map(|(_, s)| &s.sensors));
    let mut t = Table::new([Column::text("run")].into_iter().chain(count_columns(&counts)));
    for (name, summary) in runs {
        let cells = counts.iter().map(|(_, count)| sum(&summary.sensors, *count));
        t.row([Cell::text(*name)].into_iter().chain(cells));
    }
    t
}

fn consistency(runs: &[(&str, &Summary)]) -> Table {
    let nees = NEES.map(Column::number);
    let backends = runs.windows(2).any(|w| w[0].1.backend != w[1].1.backend);
    let mut t = Table::new(
        [Column::text("run")]
            .into_iter()
            .chain(nees)
            .chain([Column::with_unit("epoch", Unit::shown("ns")), Column::text("backend")]),
    );
    for (name, summary) in runs {
        let of = |score: Option<&Score>| {
            let all = score.map(|s| [s.nees_position, s.nees_velocity, s.nees_attitude]);
            all.unwrap_or_default().map(|c| c.map_or(Cell::Empty, Cell::Judged))
        };
        let own = [Cell::text(*name)].into_iter().chain(of(summary.score.as_ref()));
        t.row(own.chain([
            Cell::Fixed(summary.filter_ns_per_epoch, 0),
            if backends { Cell::text(&summary.backend) } else { Cell::Empty },
        ]));
        if let Some(smoothed) = &summary.smoothed {
            let name = Cell::text(format!("{name}, smoothed"));
            t.row([name].into_iter().chain(of(smoothed.score.as_ref())));
        }
    }
    t
}
