//! The estimator: predict and update. The only place where gains, gates and corrections are
//! computed; it knows blocks and Jacobians, and no sensor.

mod step;

pub use step::Step;

use crate::chart::{AdditiveEuler, AdditiveQuaternion, Body, Chart, Navigation};
use crate::covariance::{Covariance, Form, Scratch, cholesky, solve_lower, solve_rows};
use crate::gate::{Answer, Decision, Gate, GateInput, Mode};
use crate::linear::{BlockMatrix, Jacobian, Transition};
use crate::loss::Loss;
use crate::model::{Input, Measurement, Process, SignalBuffer, Size, Undefined};
use crate::state::{Belief, Dynamics, Layout, View};
use crate::time::Time;
use std::sync::Arc;
use thiserror::Error;

/// The most that readoption may grow P: ten thousand times every σ.
const MOST_GROWTH: f64 = 1e8;

/// What the covariance is the covariance of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ChartKind {
    /// Additive Euler angles: the classical EKF.
    AdditiveEuler,
    /// Additive quaternion components, normalised.
    AdditiveQuaternion,
    /// Body-frame attitude error.
    #[default]
    Body,
    /// Navigation-frame attitude error.
    Navigation,
}

/// How a measurement is linearised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum UpdateKind {
    /// Once, at the prediction.
    #[default]
    Single,
}

/// A backend: three independent choices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Backend {
    /// What the covariance is the covariance of.
    pub chart: ChartKind,
    /// How a measurement is linearised.
    pub update: UpdateKind,
    /// How P is kept positive.
    pub form: Form,
}

impl Backend {
    /// The classical EKF: additive Euler angles, one linearisation, Joseph form.
    pub const EKF: Self = Self {
        chart: ChartKind::AdditiveEuler,
        update: UpdateKind::Single,
        form: Form::Joseph,
    };
    /// The error-state filter: body-frame error, one linearisation, Joseph form.
    pub const ERROR_STATE: Self = Self {
        chart: ChartKind::Body,
        update: UpdateKind::Single,
        form: Form::Joseph,
    };
}

impl ChartKind {
    fn make(self) -> Arc<dyn Chart> {
        match self {
            Self::AdditiveEuler => Arc::new(AdditiveEuler),
            Self::AdditiveQuaternion => Arc::new(AdditiveQuaternion),
            Self::Body => Arc::new(Body),
            Self::Navigation => Arc::new(Navigation),
        }
    }
}

/// Why the estimator could not go on.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilterError {
    /// The state or its variances stopped being numbers; the belief is the last sound one.
    #[error("the estimate stopped being finite at {0}; the state before that step is kept")]
    Diverged(Time),
    /// A prediction to before the belief.
    #[error("asked to predict from {from} back to {to}")]
    Backwards {
        /// The belief's time.
        from: Time,
        /// The time asked for.
        to: Time,
    },
}

/// What became of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It corrected the estimate.
    Accepted,
    /// Its gate rejected it.
    Rejected,
    /// Its gate believed it against the estimate, whose covariance was inflated first.
    Readopted,
    /// The model has no value at this state.
    Undefined(Undefined),
    /// S was not positive definite, or the correction not finite: nothing was changed.
    Unusable,
}

/// One measurement's passage through the filter.
#[derive(Clone, Copy, Debug)]
pub struct Update<'a> {
    /// What became of it.
    pub verdict: Verdict,
    /// The measured value z, as it was offered.
    pub value: &'a [f64],
    /// The predicted value h(x̂) before the update; not a number where it is undefined.
    pub predicted: &'a [f64],
    /// R, m×m, row by row, before any robust weight.
    pub noise: &'a [f64],
    /// r = z ⊟ h(x̂) before the update.
    pub residual: &'a [f64],
    /// √S_ii, the predicted 1σ of each residual.
    pub innovation_sigma: &'a [f64],
    /// Normalised innovation squared, rᵀS⁻¹r.
    pub nis: f64,
    /// The gate's own statistic.
    pub statistic: f64,
    /// What the gate compared it with.
    pub threshold: f64,
    /// The gate's mode afterwards.
    pub mode: Mode,
    /// Robust weight, 1 where the loss left the measurement whole.
    pub weight: f64,
}

