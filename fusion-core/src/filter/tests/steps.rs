//! Copies and kept steps.

use super::*;

/// An input-driven track with a measurement now and then; `steps` of it from number `from`.
fn drive(f: &mut dyn Estimator, slots: (Slot<Scalar>, Slot<Scalar>), numbers: core::ops::Range<i64>) {
    let mut gate = Nis::new(0.99, Recovery::default());
    for k in numbers {
        let mut r = Lcg::new(k as u64);
        f.predict(second(k), &Input::held(&[r.signed()])).unwrap();
        let model = Direct(if k % 2 == 0 { slots.0 } else { slots.1 });
        let (value, noise) = ([r.signed()], [0.5]);
        let observed = Observed {
            sensor: 0,
            model: &model,
            value: &value,
            noise: &noise,
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        f.update(&observed, &mut gate, &[], &Quadratic);
    }
}

fn tracked() -> (Filter, (Slot<Scalar>, Slot<Scalar>)) {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 0.0, &[100.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 0.0, &[10.0], Dynamics::Process);
    let sigma = 0.1;
    let process = Track { position, velocity, sigma };
    (filter(b, process, 1), (position, velocity))
}

#[test]
fn a_filter_with_the_memory_of_another_continues_bit_for_bit() {
    let (mut f, slots) = tracked();
    drive(&mut f, slots, 1..20);
    let (mut twin, _) = tracked();
    crate::testing::check_memory(&mut f, &mut twin).unwrap();
    drive(&mut f, slots, 20..40);
    drive(&mut twin, slots, 20..40);
    assert_eq!(
        (&f.belief().x, &f.belief().covariance),
        (&twin.belief().x, &twin.belief().covariance)
    );
}

#[test]
fn kept_steps_lead_from_belief_to_belief() {
    let (mut f, slots) = tracked();
    let (mut unheard, _) = tracked();
    f.keep_steps(true);
    drive(&mut unheard, slots, 1..30);
    let mut last = f.belief().clone();
    for k in 1..30 {
        f.predict(second(k), &Input::held(&[Lcg::new(k as u64).signed()])).unwrap();
        let [
            Step::Predicted {
                prior,
                transition,
                posterior,
                ..
            },
        ] = f.steps()
        else {
            panic!("{:?}", f.steps())
        };
        assert_eq!((prior.time, &prior.covariance), (last.time, &last.covariance));
        let phi = DMatrix::from_fn(2, 2, |i, j| transition.phi.get(i, j));
        let q = |noise: Vec<(usize, usize, f64)>| {
            let mut q = DMatrix::zeros(2, 2);
            noise.into_iter().for_each(|(i, j, v)| q[(i, j)] += v);
            q
        };
        let dense = |b: &Belief| DMatrix::from_row_slice(2, 2, &b.covariance.to_dense());
        let (before, after) = (q(transition.noise_before().collect()), q(transition.noise_after().collect()));
        let wanted = &phi * (dense(prior) + before) * phi.transpose() + after;
        // 1e-12: rounding of products of up to 1e4.
        assert!((dense(posterior) - &wanted).amax() < 1e-12 * wanted.amax());
        assert_eq!(posterior.time, second(k));
        let predicted = posterior.clone();
        let model = Direct(if k % 2 == 0 { slots.0 } else { slots.1 });
        let mut r = Lcg::new(k as u64);
        let value = [(r.signed(), r.signed()).1];
        let update = accept(&mut f, &model, &value, &[0.5]);
        assert_eq!(update.verdict, Verdict::Accepted);
        let [
            Step::Corrected {
                prior,
                jacobian,
                noise,
                residual,
                innovation,
                gain: kept,
                correction,
                reset: None,
                posterior,
                ..
            },
        ] = f.steps()
        else {
            panic!("{:?}", f.steps())
        };
        assert_eq!((&prior.x, &prior.covariance), (&predicted.x, &predicted.covariance));
        let h = DMatrix::from_fn(1, 2, |_, j| jacobian.get(0, j));
        let s = (&h * dense(prior) * h.transpose())[0] + noise[0];
        let gain = dense(prior) * h.transpose() / s;
        // The same arithmetic.
        assert!((innovation[0] - s).abs() < 1e-14 * s);
        for i in 0..2 {
            assert!((kept[i] - gain[i]).abs() < 1e-14);
            // Rounding of the gain.
            assert!((correction[i] - gain[i] * residual[0]).abs() < 1e-14 * (1.0 + correction[i].abs()));
            assert!((posterior.x[i] - prior.x[i] - correction[i]).abs() < 1e-14 * (1.0 + posterior.x[i].abs()));
        }
        last = posterior.clone();
    }
    f.keep_steps(false);
    f.predict(second(40), &Input::held(&[0.0])).unwrap();
    assert!(f.steps().is_empty() && unheard.steps().is_empty());
}

/// Stands still, in steps of 0.3 s at most.
#[derive(Debug)]
struct Slow;

impl Process for Slow {
    fn input_dim(&self) -> usize {
        0
    }
    fn max_step(&self) -> f64 {
        0.3
    }
    fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}
}

#[test]
fn a_prediction_longer_than_the_longest_step_is_made_in_equal_pieces() {
    let mut b = LayoutBuilder::new();
    declare::<Scalar>(&mut b, "still", 0.0, &[1.0], Dynamics::RandomWalk { psd: vec![1.0] });
    let mut f = filter(b, Slow, 1);
    f.keep_steps(true);
    for ends in [&[250, 500, 750, 1000][..], &[1250], &[1525, 1800]] {
        let ends: Vec<_> = ends.iter().map(|ms| Time::from_nanos(ms * 1_000_000)).collect();
        f.predict(ends[ends.len() - 1], &Input::held(&[])).unwrap();
        let found = f.steps().iter().map(|step| match step {
            Step::Predicted { posterior, .. } => posterior.time,
            other => panic!("{other:?}"),
        });
        assert_eq!(found.collect::<Vec<_>>(), ends);
    }
}

#[test]
fn a_weight_makes_the_noise_of_every_row_larger() {
    let run = |loss: &dyn crate::loss::Loss, noise: f64| {
        let mut b = LayoutBuilder::new();
        let x = declare::<Vector<3>>(&mut b, "x", SVector::zeros(), &[1.0; 3], Dynamics::Constant);
        let mut f = filter(b, Still, 3);
        let model = Linear {
            x: Param::State(x),
            h: SMatrix::<f64, 3, 3>::identity(),
        };
        let (value, r) = ([5.0, -7.0, 9.0], DMatrix::from_diagonal_element(3, 3, noise));
        let observed = Observed {
            sensor: 0,
            model: &model,
            value: &value,
            noise: r.as_slice(),
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        let weight = f.update(&observed, &mut Open, &[], loss).weight;
        (weight, f.belief().clone())
    };
    let (weight, robust) = run(&Huber::new(1.345), 1.0);
    assert!(weight < 0.5, "{weight}");
    let (_, weaker) = run(&Quadratic, 1.0 / weight);
    for (a, b) in robust.x.iter().zip(&weaker.x) {
        // 1e-15 of 9: the same arithmetic on the same noise.
        assert!((a - b).abs() < 1e-14, "{:?} {:?}", robust.x, weaker.x);
    }
}
