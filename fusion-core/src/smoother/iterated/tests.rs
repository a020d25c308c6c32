use super::*;
use crate::filter::tests::{Direct, Track, declare, second};
use crate::filter::{Backend, Estimator, Filter, Observed, SensorModel};
use crate::gate::Open;
use crate::linear::{Jacobian, Transition};
use crate::loss::{Huber, Loss, Quadratic};
use crate::model::{Input, Measurement, Size, Undefined};
use crate::smoother::{FixedInterval, Link};
use crate::state::{Dynamics, LayoutBuilder, Scalar, Slot, View};
use crate::testing::Lcg;
use crate::time::Time;
use nalgebra::Matrix1;

/// A pendulum in steps of 0.1 s: its rate gets noise of `sigma` \[rad/s\] in each step, its angle gets none.
#[derive(Debug)]
struct Pendulum {
    angle: Slot<Scalar>,
    rate: Slot<Scalar>,
    sigma: f64,
}

const STEP: f64 = 0.1;
const GRAVITY: f64 = 4.0;

/// The step without noise.
fn swing([angle, rate]: [f64; 2]) -> [f64; 2] {
    [angle + rate * STEP, rate - GRAVITY * angle.sin() * STEP]
}

impl Process for Pendulum {
    fn input_dim(&self) -> usize {
        0
    }
    fn propagate(&self, x: &mut [f64], _: &Input<'_>, _: f64) {
        let [angle, rate] = swing([self.angle.read(x), self.rate.read(x)]);
        self.angle.write(&angle, x);
        self.rate.write(&rate, x);
    }
    fn linearise(&self, x: &[f64], _: &Input<'_>, _: f64, out: &mut Transition) {
        out.set(self.angle, self.rate, &Matrix1::new(STEP));
        out.set(self.rate, self.angle, &Matrix1::new(-GRAVITY * self.angle.read(x).cos() * STEP));
        out.noise(self.rate, self.rate, &Matrix1::new(self.sigma * self.sigma));
    }
}

/// z = sin x.
#[derive(Debug)]
struct Sine(Slot<Scalar>);

impl Measurement for Sine {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.state(self.0).sin();
        Ok(())
    }
    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add_slot(0, self.0, &Matrix1::new(at.state(self.0).cos()));
        Ok(())
    }
}

/// A filter with its smoothers.
struct Rig {
    filter: Filter,
    sensors: Vec<SensorModel>,
    plain: FixedInterval,
    iterated: IteratedInterval,
}

fn tape() -> Tape {
    Tape::new(Box::new(Vec::new()))
}

impl Rig {
    fn new(b: LayoutBuilder, process: impl Process + 'static, sensors: Vec<SensorModel>) -> Self {
        let (layout, process, parts) = (Arc::new(b.finish()), Arc::new(process), Parts::from(Backend::default()));
        let mut filter = Filter::new(layout.clone(), process.clone(), Backend::default(), Size::same(1));
        filter.keep_steps(true);
        Self {
            filter,
            plain: FixedInterval::new(layout.clone(), &parts, tape()),
            iterated: IteratedInterval::new(layout, process, &parts, sensors.clone(), tape()),
            sensors,
        }
    }

    fn start(&mut self, belief: Belief) {
        self.filter.set_belief(belief);
        self.plain.start(self.filter.belief()).unwrap();
        self.iterated.start(self.filter.belief()).unwrap();
    }

    fn estimate(&mut self) {
        self.plain.estimate(self.filter.belief()).unwrap();
        self.iterated.estimate(self.filter.belief()).unwrap();
    }

    fn hear(&mut self) {
        for step in self.filter.steps() {
            Link::of(step).iter().for_each(|link| self.plain.step(link).unwrap());
            self.iterated.step(Replayed::of(step)).unwrap();
        }
    }

    fn predict(&mut self, to: Time, input: &[f64]) {
        self.filter.predict(to, &Input::held(input)).unwrap();
        self.hear();
    }

