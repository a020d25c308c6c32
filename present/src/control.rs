//! How a controlled vehicle did what it was to do.

use fusion_judge::campaign::{Campaign, Figure};
use fusion_models::sim::{Leg, Record};
use fusion_tables::Unit;
use fusion_tables::{Cell, Column, Section, Table};

/// One row per task, and what is true of them all; nothing where nothing is steered.
pub(super) fn section(record: Option<&Record>) -> Option<Section> {
    let record = record?;
    let (second, metre, angle) = (|| Unit::of_si("s"), || Unit::of_si("m"), || Unit::of_si("rad"));
    let mut legs = Table::new([
        Column::text("task"),
        Column::with_unit("from", second()),
        Column::with_unit("for", second()),
        Column::with_unit("heading RMS", angle()),
        Column::with_unit("max", angle()),
        Column::with_unit("overshoot", angle()),
        Column::with_unit("at the end", angle()),
        Column::with_unit("across RMS", metre()),
        Column::with_unit("max", metre()),
        Column::with_unit("at the end", metre()),
        Column::with_unit("end north", metre()),
        Column::with_unit("east", metre()),
    ]);
    for leg in &record.legs {
        legs.row(cells(leg));
    }
    let [north, east, _] = record.closure;
    let mut all = Table::list();
    all.row(["mission", if record.is_done { "done" } else { "not done" }]);
    all.row_in(metre(), [Cell::text("way"), Cell::Fixed(record.way, 2)]);
    all.row_in(metre(), [Cell::text("from start to end, north"), Cell::Fixed(north, 3)]);
    all.row_in(metre(), [Cell::text("from start to end, east"), Cell::Fixed(east, 3)]);
    let note = "The truth minus what was wanted; the vehicle is steered by its own estimate.";
    Some(Section::new("Control", [legs, all]).note(note))
}

fn cells(leg: &Leg) -> Vec<Cell> {
    let angle = |a: f64| Cell::Fixed(a, 2);
    let mut cells = vec![Cell::text(&leg.name), Cell::Fixed(leg.from, 1), Cell::Fixed(leg.to - leg.from, 1)];
    match &leg.heading {
        Some(h) => cells.extend([h.errors.rms, h.errors.max, h.overshoot, h.errors.last].map(angle)),
        None => cells.extend([const { Cell::Empty }; 4]),
    }
    match &leg.across {
        Some(e) => cells.extend([e.rms, e.max, e.last].map(|d| Cell::Fixed(d, 3))),
        None => cells.extend([const { Cell::Empty }; 3]),
    }
    match leg.miss {
        Some(miss) => cells.extend(miss.map(|d| Cell::Fixed(d, 3))),
        None => cells.extend([const { Cell::Empty }; 2]),
    }
    cells
}

/// The runs of a campaign together; nothing where nothing is steered.
pub(super) fn spread(campaign: &Campaign) -> Option<Section> {
    /// The names and units of [`CONTROL`](fusion_judge::campaign::CONTROL).
    const NAMES: [(&str, &str); 6] = [
        ("heading at the end of a task, largest", "rad"),
        ("overshoot of the heading, largest", "rad"),
        ("across at the end of a task, largest", "m"),
        ("from the target at the end of a task, largest", "m"),
        ("from start to end", "m"),
        ("way", "m"),
    ];
    let (missions, done) = campaign.missions;
    if missions == 0 {
        return None;
    }
    let numbers = ["mean", "standard deviation", "min", "max"].map(Column::number);
    let mut t = Table::new([Column::text("true minus wanted")].into_iter().chain(numbers));
    for (k, (name, unit)) in NAMES.into_iter().enumerate() {
        if let Some(s) = campaign.spread(Figure::Control(k)) {
            let cells = [s.mean, s.std, s.min, s.max].map(Cell::Real);
            t.row_in(Unit::of_si(unit), [Cell::text(name)].into_iter().chain(cells));
        }
    }
    let note = format!("The mission was done in {done} of {missions} runs.");
    Some(Section::new("Control, over the runs", [t]).note(note))
}
