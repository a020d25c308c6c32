//! The feed of a live run: events of the links in, rows out; and estimates out while it waits.

use crate::decoder::{Decoded, Decoder};
use crate::inbox::{Event, Happened, Inbox, Next};
use crate::latency::Latency;
use crate::leaving::Mailbox;
use crate::output::Outgoing;
use crate::placing::{Base, Placing};
use crate::record::{Entry, Record, Recorder};
use crate::relation::Relation;
use crate::resume::Lately;
use crate::sensors::Sensors;
use crate::speaker::Speaker;
use crate::status::{Board, SourceStatus};
use fusion::config::{Diagnostic, Diagnostics};
use fusion::core::memory::{Memory, Tape};
use fusion::core::runner::{Row, StreamId};
use fusion::core::time::Time;
use fusion::health::Names;
use fusion::rows::{Aboard, Feed, SourceReport, SourceStatistics};
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

/// Without an output, the feed looks at its status at this interval.
const IDLE: Duration = Duration::from_millis(500);

/// Where events come from.
pub(crate) enum Events {
    /// The links, while they are open.
    Links(Arc<Inbox>),
    /// A record.
    Record(Record),
}

/// A source that is fed by a link.
pub(crate) struct Fed {
    pub(crate) name: String,
    pub(crate) stream: StreamId,
    pub(crate) decoder: Decoder,
    pub(crate) placing: Placing,
    /// Its bytes lately, for a checkpoint.
    pub(crate) lately: Lately,
    /// The number of its rows before those that its reader counts.
    pub(crate) number_before: u64,
    /// The number of its last row.
    pub(crate) last_number: u64,
    /// Its rows since the first start.
    pub(crate) tally: Tally,
}

/// The numbers of rows of a source, with those before a checkpoint.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// The rows that were delivered, and the gaps between them.
    delivered: SourceReport,
    /// The report at the checkpoint. Its numbers of rows read and left out are used.
    before: SourceReport,
    /// The report of the reader when it is back at the place of the checkpoint.
    again: SourceReport,
}

impl Tally {
    /// The report of all rows; `read` is that of the reader.
    fn report(&self, mut read: SourceReport) -> SourceReport {
        read.subtract(&self.again);
        let mut report = SourceReport {
            rows: self.before.rows,
            skipped: self.before.skipped.clone(),
            disturbed: self.before.disturbed.clone(),
            ..SourceReport::default()
        };
        report.join(read);
        SourceReport {
            used: self.delivered.used,
            first: self.delivered.first,
            last: self.delivered.last,
            longest_gap: self.delivered.longest_gap,
            ..report
        }
    }
}

impl Fed {
    pub(crate) fn status(&self) -> SourceStatus {
        let relation = self.placing.relation();
        SourceStatus {
            name: self.name.clone(),
            rows: self.tally.delivered.used,
            unplaced: self.placing.unplaced,
            relation: relation.map(|r| (r.now() as f64 * 1e-9, r.rate() * 1e6, r.mean_delay())),
            jumps: relation.map_or(0, Relation::jumps),
            trouble: self.decoder.trouble.clone(),
        }
    }
}

/// A row that waits for the filter.
#[derive(Clone, Debug, Default)]
struct Ready {
    source: usize,
    time: Time,
    arrival: Time,
    number: u64,
    values: Vec<f64>,
}

fusion::core::memory!(Ready {
    source,
    time,
    arrival,
    number,
    values
});

/// An output at its rate.
pub(crate) struct Due {
    pub(crate) mailbox: Arc<Mailbox>,
    pub(crate) every: Duration,
    pub(crate) next: Instant,
    pub(crate) count: u64,
}

impl Due {
    /// The next estimate is the first one after now.
    fn skip_to(&mut self, now: Instant) {
        let late = now.saturating_duration_since(self.next).as_nanos();
        let steps = late / self.every.as_nanos().max(1) + 1;
        let ahead = steps.saturating_mul(self.every.as_nanos().max(1));
        let ahead = Duration::from_nanos(u64::try_from(ahead).unwrap_or(u64::MAX));
        self.next = self.next.checked_add(ahead).unwrap_or(now + IDLE);
    }
}

