//! All data of a log.

use super::adjoint::{Adjoint, Corrector};
use super::link::Link;
use super::record::{Kept, Kind, Reader, Unreadable, empty};
use super::tape::Tape;
use crate::belief::Belief;
use crate::filter::Parts;
use crate::runner::Halt;
use crate::state::Layout;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Smooths by all data of a log.
///
/// It receives the filter's events in order: starts, steps, and the beliefs that are to be smoothed. It keeps its
/// records on a [`Tape`], so that its own memory does not grow with the log.
#[derive(Debug)]
pub struct FixedInterval {
    corrector: Corrector,
    tape: Tape,
    link: Link,
    kept: Kept,
    record: Vec<u8>,
}

impl FixedInterval {
    /// For beliefs of `layout`, from a filter with these parts.
    #[must_use]
    pub fn new(layout: Arc<Layout>, parts: &Parts, tape: Tape) -> Self {
        Self {
            corrector: Corrector::new(layout, parts),
            tape,
            link: Link::default(),
            kept: Kept::default(),
            record: Vec::new(),
        }
    }

    /// The filter starts or restarts from `belief`: later data contain no information about the time before.
    ///
    /// # Errors
    /// Where the record cannot be kept.
    pub fn start(&mut self, belief: &Belief) -> Result<(), Halt> {
        self.corrector.start(belief);
        self.begin(Kind::Start);
        self.tape.push(&self.record)
    }

    /// The filter has taken a step.
    ///
    /// # Errors
    /// Where the record cannot be kept.
    pub fn step(&mut self, link: &Link) -> Result<(), Halt> {
        self.begin(Kind::Link);
        link.write(&mut self.record);
        self.tape.push(&self.record)
    }

    /// The filter is at a belief that is to be smoothed.
    ///
    /// # Errors
    /// Where the record cannot be kept.
    pub fn estimate(&mut self, belief: &Belief) -> Result<(), Halt> {
        self.kept.take(belief);
        self.begin(Kind::Estimate);
        self.kept.write(&mut self.record);
        self.tape.push(&self.record)
    }

    fn begin(&mut self, kind: Kind) {
        self.record.clear();
        self.record.push(kind.byte());
    }

    /// The end of the log: goes back through it and smooths. `turned` is an empty tape.
    ///
    /// # Errors
    /// Where a record cannot be read back, or a smoothed one not be kept.
    pub fn smooth(mut self, mut turned: Tape) -> Result<Smoothed, Halt> {
        let layout = self.corrector.layout();
        let (n, storage) = (layout.dim(), layout.storage());
        let (mut adjoint, mut belief) = (Adjoint::new(n), empty(storage, n));
        while self.tape.pop(&mut self.record)? {
            let mut reader = Reader(&self.record);
            match reader.kind()? {
                Kind::Start => adjoint.forget(),
                Kind::Link => {
                    self.link.read(&mut reader, n)?;
                    adjoint.back(&self.link);
                }
                Kind::Estimate => {
                    self.kept.read(&mut reader, n)?;
                    if self.kept.x.len() != storage {
                        return Err(Unreadable.into());
                    }
                    self.corrector.correct(&self.kept, &adjoint, &mut belief);
                    self.kept.take(&belief);
                    self.record.clear();
                    self.kept.write(&mut self.record);
                    turned.push(&self.record)?;
                }
            }
        }
        Ok(Smoothed {
            tape: turned,
            kept: self.kept,
            record: self.record,
            whole: Vec::new(),
            belief,
        })
    }
}

/// Smoothed beliefs in order of time.
#[derive(Debug)]
pub struct Smoothed {
    tape: Tape,
    kept: Kept,
    record: Vec<u8>,
    whole: Vec<f64>,
    belief: Belief,
}

impl Smoothed {
    /// The next belief; `None` at the end.
    ///
    /// # Errors
    /// Where it cannot be read back.
    pub fn read(&mut self) -> Result<Option<&Belief>, Halt> {
        if !self.tape.pop(&mut self.record)? {
            return Ok(None);
        }
        let n = self.belief.covariance.dim();
        self.kept.read(&mut Reader(&self.record), n)?;
        self.kept.give(&mut self.belief, &mut self.whole);
        Ok(Some(&self.belief))
    }
}
