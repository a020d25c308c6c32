//! Work in parts: some runs of a campaign, some cases of a stress, or the searches of a tuning from some starts, as a file; and
//! the whole from such files.
//!
//! A file is a sequence of CBOR values (RFC 8742): its format, a [head](Head) that says which work it belongs to, a row
//! for each number, and the [effort](Effort). Numbers keep every bit. The parts of a work, in any order, give the rows
//! of one process. Parts of other designs, programs, kernels, platforms or seeds are refused. Rows pass one by one:
//! neither a writer nor a reader keeps them.

use ciborium::Value;
use ciborium::de::Error as Cbor;
use core::fmt;
use core::ops::Range;
use fusion::design::Design;
use fusion::provenance::Provenance;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead, Write};
use std::sync::Arc;
use thiserror::Error;

/// The first entry of every file, and the layout of what follows; another one is refused.
const FORMAT: (&str, u32) = ("fusion part", 3);

/// The kind of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// The runs of a design over its seeds.
    Montecarlo,
    /// The runs of several designs over the same seeds.
    Compare,
    /// The cases of a catalogue of faults.
    Stress,
    /// Drawn cases.
    Draw,
    /// The searches of a tuning, each from another start.
    Tune,
}

impl Kind {
    /// The number of the first unit: runs count from 0, cases from 1.
    const fn first(self) -> u64 {
        match self {
            Self::Montecarlo | Self::Compare | Self::Tune => 0,
            Self::Stress | Self::Draw => 1,
        }
    }

    /// The name of a unit.
    const fn unit(self) -> &'static str {
        match self {
            Self::Montecarlo | Self::Compare => "run",
            Self::Stress | Self::Draw => "case",
            Self::Tune => "start",
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Montecarlo => "`fusion montecarlo`",
            Self::Compare => "`fusion compare`",
            Self::Stress => "`fusion stress`",
            Self::Draw => "`fusion stress --draw`",
            Self::Tune => "`fusion tune`",
        })
    }
}

/// A design that works.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Subject {
    /// Its name among several.
    pub name: String,
    /// The inputs of the runs; the seed is that of the whole work.
    pub provenance: Provenance,
    /// The line with which the design describes itself.
    pub description: String,
    /// Whether its data are simulated.
    pub is_simulated: bool,
    /// The kernel that computed, and the architecture and system that it ran on: results are equal to the bit for
    /// equal ones only.
    pub platform: String,
}

impl Subject {
    /// The design under a name, with the seed of the work.
    #[must_use]
    pub fn new(name: &str, design: &Design, seed: u64) -> Self {
        let kernel = design.filter.kernel.unwrap_or_default().name();
        Self {
            name: name.to_owned(),
            provenance: Provenance::of(design, Some(seed)),
            description: design.run.description.clone(),
            is_simulated: design.simulation.is_some(),
            platform: format!("{kernel} {} {}", std::env::consts::ARCH, std::env::consts::OS),
        }
    }
}

/// The head of a file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Head {
    /// The kind of work.
    pub kind: Kind,
    /// The designs that work.
    pub subjects: Vec<Subject>,
    /// The numbers of its runs or cases.
    pub numbers: Range<u64>,
    /// The end of all numbers; `None` if the work may go on without end.
    pub end: Option<u64>,
    /// The command of the work, without its numbers and files, as a user types it.
    pub again: String,
    /// The beginning of the command that repeats one run; empty where a row says it.
    pub run: String,
    /// Further entries that all parts of the work share, and that differ between works.
    pub shared: Value,
}

/// The cost of a part.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Effort {
    /// Wall-clock time \[s\], the sum over several parts.
    pub seconds: f64,
    /// The number of threads, the most of several parts.
    pub threads: usize,
}

