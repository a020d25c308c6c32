//! The records of the iteration.

use crate::belief::Belief;
use crate::filter::{Cause, Offered, Step};
use crate::linear::Transition;
use crate::memory::{self, Memory, Tape};
use crate::model::{Gap, LastInput};
use crate::smoother::link::Link;
use crate::smoother::record::Kept;
use alloc::vec::Vec;

/// An element of a noise: row, column, value.
pub(super) type Entry = (u16, u16, f64);

/// A step, apart from any linearisation.
#[derive(Clone, Debug, Default)]
pub(super) enum Operation {
    /// A smoothed estimate is wanted here.
    #[default]
    Estimate,
    /// The filter starts at the state x̄ with the covariance P₀, of which the lower triangle is given.
    Start {
        x: Vec<f64>,
        p: Vec<f64>,
    },
    /// The process moves for a time \[s\] under an input.
    Move {
        duration: f64,
        input: LastInput,
    },
    /// The process moves through a gap from the input at its beginning. `after` is the input in force afterwards.
    Coast {
        gap: Gap,
        input: LastInput,
        after: LastInput,
    },
    /// The orientations take their values in `x`: these axes forget their past and get noise.
    Renew {
        x: Vec<f64>,
        axes: Vec<u16>,
        noise: Vec<Entry>,
    },
    /// The states get noise.
    Grow {
        noise: Vec<Entry>,
    },
    Measure(Offered),
}

crate::memory!(Offered {
    sensor,
    value,
    noise,
    derivative_input,
    input_change,
    lateness
});

impl Operation {
    const fn number(&self) -> u8 {
        match self {
            Self::Estimate => 0,
            Self::Start { .. } => 1,
            Self::Move { .. } => 2,
            Self::Coast { .. } => 3,
            Self::Renew { .. } => 4,
            Self::Grow { .. } => 5,
            Self::Measure(_) => 6,
        }
    }

    fn numbered(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Estimate,
            1 => Self::Start {
                x: Vec::new(),
                p: Vec::new(),
            },
            2 => Self::Move {
                duration: 0.0,
                input: LastInput::default(),
            },
            3 => Self::Coast {
                gap: Gap { from: 0.0, to: 0.0 },
                input: LastInput::default(),
                after: LastInput::default(),
            },
            4 => Self::Renew {
                x: Vec::new(),
                axes: Vec::new(),
                noise: Vec::new(),
            },
            5 => Self::Grow { noise: Vec::new() },
            6 => Self::Measure(Offered::default()),
            _ => return None,
        })
    }
}

impl Memory for Operation {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let (before, mut number) = (self.number(), self.number());
        number.remember(tape);
        if number != before {
            match Self::numbered(number) {
                Some(other) => *self = other,
                None => tape.refuse("there is no such step"),
            }
        }
        match self {
            Self::Estimate => {}
            Self::Start { x, p } => {
                x.remember(tape);
                p.remember(tape);
            }
            Self::Move { duration, input } => {
                duration.remember(tape);
                input.remember(tape);
            }
            Self::Coast { gap, input, after } => {
                gap.from.remember(tape);
                gap.to.remember(tape);
                input.remember(tape);
                after.remember(tape);
            }
            Self::Renew { x, axes, noise } => {
                x.remember(tape);
                axes.remember(tape);
                noise.remember(tape);
            }
            Self::Grow { noise } => noise.remember(tape),
            Self::Measure(offered) => offered.remember(tape),
        }
    }
}

/// A step in the order of the next pass: what it does, and a trajectory with a direction from it.
#[derive(Clone, Debug, Default)]
pub(super) struct Planned {
    pub(super) operation: Operation,
    /// The trajectory after the step, and d.
    pub(super) x: Vec<f64>,
    pub(super) step: Vec<f64>,
    /// ν of the trajectory, and λ.
    pub(super) dual: Vec<f64>,
    pub(super) multiplier: Vec<f64>,
    /// Qν and Qλ.
    pub(super) noise: [Vec<f64>; 2],
    /// The robust weight of a measurement at the trajectory.
    pub(super) weight: f64,
    /// The smoothed belief of a wanted estimate.
    pub(super) kept: Kept,
}

crate::memory!(Planned {
    operation,
    x,
    step,
    dual,
    multiplier,
    noise,
    weight,
    kept
});

/// A step with its linearisation, in the order of the log.
#[derive(Clone, Debug, Default)]
pub(super) struct Linear {
    pub(super) operation: Operation,
    /// The trajectory after the step, ν, and e.
    pub(super) x: Vec<f64>,
    pub(super) dual: Vec<f64>,
    pub(super) defect: Vec<f64>,
    /// Mean and covariance of the error about it, given the data before; the lower triangle.
    pub(super) mean: Vec<f64>,
    pub(super) p: Vec<f64>,
    /// Q before and after Φ.
    pub(super) before: Vec<Entry>,
    pub(super) after: Vec<Entry>,
    /// Φ, or the measurement.
    pub(super) link: Link,
    /// The factor of S, and R with the robust weight, m×m, row by row.
    pub(super) factor: Vec<f64>,
    pub(super) weighed: Vec<f64>,
    /// The residual at the trajectory; empty if the measurement is left out.
    pub(super) residual: Vec<f64>,
    /// The robust weight, and the weighted square of the residual.
    pub(super) weight: f64,
    pub(super) cost: f64,
    /// The belief of a wanted estimate about the trajectory, given the data before.
    pub(super) kept: Kept,
}