/// The parts that send estimates.
pub(crate) struct Sending {
    pub(crate) outputs: Vec<Due>,
    pub(crate) sensors: Sensors,
    pub(crate) names: Names,
    /// GPS time at the time zero of the filter.
    pub(crate) time_zero: Option<i64>,
    pub(crate) clock: crate::ArrivalClock,
    /// The end of a run with a declared length.
    pub(crate) until: Option<Instant>,
}

/// A record that is written.
pub(crate) struct Recording {
    pub(crate) path: PathBuf,
    pub(crate) recorder: Option<Recorder>,
    /// The bytes of a record that could not be continued. The filter runs on without it.
    pub(crate) ended_at: Option<u64>,
    pub(crate) links: Vec<String>,
    pub(crate) ahead: i64,
}

/// The feed.
pub(crate) struct LiveFeed {
    pub(crate) events: Events,
    /// The sources that each link feeds.
    pub(crate) of_links: Vec<Vec<usize>>,
    pub(crate) sources: Vec<Fed>,
    pub(crate) base: Base,
    pub(crate) sending: Option<Sending>,
    pub(crate) recording: Option<Recording>,
    pub(crate) board: Board,
    pub(crate) speaker: Speaker,
    /// From the arrival of a row to the estimate with it.
    latency: Latency,
    pending: VecDeque<Ready>,
    row: Ready,
    /// The arrival of the row that the filter has been given.
    at_work: Option<i64>,
    /// The arrival of the latest event.
    latest: i64,
    /// The newest time of a row.
    newest: Option<Time>,
    /// The bytes of the record before the next event, at the checkpoint that is resumed.
    resumes_at: Option<u64>,
    has_ended: bool,
}

impl core::fmt::Debug for LiveFeed {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("LiveFeed")
            .field("waiting", &self.pending.len())
            .finish_non_exhaustive()
    }
}

/// A message about the record, which stops the run.
fn failed(path: &Path, error: &io::Error) -> Diagnostics {
    Diagnostic::error(format!("the record {}: {error}", path.display())).into()
}

impl LiveFeed {
    pub(crate) fn new(events: Events, of_links: Vec<Vec<usize>>, sources: Vec<Fed>, base: Base, board: Board, speaker: Speaker) -> Self {
        Self {
            events,
            of_links,
            sources,
            base,
            sending: None,
            recording: None,
            board,
            speaker,
            latency: Latency::default(),
            pending: VecDeque::new(),
            row: Ready::default(),
            at_work: None,
            latest: 0,
            newest: None,
            resumes_at: None,
            has_ended: false,
        }
    }

    /// Opens the record that is written; after a checkpoint, takes what it has since then first.
    fn begin(&mut self) -> Result<(), Diagnostics> {
        let at = self.resumes_at.take();
        let Some(recording) = &self.recording else { return Ok(()) };
        if recording.recorder.is_some() || recording.ended_at.is_some() {
            return Ok(());
        }
        self.sources.iter().for_each(|source| source.decoder.count());
        let (path, links, ahead) = (recording.path.clone(), recording.links.clone(), recording.ahead);
        let wrong = |error: io::Error| failed(&path, &error);
        let recorder = match at {
            None => Recorder::create(&path, &links, ahead).map_err(|error| {
                let is_there = error.kind() == io::ErrorKind::AlreadyExists;
                let help = "give another name: a record is not overwritten. A run that was killed continues with `--resume`";
                let d = Diagnostic::error(format!("the record {}: {error}", path.display()));
                if is_there { d.help(help) } else { d }
            })?,
            Some(at) => {
                self.catch_up(&path, &links, at).map_err(wrong)?;
                let mut record = Record::open(&path, &links).map_err(wrong)?;
                record.go_to(at).map_err(wrong)?;
                while let Some(entry) = record.next().map_err(wrong)? {
                    self.entry(entry);
                }
                let recorder = Recorder::append(&path, record.at(), ahead).map_err(wrong)?;
                self.session();
                recorder
            }
        };
        if let Some(recording) = &mut self.recording {
            recording.recorder = Some(recorder);
        }
        Ok(())
    }

