//! The Kalman filter on manifolds.

use super::backend::Backend;
use super::curvature::add_curvature;
use super::earlier::Earlier;
use super::estimator::{Estimator, FilterError, Observed, Rivals, Update, Verdict, take_orientations};
use super::fixes::Fixes;
use super::own::OwnDynamics;
use super::protect::Protection;
use super::reacquire::Growing;
use super::replay::coast;
use super::rule::{Innovation, Problem, UpdateRule};
use super::sigma::SigmaSpread;
use super::step::{Cause, Offered, Step};
use crate::belief::{Belief, Past};
use crate::chart::{Chart, Reset};
use crate::covariance::{Covariance, Form, Kernel};
use crate::gate::{Answer, Decision, Gate, GateInput, Mode, Outcome};
use crate::linear::{Jacobian, Transition};
use crate::loss::Loss;
use crate::math;
use crate::memory::{Memory, Tape};
use crate::model::{Gap, Input, LastInput, Process, SignalBuffer, Size};
use crate::state::{ALIGNED, Layout, View};
use crate::time::{Time, nanos};
use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// The parts of a filter: a [`Backend`] as objects. A program may supply custom objects.
#[derive(Clone, Debug)]
pub struct Parts {
    /// The definition of the error whose covariance is P.
    pub chart: Arc<dyn Chart>,
    /// How a measurement is linearised and conditioned on.
    pub update: Arc<dyn UpdateRule>,
    /// How P is stored and kept positive.
    pub form: Arc<dyn Form>,
    /// How P changes when a correction moves the state.
    pub reset: Reset,
    /// The kernel that computes.
    pub kernel: Kernel,
    /// Whether calibrations get only a share of the corrections by a sensor with larger errors than it declares.
    pub protection: bool,
}

impl From<Backend> for Parts {
    fn from(backend: Backend) -> Self {
        Self {
            chart: backend.chart.chart(),
            update: backend.update.rule(),
            form: backend.form.form(),
            reset: backend.reset,
            kernel: backend.kernel.unwrap_or_default(),
            protection: backend.protection,
        }
    }
}

impl Parts {
    /// How P changes at a correction: as declared, or as the update rule needs.
    pub(crate) fn reset(&self) -> Reset {
        if self.update.resets_fully() { Reset::Full } else { self.reset }
    }
}

/// The Kalman filter on manifolds.
///
/// Cloned, it continues bit for bit as the original would.
#[derive(Clone, Debug)]
pub struct Filter {
    layout: Arc<Layout>,
    process: Arc<dyn Process>,
    chart: Arc<dyn Chart>,
    /// The chart as it was given, and the state at which the present one is anchored.
    given: Arc<dyn Chart>,
    anchor: Option<Vec<f64>>,
    rule: Arc<dyn UpdateRule>,
    how: Reset,
    own: OwnDynamics,
    pub(super) growing: Growing,
    /// The parameters before a gate rejected their sensor.
    pub(super) past: Past,
    /// Whether fixes agree with the estimate.
    fixes: Fixes,
    /// The motion by which parameters are differentiated.
    earlier: Earlier,
    /// Which sensors have larger errors than they declare.
    pub(super) protection: Protection,
    /// Whether a gap has left an attitude that is too uncertain for linearisation.
    is_open: bool,
    pub(super) belief: Belief,
    pub(super) transition: Transition,
    signals: Signals,
    pub(super) work: Innovation,
    x_before: Vec<f64>,
    pub(super) p_before: Covariance,
    /// The steps of the latest call, if they are kept.
    steps: Option<Vec<Step>>,
}

/// The process's signals at the belief, evaluated when a model reads them.
#[derive(Clone, Debug)]
pub(super) struct Signals {
    pub(super) buffer: SignalBuffer,
    /// The same under the input for derivatives, values alone.
    pub(super) smooth: SignalBuffer,
    evaluated: Evaluated,
}

/// Which part of the signals is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Evaluated {
    Nothing,
    Values,
    Jacobian,
}

