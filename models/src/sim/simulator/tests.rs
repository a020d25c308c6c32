mod field;
mod places;
mod sea;

use super::*;
use crate::block::{Build, ProcessSpec, SensorSpec};
use crate::vocabulary::state;
use fusion_core::model::{Input, Prepared};
use fusion_core::state::{Attitude, Dynamics, LayoutBuilder, Manifold, Vector, Velocity};
use nalgebra::{UnitQuaternion, Vector3};

const ORIGIN: Geodetic = Geodetic::new(0.612_167, 2.252_993, 10.0);
const MOVING: &str = "{ rest = { duration = 5 } }, { straight = { distance = 40, speed = 3, acceleration = 1 } }, \
     { turn = { angle = 2, radius = 10, bank = true } }, { climb = { height = 3, distance = 20 } }, \
     { bump = { duration = 1, pitch = '8 deg', heading = '5 deg', velocity = [0.6, 0, 0] } }, \
     { sine = { duration = 250, amplitude = 2, wavelength = 30 } }, { straight = { distance = 60, end_speed = 0 } }";

/// The same in a minute or so.
fn short() -> String {
    MOVING.replace("duration = 250", "duration = 20")
}

#[derive(serde::Deserialize)]
struct Design {
    process: Box<dyn ProcessSpec>,
    #[serde(default)]
    sensor: std::collections::BTreeMap<String, Box<dyn SensorSpec>>,
    simulation: SimulationSpec,
}

/// A filter's layout, its process, and the simulator of `text`.
fn simulate(text: &str, seed: u64) -> Result<(Layout, Arc<dyn Process>, Simulator), BuildError> {
    let design: Design = toml::from_str(text).unwrap();
    let mut layout = LayoutBuilder::new();
    let mut build = Build {
        name: "process",
        layout: &mut layout,
        origin: Some(ORIGIN),
        gravity: Gravity::default(),
    };
    let process: Arc<dyn Process> = design.process.build(&mut build).unwrap().into();
    let mut sensors = Vec::new();
    for (name, spec) in &design.sensor {
        build.name = name;
        let channels = spec.reading().channels().to_vec();
        if channels.is_empty() {
            continue;
        }
        let model = spec.build(&mut build).unwrap().into();
        sensors.push(SimulatedSensor {
            name: name.clone(),
            model,
            channels,
            rows: spec.noise(),
            delay: if name == "gnss" { LATE } else { 0.0 },
            offset: None,
        });
    }
    let gravity = build.gravity;
    let layout = layout.finish();
    let input = design.process.input();
    let setup = Setup {
        layout: &layout,
        process: process.clone(),
        input: &input,
        origin: ORIGIN,
        gravity,
        sensors,
        others: Vec::new(),
        given: Vec::new(),
        told: None,
    };
    let simulator = Simulator::new(&design.simulation, setup, seed, None)?;
    Ok((layout, process, simulator))
}

fn strapdown(integrator: &str, states: bool) -> String {
    let bias = |unit| {
        if states {
            format!(", bias = {{ estimate = true, initial = [0, 0, 0], sigma = '1 {unit}' }}")
        } else {
            String::new()
        }
    };
    format!(
        "[process.strapdown]\nintegrator = '{integrator}'\n\
         gyro = {{ noise = '0.1 deg/sqrt(h)'{} }}\naccelerometer = {{ noise = '1 mg/sqrt(Hz)'{} }}\n",
        bias("deg/s"),
        bias("mg")
    )
}

const GNSS: &str = "[sensor.gnss.gnss_position]\n\
     lever_arm = { estimate = true, initial = [0.5, -0.3, -1.2], sigma = '20 cm' }\n\
     bias = { estimate = true, initial = [0, 0, 0], sigma = '1 m', correlation_time = '20 s' }\n";

/// How late the fixes of `gnss` are stamped [s].
const LATE: f64 = 0.15;

