//! Process models: how the state moves.

mod agility;
mod attitude_only;
mod constant_velocity;
mod dead_reckoning;
mod external_attitude;
mod hold;
mod inertial;
mod kinematic;
mod planar_odometry;
pub mod strapdown;
mod strapdown_local;
mod unicycle;
mod vibration;
