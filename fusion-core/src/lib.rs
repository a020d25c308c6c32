//! The estimator of the fusion framework: a state of named blocks on manifolds, prediction and update with
//! any chart, linearisation and form of P, and the order of rows in time.
//!
//! Use it where you write models and filters in Rust. To run designs in TOML take the crate `fusion`; its
//! blocks are in `fusion-models`.
//!
//! # Equations
//!
//! The belief is an estimate x̂ and the covariance P of its error δ, a vector of the tangent space
//! ([`state::Kind`]). The retraction ⊞ moves a block by an error; ⊟ is its inverse:
//!
//! ```text
//! x = x̂ ⊞ δ,   δ ~ N(0, P)
//!
//! vectors, positions, velocities   x̂ ⊞ δ = x̂ + δ
//! attitude q_nb                    q̂ ⊞ δφ_b = q̂ ⊗ Exp(δφ_b)
//! latitude, longitude, height      φ + δN/(RM+h),  λ + δE/((RN+h) cos φ),  h − δD
//! angle                            wrap(x̂ + δ) to (−π, π]
//! ```
//!
//! A process gives f, Φ = ∂(f(x) ⊟ f(x̂))/∂δ and Q; a measurement gives h and H = ∂h/∂δ. Predict:
//!
//! ```text
//! x̂ ← f(x̂, u, Δt)              P ← Φ P Φᵀ + Q
//! ```
//!
//! Update, by the default backend (single linearisation, Joseph's form):
//!
//! ```text
//! r = z ⊟ h(x̂)                 S = H P Hᵀ + R               NIS = rᵀ S⁻¹ r
//! K = P Hᵀ S⁻¹                 x̂ ← x̂ ⊞ K r
//!                              P ← (I − K H) P (I − K H)ᵀ + K R Kᵀ
//! ```
//!
//! S is factored and solved, never inverted. Between innovation and correction, a [`gate`] may
//! reject the measurement, and a [`loss`] weighs it: R ← R / w. Other charts, iteration, sigma points and factors
//! of P replace parts of this: [`filter::Backend`].
//!
//! Sources: Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, §5
//! and §10; Bucy and Joseph, *Filtering for Stochastic Processes*, 1968, for the form of P; Hertzberg et al.,
//! *Integrating generic sensor fusion algorithms with sound state representations through encapsulation of
//! manifolds*, Information Fusion 14, 2013, for ⊞ and ⊟.
//!
//! # Example
//!
//! Position and velocity on a line, an acceleration of unknown 0.1 m/s² in each second, and a position of
//! 1 m (1σ) every second. The filter settles at the gains of the α-β filter, 0.36 and 0.08.
//!
//! ```
//! use fusion_core::filter::{Backend, Estimator, Filter, Observed, Verdict};
//! use fusion_core::gate::Open;
//! use fusion_core::linear::{Jacobian, Transition};
//! use fusion_core::loss::Quadratic;
//! use fusion_core::model::{Input, Measurement, Process, Size, Undefined};
//! use fusion_core::state::{Declaration, Dynamics, LayoutBuilder, Scalar, Slot, StateRole, View};
//! use fusion_core::Time;
//! use nalgebra::Matrix1;
//! use std::sync::Arc;
//!
//! #[derive(Debug)]
//! struct Line {
//!     position: Slot<Scalar>,
//!     velocity: Slot<Scalar>,
//! }
//!
//! impl Process for Line {
//!     fn input_dim(&self) -> usize {
//!         0
//!     }
//!     fn propagate(&self, x: &mut [f64], _: &Input<'_>, dt: f64) {
//!         let moved = self.position.read(x) + self.velocity.read(x) * dt;
//!         self.position.write(&moved, x);
//!     }
//!     fn linearise(&self, _: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
//!         let (p, v, q) = (self.position, self.velocity, 0.1 * 0.1);
//!         out.set(p, v, &Matrix1::new(dt));
//!         out.noise(p, p, &Matrix1::new(q * dt.powi(4) / 4.0));
//!         out.noise(p, v, &Matrix1::new(q * dt.powi(3) / 2.0));
//!         out.noise(v, v, &Matrix1::new(q * dt.powi(2)));
//!     }
//! }
//!
//! #[derive(Debug)]
//! struct Fix(Slot<Scalar>);
//!
//! impl Measurement for Fix {
//!     fn size(&self) -> Size {
//!         Size::same(1)
//!     }
//!     fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
//!         value[0] = at.state(self.0);
//!         Ok(())
//!     }
//!     fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
//!         h.add_slot(0, self.0, &Matrix1::new(1.0));
//!         Ok(())
//!     }
//! }
//!
//! let mut layout = LayoutBuilder::new();
//! let mut declare = |name: &str, unit| {
//!     layout.declare::<Scalar>(Declaration {
//!         name: name.to_owned(),
//!         owner: "line".to_owned(),
//!         unit,
//!         initial: 0.0,
//!         sigma: vec![10.0],
//!         role: StateRole::Kinematic,
//!         dynamics: Dynamics::Process,
//!     })
//! };
//! let line = Line { position: declare("position", "m")?, velocity: declare("velocity", "m/s")? };
//! let fix = Fix(line.position);
//! let mut filter = Filter::new(Arc::new(layout.finish()), Arc::new(line), Backend::ERROR_STATE, Size::same(1));
//!
//! for k in 1..=200_i32 {
//!     filter.predict(Time::from_seconds(f64::from(k)), &Input::held(&[]))?;
//!     let (value, noise) = ([2.0 * f64::from(k)], [1.0]);
//!     let observed = Observed { sensor: 0, model: &fix, value: &value, noise: &noise, quality: None, derivative_input: None, lateness: None };
//!     let update = filter.update(&observed, &mut Open, &[], &Quadratic);
//!     assert_eq!(update.verdict, Verdict::Accepted);
//! }
//! let belief = filter.belief();
//! let p = belief.covariance.to_dense();
//! // K = P Hᵀ / R after the update; it has converged to ten digits and more.
//! assert!((p[0] - 0.36).abs() < 1e-9 && (p[1] - 0.08).abs() < 1e-9);
//! // 2 m/s, and the error of the start is forgotten.
//! assert!((belief.x[0] - 400.0).abs() < 1e-9 && (belief.x[1] - 2.0).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Map
//!
//! | module | has |
//! |---|---|
//! | [`state`] | kinds of block, layout, typed handles; manifolds of other crates |
//! | [`belief`] | state and covariance at a time |
//! | [`custom`] | charts, update rules and forms of other crates |
//! | [`model`] | the traits of a process and a measurement |
//! | [`linear`] | Φ, H and changes of chart as small blocks |
//! | [`chart`] | the error coordinates of P |
//! | [`covariance`] | P, and how its numbers are stored |
//! | [`filter`] | predict and update, update rules, a bank of several |
//! | [`gate`], [`loss`] | whether a measurement is used, and with what weight |
//! | [`runner`] | rows in order of time, delays, going back, initialisers, stages, events |
//! | [`health`], [`smoother`] | a filter's report on itself; smoothing with later data |
//! | [`consistency`] | χ² quantiles, bands of NIS and NEES |
//! | [`geometry`], [`time`], [`mod@memory`] | rotations and WGS-84; nanoseconds; internal memory, as bytes |
//! | [`math`] | sine, root, logarithm …, by the platform or by `libm` |
//! | [`testing`] | laws for your own models, charts, forms, rules, gates |
//!
//! This crate has no sensor, no file, no clock, no thread, no global generator. A run is a function of
//! its inputs.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![cfg_attr(not(feature = "std"), no_std)]

#[cfg_attr(not(feature = "std"), macro_use)]
extern crate alloc;
// The derive names this crate.
extern crate self as fusion_core;

pub mod belief;
pub mod chart;
pub mod checkpoint;
pub mod consistency;
pub mod covariance;
pub mod custom;
pub mod filter;
pub mod gate;
pub mod geometry;
pub mod health;
pub mod linear;
pub mod loss;
pub mod memory;
pub mod model;
mod printed;
pub mod runner;
pub mod smoother;
pub mod state;
pub mod stream;
#[cfg(feature = "std")]
pub mod testing;
pub mod time;

pub use fusion_kernels::math;
pub use printed::Printed;
pub use state::{Param, Quantity, Slot};
pub use time::Time;
