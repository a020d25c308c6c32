//! The memory that a compiled filter needs for the rows of a run.

use fusion::assembly::{Plan, StreamLayout, declared_streams, plan};
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion_abi::Measurement;
use fusion_core::Time;
use fusion_core::runner::Event;
use fusion_vehicle::Vehicle;
use std::io::{self, ErrorKind, Read, Seek};

/// Blocks may lie otherwise if the memory begins at another address, or ends closely behind the last block.
const SPARE: usize = 128;
/// The sizes are multiples of this number.
const UNIT: usize = 1024;

/// The bytes of memory that a compiled filter needs, measured on this computer: a processor with 32 bits needs less.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// To be assembled and fed.
    pub feed: usize,
    /// The same, and to predict, to write a checkpoint and to continue from one.
    pub all: usize,
}

/// Assembles the filter of a design, feeds it with the rows that [`record`](crate::record()) wrote, and measures the
/// memory that it needs. Another one continues from the checkpoint after half of the rows: its blocks have other lengths,
/// and lie otherwise. The rows are read twice, one by one. `None` if this program has another allocator than
/// [`fusion_abi::Meter`].
///
/// # Errors
/// The mistakes of the design; rows that cannot be read.
pub fn measure(design: &Design, rows: &mut (impl Read + Seek)) -> Result<Option<Needs>, Diagnostics> {
    let Some((whole, count)) = whole(design, rows)? else {
        return Ok(None);
    };
    rows.rewind().map_err(|e| unreadable(&e))?;
    let continued = continued(design, rows, count / 2)?;
    Ok(continued.map(|continued| Needs {
        all: whole.all.max(continued),
        ..whole
    }))
}

/// The memory of a filter that has all rows, and the number of rows.
fn whole(design: &Design, rows: &mut impl Read) -> Result<Option<(Needs, usize)>, Diagnostics> {
    let Some(measurement) = Measurement::begin() else {
        return Ok(None);
    };
    let plan = plan(design, declared_streams(design)?)?;
    let widths = widths(&plan);
    let mut vehicle = measurement.within(|| vehicle(plan));
    // Only the blocks of the plan are left. They are the part of the filter that is outside the arena.
    let blocks = measurement.bytes().map_or(0, |(_, outside)| outside);
    let (mut row, mut last, mut count) = (Vec::new(), Time::MIN, 0);
    while let Some((stream, time)) = next(rows, &widths, &mut row)? {
        measurement.within(|| feed(&mut vehicle, stream, time, &row))?;
        (last, count) = (time, count + 1);
    }
    let fed = measurement.bytes();
    measurement.within(|| _ = vehicle.predict(last));
    let checkpoint = measurement.within(|| vehicle.checkpoint());
    // The caller has its bytes.
    let bytes = checkpoint.clone();
    drop(checkpoint);
    measurement.within(|| restore(&mut vehicle, &bytes))?;
    let needs = fed.zip(measurement.bytes()).map(|(fed, all)| Needs {
        feed: rounded(fed.0 + blocks),
        all: rounded(all.0 + blocks),
    });
    Ok(needs.map(|needs| (needs, count)))
}

/// The memory of a filter that continues from the checkpoint after the first `half` rows, and then writes one.
fn continued(design: &Design, rows: &mut impl Read, half: usize) -> Result<Option<usize>, Diagnostics> {
    let assembled = || plan(design, declared_streams(design)?);
    let before = assembled()?;
    let widths = widths(&before);
    let (mut row, mut first) = (Vec::new(), vehicle(before));
    for _ in 0..half {
        if let Some((stream, time)) = next(rows, &widths, &mut row)? {
            feed(&mut first, stream, time, &row)?;
        }
    }
    let checkpoint = first.checkpoint();
    drop(first);
    let Some(measurement) = Measurement::begin() else {
        return Ok(None);
    };
    let after = assembled()?;
    let mut vehicle = measurement.within(|| vehicle(after));
    let blocks = measurement.bytes().map_or(0, |(_, outside)| outside);
    measurement.within(|| restore(&mut vehicle, &checkpoint))?;
    while let Some((stream, time)) = next(rows, &widths, &mut row)? {
        measurement.within(|| feed(&mut vehicle, stream, time, &row))?;
    }
    drop(measurement.within(|| vehicle.checkpoint()));
    Ok(measurement.bytes().map(|(arena, _)| rounded(arena + blocks)))
}

fn unreadable(error: &io::Error) -> Diagnostic {
    Diagnostic::error(format!("the rows cannot be read: {error}"))
}

fn widths(plan: &Plan) -> Vec<usize> {
    plan.streams.iter().map(StreamLayout::width).collect()
}

fn rounded(bytes: usize) -> usize {
    (bytes + SPARE).next_multiple_of(UNIT)
}

/// Feeds a row, and reads the solution.
fn feed(vehicle: &mut Vehicle, stream: usize, time: Time, row: &[f64]) -> Result<(), Diagnostic> {
    let fed = vehicle.feed(stream, time, row, &mut |_: &Event<'_>| {});
    vehicle.solution();
    fed.map_err(|e| Diagnostic::error(format!("a row is refused: {e}")))
}

fn restore(vehicle: &mut Vehicle, checkpoint: &[u8]) -> Result<(), Diagnostic> {
    let restored = vehicle.restore(checkpoint);
    restored.map_err(|e| Diagnostic::error(format!("a checkpoint cannot be read again: {e}")))
}

/// The filter as its compiled program assembles it.
fn vehicle(plan: Plan) -> Vehicle {
    let (filter, fingerprint) = (Box::new(plan.filter()), plan.fingerprint());
    let assembly = plan.assembly(filter);
    Vehicle::new(assembly.runner, &assembly.layout, assembly.process, &[], fingerprint)
}

/// The next row: its stream and stamp; `None` at the end.
fn next(rows: &mut impl Read, widths: &[usize], row: &mut Vec<f64>) -> Result<Option<(usize, Time)>, Diagnostic> {
    read(rows, widths, row).map_err(|e| unreadable(&e))
}

fn read(rows: &mut impl Read, widths: &[usize], row: &mut Vec<f64>) -> io::Result<Option<(usize, Time)>> {
    let (mut stream, mut time, mut number) = ([0; 4], [0; 8], [0; 8]);
    match rows.read_exact(&mut stream) {
        Err(e) if e.kind() == ErrorKind::UnexpectedEof => return Ok(None),
        read => read?,
    }
    let stream = u32::from_le_bytes(stream) as usize;
    let width = *widths.get(stream).ok_or(ErrorKind::InvalidData)?;
    rows.read_exact(&mut time)?;
    row.clear();
    for _ in 0..width {
        rows.read_exact(&mut number)?;
        row.push(f64::from_le_bytes(number));
    }
    Ok(Some((stream, Time::from_nanos(i64::from_le_bytes(time)))))
}
