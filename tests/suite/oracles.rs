//! Closed forms of inertial navigation, compared with an assembled filter that is fed sample by sample.
//!
//! Free drift   of a static unit with R0 = √(RM RN), ω_s = √(g/R0):
//!              accelerometer bias b: (b/ω_s²)(1 − cos ω_s t); level gyro bias ε: R0 ε (t − sin ω_s t/ω_s);
//!              tilt θ: ½ g θ t²; velocity random walk N: N √(t³/3)
//! Coning       φ = α(0, cos Ωt, sin Ωt), x = ΩT: the remainder of the drift with an interval T, ½α²Ω(1 − sin x/x)
//! Source       Groves 2013, §5.7 for free drift; Titterton and Weston 2004, §11.3 for coning

use fusion::Navigator;
use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::core::belief::Belief;
use fusion::core::filter::Verdict;
use fusion::core::geometry::{so3, wgs84::Geodetic};
use fusion::core::runner::Event;
use fusion::core::state::wrap;
use fusion::core::time::Time;
use fusion::design::Design;
use fusion::models::earth::{Gravity, LocalEarth};
use fusion::rows::Nobody;
use fusion::solution::Solution;
use fusion::world::SimulatedRows;
use nalgebra::{UnitQuaternion, Vector3};

type V = Vector3<f64>;

const MILLI_G: f64 = 9.80665e-3;
const DEG_PER_HOUR: f64 = core::f64::consts::PI / 180.0 / 3600.0;
const EARTH_RATE: f64 = 7.292_115e-5;

/// Free inertial navigation from a known start at the site; `keys` are added to the process.
fn ins(keys: &str, rpy: [f64; 3]) -> Navigator {
    let text = format!(
        r#"
[run]
origin = {{ latitude = "36.098277778 deg", longitude = "129.449944444 deg" }}
[process]
type = "strapdown"
source = "imu"
gyro.noise = 0
{keys}
[initial.known]
type = "explicit"
position_sigma = 0
velocity = [0, 0, 0]
velocity_sigma = 0
attitude = {rpy:?}
attitude_sigma = 0
"#
    );
    Navigator::from_toml(&text).unwrap_or_else(|e| panic!("{e}"))
}

fn site() -> Geodetic {
    Geodetic::new(36.098_277_778_f64.to_radians(), 129.449_944_444_f64.to_radians(), 0.0)
}

/// The readings of perfect sensors on a body at rest at the site.
fn at_rest(q: &UnitQuaternion<f64>) -> (V, V) {
    let earth = LocalEarth::at(&site());
    let gravity = V::new(0.0, 0.0, earth.gravity(Gravity::Somigliana));
    (q.inverse() * earth.earth_rate_n(), q.inverse() * -gravity)
}

