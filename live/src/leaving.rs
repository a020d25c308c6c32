//! Estimates on their way to an output.

use crate::inbox::Outlet;
use crate::output::{Outgoing, Output};
use crate::speaker::Speaker;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

/// Estimates that wait for an output that is slower than its rate. The oldest one is dropped then, and counted.
const MOST: usize = 8;

/// The queue of an output, and its counts.
#[derive(Debug, Default)]
pub(crate) struct Mailbox {
    waiting: Mutex<(VecDeque<Outgoing>, bool)>,
    arrived: Condvar,
    pub(crate) sent: AtomicU64,
    pub(crate) dropped: AtomicU64,
    pub(crate) failed: AtomicU64,
    /// The last error, and what the output says of itself.
    pub(crate) trouble: Mutex<Option<String>>,
    pub(crate) status: Mutex<Option<String>>,
}

impl Mailbox {
    pub(crate) fn put(&self, estimate: Outgoing) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        if waiting.0.len() == MOST {
            waiting.0.pop_front();
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
        waiting.0.push_back(estimate);
        self.arrived.notify_one();
    }

    /// No estimate follows.
    pub(crate) fn close(&self) {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).1 = true;
        self.arrived.notify_one();
    }

    /// The next estimate; `None` within the time: nothing left. `Err` at the end.
    fn next(&self, wait: Duration) -> Result<Option<Outgoing>, ()> {
        let waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let is_empty = |(queue, is_closed): &mut (VecDeque<Outgoing>, bool)| queue.is_empty() && !*is_closed;
        let woken = self.arrived.wait_timeout_while(waiting, wait, is_empty);
        let mut waiting = woken.unwrap_or_else(PoisonError::into_inner).0;
        match waiting.0.pop_front() {
            Some(estimate) => Ok(Some(estimate)),
            None if waiting.1 => Err(()),
            None => Ok(None),
        }
    }
}

/// An output with its thread.
pub(crate) struct Leaving {
    pub(crate) name: String,
    pub(crate) output: Box<dyn Output>,
    pub(crate) outlet: Option<Outlet>,
    pub(crate) mailbox: Arc<Mailbox>,
    /// Without an estimate for this time, a line says so.
    pub(crate) watchdog: Duration,
    pub(crate) speaker: Speaker,
}

impl Leaving {
    pub(crate) fn start(mut self) -> std::io::Result<JoinHandle<()>> {
        Builder::new().name("output".to_owned()).spawn(move || self.serve())
    }

    fn serve(&mut self) {
        let mut is_silent = false;
        loop {
            let estimate = match self.mailbox.next(self.watchdog) {
                Err(()) => return,
                Ok(None) => {
                    if !core::mem::replace(&mut is_silent, true) {
                        self.speaker
                            .say(format!("output `{}`: no estimate for {:?}", self.name, self.watchdog));
                    }
                    continue;
                }
                Ok(Some(estimate)) => estimate,
            };
            if core::mem::take(&mut is_silent) {
                self.speaker.say(format!("output `{}`: estimates leave again", self.name));
            }
            let sent = match &self.outlet {
                None => self.output.send(&estimate, None),
                Some(outlet) => match outlet.lock().unwrap_or_else(PoisonError::into_inner).as_deref_mut() {
                    Some(sender) => self.output.send(&estimate, Some(sender)),
                    None => self.output.send(&estimate, None),
                },
            };
            let trouble = sent.as_ref().err().map(ToString::to_string);
            let count = if sent.is_ok() { &self.mailbox.sent } else { &self.mailbox.failed };
            count.fetch_add(1, Ordering::Relaxed);
            *self.mailbox.trouble.lock().unwrap_or_else(PoisonError::into_inner) = trouble;
            *self.mailbox.status.lock().unwrap_or_else(PoisonError::into_inner) = self.output.status();
        }
    }
}
