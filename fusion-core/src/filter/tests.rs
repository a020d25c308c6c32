use super::*;
use crate::belief::Belief;
use crate::chart::Reset;
use crate::covariance::FormKind;
use crate::gate::{Answer, Decision, Gate, GateInput, Mode, Nis, Open, Recovery};
use crate::linear::{Jacobian, Transition};
use crate::loss::{Huber, Quadratic};
use crate::model::{Input, Measurement, Process, Size, Undefined};
use crate::state::{Attitude, Declaration, Dynamics, LayoutBuilder, Manifold, Param, Scalar, Slot, StateRole, Vector, View};
use crate::testing::Lcg;
use crate::time::Time;
use alloc::sync::Arc;
use nalgebra::{DMatrix, Matrix1, SMatrix, SVector};

mod bank;
mod curvature;
mod input_noise;
mod late;
mod protect;
mod reacquire;
mod rules;
mod signals;
mod steps;

pub(crate) fn declare<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value, sigma: &[f64], dynamics: Dynamics) -> Slot<M> {
    declare_as(b, name, StateRole::Kinematic, initial, sigma, dynamics)
}

fn declare_as<M: Manifold>(
    b: &mut LayoutBuilder,
    name: &str,
    role: StateRole,
    initial: M::Value,
    sigma: &[f64],
    dynamics: Dynamics,
) -> Slot<M> {
    let (name, owner, sigma) = (name.to_owned(), String::new(), sigma.to_vec());
    b.declare::<M>(Declaration {
        name,
        owner,
        unit: "",
        initial,
        sigma,
        role,
        dynamics,
    })
    .unwrap()
}