/// Why parts do not make a whole.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Unreadable {
    /// A part is at fault.
    #[error("`{part}`: {why}")]
    In {
        /// Its name.
        part: String,
        /// The reason.
        why: Box<Self>,
    },
    /// The file cannot be read.
    #[error("it cannot be read: {0}")]
    Io(#[from] io::Error),
    /// The file ends before its work does.
    #[error("it ends after {done} of {all} {unit}s, so that its worker was stopped or its copy was cut: write it again with `{again}`")]
    Cut {
        /// Complete rows.
        done: u64,
        /// Rows that the head announces.
        all: u64,
        /// The name of a row.
        unit: &'static str,
        /// The command.
        again: String,
    },
    /// A row has wrong bytes.
    #[error("row {row}: {reason}: write the part again with `{again}`")]
    Damaged {
        /// The row from 1.
        row: u64,
        /// The reason.
        reason: String,
        /// The command.
        again: String,
    },
    /// It is another kind of file.
    #[error("this is no part of a campaign: `fusion montecarlo --part`, and that of `compare`, `stress` and `tune`, writes one")]
    Other,
    /// It was written by a program with another layout.
    #[error("it has layout {0}, this program reads layout {wanted}: write the part again with this program", wanted = FORMAT.1)]
    Layout(u32),
    /// It belongs to another work.
    #[error("it belongs to another campaign: its {what} is {found}, that of the first part is {wanted}")]
    Mixed {
        /// The entry that differs.
        what: &'static str,
        /// Its value here.
        found: String,
        /// Its value in the first part.
        wanted: String,
    },
    /// A number is in two parts.
    #[error("{unit} {number} is in two parts: leave one of them out")]
    Twice {
        /// The name of a unit.
        unit: &'static str,
        /// The number.
        number: u64,
    },
    /// Numbers are in no part.
    #[error("{unit}s {from} to {to} are in no part: write them with `{again}`")]
    Missing {
        /// The name of a unit.
        unit: &'static str,
        /// The first missing number.
        from: u64,
        /// The last one.
        to: u64,
        /// The command.
        again: String,
    },
    /// No file was given.
    #[error("name at least one part")]
    Empty,
}

impl Head {
    /// A head without commands, and without [further entries](Head::sharing).
    #[must_use]
    pub fn new(kind: Kind, subjects: Vec<Subject>, numbers: Range<u64>, end: Option<u64>) -> Self {
        Self {
            kind,
            subjects,
            numbers,
            end,
            again: String::new(),
            run: String::new(),
            shared: Value::Null,
        }
    }

    /// With further entries that all parts share.
    ///
    /// # Errors
    /// It cannot be written as CBOR.
    pub fn sharing(self, shared: &impl Serialize) -> io::Result<Self> {
        Ok(Self {
            shared: Value::serialized(shared).map_err(io::Error::other)?,
            ..self
        })
    }

    /// The command for these numbers.
    fn again(&self, numbers: &Range<u64>, file: &str) -> String {
        format!("{} --runs {}..{} --part {file}", self.again, numbers.start, numbers.end)
    }

    /// Refuses a part of another work.
    fn belongs(&self, part: &Self) -> Result<(), Unreadable> {
        let same = |what, wanted: String, found: String| match wanted == found {
            true => Ok(()),
            false => Err(Unreadable::Mixed { what, found, wanted }),
        };
        let names = |head: &Self| {
            let names: Vec<&str> = head.subjects.iter().map(|s| s.name.as_str()).collect();
            names.join(", ")
        };
        same("command", self.kind.to_string(), part.kind.to_string())?;
        same("list of designs", names(self), names(part))?;
        for (own, other) in self.subjects.iter().zip(&part.subjects) {
            let seed = |p: &Provenance| p.seed.map_or_else(|| "none".to_owned(), |seed| seed.to_string());
            let (a, b) = (&own.provenance, &other.provenance);
            same("design", a.hash.clone(), b.hash.clone())?;
            same("program", a.version.clone(), b.version.clone())?;
            same("seed", seed(a), seed(b))?;
            same("platform", own.platform.clone(), other.platform.clone())?;
        }
        let all = |head: &Self| {
            head.end.map_or_else(
                || "open".to_owned(),
                |end| format!("{} {}s", end - head.kind.first(), head.kind.unit()),
            )
        };
        same("number of all", all(self), all(part))?;
        // As bytes, because NaN is not equal to itself.
        match bytes(&self.shared)? == bytes(&part.shared)? {
            true => Ok(()),
            false => match self.kind {
                Kind::Tune => same("list of options", "not".to_owned(), "another one".to_owned()),
                _ => same("list of cases", "not".to_owned(), "of other faults, sizes or limits".to_owned()),
            },
        }
    }
}

fn bytes(value: &Value) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    ciborium::into_writer(value, &mut bytes).map_err(io::Error::other)?;
    Ok(bytes)
}

/// A part that is being written.
#[derive(Debug)]
pub struct Writer<W>(W);