    /// Brings the readers to where they were at the checkpoint: by the latest bytes, or by the whole record.
    fn catch_up(&mut self, path: &Path, links: &[String], at: u64) -> io::Result<()> {
        for (link, sources) in self.of_links.iter().enumerate() {
            for &number in sources {
                let Fed {
                    decoder,
                    lately,
                    number_before,
                    tally,
                    ..
                } = &mut self.sources[number];
                if lately.feed(decoder, number_before) {
                    tally.again = decoder.report_so_far();
                    continue;
                }
                decoder.end(&mut |_| {});
                let mut record = Record::open(path, links)?;
                while record.at() < at
                    && let Some(entry) = record.next()?
                {
                    match entry {
                        Entry::Event(Event {
                            link: of,
                            what: Happened::Bytes(bytes),
                            ..
                        }) if of == link => decoder.push(&bytes, &mut |_| {}),
                        Entry::Event(Event { link: of, .. }) if of != link => {}
                        Entry::Event(_) | Entry::Session => decoder.end(&mut |_| {}),
                    }
                }
                tally.again = decoder.report_so_far();
            }
        }
        Ok(())
    }

    /// The program was started again: the clock of arrivals is another one, and the links were opened anew.
    fn session(&mut self) {
        self.base.forget();
        self.sources.iter_mut().for_each(|source| source.placing.forget());
        for link in 0..self.of_links.len() {
            let arrival = self.latest;
            self.take(&Event {
                link,
                arrival,
                what: Happened::Anew,
            });
        }
    }

    fn entry(&mut self, entry: Entry) {
        match entry {
            Entry::Event(event) => self.take(&event),
            Entry::Session => self.session(),
        }
    }

    /// Decodes an event.
    fn take(&mut self, event: &Event) {
        self.latest = event.arrival;
        let (pending, base, keeps) = (&mut self.pending, &mut self.base, self.recording.is_some());
        for &number in self.of_links.get(event.link).into_iter().flatten() {
            let Fed {
                name,
                decoder,
                placing,
                lately,
                number_before,
                last_number,
                tally,
                ..
            } = &mut self.sources[number];
            let mut ready = |mut row: Decoded| {
                row.stamp.number += *number_before;
                *last_number = row.stamp.number;
                tally.delivered.deliver(row.stamp.time);
                if keeps {
                    lately.row(&row);
                }
                if let Some(time) = placing.place(row.stamp.time, event.arrival, base) {
                    pending.push_back(Ready {
                        source: number,
                        time,
                        arrival: Time::from_nanos(event.arrival),
                        number: row.stamp.number,
                        values: row.values,
                    });
                }
            };
            match &event.what {
                Happened::Bytes(bytes) => {
                    decoder.push(bytes, &mut ready);
                    if keeps {
                        lately.add(bytes);
                    }
                }
                Happened::Anew | Happened::Closed => {
                    decoder.end(&mut ready);
                    *number_before = *last_number;
                    *lately = Lately::default();
                }
            }
            if let Some(why) = decoder.new_trouble() {
                self.speaker.say(format!("source `{name}`: {why}"));
            }
        }
    }

