//! The consumers of rows, and what each of them reads.

use super::{Discard, Port, RowId};
use crate::memory::{Memory, Tape};
use crate::time::Time;

/// The name of the process as a consumer of rows.
pub(super) const PROCESS: &str = "process";

/// The consumer of a row. At one time of validity, consumers are served in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Consumer {
    #[default]
    Input,
    /// Unit, input.
    Initialiser(usize, usize),
    /// Unit, input.
    Stage(usize, usize),
    /// Switches a sensor: its number.
    Switch(usize),
    /// Finds the time of validity of a row, for a sensor with an estimated offset: its number.
    Aim(usize),
    /// Rank, number.
    Sensor(usize, usize),
}

impl Consumer {
    /// Whether it does not need rows once the filter runs.
    pub(super) const fn is_initialiser(self) -> bool {
        matches!(self, Self::Initialiser(..))
    }

    /// Served after all others of its time.
    pub(super) const LAST: Self = Self::Sensor(usize::MAX, usize::MAX);

    /// Which of its inputs it takes the row at.
    pub(super) const fn input(self) -> usize {
        match self {
            Self::Initialiser(_, input) | Self::Stage(_, input) => input,
            Self::Switch(_) => 1,
            Self::Input | Self::Aim(_) | Self::Sensor(..) => 0,
        }
    }

    /// Whether it is the sensor of this number.
    pub(super) fn is_sensor(self, number: usize) -> bool {
        matches!(self, Self::Sensor(_, s) | Self::Aim(s) if s == number)
    }
}

impl Memory for Consumer {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let (mut kind, mut of, mut input) = match *self {
            Self::Input => (0_u8, 0, 0),
            Self::Initialiser(unit, input) => (1, unit, input),
            Self::Stage(unit, input) => (2, unit, input),
            Self::Switch(sensor) => (3, sensor, 0),
            Self::Aim(sensor) => (4, sensor, 0),
            Self::Sensor(rank, sensor) => (5, sensor, rank),
        };
        kind.remember(tape);
        of.remember(tape);
        input.remember(tape);
        *self = match kind {
            0 => Self::Input,
            1 => Self::Initialiser(of, input),
            2 => Self::Stage(of, input),
            3 => Self::Switch(of),
            4 => Self::Aim(of),
            5 => Self::Sensor(input, of),
            _ => return tape.refuse("a consumer does not exist"),
        };
    }
}

/// A consumer, and what it reads of one stream.
#[derive(Clone, Debug)]
pub(super) struct Route {
    pub(super) consumer: Consumer,
    pub(super) port: Port,
    /// Whether a row that comes too late is served at once.
    pub(super) takes_late: bool,
}

/// The delays that the consumers of rows declare \[ns\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Delays {
    /// The longest delay of any consumer, not negative.
    pub(super) longest: i64,
    /// The delay of the process input.
    pub(super) input: i64,
    /// How much earlier than its leader a follower on the same stream may be valid, at most.
    pub(super) lead: i64,
    /// Whether a follower is on another stream than its leader.
    pub(super) are_apart: bool,
    /// Whether a time of validity is estimated, under input that is still to come.
    pub(super) are_estimated: bool,
}

/// A row that a consumer does not use, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refused {
    pub(super) consumer: Consumer,
    /// When it is valid.
    pub(super) time: Time,
    pub(super) row: RowId,
    pub(super) why: Discard,
}