impl<W: Write> Writer<W> {
    /// Writes the head.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn begin(out: W, head: &Head) -> io::Result<Self> {
        let mut writer = Self(out);
        writer.put(&FORMAT)?;
        writer.put(head)?;
        Ok(writer)
    }

    /// Writes the next row.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn put(&mut self, row: &impl Serialize) -> io::Result<()> {
        ciborium::into_writer(row, &mut self.0).map_err(|e| match e {
            ciborium::ser::Error::Io(e) => e,
            e @ ciborium::ser::Error::Value(_) => io::Error::other(e),
        })
    }

    /// Ends the part after its last row.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn end(mut self, effort: Effort) -> io::Result<()> {
        self.put(&effort)?;
        self.0.flush()
    }
}

/// Opens the bytes of a part, each time from its beginning.
pub type Source = Box<dyn Fn() -> io::Result<Box<dyn BufRead>> + Send + Sync>;

/// A part that can be read any number of times.
pub struct Part {
    name: String,
    head: Head,
    source: Source,
}

impl fmt::Debug for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Part")
            .field("name", &self.name)
            .field("head", &self.head)
            .finish_non_exhaustive()
    }
}

impl Part {
    /// Reads the head of a part; errors call it by its name.
    ///
    /// # Errors
    /// [`Unreadable`], if it is another kind of file.
    pub fn open(name: &str, source: Source) -> Result<Self, Unreadable> {
        let head = Self::head(&source).map(|(head, _)| head);
        Ok(Self {
            head: head.map_err(|why| within(name, why))?,
            name: name.to_owned(),
            source,
        })
    }

    /// The part in memory.
    ///
    /// # Errors
    /// As [`Part::open`].
    pub fn in_memory(name: &str, bytes: Arc<[u8]>) -> Result<Self, Unreadable> {
        Self::open(name, Box::new(move || Ok(Box::new(io::Cursor::new(Arc::clone(&bytes))))))
    }

    /// The head, and the rest of the file.
    fn head(source: &Source) -> Result<(Head, Box<dyn BufRead>), Unreadable> {
        let mut file = source()?;
        let other = |e: Cbor<io::Error>| match e {
            Cbor::Io(e) if e.kind() != io::ErrorKind::UnexpectedEof => Unreadable::Io(e),
            _ => Unreadable::Other,
        };
        let (format, layout): (String, u32) = ciborium::from_reader(&mut file).map_err(other)?;
        match (format == FORMAT.0, layout == FORMAT.1) {
            (false, _) => Err(Unreadable::Other),
            (_, false) => Err(Unreadable::Layout(layout)),
            _ => Ok((ciborium::from_reader(&mut file).map_err(other)?, file)),
        }
    }

    /// Passes its rows in order.
    fn rows<T: DeserializeOwned>(&self, each: &mut dyn FnMut(T) -> io::Result<()>) -> Result<Effort, Unreadable> {
        let (head, mut file) = Self::head(&self.source)?;
        let again = || head.again(&head.numbers, &self.name);
        let all = head.numbers.end.saturating_sub(head.numbers.start);
        let wrong = |done: u64, e: Cbor<io::Error>| match e {
            Cbor::Io(e) if e.kind() == io::ErrorKind::UnexpectedEof => Unreadable::Cut {
                done,
                all,
                unit: head.kind.unit(),
                again: again(),
            },
            Cbor::Io(e) => Unreadable::Io(e),
            e => Unreadable::Damaged {
                row: done + 1,
                reason: match e {
                    Cbor::Semantic(_, reason) => reason,
                    Cbor::RecursionLimitExceeded => "values are nested too deeply".to_owned(),
                    _ => "this is no CBOR".to_owned(),
                },
                again: again(),
            },
        };
        for done in 0..all {
            each(ciborium::from_reader(&mut file).map_err(|e| wrong(done, e))?)?;
        }
        let effort = ciborium::from_reader(&mut file).map_err(|e| wrong(all, e))?;
        match file.fill_buf()? {
            [] => Ok(effort),
            _ => Err(wrong(all, Cbor::Semantic(None, "there is more after the end".to_owned()))),
        }
    }
}

fn within(name: &str, why: Unreadable) -> Unreadable {
    Unreadable::In {
        part: name.to_owned(),
        why: Box::new(why),
    }
}

/// The parts of a work, in order of their numbers.
#[derive(Debug)]
pub struct Parts(Vec<Part>);