/// A measurement ready for an estimator.
#[derive(Clone, Copy, Debug)]
pub struct Observed<'a> {
    /// The model.
    pub model: &'a dyn Measurement,
    /// The measured value.
    pub value: &'a [f64],
    /// R, m×m, row by row.
    pub noise: &'a [f64],
}

/// The face every estimator shows, with or without a covariance.
pub trait Estimator: core::fmt::Debug + Send {
    /// What it believes now.
    fn belief(&self) -> &Belief;

    /// The state layout.
    fn layout(&self) -> &Layout;

    /// Replaces the belief: initialisation, a snapshot restored.
    fn set_belief(&mut self, belief: Belief);

    /// Moves the belief to `to` under `input`.
    ///
    /// # Errors
    /// [`FilterError`]; the belief stays sound.
    fn predict(&mut self, to: Time, input: &Input<'_>) -> Result<(), FilterError>;

    /// Offers a measurement valid now.
    fn update<'a>(&'a mut self, observed: &Observed<'a>, gate: &mut dyn Gate, loss: &dyn Loss) -> Update<'a>;

    /// The state and the process's signals, as models see them.
    fn view(&mut self) -> View<'_>;

    /// Whether it keeps its steps for [`Estimator::steps`]; not at first.
    fn keep_steps(&mut self, keep: bool);

    /// What the latest prediction or update consisted of, where steps are kept.
    fn steps(&self) -> &[Step];

    /// Copies the estimator with all that it has learnt: the copy continues bit for bit as the
    /// original would.
    fn boxed_clone(&self) -> Box<dyn Estimator>;
}

impl Clone for Box<dyn Estimator> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}

/// The Kalman filter on manifolds.
#[derive(Clone, Debug)]
pub struct Filter {
    layout: Arc<Layout>,
    process: Arc<dyn Process>,
    backend: Backend,
    chart: Arc<dyn Chart>,
    belief: Belief,
    transition: Transition,
    own: Vec<OwnDynamics>,
    signals: SignalBuffer,
    evaluated: Evaluated,
    held: HeldInput,
    jacobian: Jacobian,
    reset: BlockMatrix,
    scratch: Scratch,
    rows: RowScratch,
    /// The steps of the latest call, where they are kept.
    steps: Option<Vec<Step>>,
}

/// How much of the signals is evaluated at the belief.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Evaluated {
    Nothing,
    Values,
    Jacobian,
}

/// Vectors of one measurement and of the state, sized once.
#[derive(Clone, Debug)]
struct RowScratch {
    value: Vec<f64>,
    residual: Vec<f64>,
    whitened: Vec<f64>,
    sigma: Vec<f64>,
    noise: Vec<f64>,
    delta: Vec<f64>,
    x_before: Vec<f64>,
    p_before: Covariance,
}

/// The input of the last step, under which signals are evaluated.
#[derive(Clone, Debug, Default)]
struct HeldInput {
    sample: Vec<f64>,
    neighbour: Vec<f64>,
    interval: f64,
    neighbour_interval: f64,
    neighbour_is_earlier: bool,
}

impl HeldInput {
    fn hold(&mut self, input: &Input<'_>) {
        self.sample.clear();
        self.sample.extend_from_slice(input.sample);
        self.neighbour.clear();
        self.neighbour.extend_from_slice(input.neighbour);
        self.interval = input.interval;
        self.neighbour_interval = input.neighbour_interval;
        self.neighbour_is_earlier = input.neighbour_is_earlier;
    }

    fn input(&self) -> Input<'_> {
        Input {
            sample: &self.sample,
            neighbour: &self.neighbour,
            interval: self.interval,
            neighbour_interval: self.neighbour_interval,
            neighbour_is_earlier: self.neighbour_is_earlier,
        }
    }
}

/// Dynamics that a tangent coordinate has by itself.
#[derive(Clone, Copy, Debug)]
enum OwnDynamics {
    Walk {
        axis: usize,
        psd: f64,
    },
    Markov {
        axis: usize,
        storage: usize,
        variance: f64,
        tau: f64,
    },
}

