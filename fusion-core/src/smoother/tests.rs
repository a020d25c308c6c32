use super::record::{Kept, Kind, Reader, put};
use super::*;
use crate::belief::Belief;
use crate::chart::{Biases, Body, Chart, Reset, Side};
use crate::covariance::FormKind;
use crate::filter::tests::{Direct, Still, Track, declare, second};
use crate::filter::{Backend, ChartKind, Estimator, Filter, Observed, Parts, Step, UpdateKind, Verdict};
use crate::gate::{Answer, Decision, Gate, GateInput, Mode};
use crate::geometry::so3;
use crate::linear::{BlockMatrix, Jacobian};
use crate::loss::{Huber, Quadratic};
use crate::memory::{self, Memory};
use crate::model::{Input, Measurement, Size, Undefined};
use crate::runner::Halt;
use crate::state::{Attitude, Dynamics, Geodetic, Layout, LayoutBuilder, Scalar, Slot, Vector, Velocity, View};
use crate::testing::Lcg;
use alloc::sync::Arc;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

fn plain() -> Parts {
    Backend::default().into()
}

fn tape() -> Tape {
    Tape::new(Box::new(Vec::new()))
}

/// Accepts every measurement; every n-th one re-acquires, against the estimate.
#[derive(Clone, Debug)]
struct Believing(u32, u32);

impl Memory for Believing {
    fn remember(&mut self, tape: &mut memory::Tape<'_>) {
        self.1.remember(tape);
    }
}

impl Gate for Believing {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        self.1 += 1;
        let again = self.1.is_multiple_of(self.0);
        Answer {
            decision: if again { Decision::Reacquire } else { Decision::Accept },
            statistic: input.nis,
            threshold: 0.0,
            mode: Mode::Track,
        }
    }
    fn power(&self, _: &GateInput<'_>, _: &mut [f64]) {}
}

/// An event of a run.
#[derive(Clone, Debug)]
enum Told {
    Start(Belief),
    Step(Box<Step>),
    Estimate(Belief),
}

/// A linear run: a track with a bias that walks, a number known exactly, a wandering one and a loss that
/// weighs; two restarts and some re-acquisitions.
fn told(restarts: &[i64]) -> (Arc<Layout>, Vec<Told>) {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 1.0, &[20.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 0.5, &[5.0], Dynamics::Process);
    let walk = declare::<Scalar>(&mut b, "walk", 0.0, &[2.0], Dynamics::RandomWalk { psd: vec![0.01] });
    let known = declare::<Scalar>(&mut b, "known", 3.0, &[0.0], Dynamics::Constant);
    let markov = Dynamics::GaussMarkov {
        sigma: vec![0.5],
        tau: 20.0,
    };
    let error = declare::<Scalar>(&mut b, "error", 0.2, &[0.5], markov);
    let layout = Arc::new(b.finish());
    let process = Arc::new(Track {
        position,
        velocity,
        sigma: 0.3,
    });
    let mut f = Filter::new(layout.clone(), process, Backend::default(), Size::same(1));
    f.keep_steps(true);
    let (mut all, mut random, mut gate) = (
        vec![Told::Start(f.belief().clone()), Told::Estimate(f.belief().clone())],
        Lcg::new(5),
        Believing(17, 0),
    );
    let start = f.belief().clone();
    for k in 1..60 {
        if restarts.contains(&k) {
            f.set_belief(Belief {
                time: second(k - 1),
                ..start.clone()
            });
            all.extend([Told::Start(f.belief().clone()), Told::Estimate(f.belief().clone())]);
        }
        f.predict(second(k), &Input::held(&[random.signed()])).unwrap();
        all.extend(f.steps().iter().map(|s| Told::Step(Box::new(s.clone()))));
        for slot in [position, walk, known, error] {
            let (model, value, noise) = (Sum(slot, error), [3.0 * random.signed()], [0.4]);
            let observed = Observed {
                sensor: 0,
                model: &model,
                value: &value,
                noise: &noise,
                quality: None,
                derivative_input: None,
                lateness: None,
            };
            if random.signed() > 0.0 {
                let loss = Huber::new(1.0);
                f.update(&observed, &mut gate, &[], if k % 2 == 0 { &loss } else { &Quadratic });
                all.extend(f.steps().iter().map(|s| Told::Step(Box::new(s.clone()))));
            }
        }
        all.push(Told::Estimate(f.belief().clone()));
    }
    let inflated = all
        .iter()
        .filter(|t| matches!(t, Told::Step(s) if matches!(**s, Step::Inflated { .. })));
    assert!(inflated.count() >= 4);
    (layout, all)
}