impl Signals {
    fn new(layout: &Layout) -> Self {
        Self {
            buffer: SignalBuffer::new(layout),
            smooth: SignalBuffer::of_values(layout),
            evaluated: Evaluated::Nothing,
        }
    }

    /// State or input have changed.
    pub(super) const fn forget(&mut self) {
        self.evaluated = Evaluated::Nothing;
    }

    /// The Jacobian under the input for derivatives, at the state `x`; it replaces that under the input in force.
    pub(super) fn smooth_jacobian(&mut self, process: &dyn Process, x: &[f64], smooth: &Input<'_>) -> &Jacobian {
        self.evaluated = self.evaluated.min(Evaluated::Values);
        self.smooth.evaluate_into(&mut self.buffer.jacobian, process, x, smooth);
        &self.buffer.jacobian
    }

    pub(super) fn evaluate(&mut self, process: &dyn Process, x: &[f64], input: &LastInput, with_jacobian: bool) {
        let wanted = if with_jacobian { Evaluated::Jacobian } else { Evaluated::Values };
        if self.evaluated < wanted {
            self.buffer.evaluate(process, x, &input.get(), with_jacobian);
            self.evaluated = wanted;
        }
    }
}

/// The cause that moves the state over a step.
enum Drive<'a> {
    Input(Input<'a>),
    Nothing(Gap),
}

impl Filter {
    /// A filter at the layout's initial belief, with room for measurements of up to `largest`.
    #[must_use]
    pub fn new(layout: Arc<Layout>, process: Arc<dyn Process>, backend: Backend, largest: Size) -> Self {
        Self::of(layout, process, backend.into(), largest)
    }

    /// A filter as by [`Filter::new`], from custom parts.
    #[must_use]
    pub fn of(layout: Arc<Layout>, process: Arc<dyn Process>, parts: Parts, largest: Size) -> Self {
        let n = layout.dim();
        let mut belief = Belief::initial(&layout, &parts.form, Time::default());
        belief.input = LastInput::zeros(process.input_dim());
        let how = parts.reset();
        if !parts.update.keeps_covariance() {
            belief.covariance.clear();
        }
        let mut past = Past::new(Arc::clone(&layout));
        past.start(&belief);
        let mut work = Innovation::new(&layout, parts.form.as_ref(), largest);
        work.work.kernel = parts.kernel;
        Self {
            belief,
            how,
            transition: Transition::new(&layout),
            own: OwnDynamics::of(&layout),
            growing: Growing::of(&layout),
            past,
            fixes: Fixes::of(&layout),
            earlier: Earlier::of(&layout),
            protection: Protection::of(&layout, parts.protection),
            is_open: false,
            signals: Signals::new(&layout),
            work,
            x_before: vec![0.0; layout.storage()],
            p_before: Covariance::zeros(n, parts.form),
            chart: Arc::clone(&parts.chart),
            given: parts.chart,
            anchor: None,
            rule: parts.update,
            steps: None,
            layout,
            process,
        }
    }

