//! A stop from outside: SIGINT (Ctrl-C) and SIGTERM.
//!
//! The process ends wherever it is, a read from a silent pipe included. Files that are not whole
//! have no names yet and are removed; a set that is getting its names gets all of them first.

use super::report_line;
use fusion::output::abandon;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::register_conditional_shutdown;
use signal_hook::iterator::Signals;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Ends the process at the first of these signals, with 128 and its number as the shell expects.
///
/// # Errors
/// Where the system does not let them be caught: they end the process as they always do.
pub(super) fn watch() -> std::io::Result<()> {
    let is_ending = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // A second signal does not wait for a file system that hangs.
        register_conditional_shutdown(signal, code(signal), Arc::clone(&is_ending))?;
    }
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        if let Some(signal) = signals.forever().next() {
            is_ending.store(true, Ordering::SeqCst);
            end(signal);
        }
    })?;
    Ok(())
}

const fn code(signal: i32) -> i32 {
    128 + signal
}

#[expect(clippy::exit, reason = "the other threads are anywhere in their work")]
fn end(signal: i32) -> ! {
    let name = if signal == SIGINT { "SIGINT" } else { "SIGTERM" };
    let abandoned = abandon();
    report_line(&format!("\nstopped by {name}"));
    for folder in &abandoned.folders {
        report_line(&format!("no file in {} was changed", folder.display()));
    }
    // Still held: no file is begun until the end.
    std::process::exit(code(signal))
}
