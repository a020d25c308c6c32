//! A measurement that is used a little before or after it is valid.

use super::*;
use crate::filter::Lateness;
use crate::state::Quantity;

/// Position 7 m, velocity 2 m/s, an offset of 0.3 s of which 0.1 s is assumed, under 0.5 m/s².
fn late(assumed: f64, keep: impl FnOnce(&Step, f64)) {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 7.0, &[1.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 2.0, &[1.0], Dynamics::Process);
    let offset: Quantity<Scalar> = declare::<Scalar>(&mut b, "offset", 0.3, &[0.1], Dynamics::Constant).into();
    let mut f = filter(
        b,
        Track {
            position,
            velocity,
            sigma: 0.1,
        },
        1,
    );
    f.keep_steps(true);
    let observed = Observed {
        sensor: 0,
        model: &Direct(position),
        value: &[0.0],
        noise: &[1.0],
        quality: None,
        derivative_input: None,
        lateness: Some(Lateness {
            offset: &offset,
            assumed,
            input: Input::held(&[0.5]),
        }),
    };
    let predicted = f.update(&observed, &mut Open, &[], &Quadratic).predicted[0];
    keep(&f.steps()[0], predicted);
}

#[test]
fn a_prediction_goes_back_by_what_the_offset_has_beyond_the_assumed() {
    // At 2 m/s, and half a step of 1 ms at 0.5 m/s².
    let rate = 2.0 + 0.5 * 0.5e-3;
    for (assumed, wanted) in [(0.1, 7.0 - 0.2 * rate), (0.3, 7.0), (0.5, 7.0 + 0.2 * rate)] {
        late(assumed, |step, predicted| {
            // Rounding of 7 m over a step of 1 ms.
            assert!((predicted - wanted).abs() < 1e-12, "{predicted} {wanted}");
            let Step::Corrected { jacobian, residual, .. } = step else {
                panic!("{step:?}")
            };
            assert!((residual[0] + wanted).abs() < 1e-12);
            let h = &jacobian.row(0)[..3];
            assert!(h[0] == 1.0 && h[1] == 0.0 && (h[2] + rate).abs() < 1e-11, "{h:?}");
        });
    }
}
