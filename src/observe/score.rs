//! The score, made of the errors that are told.

use super::{RunEvent, RunObserver};
use crate::score::Scorer;
use fusion_core::runner::Halt;

impl RunObserver for Scorer {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Reference { error: Some(error), .. } = event {
            self.add(error);
        }
        Ok(())
    }
}
