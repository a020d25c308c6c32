use super::*;
use crate::block::{Build, ProcessSpec};
use fusion_core::geometry::so3;
use fusion_core::model::Prepared;
use fusion_core::state::{Layout, LayoutBuilder};
use fusion_core::testing::check_process;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

type V = Vector3<f64>;

const NOISE: &str = "gyro = { noise = 1e-4 }\naccelerometer = { noise = [1e-3, 2e-3, 4e-3] }\n";

fn built(toml: &str) -> (Layout, Box<dyn Process>) {
    let mut layout = LayoutBuilder::new();
    let spec: StrapdownSpec = toml::from_str(toml).unwrap();
    let mut build = Build {
        name: "process",
        layout: &mut layout,
        origin: None,
        gravity: Gravity::default(),
    };
    let process = spec.build(&mut build).unwrap();
    (layout.finish(), process)
}

/// A state with this attitude, at 36° north and 10 m/s.
fn state(layout: &Layout, q: UnitQuaternion<f64>) -> Vec<f64> {
    let mut x = layout.initial().to_vec();
    x[..6].copy_from_slice(&[0.63, 2.26, 20.0, 8.0, -6.0, 0.0]);
    x[6..10].copy_from_slice(&[q.w, q.i, q.j, q.k]);
    x
}

/// The mean of the linear rates w, f between two times: rates of a strong, fast turn.
fn mean(from: f64, to: f64) -> [f64; 6] {
    let t = 0.5 * (from + to);
    let (w, f) = (V::new(0.5, -0.3 + 4.0 * t, 2.0 * t), V::new(2.0 - 30.0 * t, 1.0 + 20.0 * t, -10.0));
    [w.x, w.y, w.z, f.x, f.y, f.z]
}

/// Where samples of these lengths lead; an unprepared sample before them has no length.
fn driven(process: &dyn Process, x: &[f64], lengths: &[f64]) -> Vec<f64> {
    let (mut prepared, mut x, mut t) = (Prepared::default(), x.to_vec(), 0.0);
    let mut preparation = process.preparation().unwrap();
    preparation.take(0.0, &mean(0.0, 0.0), &mut prepared);
    for length in lengths {
        preparation.take(*length, &mean(t, t + length), &mut prepared);
        t += length;
    }
    preparation.finish(&mut prepared);
    for (sample, length) in prepared.samples().zip(lengths) {
        let interval = *length;
        process.propagate(&mut x, &Input { sample, interval }, interval);
    }
    x
}

#[test]
fn coning_and_sculling_are_exact_to_fourth_order_where_neighbours_last_differently() {
    let (layout, process) = built(&format!("integrator = \"two_sample\"\n{NOISE}"));
    let start = state(&layout, so3::from_rpy(0.2, -0.1, 1.0));
    let error = |scale: f64| {
        let rough = driven(process.as_ref(), &start, &[0.2 * scale, 0.06 * scale]);
        // The same rates in samples so short that nothing is left to correct: 2e-4² of the rest.
        let fine = driven(process.as_ref(), &start, &vec![0.26 * scale / 1000.0; 1000]);
        let mut gap = vec![0.0; layout.dim()];
        layout.minus(&rough, &fine, &mut gap);
        [V::from_column_slice(&gap[6..9]).norm(), V::from_column_slice(&gap[3..6]).norm()]
    };
    let (whole, half) = (error(1.0), error(0.5));
    for (quantity, k) in [("attitude", 0), ("velocity", 1)] {
        let order = (whole[k] / half[k]).log2();
        // The correction of linear rates is exact to third order, so the fourth or fifth remains; a
        // wrong length of the pair leaves the third. 0.4: the next order.
        assert!(order > 3.6, "{quantity}: order {order}, errors {whole:?} {half:?}");
    }
}

#[test]
fn phi_of_second_order_has_every_term_of_it() {
    let bias = "bias = { estimate = true, initial = [0, 0, 0], sigma = 1e-3 }";
    let scale = "scale = { estimate = true, initial = [0.01, -0.02, 0.03], sigma = 1e-2 }";
    let (layout, process) = built(&format!(
        "discretisation = \"second_order\"\ngyro = {{ noise = 1e-4, {bias}, {scale} }}\naccelerometer = {{ noise = 1e-3, {bias}, {scale} }}"
    ));
    assert_eq!(process.order(), Order::Second);
    let x = state(&layout, so3::from_rpy(0.7, -0.4, 2.0));
    let sample = mean(0.1, 0.3);
    check_process(&layout, process.as_ref(), &x, &Input::held(&sample), 0.1).unwrap();
}