/// z = a + b of two scalars, which may be one.
#[derive(Debug)]
struct Sum(Slot<Scalar>, Slot<Scalar>);

impl Measurement for Sum {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.state(self.0) + at.state(self.1);
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        [self.0, self.1]
            .iter()
            .for_each(|s| h.add_slot(0, *s, &nalgebra::Matrix1::new(1.0)));
        Ok(())
    }
}

fn interval(layout: &Arc<Layout>, parts: &Parts, told: &[Told]) -> Vec<Belief> {
    let mut smoother = FixedInterval::new(layout.clone(), parts, tape());
    for t in told {
        match t {
            Told::Start(belief) => smoother.start(belief).unwrap(),
            Told::Step(step) => Link::of(step).iter().for_each(|link| smoother.step(link).unwrap()),
            Told::Estimate(belief) => smoother.estimate(belief).unwrap(),
        }
    }
    let mut smoothed = smoother.smooth(tape()).unwrap();
    let mut all = Vec::new();
    while let Some(belief) = smoothed.read().unwrap() {
        all.push(belief.clone());
    }
    all
}

fn lagged(layout: &Arc<Layout>, told: &[Told], lag: i64) -> Vec<Belief> {
    let (mut smoother, mut all) = (FixedLag::new(layout.clone(), &plain(), lag), Vec::new());
    let mut tell = |b: &Belief| -> Result<(), Halt> {
        all.push(b.clone());
        Ok(())
    };
    for t in told {
        match t {
            Told::Start(belief) => smoother.start(belief, &mut tell).unwrap(),
            Told::Step(step) => Link::of(step).into_iter().for_each(|link| smoother.step(link, &mut tell).unwrap()),
            Told::Estimate(belief) => smoother.estimate(belief),
        }
    }
    smoother.finish(&mut tell).unwrap();
    all
}

fn dense(b: &Belief) -> DMatrix<f64> {
    let n = b.covariance.dim();
    DMatrix::from_row_slice(n, n, &b.covariance.to_dense())
}

/// Asserts that the beliefs agree: states to `tolerance` of their size and of 1, covariances likewise.
fn same(a: &[Belief], b: &[Belief], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert_eq!(a.time, b.time);
        for (a, b) in a.x.iter().zip(&b.x) {
            assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{a} {b}");
        }
        assert!(
            (dense(a) - dense(b)).amax() <= tolerance * (1.0 + dense(b).amax()),
            "{} {}",
            dense(a),
            dense(b)
        );
    }
}