    /// Waits for the next event, at most until an estimate is due; false at the end.
    fn wait(&mut self) -> Result<bool, Diagnostics> {
        let now = Instant::now();
        let due = self.sending.iter().flat_map(|sending| {
            let outputs = sending.outputs.iter().map(|output| output.next);
            outputs.chain(sending.until)
        });
        let until = due.min().unwrap_or(now + IDLE).min(now + IDLE);
        let mut next = None;
        if let Events::Links(inbox) = &self.events {
            next = Some(inbox.next(now));
            if matches!(next, Some(Next::Nothing)) {
                // The record is safe before the filter waits.
                self.write(Recorder::flush);
                next = None;
            }
        }
        match &mut self.events {
            Events::Record(record) => match record.next() {
                Ok(Some(entry)) => {
                    self.entry(entry);
                    Ok(true)
                }
                Ok(None) => Ok(false),
                Err(error) => Err(Diagnostic::error(format!("the record cannot be read on: {error}")).into()),
            },
            Events::Links(inbox) => match next.unwrap_or_else(|| inbox.next(until)) {
                Next::End => Ok(false),
                Next::Nothing => Ok(true),
                Next::Event(event) => {
                    self.write(|recorder| recorder.write(&event));
                    self.take(&event);
                    Ok(true)
                }
            },
        }
    }

    /// Writes to the record. If this fails, the record ends here and a line says so: estimates matter more.
    fn write(&mut self, write: impl FnOnce(&mut Recorder) -> io::Result<()>) {
        let Some(recording) = &mut self.recording else { return };
        let Some(recorder) = &mut recording.recorder else { return };
        if let Err(error) = write(recorder) {
            (recording.ended_at, recording.recorder) = (Some(recorder.safe()), None);
            let path = recording.path.display();
            self.speaker
                .say(format!("the record {path} ends here, and the filter runs on without it: {error}"));
        }
    }

    /// Sends the estimates that are due. An output that is behind skips what it has missed.
    fn send(&mut self, aboard: &mut dyn Aboard) {
        let Some(sending) = &mut self.sending else { return };
        let now = Instant::now();
        if sending.outputs.iter().all(|output| output.next > now) {
            return;
        }
        let time = self.base.time_at(sending.clock.at(now)).map(Time::from_nanos);
        let newest = self.newest;
        // Rows that are stamped ahead of the clock are not predicted back.
        let at = time.into_iter().chain(newest).max();
        let health = aboard.health().cloned();
        let reasons: Vec<String> = health
            .iter()
            .flat_map(|health| &health.reasons)
            .map(|reason| sending.names.of(*reason).to_string())
            .collect();
        let estimate = Outgoing {
            number: 0,
            solution: at.and_then(|at| aboard.solution(at)),
            time: at.unwrap_or_default(),
            gps_nanos: at.and_then(|at| Some(sending.time_zero?.saturating_add(at.nanos()))),
            age: at.zip(newest).map(|(at, newest)| at.seconds_since(newest)),
            health: health.map(|health| health.state).unwrap_or_default(),
            reasons: reasons.into(),
            waits_for: aboard.waits_for().into(),
            sensors: sending.sensors.lock().unwrap_or_else(PoisonError::into_inner).clone().into(),
        };
        for output in sending.outputs.iter_mut().filter(|output| output.next <= now) {
            output.mailbox.put(Outgoing {
                number: output.count,
                ..estimate.clone()
            });
            output.count += 1;
            output.skip_to(now);
        }
    }

    /// Ends the readers and the record.
    fn end(&mut self) {
        if core::mem::replace(&mut self.has_ended, true) {
            return;
        }
        for source in &mut self.sources {
            source.decoder.end(&mut |_| {});
        }
        self.board.end(&self.sources, &self.latency);
        if let Some(sending) = &self.sending {
            sending.outputs.iter().for_each(|output| output.mailbox.close());
        }
        self.write(Recorder::finish);
    }
}

impl Drop for LiveFeed {
    fn drop(&mut self) {
        // A run that an error has stopped.
        self.end();
    }
}

