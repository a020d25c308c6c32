//! The blocks of the fusion framework: processes, sensors, stages, initialisers, gates, losses and simulated
//! worlds, as they are declared in TOML.
//!
//! A block is one file: its equation with the source at the head, a model of `fusion-core` (reads quantities, writes
//! Jacobian blocks), a *spec* (the TOML fields) and its tests. `fusion blocks NAME` shows a block. In Rust it is read and
//! built as below, and [`testing::check`] tests it against the laws of its role.
//!
//! # Equations
//!
//! The process `strapdown` navigates with an inertial unit, in north-east-down axes n over the WGS-84
//! ellipsoid; f_ib_b and w_ib_b are its specific force and angular rate, less their biases:
//!
//! ```text
//! φ̇ = vN/(RM+h)      λ̇ = vE/((RN+h) cos φ)      ḣ = −vD
//! v̇_eb_n = C_nb f_ib_b − (2 w_ie_n + w_en_n) × v_eb_n + g_n
//! Ċ_nb   = C_nb [w_nb_b ×],   w_nb_b = w_ib_b − C_nbᵀ (w_ie_n + w_en_n)
//! ```
//!
//! A sensor is h(x), its residual z ⊟ h(x) and H = ∂h/∂δ. A GNSS antenna at the lever arm l of the body
//! measures
//!
//! ```text
//! r_antenna = r ⊞ C_nb l_ba_b          v_antenna = v_eb_n + C_nb (w_ib_b × l_ba_b)
//! ```
//!
//! A parameter such as l is a constant or a state; the TOML alone decides ([`param`]). A state may be constant, a
//! random walk, or decay as a Gauss-Markov process, x⁺ = e^(−Δt/τ) x + w.
//!
//! Sources: Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2013, §5.4 and §14;
//! Titterton and Weston, *Strapdown Inertial Navigation Technology*, 2004, §3.5; Gelb, *Applied Optimal Estimation*,
//! 1974, §3.8. Every other block names its own sources.
//!
//! # Example
//!
//! A process and a sensor from TOML, composed into a filter by hand. The crate `fusion` does this for a whole design.
//!
//! ```
//! use fusion_models::block::{Build, ProcessSpec, SensorSpec};
//! use fusion_models::earth::Gravity;
//! use fusion_models::fusion_core::filter::{Backend, Estimator, Filter, Observed};
//! use fusion_models::fusion_core::gate::Open;
//! use fusion_models::fusion_core::geometry::wgs84::Geodetic;
//! use fusion_models::fusion_core::loss::Quadratic;
//! use fusion_models::fusion_core::model::Input;
//! use fusion_models::fusion_core::state::LayoutBuilder;
//! use fusion_models::fusion_core::Time;
//! use nalgebra::Vector3;
//! use std::sync::Arc;
//!
//! fusion_models::link();
//! let process: Box<dyn ProcessSpec> = toml::from_str(
//!     r#"
//!     [constant_velocity]
//!     acceleration_noise = "0.1 m/s^2/sqrt(Hz)"
//!     position_sigma = "10 m"
//!     velocity_sigma = "5 m/s"
//!     "#,
//! )?;
//! let sensor: Box<dyn SensorSpec> = toml::from_str("[gnss_position]")?;
//!
//! let origin = Geodetic::new(0.63, 2.26, 50.0);
//! let mut layout = LayoutBuilder::new();
//! let mut build = Build { name: "process", layout: &mut layout, origin: Some(origin), gravity: Gravity::default() };
//! let process = process.build(&mut build)?;
//! build.name = "fix";
//! let fix = sensor.build(&mut build)?;
//!
//! let mut filter = Filter::new(Arc::new(layout.finish()), process.into(), Backend::ERROR_STATE, fix.size());
//! let noise = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0];
//! for k in 1..=60_i32 {
//!     let seconds = f64::from(k);
//!     filter.predict(Time::from_seconds(seconds), &Input::held(&[]))?;
//!     // Three metres north and one metre east a second.
//!     let at = origin.offset(&Vector3::new(3.0 * seconds, seconds, 0.0));
//!     let value = [at.lat, at.lon, at.height];
//!     let observed = Observed { sensor: 0, model: fix.as_ref(), value: &value, noise: &noise, quality: None, derivative_input: None, lateness: None };
//!     filter.update(&observed, &mut Open, &[], &Quadratic);
//! }
//! let velocity = filter.layout().block("velocity").ok_or("there is none")?;
//! let found = &filter.belief().x[velocity.storage_range()];
//! // 1 cm/s: exact fixes, seen on an ellipsoid in place of the plane of the process.
//! assert!((found[0] - 3.0).abs() < 0.01 && (found[1] - 1.0).abs() < 0.01, "{found:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Map
//!
//! | module | has |
//! |---|---|
//! | [`process`], [`sensor`] | motion of the state; measurement models |
//! | [`stage`], [`initial`] | streams made of streams; the start of a filter |
//! | [`gate`], [`loss`], [`fault`] | policies; disturbances of a source |
//! | [`sim`] | trajectories, steered vehicles, errors of instruments |
//! | [`earth`] | gravity, rates, frames, the magnetic field |
//! | [`block`], [`registry`], [`vocabulary`] | declarations of a block; the list of blocks; well-known names |
//! | [`de`] | reads specs with little code |
//! | [`param`], [`units`] | parameters, fixed or estimated; quantities with units |
//! | [`plausible`], [`spelling`] | impossible values; suggestions for misspelt names |
//! | [`testing`] | the laws, for blocks of this crate and of others |
//!
//! Without the feature `declare` the crate needs no `std`, and has the runtime models, [`earth`] and
//! [`vocabulary::state`] only: what a program for a microcontroller links.
//!
//! Not here: no block knows an estimator, a covariance or a state index, and no block reads a file.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![cfg_attr(not(feature = "declare"), no_std)]

#[cfg_attr(not(feature = "declare"), macro_use)]
extern crate alloc;
// The derive `DeserializeSpec` names this crate.
#[cfg(feature = "declare")]
extern crate self as fusion_models;

pub mod block;
mod channel;
#[cfg(feature = "declare")]
pub mod de;
pub mod earth;
mod error;
pub mod fault;
pub mod gate;
pub mod initial;
pub mod loss;
pub mod param;
pub mod plausible;
pub mod process;
pub mod registry;
mod seed;
pub mod sensor;
pub mod sim;
pub mod solution;
pub mod spelling;
pub mod stage;
pub mod testing;
pub mod units;
pub mod vocabulary;

pub use fusion_core;
#[cfg(feature = "declare")]
pub use {inventory, schemars};

/// Links the blocks of this crate into a program; call it once, so that the linker keeps them.
pub fn link() {}
