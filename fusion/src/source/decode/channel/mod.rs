//! A channel: which cells it is made of, and what is done with them.

mod convert;
mod form;
mod plan;
mod rotation;
mod turns;

pub(super) use convert::Wrong;
pub(super) use plan::ChannelPlan;
