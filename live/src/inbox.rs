//! The events of the links, in order of arrival, on their way to the filter.

use crate::arrival::ArrivalClock;
use crate::link::{LinkSpec, Received, Sender};
use crate::speaker::Speaker;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::Builder;
use std::time::{Duration, Instant};

/// The memory of an event beside its bytes.
const EVENT: u64 = size_of::<Event>() as u64;

/// The memory of arrived bytes that wait.
fn size(bytes: &[u8]) -> u64 {
    bytes.len() as u64 + EVENT
}

/// Something that has happened on a link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Event {
    /// The number of the link.
    pub(crate) link: usize,
    /// When: GPS time of this computer \[ns\].
    pub(crate) arrival: i64,
    pub(crate) what: Happened,
}

/// The kind of an event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Happened {
    /// Bytes arrived.
    Bytes(Vec<u8>),
    /// The bytes that follow do not continue those before.
    Anew,
    /// The link was closed, or lost.
    Closed,
}

/// How long a receiver waits before it looks whether the program is to stop.
const LOOK: Duration = Duration::from_millis(100);
/// The pauses between attempts to open a link: the first, and the longest. Each is twice the one before.
const PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];

/// The sending end of a link, while it is open. The thread of the link exchanges it.
pub(crate) type Outlet = Arc<Mutex<Option<Box<dyn Sender>>>>;

/// The counts of a link.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    pub(crate) bytes: AtomicU64,
    /// Bytes that were dropped: the filter was too slow.
    pub(crate) dropped: AtomicU64,
    /// How often it was opened.
    pub(crate) opened: AtomicU64,
    /// The last reason why it was not open.
    pub(crate) trouble: Mutex<Option<String>>,
    /// The line of the link about itself.
    pub(crate) about: Mutex<Option<String>>,
}

/// The queue of events, of all links.
#[derive(Debug)]
pub(crate) struct Inbox {
    waiting: Mutex<Waiting>,
    arrived: Condvar,
    /// An event has left.
    left: Condvar,
    stop: Arc<AtomicBool>,
}

#[derive(Debug, Default)]
struct Waiting {
    events: VecDeque<Event>,
    /// Bytes that wait, by link.
    bytes: Vec<u64>,
    /// Links that may still give bytes.
    open: usize,
}

/// The answer of an inbox.
pub(crate) enum Next {
    Event(Event),
    /// Nothing until the time.
    Nothing,
    /// All links have ended, or the program is to stop.
    End,
}

impl Inbox {
    pub(crate) fn new(links: usize, stop: Arc<AtomicBool>) -> Self {
        Self {
            waiting: Mutex::new(Waiting {
                events: VecDeque::new(),
                bytes: vec![0; links],
                open: links,
            }),
            arrived: Condvar::new(),
            left: Condvar::new(),
            stop,
        }
    }

    /// Adds an event, unless more than `most` bytes of its link wait; with `waits`, it waits until there is room.
    fn put(&self, event: Event, most: u64, waits: bool) -> bool {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        if let Happened::Bytes(bytes) = &event.what {
            let count = size(bytes);
            // A queue without bytes takes any number.
            let is_full = |waiting: &Waiting| waiting.bytes[event.link] > 0 && waiting.bytes[event.link] + count > most;
            while waits && is_full(&waiting) && !self.stop.load(Ordering::Relaxed) {
                waiting = self.left.wait_timeout(waiting, LOOK).unwrap_or_else(PoisonError::into_inner).0;
            }
            if is_full(&waiting) {
                return false;
            }
            waiting.bytes[event.link] += count;
        }
        waiting.events.push_back(event);
        self.arrived.notify_one();
        true
    }

    fn ended(&self) {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).open -= 1;
        self.arrived.notify_one();
    }

    /// The next event, or nothing at the time `until`.
    pub(crate) fn next(&self, until: Instant) -> Next {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return Next::End;
            }
            if let Some(event) = waiting.events.pop_front() {
                if let Happened::Bytes(bytes) = &event.what {
                    waiting.bytes[event.link] -= size(bytes);
                    self.left.notify_all();
                }
                return Next::Event(event);
            }
            if waiting.open == 0 {
                return Next::End;
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Next::Nothing;
            }
            let woken = self.arrived.wait_timeout(waiting, left.min(LOOK));
            waiting = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

