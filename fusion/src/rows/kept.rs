//! Decoded rows in memory, for many runs over one log.

use super::{ProvidedChannel, RowStream, SourceError, SourceReport, Stamp};
use core::fmt;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// The decoded rows of sources, by name. The first run that opens a source decodes all of its rows; others share them.
/// The runs have to declare their sources alike, except for faults, which each run applies itself.
#[derive(Clone, Default)]
pub struct KeptRows(Arc<Mutex<BTreeMap<String, Option<Arc<Decoded>>>>>);

impl fmt::Debug for KeptRows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("KeptRows")
    }
}

impl KeptRows {
    /// The rows of a source, which `open` opens. A source with a row that cannot be decoded is not kept: a run may end
    /// before that row.
    ///
    /// # Errors
    /// Those of `open`.
    pub(crate) fn of(
        &self,
        name: &str,
        open: impl Fn() -> Result<Box<dyn RowStream>, SourceError>,
    ) -> Result<Box<dyn RowStream>, SourceError> {
        // A thread that panics leaves the map whole.
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !known.contains_key(name) {
            let kept = Decoded::all(open()?).ok().flatten().map(Arc::new);
            known.insert(name.to_owned(), kept);
        }
        match known.get(name).cloned().flatten() {
            Some(rows) => Ok(Box::new(Again { rows, next: 0 })),
            None => open(),
        }
    }
}

/// All rows of a source.
#[derive(Debug)]
struct Decoded {
    channels: Vec<ProvidedChannel>,
    stamps: Vec<Stamp>,
    /// The numbers of all rows, of `width` each.
    values: Vec<f64>,
    width: usize,
    report: SourceReport,
}

impl Decoded {
    /// `None` if its rows differ in width.
    fn all(mut source: Box<dyn RowStream>) -> Result<Option<Self>, SourceError> {
        let (mut stamps, mut values, mut row) = (Vec::new(), Vec::new(), Vec::new());
        let mut width = None;
        while let Some(stamp) = source.next(&mut row)? {
            if *width.get_or_insert(row.len()) != row.len() {
                return Ok(None);
            }
            stamps.push(stamp);
            values.extend_from_slice(&row);
        }
        Ok(Some(Self {
            channels: source.channels().to_vec(),
            stamps,
            values,
            width: width.unwrap_or(0),
            report: source.report(),
        }))
    }
}

/// The rows once more.
#[derive(Debug)]
struct Again {
    rows: Arc<Decoded>,
    next: usize,
}

impl RowStream for Again {
    fn channels(&self) -> &[ProvidedChannel] {
        &self.rows.channels
    }

    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Stamp>, SourceError> {
        let Some(stamp) = self.rows.stamps.get(self.next).copied() else {
            return Ok(None);
        };
        let width = self.rows.width;
        values.clear();
        values.extend_from_slice(&self.rows.values[self.next * width..(self.next + 1) * width]);
        self.next += 1;
        Ok(Some(stamp))
    }

    /// That of all rows, whether or not they have been read again.
    fn report(&self) -> SourceReport {
        self.rows.report.clone()
    }
}
