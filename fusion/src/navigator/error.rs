//! The errors of feeding a filter.

use fusion_core::runner::{Halt, WrongWidth};
use fusion_models::plausible::Impossible;
use thiserror::Error;

/// Why a row was not taken, or the filter not listened to any more.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FeedError {
    /// No stream of that name.
    #[error("no stream is called `{name}`; there are: {known}")]
    UnknownStream {
        /// The name asked for.
        name: String,
        /// The streams there are.
        known: String,
    },
    /// A row of the wrong width.
    #[error("stream `{stream}`: {error} ({channels})")]
    Width {
        /// The stream.
        stream: String,
        /// The widths.
        error: WrongWidth,
        /// The channels of a row.
        channels: String,
    },
    /// A stamp that is not a valid time.
    #[error("stream `{stream}`: {seconds} s is not a stamp: a finite number of seconds, within 292 years of zero, is one")]
    Stamp {
        /// The stream.
        stream: String,
        /// The stamp.
        seconds: f64,
    },
    /// Numbers that nothing can have measured.
    #[error("stream `{stream}`, channel `{channel}`: {error}{}", if error.may_be_degrees() { "; angles are in radians" } else { "" })]
    Impossible {
        /// The stream.
        stream: String,
        /// The channel.
        channel: String,
        /// Why the numbers are impossible.
        error: Impossible,
    },
    /// An observer failed; the row that caused the event has been processed in part.
    #[error("{0}")]
    Observer(Halt),
}
