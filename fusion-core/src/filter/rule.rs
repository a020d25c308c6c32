//! How a measurement is linearised and conditioned on: the update rules.

use super::earlier::Earlier;
use super::estimator::Observed;
use super::kalman::Signals;
use super::sigma::{SigmaPoints, SigmaSpread};
use crate::Printed;
use crate::chart::{Chart, Reset};
use crate::covariance::{Covariance, Form, Workspace, axpy, cholesky, solve_lower};
use crate::linear::{BlockMatrix, Jacobian, Pattern};
use crate::model::{Input, LastInput, Process, Size, Undefined};
use crate::printed::role;
use crate::state::{Block, Layout, StateRole};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt::Debug;

/// How a measurement corrects the belief: two of the four steps of an update.
///
/// [`crate::testing::check_update_rule`] holds the laws.
pub trait UpdateRule: Printed + Send + Sync {
    /// Its name.
    fn name(&self) -> &'static str;

    /// Prediction, residual, H, HP and HPHᵀ at the belief into `work`.
    ///
    /// # Errors
    /// [`Undefined`] where the model has no value.
    fn innovation(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> Result<(), Undefined> {
        problem.linearise(work)?;
        work.project(problem.covariance);
        Ok(())
    }

    /// The correction δ \[tangent coordinates\] into `work.correction`, and the covariance given the measurement. S
    /// and its factor are in `work`, R is `work.noise`. The state does not move here: the chart moves it afterwards.
    /// Returns false, and changes nothing, if a number is not finite.
    fn condition(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> bool;

    /// Whether P given the measurement is in coordinates about the prediction. The chart then has to carry it by the
    /// Jacobian of its retraction: [`Reset::Full`], even if another reset is declared.
    fn resets_fully(&self) -> bool {
        false
    }

    /// The sigma points by which the belief is predicted as well; `None` for the process's own Φ.
    fn spread(&self) -> Option<SigmaSpread> {
        None
    }

    /// Whether there is a covariance; without it P is zero before and after every step.
    fn keeps_covariance(&self) -> bool {
        true
    }
}

role!(UpdateRule);

/// One linearisation, at the prediction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Single;

impl UpdateRule for Single {
    fn name(&self) -> &'static str {
        "single"
    }

    fn condition(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
        work.gain();
        if !work.correct() {
            return false;
        }
        work.condition(problem.covariance);
        true
    }
}

/// The problem of an update: the belief and the measurement.
#[derive(Debug)]
pub struct Problem<'a> {
    /// The state layout.
    pub layout: &'a Layout,
    /// The chart by whose retraction the correction will be applied.
    pub chart: &'a dyn Chart,
    /// The estimate x̂.
    pub x: &'a [f64],
    /// P, in the canonical chart.
    pub covariance: &'a mut Covariance,
    /// The measurement.
    pub observed: &'a Observed<'a>,
    pub(super) input: &'a LastInput,
    pub(super) process: &'a dyn Process,
    pub(super) signals: &'a mut Signals,
    pub(super) earlier: &'a Earlier,
}

