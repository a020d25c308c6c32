//! The parameters of the filters inside stages, at the end of a run.

use super::{Filters, RunEvent, RunObserver};
use crate::run::FinalState;
use fusion_core::runner::Halt;
use fusion_core::state::Belief;

/// Keeps the last estimate of every filter inside a stage.
#[derive(Debug)]
pub struct Finals<'a> {
    filters: &'a Filters,
    /// By filter; none of the outermost.
    last: Vec<Option<Belief>>,
}

impl<'a> Finals<'a> {
    /// Without an estimate yet.
    #[must_use]
    pub fn new(filters: &'a Filters) -> Self {
        let last = filters.iter().map(|_| None).collect();
        Self { filters, last }
    }

    /// Their parameters, with the names of the stages before their own.
    #[must_use]
    pub fn finish(self) -> Vec<FinalState> {
        let ended = self.filters.iter().zip(&self.last);
        let states = ended.filter_map(|(filter, last)| Some((filter, FinalState::of(&filter.layout, last.as_ref()?))));
        let named = states.flat_map(|(filter, states)| {
            states.into_iter().map(|state| FinalState {
                name: filter.named(&state.name),
                ..state
            })
        });
        named.collect()
    }
}

impl RunObserver for Finals<'_> {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Estimate { filter, belief, .. } = event
            && !filter.is_outermost()
        {
            match &mut self.last[filter.number] {
                Some(last) => last.clone_from(belief),
                none => *none = Some((*belief).clone()),
            }
        }
        Ok(())
    }
}
