//! Columns of numbers in a page.

use super::path::Point;
use super::trace::{Columns, Samples, Trace};
use serde::Serialize;

/// Columns in base64: times as little-endian f64, values as f32.
#[derive(Default, Serialize)]
pub(super) struct TableData {
    pub(super) t: String,
    pub(super) c: Vec<String>,
}

impl TableData {
    pub(super) fn of(columns: &Columns) -> Self {
        let t = base64(columns.time.iter().flat_map(|t| t.to_le_bytes()));
        let c = columns
            .values
            .iter()
            .map(|c| base64(c.iter().flat_map(|v| v.to_le_bytes())))
            .collect();
        Self { t, c }
    }

    /// Every n-th sample such that no more than `capacity` remain, moved by `shift`.
    pub(super) fn of_samples<const N: usize>(samples: &Samples<N>, capacity: usize, shift: &[f64]) -> Self {
        let count = samples.iter().count();
        let every = count.div_ceil(capacity.max(2)).max(1);
        let kept = samples.iter().enumerate().filter(|(i, _)| i % every == 0 || i + 1 == count);
        let mut columns = Columns {
            time: Vec::new(),
            values: vec![Vec::new(); N],
        };
        for (_, (t, row)) in kept {
            columns.time.push(t);
            row.iter()
                .zip(shift.iter())
                .zip(&mut columns.values)
                .for_each(|((v, s), c)| c.push((v + s) as f32));
        }
        Self::of(&columns)
    }

    /// The points of a path, moved by `shift`.
    pub(super) fn of_points(points: &[Point], shift: &[f64]) -> Self {
        let column = |k: usize| points.iter().map(|(_, p)| (p[k] + shift[k]) as f32).collect();
        Self::of(&Columns {
            time: points.iter().map(|(t, _)| *t).collect(),
            values: [0, 1].map(column).into(),
        })
    }

    pub(super) fn of_trace(trace: &Trace, capacity: usize, shift: &[f64], breaks: bool) -> Self {
        let mut columns = trace.columns(capacity, breaks);
        for (column, shift) in columns.values.iter_mut().zip(shift).filter(|(_, s)| **s != 0.0) {
            column.iter_mut().for_each(|v| *v = (f64::from(*v) + shift) as f32);
        }
        Self::of(&columns)
    }
}

/// RFC 4648, padded.
pub(super) fn base64(bytes: impl Iterator<Item = u8>) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    let mut bytes = bytes.peekable();
    while bytes.peek().is_some() {
        let three: [Option<u8>; 3] = std::array::from_fn(|_| bytes.next());
        let word = three.iter().fold(0_u32, |w, b| w << 8 | u32::from(b.unwrap_or(0)));
        for digit in 0..4 {
            let wanted = digit == 0 || three[digit - 1].is_some();
            let value = (word >> (18 - 6 * digit)) & 63;
            out.push(if wanted { char::from(DIGITS[value as usize]) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_gives_the_vectors_of_rfc_4648() {
        for (text, encoded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(text.bytes()), encoded);
        }
        assert_eq!(base64([0xfb, 0xff].into_iter()), "+/8=");
    }
}
