//! Health: the filter's own judgement of its estimate, without a reference.
//!
//! A [`Monitor`] hears the events of one filter. It judges whether its sensors agree with it as well as its
//! covariance says, whether its input and its sensors are present, whether its belief is sound and its calibration
//! plausible. The [`Health`] is the worst of the [`Reason`]s that hold, and the runner reports every change as
//! [`Event::Health`](crate::runner::Event::Health).
//!
//! A monitor has bounded memory and allocates nothing once it has been made. A copy continues bit for bit as the
//! original would. It changes nothing in the filter.
//!
//! Not here: whether the estimate is *right*. An error that no sensor contradicts is not detected, such as a slow
//! common error or an error along an unobserved axis.

mod aid;
mod blocks;
mod evidence;
mod limits;
mod means;
mod monitor;
mod pulse;
#[cfg(test)]
mod tests;

use alloc::vec::Vec;
pub use limits::{Floor, Limits};
pub use monitor::{Monitor, Sign, Watched};

use crate::memory::{Memory, Tape};
use crate::stream::StreamId;
use crate::time::Time;
use core::fmt;

/// How far a filter can be believed, from the best state to the worst.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum State {
    /// Nothing contradicts the belief.
    Good,
    /// It has not started, or its attitude is still too uncertain to be linearised about.
    #[default]
    Aligning,
    /// Its input is missing: the belief moves by what is declared of the vehicle.
    Coasting,
    /// Something contradicts the belief, or a sensor is missing.
    Degraded,
    /// The belief is to be discarded.
    Lost,
}

impl State {
    /// All, from the best to the worst.
    pub const ALL: [Self; 5] = [Self::Good, Self::Aligning, Self::Coasting, Self::Degraded, Self::Lost];

    /// The name of the state.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Aligning => "aligning",
            Self::Coasting => "coasting",
            Self::Degraded => "degraded",
            Self::Lost => "lost",
        }
    }
}

impl Memory for State {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.choice(self, &Self::ALL);
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// Why a filter is not in good health.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Reason {
    /// There is no usable input.
    #[default]
    InputGap,
    /// The input has been missing for too long: the filter waits for its initialisers.
    Stopped,
    /// The filter was lost for too long and has given up: it waits for its initialisers.
    GaveUp,
    /// A step of the estimator was rejected, because its result would not have been finite.
    Refused,
    /// A number of the belief is not finite, or a variance is negative.
    Unsound,
    /// The 1σ of a kinematic block is below the declared floor.
    Floor {
        /// Number of the block in the layout.
        block: usize,
    },
    /// A calibration parameter is many of its initial 1σ away from its initial value, or a slow error many of its
    /// stationary 1σ.
    Calibration {
        /// Number of the block in the layout.
        block: usize,
    },
    /// A parameter moved by more than its covariance explains while sensors contradicted the estimate. The reason is
    /// reported until the parameter is back. It also ends when the rest of the pull, with the weight that newer
    /// measurements leave it, is within 2σ.
    Pulled {
        /// Number of the block in the layout.
        block: usize,
    },
    /// A parameter moved within a minute by many of the 1σ that it had, though no sensor contradicted the estimate:
    /// its earlier value or its present value is wrong.
    Jumped {
        /// Number of the block in the layout.
        block: usize,
    },
    /// The innovations of a sensor that are used are far larger than their covariance says.
    Innovations {
        /// The sensor's number.
        sensor: usize,
        /// Whether they are so large that the estimate does not follow the sensor at all.
        lost: bool,
    },
    /// The innovations of a sensor that are used have a mean that chance does not explain: the sensor contradicts
    /// another sensor or a model.
    Biased {
        /// The sensor's number.
        sensor: usize,
    },
    /// A sensor is being rejected, and the estimate's own σ does not grow enough to explain the residuals.
    Rejected {
        /// The sensor's number.
        sensor: usize,
        /// Whether that has lasted for long while no other sensor has held the motion along most of its axes.
        lost: bool,
    },
    /// A sensor was re-acquired against the estimate a short while ago.
    Reacquired {
        /// The sensor's number.
        sensor: usize,
    },
    /// A sensor has been silent for many of its periods.
    Silent {
        /// The sensor's number.
        sensor: usize,
        /// Others have measured each of its axes since: no measurement is missing.
        replaced: bool,
    },
    /// Position and velocity have been unmeasured along most directions for long: the belief drifts.
    Unaided,
    /// Several attitudes or angles far from each other are still possible. The estimate shows one of them.
    Undecided,
    /// A stream that stages read has been silent for many of its periods.
    StreamSilent {
        /// The stream.
        stream: StreamId,
    },
    /// The rows of a stream are stamped ahead of the process input.
    Ahead {
        /// The stream.
        stream: StreamId,
    },
}

