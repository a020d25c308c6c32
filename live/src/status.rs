//! The state of links, sources and outputs, for those who watch a live run.

use crate::feed::Fed;
use crate::inbox::Counts;
use crate::latency::Latency;
use crate::leaving::Mailbox;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
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

/// Makes the status at intervals.
pub(crate) struct Board {
    pub(crate) links: Vec<(String, Arc<Counts>)>,
    pub(crate) outputs: Vec<(String, Arc<Mailbox>)>,
    pub(crate) listener: Option<StatusListener>,
    pub(crate) every: Duration,
    last: Mutex<Instant>,
}

impl Board {
    pub(crate) fn new(listener: Option<StatusListener>, every: Duration) -> Self {
        Self {
            links: Vec::new(),
            outputs: Vec::new(),
            listener,
            every,
            last: Mutex::new(Instant::now()),
        }
    }

    /// Passes the status on, if it is time.
    pub(crate) fn look(&self, sources: &[Fed], latency: &Latency) {
        if self.listener.is_none() {
            return;
        }
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() >= self.every {
            *last = Instant::now();
            drop(last);
            self.tell(sources, latency);
        }
    }

    /// Passes the status on.
    pub(crate) fn tell(&self, sources: &[Fed], latency: &Latency) {
        if let Some(listener) = &self.listener {
            listener(&self.status(sources, latency));
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
