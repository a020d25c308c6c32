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
