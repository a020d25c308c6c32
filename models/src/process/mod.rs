//! Process models: how the state moves.

pub mod agility;
pub mod attitude_only;
pub mod constant_velocity;
pub mod dead_reckoning;
pub mod external_attitude;
pub mod hold;
pub mod inertial;
pub mod kinematic;
pub mod planar_odometry;
pub mod strapdown;
pub mod strapdown_local;
pub mod unicycle;
pub mod vibration;
