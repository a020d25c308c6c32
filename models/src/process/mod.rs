//! Process models: how the state moves.

mod constant_velocity;
mod hold;
pub mod strapdown;
mod unicycle;
