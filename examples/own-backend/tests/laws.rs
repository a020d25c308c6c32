//! Both obey the laws, and run a strapdown filter as the built-in ones do.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

use fusion::Navigator;
use fusion::core::Time;
use fusion::core::covariance::{Form, FormKind};
use fusion::core::filter::{Backend, ChartKind, Estimator, Filter, Observed, Parts, UpdateKind, UpdateRule, Verdict};
use fusion::core::gate::Open;
use fusion::core::loss::Quadratic;
use fusion::core::model::{Input, Size};
use fusion::core::testing::{check_form, check_update_rule};
use own_backend::{Packed, Twice};
use std::sync::Arc;

#[test]
fn the_packed_triangle_obeys_the_laws_of_forms() {
    for n in [1, 2, 8, 15, 21] {
        check_form(&(Arc::new(Packed) as Arc<dyn Form>), n).unwrap();
    }
}

#[test]
fn two_steps_obey_the_laws_of_update_rules() {
    check_update_rule(&(Arc::new(Twice) as Arc<dyn UpdateRule>)).unwrap();
}

const DESIGN: &str = include_str!("../../embed.toml");

/// The design's filter of these parts after ten seconds of turning and ten fixes.
fn run(parts: Parts) -> (Vec<f64>, Vec<f64>) {
    let mut nav = Navigator::from_toml(DESIGN).unwrap();
    let rest = [0.0, 0.0, 0.0, 0.0, 0.0, -9.8];
    for k in 0..=1100 {
        nav.feed("imu", 0.01 * f64::from(k), &rest).unwrap();
        if k % 100 == 0 {
            nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0]).unwrap();
        }
    }
    let (start, assembly) = (nav.belief().unwrap().clone(), nav.assembly());
    let sensor = &assembly.sensors[0].model;
    let mut filter = Filter::of(assembly.layout.clone(), assembly.process.clone(), parts.clone(), Size::same(3));
    let mut belief = fusion::core::belief::Belief::initial(&assembly.layout, &parts.form, start.time);
    belief.x.clone_from(&start.x);
    for block in assembly.layout.blocks() {
        belief.covariance.set_block(block, &start.covariance.block(block));
    }
    filter.set_belief(belief);
    let sample = [0.01, -0.02, 0.1, 0.5, 0.2, -9.7];
    for k in 1..=1000_i64 {
        let to = start.time.shifted(k * 10_000_000);
        filter.predict(to, &Input::held(&sample)).unwrap();
        if k % 100 == 0 {
            let observed = Observed {
                sensor: 0,
                model: sensor.as_ref(),
                value: &[0.63, 2.26, 50.0 + 0.1 * k as f64 / 100.0],
                noise: &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 4.0],
                quality: None,
                derivative_input: None,
                lateness: None,
            };
            assert_eq!(filter.update(&observed, &mut Open, &[], &Quadratic).verdict, Verdict::Accepted);
        }
    }
    assert!(filter.belief().time > Time::from_seconds(20.0));
    (filter.belief().x.clone(), filter.belief().covariance.to_dense())
}

fn parts(form: Arc<dyn Form>, update: Arc<dyn UpdateRule>) -> Parts {
    Parts {
        chart: ChartKind::Body.chart(),
        update,
        form,
        ..Backend::ERROR_STATE.into()
    }
}

#[test]
fn a_strapdown_filter_runs_on_the_packed_triangle_to_rounding() {
    let wanted = run(Backend::ERROR_STATE.into());
    let found = run(parts(Arc::new(Packed), UpdateKind::Single.rule()));
    let n = wanted.1.len().isqrt();
    for (k, (a, b)) in wanted.1.iter().zip(&found.1).enumerate() {
        let scale = (wanted.1[k / n * (n + 1)] * wanted.1[k % n * (n + 1)]).sqrt();
        // 1e-9 of the deviations: a thousand products of matrices of condition up to 1e6.
        assert!((a - b).abs() <= 1e-9 * scale, "{k}: {a} and {b}");
    }
}

#[test]
fn two_steps_of_a_mild_measurement_change_the_strapdown_filter_little_but_not_nothing() {
    let wanted = run(Backend::ERROR_STATE.into());
    let found = run(parts(FormKind::Joseph.form(), Arc::new(Twice)));
    let height = |x: &[f64]| x[2];
    let change = (height(&wanted.0) - height(&found.0)).abs();
    // A position is linear but for its lever arm: the second step moves it by less than a millimetre.
    assert!(change > 0.0 && change < 1e-3, "{change:e}");
}
