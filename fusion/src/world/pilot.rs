//! A vehicle that is not steered by the filter of the run, but by another variant of the design. That variant runs
//! first, and its commands are repeated.

use super::simulated::{SimulatedRows, drawn_start};
use crate::assembly::{assemble, declared_streams};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, SimulationDesign};
use crate::load::build;
use crate::navigator::{FeedError, Navigator};
use crate::rows::Row;
use fusion_core::runner::Event;
use fusion_models::sim::{REFERENCE, Script};

/// The name of the design itself among its variants.
const BASE: &str = "base";

/// The commands of the variant that steers the vehicle of `design`; `None` if the design steers it itself.
///
/// # Errors
/// The variant does not exist, leaves the steering to another variant, or has mistakes.
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
            "`{name}` does not steer the vehicle itself: it leaves that to another variant, by its own `steered_by`"
        )));
    };
    let mut rows = SimulatedRows::new(&pilot, own, &assemble(&pilot, declared_streams(&pilot)?)?, seed)?;
    let mut aboard = filter(&pilot, own, seed)?;
    while let Some(row) = rows.next(&mut aboard) {
        hear(&mut aboard, &row).map_err(|e| mistake(format!("`{name}`, which steers the vehicle: {e}")))?;
    }
    Ok(rows.script())
}

/// The filter that steers the vehicle of `design` itself; `None` if nothing is steered, or if another variant steers.
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
