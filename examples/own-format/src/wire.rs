//! A project's own link and its own output: datagrams of a Unix socket, and heights as text.

use fusion::models::register;
use fusion_live::{About, Ends, LinkSpec, Outgoing, Output, OutputSpec, Received, Receiver, Sender};
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::{self, ErrorKind};
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;
use std::time::Duration;

/// A datagram has at most this number of bytes.
const LONGEST: usize = 1 << 16;

/// Datagrams of a Unix socket.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UnixSpec {
    /// The path of the own socket. A socket that a former program left there is replaced.
    listen: PathBuf,
    /// The socket to which outputs are sent.
    send_to: Option<PathBuf>,
}

register! { Link, "unix_datagram", UnixSpec, r#"listen = "fusion.socket""# }

#[typetag::deserialize(name = "unix_datagram")]
impl LinkSpec for UnixSpec {
    fn open(&self) -> io::Result<Ends> {
        // It may not be there.
        let _ = std::fs::remove_file(&self.listen);
        let socket = UnixDatagram::bind(&self.listen)?;
        let sender = self.send_to.clone().map(|peer| -> io::Result<Box<dyn Sender>> {
            let socket = socket.try_clone()?;
            Ok(Box::new(Outlet { socket, peer }))
        });
        let sender = sender.transpose()?;
        Ok(Ends {
            receiver: Box::new(Inlet(socket)),
            sender,
        })
    }

    fn peer(&self) -> String {
        self.listen.display().to_string()
    }
}

struct Inlet(UnixDatagram);

impl Receiver for Inlet {
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received> {
        self.0.set_read_timeout(Some(wait))?;
        bytes.resize(LONGEST, 0);
        let received = self.0.recv(bytes);
        bytes.truncate(received.as_ref().map_or(0, |count| *count));
        match received {
            Ok(_) => Ok(Received::Bytes),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Ok(Received::Nothing),
            Err(error) => Err(error),
        }
    }
}

struct Outlet {
    socket: UnixDatagram,
    peer: PathBuf,
}

impl Sender for Outlet {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.socket.send_to(bytes, &self.peer).map(drop)
    }
}

/// The height and its 1σ, in metres with two decimals.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeightSpec {
    /// The link by which it is sent.
    link: String,
}

register! { Output, "height", HeightSpec, r#"link = "socket""# }

#[typetag::deserialize(name = "height")]
impl OutputSpec for HeightSpec {
    fn link(&self) -> Option<&str> {
        Some(&self.link)
    }

    fn open(&self, _about: &About) -> io::Result<Box<dyn Output>> {
        Ok(Box::new(Heights))
    }
}

struct Heights;

impl Output for Heights {
    fn send(&mut self, estimate: &Outgoing, to: Option<&mut dyn Sender>) -> io::Result<()> {
        let position = estimate.solution.as_ref().and_then(|solution| solution.position);
        let (Some((place, covariance)), Some(to)) = (position, to) else {
            return Ok(());
        };
        let line = format!("{:.2} {:.2}\n", place.height, fusion::core::math::sqrt(covariance[(2, 2)]));
        to.send(line.as_bytes())
    }
}
