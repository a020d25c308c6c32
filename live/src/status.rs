//! The state of links, sources and outputs, for those who watch a live run.

use crate::feed::Fed;
use crate::inbox::Counts;
use crate::latency::Latency;
use crate::leaving::Mailbox;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// The state of a live run.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Status {
    /// The links, in their order in the design.
    pub links: Vec<LinkStatus>,
    /// The sources that links feed.
    pub sources: Vec<SourceStatus>,
    /// The outputs.
    pub outputs: Vec<OutputStatus>,
    /// From the arrival of a row to the estimate with it.
    pub latency: Latency,
}

/// The state of a link.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LinkStatus {
    /// Its name.
    pub name: String,
    /// Bytes received so far.
    pub bytes: u64,
    /// Bytes that were dropped, because too many waited for the filter.
    pub dropped: u64,
    /// How often it was opened.
    pub opened: u64,
    /// Why it is not open now.
    pub trouble: Option<String>,
    /// The line of the link about itself.
    pub about: Option<String>,
}

/// The state of a source.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SourceStatus {
    /// Its name.
    pub name: String,
    /// Rows decoded so far.
    pub rows: u64,
    /// Rows without a time, before the clocks were related.
    pub unplaced: u64,
    /// With `clock = "related"`: arrival − stamp without delay \[s\], the rate of this offset \[ppm\], and the mean delay
    /// above the shortest one \[s\].
    pub relation: Option<(f64, f64, f64)>,
    /// How often a clock has jumped.
    pub jumps: u64,
    /// Why its reader began again.
    pub trouble: Option<String>,
}

/// The state of an output.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct OutputStatus {
    /// Its name.
    pub name: String,
    /// Estimates that left.
    pub sent: u64,
    /// Estimates that were dropped, because the output was slower than its rate.
    pub dropped: u64,
    /// Estimates that could not be sent.
    pub failed: u64,
    /// Why the last estimate could not be sent.
    pub trouble: Option<String>,
    /// The line of the output about itself.
    pub about: Option<String>,
}

/// Hears the status.
pub type StatusListener = Arc<dyn Fn(&Status) + Send + Sync>;

/// States that wait for a listener that is slow. Further ones are dropped.
const WAITING: usize = 2;
/// At the end the listener has this time for those that wait.
const LAST: Duration = Duration::from_secs(1);

/// Makes the status at intervals. The listener hears it in its own thread, so that the filter never waits for it.
pub(crate) struct Board {
    pub(crate) links: Vec<(String, Arc<Counts>)>,
    pub(crate) outputs: Vec<(String, Arc<Mailbox>)>,
    listener: Option<(SyncSender<Status>, JoinHandle<()>)>,
    every: Duration,
    last: Instant,
}

impl Board {
    /// # Errors
    /// The system has no more threads.
    pub(crate) fn new(listener: Option<(Duration, StatusListener)>) -> std::io::Result<Self> {
        let every = listener.as_ref().map_or(Duration::MAX, |(every, _)| *every);
        let start = |(_, listener): (Duration, StatusListener)| -> std::io::Result<_> {
            let (to, states) = sync_channel::<Status>(WAITING);
            let body = move || states.iter().for_each(|status| listener(&status));
            Ok((to, Builder::new().name("status".to_owned()).spawn(body)?))
        };
        Ok(Self {
            links: Vec::new(),
            outputs: Vec::new(),
            listener: listener.map(start).transpose()?,
            every,
            last: Instant::now(),
        })
    }

    /// Passes the status on, if it is time.
    pub(crate) fn look(&mut self, sources: &[Fed], latency: &Latency) {
        if self.listener.is_some() && self.last.elapsed() >= self.every {
            self.last = Instant::now();
            self.pass(sources, latency);
        }
    }

    fn pass(&self, sources: &[Fed], latency: &Latency) {
        if let Some((to, _)) = &self.listener {
            // A listener that is slow hears the next one.
            let _ = to.try_send(self.status(sources, latency));
        }
    }

    /// Passes the last status on, and waits a moment for the listener.
    pub(crate) fn end(&mut self, sources: &[Fed], latency: &Latency) {
        self.pass(sources, latency);
        let Some((to, listener)) = self.listener.take() else { return };
        drop(to);
        let until = Instant::now() + LAST;
        while !listener.is_finished() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn status(&self, sources: &[Fed], latency: &Latency) -> Status {
        let text = |text: &Mutex<Option<String>>| text.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let link = |(name, counts): &(String, Arc<Counts>)| LinkStatus {
            name: name.clone(),
            bytes: counts.bytes.load(Ordering::Relaxed),
            dropped: counts.dropped.load(Ordering::Relaxed),
            opened: counts.opened.load(Ordering::Relaxed),
            trouble: text(&counts.trouble),
            about: text(&counts.about),
        };
        let output = |(name, mailbox): &(String, Arc<Mailbox>)| OutputStatus {
            name: name.clone(),
            sent: mailbox.sent.load(Ordering::Relaxed),
            dropped: mailbox.dropped.load(Ordering::Relaxed),
            failed: mailbox.failed.load(Ordering::Relaxed),
            trouble: text(&mailbox.trouble),
            about: text(&mailbox.status),
        };
        Status {
            links: self.links.iter().map(link).collect(),
            sources: sources.iter().map(Fed::status).collect(),
            outputs: self.outputs.iter().map(output).collect(),
            latency: latency.clone(),
        }
    }
}