/// A process that moves nothing; only blocks with their own dynamics move.
#[derive(Debug)]
pub(crate) struct Still;

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
pub(crate) struct Track {
    pub(crate) position: Slot<Scalar>,
    pub(crate) velocity: Slot<Scalar>,
    pub(crate) sigma: f64,
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
pub(crate) struct Direct(pub(crate) Slot<Scalar>);

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

fn accept<'a>(f: &'a mut Filter, model: &'a dyn Measurement, value: &'a [f64], noise: &'a [f64]) -> Update<'a> {
    f.update(
        &Observed {
            sensor: 0,
            model,
            value,
            noise,
            quality: None,
            derivative_input: None,
            lateness: None,
        },
        &mut Open,
        &[],
        &Quadratic,
    )
}

pub(crate) fn second(k: i64) -> Time {
    Time::from_nanos(k * 1_000_000_000)
}

fn dense(f: &Filter) -> DMatrix<f64> {
    let p = &f.belief().covariance;
    DMatrix::from_row_slice(p.dim(), p.dim(), &p.to_dense())
}

#[test]
fn a_random_walk_settles_at_the_riccati_solution_prior_0_1051249_gain_0_0951249() {
    let mut b = LayoutBuilder::new();
    let x = declare::<Scalar>(&mut b, "x", 0.0, &[1.0], Dynamics::RandomWalk { psd: vec![0.01] });
    let mut f = filter(b, Still, 1);
    let mut prior = 0.0;
    for k in 1..200 {
        f.predict(second(k), &Input::held(&[])).unwrap();
        prior = dense(&f)[(0, 0)];
        accept(&mut f, &Direct(x), &[0.0], &[1.0]);
    }
    // P⁻ = (q + √(q² + 4qr))/2, K = P⁻/(P⁻ + r); seven printed digits.
    assert!((prior - 0.105_124_9).abs() < 5e-8, "{prior}");
    assert!((dense(&f)[(0, 0)] - 0.095_124_9).abs() < 5e-8);
    // The gain itself: how far a unit residual moves an estimate of 0.
    f.predict(second(200), &Input::held(&[])).unwrap();
    accept(&mut f, &Direct(x), &[1.0], &[1.0]);
    assert!((f.belief().x[0] - 0.095_124_9).abs() < 5e-8, "{}", f.belief().x[0]);
}

/// A constant-velocity filter of Kalata's index `index` after 2000 s of fixes of 1 m, one each
/// second, all of them 0; and its position.
fn alpha_beta(index: f64) -> (Filter, Slot<Scalar>) {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 0.0, &[10.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 0.0, &[10.0], Dynamics::Process);
    let mut f = filter(
        b,
        Track {
            position,
            velocity,
            sigma: index,
        },
        1,
    );
    for k in 1..2000 {
        f.predict(second(k), &Input::held(&[0.0])).unwrap();
        accept(&mut f, &Direct(position), &[0.0], &[1.0]);
    }
    (f, position)
}

#[test]
fn constant_velocity_of_index_0_1_settles_at_alpha_0_36_and_beta_0_08() {
    let (mut f, position) = alpha_beta(0.1);
    // Exact; 1e-12: rounding through a contraction of 0.8² per step.
    let wanted = DMatrix::from_row_slice(2, 2, &[0.36, 0.08, 0.08, 0.04]);
    assert!((dense(&f) - wanted).amax() < 1e-12, "{}", dense(&f));
    f.predict(second(2000), &Input::held(&[0.0])).unwrap();
    accept(&mut f, &Direct(position), &[1.0], &[1.0]);
    assert!((f.belief().x[0] - 0.36).abs() < 1e-12 && (f.belief().x[1] - 0.08).abs() < 1e-12);
}

#[test]
fn constant_velocity_settles_at_the_gains_of_kalata() {
    for index in [0.01_f64, 0.1, 1.0, 5.0] {
        let r = (4.0 + index - (8.0 * index + index * index).sqrt()) / 4.0;
        let alpha = 1.0 - r * r;
        let beta = 2.0 * (2.0 - alpha) - 4.0 * (1.0 - alpha).sqrt();
        let p = dense(&alpha_beta(index).0);
        // 1e-12: as above; r² per step is 0.87 at most.
        assert!(
            (p[(0, 0)] - alpha).abs() < 1e-12 && (p[(1, 0)] - beta).abs() < 1e-12,
            "{index}: {p}"
        );
    }
}

/// A block of four correlated numbers.
fn four(form: FormKind) -> (Filter, Slot<Vector<4>>) {
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
    for form in [FormKind::Joseph, FormKind::Standard, FormKind::Udu, FormKind::SquareRoot] {
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
    let (mut f, x) = four(FormKind::Joseph);
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
    let model = Linear { x: Param::State(x), h };
    let update = accept(&mut f, &model, z.as_slice(), r.as_slice());
    assert_eq!(update.verdict, Verdict::Accepted);
    // 1e-13: rounding of an inverse of condition about 10.
    assert!((update.nis - nis).abs() < 1e-13 * nis && (update.innovation_sigma[1] - s[(1, 1)].sqrt()).abs() < 1e-14);
    assert!((dense(&f) - (DMatrix::identity(4, 4) - &gain * full) * p).amax() < 1e-13);
    let moved = x0 + gain * residual;
    assert!(moved.iter().zip(&f.belief().x).all(|(a, b)| (a - b).abs() < 1e-13));
}

#[test]
fn a_loss_divides_the_noise_by_its_weight() {
    let ((mut robust, x), (mut inflated, _)) = (four(FormKind::Joseph), four(FormKind::Joseph));
    let h = SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0);
    let model = Linear { x: Param::State(x), h };
    let huber = Huber::new(1.0);
    let weight = robust
        .update(
            &Observed {
                sensor: 0,
                model: &model,
                value: &[50.0],
                noise: &[0.2],
                quality: None,
                derivative_input: None,
                lateness: None,
            },
            &mut Open,
            &[],
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
    let (mut f, x) = four(FormKind::Joseph);
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
        f.predict(second(1), &Input::held(&[f64::NAN])),
        Err(FilterError::Diverged(second(1)))
    );
    assert!(unchanged(&f, &x, &p) && f.belief().time == second(0));
    // A covariance that overflows while the state does not.
    let mut belief = f.belief().clone();
    let overflowing = f.layout().blocks().iter().find(|b| b.tangent_range().contains(&1)).unwrap();
    belief.covariance.set_sigmas(overflowing, &[1e154]);
    f.set_belief(belief);
    let p = dense(&f);
    assert_eq!(
        f.predict(second(100), &Input::held(&[0.0])),
        Err(FilterError::Diverged(second(100)))
    );
    assert!(unchanged(&f, &x, &p));
    assert_eq!(
        f.predict(second(-1), &Input::held(&[0.0])),
        Err(FilterError::Backwards {
            from: second(0),
            to: second(-1)
        })
    );
}

/// 1e38 in one cell.
#[test]
fn a_measurement_that_would_take_the_state_off_the_earth_is_unusable() {
    let mut b = LayoutBuilder::new();
    let start = crate::state::Geodetic {
        lat: 0.8,
        lon: 0.1,
        height: 400.0,
    };
    let position = declare::<crate::state::Geodetic>(&mut b, "position", start, &[1.0; 3], Dynamics::Constant);
    let velocity = declare::<crate::state::Velocity>(&mut b, "velocity", nalgebra::Vector3::zeros(), &[1.0; 3], Dynamics::Constant);
    let mut f = filter(b, Still, 1);
    let (x, p) = (f.belief().x.clone(), dense(&f));
    for (at, value) in [(2, 1e38), (0, 1e8), (3, 1e10)] {
        let model = Component { position, velocity, at };
        assert_eq!(accept(&mut f, &model, &[value], &[1.0]).verdict, Verdict::Unusable, "{at} {value}");
        assert!(unchanged(&f, &x, &p), "{at} {value}");
        assert_eq!(f.view().state(position).height, 400.0);
        assert_eq!(accept(&mut f, &model, &[1.0], &[1e9]).verdict, Verdict::Accepted);
        let mut belief = f.belief().clone();
        belief.x.copy_from_slice(&x);
        belief.covariance = crate::belief::Belief::initial(f.layout(), belief.covariance.form(), second(0)).covariance;
        f.set_belief(belief);
    }
}

/// One tangent coordinate of a position or, from 3 on, of a velocity; z ⊟ h is z itself.
#[derive(Debug)]
struct Component {
    position: Slot<crate::state::Geodetic>,
    velocity: Slot<crate::state::Velocity>,
    at: usize,
}

impl Measurement for Component {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, _: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = 0.0;
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let row = nalgebra::Matrix1x3::from_fn(|_, j| f64::from(u8::from(j == self.at % 3)));
        if self.at < 3 {
            h.add_slot(0, self.position, &row);
        } else {
            h.add_slot(0, self.velocity, &row);
        }
        Ok(())
    }
}