/// Feeds samples of `dt_ms` from `imu(from, to)`, their interval in seconds. The first sample opens the first interval.
/// `see` receives each whole step.
fn fly(nav: &mut Navigator, dt_ms: i64, steps: i64, imu: impl Fn(f64, f64) -> (V, V), mut see: impl FnMut(i64, Solution)) {
    let stream = nav.stream("imu").unwrap();
    let seconds = |k: i64| (k * dt_ms) as f64 * 1e-3;
    for k in 0..=steps {
        let (w, f) = imu(seconds(k - 1), seconds(k));
        let row = [w.x, w.y, w.z, f.x, f.y, f.z];
        nav.feed_stream(stream, Time::from_nanos(k * dt_ms * 1_000_000), &row, &mut |_: &Event<'_>| {})
            .unwrap();
        see(k, nav.solution().unwrap());
    }
}

/// Displacement north and east \[m\] at `times` \[s\], with the errors added to the readings of a level body at rest
/// that heads north.
fn drift(rpy: [f64; 3], w_error: V, f_error: V, times: &[i64]) -> Vec<V> {
    let (w, f) = at_rest(&UnitQuaternion::identity());
    let mut out = Vec::new();
    let last = times.iter().max().unwrap() * 10;
    fly(
        &mut ins("accelerometer.noise = 0", rpy),
        100,
        last,
        |_, _| (w + w_error, f + f_error),
        |k, now| {
            if k % 10 == 0 && times.contains(&(k / 10)) {
                out.push(now.position.unwrap().0.difference(&site()));
            }
        },
    );
    out
}

/// Half of the last printed digit, and (Ωt)² of the value. The closed forms ignore the rotation of the Earth, which
/// couples north, east and heading by Ωt twice before it affects the same axis again.
fn assert_printed(got: f64, printed: f64, half_digit: f64, t: i64) {
    let allowed = half_digit + printed.abs() * (EARTH_RATE * t as f64).powi(2);
    assert!(
        (got - printed).abs() < allowed,
        "{got} against {printed} at {t} s, {allowed} allowed"
    );
}

#[test]
fn free_drift_of_1_mg_is_17_644_m_after_60_s() {
    let times = [10, 60, 300, 600];
    let north = drift([0.0; 3], V::zeros(), V::new(MILLI_G, 0.0, 0.0), &times);
    let east = drift([0.0; 3], V::zeros(), V::new(0.0, MILLI_G, 0.0), &times);
    let printed = [(0.4903, 5e-5), (17.644, 5e-4), (436.2, 0.05), (1685.0, 0.5)];
    for (k, (want, half_digit)) in printed.into_iter().enumerate() {
        assert_printed(north[k].x, want, half_digit, times[k]);
        assert_printed(east[k].y, want, half_digit, times[k]);
    }
}

#[test]
fn free_drift_of_1_deg_per_h_about_east_is_1_710_m_to_the_south_after_60_s() {
    let times = [60, 600];
    let east = drift([0.0; 3], V::new(0.0, DEG_PER_HOUR, 0.0), V::zeros(), &times);
    let north = drift([0.0; 3], V::new(DEG_PER_HOUR, 0.0, 0.0), V::zeros(), &times);
    for (k, (want, half_digit)) in [(1.710, 5e-4), (1663.0, 0.5)].into_iter().enumerate() {
        assert_printed(east[k].x, -want, half_digit, times[k]);
        assert_printed(north[k].y, want, half_digit, times[k]);
    }
}

#[test]
fn free_drift_of_a_tilt_of_0_1_deg_is_0_855_m_after_10_s() {
    let tilt = 0.1_f64.to_radians();
    let times = [5, 10];
    // With the nose down in the estimate, the upward force seems to push forward; with the left side down, to the
    // right.
    let north = drift([0.0, -tilt, 0.0], V::zeros(), V::zeros(), &times);
    let east = drift([tilt, 0.0, 0.0], V::zeros(), V::zeros(), &times);
    for (k, want) in [0.214, 0.855].into_iter().enumerate() {
        assert_printed(north[k].x, want, 5e-4, times[k]);
        assert_printed(east[k].y, want, 5e-4, times[k]);
    }
}

/// The HG1700's.
const VELOCITY_RANDOM_WALK: &str = r#"accelerometer.noise = "0.065 fps/sqrt(h)""#;

#[test]
fn velocity_random_walk_of_0_065_fps_per_root_h_predicts_0_0886_m_after_60_s() {
    let (w, f) = at_rest(&UnitQuaternion::identity());
    let mut nav = ins(VELOCITY_RANDOM_WALK, [0.0; 3]);
    fly(&mut nav, 10, 6000, |_, _| (w, f), |_, _| {});
    let p = nav.solution().unwrap().position.unwrap().1;
    for sigma in [p.m11.sqrt(), p.m22.sqrt()] {
        // Half of the last digit, and the return of (ω_s t)²/10 = 0.06 % that N √(t³/3) ignores.
        assert!((sigma - 0.0886).abs() < 1e-4, "{sigma}");
    }
}

#[test]
fn velocity_random_walk_of_0_065_fps_per_root_h_scatters_by_0_0886_m_after_60_s() {
    let text = format!(
        r#"
[run]
origin = {{ latitude = "36.098277778 deg", longitude = "129.449944444 deg" }}
[process]
type = "strapdown"
source = "imu"
gyro.noise = 0
{VELOCITY_RANDOM_WALK}
[initial.known]
type = "explicit"
position_sigma = 0
velocity = [0, 0, 0]
velocity_sigma = 0
attitude = [0, 0, 0]
attitude_sigma = 0
[simulation]
imu = {{ rate = "10 Hz", accelerometer = {{ noise = "0.065 fps/sqrt(h)" }} }}
trajectory = [{{ type = "rest", duration = "60 s" }}]
"#
    );
    let runs = 400;
    let square: f64 = (1..=runs)
        .map(|seed| {
            let d = simulated(&text, seed)
                .nav
                .solution()
                .unwrap()
                .position
                .unwrap()
                .0
                .difference(&site());
            d.x * d.x + d.y * d.y
        })
        .sum();
    let sigma = (square / (2 * runs) as f64).sqrt();
    // 8 %: 1/√(2·800) = 2.5 % of 1σ.
    assert!((sigma / 0.0886 - 1.0).abs() < 0.08, "{sigma}");
}

#[test]
fn a_static_minute_without_noise_drifts_less_than_a_micrometre_in_every_integrator() {
    let rpy = [0.1, -0.2, 2.0];
    let (w, f) = at_rest(&so3::from_rpy(rpy[0], rpy[1], rpy[2]));
    for integrator in ["one_sample", "two_sample", "first_order"] {
        let mut nav = ins(&format!("accelerometer.noise = 0\nintegrator = '{integrator}'"), rpy);
        fly(&mut nav, 10, 6000, |_, _| (w, f), |_, _| {});
        let solution = nav.solution().unwrap();
        assert_eq!(solution.time, Time::from_seconds(60.0));
        // 1e-6 m: the required figure.
        let gone = solution.position.unwrap().0.difference(&site()).norm();
        assert!(gone < 1e-6, "{integrator}: {gone:e}");
    }
}

/// Residual drift \[deg/h\] about the cone axis over a minute of coning of 1° at 5 Hz.
fn coning(integrator: &str, dt_ms: i64) -> f64 {
    let (alpha, omega) = (1_f64.to_radians(), 5.0 * core::f64::consts::TAU);
    let truth = |t: f64| so3::exp(&V::new(0.0, alpha * (omega * t).cos(), alpha * (omega * t).sin()));
    let angle = |t: f64| {
        let (s, c) = (omega * t).sin_cos();
        V::new(-2.0 * omega * (alpha / 2.0).sin().powi(2) * t, alpha.sin() * c, alpha.sin() * s)
    };
    let imu = |from: f64, to: f64| {
        // Earth rate and gravity, rotated through the body by the cone: Simpson over eight parts.
        let (mut w, mut f) = (V::zeros(), V::zeros());
        for k in 0..=8 {
            let weight = if k == 0 || k == 8 { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
            let (earth, force) = at_rest(&truth(from + (to - from) * f64::from(k) / 8.0));
            w += earth * (weight / 24.0);
            f += force * (weight / 24.0);
        }
        (w + (angle(to) - angle(from)) / (to - from), f)
    };
    let keys = format!("accelerometer.noise = 0\nintegrator = '{integrator}'");
    let mut nav = ins(&keys, [0.0, alpha, 0.0]);
    fly(&mut nav, dt_ms, 60_000 / dt_ms, imu, |_, _| {});
    let error = so3::log(&(nav.solution().unwrap().attitude.unwrap().0 * truth(60.0).inverse()));
    (error.x / 60.0 / DEG_PER_HOUR).abs()
}

#[test]
fn coning_residual_of_each_integrator_is_16_15_or_0_317_or_0_0200_deg_per_h() {
    // The pair of samples of 5 ms is the interval of 10 ms.
    for (integrator, dt_ms, printed) in [("first_order", 10, 16.15), ("one_sample", 10, 0.317), ("two_sample", 5, 0.0200)] {
        let got = coning(integrator, dt_ms);
        // 5 %: the closed forms are leading terms in x = ΩT = 0.31, the next is of order x².
        assert!((got / printed - 1.0).abs() < 0.05, "{integrator}: {got} against {printed}");
    }
}

/// A simulated run at its end.
struct Flown {
    nav: Navigator,
    accepted: u32,
    rejected: u32,
}

fn simulated(text: &str, seed: u64) -> Flown {
    let (document, mistakes) = Document::parse("oracle.toml", text);
    assert!(mistakes.is_empty());
    let design = Design::read(document).unwrap_or_else(|e| panic!("{e}"));
    let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap_or_else(|e| panic!("{e}"));
    let mut world =
        SimulatedRows::new(&design, design.simulation.as_ref().unwrap(), &assembly, Some(seed)).unwrap_or_else(|e| panic!("{e}"));
    let mut nav = Navigator::from_assembly(assembly);
    let (mut accepted, mut rejected) = (0, 0);
    let mut count = |event: &Event<'_>| {
        if let Event::Updated { update, .. } = event {
            match update.verdict {
                Verdict::Accepted => accepted += 1,
                Verdict::Rejected => rejected += 1,
                other => panic!("{other:?}"),
            }
        }
    };
    while let Some(row) = world.next(&mut Nobody) {
        nav.feed_stream(row.stream, row.time, row.values, &mut count).unwrap();
    }
    nav.finish(&mut count).unwrap();
    Flown { nav, accepted, rejected }
}

/// Five minutes of INS and GNSS without outliers, judged by the information of the filter only.
fn clean(gate: &str, seed: u64) -> Flown {
    let text = format!(
        r#"
[run]
origin = {{ latitude = "36.098277778 deg", longitude = "129.449944444 deg" }}
[process]
type = "strapdown"
source = "imu"
gyro.noise = "0.125 deg/sqrt(h)"
accelerometer.noise = "0.065 fps/sqrt(h)"
[sensor.gnss]
type = "gnss_position"
source = "gnss"
noise = {{ sigma = "1 m" }}
gate = {{ {gate} }}
[initial.known]
type = "explicit"
position_sigma = "0.1 m"
velocity = [0, 0, 0]
velocity_sigma = "0.01 m/s"
attitude = [0, 0, 0]
attitude_sigma = "0.05 deg"
[simulation]
imu = {{ rate = "20 Hz", gyro = {{ noise = "0.125 deg/sqrt(h)" }}, accelerometer = {{ noise = "0.065 fps/sqrt(h)" }} }}
trajectory = [
    {{ type = "rest", duration = "20 s" }},
    {{ type = "straight", distance = "500 m", speed = "5 m/s", acceleration = "1 m/s^2" }},
    {{ type = "turn", angle = "90 deg", radius = "30 m" }},
    {{ type = "straight", distance = "850 m" }},
]
[simulation.sensor.gnss]
rate = "1 Hz"
white = "1 m"
"#
    );
    simulated(&text, seed)
}

#[test]
fn a_gate_rejects_of_clean_fixes_its_false_reject_rate_and_otherwise_changes_nothing() {
    let runs = 12;
    let (mut fixes, mut nis, mut two_condition, mut moved) = (0, 0, 0, 0.0);
    for seed in 1..=runs {
        let open = clean("type = 'none'", seed);
        let belief = open.nav.belief().unwrap();
        fixes += open.accepted;
        assert_eq!(open.rejected, 0);

        let gated = clean("type = 'nis', probability = 0.99", seed);
        nis += gated.rejected;
        let d = place(gated.nav.belief().unwrap()).difference(&place(belief));
        let mut variances = belief.covariance.variances(&open.nav.layout().blocks()[0]);
        let mut variance = || variances.next().unwrap();
        moved += (d.x * d.x / variance() + d.y * d.y / variance()) / (2 * runs) as f64;

        let gated = clean("type = 'two_condition', sigma = '1 m', min_distance = '3 m'", seed);
        two_condition += gated.rejected;
        if gated.rejected == 0 {
            let same = gated.nav.belief().unwrap();
            assert_eq!((&same.x, &same.covariance), (&belief.x, &belief.covariance), "seed {seed}");
        }
    }
    // 1 % of the fixes, 4 σ of the binomial.
    let expected = 0.01 * f64::from(fixes);
    assert!((f64::from(nis) - expected).abs() < 4.0 * expected.sqrt(), "{nis} of {fixes}");
    // Those fixes have 4 % of the squared residuals (χ²₃ beyond 11.3 has a mean of 13.5). So without them the estimate
    // moves by about 4 % of its variance; three times that for the scatter over 24.
    assert!(moved < 0.12, "{moved}");
    // 0.05 %, as measured with this gate; 4 σ of the binomial.
    let expected = 5e-4 * f64::from(fixes);
    assert!(
        f64::from(two_condition) < expected + 4.0 * expected.sqrt(),
        "{two_condition} of {fixes}"
    );
    assert!(two_condition < runs as u32, "no run was without a rejection, none was compared");
}

fn place(belief: &Belief) -> Geodetic {
    Geodetic::new(belief.x[0], belief.x[1], belief.x[2])
}

/// Yaw \[rad\] minus `heading` after ten minutes at rest with a compass that reads 2° to either side in turn, and the
/// largest residual \[rad\] in between.
fn compass_at(heading: f64) -> (f64, f64) {
    let text = format!(
        r#"
[run]
origin = {{ latitude = "36.098277778 deg", longitude = "129.449944444 deg" }}
[process]
type = "strapdown"
source = "imu"
gyro.noise = "0.125 deg/sqrt(h)"
accelerometer.noise = "0.065 fps/sqrt(h)"
[sensor.compass]
type = "heading"
source = "compass"
noise = {{ sigma = "2 deg" }}
[initial.known]
type = "explicit"
position_sigma = 0
velocity = [0, 0, 0]
velocity_sigma = 0
attitude = [0, 0, {heading}]
attitude_sigma = [0, 0, "3 deg"]
"#
    );
    let mut nav = Navigator::from_toml(&text).unwrap_or_else(|e| panic!("{e}"));
    let (imu, compass) = (nav.stream("imu").unwrap(), nav.stream("compass").unwrap());
    let (w, f) = at_rest(&so3::from_rpy(0.0, 0.0, heading));
    let mut largest = 0.0_f64;
    let mut see = |event: &Event<'_>| {
        if let Event::Updated { update, .. } = event {
            largest = largest.max(update.residual[0].abs());
        }
    };
    for k in 0..=600 {
        let time = Time::from_nanos(k * 1_000_000_000);
        nav.feed_stream(imu, time, &[w.x, w.y, w.z, f.x, f.y, f.z], &mut see).unwrap();
        let side = if k % 2 == 0 { 2_f64 } else { -2.0 };
        nav.feed_stream(compass, time, &[wrap(heading + side.to_radians())], &mut see)
            .unwrap();
    }
    nav.finish(&mut see).unwrap();
    let yaw = nav.solution().unwrap().rpy().unwrap().0.z;
    (wrap(yaw - heading), largest)
}

