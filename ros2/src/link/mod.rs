//! Topics as a link.

mod declared;
mod subscription;

pub use declared::Ros2LinkSpec;

use crate::cdr::failed;
use crate::records;
use fusion_live::{Received, Receiver};
use rustdds::DomainParticipant;
use std::io;
use std::sync::Arc;
use std::task::{Wake, Waker};
use std::thread::Thread;
use std::time::{Duration, Instant, SystemTime};
use subscription::Subscription;

/// Bytes are given away when there are this many.
const MOST_AT_ONCE: usize = 1 << 20;
/// DDS orders messages by the clock of the computer, and holds back those of a time before the latest one.
const SET_BACK: Duration = Duration::from_millis(500);

/// Receives the messages of all topics.
struct Inlet {
    // Subscriptions end before their participant.
    subscriptions: Vec<Subscription>,
    participant: DomainParticipant,
    has_begun: bool,
    latest: SystemTime,
}

impl Inlet {
    /// Takes the messages that have arrived. The channels of all topics come before the first message: a reader that cannot
    /// follow loses later bytes, and never these.
    fn take(&mut self, bytes: &mut Vec<u8>) {
        let from = bytes.len();
        if !self.has_begun {
            records::begin(bytes);
            self.subscriptions.iter().for_each(|subscription| subscription.declare(bytes));
        }
        let empty = bytes.len();
        for subscription in &mut self.subscriptions {
            while bytes.len() - from < MOST_AT_ONCE && subscription.take(bytes) {}
        }
        if bytes.len() > empty {
            self.has_begun = true;
        } else {
            bytes.truncate(from);
        }
    }

    /// # Errors
    /// The clock of the computer was set back.
    fn watch_clock(&mut self) -> io::Result<()> {
        let now = SystemTime::now();
        if now + SET_BACK < self.latest {
            return Err(io::Error::other(
                "the clock of this computer was set back: the subscriptions begin again",
            ));
        }
        self.latest = now;
        Ok(())
    }
}

impl Receiver for Inlet {
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received> {
        let (until, before) = (Instant::now() + wait, bytes.len());
        let waker = Waker::from(Arc::new(Unpark(std::thread::current())));
        loop {
            self.watch_clock()?;
            // A message that arrives after it was looked for wakes this thread.
            self.subscriptions.iter().for_each(|subscription| subscription.wake_by(&waker));
            self.take(bytes);
            if bytes.len() > before {
                return Ok(Received::Bytes);
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(Received::Nothing);
            }
            std::thread::park_timeout(left);
        }
    }

    fn status(&self) -> Option<String> {
        let writers = self.participant.discovered_writers();
        let each: Vec<String> = self.subscriptions.iter().map(|one| one.status(&writers)).collect();
        Some(each.join("; "))
    }
}

/// Wakes the thread that waits for messages.
struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}