    /// Moves the belief to `to` in steps that the process allows. `drive` gives the cause of the motion between two
    /// times, in seconds from the start.
    fn advance<'a>(&mut self, to: Time, drive: impl Fn(f64, f64) -> Drive<'a>) -> Result<(), FilterError> {
        self.forget_steps();
        let from = self.belief.time;
        if to < from {
            return Err(FilterError::Backwards { from, to });
        }
        let total = to.seconds_since(from);
        if total <= 0.0 {
            return Ok(());
        }
        let longest = self.process.max_step();
        // Nearly every prediction is one step.
        let steps = if total <= longest {
            1.0
        } else {
            math::clamp(math::ceil(total / longest), 1.0, 1e6)
        };
        self.x_before.copy_from_slice(&self.belief.x);
        if steps > 1.0 {
            self.p_before.copy_from(&self.belief.covariance);
        }
        for k in 1..=steps as usize {
            let part = |k: usize| total / steps * k as f64;
            let end = if k == steps as usize { to } else { from.shifted(nanos(part(k))) };
            if self.step(&drive(part(k - 1), part(k)), end, total / steps) {
                continue;
            }
            self.belief.time = from;
            self.belief.x.copy_from_slice(&self.x_before);
            if steps > 1.0 {
                self.belief.covariance.copy_from(&self.p_before);
            }
            self.forget_steps();
            return Err(FilterError::Diverged(to));
        }
        Ok(())
    }

    /// One step to `to`. Returns false if its result is not sound; the caller then has to restore the state, and the
    /// covariance is as before.
    fn step(&mut self, drive: &Drive<'_>, to: Time, dt: f64) -> bool {
        let prior = self.prior();
        self.transition.restart();
        let is_moved = match (drive, self.rule.spread()) {
            (Drive::Input(input), Some(spread)) => self.spread_step(&spread, input, dt),
            (Drive::Input(input), None) => {
                self.process.step(&mut self.belief.x, input, dt, &mut self.transition);
                self.predict_covariance(dt)
            }
            (Drive::Nothing(gap), _) => {
                let Belief { x, input, .. } = &mut self.belief;
                coast(self.process.as_ref(), gap, x, input, &mut self.transition);
                self.predict_covariance(dt)
            }
        };
        if !is_moved {
            return false;
        }
        if let Drive::Input(input) = drive {
            self.belief.input.take(input);
        }
        self.signals.forget();
        self.belief.time = to;
        self.keep(prior, |f, prior| Step::Predicted {
            prior,
            cause: match drive {
                Drive::Input(_) => Cause::Input { duration: dt },
                Drive::Nothing(gap) => Cause::Gap(*gap),
            },
            transition: f.transition.clone(),
            posterior: f.belief.clone(),
        });
        true
    }

    /// The blocks' own dynamics, and P by the transition. Returns false, with P as before, if P is not sound. The
    /// process moves under the state at which it was linearised, so blocks decay after it.
    fn predict_covariance(&mut self, dt: f64) -> bool {
        self.own.write(dt, &mut self.transition);
        self.transition.finish();
        self.own.decay(&mut self.belief.x);
        if !self.rule.keeps_covariance() {
            return self.layout.is_sane(&self.belief.x);
        }
        let covariance = &self.belief.covariance;
        self.transition.settle(|axis| covariance.marginal_at::<1>(axis).x);
        self.layout.is_sane(&self.belief.x) && self.belief.covariance.predict(&self.transition, &mut self.work.work)
    }

    /// The belief by sigma points through the process's own step; its noise is added as usual. Returns false,
    /// with the covariance as before, if the result is not sound. If steps are kept, Φ becomes the regression of the
    /// moved points on the points before.
    fn spread_step(&mut self, spread: &SigmaSpread, input: &Input<'_>, dt: f64) -> bool {
        self.process.linearise(&self.belief.x, input, dt, &mut self.transition);
        self.own.write(dt, &mut self.transition);
        self.transition.finish();
        let covariance = &self.belief.covariance;
        self.transition.settle(|axis| covariance.marginal_at::<1>(axis).x);
        let (n, storage) = (self.layout.dim(), self.layout.storage());
        let reach = spread.reach(n);
        let (kernel, points) = (self.work.work.kernel, &mut self.work.points);
        points.prepare(kernel, n, n, storage);
        points.take(covariance, self.transition.noise_before());
        let (process, own, layout, chart) = (&self.process, &self.own, &self.layout, &self.chart);
        let run = |x: &mut [f64]| {
            process.propagate(x, input, dt);
            own.decay(x);
        };
        points.centre.copy_from_slice(&self.belief.x);
        run(&mut points.centre);
        for i in 0..n {
            let is_there = points.point(i, reach);
            for end in (0..2).filter(|_| is_there) {
                points.x.copy_from_slice(&self.belief.x);
                chart.correct(layout, &mut points.x, &points.delta[..n], Reset::Plain, &mut self.work.reset);
                run(&mut points.x);
                chart.difference(layout, &points.x, &points.centre, &mut points.ends[end][..n]);
                points.delta.iter_mut().for_each(|d| *d = -*d);
            }
            points.keep(i, n, reach, is_there);
        }
        points.second_order(n, reach, spread);
        self.belief.x.copy_from_slice(&points.centre);
        self.work.reset.reset();
        chart.correct(layout, &mut self.belief.x, &points.mean[..n], Reset::Full, &mut self.work.reset);
        points.carry(&self.work.reset);
        let p = points.covariance(self.transition.noise_after());
        let Some(p) = p.filter(|_| layout.is_sane(&self.belief.x)) else {
            return false;
        };
        self.belief.covariance.set_whole(p);
        if self.steps.is_some() {
            points.explain(&mut self.transition);
        }
        true
    }

    /// The largest 1σ of an axis of the orientations \[rad\]; zero without any.
    fn widest_orientation(&self) -> f64 {
        let variances = self.growing.angular.iter().map(|axis| self.belief.covariance.variance(*axis));
        math::sqrt(variances.fold(0.0, f64::max))
    }

    /// The belief before a step, if steps are kept.
    pub(super) fn prior(&self) -> Option<Belief> {
        self.steps.is_some().then(|| self.belief.clone())
    }

    /// Keeps a step, if steps are kept.
    pub(super) fn keep(&mut self, prior: Option<Belief>, step: impl FnOnce(&Self, Belief) -> Step) {
        if let Some(prior) = prior {
            let step = step(self, prior);
            self.steps.get_or_insert_default().push(step);
        }
    }

    fn forget_steps(&mut self) {
        if let Some(steps) = &mut self.steps {
            steps.clear();
        }
    }

    /// The update problem of `observed` at the belief, and the working memory for it.
    fn problem<'a>(&'a mut self, observed: &'a Observed<'_>) -> (Problem<'a>, &'a mut Innovation, &'a dyn UpdateRule) {
        let problem = Problem {
            layout: &self.layout,
            chart: self.chart.as_ref(),
            x: &self.belief.x,
            input: &self.belief.input,
            covariance: &mut self.belief.covariance,
            observed,
            process: self.process.as_ref(),
            signals: &mut self.signals,
            earlier: &self.earlier,
        };
        (problem, &mut self.work, self.rule.as_ref())
    }

    /// First step: residual, H, S and the NIS. `Err` holds the verdict if the innovation cannot be computed.
    fn innovation(&mut self, observed: &Observed<'_>) -> Result<f64, Verdict> {
        let Size { value, residual: m } = observed.model.size();
        self.work.rows = m;
        self.work.sigma[..m].fill(f64::NAN);
        self.work.innovation_factor[..m * m].fill(f64::NAN);
        self.work.power[..m].fill(f64::NAN);
        self.is_open = self.is_open && self.widest_orientation() > ALIGNED;
        let (is_open, angular) = (self.is_open, Arc::clone(&self.growing.angular));
        let (mut problem, work, rule) = self.problem(observed);
        if let Err(why) = rule.innovation(&mut problem, work) {
            work.residual[..m].fill(f64::NAN);
            work.predicted[..value].fill(f64::NAN);
            return Err(Verdict::Undefined(why));
        }
        work.noise[..m * m].copy_from_slice(&observed.noise[..m * m]);
        // Sigma points see the curvature themselves.
        if is_open && rule.spread().is_none() {
            add_curvature(&angular, &mut problem, work);
        }
        if !(work.residual[..m].iter().all(|r| r.is_finite()) && work.factor()) {
            return Err(Verdict::Unusable);
        }
        let nis = work.whiten();
        for i in 0..m {
            work.sigma[i] = math::sqrt(work.work.s[i * m + i]);
        }
        work.innovation_factor[..m * m].copy_from_slice(&work.work.l[..m * m]);
        Ok(nis)
    }

    /// Second step: the gate's answer, and the errors that it would have rejected.
    fn judge(&mut self, quality: Option<f64>, nis: f64, gate: &mut dyn Gate, others: &[Option<Outcome>]) -> Answer {
        self.work.unit_nis();
        let (m, work) = (self.work.rows, &mut self.work);
        let input = GateInput {
            time: self.belief.time,
            residual: &work.residual[..m],
            predicted: &work.work.hph[..m * m],
            noise: &work.noise[..m * m],
            innovation: &work.work.s[..m * m],
            nis,
            unit_nis: &work.unit_nis[..m],
            quality,
            others,
        };
        gate.power(&input, &mut work.power[..m]);
        gate.judge(&input)
    }

    /// R ← R / w. Returns the weight, or `None` if S is then not positive definite.
    fn weigh(&mut self, nis: f64, loss: &dyn Loss) -> Option<f64> {
        let (m, work) = (self.work.rows, &mut self.work);
        let weight = loss.weight(math::sqrt(nis), m);
        if weight < 1.0 {
            work.noise[..m * m].iter_mut().for_each(|r| *r /= weight);
            if !work.factor() {
                return None;
            }
        }
        Some(weight)
    }

    /// Uses an accepted measurement with its robust weight; nothing changes if that is impossible.
    fn use_it(&mut self, observed: &Observed<'_>, nis: f64, loss: &dyn Loss) -> (Verdict, f64) {
        let Some(weight) = self.weigh(nis, loss) else {
            return (Verdict::Unusable, 0.0);
        };
        self.remember();
        if self.correct(observed, self.protection.share(observed.sensor)) {
            return (Verdict::Accepted, weight);
        }
        self.restore();
        (Verdict::Unusable, weight)
    }

    /// Keeps the belief, for a step that may turn out unsound.
    fn remember(&mut self) {
        self.x_before.copy_from_slice(&self.belief.x);
        self.p_before.copy_from(&self.belief.covariance);
    }

    /// Back to the belief that was kept.
    fn restore(&mut self) {
        self.belief.x.copy_from_slice(&self.x_before);
        self.belief.covariance.copy_from(&self.p_before);
        self.signals.forget();
        self.forget_steps();
    }

    /// Third step: gain, correction and P. Fourth step: the chart moves state and P by the correction. Returns false
    /// if the result is not sound; the caller then has to restore state and P from `x_before` and `p_before`.
    fn correct(&mut self, observed: &Observed<'_>, share: f64) -> bool {
        let prior = self.prior();
        let (mut problem, work, rule) = self.problem(observed);
        if !rule.condition(&mut problem, work) {
            return false;
        }
        if share < 1.0 && self.rule.keeps_covariance() {
            self.protect(share);
        }
        let is_reset = self.apply();
        if !(self.layout.is_sane(&self.belief.x) && self.belief.covariance.is_positive(&mut self.work.work)) {
            return false;
        }
        self.keep(prior, |f, prior| {
            let (m, n, w) = (f.work.rows, f.layout.dim(), &f.work.work);
            Step::Corrected {
                prior,
                offered: Box::new(Offered::of(observed, &f.work.input_change[..m])),
                jacobian: f.work.jacobian.clone(),
                noise: f.work.noise[..m * m].to_vec(),
                residual: f.work.effective[..m].to_vec(),
                innovation: w.s[..m * m].to_vec(),
                gain: w.kt().chunks(w.ld).take(m).flat_map(|row| &row[..n]).copied().collect(),
                correction: f.work.correction.clone(),
                reset: is_reset.then(|| f.work.reset.clone()),
                posterior: f.belief.clone(),
            }
        });
        true
    }

    /// The innovation under a covariance that has grown, for rules that need more than H.
    fn redraw(&mut self, observed: &Observed<'_>) -> bool {
        if self.rule.spread().is_none() {
            return true;
        }
        let (mut problem, work, rule) = self.problem(observed);
        let is_defined = rule.innovation(&mut problem, work).is_ok();
        is_defined && work.residual[..work.rows].iter().all(|r| r.is_finite()) && work.factor()
    }

    /// Moves the state by the correction, through the chart, and P with it. Returns whether P had to follow.
    fn apply(&mut self) -> bool {
        let (x, work) = (&mut self.belief.x, &mut self.work);
        work.reset.reset();
        let is_reset = self.chart.correct(&self.layout, x, &work.correction, self.how, &mut work.reset);
        if is_reset {
            self.belief.covariance.congruence(&work.reset, &mut work.work);
        }
        self.signals.forget();
        is_reset
    }

    fn report<'a>(&'a self, observed: &Observed<'a>, verdict: Verdict, nis: f64, answer: Answer, weight: f64) -> Update<'a> {
        let Size { value, residual: m } = observed.model.size();
        Update {
            verdict,
            value: &observed.value[..value],
            predicted: &self.work.predicted[..value],
            noise: &observed.noise[..m * m],
            residual: &self.work.residual[..m],
            innovation_sigma: &self.work.sigma[..m],
            innovation_factor: &self.work.innovation_factor[..m * m],
            nis,
            statistic: answer.statistic,
            threshold: answer.threshold,
            mode: answer.mode,
            power: &self.work.power[..m],
            weight,
            rivals: Rivals::NONE,
            jacobian: self.jacobian(),
        }
    }
}