/// The recursion of Rauch, Tung and Striebel over one piece, as published; P⁻ is inverted where it
/// has an inverse.
fn rauch_tung_striebel(told: &[Told]) -> Vec<Belief> {
    let (mut later, mut all) = (None::<(DVector<f64>, DMatrix<f64>)>, Vec::new());
    let back = |later: &mut Option<(DVector<f64>, DMatrix<f64>)>, phi: &DMatrix<f64>, prior: &Belief, posterior: &Belief| {
        let Some((x, p)) = later else { return };
        let pseudo = dense(posterior).pseudo_inverse(1e-12).unwrap();
        let g = dense(prior) * phi.transpose() * pseudo;
        let change = &*x - DVector::from_column_slice(&posterior.x);
        *x = DVector::from_column_slice(&prior.x) + &g * change;
        *p = dense(prior) + &g * (&*p - dense(posterior)) * g.transpose();
    };
    for t in told.iter().rev() {
        match t {
            Told::Start(_) => later = None,
            Told::Step(step) => match &**step {
                Step::Predicted {
                    prior,
                    transition,
                    posterior,
                    ..
                } => {
                    let n = prior.covariance.dim();
                    let phi = DMatrix::from_fn(n, n, |i, j| transition.phi.get(i, j));
                    back(&mut later, &phi, prior, posterior);
                }
                Step::Inflated { prior, posterior } => {
                    let n = prior.covariance.dim();
                    back(&mut later, &DMatrix::identity(n, n), prior, posterior);
                }
                Step::Corrected { .. } => {}
            },
            Told::Estimate(belief) => {
                let (x, p) = later.get_or_insert_with(|| (DVector::from_column_slice(&belief.x), dense(belief)));
                let mut smoothed = belief.clone();
                smoothed.x.copy_from_slice(x.as_slice());
                smoothed.covariance.set_whole(p.as_slice());
                all.push(smoothed);
            }
        }
    }
    all.reverse();
    all
}

#[test]
fn it_gives_what_the_recursion_of_rauch_tung_and_striebel_gives() {
    let (layout, told) = told(&[]);
    let found = interval(&layout, &plain(), &told);
    // 1e-9: a pseudo-inverse of condition 1e4, sixty times.
    same(&found, &rauch_tung_striebel(&told), 1e-9);
    // The exactly known state stays unchanged, and later data reduce the other variances.
    let variance = |b: &Belief, k: usize| b.covariance.element(k, k);
    assert!(found.iter().all(|b| b.x[3].to_bits() == 3_f64.to_bits() && variance(b, 3) == 0.0));
    let Told::Estimate(first) = &told[1] else { panic!() };
    assert!(
        (0..5)
            .filter(|k| *k != 3)
            .all(|k| variance(&found[0], k) < 0.9 * variance(first, k))
    );
}

#[test]
fn pieces_between_starts_are_smoothed_each_by_itself() {
    let (layout, told) = told(&[20, 41]);
    let starts: Vec<usize> = (0..told.len()).filter(|k| matches!(told[*k], Told::Start(_))).collect();
    let ends = starts.iter().skip(1).copied().chain([told.len()]);
    let apart: Vec<Belief> = starts
        .iter()
        .zip(ends)
        .flat_map(|(start, end)| interval(&layout, &plain(), &told[*start..end]))
        .collect();
    let whole = interval(&layout, &plain(), &told);
    assert_eq!(whole, apart);
    let lag = lagged(&layout, &told, second(1000).nanos());
    // 1e-12: the same sums in another order.
    same(&lag, &whole, 1e-12);
}

#[test]
fn a_lag_uses_the_data_up_to_its_end_and_no_more() {
    let (layout, told) = told(&[33]);
    for (lag, slack) in [(0, 0), (3, 0), (7, 500_000_000), (40, 0), (100, 0)] {
        let lag = second(lag).nanos() + slack;
        let found = lagged(&layout, &told, lag);
        let mut expected = Vec::new();
        for (k, t) in told.iter().enumerate() {
            let Told::Estimate(belief) = t else { continue };
            let is_within = |t: &&Told| match t {
                Told::Start(_) => false,
                Told::Estimate(later) => later.time.nanos() <= belief.time.nanos() + lag,
                Told::Step(step) => match &**step {
                    Step::Predicted { posterior, .. } | Step::Inflated { posterior, .. } | Step::Corrected { posterior, .. } => {
                        posterior.time.nanos() <= belief.time.nanos() + lag
                    }
                },
            };
            let until = k + told[k..].iter().take_while(is_within).count();
            expected.push(interval(&layout, &plain(), &told[k..until]).swap_remove(0));
        }
        // 1e-11: the same sums in another order, of numbers up to 400.
        same(&found, &expected, 1e-11);
    }
}

