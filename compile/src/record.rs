//! The rows of a run, for a compiled filter to replay.

use core::fmt;
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Smoothing, run_sharing};
use fusion_core::runner::Halt;
use fusion_models::sim::SharedCourse;
use fusion_vehicle::Digest;
use std::io::Write;

/// Runs a design and writes all rows that reach its filter, in their order. Returns the number of its estimates and their
/// hash, which a compiled filter has after these rows if the design has the kernel `portable`.
///
/// A row is little-endian: the number of its stream as u32, its stamp in nanoseconds as i64, its numbers as f64.
///
/// # Errors
/// The mistakes of the run; a world that draws the start of the filter, which a compiled filter cannot know; errors of
/// `out`.
pub fn record(design: &Design, options: Options, out: &mut dyn Write) -> Result<Digest, Diagnostics> {
    if let Some(simulation) = design.simulation.as_ref().filter(|s| s.block.world.draw_start) {
        let key = simulation.node.get("draw_start").unwrap_or(&simulation.node);
        let error = Diagnostic::error("the simulated world draws the start of the filter, which no row says").at(key.place());
        return Err(error.help("add `--set simulation.draw_start=false`").into());
    }
    let options = Options {
        smooth: Smoothing::Never,
        ..options
    };
    let mut recorder = Recorder {
        out,
        digest: Digest::default(),
    };
    run_sharing(design, &options, &SharedCourse::default(), &mut [&mut recorder])?;
    let digest = recorder.digest;
    out.flush()
        .map_err(|e| Diagnostic::error(format!("the rows cannot be written: {e}")))?;
    Ok(digest)
}

/// Hears a run.
struct Recorder<'a> {
    out: &'a mut dyn Write,
    digest: Digest,
}

impl fmt::Debug for Recorder<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recorder").field("digest", &self.digest).finish_non_exhaustive()
    }
}

impl RunObserver for Recorder<'_> {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Row(row) => {
                self.out.write_all(&u32::try_from(row.stream)?.to_le_bytes())?;
                self.out.write_all(&row.time.nanos().to_le_bytes())?;
                for value in row.values {
                    self.out.write_all(&value.to_le_bytes())?;
                }
            }
            RunEvent::Estimate { filter, belief, .. } if filter.number == 0 => self.digest.add(belief),
            _ => {}
        }
        Ok(())
    }
}
