//! The filter of a compiled design on its vehicle. `fusion compile` writes the program that assembles it.
//!
//! There is no parser, no registry and no text: a [`Vehicle`] is a runner whose blocks were built by constructors.
//! It allocates while it is assembled, and when it starts; after that, rows are fed without allocation.

#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod digest;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use fusion_core::Time;
use fusion_core::health::State as Health;
use fusion_core::model::Process;
use fusion_core::runner::{Observer, Row, RunError, Runner, StreamId};
use fusion_core::state::Layout;
use fusion_models::solution::{Solution, SolutionReader};

pub use digest::Digest;
pub use fusion_core;
pub use fusion_models;
pub use nalgebra;

/// The filter of one design.
#[derive(Debug)]
pub struct Vehicle {
    runner: Runner,
    reader: Box<SolutionReader>,
    /// The number of the next row of each stream.
    counts: Vec<u64>,
}

impl Vehicle {
    /// The vehicle of an assembled runner.
    #[must_use]
    pub fn new(runner: Runner, layout: &Layout, process: Arc<dyn Process>) -> Self {
        let counts = runner.streams().map(|_| 0).collect();
        Self {
            runner,
            reader: Box::new(SolutionReader::new(layout, process)),
            counts,
        }
    }

    /// Feeds a row of a stream, in SI with angles in radians. `observer` hears what it causes.
    ///
    /// # Errors
    /// A row of another width than its stream has; an error of the observer.
    pub fn feed(&mut self, stream: StreamId, time: Time, row: &[f64], observer: &mut dyn Observer) -> Result<(), RunError> {
        let number = self.counts.get(stream).copied().unwrap_or_default();
        let row = Row {
            number,
            ..Row::new(stream, time, row)
        };
        self.runner.feed(&row, observer)?;
        if let Some(count) = self.counts.get_mut(stream) {
            *count += 1;
        }
        Ok(())
    }

    /// Processes what has been held back: the end of the data.
    ///
    /// # Errors
    /// An error of the observer.
    pub fn finish(&mut self, observer: &mut dyn Observer) -> Result<(), RunError> {
        Ok(self.runner.finish(observer)?)
    }

    /// Position, velocity and attitude; `None` until the filter has started.
    pub fn solution(&mut self) -> Option<&Solution> {
        self.runner.newest().started().then(|| self.reader.read(self.runner.belief()))
    }

    /// How far the filter can be believed.
    #[must_use]
    pub fn health(&self) -> Health {
        self.runner.health().state
    }

    /// The runner.
    #[must_use]
    pub const fn runner(&self) -> &Runner {
        &self.runner
    }
}