#[test]
fn it_gives_the_least_squares_solution_of_the_whole_log() {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 1.0, &[20.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 0.5, &[5.0], Dynamics::Process);
    let layout = Arc::new(b.finish());
    let (sigma, noise, epochs) = (0.3, 0.4, 30);
    let process = Arc::new(Track { position, velocity, sigma });
    let mut f = Filter::new(layout.clone(), process, Backend::default(), Size::same(1));
    f.keep_steps(true);
    let (mut told, mut random) = (vec![Told::Estimate(f.belief().clone())], Lcg::new(2));
    // Unknown: position and velocity at the start, one acceleration per second, all of them with a prior.
    let unknown = 2 + epochs;
    let mut state = DMatrix::<f64>::zeros(2, unknown);
    state.fill_with_identity();
    let mut states = vec![state.clone()];
    let mut information = DMatrix::from_diagonal_element(unknown, unknown, 1.0 / (sigma * sigma));
    (information[(0, 0)], information[(1, 1)]) = (1.0 / 400.0, 1.0 / 25.0);
    let mut right = &information * DVector::from_fn(unknown, |k, _| [1.0, 0.5].get(k).copied().unwrap_or(0.0));
    for k in 0..epochs {
        let phi = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 1.0]);
        state = phi * state;
        state[(0, 2 + k)] += 0.5;
        state[(1, 2 + k)] += 1.0;
        f.predict(second(k as i64 + 1), &Input::held(&[0.0])).unwrap();
        told.extend(f.steps().iter().map(|s| Told::Step(Box::new(s.clone()))));
        if k % 3 != 1 {
            let value = [5.0 * random.signed()];
            let observed = Observed {
                sensor: 0,
                model: &Direct(position),
                value: &value,
                noise: &[noise],
                quality: None,
                derivative_input: None,
                lateness: None,
            };
            let verdict = f.update(&observed, &mut Believing(u32::MAX, 0), &[], &Quadratic).verdict;
            assert_eq!(verdict, Verdict::Accepted);
            told.extend(f.steps().iter().map(|s| Told::Step(Box::new(s.clone()))));
            let row = state.row(0);
            information += row.transpose() * row / noise;
            right += row.transpose() * (value[0] / noise);
        }
        states.push(state.clone());
        told.push(Told::Estimate(f.belief().clone()));
    }
    let spread = information.cholesky().unwrap().inverse();
    let solution = &spread * right;
    let found = interval(&layout, &plain(), &told);
    for (state, belief) in states.iter().zip(&found) {
        let (x, p) = (state * &solution, state * &spread * state.transpose());
        // 1e-10: normal equations of condition 1e6, and sums of thirty steps.
        assert!((DVector::from_column_slice(&belief.x) - x).amax() < 1e-10);
        assert!((dense(belief) - p).amax() < 1e-10);
    }
}

