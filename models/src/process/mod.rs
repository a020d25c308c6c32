//! Process models: how the state moves.

pub mod strapdown;
