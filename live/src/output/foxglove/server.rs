//! A server with several clients: a thread that accepts them, and two for each of them.
//!
//! ```text
//! publish ──▶ Queue of each client ──▶ writer ──▶ socket ──▶ reader ──▶ requests
//!                    ▲                                          │ answers
//!                    └──────────────────────────────────────────┘
//! ```
//!
//! A publisher never waits for a socket. The reader answers by the queue, so that only the writer writes.

use super::protocol::{Request, SUBPROTOCOLS, Wanted, warning};
use super::queue::{Message, Next, Queue, framed};
use crate::link::is_time_out;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, Builder, JoinHandle};
use std::time::{Duration, Instant};
use tungstenite::handshake::server::{ErrorResponse, Request as Upgrade, Response};
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::frame::{CloseFrame, Frame};
use tungstenite::protocol::{self, WebSocketConfig};
use tungstenite::{Error, WebSocket, accept_hdr_with_config};

/// Clients at a time.
pub(super) const MOST_CLIENTS: usize = 16;
/// Bytes of the longest message of a client: a subscription to a thousand channels has 40 kB.
const LONGEST_REQUEST: usize = 1 << 17;
/// The interval between two looks for new clients.
const LOOK: Duration = Duration::from_millis(20);
/// A connection that is not upgraded within this time is closed.
const UPGRADE: Duration = Duration::from_secs(5);
/// How long a server waits for its clients.
pub(super) const PATIENCE: Patience = Patience {
    ping: Duration::from_secs(10),
    silence: Duration::from_secs(60),
};
/// A client that is closed has this time to read the reason.
const LEAVE: Duration = Duration::from_millis(500);
/// Bytes of the longest reason in a close frame.
const LONGEST_REASON: usize = 123;

/// How long a server waits for its clients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// The interval between two pings.
    pub(super) ping: Duration,
    /// A client of which nothing is received for this time, or that takes no byte for this time, is not there.
    pub(super) silence: Duration,
}

/// A running server. It ends with its clients when it is dropped.
#[derive(Debug)]
pub(super) struct Server {
    pub(super) address: SocketAddr,
    shared: Arc<Shared>,
    acceptor: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    /// The texts that each client receives first.
    greetings: [String; 2],
    channels: usize,
    patience: Patience,
    clients: Mutex<Vec<Arc<Client>>>,
    /// The newest message of a channel that a new subscription receives at once.
    latest: Mutex<Option<(usize, Arc<Message>)>>,
    dropped: AtomicU64,
    is_over: AtomicBool,
}

#[derive(Debug)]
struct Client {
    stream: TcpStream,
    queue: Queue,
    /// It speaks the protocol.
    is_upgraded: AtomicBool,
}

/// The state of a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Count {
    pub(super) clients: usize,
    /// Messages that slow clients have lost.
    pub(super) dropped: u64,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    /// Starts a server of some channels. Each client first receives the greetings.
    ///
    /// # Errors
    /// The address is not free.
    pub(super) fn start(listen: SocketAddr, greetings: [String; 2], channels: usize, patience: Patience) -> io::Result<Self> {
        let refused = |error: io::Error| io::Error::new(error.kind(), format!("cannot listen on {listen}: {error}"));
        let listener = TcpListener::bind(listen).map_err(refused)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared {
            greetings,
            channels,
            patience,
            clients: Mutex::default(),
            latest: Mutex::default(),
            dropped: AtomicU64::new(0),
            is_over: AtomicBool::new(false),
        });
        let own = shared.clone();
        let acceptor = named(address).spawn(move || accept(&listener, address, &own))?;
        Ok(Self {
            address,
            shared,
            acceptor: Some(acceptor),
        })
    }

    /// Gives a message to the clients that have subscribed to its channel. It is made only for them. It never waits.
    ///
    /// # Errors
    /// Those of `make`.
    pub(super) fn publish(&self, channel: usize, time: u64, make: impl Fn() -> io::Result<Vec<u8>>) -> io::Result<()> {
        let mut message = None;
        let clients = locked(&self.shared.clients);
        for client in clients.iter().filter(|client| client.queue.wants(channel)) {
            let message = match &message {
                Some(message) => message,
                None => message.insert(Arc::new(Message { time, payload: make()? })),
            };
            self.shared.push(client, channel, message);
        }
        Ok(())
    }

    /// Gives a message to the clients that have subscribed to its channel, and to those that will subscribe to it.
    pub(super) fn publish_latest(&self, channel: usize, message: Message) {
        let message = Arc::new(message);
        *locked(&self.shared.latest) = Some((channel, message.clone()));
        for client in locked(&self.shared.clients).iter() {
            self.shared.push(client, channel, &message);
        }
    }

    pub(super) fn count(&self) -> Count {
        let clients = locked(&self.shared.clients);
        let is_upgraded = |client: &&Arc<Client>| client.is_upgraded.load(Ordering::Relaxed);
        Count {
            clients: clients.iter().filter(is_upgraded).count(),
            dropped: self.shared.dropped.load(Ordering::Relaxed),
        }
    }
}