fn simulation(more: &str, segments: &str) -> String {
    format!("[simulation]\n{more}\ntrajectory = [{segments}]\n")
}

type Rows = Vec<(String, Time, Vec<f64>)>;

fn rows(text: &str, seed: u64) -> Rows {
    let (_, _, mut simulator) = simulate(text, seed).unwrap();
    let (mut rows, mut row) = (Vec::new(), Vec::new());
    while let Some(Next::Row(stream, time)) = simulator.next_row(&mut row) {
        rows.push((simulator.streams()[stream].name.clone(), time, row.clone()));
    }
    rows
}

fn of<'a>(rows: &'a Rows, stream: &str) -> Vec<&'a (String, Time, Vec<f64>)> {
    rows.iter().filter(|(name, ..)| name == stream).collect()
}

/// Where prepared samples lead from the true start, against the truth: their number, and the largest error [m].
fn led_prepared(text: &str) -> (usize, f64) {
    let (layout, process, mut simulator) = simulate(text, 1).unwrap();
    let mut x = layout.initial().to_vec();
    let (mut row, mut rows, mut worst) = (Vec::new(), 0, 0.0_f64);
    let (mut preparation, mut prepared) = (process.preparation().unwrap(), Prepared::default());
    let (mut last, mut intervals) = (None, std::collections::VecDeque::new());
    let mut reached = Time::default();
    while let Some(Next::Row(stream, time)) = simulator.next_row(&mut row) {
        if simulator.streams()[stream].name == "reference" {
            if time == Time::default() {
                x.copy_from_slice(simulator.reference_state());
            }
            let estimate = Geodetic::read(&x);
            let truth = Geodetic::read(&row);
            if rows > 2 && reached == time {
                worst = worst.max(estimate.difference(&truth).norm());
            }
            continue;
        }
        // As the runner does it: the first row opens the first interval.
        rows += 1;
        let interval = last.replace(time).map_or(0.0, |last| time.seconds_since(last));
        if rows > 1 {
            intervals.push_back((time, interval));
        }
        preparation.take(interval, &row, &mut prepared);
        for sample in prepared.samples() {
            let (end, interval) = intervals.pop_front().unwrap();
            process.propagate(&mut x, &Input { sample, interval }, interval);
            reached = end;
        }
        prepared.clear();
    }
    (rows, worst)
}

#[test]
fn noise_free_rows_lead_the_process_along_the_truth_in_every_mode() {
    for integrator in ["one_sample", "two_sample"] {
        let text = strapdown(integrator, false) + &simulation("imu = { rate = '100 Hz' }\nreference_rate = '50 Hz'", MOVING);
        let (rows, worst) = led_prepared(&text);
        assert!(rows > 30_000, "{rows}");
        // 1e-4 m over 300 s: dt²/12·Δa, as of the inverse mechanisation.
        assert!(worst > 0.0 && worst < 1e-4, "{integrator}: {worst:e}");
    }
}

/// Where samples without preparation lead from the true start, against the truth: the largest error.
fn led_along(text: &str, unit: &str) -> f64 {
    let (layout, process, mut simulator) = simulate(text, 1).unwrap();
    let (mut x, mut row, mut last, mut worst) = (layout.initial().to_vec(), Vec::new(), None, 0.0_f64);
    while let Some(Next::Row(stream, time)) = simulator.next_row(&mut row) {
        let name = simulator.streams()[stream].name.clone();
        if name == unit {
            let interval = last.replace(time).map_or(0.0, |last| time.seconds_since(last));
            process.propagate(&mut x, &Input { sample: &row, interval }, interval);
        } else if time == Time::default() {
            x.copy_from_slice(simulator.reference_state());
        } else if last == Some(time) {
            let mut gap = vec![0.0; layout.dim()];
            layout.minus(&x, simulator.reference_state(), &mut gap);
            worst = gap.iter().fold(worst, |w, g| w.max(g.abs()));
        }
    }
    worst
}

