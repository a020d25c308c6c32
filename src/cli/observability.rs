//! `fusion check --observability`.

use super::progress::Progress;
use super::{DesignArgs, Failure, OutputArgs};
use clap::Args;
use fusion::provenance::Provenance;
use fusion::run::{Options, Smoothing};
use fusion_judge::observability::{Cause, Direction, Observability, State, observability};
use fusion_tables::{Cell, Column, Page, Section, Table, Unit, fixed, short};

#[derive(Debug, Args)]
pub(super) struct ObservabilityArgs {
    /// Shows instead what the motion lets the filter estimate: along the simulated trajectory, or along recorded data.
    #[arg(long, conflicts_with_all = ["resolved", "fix"])]
    pub(super) observability: bool,
    /// Also shows what remains without these sensors, whose updates are left out of the information. Several times for
    /// several comparisons.
    #[arg(long, value_name = "SENSOR,SENSOR", requires = "observability")]
    without: Vec<String>,
}

pub(super) fn show(args: &ObservabilityArgs, design: &DesignArgs, output: &OutputArgs) -> Result<(), Failure> {
    let (options, design) = (design.options(), design.read()?);
    let options = Options {
        smooth: Smoothing::Never,
        ..options
    };
    let list = |names: &String| names.split(',').map(|name| name.trim().to_owned()).collect();
    let without: Vec<Vec<String>> = args.without.iter().map(list).collect();
    let mut progress = Progress::new(&design);
    let found = observability(&design, &options, &without, &mut |to| progress.at(to));
    progress.finish();
    let found = found?;
    output.print(&Page {
        title: design.run.description.clone(),
        provenance: Provenance::of(&design, None),
        warnings: Vec::new(),
        sections: vec![
            Section::new("Observability", [ranks(&found)]),
            Section::new("Least known directions", [directions(&found)]).note(
                "In units of the initial σ of each state. A direction with information 1 has half of its initial variance left.",
            ),
            Section::new("States", [states(&found)]).note(
                "`left`: the smallest σ along the log, given all data, over the initial σ. `× without`: the factor by which that σ grows if no \
                 data of that segment, or of all such motion, exist.",
            ),
            Section::new("Segments", [segments(&found)]),
            Section::new("Sensors", [sensors(&found)]),
            Section::new("σ left without a sensor", [without_sensors(&found)]),
        ],
    })
}

fn ranks(found: &Observability) -> Table {
    let mut t = Table::list();
    let n = found.states.len();
    t.row(["rank", &format!("{} of {n} directions have information above 1", found.rank)]);
    let last = found.singular_values.last().copied().unwrap_or(0.0);
    t.row([
        "exact rank",
        &format!(
            "{} of {n} without process noise, in the arithmetic of the machine; last singular value {}",
            found.exact_rank,
            short(last)
        ),
    ]);
    t
}

/// A direction in words: `heading − 0.5 × gyro bias z`.
fn words(direction: &Direction, states: &[State]) -> String {
    /// A smaller component has less than 1 % of the variance of the largest.
    const SMALL: f64 = 0.1;
    let mut parts: Vec<(f64, &str)> = direction.components.iter().copied().zip(states.iter().map(|s| &*s.name)).collect();
    parts.retain(|(factor, _)| factor.abs() >= SMALL);
    parts.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let mut text = String::new();
    for (factor, name) in parts {
        let sign = match (text.is_empty(), factor < 0.0) {
            (true, _) => "",
            (false, true) => " − ",
            (false, false) => " + ",
        };
        let size = format!("{:.2}", factor.abs());
        let times = if size == "1.00" {
            String::new()
        } else {
            format!("{} × ", size.trim_end_matches('0'))
        };
        text.extend([sign, &times, name]);
    }
    text
}

fn directions(found: &Observability) -> Table {
    let mut t = Table::new([Column::number("information"), Column::text("direction")]);
    // The least known direction is shown even if all are known.
    let shown = found.directions.iter().take((found.directions.len() - found.rank).max(1));
    for direction in shown {
        t.row([Cell::Real(direction.information), Cell::text(words(direction, &found.states))]);
    }
    t
}

fn states(found: &Observability) -> Table {
    let mut t = Table::new([
        Column::text("state"),
        Column::number("initial σ"),
        Column::number("smallest σ"),
        Column::number("left"),
        Column::text("identified by"),
        Column::number("× without"),
    ]);
    for state in &found.states {
        let (by, factor) = match found.identified_by(state) {
            Some((Cause::Segment(number), factor)) => (format!("segment {}", number + 1), Cell::Ratio(factor)),
            Some((Cause::Kind(number), factor)) => (found.kinds[number].name.to_owned(), Cell::Ratio(factor)),
            None if state.is_identifiable() => ("several motions".to_owned(), Cell::Empty),
            None => ("not identifiable".to_owned(), Cell::Empty),
        };
        let cells = [
            Cell::text(&state.name),
            Cell::Real(state.sigma),
            Cell::Real(state.sigma * state.left),
            Cell::Share(state.left),
            Cell::text(by),
            factor,
        ];
        t.row_in(Unit::of_si(state.unit), cells);
    }
    t
}

fn segments(found: &Observability) -> Table {
    let second = || Unit::of_si("s");
    let mut t = Table::new([
        Column::number("segment"),
        Column::with_unit("from", second()),
        Column::with_unit("to", second()),
        Column::text("motion"),
        Column::text("identifies"),
    ]);
    let identifies = |cause: Cause| {
        let is_by_it = |state: &&State| found.identified_by(state).is_some_and(|(by, _)| by == cause);
        let names: Vec<&str> = found.states.iter().filter(is_by_it).map(|state| &*state.name).collect();
        Cell::text(names.join(", "))
    };
    for (number, segment) in found.segments.iter().enumerate() {
        t.row([
            Cell::from(number + 1),
            Cell::Seconds(segment.from),
            Cell::Seconds(segment.to),
            Cell::text(&segment.motion),
            identifies(Cause::Segment(number)),
        ]);
    }
    for (number, kind) in found.kinds.iter().enumerate() {
        let seconds = fixed(kind.seconds, 0);
        t.row([
            Cell::Empty,
            Cell::Empty,
            Cell::Empty,
            Cell::text(format!("{}, {seconds} s in all", kind.name)),
            identifies(Cause::Kind(number)),
        ]);
    }
    t
}

fn sensors(found: &Observability) -> Table {
    let mut t = Table::new([
        Column::text("sensor"),
        Column::number("used"),
        Column::number("rejected"),
        Column::text(""),
    ]);
    for sensor in &found.sensors {
        let kind = if sensor.is_constraint { "a constraint, without data" } else { "" };
        t.row([
            Cell::text(&sensor.name),
            Cell::from(sensor.used),
            Cell::from(sensor.rejected),
            Cell::text(kind),
        ]);
    }
    t
}

fn without_sensors(found: &Observability) -> Table {
    let names = found
        .without
        .iter()
        .map(|w| Column::number(format!("without {}", w.sensors.join(", "))));
    let mut t = Table::new([Column::text("state"), Column::number("all sensors")].into_iter().chain(names));
    if found.without.is_empty() {
        return t;
    }
    let ranks = [found.rank].into_iter().chain(found.without.iter().map(|w| w.rank)).map(Cell::from);
    t.row([Cell::text("rank")].into_iter().chain(ranks));
    for (k, state) in found.states.iter().enumerate() {
        let left = [state.left].into_iter().chain(found.without.iter().map(|w| w.left[k]));
        t.row([Cell::text(&state.name)].into_iter().chain(left.map(Cell::Share)));
    }
    t
}
