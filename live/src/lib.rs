//! Live links of a filter: instruments and programs while it runs.
//!
//! ```text
//! link ── Receiver, one thread each ──▶ bytes with their arrival ──▶ queue, bounded ──▶ Feed of the run
//!                                                  │                                      │  decoders of the sources
//!                                                  ▼                                      ▼  clocks
//!                                               record                                 the filter
//!                                                  │                                      │
//!                                    `fusion run --replay`             Outgoing ──▶ Output, one thread each ──▶ link
//! ```
//!
//! A source reads the bytes of a link as it reads its file, with the same declaration. The results of the
//! filter are a function of the bytes and their arrivals: a record of both gives the same results, bit for bit.
//!
//! A crate adds a link with [`LinkSpec`], and an output with [`OutputSpec`]: each is one file that registers a block.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod arrival;
mod decoder;
mod feed;
mod inbox;
mod latency;
mod leaving;
pub mod link;
pub mod output;
mod placing;
mod record;
mod relation;
mod resume;
mod run;
mod sensors;
mod speaker;
mod status;
mod table;

pub use arrival::ArrivalClock;
pub use latency::Latency;
pub use link::{Ends, LinkSpec, Received, Receiver, Sender};
pub use output::{About, Outgoing, Output, OutputSpec, SensorNow};
pub use relation::Relation;
pub use run::{Live, LiveOptions};
pub use sensors::Watch;
pub use speaker::LineListener;
pub use status::{LinkStatus, OutputStatus, SourceStatus, Status, StatusListener};

/// Links the blocks into a program; call it once, so that the linker keeps them.
pub const fn link_blocks() {}
