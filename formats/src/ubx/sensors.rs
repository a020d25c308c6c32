//! The measurements of `ESF-MEAS` and `ESF-RAW`: one column for each type of measurement.

use super::clock::STAMP;
use crate::messages::Cells;

/// The types of measurements: their number, column, unit and how many parts make one unit. A wheel has its direction in
/// the highest bit.
const TYPES: [(u8, &str, &str, Form); 13] = [
    (14, "gyroX", "deg/s", Form::Parts(4096.0)),
    (13, "gyroY", "deg/s", Form::Parts(4096.0)),
    (5, "gyroZ", "deg/s", Form::Parts(4096.0)),
    (16, "accX", "m/s^2", Form::Parts(1024.0)),
    (17, "accY", "m/s^2", Form::Parts(1024.0)),
    (18, "accZ", "m/s^2", Form::Parts(1024.0)),
    (12, "gyroTemp", "degC", Form::Parts(100.0)),
    (6, "wheelTicksFL", "", Form::Ticks),
    (7, "wheelTicksFR", "", Form::Ticks),
    (8, "wheelTicksRL", "", Form::Ticks),
    (9, "wheelTicksRR", "", Form::Ticks),
    (10, "speedTicks", "", Form::Ticks),
    (11, "speed", "m/s", Form::Parts(1000.0)),
];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// A number with a sign, of this many parts of the unit.
    Parts(f64),
    /// A count, negative when it runs backward.
    Ticks,
}

/// Bits of a measurement.
const BITS: u32 = 24;
/// Bytes of a measurement, with its type.
const MEASUREMENT: usize = 4;

/// The message `ESF-MEAS`.
pub(super) const MEAS: [u8; 2] = [0x10, 0x02];
/// The message `ESF-RAW`.
pub(super) const RAW: [u8; 2] = [0x10, 0x03];

/// The columns of a message before its measurements.
const fn head(id: [u8; 2]) -> &'static [&'static str] {
    match id {
        MEAS => &[
            "timeTag",
            "timeMarkSent",
            "timeMarkEdge",
            "calibTtagValid",
            "numMeas",
            "id",
            "calibTtag",
        ],
        _ => &["sTag"],
    }
}

/// The columns of a message.
pub(super) fn columns(id: [u8; 2]) -> Vec<String> {
    let names = core::iter::once(STAMP).chain(head(id).iter().copied());
    names.chain(TYPES.iter().map(|(_, name, ..)| *name)).map(str::to_owned).collect()
}

/// A column with its unit.
pub(super) fn label(id: [u8; 2], column: usize) -> Option<String> {
    let (_, name, unit, _) = TYPES.get(column.checked_sub(1 + head(id).len())?)?;
    (!unit.is_empty()).then(|| format!("{name} [{unit}]"))
}

/// Adds the cells of `ESF-MEAS` after the stamp.
pub(super) fn decode_meas(content: &[u8], cells: &mut Cells) -> Result<(), String> {
    let Some((&[t0, t1, t2, t3, f0, f1, i0, i1], data)) = content.split_first_chunk() else {
        return Err("it is shorter than its first fields".to_owned());
    };
    let flags = u16::from_le_bytes([f0, f1]);
    let (has_tag, count) = (flags >> 3 & 1, usize::from(flags >> 11));
    let tag = u32::from_le_bytes([t0, t1, t2, t3]);
    for whole in [
        tag,
        (flags & 3).into(),
        (flags >> 2 & 1).into(),
        has_tag.into(),
        u32::from(flags >> 11),
    ] {
        cells.integer(whole.into());
    }
    cells.integer(u16::from_le_bytes([i0, i1]).into());
    let (data, calibrated) = data
        .split_at_checked(count * MEASUREMENT)
        .ok_or("it has fewer measurements than it says")?;
    match calibrated.first_chunk().filter(|_| has_tag == 1) {
        Some(tag) => cells.integer(u32::from_le_bytes(*tag).into()),
        None => cells.empty(),
    }
    add(data.chunks_exact(MEASUREMENT), cells);
    Ok(())
}

/// The measurements of `ESF-RAW` from this byte on that have one tag: the byte after them.
pub(super) fn next_raw(content: &[u8], from: usize) -> usize {
    let mut all = content[from..].chunks_exact(2 * MEASUREMENT);
    let tag = all.next().map(|first| &first[MEASUREMENT..]);
    let others = all.take_while(|next| Some(&next[MEASUREMENT..]) == tag).count();
    from + (1 + others) * 2 * MEASUREMENT
}

/// Where the measurements of `ESF-RAW` begin.
pub(super) const RAW_HEAD: usize = 4;

/// Whether `ESF-RAW` has measurements from this byte on.
pub(super) const fn has_raw(content: &[u8], from: usize) -> bool {
    content.len() >= from + 2 * MEASUREMENT
}

/// Adds the cells of measurements of `ESF-RAW` with one tag after the stamp.
pub(super) fn decode_raw(data: &[u8], cells: &mut Cells) {
    let tag = data.get(MEASUREMENT..).and_then(|tag| tag.first_chunk());
    cells.integer(tag.map_or(0, |tag| u32::from_le_bytes(*tag)).into());
    add(data.chunks_exact(2 * MEASUREMENT).map(|both| &both[..MEASUREMENT]), cells);
}

/// Adds a cell for each type. If a type has several measurements, the last one counts.
fn add<'a>(measurements: impl Iterator<Item = &'a [u8]> + Clone, cells: &mut Cells) {
    for (kind, .., form) in TYPES {
        let of_kind = measurements.clone().filter(|bytes| bytes[3] & 0x3f == kind).last();
        let Some(&[low, middle, high, _]) = of_kind else {
            cells.empty();
            continue;
        };
        let raw = i32::from_le_bytes([low, middle, high, 0]);
        match form {
            Form::Parts(parts) => {
                let signed = raw << (32 - BITS) >> (32 - BITS);
                cells.number(f64::from(signed) / parts);
            }
            Form::Ticks => {
                let ticks = raw & ((1 << (BITS - 1)) - 1);
                cells.integer(if raw >> (BITS - 1) == 1 { -ticks } else { ticks }.into());
            }
        }
    }
}
