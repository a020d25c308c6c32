//! Process models: how the state moves.

mod constant_velocity;
pub mod strapdown;
mod unicycle;
