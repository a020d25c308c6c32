//! The record of a live run: all bytes that came in, with their arrivals, as MCAP.
//!
//! | topic | a message is |
//! |---|---|
//! | `/link/NAME` | the bytes that a link gave at once, as they came; `log_time` is their arrival |
//! | `/link/NAME/state` | `anew`: the bytes that follow do not continue those before; `closed` |
//!
//! Records are not in chunks, so that all that was written before a kill can be read. `log_time` is Unix time. It differs
//! from GPS time by a constant within a session, which the metadata at the start of the session has, in nanoseconds.
//!
//! Source   MCAP specification, version 0 (<https://mcap.dev/spec>)

use crate::inbox::{Event, Happened};
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, BufWriter, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// The name of the metadata, and of their only entry.
const METADATA: &str = "fusion";
const AHEAD: &str = "gps_minus_unix_ns";
/// A record of a message has at most this number of bytes.
const LONGEST: u64 = 64 << 20;

/// The codes of records.
mod op {
    pub(super) const HEADER: u8 = 0x01;
    pub(super) const FOOTER: u8 = 0x02;
    pub(super) const CHANNEL: u8 = 0x04;
    pub(super) const MESSAGE: u8 = 0x05;
    pub(super) const METADATA: u8 = 0x0C;
    pub(super) const DATA_END: u8 = 0x0F;
}

/// Writes a record.
#[derive(Debug)]
pub(crate) struct Recorder {
    file: BufWriter<File>,
    /// GPS time less Unix time.
    ahead: i64,
    count: u32,
    at: u64,
    /// The number of bytes that the operating system has.
    safe: u64,
    body: Vec<u8>,
}

impl Recorder {
    /// Begins a record of these links.
    ///
    /// # Errors
    /// The file exists, or cannot be written.
    pub(crate) fn create(path: &Path, links: &[String], ahead: i64) -> io::Result<Self> {
        let file = OpenOptions::new().write(true).create_new(true).open(path)?;
        let mut recorder = Self::of(file, 0, ahead);
        recorder.raw(&MAGIC)?;
        recorder.body.clear();
        recorder.text("");
        recorder.text("fusion");
        recorder.put(op::HEADER)?;
        recorder.session()?;
        recorder.channels(links)?;
        Ok(recorder)
    }