#[test]
fn over_a_plane_and_on_the_ground_noise_free_rows_lead_along_the_truth() {
    let local = "[process.strapdown_local]\nintegrator = 'constant'\ngravity = 9.82\ngyro.noise = 1e-3\naccelerometer.noise = 1e-3\n";
    let text = local.to_owned() + &simulation("imu = { rate = '100 Hz' }\nreference_rate = '50 Hz'", &short());
    let worst = led_along(&text, "imu");
    // 1e-4 m: dt²/12·Δa, as of the inverse mechanisation.
    assert!(worst > 0.0 && worst < 1e-4, "{worst:e}");
    let planar = "[process.planar_odometry]\nforward_noise = 1e-3\nsideways_noise = 1e-3\nyaw_rate_noise = 1e-3\n";
    let way = "{ straight = { distance = 40, speed = 3, acceleration = 1 } }, { circle = { angle = 5, duration = 20 } }, \
         { circle = { angle = -2, duration = 3 } }";
    let text = planar.to_owned() + &simulation("odometry = { rate = '20 Hz' }\nreference_rate = '10 Hz'", way);
    let worst = led_along(&text, "odometry");
    // 1e-7: thousands of roundings of Earth-centred coordinates, 1e-9 m each.
    assert!(worst < 1e-7, "{worst:e}");
}

#[test]
fn noise_of_the_odometry_is_that_declared() {
    let planar = "[process.planar_odometry]\nforward_noise = 1e-3\nsideways_noise = 1e-3\nyaw_rate_noise = 1e-3\n";
    let unit = "odometry = { rate = '100 Hz', forward_noise = 0.01, sideways_noise = 0.02, yaw_rate_noise = 0.03 }";
    let text = planar.to_owned() + &simulation(unit, "{ rest = { duration = 100 } }");
    let rows = rows(&text, 4);
    let samples = of(&rows, "odometry");
    for (axis, density) in [(0, 0.01), (1, 0.02), (2, 0.03)] {
        let squares: f64 = samples.iter().map(|(_, _, row)| row[axis].powi(2)).sum();
        let sigma = (squares / samples.len() as f64).sqrt();
        // 3 %: √(1/2n) = 0.7 % of 10 000 samples, four times. σ of a sample is N √(100 Hz).
        assert!((sigma / (10.0 * density) - 1.0).abs() < 0.03, "{axis}: {sigma}");
    }
}

#[test]
fn starts_are_drawn_about_the_truth_with_the_declared_sigma() {
    use super::super::start::DrawnStart;
    use fusion_core::belief::Belief;
    use fusion_core::covariance::FormKind;
    use fusion_core::runner::Initialiser;
    let text = "[process.strapdown_local]\ngyro.noise = 1e-3\naccelerometer.noise = 1e-3\n".to_owned()
        + &simulation(
            "imu = { rate = '100 Hz' }\nstart = { position = [3, 4, 5], heading = 1, speed = 2 }",
            "{ circle = { angle = 5, duration = 20 } }",
        );
    let design: Design = toml::from_str(&text).unwrap();
    let (layout, _, mut simulator) = simulate(&text, 1).unwrap();
    while simulator
        .next_row(&mut Vec::new())
        .is_some_and(|next| matches!(next, Next::Row(stream, _) if simulator.streams()[stream].name != "reference"))
    {}
    let truth = simulator.reference_state().to_vec();
    let sigmas = [[1.0, 2.0, 0.0], [0.1, 0.1, 0.3], [0.1, 0.2, 0.4]];
    let start = |seed| {
        let place = (ORIGIN, Gravity::Flat(crate::units::STANDARD_GRAVITY));
        let drawn = DrawnStart::new(&design.simulation, &layout, place, &[], seed).unwrap();
        let mut belief = Belief::initial(&layout, &FormKind::Joseph.form(), Time::default());
        layout
            .blocks()
            .iter()
            .zip(sigmas)
            .for_each(|(b, s)| belief.covariance.set_sigmas(b, &s));
        drawn.write(Time::default(), &layout, &mut belief);
        let mut error = vec![0.0; layout.dim()];
        layout.minus(&belief.x, &truth, &mut error);
        error
    };
    assert_eq!(start(7), start(7));
    let count = 2000;
    let mut squares = vec![0.0; layout.dim()];
    (0..count).for_each(|seed| squares.iter_mut().zip(start(seed)).for_each(|(s, e)| *s += e * e));
    for (k, (square, sigma)) in squares.iter().zip(sigmas.concat()).enumerate() {
        let spread = (square / count as f64).sqrt();
        // 7 %: √(1/2n) = 1.6 %, four times; 1e-8 m: Earth-centred coordinates of the truth.
        assert!((spread - sigma).abs() < 0.07 * sigma + 1e-8, "{k}: {spread} {sigma}");
    }
    // Blocks that initialisers find from data stay unchanged; if these are all blocks, nothing is left to draw.
    let found = ["local_position", "velocity", "attitude"];
    let none = DrawnStart::new(&design.simulation, &layout, (ORIGIN, Gravity::default()), &found, 1);
    assert_eq!(none.unwrap_err().field, "draw_start");
}

