//! Decodes the bytes of a link for one source, as they arrive.
//!
//! The reader of the source runs in its own thread, where it waits for bytes as for those of a slow file. The filter
//! gives it bytes and takes rows until the reader waits again, so that the two never work at the same time: the rows are a
//! function of the bytes, and any format can be read.

use fusion::design::{Design, SourceDesign};
use fusion::rows::{RowStream, SourceError, SourceReport, Stamp};
use fusion::run::open_one;
use fusion::source::{ArrivingBytes, OpenContext};
use std::io::{self, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;

/// A row as its source gives it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Decoded {
    pub(crate) stamp: Stamp,
    pub(crate) values: Vec<f64>,
}

/// The messages of a reader.
enum Said {
    Row(Decoded),
    /// It has used all bytes.
    Waits,
    /// It has ended, and the next bytes are read by a new one.
    Ended(SourceReport, Option<SourceError>),
}

/// The messages to a reader.
enum Told {
    Bytes(Vec<u8>),
    End,
}

/// The report of the current reader at its last row. It is written if it is needed.
#[derive(Debug, Default)]
struct Current {
    is_needed: AtomicBool,
    report: Mutex<SourceReport>,
}

impl Current {
    fn set(&self, report: impl FnOnce() -> SourceReport) {
        if self.is_needed.load(Ordering::Relaxed) {
            *self.report.lock().unwrap_or_else(PoisonError::into_inner) = report();
        }
    }
}

/// A source that reads arriving bytes.
#[derive(Debug)]
pub(crate) struct Decoder {
    tell: Sender<Told>,
    said: Receiver<Said>,
    /// The reader has read nothing.
    is_fresh: bool,
    /// The report of the readers that have ended.
    pub(crate) report: SourceReport,
    current: Arc<Current>,
    /// Why a reader ended, if no row came after it.
    pub(crate) trouble: Option<String>,
    is_trouble_new: bool,
}

impl Decoder {
    /// Starts the thread of the source with this number.
    ///
    /// # Errors
    /// The system has no more threads.
    pub(crate) fn start(design: Arc<Design>, source: usize, context: OpenContext) -> io::Result<Self> {
        let (tell, told) = channel();
        let (say, said) = channel();
        let current = Arc::<Current>::default();
        let of_reader = current.clone();
        let body = move || {
            let mut next = Some(told);
            while let Some(told) = next {
                next = read(told, (&say, &of_reader), &design.sources[source].block, &context);
            }
        };
        Builder::new().name("decoder".to_owned()).spawn(body)?;
        let mut decoder = Self {
            tell,
            said,
            is_fresh: true,
            report: SourceReport::default(),
            current,
            trouble: None,
            is_trouble_new: false,
        };
        decoder.listen(&mut |_| {});
        Ok(decoder)
    }

    /// From now on, [`report_so_far`](Self::report_so_far) has the rows of the current reader.
    pub(crate) fn count(&self) {
        self.current.is_needed.store(true, Ordering::Relaxed);
    }

    /// The report of all rows, up to the last one that was given.
    pub(crate) fn report_so_far(&self) -> SourceReport {
        let mut report = self.report.clone();
        report.join(self.current.report.lock().unwrap_or_else(PoisonError::into_inner).clone());
        report
    }

    /// Decodes bytes.
    pub(crate) fn push(&mut self, bytes: &[u8], take: &mut dyn FnMut(Decoded)) {
        self.is_fresh &= bytes.is_empty();
        self.told(Told::Bytes(bytes.to_vec()), take);
    }

    /// The bytes so far are not continued.
    pub(crate) fn end(&mut self, take: &mut dyn FnMut(Decoded)) {
        if !core::mem::replace(&mut self.is_fresh, true) {
            self.told(Told::End, take);
        }
    }

    /// Why a reader ended, once.
    pub(crate) fn new_trouble(&mut self) -> Option<&str> {
        if core::mem::replace(&mut self.is_trouble_new, false) {
            return self.trouble.as_deref();
        }
        None
    }

