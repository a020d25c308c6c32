//! Standard input and output.

use super::{BLOCK, Ends, LinkSpec, Received, Receiver, Sender};
use fusion::models::register;
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::{self, ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver as Channel, RecvTimeoutError, sync_channel};
use std::thread::Builder;
use std::time::Duration;

/// Blocks of the input that wait for the link.
const WAITING: usize = 16;

/// The standard input of the program; outputs go to its standard output.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StdioSpec {}

register! { Link, "stdio", StdioSpec, "" }

#[typetag::deserialize(name = "stdio")]
impl LinkSpec for StdioSpec {
    fn open(&self) -> io::Result<Ends> {
        let (to, blocks) = sync_channel(WAITING);
        // A read of the standard input cannot be ended: it has its own thread, which ends with the input.
        Builder::new().name("stdin".to_owned()).spawn(move || {
            let mut input = io::stdin().lock();
            loop {
                let mut block = vec![0; BLOCK];
                let read = match input.read(&mut block) {
                    Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                    read => read,
                };
                let is_last = !matches!(read, Ok(1..));
                let sent = to.send(read.map(|count| {
                    block.truncate(count);
                    block
                }));
                if is_last || sent.is_err() {
                    return;
                }
            }
        })?;
        Ok(Ends {
            receiver: Box::new(Input(blocks)),
            sender: Some(Box::new(Stdout)),
        })
    }

    fn ends(&self) -> bool {
        true
    }

    fn waits(&self) -> bool {
        true
    }

    fn peer(&self) -> String {
        "standard input and output".to_owned()
    }
}

struct Input(Channel<io::Result<Vec<u8>>>);

impl Receiver for Input {
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received> {
        match self.0.recv_timeout(wait) {
            Ok(Ok(block)) if block.is_empty() => Ok(Received::End),
            Ok(block) => {
                bytes.extend(block?);
                Ok(Received::Bytes)
            }
            Err(RecvTimeoutError::Timeout) => Ok(Received::Nothing),
            Err(RecvTimeoutError::Disconnected) => Ok(Received::End),
        }
    }
}

struct Stdout;

impl Sender for Stdout {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut out = io::stdout().lock();
        out.write_all(bytes)?;
        out.flush()
    }
}