#[test]
fn a_row_is_the_antenna_at_the_time_it_is_valid() {
    let text = strapdown("one_sample", false)
        + GNSS
        + &simulation(
            "imu = { rate = '100 Hz' }\nreference_rate = 1000\nsensor.gnss = { rate = '7 Hz', start = '3 ms' }",
            &short(),
        );
    let rows = rows(&text, 1);
    let reference = of(&rows, "reference");
    let fixes = of(&rows, "gnss");
    assert!(fixes.len() > 400);
    let mut seen = 0;
    for (k, (_, stamp, z)) in fixes.iter().enumerate() {
        let valid = stamp.shifted(-150_000_000);
        assert_eq!(valid, Time::from_nanos(3_000_000).shifted(nanos(k as f64 / 7.0)));
        // The reference has a row every millisecond; every seventh fix falls on one.
        let Some((_, time, truth)) = reference.get((valid.nanos() / 1_000_000) as usize) else {
            continue;
        };
        if *time != valid {
            continue;
        }
        let antenna = Attitude::read(&truth[6..]) * Vector3::new(0.5, -0.3, -1.2);
        let error = Geodetic::read(z).difference(&Geodetic::read(truth).offset(&antenna));
        // 1e-8 m: an ulp of longitude is 3e-9 m.
        assert!(error.norm() < 1e-8, "{k} {error}");
        seen += 1;
    }
    assert!(seen > 55, "{seen}");
}

#[test]
fn rows_come_in_order_of_stamps_with_every_stream_complete() {
    let text = strapdown("two_sample", true)
        + GNSS
        + &simulation(
            "imu = { rate = '100 Hz', preset = 'hg1700' }\nsensor.gnss = { rate = 5, white = 1 }",
            "{ rest = { duration = 20 } }",
        );
    let rows = rows(&text, 1);
    assert!(rows.windows(2).all(|w| w[0].1 <= w[1].1));
    // Both ends belong to the run.
    assert_eq!(of(&rows, "imu").len(), 2001);
    assert_eq!(of(&rows, "reference").len(), 201);
    assert_eq!(of(&rows, "gnss").len(), 101);
    assert!(rows.iter().all(|(_, _, row)| row.iter().all(|x| x.is_finite())));
}

