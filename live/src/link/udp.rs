//! Datagrams.

use super::{Ends, LinkSpec, Received, Receiver, Sender, is_time_out};
use fusion::models::register;
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A datagram of UDP has at most this number of bytes.
const LONGEST: usize = 65_535;

/// Datagrams of UDP. Their bytes follow each other as those of a file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UdpSpec {
    /// The own address and port, such as `"0.0.0.0:14550"`.
    listen: SocketAddr,
    /// The address to which outputs are sent. Without it, the sender of the latest datagram.
    send_to: Option<SocketAddr>,
    /// Adds a line end to a datagram that has none, for senders of text lines without line ends.
    #[serde(default)]
    line_ends: bool,
}

register! { Link, "udp", UdpSpec, r#"listen = "127.0.0.1:14550""# }

#[typetag::deserialize(name = "udp")]
impl LinkSpec for UdpSpec {
    fn open(&self) -> io::Result<Ends> {
        let socket = UdpSocket::bind(self.listen)?;
        let peer = Arc::new(Mutex::new(self.send_to));
        let sender = Outlet {
            socket: socket.try_clone()?,
            peer: peer.clone(),
        };
        let receiver = Inlet {
            socket,
            learns: self.send_to.is_none().then_some(peer),
            line_ends: self.line_ends,
            datagram: vec![0; LONGEST],
            waits: Duration::ZERO,
        };
        Ok(Ends {
            receiver: Box::new(receiver),
            sender: Some(Box::new(sender)),
        })
    }

    fn peer(&self) -> String {
        format!("udp {}", self.listen)
    }
}

struct Inlet {
    socket: UdpSocket,
    /// Where the latest sender is noted.
    learns: Option<Arc<Mutex<Option<SocketAddr>>>>,
    line_ends: bool,
    datagram: Vec<u8>,
    /// The time-out of the socket.
    waits: Duration,
}

impl Receiver for Inlet {
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received> {
        if wait != self.waits {
            self.socket.set_read_timeout(Some(wait))?;
            self.waits = wait;
        }
        let (count, from) = match self.socket.recv_from(&mut self.datagram) {
            Ok(received) => received,
            Err(error) if is_time_out(&error) => return Ok(Received::Nothing),
            // A peer that is not there: a datagram to it came back. It may be there later.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => return Ok(Received::Nothing),
            Err(error) => return Err(error),
        };
        if let Some(peer) = &self.learns {
            *peer.lock().unwrap_or_else(PoisonError::into_inner) = Some(from);
        }
        let datagram = &self.datagram[..count];
        bytes.extend_from_slice(datagram);
        if self.line_ends && !datagram.ends_with(b"\n") {
            bytes.push(b'\n');
        }
        Ok(Received::Bytes)
    }
}

struct Outlet {
    socket: UdpSocket,
    peer: Arc<Mutex<Option<SocketAddr>>>,
}

impl Sender for Outlet {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let peer = *self.peer.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(peer) = peer else {
            return Err(io::Error::new(
                ErrorKind::NotConnected,
                "no datagram has arrived yet, and `send_to` is not declared",
            ));
        };
        self.socket.send_to(bytes, peer).map(|_| ())
    }
}
