//! Data up to a time after the estimate.
//!
//! The window from an estimate to its last datum slides over the log. The sum over a window has two parts that
//! meet at a seam. The part from the estimate to the seam is summed backwards, once. The part after the seam is
//! summed forwards, as data arrive. When no window reaches back over the seam any more,
//! the seam moves to the newest data. So every step is processed twice, for any
//! lag, and the memory holds the data of two lags.

use super::adjoint::{Adjoint, Corrector, identity};
use super::link::Link;
use super::record::{Kept, empty};
use crate::belief::Belief;
use crate::filter::Parts;
use crate::linear::padded;
use crate::memory::{Memory, Tape};
use crate::runner::Halt;
use crate::state::Layout;
use crate::time::Time;
use alloc::collections::VecDeque;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Smooths each belief by the data up to a fixed time after it.
///
/// It receives the filter's events in order, and gives smoothed beliefs in order as soon as it can.
#[derive(Debug)]
pub struct FixedLag {
    corrector: Corrector,
    /// Nanoseconds.
    lag: i64,
    /// Before the seam: beliefs that wait for more data.
    closed: VecDeque<Closed>,
    /// After the seam.
    open: Vec<Open>,
    /// The time of the first step or belief after the seam.
    seam: Option<Time>,
    /// M of all steps after the seam, and their adjoint at the seam.
    head: Vec<f64>,
    ahead: Adjoint,
    moved: Vec<f64>,
    room: Vec<f64>,
    belief: Belief,
}

/// A belief before the seam.
#[derive(Debug)]
struct Closed {
    kept: Kept,
    /// The adjoint of the steps up to the seam, and their Mᵀ.
    adjoint: Adjoint,
    transposed: Vec<f64>,
}

#[derive(Debug)]
enum Open {
    Link(Link),
    Kept(Kept),
}

impl Memory for FixedLag {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let (n, storage) = (self.corrector.layout().dim(), self.corrector.layout().storage());
        self.corrector.remember(tape);
        let length = tape.length(self.closed.len(), 1);
        self.closed.resize_with(length, || Closed {
            kept: Kept::default(),
            adjoint: Adjoint::new(n),
            transposed: vec![0.0; n * padded(n)],
        });
        for Closed { kept, adjoint, transposed } in &mut self.closed {
            kept.remember(tape);
            adjoint.remember(tape);
            tape.numbers(transposed);
        }
        self.open.remember(tape);
        self.seam.remember(tape);
        tape.numbers(&mut self.head);
        self.ahead.remember(tape);
        let fits = |open: &Open| match open {
            Open::Link(link) => link.fits(n),
            Open::Kept(kept) => kept.fits(n, storage),
        };
        if tape.is_reading() && !(self.open.iter().all(fits) && self.closed.iter().all(|c| c.kept.fits(n, storage))) {
            tape.refuse("an estimate has another size");
        }
    }
}

impl Default for Open {
    fn default() -> Self {
        Self::Link(Link::default())
    }
}

impl Memory for Open {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let mut is_kept = matches!(self, Self::Kept(_));
        is_kept.remember(tape);
        match self {
            Self::Link(_) if is_kept => *self = Self::Kept(Kept::default()),
            Self::Kept(_) if !is_kept => *self = Self::default(),
            _ => {}
        }
        match self {
            Self::Link(link) => link.remember(tape),
            Self::Kept(kept) => kept.remember(tape),
        }
    }
}

impl FixedLag {
    /// For beliefs of `layout`, from a filter with these parts; `lag` in nanoseconds.
    #[must_use]
    pub fn new(layout: Arc<Layout>, parts: &Parts, lag: i64) -> Self {
        let n = layout.dim();
        let ld = padded(n);
        Self {
            lag,
            closed: VecDeque::new(),
            open: Vec::new(),
            seam: None,
            head: identity(n, ld),
            ahead: Adjoint::new(n),
            moved: vec![0.0; n * ld],
            room: Vec::new(),
            belief: empty(layout.storage(), n),
            corrector: Corrector::new(layout, parts),
        }
    }

    /// The filter starts or restarts from `belief`: later data contain no information about the time before.
    ///
    /// # Errors
    /// The first that `tell` returns.
    pub fn start(&mut self, belief: &Belief, tell: &mut dyn FnMut(&Belief) -> Result<(), Halt>) -> Result<(), Halt> {
        self.finish(tell)?;
        self.corrector.start(belief);
        Ok(())
    }

    /// The log ends: passes the beliefs that wait for more data to `tell`.
    ///
    /// # Errors
    /// The first that `tell` returns.
    pub fn finish(&mut self, tell: &mut dyn FnMut(&Belief) -> Result<(), Halt>) -> Result<(), Halt> {
        self.release(Time::MAX, tell)?;
        self.close();
        self.release(Time::MAX, tell)?;
        self.seam = None;
        Ok(())
    }

    /// The filter has taken a step.
    ///
    /// # Errors
    /// The first that `tell` returns.
    pub fn step(&mut self, link: Link, tell: &mut dyn FnMut(&Belief) -> Result<(), Halt>) -> Result<(), Halt> {
        self.release(link.time, tell)?;
        if self.seam.is_some_and(|seam| seam.shifted(self.lag) < link.time) {
            self.close();
            self.release(link.time, tell)?;
        }
        self.seam.get_or_insert(link.time);
        self.ahead.add_at_end(&self.head, &link);
        let ld = padded(self.corrector.layout().dim());
        self.room.resize(link.rows() * ld, 0.0);
        link.push(&mut self.head, &mut self.moved, &mut self.room, ld);
        core::mem::swap(&mut self.head, &mut self.moved);
        self.open.push(Open::Link(link));
        Ok(())
    }

    /// The filter is at a belief that is to be smoothed.
    pub fn estimate(&mut self, belief: &Belief) {
        let mut kept = Kept::default();
        kept.take(belief);
        self.seam.get_or_insert(kept.time);
        self.open.push(Open::Kept(kept));
    }

    /// Passes the beliefs before the seam whose lag ends before `time` to `tell`.
    fn release(&mut self, time: Time, tell: &mut dyn FnMut(&Belief) -> Result<(), Halt>) -> Result<(), Halt> {
        while let Some(mut closed) = self.closed.pop_front_if(|c| c.kept.time.shifted(self.lag) < time) {
            closed.adjoint.add(&closed.transposed, &self.ahead);
            self.corrector.correct(&closed.kept, &closed.adjoint, &mut self.belief);
            tell(&self.belief)?;
        }
        Ok(())
    }

    /// Moves the seam to the newest data. No belief may wait before the seam.
    fn close(&mut self) {
        let n = self.corrector.layout().dim();
        let ld = padded(n);
        let (mut adjoint, mut transposed) = (Adjoint::new(n), identity(n, ld));
        for item in self.open.drain(..).rev() {
            match item {
                Open::Link(link) => {
                    adjoint.back(&link);
                    self.room.resize(link.rows() * ld, 0.0);
                    link.pull(&transposed, &mut self.moved, &mut self.room, ld);
                    core::mem::swap(&mut transposed, &mut self.moved);
                }
                Open::Kept(kept) => self.closed.push_front(Closed {
                    kept,
                    adjoint: adjoint.clone(),
                    transposed: transposed.clone(),
                }),
            }
        }
        self.head = identity(n, ld);
        self.ahead.forget();
        self.seam = None;
    }
}