/// The answer of a gate that was not called.
const NOT_ASKED: Answer = Answer {
    decision: Decision::Reject,
    statistic: f64::NAN,
    threshold: f64::NAN,
    mode: Mode::Track,
};

impl Memory for Filter {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.belief.remember(tape);
        self.past.remember(tape);
        self.fixes.remember(tape);
        self.earlier.remember(tape);
        self.protection.remember(tape);
        self.is_open.remember(tape);
        if tape.is_reading() {
            self.signals.forget();
        }
        // Sums run along the learnt patterns, which therefore decide the last bit.
        self.transition.phi.remember(tape);
        let Innovation { reset, trial, .. } = &mut self.work;
        reset.remember(tape);
        reset.exchange(&mut trial.by);
        reset.remember(tape);
        reset.exchange(&mut trial.by);
        self.remember_anchor(tape);
    }
}

impl Filter {
    /// Where the chart is anchored. A filter that is read from a tape is anchored there.
    fn remember_anchor(&mut self, tape: &mut Tape<'_>) {
        let mut is_anchored = self.anchor.is_some();
        is_anchored.remember(tape);
        if !is_anchored {
            if self.anchor.take().is_some() {
                self.chart = Arc::clone(&self.given);
            }
            return;
        }
        let known = self.anchor.as_deref().unwrap_or(&self.belief.x);
        self.x_before.copy_from_slice(known);
        tape.numbers(&mut self.x_before);
        if tape.is_sound() && self.anchor.as_ref() != Some(&self.x_before) {
            self.chart = self
                .given
                .anchored(&self.layout, &self.x_before)
                .unwrap_or_else(|| Arc::clone(&self.given));
            self.anchor = Some(self.x_before.clone());
        }
    }
}