#[test]
fn exact_phi_is_the_derivative_of_the_step_however_the_body_turns() {
    let bias = "bias = { estimate = true, initial = [1e-3, 0, 0], sigma = 1e-3 }";
    let scale = "scale = { estimate = true, initial = [0.01, -0.02, 0.03], sigma = 1e-2 }";
    let text = format!(
        "discretisation = \"exact\"\ngyro = {{ noise = 1e-4, {bias}, {scale} }}\naccelerometer = {{ noise = 1e-3, {bias}, {scale} }}"
    );
    let (layout, process) = built(&text);
    assert_eq!(process.order(), Order::Exact);
    let mut x = state(&layout, so3::from_rpy(0.7, -0.4, 2.0));
    // 400 m/s near the pole, where the Earth's terms are largest.
    x[..6].copy_from_slice(&[1.4, 2.26, 9000.0, 300.0, -250.0, 60.0]);
    let sample = [3.0, -4.0, 5.0, 20.0, -30.0, -10.0];
    for dt in [0.01, 0.2] {
        check_process(&layout, process.as_ref(), &x, &Input::held(&sample), dt).unwrap();
    }
    let refused = format!("integrator = \"first_order\"\n{text}");
    let spec: StrapdownSpec = toml::from_str(&refused).unwrap();
    let mut build = Build {
        name: "process",
        layout: &mut LayoutBuilder::new(),
        origin: None,
        gravity: Gravity::default(),
    };
    assert_eq!(spec.build(&mut build).unwrap_err().field, "discretisation");
}

#[test]
fn accelerometer_noise_that_differs_by_axis_is_rotated_to_navigation_axes() {
    let (layout, process) = built(NOISE);
    let q = so3::from_rpy(0.7, -0.4, 2.0);
    let (x, dt) = (state(&layout, q), 0.02);
    let mut out = Transition::new(&layout);
    process.linearise(&x, &Input::held(&mean(0.0, 0.1)), dt, &mut out);
    let c = so3::rotation(&q);
    let wanted = c * Matrix3::from_diagonal(&V::new(1e-6, 4e-6, 16e-6)) * c.transpose() * dt;
    let mut got = Matrix3::zeros();
    let mut yaw = 0.0;
    for (i, j, v) in out.noise_before().chain(out.noise_after()) {
        if (3..6).contains(&i) && (3..6).contains(&j) {
            got[(i - 3, j - 3)] += v;
        }
        yaw += if (i, j) == (8, 8) { v } else { 0.0 };
    }
    // That of the gyros stays in body axes. 4 ε of it: a square and two halves.
    assert!((yaw - 1e-8 * dt).abs() < 4.0 * f64::EPSILON * 1e-8 * dt, "{yaw}");
    // 4 ε: products of rotation matrices.
    assert!((got - wanted).amax() < 4.0 * f64::EPSILON * wanted.amax(), "{got} {wanted}");
}

#[test]
fn a_sample_that_lasts_long_adds_noise_for_what_it_hides() {
    let (layout, process) = built("gyro = { noise = 0 }\naccelerometer = { noise = 0 }");
    let x = state(&layout, UnitQuaternion::identity());
    let (now, before) = ([0.0, 0.0, 0.3, 1.0, 0.0, -9.8], [0.0, 0.0, 0.1, 0.0, 0.0, -9.8]);
    // 1σ of yaw [rad] and of velocity north [m/s] over the whole of a sample.
    let sigma = |interval: f64| {
        let sample = [&now[..], &before[..], &[interval]].concat();
        let input = Input { sample: &sample, interval };
        let mut out = Transition::new(&layout);
        process.linearise(&x, &input, interval, &mut out);
        let variance = |axis: usize| -> f64 {
            let noise = out.noise_before().chain(out.noise_after());
            noise.filter(|(i, j, _)| *i == axis && *j == axis).map(|(_, _, v)| v).sum()
        };
        (variance(8).sqrt(), variance(3).sqrt())
    };
    assert_eq!(sigma(LONGEST_STEP), (0.0, 0.0), "what units of 5 Hz and more hide is left out");
    let (yaw, north) = sigma(1.0);
    let root = 8_f64.sqrt();
    // 1e-15: a square root of a square.
    assert!(
        (yaw - 0.2 / root).abs() < 1e-15 && (north - 1.0 / root).abs() < 1e-15,
        "{yaw} {north}"
    );
    assert!(process.max_step() <= LONGEST_STEP);
}

#[test]
fn the_noise_of_the_gyros_grows_with_the_rate_on_every_axis() {
    let of = |gyro: &str, rate: f64| {
        let (layout, process) = built(&format!("gyro = {{ {gyro} }}\naccelerometer = {{ noise = 1e-3 }}\n"));
        let mut out = Transition::new(&layout);
        let sample = [0.0, rate, 0.0, 0.0, 0.0, -9.8];
        let interval = 0.01;
        let input = Input { sample: &sample, interval };
        process.linearise(&state(&layout, UnitQuaternion::identity()), &input, interval, &mut out);
        let noise: Vec<_> = out.noise_before().chain(out.noise_after()).collect();
        noise
    };
    // √(3² + (2 · 2)²) = 5.
    let (grown, same) = (of("noise = 3e-3, scale_noise = 2e-3", 2.0), of("noise = 5e-3", 2.0));
    assert!(grown.len() == same.len() && !same.is_empty());
    for ((i, j, grown), (k, l, same)) in grown.into_iter().zip(same) {
        assert!(
            (i, j) == (k, l) && (grown - same).abs() <= 1e-12 * same.abs(),
            "{i}, {j}: {grown} {same}"
        );
    }
    assert_eq!(of("noise = 3e-3, scale_noise = 2e-3", 0.0), of("noise = 3e-3", 0.0));
}
