//! The recorded sources of a design, opened as the feed of a run.

use super::reference::{Reference, Scored, check};
use super::{Options, RunData, data_dir};
use crate::assembly::Assembly;
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::{Design, Named, SourceDesign};
use crate::rows::{Aboard, Faulted, Feed, Merged, ProvidedChannel, Row, RowStream, SourceError, SourceReport, SourceStatistics, Stamp};
use crate::source::{OpenContext, SharedReaders, Unread};
use core::ops::Range;
use fusion_core::runner::StreamId;
use std::collections::BTreeSet;

/// Rows of recorded sources.
#[derive(Debug)]
struct Recorded {
    merged: Merged,
    /// The bytes still to be read of their files.
    unread: Unread,
    /// The same before the first row; files held in memory do not count.
    all: u64,
    /// The origin of each merged source.
    origins: Vec<Origin>,
    /// The statistics of the reference sources, which were read ahead.
    reference: Vec<SourceStatistics>,
}

/// Where the rows of a merged source belong.
#[derive(Debug)]
struct Origin {
    name: String,
    /// Its stream in the assembly.
    stream: StreamId,
    /// Its declaration.
    node: Node,
}

/// Opens the sources of `design` and reads its reference.
pub(super) fn open(design: &Design, assembly: &Assembly, options: &Options) -> Result<RunData, Diagnostics> {
    if design.sources.is_empty() {
        let place = design.document.root().place();
        let help = "add [source.NAME] tables for recorded data, or a [simulation]";
        return Err(Diagnostic::error("this design has no data to run on").at(place).help(help).into());
    }
    let unread = Unread::default();
    let opened = open_all(design, options, &unread, |_| true)?;
    let (mut sources, mut origins) = (Vec::new(), Vec::new());
    let (mut reference, mut reference_statistics) = (Reference::None, Vec::new());
    let wanted = scored(design)?;
    let runner = &assembly.runner;
    let ports = runner.takers().chain(runner.starters()).map(|(_, _, stream)| stream);
    let heard: BTreeSet<StreamId> = ports.chain(runner.sensors().iter().map(|sensor| sensor.port.stream)).collect();
    for (named, mut source) in opened {
        if let Some(scored) = wanted.iter().find(|scored| scored.name() == named.name) {
            reference.add(scored, source.as_mut())?;
            reference_statistics.push(SourceStatistics::new(&named.name, &source.report()));
        } else if let Some(stream) = assembly.streams.iter().position(|s| s.name == named.name) {
            sources.push(if heard.contains(&stream) {
                source
            } else {
                Box::new(Unheard(source))
            });
            origins.push(Origin {
                name: named.name.clone(),
                stream,
                node: named.node.clone(),
            });
        }
    }
    Ok(RunData {
        reference,
        rows: Box::new(Recorded {
            merged: Merged::new(sources),
            all: unread.bytes(),
            unread,
            origins,
            reference: reference_statistics,
        }),
    })
}

/// The reference of a design alone, for rows that come from elsewhere.
pub(super) fn reference(design: &Design, options: &Options) -> Result<Reference, Diagnostics> {
    let wanted = scored(design)?;
    let of = |name: &str| wanted.iter().find(|scored| scored.name() == name);
    let mut reference = Reference::None;
    for (named, mut source) in open_all(design, options, &Unread::default(), |name| of(name).is_some())? {
        if let Some(scored) = of(&named.name) {
            reference.add(scored, source.as_mut())?;
        }
    }
    Ok(reference)
}

/// The sources of the reference of a design.
fn scored(design: &Design) -> Result<Vec<Scored>, Diagnostics> {
    let checked = design.reference.as_ref().map(|r| check(r, &design.sources));
    Ok(checked.transpose()?.unwrap_or_default())
}

type Opened<'a> = (&'a Named<SourceDesign>, Box<dyn RowStream>);