#[cfg(test)]
impl Server {
    /// The clients, so that a test sees when they are gone.
    pub(super) fn watched(&self) -> Vec<std::sync::Weak<impl Sized + use<>>> {
        locked(&self.shared.clients).iter().map(Arc::downgrade).collect()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
        if let Some(acceptor) = self.acceptor.take() {
            // It does not panic; if it did, it is over too.
            let _ = acceptor.join();
        }
    }
}

impl Shared {
    fn push(&self, client: &Client, channel: usize, message: &Arc<Message>) {
        let is_dropped = client.queue.push(channel, message);
        self.dropped.fetch_add(u64::from(is_dropped), Ordering::Relaxed);
    }
}

/// The threads of a server have its port in their names.
fn named(address: SocketAddr) -> Builder {
    Builder::new().name(format!("foxglove {}", address.port()))
}

/// Accepts clients until the server is over, then waits for them.
fn accept(listener: &TcpListener, address: SocketAddr, shared: &Arc<Shared>) {
    let mut threads: Vec<(Arc<Client>, JoinHandle<()>)> = Vec::new();
    while !shared.is_over.load(Ordering::Relaxed) {
        match listener.accept() {
            Ok((stream, _)) => threads.extend(admitted(stream, address, shared)),
            // Also if there are too many open files: a client that leaves gives one back.
            Err(_) => thread::sleep(LOOK),
        }
        leave(&mut threads, shared);
    }
    for (client, _) in &threads {
        client.queue.end(Some(reason(CloseCode::Away, "the filter has ended")));
    }
    let until = Instant::now() + LEAVE;
    while !threads.is_empty() {
        thread::sleep(LOOK / 10);
        leave(&mut threads, shared);
        if Instant::now() >= until {
            // The threads end with their socket.
            threads.iter().for_each(|(client, _)| client.shut());
        }
    }
}

/// Starts the thread of a client; `None` if there are too many, or the system has no thread for it.
fn admitted(mut stream: TcpStream, address: SocketAddr, shared: &Arc<Shared>) -> Option<(Arc<Client>, JoinHandle<()>)> {
    if locked(&shared.clients).len() >= MOST_CLIENTS {
        // The buffer of a new socket takes it at once.
        let _ = stream.write_all(b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n");
        return None;
    }
    let set_up = || {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(shared.patience.silence))?;
        stream.set_read_timeout(Some(UPGRADE))
    };
    set_up().ok()?;
    let client = Arc::new(Client {
        stream,
        queue: Queue::default(),
        is_upgraded: AtomicBool::new(false),
    });
    let (own, server) = (client.clone(), shared.clone());
    let thread = named(address).spawn(move || own.serve(address, &server)).ok()?;
    locked(&shared.clients).push(client.clone());
    Some((client, thread))
}

/// Forgets the clients that are gone.
fn leave(threads: &mut Vec<(Arc<Client>, JoinHandle<()>)>, shared: &Shared) {
    for (client, thread) in threads.extract_if(.., |(_, thread)| thread.is_finished()) {
        let _ = thread.join();
        locked(&shared.clients).retain(|other| !Arc::ptr_eq(other, &client));
    }
}

fn reason(code: CloseCode, text: &str) -> CloseFrame {
    let end = text.floor_char_boundary(LONGEST_REASON);
    CloseFrame {
        code,
        reason: text[..end].into(),
    }
}

impl Client {
    /// Serves it until it goes, breaks the protocol or the server ends.
    fn serve(&self, address: SocketAddr, server: &Shared) {
        thread::scope(|scope| {
            if named(address).spawn_scoped(scope, || self.write(server.patience.ping)).is_ok() {
                let reason = self.converse(server);
                self.is_upgraded.store(false, Ordering::Relaxed);
                self.queue.end(reason);
                self.drain();
            }
            self.shut();
        });
    }

    fn shut(&self) {
        // It fails only if the socket is closed already.
        let _ = self.stream.shutdown(Shutdown::Both);
    }

    /// Sends what the queue has, until its end.
    fn write(&self, interval: Duration) {
        let mut ping = Instant::now() + interval;
        loop {
            let bytes = match self.queue.next(ping.saturating_duration_since(Instant::now())) {
                Next::Bytes(bytes) => bytes,
                Next::Nothing => Vec::new(),
                Next::End => break,
            };
            let mut stream = &self.stream;
            let mut sent = stream.write_all(&bytes);
            if Instant::now() >= ping && self.is_upgraded.load(Ordering::Relaxed) {
                ping = Instant::now() + interval;
                sent = sent.and_then(|()| stream.write_all(&framed(Frame::ping(Vec::new()))));
            }
            if sent.is_err() {
                return self.shut();
            }
        }
        let _ = self.stream.shutdown(Shutdown::Write);
    }