impl Filter {
    /// A filter at the layout's initial belief, with room for measurements of up to `largest`.
    #[must_use]
    pub fn new(layout: Arc<Layout>, process: Arc<dyn Process>, backend: Backend, largest: Size) -> Self {
        let m = largest.residual.max(1);
        let n = layout.dim();
        let mut own = Vec::new();
        for b in layout.blocks() {
            for (k, axis) in b.tangent_range().enumerate() {
                match &b.dynamics {
                    Dynamics::RandomWalk { psd } if psd[k] > 0.0 => own.push(OwnDynamics::Walk { axis, psd: psd[k] }),
                    Dynamics::GaussMarkov { sigma, tau } => {
                        own.push(OwnDynamics::Markov {
                            axis,
                            storage: b.storage + k,
                            variance: sigma[k] * sigma[k],
                            tau: *tau,
                        });
                    }
                    _ => {}
                }
            }
        }
        Self {
            belief: Belief::initial(&layout, Time::default()),
            transition: Transition::new(&layout),
            own,
            signals: SignalBuffer::new(&layout),
            evaluated: Evaluated::Nothing,
            held: HeldInput {
                sample: vec![0.0; process.input_dim()],
                neighbour: vec![0.0; process.input_dim()],
                ..HeldInput::default()
            },
            jacobian: Jacobian::new(&layout, m),
            reset: BlockMatrix::identity(n),
            scratch: Scratch::new(n, m),
            rows: RowScratch {
                value: vec![0.0; largest.value.max(1)],
                residual: vec![0.0; m],
                whitened: vec![0.0; m],
                sigma: vec![0.0; m],
                noise: vec![0.0; m * m],
                delta: vec![0.0; n],
                x_before: vec![0.0; layout.storage()],
                p_before: Covariance::zeros(n),
            },
            chart: backend.chart.make(),
            steps: None,
            layout,
            process,
            backend,
        }
    }

    /// One step; false where its result is not finite, with a state then to be restored and a
    /// covariance as before.
    fn step(&mut self, input: &Input<'_>, to: Time, dt: f64) -> bool {
        let prior = self.steps.is_some().then(|| self.belief.clone());
        self.transition.reset();
        self.process.linearise(&self.belief.x, input, dt, &mut self.transition);
        // The process moves under the state it was linearised at, so blocks decay after it.
        self.process.propagate(&mut self.belief.x, input, dt);
        for own in &self.own {
            match *own {
                OwnDynamics::Walk { axis, psd } => self.transition.after.diagonal(axis, psd * dt),
                OwnDynamics::Markov {
                    axis,
                    storage,
                    variance,
                    tau,
                } => {
                    let decay = (-dt / tau).exp();
                    self.belief.x[storage] *= decay;
                    self.transition.phi.set_element(axis, axis, decay);
                    self.transition.after.diagonal(axis, variance * (1.0 - decay * decay));
                }
            }
        }
        if !(self.belief.x.iter().all(|v| v.is_finite()) && self.belief.covariance.predict(&self.transition, &mut self.scratch)) {
            return false;
        }
        self.belief.time = to;
        if let (Some(steps), Some(prior)) = (&mut self.steps, prior) {
            steps.push(Step::Predicted {
                prior,
                transition: self.transition.clone(),
                posterior: self.belief.clone(),
            });
        }
        true
    }

    fn evaluate_signals(&mut self, wanted: Evaluated) {
        if self.evaluated < wanted {
            self.signals.evaluate(
                self.process.as_ref(),
                &self.belief.x,
                &self.held.input(),
                wanted == Evaluated::Jacobian,
            );
            self.evaluated = wanted;
        }
    }

    /// Prediction, residual, H, S and NIS into scratch.
    fn linearise(&mut self, o: &Observed<'_>) -> Result<Option<f64>, Undefined> {
        let Size { value, residual: m } = o.model.size();
        self.evaluate_signals(Evaluated::Values);
        let view = self.signals.view(&self.belief.x);
        self.jacobian.reset(m);
        o.model.predict(&view, &mut self.rows.value[..value])?;
        o.model
            .residual(&o.value[..value], &self.rows.value[..value], &mut self.rows.residual[..m]);
        o.model.jacobian(&view, &mut self.jacobian)?;
        if self.jacobian.needs_signals() {
            self.evaluate_signals(Evaluated::Jacobian);
            self.jacobian.chain(&self.signals.jacobian);
        }
        self.belief.covariance.project(&self.jacobian, &mut self.scratch);
        self.rows.noise[..m * m].copy_from_slice(&o.noise[..m * m]);
        let finite = self.rows.residual[..m].iter().all(|r| r.is_finite());
        Ok((finite && self.factor(m)).then(|| self.whiten(m)))
    }