    /// Continues a record after this byte; later bytes are cut off.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn append(path: &Path, at: u64, ahead: i64) -> io::Result<Self> {
        let mut file = OpenOptions::new().write(true).open(path)?;
        file.set_len(at)?;
        file.seek(SeekFrom::End(0))?;
        let mut recorder = Self::of(file, at, ahead);
        recorder.session()?;
        Ok(recorder)
    }

    pub(crate) fn of(file: File, at: u64, ahead: i64) -> Self {
        Self {
            file: BufWriter::new(file),
            ahead,
            count: 0,
            at,
            safe: at,
            body: Vec::new(),
        }
    }

    /// The number of bytes that survive a kill of the program.
    pub(crate) const fn safe(&self) -> u64 {
        self.safe
    }

    /// The number of bytes so far.
    pub(crate) const fn at(&self) -> u64 {
        self.at
    }

    fn session(&mut self) -> io::Result<()> {
        self.body.clear();
        self.text(METADATA);
        let value = self.ahead.to_string();
        let length = 4 + AHEAD.len() + 4 + value.len();
        self.body.extend_from_slice(&(length as u32).to_le_bytes());
        self.text(AHEAD);
        self.text(&value);
        self.put(op::METADATA)
    }

    fn channels(&mut self, links: &[String]) -> io::Result<()> {
        for (number, name) in links.iter().enumerate() {
            for (is_state, topic) in [(false, format!("/link/{name}")), (true, format!("/link/{name}/state"))] {
                self.body.clear();
                self.body.extend_from_slice(&channel(number, is_state).to_le_bytes());
                // No schema.
                self.body.extend_from_slice(&0_u16.to_le_bytes());
                self.text(&topic);
                self.text(if is_state { "text" } else { "bytes" });
                self.body.extend_from_slice(&0_u32.to_le_bytes());
                self.put(op::CHANNEL)?;
            }
        }
        Ok(())
    }

    /// Writes what has happened on a link.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn write(&mut self, event: &Event) -> io::Result<()> {
        let state: Option<&[u8]> = match &event.what {
            Happened::Bytes(_) => None,
            Happened::Anew => Some(b"anew"),
            Happened::Closed => Some(b"closed"),
        };
        self.body.clear();
        self.body.extend_from_slice(&channel(event.link, state.is_some()).to_le_bytes());
        self.body.extend_from_slice(&self.count.to_le_bytes());
        self.count = self.count.wrapping_add(1);
        let unix = u64::try_from(event.arrival - self.ahead).unwrap_or_default();
        self.body.extend_from_slice(&unix.to_le_bytes());
        self.body.extend_from_slice(&unix.to_le_bytes());
        match (&event.what, state) {
            (Happened::Bytes(bytes), _) => self.body.extend_from_slice(bytes),
            (_, state) => self.body.extend_from_slice(state.unwrap_or_default()),
        }
        self.put(op::MESSAGE)
    }

    /// Passes everything to the operating system: it is there after a kill of the program.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.file.flush()?;
        self.safe = self.at;
        Ok(())
    }

    /// Writes the end.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        self.body.clear();
        self.body.extend_from_slice(&0_u32.to_le_bytes());
        self.put(op::DATA_END)?;
        // The record has no summary.
        self.body.clear();
        self.body.resize(20, 0);
        self.put(op::FOOTER)?;
        self.raw(&MAGIC)?;
        self.flush()
    }

    fn text(&mut self, text: &str) {
        self.body.extend_from_slice(&(text.len() as u32).to_le_bytes());
        self.body.extend_from_slice(text.as_bytes());
    }

    fn put(&mut self, code: u8) -> io::Result<()> {
        let mut head = [code; 9];
        head[1..].copy_from_slice(&(self.body.len() as u64).to_le_bytes());
        self.raw(&head)?;
        let body = core::mem::take(&mut self.body);
        let written = self.raw(&body);
        self.body = body;
        written
    }

    fn raw(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}

/// The channel of a link, or of its states.
const fn channel(link: usize, is_state: bool) -> u16 {
    (2 * link + 1 + is_state as usize) as u16
}

/// An entry of a record.
pub(crate) enum Entry {
    Event(Event),
    /// A session begins: the clock of arrivals was started again.
    Session,
}

/// Reads a record.
#[derive(Debug)]
pub(crate) struct Record {
    path: PathBuf,
    file: BufReader<File>,
    /// The bytes of the records read so far.
    at: u64,
    ahead: i64,
    /// The link of each channel, and whether it is that of its states.
    channels: Vec<(u16, Option<(usize, bool)>)>,
    links: Vec<String>,
    /// The links of the record.
    recorded: Vec<String>,
    body: Vec<u8>,
}

impl Record {
    /// Opens a record, for these links.
    ///
    /// # Errors
    /// It cannot be read, or is not a record.
    pub(crate) fn open(path: &Path, links: &[String]) -> io::Result<Self> {
        let mut record = Self {
            path: path.to_owned(),
            file: BufReader::new(File::open(path)?),
            at: MAGIC.len() as u64,
            ahead: 0,
            channels: Vec::new(),
            links: links.to_vec(),
            recorded: Vec::new(),
            body: Vec::new(),
        };
        let mut magic = [0; MAGIC.len()];
        record.file.read_exact(&mut magic).map_err(|_| record.is_none())?;
        if magic == MAGIC { Ok(record) } else { Err(record.is_none()) }
    }

    fn is_none(&self) -> io::Error {
        io::Error::new(
            ErrorKind::InvalidData,
            format!("{} is not a record of `fusion live`", self.path.display()),
        )
    }

    /// Refuses a record without one of these links.
    ///
    /// # Errors
    /// It has no such link, or cannot be read.
    pub(crate) fn needs(&mut self, needed: &[&str]) -> io::Result<()> {
        // The channels come before the first message.
        while self.file.fill_buf()?.first().is_some_and(|code| *code != op::MESSAGE) && self.read()?.is_some() {}
        let Some(missing) = needed.iter().find(|link| !self.recorded.iter().any(|known| known == *link)) else {
            return Ok(());
        };
        let known = self.recorded.join("`, `");
        let message = format!("the record has no link `{missing}`; it has `{known}`. The links of the design need the names of the record");
        Err(io::Error::new(ErrorKind::InvalidData, message))
    }

