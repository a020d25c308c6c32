//! Re-acquisition: which variances grow, by how much, and which stay as they were.

use super::*;
use crate::gate::Outcome;
use crate::state::Position;

/// A gate that believes every measurement against the estimate.
#[derive(Clone, Debug)]
struct Credulous;
crate::memory!(Credulous {});

impl Gate for Credulous {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        Answer {
            decision: Decision::Reacquire,
            statistic: input.nis,
            threshold: 0.0,
            mode: Mode::Track,
        }
    }
    fn power(&self, _: &GateInput<'_>, _: &mut [f64]) {}
}

#[test]
fn the_motion_grows_until_the_residual_is_expected() {
    let (mut f, x) = four(FormKind::Joseph);
    let h = SMatrix::<f64, 2, 4>::new(1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.3);
    let model = Linear { x: Param::State(x), h };
    let (value, noise) = ([40.0, -30.0], [0.4, 0.1, 0.1, 0.6]);
    let observed = Observed {
        sensor: 0,
        model: &model,
        value: &value,
        noise: &noise,
        quality: None,
        derivative_input: None,
        lateness: None,
    };
    f.keep_steps(true);
    let update = f.update(&observed, &mut Credulous, &[], &Quadratic);
    let (verdict, r) = (update.verdict, nalgebra::DVector::from_column_slice(update.residual));
    let [Step::Inflated { prior, posterior }, Step::Corrected { .. }] = f.steps() else {
        panic!("{:?}", f.steps());
    };
    let whole = |belief: &Belief| DMatrix::from_row_slice(4, 4, &belief.covariance.to_dense());
    let (before, grown, full) = (whole(prior), whole(posterior), DMatrix::from_fn(2, 4, |i, j| h[(i, j)]));
    let of_growth = |growth: f64| &before + DMatrix::from_diagonal(&before.diagonal()) * (growth - 1.0);
    let nis = |growth: f64| {
        let s = &full * of_growth(growth) * full.transpose() + DMatrix::from_row_slice(2, 2, &noise);
        r.dot(&s.cholesky().unwrap().solve(&r))
    };
    let growth = grown[(0, 0)] / before[(0, 0)];
    assert!(nis(growth) <= 2.0 && nis(0.5 * growth) > 2.0, "{growth}");
    assert!((grown - of_growth(growth)).amax() < 1e-9); // rounding of 1e3
    // The state goes most of the way to the measurement.
    let left = nalgebra::Vector2::from(value) - h * x.read(&f.belief().x);
    assert_eq!(verdict, Verdict::Reacquired);
    // HPHᵀ in the direction of r has grown to rᵀr; of r a share of R/(rᵀr + R) is left.
    assert!(left.norm() < 0.05, "{left}");
}

