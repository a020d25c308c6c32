//! Aligning anew after a gap in which the attitude was lost.
//!
//! A gap of the input may leave an attitude that is not aligned any more. A measurement of its sine or cosine fits two
//! headings then, and the filter keeps the nearer one. The initialisers say which one is right: they begin
//! anew, and the first attitude that they find replaces that of the filter, unless the two agree. Everything else that
//! the filter knows stays.
//!
//! Limit      three σ of a right angle, beyond which a sine turns back: twice what can be linearised about
//! Not        initialisers that read no stream: a declared start is not true later

use super::ordering::Runner;
use super::restart::copy;
use super::{Halt, Observer};
use crate::belief::Belief;
use crate::consistency::chi_square_quantile;
use crate::covariance::{cholesky, solve_lower};
use crate::memory::{Memory, Tape};
use crate::state::{ALIGNED, Block};
use crate::time::Time;

/// The largest 1σ of an attitude that still counts as aligned \[rad\].
const LOST: f64 = 2.0 * ALIGNED;
/// The probability with which a right attitude agrees with that of the initialisers.
const AGREES: f64 = 0.99;

/// Whether the initialisers are to find the attitude again.
#[derive(Clone, Debug, Default)]
pub(super) struct Realign {
    is_due: bool,
    /// Lent to the initialisers.
    trial: Option<Belief>,
}

impl Memory for Realign {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.is_due.remember(tape);
    }
}

impl Realign {
    pub(super) const fn is_due(&self) -> bool {
        self.is_due
    }

    pub(super) const fn forget(&mut self) {
        self.is_due = false;
    }
}

impl Runner {
    /// Has the initialisers begin anew where a gap has lost the attitude.
    pub(super) fn watch_attitude(&mut self) {
        let can_align = self.initialisers.iter().any(|u| !u.inputs.is_empty());
        let (layout, belief) = (self.estimator.layout(), self.estimator.belief());
        if self.realign.is_due || !can_align || !self.estimator.keeps_covariance() || belief.is_aligned(layout, LOST) {
            return;
        }
        self.begin_anew();
        self.realign.is_due = true;
    }

    /// Takes the attitude of the initialisers, once they have found one.
    pub(super) fn realign(&mut self, time: Time, observer: &mut dyn Observer) -> Result<(), Halt> {
        let mut lent = self.realign.trial.take();
        let belief = self.estimator.belief();
        let trial = lent.get_or_insert_with(|| belief.clone());
        copy(belief, trial);
        let layout = self.estimator.layout();
        let ready = self
            .initialisers
            .iter()
            .filter(|u| !u.inputs.is_empty() && u.initialiser.waits_for().is_none());
        ready.for_each(|u| u.initialiser.write(time, layout, trial));
        let is_written = layout.orientations().any(|block| !is_same(block, belief, trial));
        let is_found = is_written && trial.is_aligned(layout, LOST) && layout.is_sane(&trial.x);
        if is_found {
            self.realign.is_due = false;
            let is_known = belief.is_aligned(layout, ALIGNED) && layout.orientations().all(|block| agree(block, belief, trial));
            if !is_known {
                self.tell_epoch(observer)?;
                self.estimator.renew(trial);
            }
        }
        self.realign.trial = lent;
        if is_found { self.tell_steps(observer) } else { Ok(()) }
    }
}

/// Whether two beliefs about a block are the same to the bit.
fn is_same(block: &Block, a: &Belief, b: &Belief) -> bool {
    a.x[block.storage_range()] == b.x[block.storage_range()] && a.covariance.variances(block).eq(b.covariance.variances(block))
}

/// Whether two independent beliefs about a block are those of one value.
fn agree(block: &Block, a: &Belief, b: &Belief) -> bool {
    let (storage, n) = (block.storage_range(), block.kind.dim());
    let [mut difference, mut sum, mut factor] = [[0.0; 9]; 3];
    block.kind.minus(&a.x[storage.clone()], &b.x[storage], &mut difference[..n]);
    for (k, s) in sum[..n * n].iter_mut().enumerate() {
        let at = |i: usize| block.tangent_range().start + i;
        *s = a.covariance.element(at(k / n), at(k % n)) + b.covariance.element(at(k / n), at(k % n));
    }
    let is_factored = cholesky(&sum[..n * n], &mut factor[..n * n], n);
    solve_lower(&factor[..n * n], &mut difference[..n], n);
    is_factored && difference[..n].iter().map(|d| d * d).sum::<f64>() <= chi_square_quantile(AGREES, n as f64)
}