    /// S = HPHᵀ + R and its Cholesky factor.
    fn factor(&mut self, m: usize) -> bool {
        let w = &mut self.scratch;
        for ((s, p), r) in w.s.iter_mut().zip(&w.hph).zip(&self.rows.noise[..m * m]) {
            *s = p + r;
        }
        cholesky(&w.s, &mut w.l, m)
    }

    /// The whitened residual, and its squared norm: the NIS.
    fn whiten(&mut self, m: usize) -> f64 {
        let w = &mut self.rows.whitened[..m];
        w.copy_from_slice(&self.rows.residual[..m]);
        solve_lower(&self.scratch.l, w, m);
        w.iter().map(|v| v * v).sum()
    }

    /// P grows as a whole, doubling, until the residual is one that it expects: κ with
    /// rᵀ(κHPHᵀ + R)⁻¹r ≤ m. False, and nothing changed, where no growth explains it.
    ///
    /// As a whole, because nobody knows which state went wrong: growth along the residual alone
    /// would blame one combination of the states, and the update would then be certain of it.
    fn inflate(&mut self, m: usize) -> bool {
        let mut growth = 1.0;
        while !(self.factor(m) && self.whiten(m) <= m as f64) {
            growth *= 2.0;
            if growth > MOST_GROWTH {
                return false;
            }
            self.scratch.hph[..m * m].iter_mut().for_each(|p| *p *= 2.0);
        }
        let prior = self.steps.is_some().then(|| self.belief.clone());
        self.belief.covariance.scale(growth);
        if let (Some(steps), Some(prior)) = (&mut self.steps, prior) {
            let posterior = self.belief.clone();
            steps.push(Step::Inflated { prior, posterior });
        }
        self.belief.covariance.project(&self.jacobian, &mut self.scratch);
        self.factor(m) && self.whiten(m).is_finite()
    }

    /// Gain, correction and covariance; false (and nothing changed) if a number is not finite.
    fn correct(&mut self, m: usize) -> bool {
        let ld = self.jacobian.row(0).len();
        let n = self.layout.dim();
        let w = &mut self.scratch;
        w.kt[..m * ld].copy_from_slice(&w.hp[..m * ld]);
        solve_rows(&w.l, &mut w.kt, m, ld);
        let delta = &mut self.rows.delta;
        for (i, d) in delta.iter_mut().enumerate().take(n) {
            *d = (0..m).map(|j| w.kt[j * ld + i] * self.rows.residual[j]).sum();
        }
        if delta.iter().any(|d| !d.is_finite()) {
            return false;
        }
        let prior = self.steps.is_some().then(|| self.belief.clone());
        self.belief
            .covariance
            .update(self.backend.form, &self.jacobian, &self.rows.noise[..m * m], w);
        self.reset.reset();
        let is_moved = self.chart.correct(&self.layout, &mut self.belief.x, delta, &mut self.reset);
        if is_moved {
            self.belief.covariance.congruence(&self.reset, w);
        }
        if let (Some(steps), Some(prior)) = (&mut self.steps, prior) {
            steps.push(Step::Corrected {
                prior,
                jacobian: self.jacobian.clone(),
                noise: self.rows.noise[..m * m].to_vec(),
                residual: self.rows.residual[..m].to_vec(),
                correction: delta.clone(),
                reset: is_moved.then(|| self.reset.clone()),
                posterior: self.belief.clone(),
            });
        }
        true
    }

    fn verdict<'a>(&'a self, observed: &Observed<'a>, verdict: Verdict, nis: f64, answer: Answer, weight: f64) -> Update<'a> {
        let Size { value, residual: m } = observed.model.size();
        Update {
            verdict,
            value: &observed.value[..value],
            predicted: &self.rows.value[..value],
            noise: &observed.noise[..m * m],
            residual: &self.rows.residual[..m],
            innovation_sigma: &self.rows.sigma[..m],
            nis,
            statistic: answer.statistic,
            threshold: answer.threshold,
            mode: answer.mode,
            weight,
        }
    }
}

impl Estimator for Filter {
    fn belief(&self) -> &Belief {
        &self.belief
    }

    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn set_belief(&mut self, belief: Belief) {
        self.belief = belief;
        self.evaluated = Evaluated::Nothing;
    }

