//! From raw rows of any format to rows of the log: stamps, channels, validity, bad rows.
//!
//! A format implements [`RawRows`] and declares its table by `format_spec!`, which adds the keys
//! that are decoded here. See `source/csv/` for the first, `decode/tests.rs` for the smallest.
//!
//! Order    of the tests on a row: number in the file (`keep`), form, `valid`, stamp, time order, jumps of
//!          time (`max_jump`), `start` and `stop`, the cells that channels read, `repeats`. Cells that no channel
//!          reads are never looked at
//! Order    of a channel's arithmetic: sign, unit, `scale`, root of a variance, `offset`, increment
//!          to rate, rotation, mean with the previous sample
//! Interval of an increment: since the previous stamp in the file, whether its row is used or not. With a `rate`:
//!          since the previous valid row, or 1/`rate` in the first row, after an unreadable stamp and if the gap
//!          exceeds 1.5 intervals. With `interval = "nominal"`: always 1/`rate`
//! Memory   one row; if its stamp jumps ahead, this row and the next 20
//! Not here decimal commas

mod ahead;
mod channel;
mod clock;
mod condition;
mod header_unit;
mod instant;
mod judge;
mod jump;
mod one_or_many;
mod plan;
mod raw;
mod spec;
mod stream;
#[cfg(test)]
mod tests;

pub use crate::format_spec;
pub(super) use clock::decimal_nanos;
pub use instant::{Origin, Scale};
pub(super) use instant::{unix_of_gps, utc_text};
pub use one_or_many::OneOrMany;
pub use plan::Plan;
pub use raw::{Cell, Malformed, RawRows};
pub(crate) use spec::have_rows_in_common;
pub(super) use spec::time_spec;
pub use spec::{
    ChannelSpec, Condition, Epoch, Interval, Keep, OwnTimeSpec, PlusSpec, Policy, Repeats, RowSpec, Stamp, Ties, TimeSpec, Timing, Wanted,
};