#[test]
fn a_random_walk_in_the_middle_of_a_log_has_the_variance_0_0499376() {
    let mut b = LayoutBuilder::new();
    let x = declare::<Scalar>(&mut b, "x", 0.0, &[1.0], Dynamics::RandomWalk { psd: vec![0.01] });
    let layout = Arc::new(b.finish());
    let mut f = Filter::new(layout.clone(), Arc::new(Still), Backend::default(), Size::same(1));
    f.keep_steps(true);
    let mut told = vec![Told::Start(f.belief().clone())];
    for k in 1..400 {
        f.predict(second(k), &Input::held(&[])).unwrap();
        told.extend(f.steps().iter().map(|s| Told::Step(Box::new(s.clone()))));
        let observed = Observed {
            sensor: 0,
            model: &Direct(x),
            value: &[0.0],
            noise: &[1.0],
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        f.update(&observed, &mut Believing(u32::MAX, 0), &[], &Quadratic);
        told.extend(f.steps().iter().map(|s| Told::Step(Box::new(s.clone()))));
        told.push(Told::Estimate(f.belief().clone()));
    }
    // q r/√(q² + 4qr), seven printed digits.
    for found in [
        &interval(&layout, &plain(), &told)[200],
        &lagged(&layout, &told, second(190).nanos())[200],
    ] {
        assert!((found.covariance.element(0, 0) - 0.049_937_6).abs() < 5e-8);
    }
    // With a lag of 0 it is the filter's own covariance.
    let own = &lagged(&layout, &told, 0)[398];
    assert!((own.covariance.element(0, 0) - 0.095_124_9).abs() < 5e-8);
}

/// z = C_nbᵀ d, a direction d known.
#[derive(Debug)]
struct Direction(Slot<Attitude>, Vector3<f64>);

impl Measurement for Direction {
    fn size(&self) -> Size {
        Size::same(3)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value.copy_from_slice((at.state(self.0).inverse() * self.1).as_slice());
        Ok(())
    }
    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let seen = at.state(self.0).inverse() * self.1;
        h.add_slot(0, self.0, &so3::skew(&seen));
        Ok(())
    }
}

/// Every chart, both resets, and rules that linearise elsewhere than at the prediction.
fn backends() -> Vec<Backend> {
    let chart = |chart| Backend {
        chart,
        ..Backend::default()
    };
    let charts = [
        ChartKind::Body,
        ChartKind::Navigation,
        ChartKind::AdditiveEuler,
        ChartKind::AdditiveQuaternion,
        ChartKind::Invariant(Side::Right, Biases::Imperfect),
        ChartKind::Invariant(Side::Left, Biases::Imperfect),
    ];
    let full = |backend| Backend {
        reset: Reset::Full,
        ..backend
    };
    let all: Vec<Backend> = charts.into_iter().map(chart).collect();
    let rules = [Backend::IEKF, Backend::UKF].into_iter();
    all.iter().copied().map(full).chain(all.clone()).chain(rules).collect()
}