#[test]
fn rows_depend_on_the_seed_and_on_no_other_sensor() {
    let imu = "imu = { rate = '100 Hz', preset = 'consumer' }\n";
    let rest = "{ rest = { duration = 20 } }";
    let gnss = "sensor.gnss = { rate = 1, white = 1, markov = { sigma = 1, correlation_time = 10 }, bias_sigma = 1 }\n";
    let other = "sensor.other = { rate = 3, white = 2 }\n";
    let alone = strapdown("one_sample", true) + GNSS + &simulation(&format!("{imu}{gnss}"), rest);
    let both = strapdown("one_sample", true) + GNSS + "[sensor.other.gnss_position]\n" + &simulation(&format!("{imu}{gnss}{other}"), rest);
    let first = rows(&alone, 1);
    assert_eq!(first, rows(&alone, 1));
    let more = rows(&both, 1);
    let another = rows(&alone, 2);
    for stream in ["imu", "gnss"] {
        assert_eq!(of(&first, stream), of(&more, stream));
        assert_ne!(of(&first, stream)[3], of(&another, stream)[3]);
    }
    assert_eq!(of(&first, "reference"), of(&another, "reference"));
    assert_eq!(of(&more, "other").len(), 61);
}

#[test]
fn the_true_state_holds_the_errors_of_the_unit() {
    let unit = "imu = { rate = '100 Hz', preset = 'hg1700', gyro = { noise = 0 }, accelerometer = { noise = 0 } }";
    let text = strapdown("one_sample", true) + &simulation(unit, "{ rest = { duration = 1 } }");
    let (layout, _, mut simulator) = simulate(&text, 3).unwrap();
    let (mut row, mut imu) = (Vec::new(), Vec::new());
    while let Some(Next::Row(stream, _)) = simulator.next_row(&mut row) {
        if stream == 0 {
            imu.clone_from(&row);
        }
    }
    let x = simulator.reference_state();
    let bias = layout.slot(state::GYRO_BIAS).unwrap().read(x);
    assert!(bias.norm() > 1e-7);
    let truth = simulator.truth().imu;
    // 1e-15: rounding at rates of 1e-4.
    assert!((Vector3::from_column_slice(&imu[..3]) - truth.rate - bias).norm() < 1e-15);
    let bias = layout.slot(state::ACCEL_BIAS).unwrap().read(x);
    assert!((Vector3::from_column_slice(&imu[3..]) - truth.force - bias).norm() < 1e-12 && bias.norm() > 1e-4);
    assert_eq!(Geodetic::read(x), simulator.truth().nav.position);
}

#[test]
fn parameters_stay_at_their_initial_values_or_are_drawn_about_them() {
    let text = |draw: bool| {
        let imu = format!("imu = {{ rate = 10 }}\ndraw_parameters = {draw}");
        strapdown("one_sample", false) + GNSS + &simulation(&imu, "{ rest = { duration = 200 } }")
    };
    let run = |draw, seed| {
        let (layout, _, mut simulator) = simulate(&text(draw), seed).unwrap();
        let read = |name, s: &Simulator| layout.slot::<Vector<3>>(name).unwrap().read(s.reference_state());
        let (mut row, mut slow, mut n) = (Vec::new(), 0.0, 0.0);
        while simulator.next_row(&mut row).is_some() {
            slow += read("gnss.bias", &simulator).norm_squared();
            n += 3.0;
        }
        (read("gnss.lever_arm", &simulator), f64::sqrt(slow / n))
    };
    assert_eq!(run(false, 1), (Vector3::new(0.5, -0.3, -1.2), 0.0));
    let (mut arm, mut slow) = (0.0, 0.0);
    for seed in 0..20 {
        let (l, s) = run(true, seed);
        arm += (l - Vector3::new(0.5, -0.3, -1.2)).norm_squared() / 60.0;
        slow += s * s / 20.0;
    }
    // 40 %: 1/√120 = 9 % of 1σ. 20 %: 20·3·200/40 = 300 independent samples, 4 % of 1σ.
    assert!((arm.sqrt() / 0.2 - 1.0).abs() < 0.4, "{}", arm.sqrt());
    assert!((slow.sqrt() - 1.0).abs() < 0.2, "{}", slow.sqrt());
}

