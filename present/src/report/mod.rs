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

pub use campaign::{Look, render_campaign};
pub use page::{Run, render, write};
pub use recording::{Frame, Recording};

use fusion::config::Diagnostics;
use fusion::design::Design;
use fusion::observe::RunObserver;
use fusion::run::{Finished, Options, Progress, Run as OpenRun};

/// Runs `design` as [`run`](fusion::run::run) does, with the observers `further`, and records what a report draws. Its
/// files have no names yet.
///
/// # Errors
/// As [`run`](fusion::run::run), and the first error of an observer.
pub fn record(
    design: &Design,
    options: &Options,
    further: &mut [&mut dyn RunObserver],
    progress: &mut dyn FnMut(Progress),
) -> Result<(Finished, Recording), Diagnostics> {
    let run = OpenRun::open(design, options)?;
    let mut recording = Recording::of(design, run.assembly());
    let mut smoothed = recording.beside();
    let mut observers: Vec<&mut dyn RunObserver> = vec![&mut recording];
    further.iter_mut().for_each(|observer| observers.push(&mut **observer));
    let finished = run.go_and_smooth(&mut observers, &mut [&mut smoothed], progress)?;
    recording.smoothed = Some(Box::new(smoothed)).filter(|smoothed| smoothed.span().is_some());
    Ok((finished, recording))
}
