//! The parts by their names in designs, and the manifold in every backend.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

use fusion::Selection;
use fusion::core::state::{Kind, Layout, LayoutBuilder, Manifold};
use fusion::core::testing::{Lcg, check_chart, check_space};
use fusion::models::registry;
use fusion::run::{Keep, Options, Smoothing, Summary, run};
use fusion::source::Columns;
use nalgebra::Vector3;
use own_backend::Rodrigues;
use own_backend::direction::{Direction, basis};
use rand::SeedableRng;
use rand::rngs::StdRng;
use rand_distr::{Distribution, StandardNormal};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

const OWN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/direction.toml");
const CAR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/ins-gps.toml");

#[test]
fn the_manifold_and_its_blocks_obey_the_laws() {
    own_backend::link();
    let mut random = Lcg::new(2);
    for _ in 0..100 {
        let u = Vector3::from_fn(|_, _| random.signed()).normalize();
        // Away from −e_z, where the tangent axes are not unique, before and after the step.
        if u.z > -0.5 {
            check_space(Direction::SPACE, u.as_slice(), &[0.4 * random.signed(), 0.4 * random.signed()]).unwrap();
        }
    }
    for own in registry::all().into_iter().filter(|r| r.module.starts_with("own_backend")) {
        fusion::models::testing::check(own).unwrap();
    }
}

#[test]
fn a_wrong_jacobian_of_a_manifold_is_told() {
    static WRONG: fusion::core::state::Space = fusion::core::state::Space {
        name: "wrong",
        jacobian: |_, _, out| out.copy_from_slice(&[1.0, 0.0, 0.0, 1.0]),
        ..*Direction::SPACE
    };
    let told = check_space(&WRONG, &[0.6, 0.0, 0.8], &[0.3, 0.4]).unwrap_err();
    assert!(told.contains("the Jacobian is 1"), "{told}");
}

/// A layout with an attitude and a direction.
fn layout(random: &mut Lcg) -> Layout {
    let mut b = LayoutBuilder::new();
    let turn = Vector3::from_fn(|_, _| random.signed());
    declare::<fusion::core::state::Attitude>(&mut b, "attitude", nalgebra::UnitQuaternion::from_scaled_axis(turn));
    declare::<Direction>(&mut b, "direction", Vector3::new(0.1 * random.signed(), 0.3, 0.8).normalize());
    b.finish()
}

fn declare<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value) {
    b.declare::<M>(fusion::core::state::Declaration {
        name: name.to_owned(),
        owner: "test".to_owned(),
        unit: "rad",
        initial,
        sigma: vec![1.0; M::KIND.dim()],
        role: fusion::core::state::StateRole::Kinematic,
        dynamics: fusion::core::state::Dynamics::Process,
    })
    .unwrap();
}

#[test]
fn charts_obey_their_laws_where_there_is_a_direction() {
    let mut random = Lcg::new(3);
    let charts: [&dyn fusion::core::chart::Chart; 4] = [
        &Rodrigues,
        &fusion::core::chart::Body,
        &fusion::core::chart::AdditiveEuler,
        &fusion::core::chart::Invariant::right(),
    ];
    for _ in 0..30 {
        let layout = layout(&mut random);
        let delta: Vec<f64> = (0..5).map(|_| 0.3 * random.signed()).collect();
        for chart in charts {
            check_chart(&layout, chart, layout.initial(), &delta).unwrap();
        }
    }
}

/// A summary of a design with settings.
fn summary(design: &str, set: &[&str], rows: Option<(&str, Columns)>, out: Option<PathBuf>, smooth: bool) -> Summary {
    own_backend::link();
    let selection = Selection {
        set: set.iter().map(|value| (*value).to_owned()).collect(),
        ..Selection::default()
    };
    let design = selection.load(design).unwrap_or_else(|d| panic!("{d}"));
    let mut options = Options { out, ..Options::default() };
    if smooth {
        options.smooth = Smoothing::Whole(Keep::Memory);
    }
    if let Some((name, rows)) = rows {
        options.rows.insert(name.to_owned(), rows.into());
    }
    run(&design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"))
}

#[test]
fn a_design_takes_chart_rule_and_form_of_this_crate_by_name() {
    let plain = summary(CAR, &["run.stop=60 s"], None, None, false);
    let rms = |s: &Summary| s.score().unwrap().position_rmse_m.unwrap();
    for (key, name, apart) in [
        // Another way to store P: rounding. Another chart: the second order of small corrections.
        ("form", "packed", 1e-6),
        ("chart", "rodrigues", 0.02),
        ("update", "twice", 0.02),
    ] {
        let own = summary(CAR, &["run.stop=60 s", &format!("filter.{key}={name:?}")], None, None, false);
        assert!(own.computation().backend.contains(name), "{}", own.computation().backend);
        let (a, b) = (rms(&plain), rms(&own));
        assert!((a - b).abs() < apart * a, "{name}: {a} and {b}");
    }
}

#[test]
fn the_command_knows_the_names_and_tells_them_after_a_wrong_one() {
    let fusion = |args: &[&str]| {
        let ran = Command::new(env!("CARGO_BIN_EXE_own-backend")).args(args).output().unwrap();
        (
            ran.status.success(),
            String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr),
        )
    };
    let (is_ok, told) = fusion(&["check", CAR, "--backend", "rodrigues+twice+packed"]);
    assert!(is_ok && told.contains("rodrigues / twice / packed"), "{told}");
    let (is_ok, told) = fusion(&["check", CAR, "--set", "filter.chart=\"rodriguez\""]);
    assert!(!is_ok && told.contains("did you mean `rodrigues`?"), "{told}");
    let (_, schema) = fusion(&["schema"]);
    assert!(schema.contains("\"The lower triangle of P, row by row.\""));
    let (is_ok, told) = fusion(&["check", OWN]);
    assert!(is_ok && told.contains("direction"), "{told}");
}

