//! Estimates in further formats.

use crate::assembly::Assembly;
use crate::design::Design;
use crate::health::Names;
use crate::observe::{Heard, RunEvent, RunObserver, Thinning};
use crate::output::{EstimateAbout, EstimateClock, EstimateFormat, EstimateSink, FileSet, Origin, OutputFile, Unwritable};
use fusion_core::runner::{Event, Halt};
use std::io;
use std::path::PathBuf;

/// Writes the estimates of the outermost filter in another format. A run that may be resumed cannot have it.
#[derive(Debug)]
pub(super) struct FormatFile {
    path: PathBuf,
    sink: Box<dyn EstimateSink>,
    thinning: Thinning,
    names: Names,
}

impl FormatFile {
    /// Creates the file `first.ENDING` in `set`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn create(
        (set, first): (&FileSet, &str),
        format: &EstimateFormat,
        (design, assembly): (&Design, &Assembly),
        (filter, origin): (&Heard, Origin),
        thinning: Thinning,
    ) -> Result<Self, Unwritable> {
        let about = EstimateAbout {
            layout: &filter.layout,
            origin,
            clock: EstimateClock {
                time_zero: design.time_zero(),
            },
        };
        let file = set.create(&format!("{first}.{}", format.ending))?;
        let path = file.path().to_owned();
        match (format.begin)(file, &about) {
            Ok(sink) => Ok(Self {
                path,
                sink,
                thinning,
                names: Names::new(filter, assembly),
            }),
            Err(error) => Err(Unwritable { path, error }),
        }
    }

    fn write(&mut self, write: impl FnOnce(&mut dyn EstimateSink) -> io::Result<()>) -> Result<(), Halt> {
        let written = write(&mut *self.sink);
        Ok(written.map_err(|error| Unwritable {
            path: self.path.clone(),
            error,
        })?)
    }

    /// Writes the end and returns the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(super) fn finish(self) -> Result<OutputFile, Unwritable> {
        let Self { path, sink, .. } = self;
        sink.finish().map_err(|error| Unwritable { path, error })
    }
}

impl RunObserver for FormatFile {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Estimate { filter, solution, belief } if filter.is_outermost() && self.thinning.takes(belief.time) => {
                self.write(|sink| sink.write(solution, belief))
            }
            RunEvent::Filter {
                filter,
                event: Event::Health { health },
            } if filter.is_outermost() => {
                let named = health.reasons.iter().map(|reason| self.names.of(*reason));
                let reasons: Vec<(&str, String)> = named.map(|named| (named.reason, named.to_string())).collect();
                self.write(|sink| sink.health(health.since, health.state, &reasons))
            }
            _ => Ok(()),
        }
    }
}
