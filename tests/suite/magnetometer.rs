//! A magnetometer: a body with a magnetic field, and a magnet that approaches and leaves.

use super::real::real_design;
use fusion::config::Document;
use fusion::core::runner::Halt;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run, run};
use fusion_judge::campaign::{Statistic, monte_carlo};

/// Two circles with a bump between them, so that the body's field appears on all axes. Other sensors determine the
/// tilt, only the field determines the heading.
const CIRCLES: &str = r#"
[run]
origin = { latitude = "36.1 deg", longitude = "129.4 deg" }
[process]
type = "attitude_only"
source = "imu"
gyro_noise = "0.02 deg/sqrt(s)"
gyro_bias = { estimate = true, initial = [0, 0, 0], sigma = "0.1 deg/s" }
[sensor.level]
type = "attitude"
source = "level"
part = "tilt"
noise = { sigma = "0.5 deg" }
[sensor.field]
type = "magnetometer"
source = "field"
strength = "50 uT"
inclination = "51 deg"
declination = "-8 deg"
hard_iron = { estimate = true, initial = [0, 0, 0], sigma = "5 uT" }
noise = { sigma = "0.5 uT" }
[initial.start]
type = "explicit"
attitude = [0, 0, "30 deg"]
attitude_sigma = ["1 deg", "1 deg", "10 deg"]
[simulation]
imu = { rate = "50 Hz", gyro = { noise = "0.02 deg/sqrt(s)", bias = "0.1 deg/s" } }
draw_parameters = true
start = { heading = "30 deg" }
trajectory = [
    { type = "straight", duration = "10 s", speed = "5 m/s", acceleration = "1 m/s^2" },
    { type = "turn", angle = "180 deg", radius = "20 m" }, { type = "turn", angle = "180 deg", radius = "20 m" },
    { type = "bump", duration = "10 s", pitch = "30 deg" },
    { type = "turn", angle = "-180 deg", radius = "20 m" }, { type = "turn", angle = "-180 deg", radius = "20 m" },
]
[simulation.sensor.level]
rate = "10 Hz"
white = "0.5 deg"
[simulation.sensor.field]
rate = "10 Hz"
white = "0.5 uT"
"#;