#[test]
fn a_correction_that_leaves_a_negative_variance_is_refused() {
    // With a gain that is not optimal, the textbook form may give a negative variance. The rule here doubles the
    // gain.
    #[derive(Debug)]
    struct Eager;
    impl UpdateRule for Eager {
        fn name(&self) -> &'static str {
            "eager"
        }
        fn condition(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
            work.gain();
            work.work.kt_mut().iter_mut().for_each(|k| *k *= 2.0);
            let is_finite = work.correct();
            work.condition(problem.covariance);
            is_finite
        }
    }
    let mut b = LayoutBuilder::new();
    let x = declare::<Scalar>(&mut b, "x", 0.0, &[1.0], Dynamics::Constant);
    let parts = Parts {
        update: Arc::new(Eager),
        form: FormKind::Standard.form(),
        ..Parts::from(Backend::default())
    };
    let mut f = Filter::of(Arc::new(b.finish()), Arc::new(Still), parts, Size::same(1));
    let (before, p) = (f.belief().x.clone(), dense(&f));
    f.keep_steps(true);
    assert_eq!(accept(&mut f, &Direct(x), &[1.0], &[0.1]).verdict, Verdict::Unusable);
    assert!(unchanged(&f, &before, &p) && f.steps().is_empty());
}

#[test]
fn a_rejected_measurement_changes_nothing() {
    let (mut f, x) = four(FormKind::Joseph);
    let (before, p) = (f.belief().x.clone(), dense(&f));
    let model = Linear {
        x: Param::State(x),
        h: SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0),
    };
    let mut gate = Nis::new(0.99, Recovery::default());
    let update = f.update(
        &Observed {
            sensor: 0,
            model: &model,
            value: &[1e3],
            noise: &[0.1],
            quality: None,
            derivative_input: None,
            lateness: None,
        },
        &mut gate,
        &[],
        &Quadratic,
    );
    assert_eq!((update.verdict, update.weight), (Verdict::Rejected, 0.0));
    assert!(unchanged(&f, &before, &p));
}

