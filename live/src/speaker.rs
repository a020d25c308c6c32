//! Lines about events, such as a link that is lost.

use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::Builder;

/// Hears a line about an event.
pub type LineListener = Arc<dyn Fn(&str) + Send + Sync>;

/// Lines that wait for a listener that is slow. Further ones are dropped.
const WAITING: usize = 64;

/// Passes lines to their listener, which hears them in its own thread: no speaker waits for it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Speaker(Option<SyncSender<String>>);

impl Speaker {
    /// # Errors
    /// The system has no more threads.
    pub(crate) fn new(listener: Option<LineListener>) -> std::io::Result<Self> {
        let Some(listener) = listener else {
            return Ok(Self::default());
        };
        let (to, lines) = sync_channel::<String>(WAITING);
        let body = move || lines.iter().for_each(|line| listener(&line));
        Builder::new().name("lines".to_owned()).spawn(body)?;
        Ok(Self(Some(to)))
    }

    pub(crate) fn say(&self, line: String) {
        if let Some(to) = &self.0 {
            // A listener that is slow misses it.
            let _ = to.try_send(line);
        }
    }
}
