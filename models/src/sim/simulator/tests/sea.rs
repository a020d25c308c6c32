//! A boat that is carried by a current and moved by waves.

use super::*;
use fusion_core::geometry::so3;

const CURRENT: Vector3<f64> = Vector3::new(0.4, -0.3, 0.0);
const AFLOAT: &str = "{ rest = { duration = 10 } }, { straight = { distance = 60, speed = 2 } }, { turn = { angle = 2, radius = 10 } }, \
     { sine = { distance = 60, amplitude = 2, wavelength = 30 } }, { straight = { distance = 60, end_speed = 0 } }";
const WAVES: &str = "sea.waves = { height = 1, period = 5, direction = '40 deg', roll = '5 deg', pitch = '3 deg' }\n";

fn current() -> String {
    let [n, e, d]: [f64; 3] = CURRENT.into();
    format!("sea.current = [{n}, {e}, {d}]\n")
}

/// Logs without errors: velocity, beams and speed through the water, and velocity over ground.
const LOGS: &str = "[sensor.log.body_velocity]\n\
     current = { estimate = true, initial = [0, 0, 0], sigma = ['0.5 m/s', '0.5 m/s', 0], correlation_time = '20 min' }\n\
     [sensor.log_beams.dvl]\nbeam_angle = '30 deg'\nazimuths = [0, '120 deg', '240 deg']\ncurrent = { shared = 'log.current' }\n\
     [sensor.log_speed.odometer]\ncurrent = { shared = 'log.current' }\n\
     [sensor.bottom.body_velocity]\n";

const LOGGED: &str = "imu = { rate = '50 Hz' }\nsensor = { log = { rate = 10 }, log_beams = { rate = 10 }, log_speed = { rate = 10 }, \
     bottom = { rate = 10 } }\n";

#[test]
fn samples_of_the_inertial_unit_lead_through_waves_and_current_along_the_truth() {
    for integrator in ["one_sample", "two_sample"] {
        let sea = current() + WAVES;
        let text = strapdown(integrator, false) + &simulation(&format!("imu = {{ rate = 100 }}\nreference_rate = 50\n{sea}"), AFLOAT);
        let (rows, worst) = led_prepared(&text);
        // 1e-4 m: dt²/12·Δa, as of the inverse mechanisation; waves of 1 m and 5 s have 0.4 m/s².
        assert!(rows > 10_000 && worst > 0.0 && worst < 1e-4, "{integrator}: {rows} {worst:e}");
    }
}

#[test]
fn a_current_reaches_every_sensor_that_estimates_it_and_the_way_over_ground() {
    for draws in [false, true] {
        let of_sea = |sea: &str| {
            let more = format!("{LOGGED}draw_parameters = {draws}\n{sea}");
            rows(&(strapdown("one_sample", false) + LOGS + &simulation(&more, AFLOAT)), 3)
        };
        let (still, all) = (of_sea(WAVES), of_sea(&(current() + WAVES)));
        let (still, truth) = (of(&still, "reference"), of(&all, "reference"));
        let [log, beams, speed, bottom] = ["log", "log_beams", "log_speed", "bottom"].map(|name| of(&all, name));
        assert!(truth.len() > 1000);
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let beam = |azimuth: f64| Vector3::new(sin * azimuth.to_radians().cos(), sin * azimuth.to_radians().sin(), cos);
        for (k, (_, time, truth)) in truth.iter().enumerate() {
            let v_n = Vector3::new(truth[3], truth[4], truth[5]);
            let q_nb = Attitude::read(&truth[6..]);
            let (over_ground, in_water) = (q_nb.inverse() * v_n, q_nb.inverse() * (v_n - CURRENT));
            // 1e-12 m/s: rounding.
            let near = |z: &[f64], expected: &[f64]| {
                z.iter()
                    .zip(expected)
                    .for_each(|(z, e)| assert!((z - e).abs() < 1e-12, "{k}: {z} {e}"))
            };
            near(&bottom[k].2, over_ground.as_slice());
            near(&log[k].2, in_water.as_slice());
            near(&speed[k].2, &[in_water.x]);
            near(&beams[k].2, &[0.0, 120.0, 240.0].map(|azimuth| beam(azimuth).dot(&in_water)));
            let moved = Geodetic::read(truth).difference(&Geodetic::read(&still[k].2));
            // 1 mm: the axes at two places 50 m apart.
            assert!((moved - CURRENT * time.seconds()).xy().norm() < 1e-3, "{k}: {moved}");
        }
    }
}

