//! The smoother of a run.

use super::files::Files;
use super::{Keep, Options, Smoothing};
use crate::assembly::Assembly;
use crate::config::{Diagnostic, Diagnostics};
use crate::design::Design;
use crate::observe::By;
use fusion_core::filter::{Parts, SensorModel};
use fusion_core::smoother::{FixedInterval, FixedLag, IteratedInterval, Shelf, Tape};
use fusion_core::time::nanos;

/// The data used to smooth a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Planned {
    /// The data up to this number of seconds after an estimate.
    Lag(f64),
    /// All of the log.
    Whole(Keep),
    /// All of the log, linearised at the smoothed states.
    Iterated(Keep),
    /// The same by Cholesky factorisation.
    Batch,
}

impl Planned {
    /// The requested smoothing; `None` if none is requested.
    pub(super) fn of(design: &Design, options: &Options) -> Option<Self> {
        match options.smooth {
            Smoothing::Never => None,
            Smoothing::Whole(keep) => Some(Self::Whole(keep)),
            Smoothing::Iterated(keep) => Some(Self::Iterated(keep)),
            Smoothing::Batch => Some(Self::Batch),
            Smoothing::Declared => design.run.smooth.map(|smooth| Self::Lag(smooth.lag.si())),
        }
    }

    /// The smoother itself.
    pub(super) fn by(self, design: &Design, assembly: &Assembly, files: &Files) -> Result<By, Diagnostics> {
        if design.filter.bank.is_some() {
            let error = Diagnostic::error("a bank of hypotheses cannot be smoothed: its estimate may go over to another hypothesis");
            return Err(error.help("leave out `[filter.bank]`, or the smoothing").into());
        }
        let parts = Parts::from(design.filter.backend());
        let layout = assembly.layout.clone();
        let keep = match self {
            Self::Lag(lag) => return Ok(By::Lag(Box::new(FixedLag::new(layout, &parts, nanos(lag))), lag)),
            Self::Whole(keep) | Self::Iterated(keep) => keep,
            Self::Batch => Keep::Memory,
        };
        let tape = |name: &str| -> Result<Tape, Diagnostics> {
            let shelf: Box<dyn Shelf> = match keep {
                Keep::Memory => Box::new(Vec::new()),
                Keep::Disk => Box::new(files.spill(name)?.ok_or_else(no_folder)?),
            };
            Ok(Tape::new(shelf))
        };
        if matches!(self, Self::Iterated(_) | Self::Batch) {
            let sensors = assembly.runner.sensors().iter().map(|s| SensorModel {
                model: s.model.clone(),
                offset: s.offset.as_ref().map(|offset| offset.value.clone()),
                loss: s.loss.clone(),
            });
            let mut interval = IteratedInterval::new(layout, assembly.process.clone(), &parts, sensors.collect(), tape("steps")?);
            if self == Self::Batch {
                interval = interval.by_cholesky().ok_or_else(no_cholesky)?;
            }
            return Ok(By::Iterated(Box::new(interval), tape("smoothed")?));
        }
        let interval = FixedInterval::new(layout, &parts, tape("steps")?);
        Ok(By::All(Box::new(interval), tape("smoothed")?))
    }
}

fn no_cholesky() -> Diagnostics {
    let error = Diagnostic::error("`--batch` needs a program that is built with the feature `faer`");
    error
        .help("build it with `--features faer`, or use `--smooth=iterate`, which ends at the same estimate")
        .into()
}

fn no_folder() -> Diagnostics {
    let help = "name a folder with `--out DIR`, or smooth in memory with `--smooth=memory`";
    let error = Diagnostic::error("smoothing on disk needs a folder next to the results");
    error.help(help).into()
}
