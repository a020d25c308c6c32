//! How long rows are held back.
//!
//! Lag        the buffer, the longest delay, and the time that followers need
//! Apart      if a follower is on another stream than its leader, all rows of one stamp must be present before the
//!            first is used. So rows are held back until a later row comes
//! Lead       if a follower on the same stream is valid before its leader, all rows up to the leader's validity must be
//!            present, to look ahead
//! Live       rows are used as they arrive: only the input holds them back

/// The delays that the consumers of rows declare \[ns\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Delays {
    /// The longest delay of any consumer, not negative.
    pub(crate) longest: i64,
    /// The delay of the process input.
    pub(crate) input: i64,
    /// How much earlier than its leader a follower on the same stream may be valid, at most.
    pub(crate) lead: i64,
    /// Whether a follower is on another stream than its leader.
    pub(crate) are_apart: bool,
    /// Whether a time of validity is estimated, under input that is still to come.
    pub(crate) are_estimated: bool,
}

/// The rule by which rows are released.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Release {
    /// How far rows may arrive out of order \[ns\].
    pub(crate) buffer: i64,
    /// Whether rows are used as they arrive.
    pub(crate) is_live: bool,
    pub(crate) delays: Delays,
}

impl Release {
    /// How long rows are held back \[ns\].
    pub(crate) fn lag(&self) -> i64 {
        let Delays {
            longest,
            input,
            lead,
            are_apart,
            ..
        } = self.delays;
        if self.is_live {
            self.buffer + input
        } else {
            self.buffer.max(i64::from(are_apart)) + longest + lead
        }
    }

    /// How far beyond the served time all rows of the process input are present, for any order of arrival \[ns\].
    pub(crate) fn foreknown(&self) -> i64 {
        (self.delays.longest + self.delays.lead - self.delays.input - 1).max(0)
    }

    /// How far ahead of the served time rows may be looked at \[ns\].
    pub(crate) fn foresight(&self) -> i64 {
        if self.delays.lead > 0 || self.delays.are_estimated {
            self.delays.longest + 2 * self.delays.lead
        } else {
            0
        }
    }
}