#[test]
fn reacquiring_bears_rows_that_depend_on_each_other_and_refuses_what_no_growth_explains() {
    let (mut f, x) = four(FormKind::Joseph);
    // The third row is the sum of the others: HPHᵀ has rank two.
    let h = SMatrix::<f64, 3, 4>::new(1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.3, 1.0, 1.0, 0.5, 0.3);
    let model = Linear { x: Param::State(x), h };
    let noise = [0.4, 0.0, 0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 0.5];
    let reacquired = |f: &mut Filter, value: &[f64]| {
        let observed = Observed {
            sensor: 0,
            model: &model,
            value,
            noise: &noise,
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        f.update(&observed, &mut Credulous, &[], &Quadratic).verdict
    };
    let before = dense(&f);
    assert_eq!(reacquired(&mut f, &[40.0, -30.0, 1e3]), Verdict::Unusable);
    assert_eq!(dense(&f), before);
    assert_eq!(reacquired(&mut f, &[40.0, -30.0, 10.0]), Verdict::Reacquired);
    let left = nalgebra::Vector3::new(40.0, -30.0, 10.0) - h * x.read(&f.belief().x);
    assert!(left.norm() < 0.5, "{left}"); // R over the grown HPHᵀ is a hundredth
}

#[test]
fn reacquiring_what_cannot_be_used_leaves_the_belief_as_it_was() {
    let (mut f, x) = four(FormKind::Joseph);
    let (before, p) = (f.belief().x.clone(), dense(&f));
    let blind = SMatrix::<f64, 1, 4>::zeros();
    let seeing = SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0);
    // The square of the second residual overflows once P has grown by it.
    for (h, value) in [(blind, 1.0), (seeing, 1e200)] {
        let model = Linear { x: Param::State(x), h };
        let observed = Observed {
            sensor: 0,
            model: &model,
            value: &[value],
            noise: &[0.1],
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        assert_eq!(f.update(&observed, &mut Credulous, &[], &Quadratic).verdict, Verdict::Unusable);
        assert!(unchanged(&f, &before, &p), "{value}");
    }
}

/// A position, a velocity and the heading of the motion, a bias that is estimated; all correlated
/// by a measurement of a mixture.
fn motion_and_bias() -> (Filter, [Slot<Scalar>; 3], Slot<crate::state::Angle>) {
    let mut b = LayoutBuilder::new();
    let still = Dynamics::Constant;
    let position = declare::<Scalar>(&mut b, "position", 0.0, &[1.0], still.clone());
    let velocity = declare::<Scalar>(&mut b, "velocity", 0.0, &[0.1], still.clone());
    let heading = declare::<crate::state::Angle>(&mut b, "heading", 0.0, &[0.01], still.clone());
    let bias = declare_as::<Scalar>(&mut b, "bias", StateRole::Calibration, 0.0, &[0.5], still);
    let mut f = filter(b, Still, 1);
    let mixture = Mixture {
        of: [position, velocity, bias],
        weights: [1.0, 1.0, 1.0],
        heading,
    };
    accept(&mut f, &mixture, &[0.0], &[0.01]);
    // As if that had been known for long.
    let known = f.belief().clone();
    f.set_belief(known);
    (f, [position, velocity, bias], heading)
}

/// A weighted sum of three scalars, and a heading.
#[derive(Debug)]
struct Mixture {
    of: [Slot<Scalar>; 3],
    weights: [f64; 3],
    heading: Slot<crate::state::Angle>,
}

impl Measurement for Mixture {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let sum: f64 = self.of.iter().zip(self.weights).map(|(s, w)| w * at.state(*s)).sum();
        value[0] = sum + at.state(self.heading);
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        for (slot, weight) in self.of.iter().zip(self.weights) {
            h.add_slot(0, *slot, &Matrix1::new(weight));
        }
        h.add_slot(0, self.heading, &Matrix1::new(1.0));
        Ok(())
    }
}

fn reacquire(f: &mut Filter, model: &dyn Measurement, value: f64) -> Verdict {
    let observed = Observed {
        sensor: 0,
        model,
        value: &[value],
        noise: &[0.01],
        quality: None,
        derivative_input: None,
        lateness: None,
    };
    f.update(&observed, &mut Credulous, &[], &Quadratic).verdict
}

