//! A stop from outside: SIGINT (Ctrl-C) and SIGTERM.
//!
//! The process ends wherever it is, a read from a silent pipe included. Files that are not whole
//! have no names yet and are removed; a set that is getting its names gets all of them first. A search
//! that asks for it ends at the first SIGINT with the best that it has found.

use super::report_line;
use fusion::output::abandon;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::register_conditional_shutdown;
use signal_hook::iterator::Signals;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// Becomes true at the first SIGINT, if a search asks for it.
static SEARCH: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From now on, the first SIGINT does not end the process: it makes this true.
pub(super) fn search() -> Arc<AtomicBool> {
    Arc::clone(SEARCH.get_or_init(Arc::default))
}

/// Becomes true at the first signal, while a design runs live.
static LIVE: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From now on, the first signal does not end the process: it makes this true.
pub(super) fn live() -> Arc<AtomicBool> {
    Arc::clone(LIVE.get_or_init(Arc::default))
}

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
        for signal in signals.forever() {
            let search = SEARCH.get().filter(|_| signal == SIGINT);
            if search.is_some_and(|is_stopped| !is_stopped.swap(true, Ordering::SeqCst)) {
                report_line("\nthe search ends with the best so far; a second Ctrl-C ends it without a result");
                continue;
            }
            if LIVE.get().is_some_and(|is_stopped| !is_stopped.swap(true, Ordering::SeqCst)) {
                report_line("\nthe run ends and writes its results; a second signal ends it at once");
                continue;
            }
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
