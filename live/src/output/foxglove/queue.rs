//! The queue between a server and one of its clients.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tungstenite::protocol::frame::coding::{Data, OpCode};
use tungstenite::protocol::frame::{CloseFrame, Frame};

/// Messages of one channel that wait for a client; a client that is slower loses the oldest.
pub(super) const MOST_WAITING: usize = 64;
/// A client with more bytes of pongs and texts that wait for it gets no more of them. It asks and does not read: it is closed.
const MOST_ANSWERS: usize = 1 << 18;
/// The first byte of a message with data.
const MESSAGE_DATA: u8 = 1;

/// A message of a channel.
#[derive(Debug)]
pub(super) struct Message {
    /// Nanoseconds since 1970-01-01.
    pub(super) time: u64,
    pub(super) payload: Vec<u8>,
}

/// The messages and answers that wait for a client.
#[derive(Debug, Default)]
pub(super) struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    /// Whole frames that are sent before any message.
    answers: Vec<u8>,
    messages: VecDeque<(usize, Arc<Message>)>,
    subscriptions: Vec<Subscription>,
    /// Nothing is added any more.
    is_over: bool,
}

#[derive(Debug)]
struct Subscription {
    id: u32,
    channel: usize,
    /// Its messages in the queue.
    waiting: usize,
}

impl Waiting {
    fn subscription(&mut self, channel: usize) -> Option<&mut Subscription> {
        self.subscriptions.iter_mut().find(|own| own.channel == channel)
    }
}

/// The next thing to send to a client.
pub(super) enum Next {
    /// Whole frames.
    Bytes(Vec<u8>),
    /// Nothing within the time.
    Nothing,
    /// Nothing any more.
    End,
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a subscription to a channel.
    ///
    /// # Errors
    /// The reason why it is ignored.
    pub(super) fn subscribe(&self, id: u32, channel: usize) -> Result<(), String> {
        let mut waiting = self.lock();
        if waiting.subscriptions.iter().any(|own| own.id == id) {
            return Err(format!("the subscription {id} exists: it is ignored"));
        }
        if waiting.subscription(channel).is_some() {
            return Err(format!("the channel {channel} has a subscription: {id} is ignored"));
        }
        waiting.subscriptions.push(Subscription { id, channel, waiting: 0 });
        Ok(())
    }

    /// Ends a subscription, and removes its messages.
    ///
    /// # Errors
    /// The reason why it is ignored.
    pub(super) fn unsubscribe(&self, id: u32) -> Result<(), String> {
        let mut waiting = self.lock();
        let place = waiting.subscriptions.iter().position(|own| own.id == id);
        let place = place.ok_or_else(|| format!("there is no subscription {id}: it is ignored"))?;
        let ended = waiting.subscriptions.swap_remove(place);
        waiting.messages.retain(|(channel, _)| *channel != ended.channel);
        Ok(())
    }

    /// Whether the client has subscribed to a channel.
    pub(super) fn wants(&self, channel: usize) -> bool {
        self.lock().subscription(channel).is_some()
    }

    /// Adds a message of a channel with a subscription. Returns true if the oldest message of this channel was dropped.
    pub(super) fn push(&self, channel: usize, message: &Arc<Message>) -> bool {
        let mut waiting = self.lock();
        let is_over = waiting.is_over;
        let Some(subscription) = waiting.subscription(channel).filter(|_| !is_over) else {
            return false;
        };
        let is_full = subscription.waiting >= MOST_WAITING;
        subscription.waiting += usize::from(!is_full);
        if is_full && let Some(oldest) = waiting.messages.iter().position(|(of, _)| *of == channel) {
            waiting.messages.remove(oldest);
        }
        waiting.messages.push_back((channel, message.clone()));
        self.changed.notify_one();
        is_full
    }

    /// Adds bytes of whole frames, or of the handshake.
    ///
    /// # Errors
    /// The client does not read its answers.
    pub(super) fn answer(&self, bytes: &[u8]) -> io::Result<()> {
        let mut waiting = self.lock();
        if waiting.is_over {
            return Ok(());
        }
        if waiting.answers.len() > MOST_ANSWERS {
            return Err(io::Error::new(ErrorKind::QuotaExceeded, "the client does not read its answers"));
        }
        waiting.answers.extend(bytes);
        self.changed.notify_one();
        Ok(())
    }

    /// Ends the queue. The answers that wait are still sent, then the reason; messages are not.
    pub(super) fn end(&self, reason: Option<CloseFrame>) {
        let mut waiting = self.lock();
        if !core::mem::replace(&mut waiting.is_over, true) {
            waiting.messages.clear();
            waiting
                .answers
                .extend(reason.map(|reason| framed(Frame::close(Some(reason)))).unwrap_or_default());
        }
        self.changed.notify_one();
    }

    /// Waits for bytes to send.
    pub(super) fn next(&self, wait: Duration) -> Next {
        let is_idle = |waiting: &mut Waiting| waiting.answers.is_empty() && waiting.messages.is_empty() && !waiting.is_over;
        let mut waiting = self
            .changed
            .wait_timeout_while(self.lock(), wait, is_idle)
            .unwrap_or_else(PoisonError::into_inner)
            .0;
        if !waiting.answers.is_empty() {
            return Next::Bytes(core::mem::take(&mut waiting.answers));
        }
        if waiting.is_over {
            return Next::End;
        }
        let Some((channel, message)) = waiting.messages.pop_front() else {
            return Next::Nothing;
        };
        let Some(subscription) = waiting.subscription(channel) else {
            return Next::Nothing;
        };
        subscription.waiting -= 1;
        let id = subscription.id;
        drop(waiting);
        Next::Bytes(data(id, &message))
    }
}

/// The frame of a message.
fn data(subscription: u32, message: &Message) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(1 + 4 + 8 + message.payload.len());
    bytes.push(MESSAGE_DATA);
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(message.time.to_le_bytes());
    bytes.extend(&message.payload);
    framed(Frame::message(bytes, OpCode::Data(Data::Binary), true))
}

/// The bytes of a frame.
pub(super) fn framed(frame: Frame) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(frame.len());
    // A vector takes all bytes.
    let _ = frame.format(&mut bytes);
    bytes
}
