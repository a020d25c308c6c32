//! The report of a run, or of several beside each other: one HTML file that needs nothing else.
//!
//! A [`Recording`] listens to a run and keeps what is worth drawing in bounded memory; [`write()`]
//! turns one or more of them into a page with its plots, data and script inside. The page loads
//! nothing: its content security policy forbids it.
//!
//! Plots: uPlot 1.6.32 (MIT), in `vendor/`.

mod data;
mod page;
mod recording;
mod trace;

#[cfg(test)]
mod tests;

pub use page::{Run, render, write};
pub use recording::{Frame, Recording};
