//! The parameters at the end of a run.

use super::{Entry, Filters, Heard, Listed, RunEnd, RunEvent, RunObserver, SectionObserver, Summary};
use fusion_core::belief::Belief;
use fusion_core::covariance::FormKind;
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::Halt;
use fusion_core::state::{Block, Dynamics, Kind, Layout, StateRole};
use fusion_core::time::Time;
use schemars::JsonSchema;
use serde::Serialize;
use std::sync::Arc;

/// The state of one parameter at the end of a run.
#[derive(Clone, Debug, Serialize, JsonSchema)]
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
        let state = |b: &Block| Self {
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
        parameters(layout).map(state).collect()
    }
}

/// The blocks that the process does not move.
fn parameters(layout: &Layout) -> impl Iterator<Item = &Block> {
    layout.blocks().iter().filter(|b| b.role != StateRole::Kinematic)
}

impl Listed for FinalState {
    const NAME: &'static str = "parameters";
}

impl Summary {
    /// Estimated parameters at the end.
    #[must_use]
    pub fn parameters(&self) -> &[FinalState] {
        self.list()
    }
}

/// Makes the parameters of all filters at the end of a run. It keeps the last estimate of every filter inside a stage;
/// the runner has that of the outermost.
#[derive(Debug)]
pub(crate) struct Finals {
    /// By filter; unused for the outermost filter.
    inside: Box<[Inside]>,
}

/// A filter inside a stage.
#[derive(Debug)]
struct Inside {
    /// The names of its blocks, after the names of its stages.
    names: Vec<String>,
    layout: Arc<Layout>,
    last: Last,
}

/// The last estimate of a filter.
#[derive(Debug)]
enum Last {
    None,
    Told(Belief),
    /// The part that a checkpoint keeps.
    Kept(Vec<FinalState>),
}

impl Finals {
    /// Without an estimate yet.
    #[must_use]
    pub fn new(filters: &Filters) -> Self {
        let inside = |filter: &Heard| Inside {
            names: parameters(&filter.layout).map(|block| filter.named(&block.name)).collect(),
            layout: filter.layout.clone(),
            last: Last::None,
        };
        Self {
            inside: filters.iter().map(inside).collect(),
        }
    }

    /// Without the filters inside stages.
    #[must_use]
    pub(crate) fn of_outermost() -> Self {
        Self { inside: Box::default() }
    }

    /// The parameters of the filters inside stages, each name after the names of its stages.
    fn inside(&self) -> Vec<FinalState> {
        self.inside.iter().filter_map(Inside::named).flatten().collect()
    }
}

impl Inside {
    fn states(&self) -> Option<Vec<FinalState>> {
        match &self.last {
            Last::None => None,
            Last::Told(belief) => Some(FinalState::of(&self.layout, belief)),
            Last::Kept(states) => Some(states.clone()),
        }
    }

    fn named(&self) -> Option<Vec<FinalState>> {
        let states = self.states()?.into_iter().zip(&self.names);
        Some(
            states
                .map(|(state, name)| FinalState {
                    name: name.clone(),
                    ..state
                })
                .collect(),
        )
    }
}

impl Memory for Inside {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let known = self.states();
        let mut is_some = known.is_some();
        is_some.remember(tape);
        let blank = || {
            FinalState::of(
                &self.layout,
                &Belief::initial(&self.layout, &FormKind::Joseph.form(), Time::default()),
            )
        };
        let mut states = if is_some { known.unwrap_or_else(blank) } else { Vec::new() };
        for state in &mut states {
            tape.numbers(&mut state.value);
            tape.numbers(&mut state.sigma);
            tape.numbers(&mut state.covariance);
        }
        if tape.is_reading() {
            self.last = if is_some { Last::Kept(states) } else { Last::None };
        }
    }
}

impl Memory for Finals {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.inside.iter_mut().for_each(|filter| filter.remember(tape));
    }
}

impl RunObserver for Finals {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Estimate { filter, belief, .. } = event
            && !filter.is_outermost()
            && let Some(inside) = self.inside.get_mut(filter.number)
        {
            match &mut inside.last {
                Last::Told(last) => last.clone_from(belief),
                other => *other = Last::Told((*belief).clone()),
            }
        }
        Ok(())
    }
}

impl SectionObserver for Finals {
    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt> {
        let runner = &end.assembly.runner;
        let mut parameters = if runner.started() {
            FinalState::of(&end.assembly.layout, runner.belief())
        } else {
            Vec::new()
        };
        parameters.extend(self.inside());
        Ok(parameters.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solution::{SolutionReader, Solved};
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
        let solution = &Solved::new(&mut reader, belief);
        finals.on(&RunEvent::Estimate { filter, solution, belief }).unwrap();
        save(&mut finals, &mut bytes);
        let mut twin = Finals::new(&filters);
        restore(&mut twin, &bytes).unwrap();
        let mut again = Vec::new();
        save(&mut twin, &mut again);
        assert_eq!(again, bytes);
        let found = twin.inside().remove(0);
        assert_eq!((found.name.as_str(), &found.value[..]), ("inner.gyro_bias", &[0.01, 0.0, 0.0][..]));
        assert_eq!(found.sigma, [0.02; 3]);
    }
}
