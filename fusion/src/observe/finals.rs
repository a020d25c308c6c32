//! The parameters of the filters inside stages, at the end of a run.

use super::{Filters, Heard, RunEvent, RunObserver};
use fusion_core::belief::Belief;
use fusion_core::covariance::FormKind;
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::Halt;
use fusion_core::state::{Dynamics, Kind, Layout, StateRole};
use fusion_core::time::Time;
use serde::Serialize;

/// The state of one parameter at the end of a run.
#[derive(Clone, Debug, Serialize)]
pub struct FinalState {
    /// The block.
    pub name: String,
    /// Its kind: how its values are read.
    #[serde(skip)]
    pub kind: Kind,
    /// Its values, in storage order and SI.
    pub value: Vec<f64>,
    /// Its 1σ per tangent axis.
    pub sigma: Vec<f64>,
    /// Its initial 1σ. Empty for a parameter that decays to zero, as there is nothing to learn about it.
    #[serde(skip)]
    pub start_sigma: Vec<f64>,
    /// Its covariance in tangent coordinates, row by row.
    #[serde(skip)]
    pub covariance: Vec<f64>,
    /// Unit of a tangent coordinate.
    pub unit: &'static str,
}

impl FinalState {
    /// The state of every block of `layout` that the process does not move.
    pub fn of(layout: &Layout, last: &Belief) -> Vec<Self> {
        let parameters = layout.blocks().iter().filter(|b| b.role != StateRole::Kinematic);
        let state = |b: &fusion_core::state::Block| Self {
            name: b.name.clone(),
            kind: b.kind,
            value: last.x[b.storage_range()].to_vec(),
            sigma: last.covariance.sigmas(b).collect(),
            start_sigma: match b.dynamics {
                Dynamics::Constant | Dynamics::RandomWalk { .. } if b.role == StateRole::Calibration => b.sigma.clone(),
                _ => Vec::new(),
            },
            covariance: last.covariance.block(b),
            unit: b.unit,
        };
        parameters.map(state).collect()
    }
}

/// Keeps the last estimate of every filter inside a stage.
#[derive(Debug)]
pub struct Finals<'a> {
    filters: &'a Filters,
    /// By filter; unused for the outermost filter.
    last: Box<[Last]>,
}

/// The last estimate of a filter.
#[derive(Debug)]
enum Last {
    None,
    Told(Belief),
    /// The part that a checkpoint keeps.
    Kept(Vec<FinalState>),
}

impl<'a> Finals<'a> {
    /// Without an estimate yet.
    #[must_use]
    pub fn new(filters: &'a Filters) -> Self {
        let last = filters.iter().map(|_| Last::None).collect();
        Self { filters, last }
    }

    /// The parameters, each name after the names of its stages.
    #[must_use]
    pub fn finish(self) -> Vec<FinalState> {
        let ended = self.filters.iter().zip(&self.last);
        let states = ended.filter_map(|(filter, last)| Some((filter, last.states(filter)?)));
        let named = states.flat_map(|(filter, states)| {
            states.into_iter().map(|state| FinalState {
                name: filter.named(&state.name),
                ..state
            })
        });
        named.collect()
    }
}

impl Last {
    fn states(&self, filter: &Heard) -> Option<Vec<FinalState>> {
        match self {
            Self::None => None,
            Self::Told(belief) => Some(FinalState::of(&filter.layout, belief)),
            Self::Kept(states) => Some(states.clone()),
        }
    }

    fn remember(&mut self, filter: &Heard, tape: &mut Tape<'_>) {
        let known = self.states(filter);
        let mut is_some = known.is_some();
        is_some.remember(tape);
        let blank = || {
            FinalState::of(
                &filter.layout,
                &Belief::initial(&filter.layout, &FormKind::Joseph.form(), Time::default()),
            )
        };
        let mut states = if is_some { known.unwrap_or_else(blank) } else { Vec::new() };
        for state in &mut states {
            tape.numbers(&mut state.value);
            tape.numbers(&mut state.sigma);
            tape.numbers(&mut state.covariance);
        }
        if tape.is_reading() {
            *self = if is_some { Self::Kept(states) } else { Self::None };
        }
    }
}

impl Memory for Finals<'_> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let both = self.filters.iter().zip(&mut self.last);
        both.for_each(|(filter, last)| last.remember(filter, tape));
    }
}

impl RunObserver for Finals<'_> {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Estimate { filter, belief, .. } = event
            && !filter.is_outermost()
        {
            match &mut self.last[filter.number] {
                Last::Told(last) => last.clone_from(belief),
                other => *other = Last::Told((*belief).clone()),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solution::SolutionReader;
    use fusion_core::memory::{restore, save};

    #[test]
    fn what_a_filter_inside_a_stage_ended_with_is_remembered() {
        let nav = crate::Navigator::from_toml(
            "[process]
            type = 'attitude_only'
            source = 'inner'
            gyro_noise = 1e-2
            [initial.start]
            type = 'explicit'
            attitude = [0, 0, 0]
            attitude_sigma = 1
            [stage.inner]
            type = 'filter'
            [stage.inner.process]
            type = 'attitude_only'
            source = 'imu'
            gyro_noise = 1e-3
            gyro_bias = { estimate = true, initial = [0.01, 0, 0], sigma = 0.02 }
            [stage.inner.initial.start]
            type = 'explicit'
            attitude = [0, 0, 0]
            attitude_sigma = 1",
        );
        let nav = nav.unwrap_or_else(|d| panic!("{d}"));
        let filters = Filters::of(nav.assembly());
        let filter = filters.iter().nth(1).unwrap();
        let belief = Belief::initial(&filter.layout, &FormKind::Joseph.form(), Time::default());
        let mut finals = Finals::new(&filters);
        let (mut bytes, belief) = (Vec::new(), &belief);
        let mut reader = SolutionReader::new(&filter.layout, filter.process.clone());
        let solution = &reader.solved(belief);
        finals.on(&RunEvent::Estimate { filter, solution, belief }).unwrap();
        save(&mut finals, &mut bytes);
        let mut twin = Finals::new(&filters);
        restore(&mut twin, &bytes).unwrap();
        let mut again = Vec::new();
        save(&mut twin, &mut again);
        assert_eq!(again, bytes);
        let found = twin.finish().remove(0);
        assert_eq!((found.name.as_str(), &found.value[..]), ("inner.gyro_bias", &[0.01, 0.0, 0.0][..]));
        assert_eq!(found.sigma, [0.02; 3]);
    }
}
