//! The law of memories.

use crate::memory::{Memory, restore, save};

/// Every truncated length below this number is tried, every 97th length above it, and each of the last 256.
const WHOLE: usize = 256;

/// Restores the memory of `original` into `twin`, which was built in the same way. Then `twin` must
/// have the same memory, byte for byte. Before that, truncated bytes and one byte too many
/// must be refused, and must leave `twin` unchanged.
///
/// The caller checks the rest of the law: from here on both do the same, bit for bit.
///
/// # Errors
/// A sentence with the number of bytes.
pub fn check_memory<M: Memory + ?Sized>(original: &mut M, twin: &mut M) -> Result<(), String> {
    let [mut bytes, mut before, mut after] = [const { Vec::new() }; 3];
    save(original, &mut bytes);
    save(twin, &mut before);
    let length = bytes.len();
    bytes.push(0);
    let cut = |end: &usize| *end < WHOLE || end.is_multiple_of(97) || *end + WHOLE > length;
    for end in (0..length).filter(cut).chain([length + 1]) {
        if restore(twin, &bytes[..end]).is_ok() {
            return Err(format!("{end} of the {length} bytes that it remembers are taken for all"));
        }
    }
    save(twin, &mut after);
    if after != before {
        return Err("bytes that were refused have changed what it remembers".to_owned());
    }
    restore(twin, &bytes[..length]).map_err(|e| format!("of the {length} bytes that it wrote: {e}"))?;
    after.clear();
    save(twin, &mut after);
    if after != bytes[..length] {
        return Err("one that its memory was restored into remembers something else".to_owned());
    }
    Ok(())
}