crate::memory!(Linear {
    operation,
    x,
    dual,
    defect,
    mean,
    p,
    before,
    after,
    link,
    factor,
    weighed,
    residual,
    weight,
    cost,
    kept
});

impl Planned {
    /// Becomes an empty record that keeps its memory.
    pub(super) fn clear(&mut self) {
        let [own, planned] = &mut self.noise;
        let lists = [&mut self.x, &mut self.step, &mut self.dual, &mut self.multiplier, own, planned];
        lists.into_iter().for_each(Vec::clear);
        self.weight = 0.0;
        self.kept.clear();
    }
}

impl Linear {
    /// Becomes an empty record that keeps its memory.
    pub(super) fn clear(&mut self) {
        let lists = [
            &mut self.x,
            &mut self.dual,
            &mut self.defect,
            &mut self.mean,
            &mut self.p,
            &mut self.factor,
            &mut self.weighed,
            &mut self.residual,
        ];
        lists.into_iter().for_each(Vec::clear);
        self.before.clear();
        self.after.clear();
        self.link = Link::default();
        self.kept.clear();
        (self.weight, self.cost) = (1.0, 0.0);
    }

    /// Takes Φ and Q.
    pub(super) fn moved_by(&mut self, transition: &Transition) {
        self.link.changed(&transition.phi);
        self.before.clone_from(&transition.before.entries);
        self.after.clone_from(&transition.after.entries);
    }
}

/// A step of the filter, as an [`IteratedInterval`](super::IteratedInterval) takes it.
#[derive(Clone, Debug)]
pub struct Replayed(Linear);

impl Replayed {
    /// That of a step.
    #[must_use]
    pub fn of(step: &Step) -> Self {
        let mut linear = Linear::default();
        match step {
            Step::Predicted {
                prior,
                cause,
                transition,
                posterior,
            } => {
                linear.operation = match cause {
                    Cause::Input { duration } => Operation::Move {
                        duration: *duration,
                        input: posterior.input.clone(),
                    },
                    Cause::Gap(gap) => Operation::Coast {
                        gap: *gap,
                        input: prior.input.with_motion_of(&posterior.input),
                        after: posterior.input.clone(),
                    },
                    Cause::Renewal => renewal(transition, posterior),
                };
                linear.moved_by(transition);
                at(posterior, &mut linear);
            }
            Step::Inflated { prior, posterior } => {
                let n = posterior.covariance.dim() as u16;
                let grown = |axis: usize| posterior.covariance.variance(axis) - prior.covariance.variance(axis);
                let noise = (0..n).map(|i| (i, i, grown(i.into()))).filter(|(.., grown)| *grown > 0.0).collect();
                linear.operation = Operation::Grow { noise };
                at(posterior, &mut linear);
            }
            Step::Corrected { offered, .. } => {
                linear.operation = Operation::Measure((**offered).clone());
                linear.link = Link::of(step).unwrap_or_default();
            }
        }
        Self(linear)
    }

    pub(super) fn start(belief: &Belief) -> Self {
        let mut linear = Linear::default();
        at(belief, &mut linear);
        linear.operation = Operation::Start {
            x: belief.x.clone(),
            p: linear.p.clone(),
        };
        Self(linear)
    }

    pub(super) fn estimate(belief: &Belief) -> Self {
        let mut linear = Linear::default();
        linear.kept.take(belief);
        Self(linear)
    }

    pub(super) fn write(&mut self, record: &mut Vec<u8>) {
        record.clear();
        memory::save(&mut self.0, record);
    }
}

/// The state and the covariance of `belief`.
fn at(belief: &Belief, linear: &mut Linear) {
    let mut kept = Kept::default();
    kept.take(belief);
    (linear.x, linear.p) = (kept.x, kept.p);
}

/// The axes whose past Φ removes, with the covariance that they have afterwards.
fn renewal(transition: &Transition, posterior: &Belief) -> Operation {
    let n = posterior.covariance.dim();
    let axes: Vec<u16> = (0..n as u16).filter(|&i| transition.phi.get(i.into(), i.into()) == 0.0).collect();
    let element = |i: u16, j: u16| (i, j, posterior.covariance.element(i.into(), j.into()));
    let noise = axes.iter().flat_map(|&i| axes.iter().map(move |&j| (i, j)));
    Operation::Renew {
        x: posterior.x.clone(),
        noise: noise.map(|(i, j)| element(i, j)).filter(|(.., v)| *v != 0.0).collect(),
        axes,
    }
}
