//! Several runs next to each other.

use super::health;
use super::judged::NEES;
use super::run::NED;
use super::sensors::{count_columns, counts, residual_rows, row_name, sum};
use fusion::observe::SensorStatistics;
use fusion::run::Summary;
use fusion::score::{Consistency, Convergence, Score, Travelled};
use fusion_judge::likelihood::{Terms, differences};
use fusion_tables::Unit;
use fusion_tables::{Cell, Column, Section, Table};

/// Errors per axis, drift, outcomes of the gates, consistency and time per epoch: a row for each run
/// with its name. Where a run has no reference, innovations are all that can be compared: then each
/// sensor has its counts, NIS and innovations.
#[must_use]
pub fn sections(runs: &[(&str, &Summary)]) -> Vec<Section> {
    let drift = if runs.iter().any(|(_, s)| s.score().is_some_and(|s| s.drift_rms.is_some())) {
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
        // Without a score, only the names are left.
        (t.columns().count() > 1).then_some(t)
    };
    let position = of_score(position_columns(), position);
    let horizontal = of_score(horizontal_columns(), horizontal);
    let travelled = of_score(travelled_columns(), travelled);
    let velocity = of_score(axis_columns("RMS", NED, "m/s"), |s| {
        s.velocity.map_or_else(Vec::new, |a| a.rms.map(Cell::Real).into())
    });
    let attitude = of_score(attitude_columns(), attitude);
    let convergence = of_score(convergence_columns(), convergence);
    let healths = runs.iter().filter_map(|(name, s)| Some((*name, s.health().first()?)));
    let mut sections = vec![
        Section::new(format!("Position against the reference{drift}"), position),
        Section::new("Length of the horizontal position error", horizontal),
        Section::new("Change of the horizontal position error, of the way travelled", travelled),
        Section::new("Velocity against the reference", velocity),
        Section::new("Attitude against the reference", attitude),
        Section::new("Within the declared limits to the end, from when on after the start", convergence),
    ];
    if runs.iter().all(|(_, s)| is_scored(s)) {
        sections.push(Section::new("Measurements of all sensors together", [measurements(runs)]));
    } else {
        sections.extend(by_sensor(runs));
    }
    let last = if runs.iter().any(|(_, s)| is_scored(s)) {
        "Consistency (mean over its degrees of freedom, 1 is expected), filter time per epoch"
    } else {
        "Filter time per epoch"
    };
    sections.push(Section::new("Health, share of the time", [health::shares("run", healths)]));
    sections.push(Section::new(last, [consistency(runs)]));
    sections
}

/// How much more probable each run held its measurements than the first run did.
#[must_use]
pub fn likelihood(runs: &[(&str, &Terms)]) -> Section {
    let mut t = Table::new([
        Column::text("run"),
        Column::text("sensor"),
        Column::number("rows of both"),
        Column::number("gain [nats]"),
        Column::number("its 1σ"),
    ]);
    let Some(((first, base), others)) = runs.split_first() else {
        return Section::new("", []);
    };
    for (name, terms) in others {
        for own in differences(base, terms) {
            t.row([
                Cell::text(*name),
                Cell::text(own.sensor.as_deref().unwrap_or("all")),
                Cell::from(own.rows),
                Cell::Real(own.nats),
                Cell::real(Some(own.sigma).filter(|sigma| sigma.is_finite())),
            ]);
        }
    }
    Section::new(format!("Likelihood of innovations, gain over `{first}`"), [t])
}

/// Whether there was a reference to compare estimates with.
fn is_scored(summary: &Summary) -> bool {
    summary.score().is_some_and(|s| s.epochs > 0)
}

