//! The estimator: predict and update. The only place where gains, gates and corrections are
//! computed; it knows blocks and Jacobians, and no sensor.

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
    fn make(self) -> Box<dyn Chart> {
        match self {
            Self::AdditiveEuler => Box::new(AdditiveEuler),
            Self::AdditiveQuaternion => Box::new(AdditiveQuaternion),
            Self::Body => Box::new(Body),
            Self::Navigation => Box::new(Navigation),
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
    fn update(&mut self, observed: &Observed<'_>, gate: &mut dyn Gate, loss: &dyn Loss) -> Update<'_>;

    /// The state and the process's signals, as models see them.
    fn view(&mut self) -> View<'_>;

    /// Copies the estimator, for snapshots and look-ahead.
    fn boxed_clone(&self) -> Box<dyn Estimator>;
}

/// The Kalman filter on manifolds.
#[derive(Debug)]
pub struct Filter {
    layout: Arc<Layout>,
    process: Arc<dyn Process>,
    backend: Backend,
    chart: Box<dyn Chart>,
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
            layout,
            process,
            backend,
        }
    }

    /// One step; false where its result is not finite, with a state then to be restored and a
    /// covariance as before.
    fn step(&mut self, input: &Input<'_>, dt: f64) -> bool {
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
        self.belief.x.iter().all(|v| v.is_finite()) && self.belief.covariance.predict(&self.transition, &mut self.scratch)
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

    /// P grows so that HPHᵀ gains rrᵀ + R: by G = PHᵀ(HPHᵀ)⁻¹, for which HG = I.
    fn inflate(&mut self, m: usize) -> bool {
        let ld = self.jacobian.row(0).len();
        let w = &mut self.scratch;
        if !cholesky(&w.hph, &mut w.l, m) {
            return false;
        }
        w.kt[..m * ld].copy_from_slice(&w.hp[..m * ld]);
        solve_rows(&w.l, &mut w.kt, m, ld);
        for i in 0..m {
            for j in 0..m {
                w.s[i * m + j] = self.rows.residual[i] * self.rows.residual[j] + self.rows.noise[i * m + j];
            }
        }
        self.belief.covariance.inflate(&w.kt[..m * ld], &w.s[..m * m], m);
        self.belief.covariance.project(&self.jacobian, &mut self.scratch);
        self.factor(m)
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
        self.belief
            .covariance
            .update(self.backend.form, &self.jacobian, &self.rows.noise[..m * m], w);
        self.reset.reset();
        if self.chart.correct(&self.layout, &mut self.belief.x, delta, &mut self.reset) {
            self.belief.covariance.congruence(&self.reset, w);
        }
        true
    }

    fn verdict(&self, verdict: Verdict, m: usize, nis: f64, answer: Answer, weight: f64) -> Update<'_> {
        Update {
            verdict,
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
        let total = to.seconds_since(from);
        if total > 0.0 {
            let steps = (total / self.process.max_step()).ceil().clamp(1.0, 1e6);
            self.rows.x_before.copy_from_slice(&self.belief.x);
            if steps > 1.0 {
                self.rows.p_before.copy_from(&self.belief.covariance);
            }
            for _ in 0..steps as usize {
                if self.step(input, total / steps) {
                    continue;
                }
                self.belief.x.copy_from_slice(&self.rows.x_before);
                if steps > 1.0 {
                    self.belief.covariance.copy_from(&self.rows.p_before);
                }
                return Err(FilterError::Diverged(to));
            }
            self.belief.time = to;
        }
        self.held.hold(input);
        self.evaluated = Evaluated::Nothing;
        Ok(())
    }

    fn update(&mut self, observed: &Observed<'_>, gate: &mut dyn Gate, loss: &dyn Loss) -> Update<'_> {
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
            Ok(None) => return self.verdict(Verdict::Unusable, m, f64::NAN, silent, 0.0),
            Err(why) => {
                self.rows.residual[..m].fill(f64::NAN);
                return self.verdict(Verdict::Undefined(why), m, f64::NAN, silent, 0.0);
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
            Decision::Reject => return self.verdict(Verdict::Rejected, m, nis, answer, 0.0),
            Decision::Readopt => {
                self.rows.p_before.copy_from(&self.belief.covariance);
                if !self.inflate(m) {
                    self.belief.covariance.copy_from(&self.rows.p_before);
                    return self.verdict(Verdict::Unusable, m, nis, answer, 0.0);
                }
                verdict = Verdict::Readopted;
            }
            Decision::Accept => {
                weight = loss.weight(nis.sqrt(), m);
                if weight < 1.0 {
                    self.rows.noise[..m * m].iter_mut().for_each(|r| *r /= weight);
                    if !self.factor(m) {
                        return self.verdict(Verdict::Unusable, m, nis, answer, 0.0);
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
        self.verdict(verdict, m, nis, answer, weight)
    }

    fn view(&mut self) -> View<'_> {
        self.evaluate_signals(Evaluated::Values);
        self.signals.view(&self.belief.x)
    }

    fn boxed_clone(&self) -> Box<dyn Estimator> {
        let largest = Size {
            value: self.rows.value.len(),
            residual: self.rows.residual.len(),
        };
        let mut copy = Self::new(self.layout.clone(), self.process.clone(), self.backend, largest);
        copy.belief = self.belief.clone();
        copy.held = self.held.clone();
        Box::new(copy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::{Nis, Open, Recovery};
    use crate::loss::{Huber, Quadratic};
    use crate::state::{Attitude, Declaration, LayoutBuilder, Manifold, Param, Scalar, Slot, Vector};
    use crate::testing::Lcg;
    use nalgebra::{DMatrix, Matrix1, SMatrix, SVector};

    fn declare<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value, sigma: &[f64], dynamics: Dynamics) -> Slot<M> {
        let (name, owner, sigma) = (name.to_owned(), String::new(), sigma.to_vec());
        b.declare::<M>(Declaration {
            name,
            owner,
            unit: "",
            initial,
            sigma,
            dynamics,
        })
        .unwrap()
    }

    /// Nothing moves but what moves by itself.
    #[derive(Debug)]
    struct Still;

    impl Process for Still {
        fn input_dim(&self) -> usize {
            0
        }
        fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
        fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}
    }

    /// Constant velocity whose acceleration is constant over a step of `sigma` m/s²; its input
    /// is an acceleration known.
    #[derive(Debug)]
    struct Track {
        position: Slot<Scalar>,
        velocity: Slot<Scalar>,
        sigma: f64,
    }

    impl Process for Track {
        fn input_dim(&self) -> usize {
            1
        }
        fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
            let (p, v, a) = (self.position.read(x), self.velocity.read(x), input.sample[0]);
            self.position.write(&(p + (v + 0.5 * a * dt) * dt), x);
            self.velocity.write(&(v + a * dt), x);
        }
        fn linearise(&self, _: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
            let q = self.sigma * self.sigma;
            out.set(self.position, self.velocity, &Matrix1::new(dt));
            out.noise(self.position, self.position, &Matrix1::new(q * dt.powi(4) / 4.0));
            out.noise(self.position, self.velocity, &Matrix1::new(q * dt.powi(3) / 2.0));
            out.noise(self.velocity, self.velocity, &Matrix1::new(q * dt * dt));
        }
    }

    /// z = H x of one block.
    #[derive(Debug)]
    struct Linear<const M: usize, const N: usize> {
        x: Param<Vector<N>>,
        h: SMatrix<f64, M, N>,
    }

    impl<const M: usize, const N: usize> Measurement for Linear<M, N> {
        fn size(&self) -> Size {
            Size::same(M)
        }
        fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
            value.copy_from_slice((self.h * at.get(&self.x)).as_slice());
            Ok(())
        }
        fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
            h.add(0, &self.x, &self.h);
            Ok(())
        }
    }

    /// z = x of one scalar.
    #[derive(Debug)]
    struct Direct(Slot<Scalar>);

    impl Measurement for Direct {
        fn size(&self) -> Size {
            Size::same(1)
        }
        fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
            value[0] = at.state(self.0);
            Ok(())
        }
        fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
            h.add_slot(0, self.0, &Matrix1::new(1.0));
            Ok(())
        }
    }

    fn filter(layout: LayoutBuilder, process: impl Process + 'static, largest: usize) -> Filter {
        Filter::new(
            Arc::new(layout.finish()),
            Arc::new(process),
            Backend::default(),
            Size::same(largest),
        )
    }

    fn accept<'a>(f: &'a mut Filter, model: &dyn Measurement, value: &[f64], noise: &[f64]) -> Update<'a> {
        f.update(&Observed { model, value, noise }, &mut Open, &Quadratic)
    }

    fn second(k: i64) -> Time {
        Time::from_nanos(k * 1_000_000_000)
    }

    fn dense(f: &Filter) -> DMatrix<f64> {
        let p = &f.belief().covariance;
        DMatrix::from_fn(p.dim(), p.dim(), |i, j| p.get(i, j))
    }

    #[test]
    fn a_random_walk_settles_at_the_closed_form() {
        let mut b = LayoutBuilder::new();
        let x = declare::<Scalar>(&mut b, "x", 0.0, &[1.0], Dynamics::RandomWalk { psd: vec![0.01] });
        let mut f = filter(b, Still, 1);
        let mut prior = 0.0;
        for k in 1..200 {
            f.predict(second(k), &Input::alone(&[])).unwrap();
            prior = f.belief().covariance.get(0, 0);
            accept(&mut f, &Direct(x), &[0.0], &[1.0]);
        }
        // P⁻ = (q + √(q² + 4qr))/2, K = P⁻/(P⁻ + r); seven printed digits.
        assert!((prior - 0.105_124_9).abs() < 5e-8, "{prior}");
        assert!((f.belief().covariance.get(0, 0) - 0.095_124_9).abs() < 5e-8);
    }

    #[test]
    fn constant_velocity_settles_at_the_alpha_beta_gains() {
        let mut b = LayoutBuilder::new();
        let position = declare::<Scalar>(&mut b, "position", 0.0, &[10.0], Dynamics::Process);
        let velocity = declare::<Scalar>(&mut b, "velocity", 0.0, &[10.0], Dynamics::Process);
        let mut f = filter(
            b,
            Track {
                position,
                velocity,
                sigma: 0.1,
            },
            1,
        );
        for k in 1..200 {
            f.predict(second(k), &Input::alone(&[0.0])).unwrap();
            accept(&mut f, &Direct(position), &[0.0], &[1.0]);
        }
        // Kalata's index 0.1: α = 0.36, β = 0.08 exactly; 1e-12: 200 steps of a contraction.
        let wanted = DMatrix::from_row_slice(2, 2, &[0.36, 0.08, 0.08, 0.04]);
        assert!((dense(&f) - wanted).amax() < 1e-12, "{}", dense(&f));
        let x = f.belief().x.clone();
        f.predict(second(200), &Input::alone(&[0.0])).unwrap();
        accept(&mut f, &Direct(position), &[1.0], &[1.0]);
        assert!((f.belief().x[0] - x[0] - 0.36).abs() < 1e-12 && (f.belief().x[1] - x[1] - 0.08).abs() < 1e-12);
    }

    /// A block of four correlated numbers.
    fn four(form: Form) -> (Filter, Slot<Vector<4>>) {
        let mut b = LayoutBuilder::new();
        let x = declare::<Vector<4>>(
            &mut b,
            "x",
            SVector::from([1.0, -2.0, 3.0, 0.5]),
            &[1.0, 2.0, 0.5, 3.0],
            Dynamics::Constant,
        );
        let backend = Backend {
            form,
            ..Backend::default()
        };
        let mut f = Filter::new(Arc::new(b.finish()), Arc::new(Still), backend, Size::same(3));
        let mixing = Linear {
            x: Param::State(x),
            h: SMatrix::<f64, 2, 4>::new(1.0, 1.0, 0.0, 0.5, 0.0, -1.0, 2.0, 1.0),
        };
        accept(&mut f, &mixing, &[0.0, 1.0], &[0.5, 0.1, 0.1, 0.7]);
        (f, x)
    }

    #[test]
    fn one_update_of_three_rows_equals_three_of_one() {
        let h = SMatrix::<f64, 3, 4>::new(1.0, 0.3, 0.0, 0.0, 0.0, 1.0, -0.4, 0.0, 0.2, 0.0, 0.0, 1.0);
        let (z, r) = ([0.4, -1.0, 2.0], [0.3, 0.2, 0.5]);
        for form in [Form::Joseph, Form::Standard] {
            let ((mut whole, x), (mut parts, _)) = (four(form), four(form));
            accept(
                &mut whole,
                &Linear { x: Param::State(x), h },
                &z,
                &[r[0], 0.0, 0.0, 0.0, r[1], 0.0, 0.0, 0.0, r[2]],
            );
            for i in 0..3 {
                let row = SMatrix::<f64, 1, 4>::from_fn(|_, j| h[(i, j)]);
                accept(
                    &mut parts,
                    &Linear {
                        x: Param::State(x),
                        h: row,
                    },
                    &z[i..=i],
                    &r[i..=i],
                );
            }
            // 1e-14: rounding.
            assert!((dense(&whole) - dense(&parts)).amax() < 1e-14);
            assert!(whole.belief().x.iter().zip(&parts.belief().x).all(|(a, b)| (a - b).abs() < 1e-14));
        }
    }

    #[test]
    fn the_update_equals_the_dense_reference_and_reports_its_statistics() {
        let (mut f, x) = four(Form::Joseph);
        let h = SMatrix::<f64, 2, 4>::new(1.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, -1.0);
        let (p, x0) = (dense(&f), nalgebra::DVector::from_column_slice(&f.belief().x));
        let (full, r) = (
            DMatrix::from_fn(2, 4, |i, j| h[(i, j)]),
            DMatrix::from_row_slice(2, 2, &[0.4, 0.1, 0.1, 0.6]),
        );
        let z = nalgebra::DVector::from_column_slice(&[5.0, -4.0]);
        let s = &full * &p * full.transpose() + &r;
        let gain = &p * full.transpose() * s.clone().try_inverse().unwrap();
        let residual = &z - &full * &x0;
        let nis = (residual.transpose() * s.clone().try_inverse().unwrap() * &residual)[0];
        let update = accept(&mut f, &Linear { x: Param::State(x), h }, z.as_slice(), r.as_slice());
        assert_eq!(update.verdict, Verdict::Accepted);
        // 1e-13: rounding of an inverse of condition about 10.
        assert!((update.nis - nis).abs() < 1e-13 * nis && (update.innovation_sigma[1] - s[(1, 1)].sqrt()).abs() < 1e-14);
        assert!((dense(&f) - (DMatrix::identity(4, 4) - &gain * full) * p).amax() < 1e-13);
        let moved = x0 + gain * residual;
        assert!(moved.iter().zip(&f.belief().x).all(|(a, b)| (a - b).abs() < 1e-13));
    }

    #[test]
    fn a_loss_divides_the_noise_by_its_weight() {
        let ((mut robust, x), (mut inflated, _)) = (four(Form::Joseph), four(Form::Joseph));
        let h = SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0);
        let model = Linear { x: Param::State(x), h };
        let huber = Huber { k: 1.0 };
        let weight = robust
            .update(
                &Observed {
                    model: &model,
                    value: &[50.0],
                    noise: &[0.2],
                },
                &mut Open,
                &huber,
            )
            .weight;
        assert!(weight < 0.1, "{weight}");
        accept(&mut inflated, &model, &[50.0], &[0.2 / weight]);
        assert_eq!(
            (robust.belief().x.clone(), dense(&robust)),
            (inflated.belief().x.clone(), dense(&inflated))
        );
    }

    fn unchanged(f: &Filter, x: &[f64], p: &DMatrix<f64>) -> bool {
        f.belief().x == x && dense(f) == *p
    }

    #[test]
    fn numeric_trouble_leaves_the_belief_as_it_was() {
        let (mut f, x) = four(Form::Joseph);
        let (before, p) = (f.belief().x.clone(), dense(&f));
        let model = Linear {
            x: Param::State(x),
            h: SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0),
        };
        for (z, r) in [
            (f64::NAN, 1.0),
            (f64::INFINITY, 1.0),
            (0.0, f64::NAN),
            (0.0, -1e3),
            (0.0, f64::INFINITY),
        ] {
            assert_eq!(accept(&mut f, &model, &[z], &[r]).verdict, Verdict::Unusable, "{z} {r}");
            assert!(unchanged(&f, &before, &p), "{z} {r}");
        }
        // S = HPHᵀ + R of two equal rows without noise is singular.
        let twice = Linear {
            x: Param::State(x),
            h: SMatrix::<f64, 2, 4>::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        };
        assert_eq!(accept(&mut f, &twice, &[0.0, 0.0], &[0.0; 4]).verdict, Verdict::Unusable);
        assert!(unchanged(&f, &before, &p));
    }

    #[test]
    fn a_prediction_that_diverges_leaves_the_belief_as_it_was() {
        let mut b = LayoutBuilder::new();
        let position = declare::<Scalar>(&mut b, "position", 0.0, &[1.0], Dynamics::Process);
        let velocity = declare::<Scalar>(&mut b, "velocity", 2.0, &[1.0], Dynamics::Process);
        let mut f = filter(
            b,
            Track {
                position,
                velocity,
                sigma: 0.1,
            },
            1,
        );
        let (x, p) = (f.belief().x.clone(), dense(&f));
        assert_eq!(
            f.predict(second(1), &Input::alone(&[f64::NAN])),
            Err(FilterError::Diverged(second(1)))
        );
        assert!(unchanged(&f, &x, &p) && f.belief().time == second(0));
        // A covariance that overflows while the state does not.
        let mut belief = f.belief().clone();
        belief.covariance.set(1, 1, 1e308);
        f.set_belief(belief);
        let p = dense(&f);
        assert_eq!(
            f.predict(second(100), &Input::alone(&[0.0])),
            Err(FilterError::Diverged(second(100)))
        );
        assert!(unchanged(&f, &x, &p));
        assert_eq!(
            f.predict(second(-1), &Input::alone(&[0.0])),
            Err(FilterError::Backwards {
                from: second(0),
                to: second(-1)
            })
        );
    }

    #[test]
    fn a_rejected_measurement_changes_nothing() {
        let (mut f, x) = four(Form::Joseph);
        let (before, p) = (f.belief().x.clone(), dense(&f));
        let model = Linear {
            x: Param::State(x),
            h: SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0),
        };
        let mut gate = Nis::new(0.99, Recovery::default());
        let update = f.update(
            &Observed {
                model: &model,
                value: &[1e3],
                noise: &[0.1],
            },
            &mut gate,
            &Quadratic,
        );
        assert_eq!((update.verdict, update.weight), (Verdict::Rejected, 0.0));
        assert!(unchanged(&f, &before, &p));
    }

    /// Believes everything against the estimate.
    #[derive(Clone, Debug)]
    struct Credulous;

    impl Gate for Credulous {
        fn judge(&mut self, input: &GateInput<'_>) -> Answer {
            Answer {
                decision: Decision::Readopt,
                statistic: input.nis,
                threshold: 0.0,
                mode: Mode::Track,
            }
        }
        fn boxed_clone(&self) -> Box<dyn Gate> {
            Box::new(self.clone())
        }
    }

    #[test]
    fn readopting_first_grows_the_projected_covariance_by_the_residual_squared_plus_noise() {
        let (mut f, x) = four(Form::Joseph);
        let h = SMatrix::<f64, 2, 4>::new(1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.3);
        let model = Linear { x: Param::State(x), h };
        let (value, noise) = ([40.0, -30.0], [0.4, 0.1, 0.1, 0.6]);
        let observed = Observed {
            model: &model,
            value: &value,
            noise: &noise,
        };
        // The inflation alone.
        f.linearise(&observed).unwrap();
        let r = nalgebra::DVector::from_column_slice(&f.rows.residual[..2]);
        let (before, full) = (dense(&f), DMatrix::from_fn(2, 4, |i, j| h[(i, j)]));
        assert!(f.inflate(2));
        let grown = dense(&f) - before;
        let added = &r * r.transpose() + DMatrix::from_row_slice(2, 2, &noise);
        // 1e-11 of 1e3: rounding.
        assert!((&full * &grown * full.transpose() - added).amax() < 1e-11);
        assert!(grown.symmetric_eigen().eigenvalues.min() > -1e-10);
        // With the update: the state goes most of the way to the measurement.
        let (mut f, _) = four(Form::Joseph);
        let verdict = f.update(&observed, &mut Credulous, &Quadratic).verdict;
        let left = nalgebra::Vector2::from(value) - h * x.read(&f.belief().x);
        assert_eq!(verdict, Verdict::Readopted);
        // K = (HPHᵀ + rrᵀ + R)(… + R)⁻¹ leaves at most R/(rᵀr) of r.
        assert!(left.norm() < 0.05, "{left}");
    }

    /// Must not be asked.
    #[derive(Clone, Debug)]
    struct Unasked;

    impl Gate for Unasked {
        fn judge(&mut self, input: &GateInput<'_>) -> Answer {
            panic!("asked about {:?}", input.residual)
        }
        fn boxed_clone(&self) -> Box<dyn Gate> {
            Box::new(self.clone())
        }
    }

    #[test]
    fn a_measurement_that_is_no_number_never_reaches_its_gate() {
        let (mut f, x) = four(Form::Joseph);
        let model = Linear {
            x: Param::State(x),
            h: SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0),
        };
        let observed = Observed {
            model: &model,
            value: &[f64::NAN],
            noise: &[0.1],
        };
        assert_eq!(f.update(&observed, &mut Unasked, &Quadratic).verdict, Verdict::Unusable);
    }

    #[test]
    fn readopting_what_cannot_be_used_leaves_the_belief_as_it_was() {
        let (mut f, x) = four(Form::Joseph);
        let (before, p) = (f.belief().x.clone(), dense(&f));
        let blind = SMatrix::<f64, 1, 4>::zeros();
        let seeing = SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0);
        // The square of the second residual overflows once P has grown by it.
        for (h, value) in [(blind, 1.0), (seeing, 1e200)] {
            let model = Linear { x: Param::State(x), h };
            let observed = Observed {
                model: &model,
                value: &[value],
                noise: &[0.1],
            };
            assert_eq!(f.update(&observed, &mut Credulous, &Quadratic).verdict, Verdict::Unusable);
            assert!(unchanged(&f, &before, &p), "{value}");
        }
    }

    #[test]
    fn a_gauss_markov_block_relaxes_to_its_stationary_variance_whatever_the_steps() {
        let mut b = LayoutBuilder::new();
        declare::<Scalar>(
            &mut b,
            "bias",
            5.0,
            &[0.5],
            Dynamics::GaussMarkov {
                sigma: vec![2.0],
                tau: 60.0,
            },
        );
        let mut f = filter(b, Still, 1);
        let mut g = f.boxed_clone();
        for k in 1..=100 {
            f.predict(second(k), &Input::alone(&[])).unwrap();
        }
        g.predict(second(100), &Input::alone(&[])).unwrap();
        // x e^{−t/τ}, σ² + (P₀ − σ²) e^{−2t/τ}; 100 roundings.
        let decay = (-100.0_f64 / 60.0).exp();
        for belief in [f.belief(), g.belief()] {
            assert!((belief.x[0] - 5.0 * decay).abs() < 1e-13);
            assert!((belief.covariance.get(0, 0) - (4.0 + (0.25 - 4.0) * decay * decay)).abs() < 1e-13);
        }
    }

    #[test]
    fn one_hundred_thousand_random_steps_keep_the_covariance_symmetric_and_positive() {
        for (form, steps) in [(Form::Joseph, 100_000), (Form::Standard, 10_000)] {
            let mut b = LayoutBuilder::new();
            let position = declare::<Scalar>(&mut b, "position", 0.0, &[100.0], Dynamics::Process);
            let velocity = declare::<Scalar>(&mut b, "velocity", 0.0, &[10.0], Dynamics::Process);
            let bias = declare::<Scalar>(
                &mut b,
                "bias",
                0.0,
                &[1.0],
                Dynamics::GaussMarkov {
                    sigma: vec![1.0],
                    tau: 30.0,
                },
            );
            declare::<Attitude>(
                &mut b,
                "attitude",
                nalgebra::UnitQuaternion::identity(),
                &[0.1; 3],
                Dynamics::RandomWalk { psd: vec![1e-6; 3] },
            );
            let backend = Backend { form, ..Backend::EKF };
            let mut f = Filter::new(
                Arc::new(b.finish()),
                Arc::new(Track {
                    position,
                    velocity,
                    sigma: 0.01,
                }),
                backend,
                Size::same(1),
            );
            let mut r = Lcg::new(5);
            let mut now = 0;
            for _ in 0..steps {
                now += (r.unit() * 2e9) as i64;
                f.predict(Time::from_nanos(now), &Input::alone(&[0.1 * r.signed()])).unwrap();
                let noise = 10_f64.powf(6.0 * r.signed() - 3.0);
                let slot = if r.signed() > 0.0 { position } else { bias };
                accept(&mut f, &Direct(slot), &[r.signed()], &[noise]);
            }
            let p = dense(&f);
            assert_eq!(p, p.transpose());
            let scale: Vec<f64> = (0..6).map(|i| p[(i, i)].sqrt()).collect();
            assert!(scale.iter().all(|s| *s > 0.0));
            let correlation = DMatrix::from_fn(6, 6, |i, j| p[(i, j)] / (scale[i] * scale[j]));
            // −1e-12: rounding of the eigenvalues of a matrix of unit diagonal.
            assert!(correlation.symmetric_eigen().eigenvalues.min() > -1e-12, "{form:?}");
        }
    }
}