    fn told(&mut self, what: Told, take: &mut dyn FnMut(Decoded)) {
        // A thread that panicked says nothing any more.
        if self.tell.send(what).is_ok() {
            self.listen(take);
        }
    }

    /// Listens until the reader waits for bytes.
    fn listen(&mut self, take: &mut dyn FnMut(Decoded)) {
        while let Ok(said) = self.said.recv() {
            match said {
                Said::Row(row) => {
                    self.trouble = None;
                    take(row);
                }
                Said::Waits => return,
                Said::Ended(report, error) => {
                    self.report.join(report);
                    if let Some(error) = error {
                        let error = error.to_string();
                        // A reader that fails again and again says why once.
                        self.is_trouble_new |= self.trouble.as_ref() != Some(&error);
                        self.trouble = Some(error);
                    }
                }
            }
        }
    }
}

/// Reads a source to the end of its bytes, and returns the channel for the next reader; `None` if the filter has gone.
fn read(
    told: Receiver<Told>,
    (say, current): (&Sender<Said>, &Current),
    source: &SourceDesign,
    context: &OpenContext,
) -> Option<Receiver<Told>> {
    let (back, returned) = channel();
    let pipe = Pipe {
        told: Some(told),
        say: say.clone(),
        bytes: Vec::new(),
        done: 0,
        has_waited: false,
        has_ended: false,
        back,
    };
    let context = OpenContext {
        arriving: Some(ArrivingBytes::new(Box::new(pipe))),
        ..context.clone()
    };
    let (report, error) = match open_one(source, &context) {
        Err(error) => (SourceReport::default(), Some(error)),
        Ok(mut rows) => {
            let error = give(rows.as_mut(), say, current).err();
            (rows.report(), error)
        }
    };
    current.set(SourceReport::default);
    drop(context);
    say.send(Said::Ended(report, error)).ok()?;
    let (told, has_waited) = returned.recv().ok()?;
    if !has_waited {
        // It failed without a look at the bytes, and the next reader would too: these bytes are not read.
        say.send(Said::Waits).ok()?;
        told.recv().ok()?;
    }
    Some(told)
}

/// Gives the rows of a source, to its end.
fn give(rows: &mut dyn RowStream, say: &Sender<Said>, current: &Current) -> Result<(), SourceError> {
    let mut values = Vec::new();
    while let Some(stamp) = rows.next(&mut values)? {
        current.set(|| rows.report());
        let row = Decoded {
            stamp,
            values: values.clone(),
        };
        if say.send(Said::Row(row)).is_err() {
            break;
        }
    }
    Ok(())
}

/// The bytes that a reader waits for.
struct Pipe {
    told: Option<Receiver<Told>>,
    say: Sender<Said>,
    bytes: Vec<u8>,
    /// The bytes that were read.
    done: usize,
    has_waited: bool,
    has_ended: bool,
    /// Where the channel goes when the reader is dropped, with whether it has waited.
    back: Sender<(Receiver<Told>, bool)>,
}

impl Read for Pipe {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.done == self.bytes.len() && !self.has_ended {
            self.has_waited = true;
            let is_heard = self.say.send(Said::Waits).is_ok();
            match self.told.as_ref().filter(|_| is_heard).map(Receiver::recv) {
                Some(Ok(Told::Bytes(bytes))) => (self.bytes, self.done) = (bytes, 0),
                _ => self.has_ended = true,
            }
        }
        let left = &self.bytes[self.done..];
        let count = left.len().min(buffer.len());
        buffer[..count].copy_from_slice(&left[..count]);
        self.done += count;
        Ok(count)
    }
}