impl Estimator for Filter {
    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    fn keeps_covariance(&self) -> bool {
        self.rule.keeps_covariance()
    }

    fn set_belief(&mut self, belief: Belief) {
        if let Some(chart) = self.chart.anchored(&self.layout, &belief.x) {
            self.chart = chart;
            self.anchor = Some(belief.x.clone());
        }
        let covariance = belief.covariance.stored_in(self.p_before.form());
        let before = core::mem::take(&mut self.belief.input);
        self.belief = Belief { covariance, ..belief };
        // A belief that was read from a file, or made by hand, has no input.
        if !self.belief.input.fits(self.process.input_dim()) {
            self.belief.input = before;
        }
        if !self.rule.keeps_covariance() {
            self.belief.covariance.clear();
        }
        self.past.start(&self.belief);
        self.fixes.start();
        self.earlier.start(&self.belief.x);
        self.protection.start();
        self.is_open = false;
        self.signals.forget();
    }

    fn renew(&mut self, from: &Belief) {
        self.forget_steps();
        let prior = self.prior();
        take_orientations(&self.layout, from, &mut self.belief);
        self.earlier.start(&self.belief.x);
        self.signals.forget();
        self.keep(prior, |f, prior| {
            let mut transition = Transition::new(&f.layout);
            for axis in f.growing.angular.iter() {
                transition.phi.set_element(*axis, *axis, 0.0);
            }
            let posterior = f.belief.clone();
            Step::Predicted {
                prior,
                cause: Cause::Renewal,
                transition,
                posterior,
            }
        });
    }