#[test]
fn a_bias_is_moved_by_less_than_its_sigma_and_the_motion_alone_grows() {
    for value in [10.0, 1e3, 1e5] {
        let (mut f, [position, _, bias], _) = motion_and_bias();
        let sigma = dense(&f)[(3, 3)].sqrt();
        f.keep_steps(true);
        assert_eq!(reacquire(&mut f, &Direct(position), value), Verdict::Reacquired);
        let [Step::Inflated { prior, posterior }, Step::Corrected { .. }] = f.steps() else {
            panic!("{:?}", f.steps());
        };
        let [before, grown] = [prior, posterior].map(|b| DMatrix::from_row_slice(4, 4, &b.covariance.to_dense()));
        // The variance of the bias, and every covariance, stays; the motion grows by one factor.
        for (i, j) in [(3, 3), (0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            assert_eq!(before[(i, j)], grown[(i, j)]);
        }
        let growth = [0, 1].map(|i| grown[(i, i)] / before[(i, i)]);
        assert!((growth[0] / growth[1] - 1.0).abs() < 1e-12 && growth[0] > 40.0, "{growth:?}"); // rounding
        // A heading by no more than to a tenth of a radian; 1e-15: rounding.
        let heading = grown[(2, 2)].sqrt();
        assert!(heading <= 0.1 + 1e-15 && (value < 1e3 || heading > 0.0999), "{heading}");
        assert!((position.read(&f.belief().x) - value).abs() < 0.1); // R = (0.1)² is small compared with the grown P
        let moved = bias.read(&f.belief().x).abs();
        assert!(moved > 0.0 && moved < sigma, "{moved} of {sigma}");
    }
}

/// The effect of the next re-acquisition on the variance of the bias: before, after its growth.
fn growth_of_bias(f: &mut Filter, position: Slot<Scalar>) -> [f64; 2] {
    f.keep_steps(true);
    assert_eq!(reacquire(f, &Direct(position), 1e3), Verdict::Reacquired);
    let [Step::Inflated { prior, posterior }, Step::Corrected { .. }] = f.steps() else {
        panic!("{:?}", f.steps());
    };
    [prior, posterior].map(|b| b.covariance.to_dense()[15])
}

#[test]
fn what_was_learnt_of_a_bias_lately_is_forgotten_and_a_pull_becomes_its_sigma() {
    for value in [0.1, 5.0] {
        let learnt = |others: &[Option<Outcome>]| {
            let (mut f, [position, _, bias], _) = motion_and_bias();
            let known = dense(&f)[(3, 3)];
            for (t, noise) in [(10, 1e-4), (40, 1e12), (70, 1e12)] {
                f.predict(second(t), &Input::held(&[])).unwrap();
                let observed = Observed {
                    sensor: 0,
                    model: &Direct(bias),
                    value: &[value],
                    noise: &[noise],
                    quality: None,
                    derivative_input: None,
                    lateness: None,
                };
                f.update(&observed, &mut Open, others, &Quadratic);
                if noise < 1.0 && others.is_empty() {
                    let pull = bias.read(&f.belief().x);
                    let [_, grown] = growth_of_bias(&mut f.clone(), position);
                    assert!((grown / known.max(pull * pull) - 1.0).abs() < 1e-12, "{grown} {known} {pull}");
                }
            }
            growth_of_bias(&mut f, position)
        };
        // Half a minute later it is known for long, unless a sensor has been contradicting since.
        let [before, grown] = learnt(&[]);
        assert!((grown / before - 1.0).abs() < 1e-9, "{before} {grown}"); // a measurement of σ 1e6 between
        let refused = Outcome {
            time: second(0),
            is_used: false,
            mode: Mode::Track,
        };
        let [before, grown] = learnt(&[None, Some(refused)]);
        assert!(grown > 100.0 * before, "{before} {grown}");
    }
}

#[test]
fn what_no_growth_of_the_motion_explains_grows_all_and_a_belief_that_cannot_stays() {
    let (mut f, [_, _, bias], _) = motion_and_bias();
    assert_eq!(reacquire(&mut f, &Direct(bias), 20.0), Verdict::Reacquired);
    assert!((bias.read(&f.belief().x) - 20.0).abs() < 0.1);
    let (mut f, ..) = motion_and_bias();
    let (before, p) = (f.belief().x.clone(), dense(&f));
    assert_eq!(reacquire(&mut f, &Direct(bias), 1e6), Verdict::Unusable);
    assert!(unchanged(&f, &before, &p));
}

#[test]
fn a_sensor_that_could_not_be_reacquired_is_offered_again_with_the_next_measurement() {
    let (mut f, [_, _, bias], _) = motion_and_bias();
    let mut gate = Nis::new(0.99, Recovery::default());
    let mut offer = |k: i64, value: f64| {
        f.predict(second(k), &Input::held(&[])).unwrap();
        let observed = Observed {
            sensor: 0,
            model: &Direct(bias),
            value: &[value],
            noise: &[1.0],
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        let update = f.update(&observed, &mut gate, &[], &Quadratic);
        (update.verdict, update.mode)
    };
    // A million sigma is beyond the largest growth of P; a hundred is not.
    let first = (1..100).find(|k| offer(*k, 1e6).0 == Verdict::Unusable).unwrap();
    assert_eq!(first, 31);
    assert_eq!(offer(32, 1e6), (Verdict::Unusable, Mode::Denied));
    let used = (33..60)
        .map(|k| offer(k, 100.0))
        .position(|(verdict, _)| verdict == Verdict::Reacquired);
    // As soon as five agree.
    assert_eq!(used, Some(4));
    assert_eq!(offer(60, 100.0), (Verdict::Accepted, Mode::Track));
}

/// Two axes of a position and a heading; a sensor of either.
fn place_and_heading() -> (Filter, Slot<Position>, Slot<crate::state::Angle>) {
    let mut b = LayoutBuilder::new();
    let still = Dynamics::Constant;
    let position = declare::<Position>(&mut b, "position", nalgebra::Vector3::zeros(), &[1.0, 1.0, 1.0], still.clone());
    let heading = declare::<crate::state::Angle>(&mut b, "heading", 0.0, &[0.01], still);
    (filter(b, Still, 2), position, heading)
}

/// The horizontal position.
#[derive(Debug)]
struct Fix(Slot<Position>);

impl Measurement for Fix {
    fn size(&self) -> Size {
        Size::same(2)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value.copy_from_slice(&at.state(self.0).as_slice()[..2]);
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add_slot(0, self.0, &nalgebra::Matrix3::identity());
        Ok(())
    }
}

/// The heading.
#[derive(Debug)]
struct Compass(Slot<crate::state::Angle>);

impl Measurement for Compass {
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

#[test]
fn a_heading_is_not_believed_against_an_estimate_that_fixes_agree_with() {
    let fix = |f: &mut Filter, position: Slot<Position>, gate: &mut dyn Gate, value: f64| {
        let observed = Observed {
            sensor: 0,
            model: &Fix(position),
            value: &[value, 0.0],
            noise: &[1.0, 0.0, 0.0, 1.0],
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        f.update(&observed, gate, &[], &Quadratic).verdict
    };
    let turn = |f: &mut Filter, heading| {
        let observed = Observed {
            sensor: 1,
            model: &Compass(heading),
            value: &[0.05],
            noise: &[1e-6],
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        f.update(&observed, &mut Credulous, &[], &Quadratic).verdict
    };
    let after = |fixes: i64, pause: i64, refused: bool| {
        let (mut f, position, heading) = place_and_heading();
        for k in 1..=fixes {
            f.predict(second(k), &Input::held(&[])).unwrap();
            assert_eq!(fix(&mut f, position, &mut Open, 0.0), Verdict::Accepted);
        }
        f.predict(second(fixes + pause), &Input::held(&[])).unwrap();
        if refused {
            let mut gate = Nis::new(0.99, Recovery::default());
            assert_eq!(fix(&mut f, position, &mut gate, 100.0), Verdict::Rejected);
        }
        let before = (f.belief().x.clone(), dense(&f));
        let verdict = turn(&mut f, heading);
        assert!(verdict == Verdict::Reacquired || unchanged(&f, &before.0, &before.1));
        verdict
    };
    assert_eq!(after(5, 1, false), Verdict::Rejected);
    assert_eq!(after(4, 1, false), Verdict::Reacquired, "too few");
    assert_eq!(after(5, 11, false), Verdict::Reacquired, "too long ago");
    assert_eq!(after(5, 1, true), Verdict::Reacquired, "the latest fix does not agree");
}

#[test]
fn what_a_sensor_does_not_see_does_not_grow_with_it() {
    let (mut f, [_, _, bias], _) = motion_and_bias();
    f.keep_steps(true);
    assert_eq!(reacquire(&mut f, &Direct(bias), 20.0), Verdict::Reacquired);
    let [Step::Inflated { prior, posterior }, ..] = f.steps() else {
        panic!("{:?}", f.steps());
    };
    let [before, grown] = [prior, posterior].map(|b| DMatrix::from_row_slice(4, 4, &b.covariance.to_dense()));
    for axis in 0..3 {
        assert_eq!(before[(axis, axis)], grown[(axis, axis)]);
    }
    assert!(grown[(3, 3)] > 40.0 * before[(3, 3)]);
    // Correlations are those that were there.
    let correlation = |p: &DMatrix<f64>| p[(0, 3)] / (p[(0, 0)] * p[(3, 3)]).sqrt();
    assert!((correlation(&before) - correlation(&grown)).abs() < 1e-12); // rounding
}