impl Drop for Pipe {
    fn drop(&mut self) {
        if let Some(told) = self.told.take() {
            // The other end is gone if the thread ends.
            let _ = self.back.send((told, self.has_waited));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::config::Document;
    use fusion::examine::build;

    fn decoder(source: &str) -> Decoder {
        let text = format!(
            "[process]\ntype = 'constant_velocity'\nacceleration_noise = 1\nposition_sigma = 10\nvelocity_sigma = 5\n\
             [run]\norigin = {{ latitude = 0.8, longitude = 0.1 }}\n\
             [sensor.fix]\ntype = 'gnss_position'\nsource = 'gnss'\nnoise = {{ sigma = 2 }}\n\
             [initial.start]\ntype = 'first_fix'\nsource = 'gnss'\nposition_sigma = 5\n\
             [initial.rest]\ntype = 'explicit'\nvelocity = [0, 0, 0]\nvelocity_sigma = 1\n{source}"
        );
        let (document, mistakes) = Document::parse("design.toml", &text);
        assert!(mistakes.is_empty(), "{mistakes:?}");
        let design = build(document).unwrap_or_else(|d| panic!("{d}"));
        Decoder::start(Arc::new(design), 0, OpenContext::default()).unwrap()
    }

    const CSV: &str = "[source.gnss]\ntype = 'csv'\npath = 'gnss.csv'\ntime.column = 't'\n\
                       channels.position = { latitude = 'lat', longitude = 'lon', height = 'h', unit = 'rad' }";

    fn pushed(decoder: &mut Decoder, bytes: &[u8]) -> Vec<f64> {
        let mut times = Vec::new();
        decoder.push(bytes, &mut |row| times.push(row.stamp.time.seconds()));
        times
    }

    #[test]
    fn a_row_is_there_with_its_last_byte_and_not_before() {
        let mut decoder = decoder(CSV);
        let none: [f64; 0] = [];
        assert_eq!(pushed(&mut decoder, b"t,lat,lo"), none);
        assert_eq!(pushed(&mut decoder, b"n,h\n1.0,0.8,0.1,5"), none);
        assert_eq!(pushed(&mut decoder, b"\n"), [1.0]);
        assert_eq!(pushed(&mut decoder, b"2.0,0.8,0.1,5\n3.0,0.8,0.1,5\n4.0,"), [2.0, 3.0]);
        // Stamps that jump or go back are the filter's business, and a wrong row is counted.
        assert_eq!(
            pushed(&mut decoder, b"0.8,0.1,5\n9000.0,0.8,0.1,5\nx,y\n3.5,0.8,0.1,5\n"),
            [4.0, 9000.0, 3.5]
        );
        decoder.end(&mut |_| {});
        assert_eq!((decoder.report.used, decoder.report.left_out()), (6, 1));
        // A second end finds no file without rows.
        decoder.end(&mut |_| {});
        assert_eq!((decoder.trouble.as_deref(), decoder.report.used), (None, 6));
    }

    #[test]
    fn another_peer_is_read_from_its_beginning() {
        let mut decoder = decoder(CSV);
        assert_eq!(pushed(&mut decoder, b"t,lat,lon,h\n1.0,0.8,0.1,5\n2.0,0."), [1.0]);
        let mut last = 0;
        decoder.end(&mut |_| last += 1);
        assert_eq!(last, 0, "half a row is no row");
        assert_eq!(pushed(&mut decoder, b"t,h,lat,lon\n7.0,5,0.8,0.1\n"), [7.0]);
    }

    #[test]
    fn a_reader_that_fails_begins_again_and_says_why() {
        let mut decoder = decoder(CSV);
        assert!(pushed(&mut decoder, b"a,b,c\n1,2,3\n4,5,6\n").is_empty());
        assert!(
            decoder.trouble.as_deref().is_some_and(|told| told.contains("has no column")),
            "{:?}",
            decoder.trouble
        );
        decoder.end(&mut |_| {});
        assert_eq!(pushed(&mut decoder, b"t,lat,lon,h\n1.0,0.8,0.1,5\n"), [1.0]);
    }
}
