//! Process models: how the state moves.

mod agility;
mod attitude_only;
mod constant_velocity;
mod external_attitude;
mod hold;
mod kinematic;
pub mod strapdown;
mod unicycle;