/// A link with its thread.
pub(crate) struct Open {
    pub(crate) spec: Box<dyn LinkSpec>,
    pub(crate) number: usize,
    /// Bytes that may wait for the filter.
    pub(crate) most: u64,
    /// Whether a source reads its bytes.
    pub(crate) is_read: bool,
    pub(crate) outlet: Outlet,
    pub(crate) counts: Arc<Counts>,
    pub(crate) name: String,
    pub(crate) speaker: Speaker,
}

impl Open {
    /// Starts the thread of the link, which opens it again when it is lost. It ends with the program, or with the link.
    ///
    /// # Errors
    /// The system has no more threads.
    pub(crate) fn start(self, inbox: Arc<Inbox>, clock: ArrivalClock) -> std::io::Result<()> {
        let body = move || {
            self.serve(&inbox, clock);
            *self.outlet.lock().unwrap_or_else(PoisonError::into_inner) = None;
            inbox.ended();
        };
        Builder::new().name("link".to_owned()).spawn(body).map(drop)
    }

    fn serve(&self, inbox: &Inbox, clock: ArrivalClock) {
        let mut pause = PAUSES[0];
        while !inbox.stop.load(Ordering::Relaxed) {
            let trouble = match self.spec.open() {
                Err(error) => error.to_string(),
                Ok(ends) => {
                    self.counts.opened.fetch_add(1, Ordering::Relaxed);
                    self.trouble(None);
                    *self.outlet.lock().unwrap_or_else(PoisonError::into_inner) = ends.sender;
                    let before = self.counts.bytes.load(Ordering::Relaxed);
                    let end = self.receive(ends.receiver, inbox, clock);
                    *self.outlet.lock().unwrap_or_else(PoisonError::into_inner) = None;
                    self.tell(inbox, clock, Happened::Closed);
                    if self.counts.bytes.load(Ordering::Relaxed) > before {
                        pause = PAUSES[0];
                    }
                    match end {
                        Some(trouble) => trouble,
                        None => return,
                    }
                }
            };
            self.trouble(Some(trouble));
            let until = Instant::now() + pause;
            while Instant::now() < until && !inbox.stop.load(Ordering::Relaxed) {
                std::thread::sleep(LOOK.min(pause));
            }
            pause = (2 * pause).min(PAUSES[1]);
        }
    }

    /// Receives until the link is lost: why, or `None` if it is not to be opened again.
    fn receive(&self, mut receiver: Box<dyn crate::link::Receiver>, inbox: &Inbox, clock: ArrivalClock) -> Option<String> {
        let (mut bytes, mut looked) = (Vec::new(), Instant::now());
        while !inbox.stop.load(Ordering::Relaxed) {
            bytes.clear();
            if looked.elapsed() >= LOOK {
                looked = Instant::now();
                *self.counts.about.lock().unwrap_or_else(PoisonError::into_inner) = receiver.status();
            }
            match receiver.receive(LOOK, &mut bytes) {
                Err(error) => return Some(error.to_string()),
                Ok(Received::End) if self.spec.ends() => return None,
                Ok(Received::End) => return Some("the peer has closed it".to_owned()),
                Ok(Received::Nothing) => continue,
                Ok(Received::Anew) => {
                    self.tell(inbox, clock, Happened::Anew);
                }
                Ok(Received::Bytes) => {}
            }
            if bytes.is_empty() {
                continue;
            }
            let count = bytes.len() as u64;
            self.counts.bytes.fetch_add(count, Ordering::Relaxed);
            if self.is_read && !self.tell(inbox, clock, Happened::Bytes(bytes.as_slice().to_vec())) {
                self.counts.dropped.fetch_add(count, Ordering::Relaxed);
            }
        }
        None
    }

    fn tell(&self, inbox: &Inbox, clock: ArrivalClock, what: Happened) -> bool {
        let event = Event {
            link: self.number,
            arrival: clock.now(),
            what,
        };
        inbox.put(event, self.most, self.spec.waits())
    }

    /// Notes why the link is not open, and says so if that has changed.
    fn trouble(&self, trouble: Option<String>) {
        let mut known = self.counts.trouble.lock().unwrap_or_else(PoisonError::into_inner);
        if *known != trouble {
            let (name, peer) = (&self.name, self.spec.peer());
            self.speaker.say(match &trouble {
                Some(why) => format!("link `{name}` ({peer}) is not open: {why}. It is tried again"),
                None => format!("link `{name}` ({peer}) is open"),
            });
            *known = trouble;
        }
    }
}