#[test]
fn the_truth_of_the_current_is_that_of_the_sea_and_without_one_that_of_the_parameter() {
    let truth = |sea: &str, draws: bool| {
        let more = format!("{LOGGED}draw_parameters = {draws}\n{sea}");
        let text = strapdown("one_sample", false) + LOGS + &simulation(&more, AFLOAT);
        let (layout, _, mut simulator) = simulate(&text, 3).unwrap();
        while simulator.next_row(&mut Vec::new()).is_some() {}
        let current = layout.slot::<Vector<3>>("log.current").unwrap().read(simulator.reference_state());
        (current, simulator.is_drawn("log.current"))
    };
    for draws in [false, true] {
        assert_eq!(truth(&current(), draws), (CURRENT, true));
    }
    assert_eq!(truth(WAVES, false), (Vector3::zeros(), false));
    let (drawn, is_drawn) = truth(WAVES, true);
    assert!(is_drawn && drawn.norm() > 0.01 && drawn.z == 0.0, "{drawn}");
}

#[test]
fn the_axes_of_a_boat_in_waves_level_out_over_time() {
    let text = strapdown("one_sample", false) + &simulation(&format!("imu = {{ rate = 50 }}\n{WAVES}"), "{ rest = { duration = 1000 } }");
    let rows = rows(&text, 1);
    let tilts = of(&rows, "reference")
        .iter()
        .map(|(.., row)| so3::to_rpy(&Attitude::read(&row[6..])))
        .collect::<Vec<_>>();
    let mean_square = |axis: usize| tilts.iter().map(|rpy| rpy[axis].powi(2)).sum::<f64>() / tilts.len() as f64;
    for (axis, declared) in [(0, 5.0_f64), (1, 3.0)] {
        // 3 %: groups of 100 s, and 10 s in which they rise.
        assert!(
            (mean_square(axis).sqrt().to_degrees() / declared - 1.0).abs() < 0.03,
            "{axis}: {}",
            mean_square(axis)
        );
    }
}

#[test]
fn waves_are_refused_where_nothing_floats() {
    let refusal = |unit: &str, segments: &str| {
        let spec: SimulationSpec =
            toml::from_str(&simulation(&format!("{unit}\n{WAVES}"), segments).replacen("[simulation]", "", 1)).unwrap();
        spec.mistakes(&[]).first().map(|e| e.field.clone())
    };
    let straight = "{ straight = { distance = 20, speed = 1 } }";
    assert_eq!(refusal("", AFLOAT), None);
    assert_eq!(refusal("odometry = { rate = 10 }", AFLOAT).unwrap(), "sea.waves");
    let climb = format!("{straight}, {{ climb = {{ height = -3, distance = 20 }} }}");
    assert_eq!(refusal("", &climb).unwrap(), "trajectory.1");
    for segment in ["{ hover = { duration = 20 } }", "{ fly = { by = [0, 0, -3], speed = 1 } }"] {
        assert_eq!(refusal("", segment).unwrap(), "trajectory.0");
    }
    let spec: SimulationSpec = toml::from_str(&format!("trajectory = [{climb}]\n{}", current())).unwrap();
    assert!(spec.mistakes(&[]).is_empty(), "a current carries a diver");
    let period = toml::from_str::<SimulationSpec>("sea.waves = { height = 1 }").unwrap_err();
    assert!(period.message().contains("`period`"), "{period}");
}
