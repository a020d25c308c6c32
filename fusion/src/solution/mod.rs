//! The navigation solution: position, velocity and attitude of any process, with their 1σ.

mod solved;
mod turning;

pub(crate) use fusion_models::solution::SolutionReader;
pub use fusion_models::solution::{Solution, rpy_of, sigmas};
pub use solved::Solved;
pub(crate) use turning::Turning;