    /// Goes to this byte, where a record of the file begins, after the head with the channels has been read.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn go_to(&mut self, at: u64) -> io::Result<()> {
        while self.at < at && self.channels.len() < 2 * self.links.len() && self.read()?.is_some() {}
        self.file.seek(SeekFrom::Start(at))?;
        self.at = at;
        Ok(())
    }

    /// The number of bytes before the next record of the file.
    pub(crate) const fn at(&self) -> u64 {
        self.at
    }

    /// Reads the next record of the file into the body, and returns its code; `None` at the end, or where the file is cut
    /// off.
    fn read(&mut self) -> io::Result<Option<u8>> {
        let mut head = [0; 9];
        if !filled(&mut self.file, &mut head)? {
            return Ok(None);
        }
        let length = u64::from_le_bytes([head[1], head[2], head[3], head[4], head[5], head[6], head[7], head[8]]);
        if length > LONGEST {
            let message = format!("{}: the record after byte {} is damaged", self.path.display(), self.at);
            return Err(io::Error::new(ErrorKind::InvalidData, message));
        }
        self.body.resize(length as usize, 0);
        if !filled(&mut self.file, &mut self.body)? {
            return Ok(None);
        }
        self.at += head.len() as u64 + length;
        match head[0] {
            op::CHANNEL => self.channel()?,
            op::METADATA => self.session(),
            _ => {}
        }
        Ok(Some(head[0]))
    }

    fn channel(&mut self) -> io::Result<()> {
        let damaged = || io::Error::new(ErrorKind::InvalidData, "a channel of the record is damaged");
        let number = self
            .body
            .first_chunk()
            .map(|bytes| u16::from_le_bytes(*bytes))
            .ok_or_else(damaged)?;
        let (topic, _) = self.body.get(4..).and_then(text).ok_or_else(damaged)?;
        let Some(name) = topic.strip_prefix("/link/") else {
            return Err(self.is_none());
        };
        if !name.ends_with("/state") {
            self.recorded.push(name.to_owned());
        }
        let known = |name: &str| self.links.iter().position(|link| link == name);
        let of_state = name.strip_suffix("/state").and_then(known).map(|link| (link, true));
        let link = of_state.or_else(|| known(name).map(|link| (link, false)));
        self.channels.push((number, link));
        Ok(())
    }

    fn session(&mut self) {
        let entry = text(&self.body).filter(|(name, _)| *name == METADATA).and_then(|(_, rest)| {
            let (key, rest) = text(rest.get(4..)?)?;
            let (value, _) = text(rest)?;
            (key == AHEAD).then(|| value.parse().ok())?
        });
        self.ahead = entry.unwrap_or(self.ahead);
    }

    /// The next entry; `None` at the end. The bytes of a link that is not declared are left out.
    ///
    /// # Errors
    /// The file cannot be read, or is damaged.
    pub(crate) fn next(&mut self) -> io::Result<Option<Entry>> {
        loop {
            match self.read()? {
                None | Some(op::DATA_END) => return Ok(None),
                Some(op::METADATA) => return Ok(Some(Entry::Session)),
                Some(op::MESSAGE) => {
                    if let Some(event) = self.event() {
                        return Ok(Some(Entry::Event(event)));
                    }
                }
                Some(_) => {}
            }
        }
    }

    fn event(&self) -> Option<Event> {
        let (head, data) = self.body.split_at_checked(22)?;
        let number = u16::from_le_bytes([head[0], head[1]]);
        let unix = u64::from_le_bytes(*head[6..].first_chunk()?);
        let (link, is_state) = self.channels.iter().find(|(known, _)| *known == number)?.1?;
        let what = match data {
            b"anew" if is_state => Happened::Anew,
            _ if is_state => Happened::Closed,
            bytes => Happened::Bytes(bytes.to_vec()),
        };
        Some(Event {
            link,
            arrival: i64::try_from(unix).ok()?.checked_add(self.ahead)?,
            what,
        })
    }
}