#[test]
fn a_heading_about_plus_minus_180_deg_is_filtered_as_one_about_north() {
    let (north, south) = (compass_at(0.0), compass_at(core::f64::consts::PI));
    // 1e-9 rad: rounding of π, 1e-16, without amplification in 600 updates.
    assert!(
        (north.0 - south.0).abs() < 1e-9 && (north.1 - south.1).abs() < 1e-9,
        "{north:?} {south:?}"
    );
    // The estimate stays between the readings, 4° apart. The last of 600 has an excess weight of 2°/600.
    assert!(
        south.1 < 4_f64.to_radians() && south.0.abs() < (2.0_f64 / 600.0).to_radians(),
        "{south:?}"
    );
}

#[test]
fn an_inertial_unit_of_1_hz_is_not_believed_more_than_one_of_100_hz() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps.toml");
    let mut document = Document::load(std::path::Path::new(file)).unwrap_or_else(|d| panic!("{d}"));
    document.set("simulation.imu.rate=1 Hz").unwrap();
    let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
    let options = fusion::run::Options::default();
    let campaign = fusion_judge::campaign::monte_carlo(&design, &options, 0..6, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
    // Expected 3. Without noise for the motion hidden within a second, attitude and velocity have 10 and 12. The rest
    // of the velocity NEES arises when a car starts to pull away or to turn: the sample before does not show this.
    for (k, quantity, most) in [(0, "position", 6.0), (1, "velocity", 9.0), (2, "attitude", 4.0)] {
        let nees = campaign.campaign.judge(fusion_judge::campaign::Statistic::Nees(k)).unwrap().mean;
        assert!(nees < most, "{quantity}: {nees}");
    }
}
