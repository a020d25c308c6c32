//! Navigation filters composed from model blocks declared in TOML.
//!
//! A design is *declared* in TOML, *assembled* once and then *run*: fed row by row by a program through
//! [`Navigator`], or over its data or its simulated world through [`run`]. This is all that a vehicle needs. The
//! command `fusion` adds crates for judging, advice and presentation, which use the same calls.
//!
//! ```
//! let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
//! // A minute at rest: angular rate [rad/s] and specific force [m/s²] forward, right, down at 100 Hz; a fix
//! // [rad, rad, m] every second.
//! for k in 0..=6000 {
//!     let seconds = 0.01 * f64::from(k);
//!     nav.feed("imu", seconds, &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
//!     if k % 100 == 0 {
//!         nav.feed("gnss", seconds, &[0.63, 2.26, 50.0])?;
//!     }
//! }
//! let solution = nav.solution().ok_or("it has not started")?;
//! let (place, covariance) = solution.position.ok_or("it has no position")?;
//! // Within 3σ; the antenna is 1 m above the unit.
//! assert!((place.height - 49.0).abs() < 3.0 * covariance.m33.sqrt());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | has |
//! |---|---|
//! | [`Navigator`] | the filter inside another program |
//! | [`config`], [`design`], [`assembly`] | TOML that knows its places, what its tables mean, from a design to a runner |
//! | [`source`], [`world`], [`rows`] | recorded rows, simulated rows, rows on their way |
//! | [`mod@run`], [`observe`] | a design over its data; who hears it |
//! | [`solution`], [`health`], [`score`] | position, velocity, attitude; health with names; errors against a reference |
//! | [`output`], [`provenance`] | results as CSV files, what a run was made of |
//!
//! The estimator is [`fusion_core`], here `fusion::core`, the blocks are [`fusion_models`], here
//! `fusion::models`: their pages have the equations.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod assembly;
mod checkpoint;
pub mod config;
pub mod design;
pub mod health;
mod load;
mod navigator;
pub mod observe;
pub mod output;
pub mod provenance;
pub mod rows;
pub mod run;
pub mod score;
pub mod solution;
pub mod source;
pub mod world;

pub use design::schema;
pub use fusion_core as core;
pub use fusion_core::checkpoint::CheckpointError;
pub use fusion_models as models;
pub use fusion_models::inventory;
pub use load::{BASE, Selection};
pub use navigator::{FeedError, Navigator};
pub use run::examine;
