//! A campaign in parts: some of its runs as a file, and the whole from such files.
//!
//! A file is a sequence of CBOR values (RFC 8742): a head that says which campaign it belongs to, then a row for each
//! run. Numbers keep every bit. The parts of a campaign, in any order, give the rows of one process. Parts of other
//! designs, programs, kernels, platforms or seeds are refused.

use super::{Campaign, Independence, Pace, RunRow};
use ciborium::de::Error as Cbor;
use fusion::provenance::Provenance;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::io::{self, BufRead, Write};
use thiserror::Error;

/// The first entry of every file.
const FORMAT: &str = "fusion campaign";
/// The layout of a row; another one is refused.
const VERSION: u32 = 1;

/// The head of a file.
#[derive(Debug, Serialize, Deserialize)]
struct Head {
    format: String,
    layout: u32,
    provenance: Provenance,
    platform: String,
    description: String,
    is_simulated: bool,
    rows: usize,
    seconds: f64,
    threads: usize,
}

/// Why parts do not make a campaign.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Unreadable {
    /// The file cannot be read, or it ends too early.
    #[error("row {row}: {reason}")]
    Damaged {
        /// The row from 1; 0 is the head.
        row: usize,
        /// The reason.
        reason: String,
    },
    /// It is another kind of file.
    #[error("this is no part of a campaign: `fusion montecarlo --shard` writes one")]
    Other,
    /// It was written by a program with another layout of rows.
    #[error("its rows have layout {found}, this program reads layout {VERSION}: write the part again with this program")]
    Layout {
        /// The layout found.
        found: u32,
    },
    /// It belongs to another campaign.
    #[error("it belongs to another campaign: its {what} is {found}, that of the first part is {wanted}")]
    Mixed {
        /// The entry that differs.
        what: &'static str,
        /// Its value here.
        found: String,
        /// Its value in the first part.
        wanted: String,
    },
    /// A run is in two parts.
    #[error("run {0} is in two parts: leave one of them out")]
    Twice(u64),
    /// Runs are in no part.
    #[error("runs {from} to {to} are in no part")]
    Missing {
        /// The first missing run.
        from: u64,
        /// The last one.
        to: u64,
    },
    /// No file was given.
    #[error("name at least one part")]
    Empty,
}

fn damaged<T: core::fmt::Debug>(row: usize) -> impl Fn(Cbor<T>) -> Unreadable {
    move |e| Unreadable::Damaged {
        row,
        reason: match e {
            Cbor::Io(_) => "the file ends here, or cannot be read".to_owned(),
            Cbor::Syntax(at) => format!("no CBOR at byte {at} of the row"),
            Cbor::Semantic(_, reason) => reason,
            Cbor::RecursionLimitExceeded => "values are nested too deeply".to_owned(),
        },
    }
}

impl Campaign {
    /// Writes the campaign as a part of a larger one.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn write_part(&self, mut out: impl Write) -> io::Result<()> {
        let head = Head {
            format: FORMAT.to_owned(),
            layout: VERSION,
            provenance: self.provenance.clone(),
            platform: self.platform.clone(),
            description: self.description.clone(),
            is_simulated: self.is_simulated,
            rows: self.rows.len(),
            seconds: self.pace.seconds,
            threads: self.pace.threads,
        };
        ciborium::into_writer(&head, &mut out).map_err(io::Error::other)?;
        for row in &self.rows {
            ciborium::into_writer(row, &mut out).map_err(io::Error::other)?;
        }
        out.flush()
    }

    /// Reads a part.
    ///
    /// # Errors
    /// [`Unreadable`], if the file is damaged or another kind of file.
    pub fn read_part(mut file: impl BufRead) -> Result<Self, Unreadable> {
        let head: Head = ciborium::from_reader(&mut file).map_err(|e| match e {
            Cbor::Io(_) => damaged(0)(e),
            _ => Unreadable::Other,
        })?;
        if head.format != FORMAT {
            return Err(Unreadable::Other);
        }
        if head.layout != VERSION {
            return Err(Unreadable::Layout { found: head.layout });
        }
        let read = |row: usize| ciborium::from_reader(&mut file).map_err(damaged(row));
        let rows: Vec<RunRow> = (1..=head.rows).map(read).collect::<Result<_, _>>()?;
        if file.read(&mut [0]).is_ok_and(|more| more > 0) {
            let reason = format!("there is more behind the {} rows of the head", head.rows);
            return Err(Unreadable::Damaged {
                row: head.rows + 1,
                reason,
            });
        }
        Ok(Self {
            independence: Independence::of(head.is_simulated, &rows),
            pace: Pace {
                epochs: rows.iter().map(|row| row.epochs).sum(),
                seconds: head.seconds,
                threads: head.threads,
            },
            rows,
            provenance: head.provenance,
            description: head.description,
            is_simulated: head.is_simulated,
            platform: head.platform,
        })
    }

    /// The campaign that all parts make together, in any order. Its pace is the sum: of epochs, of seconds, and the
    /// most threads.
    ///
    /// # Errors
    /// [`Unreadable`], with the number of the part from 0: a part of another campaign, a run that is in two parts, runs
    /// that are in none.
    pub fn merge(parts: impl IntoIterator<Item = Self>) -> Result<Self, (usize, Unreadable)> {
        let mut parts = parts.into_iter();
        let mut whole = parts.next().ok_or((0, Unreadable::Empty))?;
        let mut known: BTreeSet<u64> = whole.rows.iter().map(|row| row.run).collect();
        for (number, part) in parts.enumerate() {
            whole.belongs(&part).map_err(|e| (number + 1, e))?;
            if let Some(row) = part.rows.iter().find(|row| !known.insert(row.run)) {
                return Err((number + 1, Unreadable::Twice(row.run)));
            }
            whole.pace.epochs += part.pace.epochs;
            whole.pace.seconds += part.pace.seconds;
            whole.pace.threads = whole.pace.threads.max(part.pace.threads);
            whole.rows.extend(part.rows);
        }
        whole.rows.sort_by_key(|row| row.run);
        let mut next = 0;
        for row in &whole.rows {
            if row.run > next {
                let (from, to) = (next, row.run - 1);
                return Err((0, Unreadable::Missing { from, to }));
            }
            next = row.run + 1;
        }
        whole.independence = Independence::of(whole.is_simulated, &whole.rows);
        Ok(whole)
    }

    /// Refuses a part of another campaign.
    fn belongs(&self, part: &Self) -> Result<(), Unreadable> {
        let (own, other) = (&self.provenance, &part.provenance);
        let seed = |p: &Provenance| p.seed.map_or_else(|| "none".to_owned(), |seed| seed.to_string());
        let entries = [
            ("design", own.hash.clone(), other.hash.clone()),
            ("program", own.version.clone(), other.version.clone()),
            ("seed", seed(own), seed(other)),
            ("platform", self.platform.clone(), part.platform.clone()),
        ];
        match entries.into_iter().find(|(_, own, other)| own != other) {
            Some((what, wanted, found)) => Err(Unreadable::Mixed { what, found, wanted }),
            None => Ok(()),
        }
    }
}
