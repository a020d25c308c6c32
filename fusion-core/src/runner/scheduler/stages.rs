//! The stages: they see rows, and emit rows.

use crate::memory::{Memory, Tape};
use crate::runner::parts::Emitted;
use crate::runner::rows::Stored;
use crate::runner::{Emitter, Halt, Observer, StageUnit, StreamId};
use crate::state::View;
use crate::time::Time;
use alloc::vec::Vec;

/// Rows that a stage has emitted.
#[derive(Debug)]
pub(crate) struct Emission {
    /// The stream that the stage feeds.
    pub(crate) stream: StreamId,
    /// Whether a declared fault changed the row that caused them.
    pub(crate) is_disturbed: bool,
    /// The rows that the stage has emitted before.
    before: u64,
    rows: Emitted,
}

impl Emission {
    /// The rows: how many the stage has emitted before, when each is valid, and its values.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (u64, Time, &[f64])> {
        let numbered = (self.before..).zip(self.rows.rows());
        numbered.map(|(number, (time, values))| (number, time, values))
    }
}

/// The stages, in order of their numbers.
#[derive(Debug, Default)]
pub(super) struct Stages {
    units: Vec<StageUnit>,
    /// Rows that each stage has emitted so far.
    emissions: Vec<u64>,
    emitted: Emitted,
    value: Vec<f64>,
}

impl Memory for Stages {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.units.iter_mut().for_each(|unit| unit.stage.remember(tape));
        self.emissions.as_mut_slice().remember(tape);
    }
}

impl Stages {
    /// Adds a stage that emits rows of `width` numbers.
    pub(super) fn add(&mut self, stage: StageUnit, width: usize) {
        // The buffers are empty: room for the first rows.
        let widest = stage.inputs.iter().map(|port| port.columns.len()).max();
        self.value.reserve(widest.unwrap_or_default());
        self.emitted.reserve(width);
        self.units.push(stage);
        self.emissions.push(0);
    }

    pub(super) fn units(&self) -> &[StageUnit] {
        &self.units
    }

    /// Shows a stage a row of its `input`, with the estimate if there is one.
    pub(super) fn row(
        &mut self,
        (unit, input): (usize, usize),
        time: Time,
        row: &Stored,
        view: Option<&View<'_>>,
        observer: &mut dyn Observer,
    ) -> Result<Emission, Halt> {
        let u = &mut self.units[unit];
        u.inputs[input].gather(row.values(), &mut self.value);
        let id = row.id(&u.inputs[input].columns);
        let mut emitter = Emitter::new(core::mem::take(&mut self.emitted), &u.name, observer).seeing(id.number, id.disturbed);
        u.stage.row(input, time, &self.value, view, &mut emitter);
        let rows = emitter.finish()?;
        Ok(self.emission(unit, id.disturbed, rows))
    }

    /// Notifies a stage that the process input is silent up to `time`.
    pub(super) fn silence(&mut self, unit: usize, time: Time, view: &View<'_>, observer: &mut dyn Observer) -> Result<Emission, Halt> {
        let u = &mut self.units[unit];
        let mut emitter = Emitter::new(core::mem::take(&mut self.emitted), &u.name, observer);
        u.stage.silence(time, view, &mut emitter);
        let rows = emitter.finish()?;
        Ok(self.emission(unit, false, rows))
    }

    /// Notifies a stage that no row follows.
    pub(super) fn finish(&mut self, unit: usize, observer: &mut dyn Observer) -> Result<Emission, Halt> {
        let u = &mut self.units[unit];
        let mut emitter = Emitter::new(core::mem::take(&mut self.emitted), &u.name, observer);
        u.stage.finish(&mut emitter);
        let rows = emitter.finish()?;
        Ok(self.emission(unit, false, rows))
    }

    fn emission(&mut self, unit: usize, is_disturbed: bool, rows: Emitted) -> Emission {
        let before = self.emissions[unit];
        self.emissions[unit] += rows.count();
        Emission {
            stream: self.units[unit].output,
            is_disturbed,
            before,
            rows,
        }
    }

    /// Takes the memory of rows that are queued.
    pub(super) fn give_back(&mut self, emission: Emission) {
        self.emitted = emission.rows;
    }
}