/// The scores of the runs; that of its smoothed estimates follows that of a run.
fn scores<'a>(runs: &[(&'a str, &'a Summary)]) -> impl Iterator<Item = (String, Option<&'a Score>)> {
    runs.iter().flat_map(|(name, summary)| {
        let own = ((*name).to_owned(), summary.score());
        let smoothed = summary.smoothed().map(|s| (format!("{name}, smoothed"), s.score.as_ref()));
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
    columns.push(Column::with_unit("2D RMS", Unit::shown("m")));
    columns.push(Column::with_unit("drift", Unit::of_si("m")));
    columns
}

fn position(score: &Score) -> Vec<Cell> {
    let axis = |k: usize| {
        let axes = score.position.map(|a| [a.rms, a.max].concat());
        Cell::real(axes.map(|values| values[k]))
    };
    let horizontal = score.position.map(|_| score.horizontal_rms).filter(|v| !v.is_nan());
    (0..6)
        .map(axis)
        .chain([Cell::real(horizontal), Cell::real(score.drift_rms)])
        .collect()
}

fn horizontal_columns() -> Vec<Column> {
    let metres = ["RMS", "median", "95 %", "max"].map(|name| Column::with_unit(name, Unit::shown("m")));
    [Column::text("run")].into_iter().chain(metres).collect()
}

/// Nothing without a horizontal position.
fn horizontal(score: &Score) -> Vec<Cell> {
    let Some(spread) = score.spread.horizontal else { return Vec::new() };
    [score.horizontal_rms, spread.median, spread.p95, score.horizontal_max]
        .map(Cell::Real)
        .into()
}

fn travelled_columns() -> Vec<Column> {
    let percent = |name: &str| Column::with_unit(name, Unit::shown("%"));
    vec![
        Column::text("run"),
        Column::with_unit("way", Unit::shown("m")),
        percent("from the origin"),
        percent("reciprocal lines"),
    ]
}

fn travelled(score: &Score) -> Vec<Cell> {
    let of = |t: Travelled| [t.distance, t.from_origin_percent, t.reciprocal_percent].map(Cell::Real).into();
    score.travelled.map_or_else(Vec::new, of)
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
    let counts = counts(runs.iter().flat_map(|(_, s)| s.sensors()));
    let mut t = Table::new([Column::text("run")].into_iter().chain(count_columns(&counts)));
    for (name, summary) in runs {
        let cells = counts.iter().map(|(_, count)| sum(summary.sensors(), *count));
        t.row([Cell::text(*name)].into_iter().chain(cells));
    }
    t
}

/// The outcomes of the measurements of each sensor, and how well its innovations fit their covariance.
/// The runs of a sensor are next to each other.
fn by_sensor(runs: &[(&str, &Summary)]) -> [Section; 2] {
    let counts = counts(runs.iter().flat_map(|(_, s)| s.sensors()));
    let columns = [Column::text("sensor"), Column::text("run")];
    let nis = [Column::number("NIS over expected"), Column::text("verdict")];
    let mut measured = Table::new(columns.into_iter().chain(count_columns(&counts)).chain(nis));
    let columns = [Column::text("residual"), Column::text("run")];
    let mut innovations = Table::new(columns.into_iter().chain(["RMS", "max"].map(Column::number)));
    for name in sensor_names(runs) {
        let of_runs: Vec<(&str, &SensorStatistics)> = runs
            .iter()
            .filter_map(|(run, s)| Some((*run, s.sensors().iter().find(|s| s.name == name)?)))
            .collect();
        for (run, s) in &of_runs {
            let nis = s.nis.as_ref();
            let judged = [
                Cell::real(nis.map(Consistency::over_expected)),
                Cell::verdict(nis.and_then(Consistency::verdict)),
            ];
            let cells = counts.iter().map(|(_, count)| Cell::count(count(s)));
            measured.row([Cell::text(name), Cell::text(*run)].into_iter().chain(cells).chain(judged));
        }
        let mut residuals: Vec<Residual> = of_runs.iter().flat_map(|(run, s)| residuals(run, s)).collect();
        residuals.sort_by_key(|r| r.index);
        for Residual { unit, cells, .. } in residuals {
            innovations.row_in(unit, cells);
        }
    }
    [
        Section::new("Measurements of each sensor", [measured]),
        Section::new("Innovations of accepted measurements", [innovations]).note(ACCEPTED_ALONE),
    ]
}

/// Why the smallest innovations are not those of the best run.
const ACCEPTED_ALONE: &str = "Without a reference no run has errors. A gate that rejects more makes NIS and innovations \
    smaller, whether it was right or not: compare the counts as well, or withhold some fixes and use them as the reference.";

/// One residual row of a sensor in one run.
struct Residual {
    /// Which row of the sensor.
    index: usize,
    unit: Unit,
    /// Residual, run, RMS and maximum.
    cells: [Cell; 4],
}

/// The residual rows of a sensor that had any.
fn residuals(run: &str, s: &SensorStatistics) -> Vec<Residual> {
    if s.innovations.count == 0 {
        return Vec::new();
    }
    let of = |(index, (row, unit)): (usize, (String, Unit))| {
        let [rms, max] = [&s.innovations.rms, &s.innovations.max].map(|v| Cell::real(v.get(index).copied()));
        Residual {
            index,
            unit,
            cells: [row_name(s, &row), Cell::text(run), rms, max],
        }
    };
    residual_rows(s).into_iter().enumerate().map(of).collect()
}

/// The sensors of all runs, each once, in the order of their first mention.
fn sensor_names<'a>(runs: &[(&str, &'a Summary)]) -> Vec<&'a str> {
    let mut names = Vec::new();
    for sensor in runs.iter().flat_map(|(_, s)| s.sensors()) {
        if !names.contains(&sensor.name.as_str()) {
            names.push(sensor.name.as_str());
        }
    }
    names
}

fn consistency(runs: &[(&str, &Summary)]) -> Table {
    let nees = NEES.map(Column::number);
    let backends = runs
        .windows(2)
        .any(|w| w[0].1.computation().backend != w[1].1.computation().backend);
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
        let own = [Cell::text(*name)].into_iter().chain(of(summary.score()));
        t.row(own.chain([
            Cell::Fixed(summary.effort().filter_ns_per_epoch, 0),
            if backends {
                Cell::text(&summary.computation().backend)
            } else {
                Cell::Empty
            },
        ]));
        if let Some(smoothed) = summary.smoothed() {
            let name = Cell::text(format!("{name}, smoothed"));
            t.row([name].into_iter().chain(of(smoothed.score.as_ref())));
        }
    }
    t
}
