//! Calibrations under a sensor whose errors are not those that it declares.

use super::*;

/// One scalar that moves and one calibration, both measured together as their sum and the first alone.
fn setup(form: FormKind) -> (Filter, Sum) {
    let mut b = LayoutBuilder::new();
    let walk = Dynamics::RandomWalk { psd: vec![0.01] };
    let motion = declare::<Scalar>(&mut b, "motion", 0.0, &[1.0], walk);
    let offset = declare_as::<Scalar>(&mut b, "offset", StateRole::Calibration, 0.0, &[3.0], Dynamics::Process);
    let backend = Backend {
        form,
        protection: true,
        ..Backend::default()
    };
    let filter = Filter::new(Arc::new(b.finish()), Arc::new(Still), backend, Size::same(2));
    (filter, Sum(motion, offset))
}

/// z = (motion, motion + offset).
#[derive(Debug)]
struct Sum(Slot<Scalar>, Slot<Scalar>);

impl Measurement for Sum {
    fn size(&self) -> Size {
        Size::same(2)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.state(self.0);
        value[1] = at.state(self.0) + at.state(self.1);
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add_slot(0, self.0, &SMatrix::<f64, 2, 1>::new(1.0, 1.0));
        h.add_slot(0, self.1, &SMatrix::<f64, 2, 1>::new(0.0, 1.0));
        Ok(())
    }
}

/// Mean square of the error of the offset over its 1σ, and the mean of that 1σ, over 200 seeds of 150 measurements
/// with errors of 1σ `size`; 1 is declared.
fn offset_of(size: f64) -> (f64, f64) {
    let (mut squares, mut sigmas) = (0.0, 0.0);
    let seeds = 200;
    for seed in 0..seeds {
        let mut random = Lcg::new(seed);
        let (mut filter, model) = setup(FormKind::Joseph);
        let offset = 3.0 * random.normal();
        let mut motion = random.normal();
        for k in 1..=150 {
            motion += 0.1 * random.normal();
            filter.predict(Time::from_seconds(f64::from(k)), &Input::held(&[])).unwrap();
            let value = [motion + size * random.normal(), motion + offset + size * random.normal()];
            accept(&mut filter, &model, &value, &[1.0, 0.0, 0.0, 1.0]);
        }
        let (x, sigma) = (filter.belief().x[1], filter.belief().covariance.marginal_at::<1>(1).x.sqrt());
        squares += ((x - offset) / sigma).powi(2);
        sigmas += sigma;
    }
    (squares / seeds as f64, sigmas / seeds as f64)
}

#[test]
fn an_offset_is_as_certain_as_errors_that_are_larger_than_declared_allow() {
    let (square, alone) = offset_of(1.0);
    // 200 squares have a mean of 1 ± 0.1.
    assert!((0.7..1.3).contains(&square), "as declared: {square}");
    for size in [2.0, 3.0, 5.0] {
        // Without protection it is size². Until the excess is beyond chance, the first ones of 150 count in full.
        let (square, sigma) = offset_of(size);
        assert!((0.3..0.5 * size * size).contains(&square), "{size} × σ: {square}");
        assert!(sigma > 0.6 * size * alone, "{size} × σ: {sigma}, as declared {alone}");
    }
}

#[test]
fn the_motion_gets_the_whole_correction_and_every_form_the_same_covariance() {
    let of = |form| {
        let (mut filter, model) = setup(form);
        let before = dense(&filter);
        // 2.25 times the declared variance.
        (0..50).for_each(|_| filter.protection.hear(0, 4.5, 2));
        accept(&mut filter, &model, &[1.0, 2.0], &[1.0, 0.0, 0.0, 1.0]);
        let share = filter.protection.share(0);
        (before, share, filter.belief().x.clone(), dense(&filter))
    };
    for form in [FormKind::Joseph, FormKind::Standard, FormKind::Udu, FormKind::SquareRoot] {
        let (before, share, x, after) = of(form);
        let h = nalgebra::Matrix2::new(1.0, 0.0, 1.0, 1.0);
        let p = before.fixed_view::<2, 2>(0, 0).into_owned();
        let s = h * p * h.transpose() + nalgebra::Matrix2::identity();
        let k = p * h.transpose() * s.try_inverse().unwrap();
        let taken = k * s * k.transpose();
        let correction = k * nalgebra::Vector2::new(1.0, 2.0);
        let expected = p - taken + nalgebra::Matrix2::new(0.0, 0.0, 0.0, (1.0 - share) * taken[(1, 1)]);
        // 1e-12: rounding of numbers of at most ten.
        assert!(
            (after - DMatrix::from_column_slice(2, 2, expected.as_slice())).amax() < 1e-12,
            "{form:?}"
        );
        assert!(
            (x[0] - correction.x).abs() < 1e-12 && (x[1] - share * correction.y).abs() < 1e-12,
            "{form:?}"
        );
        assert!((0.1..0.9).contains(&share), "{share}");
    }
}