/// Rows of the camera, and the true directions: a random walk of 0.05 rad/√s, measured to 0.1 at 10 Hz.
fn light(seed: u64) -> (Columns, Vec<Vector3<f64>>) {
    let mut random = StdRng::seed_from_u64(seed);
    let mut normal = |sigma: f64| -> f64 { sigma * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut random) };
    let step = |u: &Vector3<f64>, delta: [f64; 2]| {
        let mut x = [u.x, u.y, u.z];
        Kind::Custom(Direction::SPACE).plus(&mut x, &delta);
        Vector3::from(x)
    };
    // The start is drawn from the declared belief, 20° about straight up.
    let mut u = step(&Vector3::z(), [normal(0.349), normal(0.349)]);
    let (mut truth, mut columns) = (Vec::new(), [const { Vec::new() }; 4]);
    for k in 0..600 {
        u = step(&u, [normal(0.05 * 0.1_f64.sqrt()), normal(0.05 * 0.1_f64.sqrt())]);
        if u.z < -0.5 {
            break;
        }
        truth.push(u);
        columns[0].push(0.1 * f64::from(k));
        (0..3).for_each(|i| columns[i + 1].push(u[i] + normal(0.1)));
    }
    let names = ["t_s", "x", "y", "z"].into_iter().zip(columns);
    (names.fold(Columns::default(), |all, (name, column)| all.with(name, column)), truth)
}

/// Squared error over variance on average over both axes, and RMS error \[rad\], of a file of estimates.
fn judged(file: &str, truth: &[Vector3<f64>]) -> (f64, f64) {
    let mut lines = file.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = |name: &str| names.iter().position(|n| *n == name).unwrap();
    let columns = [
        "t_s",
        "direction_x",
        "direction_y",
        "direction_z",
        "sigma_direction_0",
        "sigma_direction_1",
    ]
    .map(at);
    let (mut nees, mut squares, mut count) = (0.0, 0.0, 0.0);
    for line in lines {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        let [t, x, y, z, s0, s1] = columns.map(|k| cells[k]);
        let estimate = Vector3::new(x, y, z);
        let d = basis(&estimate).transpose() * truth[(t * 10.0).round() as usize];
        nees += 0.5 * ((d.x / s0).powi(2) + (d.y / s1).powi(2));
        (squares, count) = (squares + d.norm_squared(), count + 1.0);
    }
    assert!(count > 300.0, "{count}");
    (nees / count, (squares / count).sqrt())
}

#[test]
fn a_direction_is_estimated_honestly_by_every_backend_and_smoothed() {
    const SEEDS: u64 = 12;
    let backends = [
        "",
        "filter.backend=\"iekf\"",
        "filter.backend=\"ukf\"",
        "filter.reset=\"full\"",
        "filter.form=\"udu\"",
        "filter.form=\"square_root\"",
        "filter.form=\"packed\"",
        "filter.update=\"twice\"",
    ];
    let folder = std::env::temp_dir().join(format!("own-backend-{}", std::process::id()));
    for set in backends {
        let (mut nees, mut rms, mut smoothed) = (0.0, 0.0, 0.0);
        for seed in 0..SEEDS {
            let (rows, truth) = light(seed);
            let settings: Vec<&str> = [set].into_iter().filter(|set| !set.is_empty()).collect();
            let out = folder.join("out");
            let _ = fs::remove_dir_all(&out);
            // Sigma points and a gain that is not optimal cannot be smoothed here by name alone.
            let smooth = !set.contains("ukf");
            summary(OWN, &settings, Some(("camera", rows)), Some(out.clone()), smooth);
            let (own, error) = judged(&fs::read_to_string(out.join("estimates.csv")).unwrap(), &truth);
            (nees, rms) = (nees + own / SEEDS as f64, rms + error / SEEDS as f64);
            if smooth {
                smoothed += judged(&fs::read_to_string(out.join("smoothed.csv")).unwrap(), &truth).1 / SEEDS as f64;
            }
        }
        // 12 seeds, 2 axes, one independent error per half second of 60 s: 2,900 of them, 1σ of the mean 0.026.
        assert!((nees - 1.0).abs() < 0.1, "{set}: NEES {nees}");
        assert!(rms < 0.07, "{set}: {rms} rad of 0.1");
        assert!(set.contains("ukf") || smoothed < 0.8 * rms, "{set}: {smoothed} of {rms}");
    }
    let _ = fs::remove_dir_all(&folder);
}
