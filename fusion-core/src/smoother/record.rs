//! The records that smoothing keeps of a run, as bytes.

use crate::belief::Belief;
use crate::covariance::{Covariance, Form, FormKind};
use crate::model::LastInput;
use crate::time::Time;
use alloc::sync::Arc;
use alloc::vec::Vec;
use thiserror::Error;

/// A record differs from the record that was written.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the steps that were kept for smoothing cannot be read back: they have been changed")]
pub struct Unreadable;

/// The kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A filter starts: earlier records belong to another piece.
    Start,
    /// A step.
    Link,
    /// A requested estimate.
    Estimate,
}

impl Kind {
    pub(super) const fn byte(self) -> u8 {
        self as u8
    }
}

/// Writing numbers.
pub(super) mod put {
    use crate::time::Time;
    use alloc::vec::Vec;

    pub(in super::super) fn time(out: &mut Vec<u8>, time: Time) {
        out.extend_from_slice(&time.nanos().to_le_bytes());
    }

    pub(in super::super) fn count(out: &mut Vec<u8>, count: usize) {
        out.extend_from_slice(&(count as u32).to_le_bytes());
    }

    pub(in super::super) fn index(out: &mut Vec<u8>, index: u16) {
        out.extend_from_slice(&index.to_le_bytes());
    }

    pub(in super::super) fn numbers(out: &mut Vec<u8>, numbers: &[f64]) {
        out.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
    }
}

/// Reads a record from its beginning.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], Unreadable> {
        let (bytes, rest) = self.0.split_first_chunk().ok_or(Unreadable)?;
        self.0 = rest;
        Ok(*bytes)
    }

    pub(super) fn kind(&mut self) -> Result<Kind, Unreadable> {
        let [byte] = self.bytes()?;
        let kinds = [Kind::Start, Kind::Link, Kind::Estimate];
        kinds.into_iter().find(|kind| kind.byte() == byte).ok_or(Unreadable)
    }

    pub(super) fn time(&mut self) -> Result<Time, Unreadable> {
        Ok(Time::from_nanos(i64::from_le_bytes(self.bytes()?)))
    }

    pub(super) fn count(&mut self) -> Result<usize, Unreadable> {
        Ok(u32::from_le_bytes(self.bytes()?) as usize)
    }

    /// An index below `n`.
    pub(super) fn index(&mut self, n: usize) -> Result<u16, Unreadable> {
        let index = u16::from_le_bytes(self.bytes()?);
        if usize::from(index) < n { Ok(index) } else { Err(Unreadable) }
    }

    pub(super) fn number(&mut self) -> Result<f64, Unreadable> {
        Ok(f64::from_le_bytes(self.bytes()?))
    }

    /// `count` numbers in place of those in `out`.
    pub(super) fn numbers(&mut self, out: &mut Vec<f64>, count: usize) -> Result<(), Unreadable> {
        const WIDTH: usize = size_of::<f64>();
        let length = count.checked_mul(WIDTH).ok_or(Unreadable)?;
        let (bytes, rest) = self.0.split_at_checked(length).ok_or(Unreadable)?;
        self.0 = rest;
        out.clear();
        out.extend(bytes.as_chunks::<WIDTH>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)));
        Ok(())
    }
}

/// An estimate apart from the form of its filter: time, state, and the lower triangle of P.
#[derive(Clone, Debug, Default)]
pub(super) struct Kept {
    pub(super) time: Time,
    pub(super) x: Vec<f64>,
    /// P_ij, j ≤ i, row by row.
    pub(super) p: Vec<f64>,
    pub(super) input: LastInput,
}

crate::memory!(Kept { time, x, p, input });

impl Kept {
    /// Whether it has `n` dimensions and a state of `storage` numbers.
    pub(super) fn fits(&self, n: usize, storage: usize) -> bool {
        (self.x.len(), self.p.len()) == (storage, n * (n + 1) / 2)
    }

    pub(super) fn take(&mut self, belief: &Belief) {
        self.time = belief.time;
        self.x.clone_from(&belief.x);
        self.input.clone_from(&belief.input);
        pack_lower(&belief.covariance, &mut self.p);
    }

    /// Becomes an empty record that keeps its memory.
    pub(super) fn clear(&mut self) {
        self.x.clear();
        self.p.clear();
        self.input = LastInput::default();
    }

    /// The belief itself.
    pub(super) fn give(&self, belief: &mut Belief, whole: &mut Vec<f64>) {
        belief.time = self.time;
        belief.x.clone_from(&self.x);
        belief.input.clone_from(&self.input);
        let n = belief.covariance.dim();
        whole.resize(n * n, 0.0);
        let mut lower = self.p.iter();
        for i in 0..n {
            for (j, &value) in lower.by_ref().take(i + 1).enumerate() {
                whole[i * n + j] = value;
                whole[j * n + i] = value;
            }
        }
        belief.covariance.set_whole(whole);
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        put::time(out, self.time);
        put::count(out, self.x.len());
        put::numbers(out, &self.x);
        put::numbers(out, &self.p);
        put::count(out, self.input.sample.len());
        put::numbers(out, &self.input.sample);
        put::numbers(out, &[self.input.interval]);
    }

    /// Reads a written record, with `n` dimensions, into `self`.
    pub(super) fn read(&mut self, from: &mut Reader<'_>, n: usize) -> Result<(), Unreadable> {
        self.time = from.time()?;
        let storage = from.count()?;
        from.numbers(&mut self.x, storage)?;
        from.numbers(&mut self.p, n * (n + 1) / 2)?;
        let length = from.count()?;
        from.numbers(&mut self.input.sample, length)?;
        self.input.interval = from.number()?;
        Ok(())
    }
}

/// The lower triangle of P, row by row, into `lower`.
pub(super) fn pack_lower(p: &Covariance, lower: &mut Vec<f64>) {
    lower.clear();
    lower.extend((0..p.dim()).flat_map(|i| (0..=i).map(move |j| p.element(i, j))));
}

/// The form of smoothed covariances: always whole, for every form of the filter.
pub(super) fn form() -> Arc<dyn Form> {
    FormKind::Joseph.form()
}

/// A belief of `n` dimensions to write smoothed ones into.
pub(super) fn empty(storage: usize, n: usize) -> Belief {
    Belief {
        time: Time::default(),
        x: vec![0.0; storage],
        covariance: Covariance::zeros(n, form()),
        input: LastInput::default(),
    }
}
