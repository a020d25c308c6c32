//! `fusion record`.

use super::{DesignArgs, Failure, print};
use clap::Args;
use fusion::world::{LOG_DESIGN, record};
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct RecordArgs {
    #[command(flatten)]
    design: DesignArgs,
    /// Where the log goes: a file for each stream, and the design that reads them; the folder is made if need be.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed of the simulated world, instead of the design's.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

/// Writes a simulated world as a log.
pub(super) fn record_world(args: &RecordArgs) -> Result<(), Failure> {
    let design = args.design.read()?;
    let mut said = String::new();
    for stream in record(&design, &args.out, args.seed)? {
        let _ = writeln!(said, "  {:<32}{:>9} rows", stream.path.display(), stream.rows);
    }
    if design.simulation.as_ref().is_some_and(|s| s.block.world.draw_start) {
        said += "\nThe filter over the log starts as declared, not at a draw about the truth.\n";
    }
    let _ = writeln!(said, "\n  fusion run {}", args.out.join(LOG_DESIGN).display());
    print(&said)
}
