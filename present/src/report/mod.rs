//! The report of a run, or of several runs next to each other: one HTML file that needs nothing else.
//!
//! A [`Recording`] observes a run and keeps the data to draw in bounded memory; [`write()`] turns one or
//! more recordings into a page that contains its plots, data and script. The page loads nothing: its
//! content security policy forbids it.
//!
//! Plots: uPlot 1.6.32 (MIT), in `vendor/`.

mod campaign;
mod consistency;
mod data;
mod intervals;
mod page;
mod parameters;
mod path;
mod recording;
mod sensor;
mod table;
mod trace;

#[cfg(test)]
mod tests;

pub use campaign::{Look, render_campaign, worst_first};
pub use page::{Run, render, write};
pub use recording::{Frame, Recording};

use fusion::config::Diagnostics;
use fusion::design::Design;
use fusion::run::{Finished, Options, Progress, Run as OpenRun};

/// Runs `design` as [`run`](fusion::run::run) does, and records what a report draws. Its files have
/// no names yet.
///
/// # Errors
/// As [`run`](fusion::run::run).
pub fn record(design: &Design, options: &Options, progress: &mut dyn FnMut(Progress)) -> Result<(Finished, Recording), Diagnostics> {
    let run = OpenRun::open(design, options)?;
    let mut recording = Recording::of(design, run.assembly());
    let mut smoothed = recording.beside();
    let finished = run.go_and_smooth(&mut [&mut recording], &mut [&mut smoothed], progress)?;
    recording.smoothed = Some(Box::new(smoothed)).filter(|smoothed| smoothed.span().is_some());
    Ok((finished, recording))
}