    fn predict(&mut self, to: Time, input: &Input<'_>) -> Result<(), FilterError> {
        let from = self.belief.time;
        if to < from {
            return Err(FilterError::Backwards { from, to });
        }
        if let Some(steps) = &mut self.steps {
            steps.clear();
        }
        let total = to.seconds_since(from);
        if total > 0.0 {
            let steps = (total / self.process.max_step()).ceil().clamp(1.0, 1e6);
            self.rows.x_before.copy_from_slice(&self.belief.x);
            if steps > 1.0 {
                self.rows.p_before.copy_from(&self.belief.covariance);
            }
            for k in 1..=steps as usize {
                let part = crate::time::nanos(total / steps * k as f64);
                let end = if k == steps as usize { to } else { from.shifted(part) };
                if self.step(input, end, total / steps) {
                    continue;
                }
                self.belief.time = from;
                if let Some(steps) = &mut self.steps {
                    steps.clear();
                }
                self.belief.x.copy_from_slice(&self.rows.x_before);
                if steps > 1.0 {
                    self.belief.covariance.copy_from(&self.rows.p_before);
                }
                return Err(FilterError::Diverged(to));
            }
        }
        self.held.hold(input);
        self.evaluated = Evaluated::Nothing;
        Ok(())
    }

    fn update<'a>(&'a mut self, observed: &Observed<'a>, gate: &mut dyn Gate, loss: &dyn Loss) -> Update<'a> {
        if let Some(steps) = &mut self.steps {
            steps.clear();
        }
        let m = observed.model.size().residual;
        let silent = Answer {
            decision: Decision::Reject,
            statistic: f64::NAN,
            threshold: f64::NAN,
            mode: Mode::Track,
        };
        self.rows.sigma[..m].fill(f64::NAN);
        let nis = match self.linearise(observed) {
            Ok(Some(nis)) => nis,
            Ok(None) => return self.verdict(observed, Verdict::Unusable, f64::NAN, silent, 0.0),
            Err(why) => {
                self.rows.residual[..m].fill(f64::NAN);
                self.rows.value[..observed.model.size().value].fill(f64::NAN);
                return self.verdict(observed, Verdict::Undefined(why), f64::NAN, silent, 0.0);
            }
        };
        for i in 0..m {
            self.rows.sigma[i] = self.scratch.s[i * m + i].sqrt();
        }
        let answer = gate.judge(&GateInput {
            time: self.belief.time,
            residual: &self.rows.residual[..m],
            predicted: &self.scratch.hph[..m * m],
            noise: &self.rows.noise[..m * m],
            innovation: &self.scratch.s[..m * m],
            nis,
        });
        let mut verdict = Verdict::Accepted;
        let mut weight = 1.0;
        match answer.decision {
            Decision::Reject => return self.verdict(observed, Verdict::Rejected, nis, answer, 0.0),
            Decision::Readopt => {
                self.rows.p_before.copy_from(&self.belief.covariance);
                if !self.inflate(m) {
                    self.belief.covariance.copy_from(&self.rows.p_before);
                    return self.verdict(observed, Verdict::Unusable, nis, answer, 0.0);
                }
                verdict = Verdict::Readopted;
            }
            Decision::Accept => {
                weight = loss.weight(nis.sqrt(), m);
                if weight < 1.0 {
                    self.rows.noise[..m * m].iter_mut().for_each(|r| *r /= weight);
                    if !self.factor(m) {
                        return self.verdict(observed, Verdict::Unusable, nis, answer, 0.0);
                    }
                }
            }
        }
        if !self.correct(m) {
            if verdict == Verdict::Readopted {
                self.belief.covariance.copy_from(&self.rows.p_before);
            }
            verdict = Verdict::Unusable;
        }
        self.evaluated = Evaluated::Nothing;
        self.verdict(observed, verdict, nis, answer, weight)
    }

    fn view(&mut self) -> View<'_> {
        self.evaluate_signals(Evaluated::Values);
        self.signals.view(&self.belief.x)
    }

    fn keep_steps(&mut self, keep: bool) {
        self.steps = keep.then(Vec::new);
    }

    fn steps(&self) -> &[Step] {
        self.steps.as_deref().unwrap_or_default()
    }

    fn boxed_clone(&self) -> Box<dyn Estimator> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
pub(crate) mod tests;