fn design(sets: &[&str]) -> Design {
    let (mut document, errors) = Document::parse("circles.toml", CIRCLES);
    assert!(errors.is_empty(), "{errors:?}");
    sets.iter().for_each(|set| document.set(set).unwrap());
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

#[test]
fn hard_iron_is_found_while_the_body_turns_and_the_heading_is_then_the_true_one() {
    // The simulated body has a magnetic field, drawn with 5 uT per axis; the Earth's field is 50 uT.
    let campaign = |sets: &[&str]| monte_carlo(&design(sets), &Options::default(), 0..8, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
    let heading = |sets: &[&str]| campaign(sets).spread(|r| r.attitude_rms[2]).unwrap().mean;
    let nees = campaign(&[]).campaign.judge(Statistic::Nees(2)).unwrap();
    // 8 runs, correlated over a minute each: their band is 2.5 to 3.5. One third more for the nonlinearity of a start
    // with 10 deg of heading and 5 uT.
    assert!((2.2..4.5).contains(&nees.mean), "{nees:?}");
    // This includes the 10 deg of the start. An unestimated field of 5 uT, with 31 uT horizontal, causes 9 deg.
    let estimated = heading(&[]);
    assert!(estimated < 2.5, "{estimated} deg");
}

#[test]
fn the_hard_iron_that_was_drawn_is_found() {
    for seed in 1..=3 {
        let set = format!("run.seed={seed}");
        let summary = run(&design(&[&set]), &Options::default(), &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
        let score = summary.score().unwrap();
        let iron = score.blocks.iter().find(|block| block.name == "field.hard_iron").unwrap();
        for (error, sigma) in iron.error.iter().zip(&iron.sigma) {
            // From 5 uT to a fifth; the bound is 4σ of it.
            assert!(*sigma < 1e-6 && error.abs() < 4.0 * sigma, "{seed}: {iron:?}");
        }
        // The estimate differs from the declared value by more than its 1σ.
        let found = summary.parameters().iter().find(|p| p.name == "field.hard_iron").unwrap();
        assert!(
            found.value.iter().zip(&iron.sigma).any(|(value, sigma)| value.abs() > 3.0 * sigma),
            "{found:?}"
        );
    }
}

#[test]
fn the_strength_of_the_field_may_be_left_to_the_filter() {
    let sets = ["sensor.field.strength={ estimate = true, initial = '40 uT', sigma = '10 uT' }"];
    let summary = run(&design(&sets), &Options::default(), &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
    let score = summary.score().unwrap();
    assert!(score.nees_attitude.unwrap().mean < 6.0, "{:?}", score.nees_attitude);
}

/// Time \[s\] and heading error \[deg\] at every epoch of the reference: the rotation about down of q q_true⁻¹.
#[derive(Default)]
struct Headings(Vec<(f64, f64)>);

impl RunObserver for Headings {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Reference { epoch, error: Some(e), .. } = event
            && let Some(attitude) = &e.attitude
        {
            let turned = attitude.estimate * attitude.truth.inverse();
            self.0.push((epoch.time.seconds(), 2.0 * (turned.k / turned.w).atan().to_degrees()));
        }
        Ok(())
    }
}

impl Headings {
    fn of(design: &Design, options: &Options) -> Self {
        let mut headings = Self::default();
        let run = Run::open(design, options).unwrap_or_else(|d| panic!("{d}"));
        run.go(&mut [&mut headings], &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
        headings
    }

    /// The RMS from `from` to `to` \[s\].
    fn rms(&self, from: f64, to: f64) -> f64 {
        let chosen: Vec<f64> = self.0.iter().filter(|(t, _)| (from..to).contains(t)).map(|(_, e)| e * e).collect();
        assert!(!chosen.is_empty(), "no reference from {from} to {to} s");
        (chosen.iter().sum::<f64>() / chosen.len() as f64).sqrt()
    }
}

/// The last half second of the five seconds after a magnet left.
const RETURN: (f64, f64) = (4.5, 5.0);

#[test]
fn the_heading_returns_within_five_seconds_of_the_magnets_leaving() {
    // The gate of a compass checks the simulated field. The sensor `field` has no weight.
    const GATED: [&str; 4] = [
        "sensor.field.noise.sigma = '1000 uT'",
        "sensor.field.hard_iron = [0, 0, 0]",
        "stage.compass = { type = 'compass', source = 'field', gate = { smooth_over = '0.1 s', hold_off = '1 s' }, noise = { sigma = '0.5 uT', difference = 3 } }",
        "sensor.gated = { type = 'magnetometer', source = 'compass', strength = '50 uT', inclination = '51 deg', declination = '-8 deg', noise = { from_source = true } }",
    ];
    const MAGNET: &str = "simulation.sensor.field.fault.magnet={ type = 'spike', window = { from = '30 s', duration = '20 s' }, value = ['10 uT', '-15 uT', '5 uT'] }";
    let flown = |further: &[&str]| {
        let sets = [&GATED[..], &[MAGNET], further].concat();
        Headings::of(&design(&sets), &Options::default())
    };
    let gated = flown(&[]);
    let believing = flown(&["stage.compass.gate.enabled = false", "stage.compass.noise.difference = 0"]);
    let undisturbed = gated.rms(20.0, 30.0);
    let back = gated.rms(50.0 + RETURN.0, 50.0 + RETURN.1);
    // The field determines the heading to some 0.3°; 0.5° more is two of its σ.
    assert!(
        undisturbed < 1.0 && back < undisturbed + 0.5,
        "before {undisturbed}°, after {back}°"
    );
    // With gyros alone for 20 s, at 0.02 °/√s and a bias known to 0.03 °/s, the error is 0.6°. 18 µT of 31 µT turn the
    // heading by 30°.
    let (carried, turned) = (gated.rms(30.0, 50.0), believing.rms(30.0, 50.0));
    assert!(
        carried < 1.5 && turned > 5.0,
        "beside the magnet {carried}°, every field believed {turned}°"
    );
}

#[test]
fn the_heading_of_a_recorded_body_returns_within_five_seconds_of_leaving_a_magnet() {
    // The reference also counts while the body is at rest.
    let always = "source.truth.valid={ column = 't_s', at_least = 0 }";
    let Some((design, options)) = real_design("broad", &["trial_31"], &[always]) else {
        return;
    };
    let headings = Headings::of(&design, &options);
    let before = headings.rms(20.0, 30.0);
    // When the field, rotated by the optical attitude, again has its previous dip within 1°.
    for left in [43.7, 68.3, 91.0, 112.3, 142.0] {
        let (there, back) = (headings.rms(left - 1.0, left), headings.rms(left + RETURN.0, left + RETURN.1));
        // Before the magnet 1.1°, the difference between the field of the table and the reference. 0.5°: the worst of
        // the five is 0.4° above.
        assert!(back < before + 0.5, "left at {left} s: {there}° → {back}°, before {before}°");
    }
}
