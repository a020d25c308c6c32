//! Navigation filters composed from model blocks declared in TOML.
//!
//! A design is *declared* in TOML, *assembled* once and then *run*: on recorded data, in
//! simulation, or fed by a program through [`Navigator`].
//!
//! ```no_run
//! let mut nav = fusion::Navigator::from_toml(&std::fs::read_to_string("design.toml")?)?;
//! nav.feed("imu", 0.01, &[0.0, 0.0, 0.0, 0.0, 0.0, -9.81])?;
//! if let Some(solution) = nav.solution() {
//!     println!("{:?}", solution.position);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod allan;
pub mod assembly;
pub mod campaign;
mod checkpoint;
pub mod config;
pub mod design;
pub mod frames;
pub mod health;
pub mod inspect;
mod navigator;
pub mod observe;
pub mod output;
pub mod present;
pub mod report;
pub mod rows;
pub mod run;
pub mod score;
pub mod solution;
pub mod source;
pub mod stress;
pub mod world;

pub use checkpoint::CheckpointError;
pub use design::schema;
pub use fusion_core as core;
pub use fusion_models as models;
pub use navigator::{FeedError, Navigator};
pub use run::examine;