impl Problem<'_> {
    /// Prediction, residual and H at the estimate.
    ///
    /// # Errors
    /// [`Undefined`] where the model has no value.
    pub fn linearise(&mut self, work: &mut Innovation) -> Result<(), Undefined> {
        self.linearise_with(self.x, true, work)
    }

    /// The same at another state `x`.
    ///
    /// # Errors
    /// [`Undefined`] where the model has no value there.
    pub fn linearise_at(&mut self, x: &[f64], work: &mut Innovation) -> Result<(), Undefined> {
        self.signals.forget();
        let linearised = self.linearise_with(x, false, work);
        self.signals.forget();
        linearised
    }

    /// x̂ ⊞ `delta` into `x`, by the chart. The Jacobian of that state with respect to `delta` goes into `by`.
    pub fn move_to(&self, delta: &[f64], x: &mut [f64], by: &mut BlockMatrix) {
        x.copy_from_slice(self.x);
        by.reset();
        self.chart.correct(self.layout, x, delta, Reset::Full, by);
    }

    /// h at another state `x`, without its Jacobian, into `value`, for differences between states: the time
    /// offset of the measurement and the noise of the sample in force are left out.
    ///
    /// # Errors
    /// [`Undefined`] where the model has no value there.
    pub fn predict_at(&mut self, x: &[f64], value: &mut [f64]) -> Result<(), Undefined> {
        self.signals.forget();
        let (model, signals) = (self.observed.model, &mut *self.signals);
        let given = model.given_in(self.observed.value);
        if let Some(smooth) = self.observed.derivative_input.filter(|_| model.reads_signals()) {
            signals.smooth.evaluate(self.process, x, &smooth, false);
            return model.predict(&signals.smooth.view(x).with_given(given), value);
        }
        if model.reads_signals() {
            signals.evaluate(self.process, x, self.input, false);
        }
        let predicted = model.predict(&signals.buffer.view(x).with_given(given), value);
        self.signals.forget();
        predicted
    }

    /// Residual and H at `x`, which is the estimate or, later, another state.
    fn linearise_with(&mut self, x: &[f64], is_estimate: bool, work: &mut Innovation) -> Result<(), Undefined> {
        let (o, process, input) = (self.observed, self.process, self.input);
        let (model, Size { value, residual: m }) = (o.model, o.model.size());
        work.rows = m;
        work.jacobian.reset(m);
        work.multiplies = false;
        match o.derivative_input.filter(|_| model.reads_signals()) {
            Some(smooth) => self.linearise_under(&smooth, x, is_estimate, work)?,
            None => {
                if model.reads_signals() {
                    self.signals.evaluate(process, x, input, false);
                }
                let view = self.signals.buffer.view(x).with_given(model.given_in(o.value));
                model.predict(&view, &mut work.predicted[..value])?;
                model.jacobian(&view, &mut work.jacobian)?;
                if work.jacobian.needs_signals() {
                    self.signals.evaluate(process, x, input, true);
                    work.jacobian.chain(&self.signals.buffer.jacobian);
                }
            }
        }
        if let Some(lateness) = &o.lateness {
            lateness.account(model, process, self.layout, x, work);
        }
        model.residual(&o.value[..value], &work.predicted[..value], &mut work.residual[..m]);
        Ok(())
    }

    /// Prediction and H at `x`, with derivatives under the input `smooth`.
    ///
    /// The model is h(x) under that input plus a constant: the change of the prediction at the estimate by the sample
    /// in force. The noise of that sample is then in the residual, and not in H.
    fn linearise_under(&mut self, smooth: &Input<'_>, x: &[f64], is_estimate: bool, work: &mut Innovation) -> Result<(), Undefined> {
        let (o, process, signals) = (self.observed, self.process, &mut *self.signals);
        let (model, Size { value, residual: m }) = (o.model, o.model.size());
        let (predicted, change) = (&mut work.predicted[..value], &mut work.input_change[..m]);
        let given = model.given_in(o.value);
        signals.smooth.evaluate(process, x, smooth, false);
        model.predict(&signals.smooth.view(x).with_given(given), predicted)?;
        if is_estimate {
            signals.evaluate(process, x, self.input, false);
            let raw = &mut work.trial.value[..value];
            model.predict(&signals.buffer.view(x).with_given(given), raw)?;
            model.residual(raw, predicted, change);
        }
        model.perturb(predicted, change);
        model.jacobian(&signals.smooth.view(x).with_given(given), &mut work.jacobian)?;
        if !work.jacobian.needs_signals() {
            return Ok(());
        }
        work.multiplies = has_parameter(self.layout, &work.jacobian);
        if work.multiplies {
            self.earlier.write(x, self.covariance, &mut work.moved);
            signals.smooth.evaluate(process, &work.moved, smooth, false);
            work.by_parameter.reset(m);
            // If h has no value there, only the derivative at the present state remains.
            let earlier = signals.smooth.view(&work.moved).with_given(given);
            if model.jacobian(&earlier, &mut work.by_parameter).is_ok() {
                for block in parameters(self.layout) {
                    work.jacobian.copy_columns(block.tangent_range(), &work.by_parameter);
                }
            }
        }
        work.jacobian.chain(signals.smooth_jacobian(process, x, smooth));
        Ok(())
    }
}

/// The blocks that the process does not move: calibrations and errors of sensors.
fn parameters(layout: &Layout) -> impl Iterator<Item = &Block> {
    layout.blocks().iter().filter(|b| b.role != StateRole::Kinematic)
}

/// Whether h itself, not a signal that it reads, has a parameter.
fn has_parameter(layout: &Layout, h: &Jacobian) -> bool {
    parameters(layout).any(|b| h.touches(&b.tangent_range()))
}

