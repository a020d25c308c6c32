//! Connections of TCP.

use super::{BLOCK, Ends, LinkSpec, Received, Receiver, Sender, is_time_out, read_some};
use fusion::models::register;
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A peer that does not answer within this time is not there.
const ANSWER: Duration = Duration::from_secs(3);
/// A peer that does not take bytes for this time has lost the connection.
const STUCK: Duration = Duration::from_secs(2);
/// The interval between two looks for a peer.
const LOOK: Duration = Duration::from_millis(5);

/// A connection of TCP, to a server or as a server for one peer at a time.
#[derive(Debug, Deserialize)]
#[serde(try_from = "TcpTable")]
pub enum TcpSpec {
    /// To this server.
    Connect(String),
    /// As a server at this address.
    Listen(SocketAddr),
}

/// A connection of TCP, to a server or as a server for one peer at a time. It has either `connect` or `listen`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TcpTable {
    /// The server to connect to, such as `"192.168.1.20:9001"`.
    connect: Option<String>,
    /// The own address and port as a server, such as `"0.0.0.0:9001"`. A new peer replaces the one before.
    listen: Option<SocketAddr>,
}

impl TryFrom<TcpTable> for TcpSpec {
    type Error = &'static str;

    fn try_from(table: TcpTable) -> Result<Self, Self::Error> {
        match (table.connect, table.listen) {
            (Some(server), None) => Ok(Self::Connect(server)),
            (None, Some(own)) => Ok(Self::Listen(own)),
            _ => Err("a link of the type `tcp` has either `connect` or `listen`"),
        }
    }
}

register! { Link, "tcp", TcpTable, r#"connect = "127.0.0.1:9001""# }

#[typetag::deserialize(name = "tcp")]
impl LinkSpec for TcpSpec {
    fn open(&self) -> io::Result<Ends> {
        match self {
            Self::Connect(server) => connected(server),
            Self::Listen(own) => listening(*own),
        }
    }

    fn peer(&self) -> String {
        match self {
            Self::Connect(server) => format!("tcp {server}"),
            Self::Listen(own) => format!("tcp {own}"),
        }
    }
}

fn prepared(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(STUCK))
}

fn connected(server: &str) -> io::Result<Ends> {
    let unknown = || io::Error::new(ErrorKind::NotFound, format!("`{server}` has no address"));
    let address = server.to_socket_addrs()?.next().ok_or_else(unknown)?;
    let stream = TcpStream::connect_timeout(&address, ANSWER)?;
    prepared(&stream)?;
    let sender = Client(stream.try_clone()?);
    Ok(Ends {
        receiver: Box::new(Client(stream)),
        sender: Some(Box::new(sender)),
    })
}

struct Client(TcpStream);

impl Receiver for Client {
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received> {
        self.0.set_read_timeout(Some(wait))?;
        read_some(&mut self.0, BLOCK, bytes)
    }
}

impl Sender for Client {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}

/// The peer of a server, for both of its ends.
type Peer = Arc<Mutex<Option<TcpStream>>>;

fn listening(own: SocketAddr) -> io::Result<Ends> {
    let listener = TcpListener::bind(own)?;
    listener.set_nonblocking(true)?;
    let peer = Peer::default();
    Ok(Ends {
        receiver: Box::new(Server {
            listener,
            peer: peer.clone(),
            stream: None,
            is_new: false,
        }),
        sender: Some(Box::new(ToPeer(peer))),
    })
}

struct Server {
    listener: TcpListener,
    peer: Peer,
    stream: Option<TcpStream>,
    /// Nothing has been received of this peer.
    is_new: bool,
}

impl Server {
    /// Takes a new peer, if there is one.
    fn accept(&mut self) -> io::Result<()> {
        match self.listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                prepared(&stream)?;
                *self.peer.lock().unwrap_or_else(PoisonError::into_inner) = Some(stream.try_clone()?);
                (self.stream, self.is_new) = (Some(stream), true);
                Ok(())
            }
            Err(error) if is_time_out(&error) => Ok(()),
            Err(error) => Err(error),
        }
    }

    fn forget(&mut self) {
        self.stream = None;
        *self.peer.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

impl Receiver for Server {
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received> {
        let until = Instant::now() + wait;
        loop {
            self.accept()?;
            let left = until.saturating_duration_since(Instant::now());
            let Some(stream) = &mut self.stream else {
                if left.is_zero() {
                    return Ok(Received::Nothing);
                }
                std::thread::sleep(left.min(LOOK));
                continue;
            };
            stream.set_read_timeout(Some(left.clamp(Duration::from_micros(100), LOOK)))?;
            match read_some(stream, BLOCK, bytes) {
                Ok(Received::Bytes) if core::mem::take(&mut self.is_new) => return Ok(Received::Anew),
                Ok(Received::Bytes) => return Ok(Received::Bytes),
                Ok(Received::End) | Err(_) => self.forget(),
                Ok(_) if left.is_zero() => return Ok(Received::Nothing),
                Ok(_) => {}
            }
        }
    }
}

struct ToPeer(Peer);

impl Sender for ToPeer {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let stream = self
            .0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .as_ref()
            .map(TcpStream::try_clone);
        let none = || io::Error::new(ErrorKind::NotConnected, "no peer is connected");
        stream.ok_or_else(none)??.write_all(bytes)
    }
}
