//! Who steers the vehicle where it is not the filter that is run: another variant of the design, which runs
//! first, and whose commands are given again.

use super::simulated::{SimulatedRows, drawn_start};
use crate::assembly::{assemble, declared_streams};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, SimulationDesign};
use crate::load::build;
use crate::navigator::{FeedError, Navigator};
use crate::rows::Row;
use fusion_core::runner::Event;
use fusion_models::sim::{REFERENCE, Script};

/// What the design itself is called among its variants.
const BASE: &str = "base";

/// The commands that the variant which steers the vehicle of `design` gives, where it is another one.
///
/// # Errors
/// There is no such variant, it is steered by another one itself, or its own mistakes.
pub(super) fn script(design: &Design, simulation: &Named<SimulationDesign>, seed: Option<u64>) -> Result<Option<Script>, Diagnostics> {
    let Some(name) = &simulation.block.world.steered_by else {
        return Ok(None);
    };
    let place = simulation.node.place_of("steered_by");
    let mistake = |message: String| Diagnostics::from(Diagnostic::error(message).at(place));
    let mut document = design.document.base();
    if name != BASE {
        let unknown = |_| mistake(format!("no variant is called `{name}`"));
        document.overlay(&format!("variant.{name}")).map_err(unknown)?;
    }
    let mut pilot = build(document)?;
    if let Some(kernel) = design.filter.kernel {
        pilot.set_kernel(kernel);
    }
    let Some(own) = pilot.simulation.as_ref().filter(|s| s.block.world.steered_by.is_none()) else {
        return Err(mistake(format!(
            "`{name}` does not steer the vehicle itself: it leaves that to another variant, by a `steered_by` of its own"
        )));
    };
    let mut rows = SimulatedRows::new(&pilot, own, &assemble(&pilot, declared_streams(&pilot)?)?, seed)?;
    let mut aboard = filter(&pilot, own, seed)?;
    while let Some(row) = rows.next(&mut aboard) {
        hear(&mut aboard, &row).map_err(|e| mistake(format!("`{name}`, which steers the vehicle: {e}")))?;
    }
    Ok(rows.script())
}

/// The filter that steers the vehicle of `design` itself; none where nothing is steered, or another variant steers.
///
/// # Errors
/// Mistakes of the declared world.
pub(super) fn aboard(design: &Design, simulation: &Named<SimulationDesign>, seed: Option<u64>) -> Result<Option<Navigator>, Diagnostics> {
    let world = &simulation.block.world;
    if world.vehicle.is_none() || world.steered_by.is_some() {
        return Ok(None);
    }
    filter(design, simulation, seed).map(Some)
}

/// Gives the filter a row, as a run does: the truth is not for it.
///
/// # Errors
/// A row that it cannot read.
pub(super) fn hear(aboard: &mut Navigator, row: &Row<'_>) -> Result<(), FeedError> {
    if aboard.streams()[row.stream].name == REFERENCE {
        return Ok(());
    }
    aboard.feed_row(row, &mut |_: &Event<'_>| {})
}

/// The filter of `design`, started as in a run of it.
fn filter(design: &Design, simulation: &Named<SimulationDesign>, seed: Option<u64>) -> Result<Navigator, Diagnostics> {
    let mut assembly = assemble(design, declared_streams(design)?)?;
    let drawn = drawn_start(design, simulation, &assembly, seed)?;
    drawn.into_iter().for_each(|unit| assembly.runner.add_initialiser(unit));
    Ok(Navigator::from_assembly(assembly))
}