/// The squared norm of each column of L⁻¹ into `squares`; L lower, m×m, row by row. `column` is working
/// memory, of m numbers.
#[inline(always)]
fn squared_columns(l: &[f64], column: &mut [f64], squares: &mut [f64], m: usize) {
    for i in 0..m {
        // Its elements before i are zero.
        column[i] = 1.0 / l[i * m + i];
        let mut sum = column[i] * column[i];
        for j in i + 1..m {
            let product: f64 = (i..j).map(|k| l[j * m + k] * column[k]).sum();
            column[j] = -product / l[j * m + j];
            sum += column[j] * column[j];
        }
        squares[i] = sum;
    }
}

/// Σ `r`ᵢ times row i of `rows`, each `ld` long, into `out`, in one pass.
fn combine<const M: usize>(rows: &[f64], ld: usize, r: [f64; M], out: &mut [f64]) {
    let rows: [&[f64]; M] = core::array::from_fn(|i| &rows[i * ld..][..out.len()]);
    for (k, out) in out.iter_mut().enumerate() {
        let mut sum = r[0] * rows[0][k];
        for i in 1..M {
            sum += r[i] * rows[i][k];
        }
        *out = sum;
    }
}

/// The memory for linearising the measurement at another state.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    /// The pattern of the Jacobian of the chart's retraction. It takes turns with [`Innovation::reset`].
    pub(super) by: Arc<Pattern>,
    /// The state.
    pub(super) x: Vec<f64>,
    /// A correction kept, and P⁻¹ times it.
    pub(super) delta: Vec<f64>,
    pub(super) dual: Vec<f64>,
    pub(super) dual_kept: Vec<f64>,
    /// A row of H; another H.
    pub(super) row: Vec<f64>,
    pub(super) jacobian: Jacobian,
    /// The innovation of the prediction, which is reported.
    pub(super) residual: Vec<f64>,
    pub(super) predicted: Vec<f64>,
    /// h at another state.
    pub(super) value: Vec<f64>,
    /// The factor of R.
    pub(super) noise: Vec<f64>,
}

impl Trial {
    fn new(layout: &Layout, by: Arc<Pattern>, m: usize, value: usize) -> Self {
        let n = layout.dim();
        Self {
            by,
            x: vec![0.0; layout.storage()],
            delta: vec![0.0; n],
            dual: vec![0.0; n],
            dual_kept: vec![0.0; n],
            row: vec![0.0; n],
            jacobian: Jacobian::new(layout, m),
            residual: vec![0.0; m],
            predicted: vec![0.0; value],
            value: vec![0.0; value],
            noise: vec![0.0; m * m],
        }
    }
}

/// A measurement's passage: residual, H, S, gain and correction, in memory sized once.
#[derive(Clone, Debug)]
pub struct Innovation {
    /// Rows m of the measurement at hand.
    pub rows: usize,
    /// h(x̂).
    pub predicted: Vec<f64>,
    /// r = z ⊟ h(x̂); the first m.
    pub residual: Vec<f64>,
    /// The vector that K multiplies to give the correction: the residual, or for an iterated update r + H δ of the
    /// last linearisation.
    pub effective: Vec<f64>,
    /// H, m×n.
    pub jacobian: Jacobian,
    /// R, m×m, row by row: as it was offered, or divided by the robust weight.
    pub noise: Vec<f64>,
    /// δ = K r, in tangent coordinates.
    pub correction: Vec<f64>,
    /// HP, HPHᵀ, S, its factor and Kᵀ.
    pub work: Workspace,
    /// The Jacobian of the chart's retraction at the correction.
    pub(super) reset: BlockMatrix,
    /// A second linearisation: a state, predictions.
    pub(super) trial: Trial,
    /// Sigma points, for rules that draw them.
    pub(super) points: SigmaPoints,
    /// A state a little later, the change up to it, and the change of the measurement.
    pub(super) moved: Vec<f64>,
    pub(super) rate: Vec<f64>,
    pub(super) shift: Vec<f64>,
    /// The change of the prediction at the estimate by the sample in force, compared with the input for derivatives.
    pub(super) input_change: Vec<f64>,
    /// Whether h reads a signal and has a parameter: their product may then have two uncertain factors.
    pub(super) multiplies: bool,
    /// H at an earlier motion: its columns of parameters.
    pub(super) by_parameter: Jacobian,
    pub(super) whitened: Vec<f64>,
    pub(super) sigma: Vec<f64>,
    /// The factor of S at the prediction, which is reported.
    pub(super) innovation_factor: Vec<f64>,
    /// (S⁻¹)_ii.
    pub(super) unit_nis: Vec<f64>,
    /// The smallest error per row that the gate's test would reject.
    pub(super) power: Vec<f64>,
}

