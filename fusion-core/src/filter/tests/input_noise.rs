//! The noise of the process input, and of the motion, in a residual and in its derivative.

use super::*;
use crate::model::{Exact, ExactModel, ExactView, Real, SignalsOut};
use crate::state::{Quantity, Signal};

/// A body whose acceleration and rate of turn are measured; its noise of velocity, declared \[m²/s³\].
#[derive(Debug)]
struct Driven {
    speed: Slot<Scalar>,
    rate: Signal<Scalar>,
    psd: f64,
}

impl Process for Driven {
    fn input_dim(&self) -> usize {
        2
    }
    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let speed = self.speed.read(x) + input.sample[0] * dt;
        self.speed.write(&speed, x);
    }
    fn linearise(&self, _: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
        out.noise(self.speed, self.speed, &Matrix1::new(self.psd * dt));
    }
    fn signals(&self, _: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        out.set(self.rate, &input.sample[1]);
    }
}

/// z = c (u + w).
#[derive(Debug)]
struct Product {
    factor: Quantity<Scalar>,
    speed: Quantity<Scalar>,
    rate: Quantity<Scalar>,
}

impl ExactModel for Product {
    fn dim(&self) -> usize {
        1
    }
    fn h<D: Real>(&self, x: &ExactView<'_, D>, z: &mut [D]) -> Result<(), Undefined> {
        z[0] = x.scalar(&self.factor) * (x.scalar(&self.speed) + x.scalar(&self.rate));
        Ok(())
    }
}

/// The filter of a speed, and of a factor that begins at 1.03 ± 0.03.
fn product(speed_sigma: f64, psd: f64) -> (Filter, Slot<Scalar>, Slot<Scalar>, Exact<Product>) {
    let mut b = LayoutBuilder::new();
    let speed = declare::<Scalar>(&mut b, "speed", 0.0, &[speed_sigma], Dynamics::Process);
    let factor = declare_as::<Scalar>(&mut b, "factor", StateRole::Calibration, 1.03, &[0.03], Dynamics::Constant);
    let rate = b.signal::<Scalar>("rate").unwrap();
    let model = Exact(Product {
        factor: factor.into(),
        speed: speed.into(),
        rate: Quantity::Signal(rate),
    });
    (filter(b, Driven { speed, rate, psd }, 1), speed, factor, model)
}

/// Uses z of variance `noise`, with derivatives under `smooth`, if any.
fn use_it(f: &mut Filter, model: &dyn Measurement, z: f64, noise: f64, smooth: Option<&[f64]>) {
    let observed = Observed {
        sensor: 0,
        model,
        value: &[z],
        noise: &[noise],
        quality: None,
        derivative_input: smooth.map(Input::held),
        lateness: None,
    };
    f.update(&observed, &mut Open, &[], &Quadratic);
}

/// By how many of its 1σ the factor, which is 1, is found too large.
fn error(f: &Filter, factor: Slot<Scalar>) -> f64 {
    (factor.read(&f.belief().x) - 1.0) / dense(f)[(factor.tangent, factor.tangent)].sqrt()
}

/// The factor of a rate that is measured with noise, after 20000 samples of a tenth of a second.
fn by_rate(is_smooth: bool) -> f64 {
    let (mut f, _, factor, model) = product(0.0, 0.0);
    let mut random = Lcg::new(7);
    for k in 1..=20_000 {
        let rate = 0.3 * (0.01 * k as f64).sin();
        let (sample, smooth) = ([0.0, rate + 0.1 * random.normal()], [0.0, rate]);
        f.predict(Time::from_nanos(k * 100_000_000), &Input::held(&sample)).unwrap();
        let z = rate + 0.05 * random.normal();
        use_it(&mut f, &model, z, 0.0025 + 0.01, is_smooth.then_some(&smooth));
    }
    error(&f, factor)
}

/// The factor of a speed that is 0.3 for 30 s of every 300 s and nearly 0 else. The noise of the acceleration is
/// declared ten times what it is, so that each innovation is partly what the one before left too little of.
fn by_speed(is_smooth: bool) -> f64 {
    const WALK: f64 = 3e-3;
    let (mut f, speed, factor, model) = product(0.01, 100.0 * WALK * WALK);
    let (mut random, mut truth, smooth) = (Lcg::new(5), 0.0, [0.0; 2]);
    for k in 1..=20_000 {
        let acceleration = 0.5 * (if k % 3000 < 300 { 0.3 } else { 0.0 } - truth);
        let sample = [acceleration + WALK / 0.1_f64.sqrt() * random.normal(), 0.0];
        truth += acceleration * 0.1;
        f.predict(Time::from_nanos(k * 100_000_000), &Input::held(&sample)).unwrap();
        if k % 10 == 0 {
            accept(&mut f, &Direct(speed), &[truth + 0.1 * random.normal()], &[0.01]);
        }
        let z = truth + 0.02 * random.normal();
        use_it(&mut f, &model, z, 0.0004, is_smooth.then_some(&smooth));
    }
    error(&f, factor)
}

#[test]
fn noise_of_the_input_does_not_pull_what_multiplies_it() {
    // Attenuation by 0.01 / (0.045 + 0.01), where the noise of the rate is in the derivative too.
    let raw = by_rate(false);
    assert!(raw < -20.0, "{raw}");
    let smooth = by_rate(true);
    // 3σ.
    assert!(smooth.abs() < 3.0, "{smooth}");
}

#[test]
fn noises_that_are_declared_too_large_do_not_pull_what_multiplies_the_motion() {
    let now = by_speed(false);
    assert!(now < -10.0, "{now}");
    let earlier = by_speed(true);
    // 3σ.
    assert!(earlier.abs() < 3.0, "{earlier}");
}

#[test]
fn the_prediction_is_that_of_the_sample_in_force() {
    let (mut f, speed, factor, model) = product(1.0, 0.0);
    f.keep_steps(true);
    f.predict(second(1), &Input::held(&[2.0, 0.5])).unwrap();
    let observed = Observed {
        sensor: 0,
        model: &model,
        value: &[8.0],
        noise: &[1e12],
        quality: None,
        derivative_input: Some(Input::held(&[0.0, 0.25])),
        lateness: None,
    };
    let update = f.update(&observed, &mut Open, &[], &Quadratic);
    // 1.03 (2 + ½) and 8 less that, each rounded.
    assert!((update.predicted[0] - 2.575).abs() < 1e-14 && (update.residual[0] - 5.425).abs() < 1e-14);
    let Some(Step::Corrected { jacobian, .. }) = f.steps().last() else {
        panic!("{:?}", f.steps())
    };
    // ∂h/∂u = c, and ∂h/∂c = u + w at the rate of the derivatives and at the earlier speed, 0: 2 is within its 3.3σ.
    assert!((jacobian.get(0, speed.tangent) - 1.03).abs() < 1e-14);
    assert!((jacobian.get(0, factor.tangent) - 0.25).abs() < 1e-14);
}