impl From<Part> for Parts {
    /// One part, whether or not it is the whole.
    fn from(part: Part) -> Self {
        Self(vec![part])
    }
}

impl Parts {
    /// All parts of a work, in any order.
    ///
    /// # Errors
    /// [`Unreadable`], if a part belongs to another work, and if a number is in two parts or in none.
    pub fn whole(parts: Vec<Part>) -> Result<Self, Unreadable> {
        let first = parts.first().ok_or(Unreadable::Empty)?.head.kind.first();
        Self::from_number(parts, first)
    }

    /// The parts of a work from a number on, in any order.
    ///
    /// # Errors
    /// As [`Parts::whole`].
    pub fn from_number(mut parts: Vec<Part>, mut next: u64) -> Result<Self, Unreadable> {
        let first = parts.first().ok_or(Unreadable::Empty)?;
        for part in &parts {
            first.head.belongs(&part.head).map_err(|why| within(&part.name, why))?;
        }
        parts.sort_by_key(|part| part.head.numbers.start);
        let head = parts[0].head.clone();
        let unit = head.kind.unit();
        let missing = |numbers: Range<u64>| Unreadable::Missing {
            unit,
            from: numbers.start,
            to: numbers.end - 1,
            again: head.again(&numbers, "FILE"),
        };
        for part in &parts {
            let Range { start: number, end } = part.head.numbers;
            if number < next {
                return Err(within(&part.name, Unreadable::Twice { unit, number }));
            }
            if number > next {
                return Err(missing(next..number));
            }
            next = end;
        }
        match head.end {
            Some(end) if end > next => Err(missing(next..end)),
            _ => Ok(Self(parts)),
        }
    }

    /// The head of the first part.
    #[must_use]
    pub fn head(&self) -> &Head {
        &self.0[0].head
    }

    /// The further entries of the head.
    ///
    /// # Errors
    /// [`Unreadable`], if it is not what is asked for.
    pub fn shared<T: DeserializeOwned>(&self) -> Result<T, Unreadable> {
        self.head().shared.deserialized().map_err(|e| Unreadable::Io(io::Error::other(e)))
    }

    /// Passes all rows in order. One row is in memory at a time.
    ///
    /// # Errors
    /// [`Unreadable`], if a part is damaged; the errors of `each`.
    pub fn rows<T: DeserializeOwned>(&self, each: &mut dyn FnMut(T) -> io::Result<()>) -> Result<Effort, Unreadable> {
        let mut all = Effort::default();
        for part in &self.0 {
            let effort = part.rows(each).map_err(|why| within(&part.name, why))?;
            all.seconds += effort.seconds;
            all.threads = all.threads.max(effort.threads);
        }
        Ok(all)
    }

    /// The design that works, the further entries of the head, and all rows in memory.
    ///
    /// # Errors
    /// As [`Parts::rows`].
    pub fn read<S: DeserializeOwned, T: DeserializeOwned>(&self) -> Result<(Subject, S, Vec<T>), Unreadable> {
        let subject = self.head().subjects.first().cloned().ok_or(Unreadable::Empty)?;
        let mut rows = Vec::new();
        self.rows(&mut |row| {
            rows.push(row);
            Ok(())
        })?;
        Ok((subject, self.shared()?, rows))
    }

    /// Writes all of them as one part.
    ///
    /// # Errors
    /// As [`Parts::rows`], and the errors of the writer.
    pub fn join(&self, out: impl Write) -> Result<(), Unreadable> {
        let mut head = self.head().clone();
        head.numbers.end = self.0.iter().map(|part| part.head.numbers.end).max().unwrap_or(head.numbers.end);
        let mut whole = Writer::begin(out, &head)?;
        let effort = self.rows(&mut |row: Value| whole.put(&row))?;
        Ok(whole.end(effort)?)
    }

    /// The row of a number, read again.
    ///
    /// # Errors
    /// As [`Parts::rows`].
    pub fn row<T: DeserializeOwned>(&self, number: u64) -> Result<Option<T>, Unreadable> {
        let Some(part) = self.0.iter().find(|part| part.head.numbers.contains(&number)) else {
            return Ok(None);
        };
        let (mut next, mut found) = (part.head.numbers.start, None);
        let mut keep = |row| {
            found = (next == number).then_some(row).or(found.take());
            next += 1;
            Ok(())
        };
        part.rows(&mut keep).map_err(|why| within(&part.name, why))?;
        Ok(found)
    }
}