/// Must not be asked.
#[derive(Clone, Debug)]
struct Unasked;
crate::memory!(Unasked {});

impl Gate for Unasked {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        panic!("asked about {:?}", input.residual)
    }
    fn power(&self, input: &GateInput<'_>, _: &mut [f64]) {
        panic!("asked about {:?}", input.residual)
    }
}

#[test]
fn a_measurement_that_is_no_number_never_reaches_its_gate() {
    let (mut f, x) = four(FormKind::Joseph);
    let model = Linear {
        x: Param::State(x),
        h: SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0),
    };
    let observed = Observed {
        sensor: 0,
        model: &model,
        value: &[f64::NAN],
        noise: &[0.1],
        quality: None,
        derivative_input: None,
        lateness: None,
    };
    assert_eq!(f.update(&observed, &mut Unasked, &[], &Quadratic).verdict, Verdict::Unusable);
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
    let mut g = f.clone();
    for k in 1..=100 {
        f.predict(second(k), &Input::held(&[])).unwrap();
    }
    g.predict(second(100), &Input::held(&[])).unwrap();
    // x e^{−t/τ}, σ² + (P₀ − σ²) e^{−2t/τ}; 100 roundings.
    let decay = (-100.0_f64 / 60.0).exp();
    for belief in [f.belief(), g.belief()] {
        assert!((belief.x[0] - 5.0 * decay).abs() < 1e-13);
        assert!((belief.covariance.to_dense()[0] - (4.0 + (0.25 - 4.0) * decay * decay)).abs() < 1e-13);
    }
}

#[test]
fn gauss_markov_of_60_s_keeps_0_98347_and_gains_0_032784_of_its_variance_in_a_second() {
    let mut b = LayoutBuilder::new();
    let (sigma, tau) = (vec![2.0], 60.0);
    declare::<Scalar>(&mut b, "bias", 1.0, &[0.0], Dynamics::GaussMarkov { sigma, tau });
    let mut f = filter(b, Still, 1);
    f.predict(second(1), &Input::held(&[])).unwrap();
    // Half of the last digit printed.
    assert!((f.belief().x[0] - 0.983_47).abs() < 5e-6, "{}", f.belief().x[0]);
    let q = dense(&f)[(0, 0)] / 4.0;
    assert!((q - 0.032_784).abs() < 5e-7, "{q}");
}

/// The entries of a pattern decide the order in which numbers are summed.
#[test]
fn patterns_that_were_learnt_are_remembered() {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 0.0, &[100.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 0.0, &[10.0], Dynamics::Process);
    let q = nalgebra::UnitQuaternion::identity();
    declare::<Attitude>(&mut b, "attitude", q, &[0.1; 3], Dynamics::RandomWalk { psd: vec![1e-6; 3] });
    let track = Track {
        position,
        velocity,
        sigma: 0.01,
    };
    let backend = Backend {
        reset: Reset::Full,
        ..Backend::ERROR_STATE
    };
    let new = Filter::new(Arc::new(b.finish()), Arc::new(track), backend, Size::same(1));
    let mut f = new.clone();
    f.predict(second(1), &Input::held(&[0.0])).unwrap();
    accept(&mut f, &Direct(position), &[1.0], &[1.0]);
    let (mut bytes, mut twin) = (Vec::new(), new.clone());
    crate::memory::save(&mut f, &mut bytes);
    crate::memory::restore(&mut twin, &bytes).unwrap();
    let patterns = |f: &Filter| [&f.transition.phi, &f.work.reset].map(|m| (0..5).map(|i| m.ranges(i).to_vec()).collect::<Vec<_>>());
    let learnt = patterns(&f);
    assert_eq!(patterns(&twin), learnt);
    for (learnt, before) in learnt.iter().zip(patterns(&new)) {
        assert_ne!(*learnt, before, "something was learnt");
    }
}

#[test]
fn a_million_random_steps_keep_the_covariance_symmetric_and_positive() {
    // The standard form guarantees this only up to rounding.
    for (form, steps) in [(FormKind::Joseph, 1_000_000), (FormKind::Standard, 10_000)] {
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
            f.predict(Time::from_nanos(now), &Input::held(&[0.1 * r.signed()])).unwrap();
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