impl Memory for Reason {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let (mut kind, mut of) = match *self {
            Self::InputGap => (0_u8, 0),
            Self::Stopped => (1, 0),
            Self::Refused => (2, 0),
            Self::Unsound => (3, 0),
            Self::Floor { block } => (4, block),
            Self::Calibration { block } => (5, block),
            Self::Pulled { block } => (6, block),
            Self::Innovations { sensor, lost } => (7 + u8::from(lost), sensor),
            Self::Rejected { sensor, lost } => (9 + u8::from(lost), sensor),
            Self::Reacquired { sensor } => (11, sensor),
            Self::Silent { sensor, replaced } => (if replaced { 16 } else { 12 }, sensor),
            Self::StreamSilent { stream } => (13, stream),
            Self::Ahead { stream } => (14, stream),
            Self::Unaided => (15, 0),
            Self::Undecided => (17, 0),
            Self::Jumped { block } => (18, block),
            Self::Biased { sensor } => (19, sensor),
            Self::GaveUp => (20, 0),
        };
        kind.remember(tape);
        of.remember(tape);
        *self = match kind {
            0 => Self::InputGap,
            1 => Self::Stopped,
            2 => Self::Refused,
            3 => Self::Unsound,
            4 => Self::Floor { block: of },
            5 => Self::Calibration { block: of },
            6 => Self::Pulled { block: of },
            7 | 8 => Self::Innovations {
                sensor: of,
                lost: kind == 8,
            },
            9 | 10 => Self::Rejected {
                sensor: of,
                lost: kind == 10,
            },
            11 => Self::Reacquired { sensor: of },
            13 => Self::StreamSilent { stream: of },
            14 => Self::Ahead { stream: of },
            15 => Self::Unaided,
            17 => Self::Undecided,
            18 => Self::Jumped { block: of },
            19 => Self::Biased { sensor: of },
            20 => Self::GaveUp,
            12 | 16 => Self::Silent {
                sensor: of,
                replaced: kind == 16,
            },
            _ => return tape.refuse("a reason does not exist"),
        };
    }
}

impl Reason {
    /// Whether a sensor contradicts the belief by single measurements; a mean of innovations pulls slowly.
    pub(crate) const fn is_contradiction(&self) -> bool {
        matches!(self, Self::Innovations { .. } | Self::Rejected { .. } | Self::Reacquired { .. })
    }

    /// The state that this reason causes.
    #[must_use]
    pub const fn state(self) -> State {
        match self {
            Self::Undecided => State::Aligning,
            Self::InputGap => State::Coasting,
            Self::Stopped | Self::GaveUp | Self::Refused | Self::Unsound => State::Lost,
            Self::Innovations { lost: true, .. } | Self::Rejected { lost: true, .. } => State::Lost,
            Self::Silent { replaced: true, .. } => State::Good,
            _ => State::Degraded,
        }
    }
}

/// The state of a filter, since when, and why.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Health {
    /// The state.
    pub state: State,
    /// The time since when this state has held for these reasons.
    pub since: Time,
    /// All reasons that hold. A *good* filter has only sensors that others replace; an *aligning* filter may also
    /// have several possible attitudes.
    pub reasons: Vec<Reason>,
}
crate::memory!(Health { state, since, reasons });

impl Health {
    /// The health before the first row.
    pub const UNKNOWN: Self = Self {
        state: State::Aligning,
        since: Time::MIN,
        reasons: Vec::new(),
    };
}
