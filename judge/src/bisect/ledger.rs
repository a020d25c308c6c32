//! A ledger: a line for each measurement.

use fusion::observe::{RunEvent, RunObserver};
use fusion_core::filter::Verdict;
use fusion_core::runner::{Event, Halt};
use std::fmt::Write as _;
use std::io::{self, BufRead, ErrorKind, Write};

/// The first line, which names the fields.
pub(super) const HEAD: &str = "fusion ledger 1\ttime_ns\tsensor\trow\tverdict\tnis\tmeasured\tpredicted\tnoise\tresidual\tsigma\n";
/// The fields of a line.
const FIELDS: [&str; 10] = [
    "time_ns",
    "sensor",
    "row",
    "verdict",
    "nis",
    "measured",
    "predicted",
    "noise",
    "residual",
    "sigma",
];

/// A measurement in a ledger.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry(String);

impl Entry {
    /// The fields with their names. Lists have commas between their numbers.
    pub fn fields(&self) -> impl Iterator<Item = (&'static str, &str)> {
        FIELDS.into_iter().zip(self.0.split('\t'))
    }

    fn field(&self, name: &str) -> &str {
        self.fields().find(|(known, _)| *known == name).map_or("", |(_, content)| content)
    }

    /// The time of validity \[ns\].
    #[must_use]
    pub fn time_ns(&self) -> i64 {
        self.field("time_ns").parse().unwrap_or_default()
    }

    /// The sensor, after the stages around its filter.
    #[must_use]
    pub fn sensor(&self) -> &str {
        self.field("sensor")
    }

    /// The number of its row in the source.
    #[must_use]
    pub fn row(&self) -> &str {
        self.field("row")
    }
}

/// Reads a ledger.
#[derive(Debug)]
pub struct Ledger<R> {
    lines: R,
    number: u64,
}

impl<R: BufRead> Ledger<R> {
    /// Reads the head.
    ///
    /// # Errors
    /// It cannot be read, or is not a ledger.
    pub fn read(mut lines: R) -> io::Result<Self> {
        let mut head = String::new();
        lines.read_line(&mut head)?;
        if head != HEAD {
            let message = "this file is not a ledger of `fusion run --ledger`, or of another version";
            return Err(io::Error::new(ErrorKind::InvalidData, message));
        }
        Ok(Self { lines, number: 1 })
    }

    /// The next measurement; `None` after the last.
    ///
    /// # Errors
    /// The ledger cannot be read, or is damaged.
    #[expect(clippy::should_implement_trait, reason = "an error is not an item")]
    pub fn next(&mut self) -> io::Result<Option<Entry>> {
        let mut line = String::new();
        self.number += 1;
        if self.lines.read_line(&mut line)? == 0 {
            return Ok(None);
        }
        line.truncate(line.trim_end_matches('\n').len());
        if line.split('\t').count() != FIELDS.len() {
            let message = format!("line {} of the ledger is damaged", self.number);
            return Err(io::Error::new(ErrorKind::InvalidData, message));
        }
        Ok(Some(Entry(line)))
    }
}

/// Observes a run, and writes its ledger.
#[derive(Debug)]
pub struct LedgerWriter<W> {
    out: W,
    line: String,
}

impl<W: Write> LedgerWriter<W> {
    /// Begins a ledger.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(mut out: W) -> io::Result<Self> {
        out.write_all(HEAD.as_bytes())?;
        Ok(Self { out, line: String::new() })
    }

    /// Ends the ledger, and returns the writer.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }

    /// Adds numbers with all their digits: as the shortest text that is read as the same number.
    fn list(&mut self, numbers: &[f64]) {
        for (k, number) in numbers.iter().enumerate() {
            let comma = if k == 0 { "" } else { "," };
            // A String takes everything.
            let _ = write!(self.line, "{comma}{number:?}");
        }
    }
}

impl<W: Write> RunObserver for LedgerWriter<W> {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter {
            filter,
            event: Event::Updated { sensor, update, time, row },
        } = event
        else {
            return Ok(());
        };
        let verdict = match update.verdict {
            Verdict::Accepted => "accepted",
            Verdict::Rejected => "rejected",
            Verdict::Reacquired => "reacquired",
            Verdict::Undefined(_) => "undefined",
            Verdict::Unusable => "unusable",
        };
        self.line.clear();
        let name = filter.sensors.get(*sensor).map_or("", |sensor| &sensor.name);
        let _ = write!(self.line, "{}\t{name}\t{}\t{verdict}\t", time.nanos(), row.number);
        self.list(&[update.nis]);
        let lists = [
            update.value,
            update.predicted,
            update.noise,
            update.residual,
            update.innovation_sigma,
        ];
        for numbers in lists {
            self.line.push('\t');
            self.list(numbers);
        }
        self.line.push('\n');
        Ok(self.out.write_all(self.line.as_bytes())?)
    }
}