impl Innovation {
    /// Memory for measurements of up to `largest` over the tangent space of `layout`.
    #[must_use]
    pub fn new(layout: &Layout, form: &dyn Form, largest: Size) -> Self {
        let (n, m) = (layout.dim(), largest.residual.max(1));
        let reset = BlockMatrix::identity(n);
        Self {
            rows: 0,
            predicted: vec![0.0; largest.value.max(1)],
            residual: vec![0.0; m],
            effective: vec![0.0; m],
            jacobian: Jacobian::new(layout, m),
            noise: vec![0.0; m * m],
            correction: vec![0.0; n],
            work: Workspace::new(form, n, m),
            trial: Trial::new(layout, reset.pattern(), m, largest.value.max(1)),
            reset,
            points: SigmaPoints::default(),
            moved: vec![0.0; layout.storage()],
            rate: vec![0.0; n],
            shift: vec![0.0; m],
            input_change: vec![0.0; m],
            multiplies: false,
            by_parameter: Jacobian::new(layout, m),
            whitened: vec![0.0; m],
            sigma: vec![0.0; m],
            innovation_factor: vec![0.0; m * m],
            unit_nis: vec![0.0; m],
            power: vec![0.0; m],
        }
    }

    /// HP and HPHᵀ.
    pub fn project(&mut self, covariance: &Covariance) {
        covariance.project(&self.jacobian, &mut self.work);
    }

    /// S = HPHᵀ + R and its Cholesky factor; false where S is not positive definite.
    pub fn factor(&mut self) -> bool {
        let (m, w) = (self.rows, &mut self.work);
        w.forget_gain();
        for ((s, p), r) in w.s.iter_mut().zip(&w.hph).zip(&self.noise[..m * m]) {
            *s = p + r;
        }
        cholesky(&w.s, &mut w.l, m)
    }

    /// Whitens the residual by the factor of S; its squared norm is the NIS.
    pub fn whiten(&mut self) -> f64 {
        let w = &mut self.whitened[..self.rows];
        w.copy_from_slice(&self.residual[..self.rows]);
        solve_lower(&self.work.l, w, self.rows);
        w.iter().map(|v| v * v).sum()
    }

    /// (S⁻¹)_ii of each row, as the squared norm of L⁻¹eᵢ: the NIS of a residual that is one in this row and zero in
    /// the others.
    pub(super) fn unit_nis(&mut self) {
        let (m, l) = (self.rows, &self.work.l);
        let (unit, squares) = (&mut self.whitened[..m], &mut self.unit_nis[..m]);
        // Loops of the usual lengths are unrolled.
        match m {
            1 => squared_columns(&l[..1], unit, squares, 1),
            2 => squared_columns(&l[..4], unit, squares, 2),
            3 => squared_columns(&l[..9], unit, squares, 3),
            _ => squared_columns(l, unit, squares, m),
        }
    }

    /// K = PHᵀS⁻¹, by solving with the factor of S.
    pub fn gain(&mut self) {
        self.work.gain(self.rows);
    }

    /// δ = K r; false where a number of it is not finite.
    pub fn correct(&mut self) -> bool {
        let m = self.rows;
        self.effective[..m].copy_from_slice(&self.residual[..m]);
        self.correct_by_effective()
    }

    /// δ = K times [`Innovation::effective`]; false where a number of it is not finite.
    pub fn correct_by_effective(&mut self) -> bool {
        let (kt, ld, r, delta) = (self.work.kt(), self.work.ld, &self.effective[..self.rows], &mut self.correction);
        match *r {
            [a] => combine(kt, ld, [a], delta),
            [a, b] => combine(kt, ld, [a, b], delta),
            [a, b, c] => combine(kt, ld, [a, b, c], delta),
            _ => {
                delta.fill(0.0);
                kt.chunks_exact(ld).zip(r).for_each(|(row, r)| axpy(*r, row, delta));
            }
        }
        // Without branches in the loop: nearly always all numbers are finite.
        self.correction.iter().fold(true, |all, d| all & d.is_finite())
    }

    /// P given the measurement, by the present gain.
    pub fn condition(&mut self, covariance: &mut Covariance) {
        let m = self.rows;
        covariance.condition(&self.jacobian, &self.noise[..m * m], &mut self.work);
    }
}