#[test]
fn what_corrections_say_of_the_instant_before_them_is_what_they_did_in_every_backend() {
    for (backend, error) in backends().into_iter().flat_map(|b| [(b, 0.8), (b, 0.1), (b, 1e-3)]) {
        let mut b = LayoutBuilder::new();
        let q = so3::from_rpy(0.3, -0.4, 1.0);
        declare::<Geodetic>(&mut b, "position", Geodetic::new(0.6, 2.2, 10.0), &[1.0; 3], Dynamics::Constant);
        declare::<Velocity>(&mut b, "velocity", Vector3::new(9.0, 5.0, 0.0), &[1.0; 3], Dynamics::Constant);
        let attitude = declare::<Attitude>(&mut b, "attitude", q, &[0.5, 0.3, 0.4], Dynamics::Constant);
        let layout = Arc::new(b.finish());
        let mut f = Filter::new(layout.clone(), Arc::new(Still), backend, Size::same(3));
        f.keep_steps(true);
        // It starts twice, a kilometre apart: position counts from the first.
        let first = f.belief().clone();
        let mut start = first.clone();
        layout.plus(&mut start.x, &[800.0, 600.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        f.set_belief(first.clone());
        f.set_belief(start.clone());
        let mut told = vec![Told::Start(first), Told::Start(start.clone())];
        let truth = q * so3::exp(&(Vector3::new(0.6, -0.48, 0.64) * error));
        for direction in [Vector3::x(), Vector3::new(0.0, 0.6, 0.8)] {
            told.push(Told::Estimate(f.belief().clone()));
            let (model, noise) = (Direction(attitude, direction), Matrix3::identity() * 0.04);
            let value = truth.inverse() * direction;
            let observed = Observed {
                sensor: 0,
                model: &model,
                value: value.as_slice(),
                noise: noise.as_slice(),
                quality: None,
                derivative_input: None,
                lateness: None,
            };
            f.update(&observed, &mut Believing(u32::MAX, 0), &[], &Quadratic);
            told.extend(f.steps().iter().map(|s| Told::Step(Box::new(s.clone()))));
            let piece = [&told[..2], &told[told.len() - 2..]].concat();
            let found = interval(&layout, &backend.into(), &piece).remove(0);
            // 1e-12: rounding, over a kilometre.
            same(&[found], &[f.belief().clone()], 1e-12);
        }
        told.push(Told::Estimate(f.belief().clone()));
        let found = interval(&layout, &backend.into(), &told);
        // The last estimate has no later data: bit for bit the filter's.
        let last = f.belief();
        assert_eq!((&found[2].x, found[2].covariance.to_dense()), (&last.x, last.covariance.to_dense()));
        // Two corrections at once agree with both in turn, except for terms of second order.
        let (mut apart, mut moved) = ([0.0; 9], [0.0; 9]);
        layout.minus(&found[0].x, &last.x, &mut apart);
        layout.minus(&start.x, &last.x, &mut moved);
        let turn = |d: [f64; 9]| d[6..].iter().fold(0.0, |most, d| f64::max(most, d.abs()));
        // Sigma points see the curvature over σ, however small the error: half a per cent.
        let over_sigma = if matches!(backend.update, UpdateKind::Unscented(_)) {
            5e-3
        } else {
            0.0
        };
        let most = (0.3 * error + over_sigma) * error;
        assert!(turn(apart) < most, "{backend:?} {error}: {apart:?}");
        assert!(turn(moved) > 0.3 * error, "{moved:?}");
    }
}

/// Counts the first number in half its unit from each correction on.
#[derive(Debug)]
struct Halving;

impl Chart for Halving {
    fn to_canonical(&self, _: &Layout, _: &[f64], _: &mut BlockMatrix) {}
    fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], _: Reset, by: &mut BlockMatrix) -> bool {
        layout.plus(x, delta);
        x[0] *= 2.0;
        by.set_element(0, 0, 2.0);
        true
    }
    fn difference(&self, layout: &Layout, a: &[f64], b: &[f64], delta: &mut [f64]) {
        layout.minus(a, b, delta);
        delta[0] = 0.5 * a[0] - b[0];
    }
}

/// z = a x.
#[derive(Debug)]
struct Row(Slot<Vector<2>>, [f64; 2]);

impl Measurement for Row {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = nalgebra::Vector2::from(self.1).dot(&at.state(self.0));
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add_slot(0, self.0, &nalgebra::RowVector2::from(self.1));
        Ok(())
    }
}

#[test]
fn a_chart_that_changes_the_coordinates_at_every_correction_changes_nothing_else() {
    let run = |chart: Arc<dyn Chart>, halves: f64| {
        let mut b = LayoutBuilder::new();
        let x = declare::<Vector<2>>(&mut b, "x", [1.0, 2.0].into(), &[1.0, 3.0], Dynamics::Constant);
        let layout = Arc::new(b.finish());
        let parts = Parts { chart, ..plain() };
        let mut f = Filter::of(layout.clone(), Arc::new(Still), parts.clone(), Size::same(1));
        f.keep_steps(true);
        let mut told = vec![Told::Estimate(f.belief().clone())];
        for (k, (a, b)) in [(1.0, 1.0), (1.0, -0.5), (0.3, 2.0)].into_iter().enumerate() {
            let model = Row(x, [a * halves.powi(k as i32), b]);
            let observed = Observed {
                sensor: 0,
                model: &model,
                value: &[0.5],
                noise: &[0.4],
                quality: None,
                derivative_input: None,
                lateness: None,
            };
            f.update(&observed, &mut Believing(u32::MAX, 0), &[], &Quadratic);
            told.extend(f.steps().iter().map(|s| Told::Step(Box::new(s.clone()))));
        }
        interval(&layout, &parts, &told).remove(0)
    };
    let (mut plain, halving) = (run(Arc::new(Body), 1.0), run(Arc::new(Halving), 0.5));
    // The chart carries the smoothed estimate too: once.
    plain.x[0] *= 2.0;
    plain.covariance.scale(core::slice::from_ref(&(0..1)), 4.0);
    same(&[halving], &[plain], 1e-14); // rounding
}

