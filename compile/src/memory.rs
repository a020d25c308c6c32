//! The memory that a compiled filter needs for the rows of a run.

use fusion::assembly::{Plan, StreamLayout, declared_streams, plan};
use fusion::config::{Diagnostic, Diagnostics};
use fusion::design::Design;
use fusion_abi::Measurement;
use fusion_core::Time;
use fusion_core::runner::Event;
use fusion_vehicle::Vehicle;
use std::io::{self, ErrorKind, Read};

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
/// memory that it needs. `None` if this program has another allocator than [`fusion_abi::Meter`].
///
/// # Errors
/// The mistakes of the design; rows that cannot be read.
pub fn measure(design: &Design, rows: &mut dyn Read) -> Result<Option<Needs>, Diagnostics> {
    let Some(measurement) = Measurement::begin() else {
        return Ok(None);
    };
    let plan = plan(design, declared_streams(design)?)?;
    let widths: Vec<usize> = plan.streams.iter().map(StreamLayout::width).collect();
    let mut vehicle = measurement.within(|| vehicle(plan));
    // Only the blocks of the plan are left. They are the part of the filter that is outside the arena.
    let blocks = measurement.bytes().map_or(0, |(_, outside)| outside);
    let mut row = Vec::new();
    let mut last = Time::MIN;
    while let Some((stream, time)) =
        next(rows, &widths, &mut row).map_err(|e| Diagnostic::error(format!("the rows cannot be read: {e}")))?
    {
        let fed = measurement.within(|| {
            let fed = vehicle.feed(stream, time, &row, &mut |_: &Event<'_>| {});
            vehicle.solution();
            fed
        });
        fed.map_err(|e| Diagnostic::error(format!("a row is refused: {e}")))?;
        last = time;
    }
    let feed = measurement.bytes();
    measurement.within(|| _ = vehicle.predict(last));
    let checkpoint = measurement.within(|| vehicle.checkpoint());
    // The caller has its bytes.
    let bytes = checkpoint.clone();
    drop(checkpoint);
    let restored = measurement.within(|| vehicle.restore(&bytes));
    restored.map_err(|e| Diagnostic::error(format!("a checkpoint cannot be read again: {e}")))?;
    let all = measurement.bytes();
    let rounded = |(arena, _): (usize, usize)| (arena + blocks + SPARE).next_multiple_of(UNIT);
    Ok(feed.zip(all).map(|(feed, all)| Needs {
        feed: rounded(feed),
        all: rounded(all),
    }))
}

/// The filter as its compiled program assembles it.
fn vehicle(plan: Plan) -> Vehicle {
    let (filter, fingerprint) = (Box::new(plan.filter()), plan.fingerprint());
    let assembly = plan.assembly(filter);
    Vehicle::new(assembly.runner, &assembly.layout, assembly.process, &[], fingerprint)
}

/// The next row: its stream and stamp; `None` at the end.
fn next(rows: &mut dyn Read, widths: &[usize], row: &mut Vec<f64>) -> io::Result<Option<(usize, Time)>> {
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