    fn measure(&mut self, sensor: usize, value: f64, noise: f64) {
        let SensorModel { model, loss, .. } = self.sensors[sensor].clone();
        let observed = Observed {
            sensor,
            model: model.as_ref(),
            value: &[value],
            noise: &[noise],
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        self.filter.update(&observed, &mut Open, &[], loss.as_ref());
        self.hear();
    }

    /// The estimates of the iteration by Cholesky factorisation.
    #[cfg(feature = "faer")]
    fn batch(self) -> (Vec<Belief>, Iteration) {
        let (mut batch, how) = self.iterated.by_cholesky().unwrap().smooth(tape()).unwrap();
        let mut all = Vec::new();
        while let Some(belief) = batch.read().unwrap() {
            all.push(belief.clone());
        }
        (all, how)
    }

    /// The estimates of both smoothers, and how the iteration ended.
    fn smoothed(self) -> (Vec<Belief>, Vec<Belief>, Iteration) {
        let (mut plain, (mut iterated, how)) = (self.plain.smooth(tape()).unwrap(), self.iterated.smooth(tape()).unwrap());
        let (mut once, mut again) = (Vec::new(), Vec::new());
        while let Some(belief) = plain.read().unwrap() {
            once.push(belief.clone());
        }
        while let Some(belief) = iterated.read().unwrap() {
            again.push(belief.clone());
        }
        (once, again, how)
    }
}

fn sensor(model: impl Measurement + 'static, loss: impl Loss + 'static) -> SensorModel {
    SensorModel {
        model: Arc::new(model),
        offset: None,
        loss: Arc::new(loss),
    }
}

#[test]
fn a_linear_log_is_left_as_the_smoother_finds_it() {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 1.0, &[20.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 0.5, &[5.0], Dynamics::Process);
    let walk = declare::<Scalar>(&mut b, "walk", 0.0, &[2.0], Dynamics::RandomWalk { psd: vec![0.01] });
    declare::<Scalar>(&mut b, "known", 3.0, &[0.0], Dynamics::Constant);
    let process = Track {
        position,
        velocity,
        sigma: 0.3,
    };
    let sensors = [position, velocity, walk].map(|slot| sensor(Direct(slot), Quadratic));
    let (mut rig, mut random) = (Rig::new(b, process, sensors.to_vec()), Lcg::new(5));
    let first = rig.filter.belief().clone();
    for k in 0..60 {
        // Two restarts: pieces are smoothed each by itself.
        if k % 25 == 0 {
            let time = second(k);
            rig.start(Belief { time, ..first.clone() });
            rig.estimate();
        }
        rig.predict(second(k + 1), &[random.signed()]);
        if random.signed() > 0.0 {
            rig.measure((k % 3) as usize, 3.0 * random.signed(), 0.4);
        }
        rig.estimate();
    }
    let (once, again, how) = rig.smoothed();
    assert!(how.is_converged && how.iterations == 1 && how.shortened == 0, "{how:?}");
    assert_eq!(once.len(), again.len());
    for (a, b) in once.iter().zip(&again) {
        assert_eq!(a.time, b.time);
        // 1e-10: rounding of numbers up to 400, sixty times.
        assert!(a.x.iter().zip(&b.x).all(|(a, b)| (a - b).abs() < 1e-10), "{a:?} {b:?}");
        let (p, q) = (a.covariance.to_dense(), b.covariance.to_dense());
        assert!(p.iter().zip(q).all(|(p, q)| (p - q).abs() < 1e-10 * (1.0 + p.abs())));
    }
}

const NOISE: f64 = 0.05;
const DRIVE: f64 = 0.1;
const MEAN: [f64; 2] = [0.0, 0.0];
const SPREAD: [f64; 2] = [1.0, 0.5];

/// A swing that begins at `angle`, measured through a sine; `outlier` is added to some measurements.
fn swinging(angle: f64, loss: impl Loss + 'static, outlier: f64) -> (Rig, Vec<[f64; 2]>, Vec<Option<f64>>) {
    let mut b = LayoutBuilder::new();
    let slots = ["angle", "rate"].map(|name| {
        let k = usize::from(name == "rate");
        declare::<Scalar>(&mut b, name, MEAN[k], &[SPREAD[k]], Dynamics::Process)
    });
    let process = Pendulum {
        angle: slots[0],
        rate: slots[1],
        sigma: DRIVE,
    };
    let (mut rig, mut random) = (Rig::new(b, process, vec![sensor(Sine(slots[0]), loss)]), Lcg::new(8));
    let (mut x, mut truth, mut all) = ([angle, 0.2], vec![[angle, 0.2]], Vec::new());
    rig.start(rig.filter.belief().clone());
    rig.estimate();
    for k in 1..=60 {
        x = swing(x);
        x[1] += DRIVE * random.signed();
        let time = Time::from_nanos(k * 100_000_000);
        rig.predict(time, &[]);
        let wrong = if k % 15 == 0 { outlier } else { 0.0 };
        let value = (k % 3 == 0).then(|| x[0].sin() + NOISE * random.signed() + wrong);
        value.iter().for_each(|value| rig.measure(0, *value, NOISE * NOISE));
        rig.estimate();
        truth.push(x);
        all.push(value);
    }
    (rig, truth, all)
}

/// The cost of a start and a noise for each step, in units of their σ, with the loss of Huber from `knee` σ on.
fn cost(unknown: &[f64], values: &[Option<f64>], knee: f64) -> f64 {
    let mut x = [MEAN[0] + SPREAD[0] * unknown[0], MEAN[1] + SPREAD[1] * unknown[1]];
    let mut sum: f64 = unknown.iter().map(|u| u * u).sum();
    for (w, value) in unknown[2..].iter().zip(values) {
        x = swing(x);
        x[1] += DRIVE * w;
        let r = value.map_or(0.0, |z| (z - x[0].sin()).abs() / NOISE);
        sum += if r <= knee { r * r } else { knee * (2.0 * r - knee) };
    }
    sum
}

/// The start and the noises of a trajectory, in units of their σ.
fn unknown(smoothed: &[Belief]) -> Vec<f64> {
    let start = (0..2).map(|k| (smoothed[0].x[k] - MEAN[k]) / SPREAD[k]);
    let noises = smoothed.windows(2).map(|pair| {
        let moved = swing([pair[0].x[0], pair[0].x[1]]);
        (pair[1].x[1] - moved[1]) / DRIVE
    });
    start.chain(noises).collect()
}

/// The largest derivative of the cost.
fn slope(unknown: &[f64], values: &[Option<f64>], knee: f64) -> f64 {
    let along = |k: usize| {
        let at = |h: f64| {
            let mut moved = unknown.to_vec();
            moved[k] += h;
            cost(&moved, values, knee)
        };
        (at(1e-5) - at(-1e-5)).abs() / 2e-5
    };
    (0..unknown.len()).map(along).fold(0.0, f64::max)
}

/// Asserts that the trajectory obeys the process, and that no change of it lowers the cost.
fn is_most_probable(smoothed: &[Belief], values: &[Option<f64>], knee: f64) {
    for pair in smoothed.windows(2) {
        let moved = swing([pair[0].x[0], pair[0].x[1]]);
        // 1e-9: the square of a last change of 1e-6 σ, and rounding.
        assert!((pair[1].x[0] - moved[0]).abs() < 1e-9);
    }
    let slope = slope(&unknown(smoothed), values, knee);
    // The information of an unknown, in units of its σ, is below 1e4: 1e-6 σ is a slope of 1e-2 at most.
    assert!(slope < 1e-2, "{slope}");
}

#[test]
fn the_iteration_ends_where_no_change_lowers_the_cost() {
    let (rig, _, values) = swinging(1.2, Quadratic, 0.0);
    let (once, again, how) = rig.smoothed();
    assert!(how.is_converged, "{how:?}");
    is_most_probable(&again, &values, f64::INFINITY);
    let at = |smoothed: &[Belief]| cost(&unknown(smoothed), &values, f64::INFINITY);
    // 1e-9: rounding of sums.
    assert!((how.cost - at(&again)).abs() < 1e-6 * how.cost, "{} {}", how.cost, at(&again));
    assert!(at(&once) > at(&again) + 1.0, "{} {}", at(&once), at(&again));
    assert!(
        slope(&unknown(&once), &values, f64::INFINITY) > 1.0,
        "the smoother alone is not there"
    );
}

#[test]
fn a_poor_start_is_found_where_one_linearisation_does_not_find_it() {
    let (rig, truth, values) = swinging(2.0, Quadratic, 0.0);
    let (once, again, how) = rig.smoothed();
    assert!(how.is_converged, "{how:?}");
    is_most_probable(&again, &values, f64::INFINITY);
    let worst = |smoothed: &[Belief]| {
        let errors = smoothed.iter().zip(&truth).map(|(b, x)| {
            let sigma = b.covariance.variance(0).sqrt();
            (b.x[0] - x[0]).abs() / sigma
        });
        errors.fold(0.0, f64::max)
    };
    // 4 σ: one of 61 correlated angles is beyond it with a probability of 0.4 % at most.
    assert!(worst(&again) < 4.0, "{}", worst(&again));
    assert!(worst(&once) > 10.0, "{}", worst(&once));
}

#[test]
fn a_robust_loss_is_weighed_at_the_smoothed_states() {
    let (rig, _, values) = swinging(0.8, Huber::new(1.5), 0.7);
    let (_, again, how) = rig.smoothed();
    assert!(how.is_converged, "{how:?}");
    is_most_probable(&again, &values, 1.5);
    assert!(slope(&unknown(&again), &values, f64::INFINITY) > 1.0, "the loss has an effect");
}

#[cfg(feature = "faer")]
#[test]
fn cholesky_factorisation_ends_at_the_same_estimates() {
    let logs: [fn() -> Rig; 3] = [
        || swinging(1.2, Quadratic, 0.0).0,
        || swinging(2.0, Quadratic, 0.0).0,
        || swinging(0.8, Huber::new(1.5), 0.7).0,
    ];
    for log in logs {
        let (_, iterated, _) = log().smoothed();
        let (batch, how) = log().batch();
        assert!(how.is_converged, "{how:?}");
        for (a, b) in iterated.iter().zip(&batch) {
            for k in 0..2 {
                let sigma = a.covariance.variance(k).sqrt();
                // Each is within 1e-6 σ of the optimum.
                assert!((a.x[k] - b.x[k]).abs() < 2e-6 * sigma, "{:?} {:?}", a.x, b.x);
            }
        }
    }
}
