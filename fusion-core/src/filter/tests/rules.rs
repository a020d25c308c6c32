//! The update rules compared with each other, and with the values that they approximate.

use super::*;
use crate::state::Quantity;
use crate::testing::check_update_rule;

/// The sets of sigma points that are tried: the default, a narrow one, one with a weight of the centre.
const SPREADS: [SigmaSpread; 3] = [
    SigmaSpread::DEFAULT,
    SigmaSpread {
        alpha: 0.01,
        beta: 2.0,
        kappa: 0.0,
    },
    SigmaSpread {
        alpha: 1.0,
        beta: 2.0,
        kappa: 3.0,
    },
];

fn iterated() -> Arc<dyn UpdateRule> {
    Arc::new(Iterated::DEFAULT)
}

fn unscented(spread: SigmaSpread) -> Arc<dyn UpdateRule> {
    Arc::new(Unscented(spread))
}

#[test]
fn every_rule_is_exact_for_a_linear_measurement() {
    check_update_rule(&(Arc::new(Single) as Arc<dyn UpdateRule>)).unwrap();
    check_update_rule(&iterated()).unwrap();
    for spread in SPREADS {
        check_update_rule(&unscented(spread)).unwrap();
    }
}

/// A function of two numbers, by formulas.
#[derive(Debug)]
struct Curve {
    x: Slot<Vector<2>>,
    value: fn(f64, f64) -> f64,
    slope: fn(f64, f64) -> [f64; 2],
}

impl Measurement for Curve {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let x = at.get(&Quantity::State(self.x));
        value[0] = (self.value)(x.x, x.y);
        Ok(())
    }
    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let x = at.get(&Quantity::State(self.x));
        let [a, b] = (self.slope)(x.x, x.y);
        h.add_slot(0, self.x, &SMatrix::<f64, 1, 2>::new(a, b));
        Ok(())
    }
}

fn two(update: Arc<dyn UpdateRule>, at: [f64; 2], sigma: [f64; 2]) -> (Filter, Slot<Vector<2>>) {
    let mut b = LayoutBuilder::new();
    let x = declare::<Vector<2>>(&mut b, "x", at.into(), &sigma, Dynamics::Constant);
    let parts = Parts {
        update,
        ..Parts::from(Backend::default())
    };
    (Filter::of(Arc::new(b.finish()), Arc::new(Still), parts, Size::same(1)), x)
}

/// The cost of the maximum a posteriori, from (x̂, σ) and z = h(x) with variance r.
fn cost(curve: &Curve, at: [f64; 2], sigma: [f64; 2], z: f64, r: f64, x: &[f64]) -> f64 {
    let prior: f64 = (0..2).map(|i| ((x[i] - at[i]) / sigma[i]).powi(2)).sum();
    prior + (z - (curve.value)(x[0], x[1])).powi(2) / r
}

#[test]
fn the_iterated_update_ends_at_the_maximum_a_posteriori() {
    // A beacon 20 m away, σ of 10 m across: the circle bends by metres within the σ. The single update
    // leaves it, the iterated one finds the point from which no step lowers the cost.
    let (at, sigma, z, r) = ([20.0, 6.0], [1.0, 10.0], 25.0, 0.01);
    let ended = |update: Arc<dyn UpdateRule>| {
        let (mut f, x) = two(update, at, sigma);
        let curve = Curve {
            x,
            value: f64::hypot,
            slope: |x, y| [x / x.hypot(y), y / x.hypot(y)],
        };
        let (value, noise) = ([z], [r]);
        let update = accept(&mut f, &curve, &value, &noise);
        assert!(
            (update.residual[0] - (z - 20_f64.hypot(6.0))).abs() < 1e-12,
            "the innovation is that of the prediction"
        );
        let x = f.belief().x.clone();
        let here = cost(&curve, at, sigma, z, r, &x);
        // 1e-3 of a σ: the tolerance of the iteration.
        let lower = (0..16).any(|k| {
            let (sin, cos) = (f64::from(k) * core::f64::consts::PI / 8.0).sin_cos();
            cost(&curve, at, sigma, z, r, &[x[0] + 0.01 * cos, x[1] + 0.1 * sin]) < here - 1e-3
        });
        (here, lower)
    };
    let (single, is_short) = ended(Arc::new(Single));
    let (least, is_short_of) = ended(iterated());
    assert!(is_short && !is_short_of && single > 100.0 * least, "{single} {least}");
}