#[test]
fn the_true_bias_of_a_sensor_is_all_of_its_error_that_lasts() {
    let truth = |error: &str| {
        let imu = format!("imu = {{ rate = 10 }}\ndraw_parameters = true\nsensor.gnss = {{ rate = 1{error} }}");
        let text = strapdown("one_sample", false) + GNSS + &simulation(&imu, "{ rest = { duration = 20 } }");
        let (layout, _, mut simulator) = simulate(&text, 3).unwrap();
        let bias = layout.slot::<Vector<3>>("gnss.bias").unwrap();
        let (mut row, mut lasts) = (Vec::new(), Vec::new());
        while simulator.next_row(&mut row).is_some() {
            lasts.push(bias.read(simulator.reference_state()));
        }
        lasts
    };
    let (alone, both) = (truth(""), truth(", bias_sigma = 2"));
    // The draw of the state is the same; the difference is one constant.
    let added = both.last().unwrap() - alone.last().unwrap();
    assert!(added.norm() > 0.1, "{added}");
    let settled = alone.iter().zip(&both).skip(20);
    // 1e-12: rounding.
    settled.for_each(|(alone, both)| assert!((both - alone - added).norm() < 1e-12, "{added}"));
    let slow = truth(", markov = { sigma = 2, correlation_time = 5 }");
    assert!(slow.iter().zip(&alone).skip(20).any(|(slow, alone)| (slow - alone).norm() > 0.1));
}

#[test]
fn a_moved_state_that_the_world_does_not_know_is_refused_with_the_name_that_was_meant() {
    #[derive(Debug)]
    struct Still;
    impl Process for Still {
        fn input_dim(&self) -> usize {
            0
        }
        fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
        fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut fusion_core::linear::Transition) {}
    }
    let refusal = |name: &str| {
        let mut layout = LayoutBuilder::new();
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin: Some(ORIGIN),
            gravity: Gravity::default(),
        };
        build
            .declare::<Velocity>(name, "m/s", Vector3::zeros(), vec![1.0; 3], Dynamics::Process)
            .unwrap();
        let setup = Setup {
            layout: layout.so_far(),
            process: Arc::new(Still),
            input: &[],
            origin: ORIGIN,
            gravity: Gravity::default(),
            sensors: Vec::new(),
            others: Vec::new(),
            given: Vec::new(),
            told: None,
        };
        let spec: SimulationSpec = toml::from_str("trajectory = [{ rest = { duration = 1 } }]").unwrap();
        Simulator::new(&spec, setup, 1, None).map_err(|e| e.message).err()
    };
    assert_eq!(refusal("velocity"), None);
    let message = refusal("velocty").unwrap();
    assert!(
        message.contains("`velocty`") && message.ends_with("did you mean `velocity`?"),
        "{message}"
    );
    assert!(refusal("current").unwrap().ends_with("`current`, which the process moves"));
    assert!(refusal("attitude").unwrap().contains("Velocity, and Attitude is needed"));
}

#[test]
fn memory_is_bounded_by_the_longest_delay() {
    let text = strapdown("one_sample", false) + GNSS + &simulation("imu = { rate = 100 }\nsensor.gnss = { rate = 50 }", &short());
    let (_, _, mut simulator) = simulate(&text, 1).unwrap();
    let mut row = Vec::new();
    let mut most = 0;
    while simulator.next_row(&mut row).is_some() {
        most = most.max(simulator.queue.len() + simulator.spare.len());
    }
    // 150 ms at 50 Hz, and a row or two of each stream.
    assert!(most < 20, "{most}");
}

