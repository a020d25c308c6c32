//! Files that grow, and named pipes.

use super::{BLOCK, Ends, LinkSpec, Received, Receiver, Sender, read_some};
use fusion::models::register;
use schemars::JsonSchema;
use serde::Deserialize;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The interval between two looks at a file that has not grown.
const LOOK: Duration = Duration::from_millis(5);

/// A file that another program writes while it is read. If the file becomes shorter or is replaced, it is read anew.
#[derive(Debug, Deserialize)]
#[serde(try_from = "FileTable")]
pub struct FileSpec(FileTable);

/// A file that another program writes while it is read. If the file becomes shorter or is replaced, it is read anew. Paths
/// start at the working directory.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FileTable {
    /// The file that is read.
    path: Option<PathBuf>,
    /// Reads only what is added from now on. Without it, the file is read from its beginning.
    #[serde(default)]
    only_new: bool,
    /// The file to which outputs are appended.
    append_to: Option<PathBuf>,
}

impl TryFrom<FileTable> for FileSpec {
    type Error = &'static str;

    fn try_from(table: FileTable) -> Result<Self, Self::Error> {
        if table.path.is_none() && table.append_to.is_none() {
            return Err("a link of the type `file` has `path`, `append_to` or both");
        }
        Ok(Self(table))
    }
}

register! { Link, "file", FileTable, r#"path = "receiver.nmea""# }

#[typetag::deserialize(name = "file")]
impl LinkSpec for FileSpec {
    fn open(&self) -> io::Result<Ends> {
        let append = |path: &PathBuf| OpenOptions::new().append(true).create(true).open(path);
        let sender = self.0.append_to.as_ref().map(append).transpose()?;
        let receiver: Box<dyn Receiver> = match &self.0.path {
            Some(path) => Box::new(Growing::open(path, self.0.only_new)?),
            None => Box::new(Silent),
        };
        Ok(Ends {
            receiver,
            sender: sender.map(|file| Box::new(Appended(file)) as Box<dyn Sender>),
        })
    }

    fn waits(&self) -> bool {
        true
    }

    fn peer(&self) -> String {
        let path = self.0.path.iter().chain(&self.0.append_to).next();
        path.map_or_else(String::new, |path| path.display().to_string())
    }
}

/// A file, with the number of bytes that were read.
struct Growing {
    path: PathBuf,
    file: File,
    done: u64,
    is_anew: bool,
}

impl Growing {
    fn open(path: &Path, only_new: bool) -> io::Result<Self> {
        let mut file = File::open(path)?;
        let done = if only_new { file.seek(SeekFrom::End(0))? } else { 0 };
        Ok(Self {
            path: path.to_owned(),
            file,
            done,
            is_anew: false,
        })
    }

    /// Opens the file again, if it has become shorter than what was read of it.
    fn look_again(&mut self) -> io::Result<()> {
        match std::fs::metadata(&self.path) {
            Ok(now) if now.is_file() && now.len() < self.done => {
                *self = Self::open(&self.path, false)?;
                self.is_anew = true;
                Ok(())
            }
            // A file that is being replaced is not there for a moment.
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }
}

impl Receiver for Growing {
    fn receive(&mut self, wait: Duration, bytes: &mut Vec<u8>) -> io::Result<Received> {
        let until = Instant::now() + wait;
        loop {
            let before = bytes.len();
            match read_some(&mut self.file, BLOCK, bytes)? {
                Received::Bytes => {
                    self.done += (bytes.len() - before) as u64;
                    let is_anew = core::mem::take(&mut self.is_anew);
                    return Ok(if is_anew { Received::Anew } else { Received::Bytes });
                }
                _ => self.look_again()?,
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(Received::Nothing);
            }
            std::thread::sleep(left.min(LOOK));
        }
    }
}

/// The receiver of a link that only sends.
struct Silent;

impl Receiver for Silent {
    fn receive(&mut self, wait: Duration, _: &mut Vec<u8>) -> io::Result<Received> {
        std::thread::sleep(wait);
        Ok(Received::Nothing)
    }
}

struct Appended(File);

impl Sender for Appended {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}