/// All wanted sources with their faults, or all of their mistakes.
fn open_all<'a>(
    design: &'a Design,
    options: &Options,
    unread: &Unread,
    is_wanted: impl Fn(&str) -> bool,
) -> Result<Vec<Opened<'a>>, Diagnostics> {
    let (mut d, mut opened) = (Diagnostics::new(), Vec::new());
    let (data_dir, shared) = (data_dir(design, options), SharedReaders::default());
    for named in design.sources.iter().filter(|named| is_wanted(&named.name)) {
        let context = OpenContext {
            data_dir: data_dir.clone(),
            name: named.name.clone(),
            origin: design.run.origin.map(Into::into),
            seed: options.seed.unwrap_or(design.run.seed),
            unread: unread.clone(),
            shared: shared.clone(),
            rows: options.rows.get(&named.name).cloned(),
            arriving: None,
        };
        let open = || undisturbed(&named.block, &context);
        let rows = match &options.kept {
            Some(kept) => kept.of(&named.name, open),
            None => open(),
        };
        match rows.and_then(|rows| disturbed(rows, &named.block, &context)) {
            Ok(source) => opened.push((named, source)),
            Err(error) => d.extend(error.diagnostics(&named.node)),
        }
    }
    d.unless_errors(opened)
}

/// A source with its faults.
///
/// # Errors
/// Mistakes of its declaration or of its file.
pub fn open_one(source: &SourceDesign, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
    disturbed(undisturbed(source, context)?, source, context)
}

/// A source before its faults.
fn undisturbed(source: &SourceDesign, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
    match &context.rows {
        Some(supply) => source.source.open_rows(supply.open()?, context),
        None => source.source.open(context),
    }
}

/// The rows of a source with its faults.
fn disturbed(rows: Box<dyn RowStream>, source: &SourceDesign, context: &OpenContext) -> Result<Box<dyn RowStream>, SourceError> {
    let faulted = Faulted::new(rows, &source.faults, |fault| context.fault_seed(fault))?;
    Ok(Box::new(faulted))
}

/// A source without users, such as that of a sensor with `enabled = false`: a run needs no row of it.
#[derive(Debug)]
struct Unheard(Box<dyn RowStream>);

impl RowStream for Unheard {
    fn channels(&self) -> &[ProvidedChannel] {
        self.0.channels()
    }

    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Stamp>, SourceError> {
        match self.0.next(values) {
            Err(SourceError::NoRow(_)) => Ok(None),
            next => next,
        }
    }

    fn disturbed(&self) -> &[Range<usize>] {
        self.0.disturbed()
    }

    fn disturbable(&self) -> Vec<Range<usize>> {
        self.0.disturbable()
    }

    fn report(&self) -> SourceReport {
        self.0.report()
    }
}

impl Feed for Recorded {
    fn next(&mut self, _: &mut dyn Aboard) -> Result<Option<Row<'_>>, Diagnostics> {
        match self.merged.next() {
            Ok(next) => Ok(next.map(|row| Row {
                stream: self.origins[row.stream].stream,
                ..row
            })),
            Err(failed) => {
                let mut d = Diagnostics::new();
                d.extend(failed.error.diagnostics(&self.origins[failed.index].node));
                Err(d)
            }
        }
    }

    fn share(&self) -> Option<f64> {
        (self.all > 0).then(|| 1.0 - self.unread.bytes() as f64 / self.all as f64)
    }

    fn disturbable(&self) -> Vec<(StreamId, Range<usize>)> {
        let sources = self.origins.iter().zip(self.merged.sources());
        let columns = sources.flat_map(|(origin, source)| source.disturbable().into_iter().map(|c| (origin.stream, c)));
        columns.collect()
    }

    fn statistics(&self) -> Vec<SourceStatistics> {
        let named = self.origins.iter().zip(self.merged.sources());
        let fused = named.map(|(origin, source)| SourceStatistics::new(&origin.name, &source.report()));
        fused.chain(self.reference.clone()).collect()
    }
}