#[test]
fn every_form_is_smoothed_to_the_same_numbers() {
    let (layout, told) = told(&[]);
    let joseph = interval(&layout, &plain(), &told);
    let others: Vec<Told> = told
        .iter()
        .map(|t| match t {
            Told::Estimate(b) => {
                let mut other = b.clone();
                other.covariance = crate::covariance::Covariance::zeros(5, FormKind::Standard.form());
                other.covariance.set_whole(&b.covariance.to_dense());
                Told::Estimate(other)
            }
            t => t.clone(),
        })
        .collect();
    same(&interval(&layout, &plain(), &others), &joseph, 1e-13); // rounding
}

#[test]
fn records_come_back_from_the_end_whatever_their_length() {
    let record = |k: usize| vec![k as u8; [0, 1, 70, 300_000, 1_500_000][k % 5]];
    let mut tape = tape();
    (0..40).for_each(|k| tape.push(&record(k)).unwrap());
    let mut found = vec![9; 9];
    // Read and written in turns.
    for k in (30..40).rev() {
        assert!(tape.pop(&mut found).unwrap() && found == record(k), "{k}");
    }
    (30..35).for_each(|k| tape.push(&record(k)).unwrap());
    for k in (0..35).rev() {
        assert!(tape.pop(&mut found).unwrap() && found == record(k), "{k}");
    }
    assert!(!tape.pop(&mut found).unwrap() && found.is_empty());
}

/// Gives back a block that lacks its last byte.
#[derive(Debug)]
struct Damaged(Vec<Vec<u8>>, usize);

impl Shelf for Damaged {
    fn put(&mut self, block: &[u8]) -> Result<(), Halt> {
        self.0.put(block)
    }
    fn take(&mut self, block: &mut Vec<u8>) -> Result<bool, Halt> {
        let is_there = self.0.take(block)?;
        block.truncate(block.len() - self.1);
        Ok(is_there)
    }
}

#[test]
fn records_that_were_changed_are_told() {
    for lost in [1, 2, 5, 1000] {
        let mut tape = Tape::new(Box::new(Damaged(Vec::new(), lost)));
        (0..3000).for_each(|_| tape.push(&[7; 500]).unwrap());
        let mut record = Vec::new();
        let found = (0..3001).find_map(|_| tape.pop(&mut record).err());
        // A truncated length may be another valid length: the records then differ from the written ones.
        let is_told = found.is_some_and(|e| e.downcast_ref() == Some(&Unreadable)) || lost > 4;
        assert!(is_told, "{lost}");
    }
    let mut whole = vec![Kind::Estimate.byte()];
    let kept = Kept {
        x: vec![1.0; 4],
        p: vec![2.0; 6],
        ..Kept::default()
    };
    kept.write(&mut whole);
    for length in 0..whole.len() {
        let mut reader = Reader(&whole[..length]);
        let read = reader.kind().and_then(|_| Kept::default().read(&mut reader, 3));
        assert_eq!(read, Err(Unreadable), "{length}");
    }
    let mut changed = Vec::new();
    put::time(&mut changed, second(1));
    put::count(&mut changed, usize::MAX);
    assert_eq!(Kept::default().read(&mut Reader(&changed), 3), Err(Unreadable));
    assert_eq!(Reader(&[9]).kind(), Err(Unreadable));
    assert_eq!(Reader(&[7, 0]).index(7), Err(Unreadable));
}