#[test]
fn a_step_that_would_raise_the_cost_is_shortened() {
    // Gauss-Newton on atan(5x) leaps ever further: from x = 1.5 the first full step leads to −8, the next away.
    let (at, sigma, z, r) = ([1.5, 0.0], [100.0, 1.0], 0.0, 1e-4);
    let (mut f, x) = two(iterated(), at, sigma);
    let curve = Curve {
        x,
        value: |x, _| (5.0 * x).atan(),
        slope: |x, _| [5.0 / (1.0 + 25.0 * x * x), 0.0],
    };
    accept(&mut f, &curve, &[z], &[r]);
    // σ of x there is 0.01/5: a tenth of it.
    assert!(f.belief().x[0].abs() < 2e-4, "{:?}", f.belief().x);
}

#[test]
fn where_h_has_no_value_a_step_is_shortened_too() {
    #[derive(Debug)]
    struct Root(Slot<Vector<2>>);
    impl Measurement for Root {
        fn size(&self) -> Size {
            Size::same(1)
        }
        fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
            let x = at.get(&Quantity::State(self.0)).x;
            value[0] = x.sqrt();
            if x > 0.0 {
                Ok(())
            } else {
                Err(Undefined("a root of a negative number"))
            }
        }
        fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
            h.add_slot(
                0,
                self.0,
                &SMatrix::<f64, 1, 2>::new(0.5 / at.get(&Quantity::State(self.0)).x.sqrt(), 0.0),
            );
            Ok(())
        }
    }
    // From x = 4 to √x = 0.1 a full step leads to −3.6.
    let (mut f, x) = two(iterated(), [4.0, 0.0], [100.0, 1.0]);
    accept(&mut f, &Root(x), &[0.1], &[1e-6]);
    // σ of x there is 2·0.1·1e-3.
    assert!((f.belief().x[0] - 0.01).abs() < 2e-5, "{:?}", f.belief().x);
}

#[test]
fn sigma_points_see_mean_and_variance_of_a_square() {
    // z = x², x ~ N(2, 3): mean 4 + 3, variance 4·4·3 + 2·9 = 66; covariance with x 2·2·3.
    let mut b = LayoutBuilder::new();
    let x = declare::<Scalar>(&mut b, "x", 2.0, &[3_f64.sqrt()], Dynamics::Constant);
    let parts = Parts {
        update: unscented(SigmaSpread::DEFAULT),
        ..Parts::from(Backend::default())
    };
    #[derive(Debug)]
    struct Square(Slot<Scalar>);
    impl Measurement for Square {
        fn size(&self) -> Size {
            Size::same(1)
        }
        fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
            value[0] = at.get(&Quantity::State(self.0)).powi(2);
            Ok(())
        }
        fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
            h.add_slot(0, self.0, &Matrix1::new(2.0 * at.get(&Quantity::State(self.0))));
            Ok(())
        }
    }
    let mut f = Filter::of(Arc::new(b.finish()), Arc::new(Still), parts, Size::same(1));
    f.keep_steps(true);
    let (square, value, noise) = (Square(x), [9.0], [1.0]);
    let update = accept(&mut f, &square, &value, &noise);
    // 1e-12: rounding.
    let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-12 * wanted.abs(), "{found} {wanted}");
    near(update.predicted[0], 7.0);
    near(update.innovation_sigma[0].powi(2), 67.0);
    near(f.belief().x[0], 2.0 + 12.0 / 67.0 * 2.0);
    near(dense(&f)[(0, 0)], 3.0 - 144.0 / 67.0);
    let Step::Corrected {
        jacobian, noise, residual, ..
    } = &f.steps()[0]
    else {
        panic!("{:?}", f.steps())
    };
    // The linear measurement that does the same: H = 12/3, R = 1 + 2·9.
    near(jacobian.get(0, 0), 4.0);
    near(noise[0], 19.0);
    near(residual[0], 2.0);
}

