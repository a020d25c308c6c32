//! How the runner serves its stages.

use super::parts::Emitted;
use super::{Emitter, Halt, Observer, Row, Runner};
use crate::time::Time;

impl Runner {
    /// Shows a stage a row of its `input`, and takes what it emits.
    pub(super) fn stage_row(&mut self, unit: usize, input: usize, time: Time, row: usize, observer: &mut dyn Observer) -> Result<(), Halt> {
        let u = &mut self.stages[unit];
        let origin = self.rows.get(row);
        u.inputs[input].gather(&origin.values, &mut self.value);
        let id = origin.id(&u.inputs[input].columns);
        let mut emitter = Emitter::new(core::mem::take(&mut self.emitted), &u.name, observer).seeing(id.number, id.disturbed);
        let view = if self.started { Some(self.estimator.view()) } else { None };
        u.stage.row(input, time, &self.value, view.as_ref(), &mut emitter);
        let emitted = emitter.finish()?;
        self.enqueue_emitted(unit, emitted, id.disturbed, observer)
    }

    /// Takes the rows that a stage has emitted.
    pub(super) fn enqueue_emitted(
        &mut self,
        unit: usize,
        emitted: Emitted,
        disturbed: bool,
        observer: &mut dyn Observer,
    ) -> Result<(), Halt> {
        let output = self.stages[unit].output;
        let everything = 0..self.streams[output].width;
        for (time, values) in emitted.rows() {
            let row = Row {
                stream: output,
                time,
                values,
                number: self.emissions[unit],
                disturbed: if disturbed { core::slice::from_ref(&everything) } else { &[] },
                arrival: None,
            };
            self.emissions[unit] += 1;
            self.enqueue(&row, self.watermark, Time::MIN, observer)?;
        }
        self.emitted = emitted;
        Ok(())
    }

    /// Notifies the stages that no row follows, and uses the rows that they still emit.
    pub(super) fn finish_stages(&mut self, observer: &mut dyn Observer) -> Result<(), Halt> {
        for unit in 0..self.stages.len() {
            let u = &mut self.stages[unit];
            let mut emitter = Emitter::new(core::mem::take(&mut self.emitted), &u.name, observer);
            u.stage.finish(&mut emitter);
            let emitted = emitter.finish()?;
            self.enqueue_emitted(unit, emitted, false, observer)?;
            self.drain(Time::MAX, observer)?;
        }
        Ok(())
    }
}