/// Takes a text off the front.
fn text(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    let (text, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    Some((core::str::from_utf8(text).ok()?, rest))
}

/// Fills a buffer; false if the file ends before.
fn filled(file: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match file.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(link: usize, arrival: i64, bytes: &[u8]) -> Event {
        let what = Happened::Bytes(bytes.to_vec());
        Event { link, arrival, what }
    }

    /// A folder for this test alone.
    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("fusion-record-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn events(path: &Path, links: &[String], at: u64) -> Vec<Option<Event>> {
        let mut record = Record::open(path, links).unwrap();
        if at > 0 {
            record.go_to(at).unwrap();
        }
        let mut all = Vec::new();
        while let Some(entry) = record.next().unwrap() {
            all.push(match entry {
                Entry::Event(event) => Some(event),
                Entry::Session => None,
            });
        }
        all
    }

    #[test]
    fn what_was_written_is_read_also_after_a_cut_and_a_continuation() {
        let path = folder("round").join("in.mcap");
        let links = ["imu".to_owned(), "gnss".to_owned()];
        // GPS time of arrivals, with 18 leap seconds.
        let (ahead, zero) = (-315_964_800_000_000_000 + 18_000_000_000, 1_400_000_000_000_000_001);
        let mut recorder = Recorder::create(&path, &links, ahead).unwrap();
        let all = [
            event(0, zero, b"one"),
            event(1, zero + 1, &[0, 255, 10]),
            Event {
                link: 1,
                arrival: zero + 7,
                what: Happened::Anew,
            },
            event(0, zero + 8, b""),
        ];
        all.iter().for_each(|event| recorder.write(event).unwrap());
        let at = recorder.at();
        recorder.write(&event(0, zero + 9, b"after the checkpoint")).unwrap();
        recorder.flush().unwrap();
        let known: Vec<_> = core::iter::once(None).chain(all.iter().cloned().map(Some)).collect();
        assert_eq!(events(&path, &links, 0)[..5], known);
        assert_eq!(events(&path, &links, at), [Some(event(0, zero + 9, b"after the checkpoint"))]);

        // A kill within a record: it is not there, and the next session begins in its place.
        drop(recorder);
        let length = std::fs::metadata(&path).unwrap().len();
        File::options().write(true).open(&path).unwrap().set_len(length - 3).unwrap();
        assert_eq!(events(&path, &links, 0), known);
        let mut recorder = Recorder::append(&path, at, ahead + 5).unwrap();
        recorder.write(&event(1, zero + 20, b"more")).unwrap();
        recorder.finish().unwrap();
        let after = events(&path, &links, at);
        assert_eq!(after, [None, Some(event(1, zero + 20, b"more"))]);
        // A link that is not declared any more is left out.
        assert_eq!(events(&path, &links[1..], 0).iter().flatten().count(), 3);
    }

    #[test]
    fn every_cut_of_a_record_gives_the_events_before_it() {
        let path = folder("cuts").join("in.mcap");
        let links = ["imu".to_owned()];
        let mut recorder = Recorder::create(&path, &links, 0).unwrap();
        let mut ends = Vec::new();
        for k in 0..5 {
            recorder.write(&event(0, k, &[k as u8; 30])).unwrap();
            ends.push(recorder.at());
        }
        recorder.finish().unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in MAGIC.len()..whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let sure = ends.iter().filter(|end| **end <= cut as u64).count();
            assert_eq!(events(&path, &links, 0).iter().flatten().count(), sure, "cut at {cut}");
        }
    }

    #[test]
    fn another_reader_of_mcap_reads_a_record() {
        let path = folder("other").join("in.mcap");
        let mut recorder = Recorder::create(&path, &["imu".to_owned()], 0).unwrap();
        recorder.write(&event(0, 123, b"bytes")).unwrap();
        recorder.finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let messages: Vec<_> = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
        assert_eq!(messages.len(), 1);
        let message = &messages[0];
        assert_eq!(
            (message.channel.topic.as_str(), message.log_time, &*message.data),
            ("/link/imu", 123, &b"bytes"[..])
        );
    }
}
