//! The filter of a compiled design on its vehicle. `fusion compile` writes the program that assembles it.
//!
//! A [`Vehicle`] is a runner whose blocks were built by constructors, without parser, registry and text. It allocates
//! while it is assembled and when it starts. After that, rows are fed without allocation.

#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod digest;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use fusion_core::Time;
use fusion_core::checkpoint::{CheckpointError, Of, opened, sealed};
use fusion_core::health::State as Health;
use fusion_core::memory::{self, Memory, Tape};
use fusion_core::model::Process;
use fusion_core::runner::{Observer, Row, RunError, Runner, StreamId};
use fusion_core::state::Layout;
use fusion_models::plausible::{Bounds, Impossible};
use fusion_models::solution::{Solution, SolutionReader};
use thiserror::Error;

pub use digest::Digest;
pub use fusion_core;
pub use fusion_models;
pub use nalgebra;

/// Why a row is not used.
#[derive(Debug, Error)]
pub enum FeedError {
    /// There is no such stream.
    #[error("there is no stream {stream}: the numbers are below {known}")]
    Stream {
        /// The number given.
        stream: StreamId,
        /// The number of streams.
        known: usize,
    },
    /// Nothing can have measured these numbers. Angles are in radians.
    #[error("stream {stream}, channel {channel}: {error}")]
    Impossible {
        /// The stream.
        stream: StreamId,
        /// The number of the channel.
        channel: usize,
        /// Why they are impossible.
        error: Impossible,
    },
    /// The row has another width than its stream, or the observer could not go on.
    #[error(transparent)]
    Run(#[from] RunError),
}

/// The filter of one design.
#[derive(Debug)]
pub struct Vehicle {
    runner: Runner,
    reader: Box<SolutionReader>,
    /// The number of the next row of each stream.
    counts: Vec<u64>,
    /// The possible numbers of the channels, for each stream.
    bounds: &'static [&'static [Bounds]],
    /// A hash of what the design declares for the filter.
    fingerprint: u64,
}

impl Vehicle {
    /// The vehicle of an assembled runner. `bounds` are for each stream the numbers that its channels can have,
    /// `fingerprint` is a hash of what the design declares for the filter.
    #[must_use]
    pub fn new(runner: Runner, layout: &Layout, process: Arc<dyn Process>, bounds: &'static [&'static [Bounds]], fingerprint: u64) -> Self {
        let counts = runner.streams().map(|_| 0).collect();
        Self {
            runner,
            reader: Box::new(SolutionReader::new(layout, process)),
            counts,
            bounds,
            fingerprint,
        }
    }

    /// Feeds a row of a stream, in SI with angles in radians. `observer` hears what it causes. A number that is not
    /// finite is reported as an event. Impossible values, such as a latitude in degrees, are refused.
    ///
    /// # Errors
    /// [`FeedError`]; a row that is refused changes nothing.
    pub fn feed(&mut self, stream: StreamId, time: Time, row: &[f64], observer: &mut dyn Observer) -> Result<(), FeedError> {
        let known = self.counts.len();
        let count = self.counts.get_mut(stream).ok_or(FeedError::Stream { stream, known })?;
        let bounds = self.bounds.get(stream).copied().unwrap_or_default();
        for (channel, bounds) in bounds.iter().enumerate() {
            bounds
                .check(row)
                .map_err(|error| FeedError::Impossible { stream, channel, error })?;
        }
        let row = Row {
            number: *count,
            ..Row::new(stream, time, row)
        };
        self.runner.feed(&row, observer)?;
        *count += 1;
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

    /// The solution at `time`, for a control loop that is faster than the sensors. The filter is unchanged. `None` until
    /// it has started.
    pub fn predict(&mut self, time: Time) -> Option<Solution> {
        let belief = self.runner.predicted(time)?;
        Some(*self.reader.read(&belief))
    }

    /// The whole memory of the filter. Another one of the same design that is [restored](Self::restore) from it, here or
    /// in a `Navigator` of the crate `fusion`, continues as this one would, to the bit.
    #[must_use]
    pub fn checkpoint(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        memory::save(self, &mut bytes);
        sealed(Of::Navigator, self.fingerprint, &bytes)
    }

    /// Resumes from a checkpoint, also from one of a `Navigator` of the crate `fusion`.
    ///
    /// # Errors
    /// [`CheckpointError`] if the bytes are incomplete, or belong to another design or version; the filter is unchanged.
    pub fn restore(&mut self, checkpoint: &[u8]) -> Result<(), CheckpointError> {
        let bytes = opened(Of::Navigator, self.fingerprint, checkpoint)?;
        memory::restore(self, bytes).map_err(|_| CheckpointError::Damaged)
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

impl Memory for Vehicle {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.counts.as_mut_slice().remember(tape);
        self.runner.remember(tape);
    }
}