    /// Answers requests until the client goes. Returns the reason to close it, if it did not close by itself.
    fn converse(&self, server: &Shared) -> Option<CloseFrame> {
        let half = Half {
            stream: &self.stream,
            queue: &self.queue,
        };
        let config = WebSocketConfig::default()
            .max_message_size(Some(LONGEST_REQUEST))
            .max_frame_size(Some(LONGEST_REQUEST))
            .read_buffer_size(1 << 12)
            .write_buffer_size(0);
        let mut socket = accept_hdr_with_config(half, upgraded, Some(config)).ok()?;
        self.stream.set_read_timeout(Some(server.patience.silence)).ok()?;
        for text in &server.greetings {
            socket.send(text.as_str().into()).ok()?;
        }
        self.is_upgraded.store(true, Ordering::Relaxed);
        loop {
            let told = match socket.read() {
                Ok(protocol::Message::Text(text)) => self.answer(&text, server, &mut socket),
                Ok(protocol::Message::Binary(_)) => Err(reason(CloseCode::Unsupported, "a client sends no binary messages")),
                Ok(_) => Ok(()),
                Err(error) => return closing(&error, server.patience),
            };
            if let Err(reason) = told {
                return Some(reason);
            }
        }
    }

    /// Answers a request.
    ///
    /// # Errors
    /// The text is not a request.
    fn answer(&self, text: &str, server: &Shared, socket: &mut WebSocket<Half<'_>>) -> Result<(), CloseFrame> {
        let request = serde_json::from_str(text)
            .map_err(|error| reason(CloseCode::Protocol, &format!("not a request of {}: {error}", SUBPROTOCOLS[0])))?;
        let results: Vec<Result<(), String>> = match request {
            Request::Subscribe { subscriptions } => subscriptions.iter().map(|wanted| self.subscribe(wanted, server)).collect(),
            Request::Unsubscribe { subscription_ids } => subscription_ids.iter().map(|id| self.queue.unsubscribe(*id)).collect(),
            Request::Other => vec![Err("the server takes the requests `subscribe` and `unsubscribe` only".to_owned())],
        };
        for ignored in results.into_iter().filter_map(Result::err) {
            socket
                .send(warning(&ignored).into())
                .map_err(|error| reason(CloseCode::Policy, &error.to_string()))?;
        }
        Ok(())
    }

    fn subscribe(&self, wanted: &Wanted, server: &Shared) -> Result<(), String> {
        let Wanted { id, channel_id } = *wanted;
        if channel_id >= server.channels {
            return Err(format!("there is no channel {channel_id}: the subscription {id} is ignored"));
        }
        self.queue.subscribe(id, channel_id)?;
        if let Some((channel, message)) = &*locked(&server.latest)
            && *channel == channel_id
        {
            server.push(self, channel_id, message);
        }
        Ok(())
    }

    /// Reads the rest: a socket that is closed with unread bytes would take back the reason that was sent.
    fn drain(&self) {
        let until = Instant::now() + LEAVE;
        let mut rest = [0; 1 << 10];
        while Instant::now() < until && self.stream.set_read_timeout(Some(LEAVE / 10)).is_ok() {
            match (&self.stream).read(&mut rest) {
                Ok(0) => return,
                Ok(_) => {}
                Err(error) if is_time_out(&error) => {}
                Err(_) => return,
            }
        }
    }
}

/// Accepts a subprotocol of Foxglove; without one the request is refused.
#[expect(clippy::result_large_err, reason = "the signature of the library")]
fn upgraded(request: &Upgrade, mut response: Response) -> Result<Response, ErrorResponse> {
    const PROTOCOL: &str = "Sec-WebSocket-Protocol";
    let offers = request.headers().get_all(PROTOCOL);
    let offers = offers.iter().filter_map(|offer| offer.to_str().ok());
    let chosen = offers
        .flat_map(|offer| offer.split(','))
        .find_map(|offer| SUBPROTOCOLS.into_iter().find(|own| *own == offer.trim()));
    match chosen {
        Some(chosen) => {
            response.headers_mut().insert(PROTOCOL, HeaderValue::from_static(chosen));
            Ok(response)
        }
        None => {
            let mut refusal = ErrorResponse::new(Some(format!("the subprotocol is {}", SUBPROTOCOLS[0])));
            *refusal.status_mut() = StatusCode::BAD_REQUEST;
            Err(refusal)
        }
    }
}

/// The reason to close a client after an error; `None` if it is gone.
fn closing(error: &Error, patience: Patience) -> Option<CloseFrame> {
    match error {
        Error::Io(error) if is_time_out(error) => {
            let text = format!("nothing was received for {:?}, no answer to a ping either", patience.silence);
            Some(reason(CloseCode::Policy, &text))
        }
        Error::Io(error) if error.kind() == ErrorKind::QuotaExceeded => Some(reason(CloseCode::Policy, &error.to_string())),
        Error::Capacity(error) => Some(reason(CloseCode::Size, &error.to_string())),
        Error::Utf8(error) => Some(reason(CloseCode::Invalid, error)),
        Error::Protocol(error) => Some(reason(CloseCode::Protocol, &error.to_string())),
        _ => None,
    }
}

/// The socket of a client for its reader: it reads from the socket, and answers by the queue.
#[derive(Debug)]
struct Half<'a> {
    stream: &'a TcpStream,
    queue: &'a Queue,
}

impl Read for Half<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.stream.read(bytes) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                read => return read,
            }
        }
    }
}

impl Write for Half<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.queue.answer(bytes).map(|()| bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