/// A track with two additional states, a walk and a Gauss-Markov state; a correlated belief.
fn tracked(parts: Parts) -> (Filter, Slot<Scalar>) {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 1.0, &[2.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", -3.0, &[1.0], Dynamics::Process);
    declare::<Scalar>(&mut b, "walk", 0.5, &[0.1], Dynamics::RandomWalk { psd: vec![0.3] });
    let tau = 4.0;
    declare::<Scalar>(&mut b, "markov", 0.7, &[0.2], Dynamics::GaussMarkov { sigma: vec![0.4], tau });
    let track = Track {
        position,
        velocity,
        sigma: 0.5,
    };
    let mut f = Filter::of(Arc::new(b.finish()), Arc::new(track), parts, Size::same(1));
    f.keep_steps(true);
    (f, position)
}

#[test]
fn sigma_points_predict_a_linear_process_as_its_transition_does() {
    for spread in SPREADS {
        let run = |update: Arc<dyn UpdateRule>| {
            let (mut f, position) = tracked(Parts {
                update,
                ..Parts::from(Backend::default())
            });
            let mut steps = Vec::new();
            for k in 1..20 {
                f.predict(Time::from_seconds(f64::from(k) * 0.5), &Input::held(&[0.2])).unwrap();
                steps.extend(f.steps().to_vec());
                accept(&mut f, &Direct(position), &[f64::from(k)], &[0.3]);
            }
            (f.belief().x.clone(), dense(&f), steps)
        };
        let ((x, p, steps), (wanted, q, linear)) = (run(unscented(spread)), run(Arc::new(Single)));
        // 1e-9: rounding over 20 steps, divided by α of 0.01 and its square.
        assert!(x.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{x:?} {wanted:?}");
        assert!((&p - &q).amax() < 1e-9, "{p} {q}");
        for (found, wanted) in steps.iter().zip(&linear) {
            let (Step::Predicted { transition, .. }, Step::Predicted { transition: by, .. }) = (found, wanted) else {
                panic!("{found:?}")
            };
            let pairs = (0..16).map(|k| (transition.phi.get(k / 4, k % 4) - by.phi.get(k / 4, k % 4)).abs());
            assert!(pairs.fold(0.0, f64::max) < 1e-9, "Φ of the step");
        }
    }
}

#[test]
fn an_axis_that_is_known_exactly_has_no_sigma_points_and_does_no_harm() {
    let (mut f, x) = two(unscented(SigmaSpread::DEFAULT), [2.0, 1.0], [1.0, 0.0]);
    let curve = Curve {
        x,
        value: |x, y| x + 5.0 * y,
        slope: |_, _| [1.0, 5.0],
    };
    f.predict(Time::from_seconds(1.0), &Input::held(&[])).unwrap();
    accept(&mut f, &curve, &[8.0], &[1.0]);
    assert!((f.belief().x[0] - 2.5).abs() < 1e-14 && f.belief().x[1] == 1.0);
}

#[test]
fn a_belief_that_grew_before_a_measurement_was_believed_has_new_sigma_points() {
    #[derive(Clone, Debug)]
    struct Believe;
    crate::memory!(Believe {});
    impl Gate for Believe {
        fn judge(&mut self, _: &GateInput<'_>) -> Answer {
            Answer {
                decision: Decision::Reacquire,
                statistic: 0.0,
                threshold: 0.0,
                mode: Mode::Denied,
            }
        }
        fn power(&self, _: &GateInput<'_>, _: &mut [f64]) {}
    }
    let ended = |update: Arc<dyn UpdateRule>| {
        let (mut f, x) = two(update, [0.0, 0.0], [0.1, 0.1]);
        let curve = Curve {
            x,
            value: |x, _| x,
            slope: |_, _| [1.0, 0.0],
        };
        let observed = Observed {
            sensor: 0,
            model: &curve,
            value: &[100.0],
            noise: &[1.0],
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        assert_eq!(f.update(&observed, &mut Believe, &[], &Quadratic).verdict, Verdict::Reacquired);
        (f.belief().x[0], dense(&f)[(0, 0)])
    };
    let (found, wanted) = (ended(unscented(SigmaSpread::DEFAULT)), ended(Arc::new(Single)));
    // 1e-9 of 100 m: rounding.
    assert!(
        (found.0 - wanted.0).abs() < 1e-7 && (found.1 - wanted.1).abs() < 1e-9,
        "{found:?} {wanted:?}"
    );
    assert!(wanted.0 > 90.0);
}

/// A process that throws the position out of the world.
#[derive(Debug)]
struct Thrown(Slot<crate::state::Position>);

impl Process for Thrown {
    fn input_dim(&self) -> usize {
        0
    }
    fn propagate(&self, x: &mut [f64], _: &Input<'_>, _: f64) {
        self.0.write(&nalgebra::Vector3::repeat(1e12), x);
    }
    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, out: &mut Transition) {
        out.noise(self.0, self.0, &nalgebra::Matrix3::identity());
    }
}

#[test]
fn a_prediction_out_of_the_world_changes_nothing_with_sigma_points_either() {
    for update in [unscented(SigmaSpread::DEFAULT), Arc::new(Single) as Arc<dyn UpdateRule>] {
        let mut b = LayoutBuilder::new();
        let position = declare::<crate::state::Position>(&mut b, "position", nalgebra::Vector3::zeros(), &[1.0; 3], Dynamics::Process);
        let parts = Parts {
            update,
            ..Parts::from(Backend::default())
        };
        let mut f = Filter::of(Arc::new(b.finish()), Arc::new(Thrown(position)), parts, Size::same(1));
        let (before, p) = (f.belief().x.clone(), dense(&f));
        assert!(f.predict(Time::from_seconds(1.0), &Input::held(&[])).is_err());
        assert!(unchanged(&f, &before, &p) && f.belief().time == Time::default());
    }
}