impl Feed for LiveFeed {
    fn next(&mut self, aboard: &mut dyn Aboard) -> Result<Option<Row<'_>>, Diagnostics> {
        self.begin()?;
        if let (Some(sending), Some(arrival)) = (&self.sending, self.at_work.take()) {
            self.latency.add(sending.clock.now() - arrival);
        }
        while !self.has_ended {
            self.send(aboard);
            self.board.look(&self.sources, &self.latency);
            let is_over = |sending: &Sending| sending.until.is_some_and(|until| until <= Instant::now());
            if self.pending.is_empty() && (self.sending.as_ref().is_some_and(is_over) || !self.wait()?) {
                self.end();
            }
            let Some(ready) = self.pending.pop_front() else { continue };
            self.row = ready;
            self.newest = self.newest.max(Some(self.row.time));
            self.at_work = Some(self.row.arrival.nanos());
            return Ok(Some(Row {
                stream: self.sources[self.row.source].stream,
                time: self.row.time,
                number: self.row.number,
                values: &self.row.values,
                disturbed: &[],
                arrival: Some(self.row.arrival),
            }));
        }
        Ok(None)
    }

    fn memory(&mut self) -> Option<&mut dyn Memory> {
        // A checkpoint is of no use without the record that continues it.
        self.recording.is_some().then_some(self as &mut dyn Memory)
    }

    fn disturbable(&self) -> Vec<(usize, core::ops::Range<usize>)> {
        Vec::new()
    }

    fn statistics(&self) -> Vec<SourceStatistics> {
        let report = |source: &Fed| source.tally.report(source.decoder.report.clone());
        let one = |source: &Fed| SourceStatistics::new(&source.name, &report(source));
        self.sources.iter().map(one).collect()
    }
}

impl Memory for LiveFeed {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        if !tape.is_reading() {
            // The checkpoint refers to the file.
            self.write(Recorder::flush);
        }
        let mut at = self.recording.as_ref().map_or(0, |recording| {
            let written = recording.recorder.as_ref().map(Recorder::at);
            written.or(recording.ended_at).unwrap_or(0)
        });
        at.remember(tape);
        self.base.remember(tape);
        self.pending.remember(tape);
        self.latest.remember(tape);
        self.newest.remember(tape);
        for source in &mut self.sources {
            source.placing.remember(tape);
            source.lately.remember(tape);
            source.number_before.remember(tape);
            source.last_number.remember(tape);
            source.tally.delivered.remember(tape);
            let mut so_far = source.tally.report(source.decoder.report_so_far());
            so_far.remember(tape);
            if tape.is_reading() {
                source.tally.before = so_far;
            }
        }
        if tape.is_reading() && tape.is_sound() {
            self.resumes_at = Some(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// A disk without room. Writes to it fail on any Linux.
    const FULL: &str = "/dev/full";

    #[test]
    #[cfg(target_os = "linux")]
    fn a_disk_without_room_ends_the_record_and_not_the_filter() {
        let said = Arc::new(Mutex::new(Vec::new()));
        let hears = said.clone();
        let say = move |line: &str| hears.lock().unwrap().push(line.to_owned());
        let speaker = Speaker::new(Some(Arc::new(say))).unwrap();
        let inbox = Arc::new(Inbox::new(1, Arc::default()));
        let board = Board::new(None).unwrap();
        let mut feed = LiveFeed::new(Events::Links(inbox), vec![Vec::new()], Vec::new(), Base::new(None), board, speaker);
        let disk = std::fs::OpenOptions::new().write(true).open(FULL).unwrap();
        feed.recording = Some(Recording {
            path: FULL.into(),
            recorder: Some(Recorder::of(disk, 7, 0)),
            ended_at: None,
            links: vec!["unit".to_owned()],
            ahead: 0,
        });
        let event = Event {
            link: 0,
            arrival: 1,
            what: Happened::Bytes(vec![0; 1 << 16]),
        };
        for _ in 0..3 {
            feed.write(|recorder| recorder.write(&event));
            feed.write(Recorder::flush);
        }
        assert_eq!(
            feed.recording.as_ref().unwrap().ended_at,
            Some(7),
            "no byte is safe after those before"
        );
        feed.end();
        drop(feed);
        // The thread of the lines ends with the last speaker.
        let until = Instant::now() + Duration::from_secs(10);
        while Arc::strong_count(&said) > 1 && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(1));
        }
        let said = said.lock().unwrap();
        assert!(said.len() == 1 && said[0].contains("ends here, and the filter runs on"), "{said:?}");
    }
}
