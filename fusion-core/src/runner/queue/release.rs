//! How long rows are held back.
//!
//! Lag        the buffer, the longest delay, and the time that followers need
//! Apart      if a follower is on another stream than its leader, all rows of one stamp must be present before the
//!            first is used. So rows are held back until a later row comes
//! Lead       if a follower on the same stream is valid before its leader, all rows up to the leader's validity must be
//!            present, to look ahead
//! Live       rows are used as they arrive: only the input holds them back

use crate::runner::consumer::Delays;

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
