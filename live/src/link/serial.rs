//! Serial ports.

use super::{BLOCK, Ends, LinkSpec, Received, Receiver, Sender, read_some};
use fusion::models::register;
use schemars::JsonSchema;
use serde::Deserialize;
use serialport::SerialPort;
use std::io::{self, Write};
use std::time::Duration;

/// A serial port: 8 data bits, no parity, one stop bit.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SerialSpec {
    /// The port, such as `"/dev/ttyUSB0"` or `"COM3"`.
    port: String,
    /// Bits per second.
    baud: u32,
}

register! { Link, "serial", SerialSpec, "port = \"/dev/ttyUSB0\"\nbaud = 115200" }

#[typetag::deserialize(name = "serial")]
impl LinkSpec for SerialSpec {
    fn open(&self) -> io::Result<Ends> {
        let port = serialport::new(&self.port, self.baud).timeout(Duration::from_secs(1)).open()?;
        let sender = Port(port.try_clone()?);
        Ok(Ends {
            receiver: Box::new(Port(port)),
            sender: Some(Box::new(sender)),
        })
    }

    fn peer(&self) -> String {
        format!("serial {} at {} baud", self.port, self.baud)
    }
}

struct Port(Box<dyn SerialPort>);

impl Receiver for Port {
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received> {
        if self.0.timeout() != wait {
            self.0.set_timeout(wait)?;
        }
        // A port without bytes is not at its end.
        match read_some(&mut self.0, BLOCK, bytes)? {
            Received::End => Ok(Received::Nothing),
            received => Ok(received),
        }
    }
}

impl Sender for Port {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use super::*;
    use serialport::TTYPort;
    use std::io::Read;

    const WAIT: Duration = Duration::from_millis(200);

    /// A pair of pseudo terminals: the end of an instrument, and the link to it.
    fn linked() -> (TTYPort, Ends) {
        let (instrument, port) = TTYPort::pair().unwrap();
        let spec = SerialSpec {
            port: port.name().unwrap(),
            baud: 115_200,
        };
        // The link opens it alone.
        drop(port);
        (instrument, spec.open().unwrap())
    }

    #[test]
    fn bytes_of_both_directions_arrive_unchanged() {
        let (mut instrument, mut link) = linked();
        let mut bytes = Vec::new();
        assert!(matches!(link.receiver.receive(WAIT, &mut bytes), Ok(Received::Nothing)));
        // All bytes: a terminal would change some of them.
        let all: Vec<u8> = (0..=255).collect();
        instrument.write_all(&all).unwrap();
        while bytes.len() < all.len() {
            assert!(matches!(link.receiver.receive(WAIT, &mut bytes), Ok(Received::Bytes)));
        }
        assert_eq!(bytes, all);
        link.sender.unwrap().send(&all).unwrap();
        instrument.set_timeout(WAIT).unwrap();
        let mut sent = [0; 256];
        instrument.read_exact(&mut sent).unwrap();
        assert_eq!(sent[..], all);
    }

    #[test]
    fn an_instrument_that_is_unplugged_ends_the_link() {
        let (instrument, mut link) = linked();
        drop(instrument);
        let mut bytes = Vec::new();
        assert!(link.receiver.receive(WAIT, &mut bytes).is_err());
    }

    #[test]
    fn a_port_that_does_not_exist_is_an_error() {
        let spec = SerialSpec {
            port: "/dev/no port".into(),
            baud: 9600,
        };
        assert!(spec.open().is_err());
        assert_eq!(spec.peer(), "serial /dev/no port at 9600 baud");
    }
}