    fn predict(&mut self, to: Time, input: &Input<'_>) -> Result<(), FilterError> {
        self.advance(to, |_, _| Drive::Input(*input))
    }

    fn coast(&mut self, to: Time, missing: f64, expected: Option<&Input<'_>>) -> Result<(), FilterError> {
        if let Some(expected) = expected.filter(|_| !self.belief.input.is_coasting()) {
            self.belief.input.take(expected);
        }
        let before = missing - to.seconds_since(self.belief.time);
        self.advance(to, |from, to| {
            Drive::Nothing(Gap {
                from: before + from,
                to: before + to,
            })
        })?;
        self.is_open = self.is_open || self.widest_orientation() > ALIGNED;
        Ok(())
    }

    fn update<'a>(&'a mut self, observed: &Observed<'a>, gate: &mut dyn Gate, others: &[Option<Outcome>], loss: &dyn Loss) -> Update<'a> {
        self.forget_steps();
        if others.iter().flatten().all(|o| o.is_used) {
            self.past.hear(&self.belief);
        }
        let nis = match self.innovation(observed) {
            Ok(nis) => nis,
            Err(verdict) => return self.report(observed, verdict, f64::NAN, NOT_ASKED, 0.0),
        };
        self.protection.hear(observed.sensor, nis, self.work.rows);
        let mut answer = self.judge(observed.quality, nis, gate, others);
        let (verdict, weight) = match answer.decision {
            Decision::Reject => (Verdict::Rejected, 0.0),
            Decision::Accept => self.use_it(observed, nis, loss),
            Decision::Reacquire if self.fixes.contradict(self.belief.time, &self.work.jacobian, &self.growing) => {
                answer.mode = Mode::Denied;
                (Verdict::Rejected, 0.0)
            }
            Decision::Reacquire => {
                self.remember();
                if self.inflate() && self.redraw(observed) && self.correct(observed, 1.0) {
                    (Verdict::Reacquired, 1.0)
                } else {
                    self.restore();
                    answer.mode = Mode::Denied;
                    (Verdict::Unusable, 0.0)
                }
            }
        };
        let is_used = matches!(verdict, Verdict::Accepted | Verdict::Reacquired);
        match verdict {
            Verdict::Reacquired => self.earlier.start(&self.belief.x),
            Verdict::Accepted if self.work.multiplies => {
                self.earlier.corrected(&self.belief.x, &self.work.jacobian, &self.work.work);
            }
            _ => {}
        }
        self.fixes.hear(self.belief.time, &self.work.jacobian, verdict == Verdict::Accepted);
        gate.settle(is_used);
        self.report(observed, verdict, nis, answer, weight)
    }

    fn jacobian(&self) -> Option<&Jacobian> {
        // The predicted σ is NaN or missing if the latest measurement failed before that step.
        let is_there = self.work.sigma[..self.work.rows].first().is_some_and(|sigma| *sigma > 0.0);
        (is_there && self.keeps_covariance()).then_some(&self.work.jacobian)
    }

    fn view(&mut self) -> View<'_> {
        self.signals
            .evaluate(self.process.as_ref(), &self.belief.x, &self.belief.input, false);
        self.signals.buffer.view(&self.belief.x)
    }

    fn keep_steps(&mut self, keep: bool) {
        self.steps = keep.then(Vec::new);
    }

    fn steps(&self) -> &[Step] {
        self.steps.as_deref().unwrap_or_default()
    }
}
