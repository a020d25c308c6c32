//! Links: connections by which bytes come and go.

mod file;
#[cfg(feature = "serial")]
mod serial;
mod stdio;
mod tcp;
mod udp;

pub use file::FileSpec;
#[cfg(feature = "serial")]
pub use serial::SerialSpec;
pub use stdio::StdioSpec;
pub use tcp::TcpSpec;
pub use udp::UdpSpec;

use core::fmt::Debug;
use std::io;
use std::time::Duration;

/// A link as declared: the table `[link.NAME]`. A type registers itself as a block of the role `Link`, with
/// `fusion::models::register!`, in its own file.
#[typetag::deserialize]
pub trait LinkSpec: Debug + Send + Sync {
    /// Opens it. It is called again, after a while, when the link was lost or could not be opened.
    ///
    /// # Errors
    /// It cannot be opened now.
    fn open(&self) -> io::Result<Ends>;

    /// Whether its end is final. Any other link is opened again.
    fn ends(&self) -> bool {
        false
    }

    /// Whether bytes that are not received yet stay where they are, as in a file or a pipe. The link then waits for the
    /// filter, and nothing is dropped.
    fn waits(&self) -> bool {
        false
    }

    /// Its peer, as messages name it, such as `udp 0.0.0.0:14550`.
    fn peer(&self) -> String;
}

/// The two ends of an open link.
pub struct Ends {
    /// Gives the bytes that arrive.
    pub receiver: Box<dyn Receiver>,
    /// Takes bytes that leave; `None` if it only receives.
    pub sender: Option<Box<dyn Sender>>,
}

/// Gives the bytes of an open link. It is used in its own thread.
pub trait Receiver: Send {
    /// Waits for bytes, at most for `wait`, and appends those that are there to `bytes`.
    ///
    /// # Errors
    /// The link is lost.
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received>;

    /// One line for `fusion live` about what the link has received and lost by itself, such as the messages of each topic.
    fn status(&self) -> Option<String> {
        None
    }
}

/// The result of receiving.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// Bytes, which continue those before.
    Bytes,
    /// The first bytes of another peer, which do not continue those before.
    Anew,
    /// Nothing within the time.
    Nothing,
    /// No bytes will come any more.
    End,
}

/// Takes bytes that leave by a link. It is used in another thread than the receiver.
pub trait Sender: Send {
    /// Sends bytes. It may wait; the filter does not.
    ///
    /// # Errors
    /// The link is lost.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;
}

/// Whether an operation ended because nothing came in time.
pub(crate) fn is_time_out(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
    )
}

/// Reads what is there from a stream with a time-out, at most `most` bytes; its end is the end of the link.
fn read_some(stream: &mut impl io::Read, most: usize, bytes: &mut Vec<u8>) -> io::Result<Received> {
    let before = bytes.len();
    bytes.resize(before + most, 0);
    let read = stream.read(&mut bytes[before..]);
    bytes.truncate(before + read.as_ref().map_or(0, |count| *count));
    match read {
        Ok(0) => Ok(Received::End),
        Ok(_) => Ok(Received::Bytes),
        Err(error) if is_time_out(&error) => Ok(Received::Nothing),
        Err(error) => Err(error),
    }
}

/// Bytes that are read from a stream at a time.
const BLOCK: usize = 1 << 14;