#[test]
fn a_process_without_input_needs_no_unit_and_one_with_input_does() {
    let unicycle = "[process.unicycle]\n".to_owned() + &unicycle_fields();
    let rest = "{ straight = { distance = 20, speed = 1 } }, { turn = { angle = 1, radius = 8 } }";
    let (layout, _, mut simulator) = simulate(&(unicycle + &simulation("start = { heading = '20 deg' }", rest)), 1).unwrap();
    let mut row = Vec::new();
    while simulator.next_row(&mut row).is_some() {
        let truth = simulator.truth();
        let x = simulator.reference_state();
        let speed = layout.slot(state::SPEED).unwrap().read(x);
        let rate = layout.slot(state::YAW_RATE).unwrap().read(x);
        // 1e-11 m/s: the plane of the origin is tilted by 4e-6 rad at 25 m, squared.
        assert!((speed - truth.nav.v_eb_n.norm()).abs() < 1e-11, "{speed}");
        assert!((-1e-9..0.2).contains(&rate), "{rate}");
    }
    let heading = layout.slot(state::HEADING).unwrap().read(simulator.reference_state());
    // The last reference row is up to 0.1 s before the end of the turn, where the rate is small.
    assert!((heading - (20_f64.to_radians() + 1.0)).abs() < 1e-3, "{heading}");
    assert_eq!(simulator.streams().len(), 1);

    let missing = strapdown("one_sample", false) + &simulation("", rest);
    assert_eq!(simulate(&missing, 1).unwrap_err().field, "imu");
    let unknown = strapdown("one_sample", false) + GNSS + &simulation("imu = { rate = 100 }\nsensor.gns = { rate = 1 }", rest);
    assert_eq!(simulate(&unknown, 1).unwrap_err().field, "sensor.gns");
    let wrong =
        strapdown("one_sample", false) + GNSS + &simulation("imu = { rate = 100 }\nsensor.gnss = { rate = 1, white = '1 s' }", rest);
    assert_eq!(simulate(&wrong, 1).unwrap_err().field, "sensor.gnss.white");
}

/// The fields of the registered example.
fn unicycle_fields() -> String {
    let all = crate::registry::all();
    all.iter().find(|r| r.name == "unicycle").unwrap().example.to_owned()
}

#[test]
fn a_shared_course_leads_to_the_same_rows_to_the_last_bit() {
    let all = |mut simulator: Simulator| {
        let (mut found, mut row) = (Vec::new(), Vec::new());
        while let Some(Next::Row(stream, time)) = simulator.next_row(&mut row) {
            let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            found.push((stream, time, bits(&row), bits(simulator.reference_state())));
        }
        found
    };
    // Fixes between the samples of the unit, stamped late; an odd number of samples, so that a pair is left over.
    let more = "imu = { rate = '51 Hz', preset = 'consumer' }\ndraw_parameters = true\nodometry = { rate = '7 Hz' }\n\
         sensor.gnss = { rate = '3 Hz', start = 0.1, white = 1 }";
    for integrator in ["one_sample", "two_sample"] {
        let text = strapdown(integrator, true) + GNSS + &simulation(more, &short());
        let shared = SharedCourse::default();
        let runs = [1, 2, 1].map(|seed| {
            let own = all(simulate(&text, seed).unwrap().2);
            assert!(own == all(simulate(&text, seed).unwrap().2.share(&shared)), "{integrator} {seed}");
            own
        });
        assert!(runs[0] == runs[2] && runs[0] != runs[1] && runs[0].len() > 3000);
        assert!(shared.is_made());
    }
}

#[test]
fn what_depends_on_the_seed_or_takes_too_much_memory_is_not_shared() {
    let shared = |text: String| {
        let shared = SharedCourse::default();
        let _ = simulate(&text, 1).unwrap().2.share(&shared);
        shared.is_made()
    };
    let design = |more: &str| strapdown("one_sample", false) + &simulation(more, "{ rest = { duration = 600 } }");
    assert!(shared(design("imu = { rate = '10 Hz' }")));
    // 72 bytes for each of 1.2 million samples: 86 MB.
    assert!(!shared(design("imu = { rate = '2 kHz' }")));
}
