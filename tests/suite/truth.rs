//! True values that differ from those of the filter: `truth` of simulated sensors, and the simulated water.

use crate::support::{Workspace, stderr};
use fusion::config::Document;
use fusion::design::Design;
use fusion::run::{FinalState, Options, run};

/// A car on a lawn-mower path. Its fixes are exact except for a lever arm; the declared noise is 5 cm.
const DRIVE: &str = r#"
[run]
origin = { latitude = "47 deg", longitude = "8 deg", height = "400 m" }
seed = 1
[process]
type = "strapdown"
source = "imu"
gyro.noise = "0.05 deg/sqrt(h)"
accelerometer.noise = "0.05 m/s/sqrt(h)"
[sensor.gnss]
type = "gnss_position"
source = "gnss"
lever_arm = [0, 0, 0]
noise = { sigma = "5 cm" }
[initial.start]
type = "explicit"
position_sigma = "10 cm"
velocity = [0, 0, 0]
velocity_sigma = "0.1 m/s"
attitude = [0, 0, "30 deg"]
attitude_sigma = "0.5 deg"
[simulation]
imu = { rate = "100 Hz", gyro = { noise = "0.05 deg/sqrt(h)" }, accelerometer = { noise = "0.05 m/s/sqrt(h)" } }
start = { heading = "30 deg" }
trajectory = [
    { type = "straight", distance = "100 m", speed = "5 m/s", acceleration = "1 m/s^2" },
    { type = "turn", angle = "180 deg", radius = "15 m" },
    { type = "straight", distance = "100 m" },
    { type = "turn", angle = "-180 deg", radius = "15 m" },
    { type = "straight", distance = "100 m" },
]
[simulation.sensor.gnss]
rate = "5 Hz"
white = "5 cm"
[variant.arm.sensor.gnss]
lever_arm = ["2 m", 0, 0]
"#;
const ESTIMATED: &str = "sensor.gnss.lever_arm={ estimate = true, initial = [0, 0, 0], sigma = \"2 m\" }";
const TRULY: &str = "simulation.sensor.gnss.truth={ lever_arm = [\"1.5 m\", \"-0.8 m\", \"-1 m\"] }";

fn design(text: &str, sets: &[&str]) -> Design {
    let (mut document, mistakes) = Document::parse("truth.toml", text);
    assert!(mistakes.is_empty(), "{mistakes:?}");
    sets.iter().for_each(|set| document.set(set).unwrap());
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

/// RMS of the horizontal error \[m\], and the estimated parameters.
fn ran(text: &str, sets: &[&str]) -> (f64, Vec<FinalState>) {
    let summary = run(&design(text, sets), &Options::default(), &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
    (summary.score().unwrap().horizontal_rms, summary.parameters().to_vec())
}

#[test]
fn a_filter_that_is_wrong_about_a_lever_arm_is_off_by_it() {
    // The right lever arm, 0 or not.
    let right = ran(DRIVE, &[]).0;
    assert!(right < 0.1, "{right}");
    let both = ran(DRIVE, &["sensor.gnss.lever_arm=[\"1.5 m\", \"-0.8 m\", \"-1 m\"]"]).0;
    assert!(both < 0.1, "{both}");
    // A horizontal error of 1.7 m, the offset of the antenna. In turns the antenna swings. The filter attributes this
    // to the body, which also turns the velocity: up to a fifth more.
    let wrong = ran(DRIVE, &[TRULY]).0;
    assert!((1.5..2.05).contains(&wrong), "{wrong}");
}

#[test]
fn an_estimated_parameter_finds_what_is_said_to_be_true_and_is_not_drawn() {
    for draws in ["false", "true"] {
        let (rms, estimated) = ran(DRIVE, &[ESTIMATED, TRULY, &format!("simulation.draw_parameters={draws}")]);
        assert!(rms < 0.15, "{rms}");
        let arm = estimated.iter().find(|e| e.name == "gnss.lever_arm").unwrap();
        for (i, truth) in [1.5, -0.8, -1.0].into_iter().enumerate() {
            // Within 4σ of the true value, except one in 16,000. A draw of 2 m would be far off.
            let off = (arm.value[i] - truth).abs();
            assert!(off < 4.0 * arm.sigma[i], "{i}: {off} of {}", arm.sigma[i]);
        }
        // Forward and right become observable in turns.
        assert!(arm.sigma[0] < 0.1 && arm.sigma[1] < 0.1, "{:?}", arm.sigma);
    }
}

#[test]
fn a_latency_that_the_filter_does_not_know_is_half_a_metre_at_five_metres_per_second() {
    let late = ran(DRIVE, &["simulation.sensor.gnss.truth={ time_offset = \"100 ms\" }"]).0;
    assert!((0.4..0.55).contains(&late), "{late}");
    let known = ran(DRIVE, &["sensor.gnss.time_offset=100 ms"]).0;
    assert!(known < 0.1, "{known}");
}

/// A log through water that the filter assumes to be still, without fixes: the error grows with the current.
const DRIFT: &str = r#"
[sensor.log]
type = "body_velocity"
source = "log"
current = [0, 0, 0]
noise = { sigma = "2 cm/s" }
[simulation.sensor.log]
rate = "5 Hz"
white = "2 cm/s"
"#;

#[test]
fn water_that_the_filter_takes_for_still_carries_the_boat_all_the_same() {
    let text = DRIVE.replace("[initial.start]", &format!("{DRIFT}[initial.start]"));
    let blind = ["sensor.gnss.enabled=false"];
    let still = ran(&text, &blind).0;
    let sea = [blind[0], "simulation.sea={ current = [\"0.3 m/s\", 0, 0] }"];
    let carried = ran(&text, &sea).0;
    // 0.3 m/s over T = 85 s: an RMS of 0.3·T/√3 = 14.7 m. Still water: the effect of 2 cm/s of white noise.
    assert!(still < 1.0 && (12.0..16.5).contains(&carried), "{still} {carried}");
    // Without the key `current` it is a log over ground.
    let ground = ran(&text.replace("current = [0, 0, 0]\n", ""), &sea).0;
    assert!(ground < 1.0, "{ground}");
    // The current turns within the run: its mean counts.
    let turning = [
        blind[0],
        "simulation.sea={ current = [\"0.3 m/s\", 0, 0], tide = [{ at = \"85 s\", current = [\"-0.3 m/s\", 0, 0] }] }",
    ];
    let returned = ran(&text, &turning).0;
    // 0.3·(t − t²/T): at most 6.4 m, in the middle; RMS 6.4·√(8/15) = 4.7 m.
    assert!((3.7..5.5).contains(&returned), "{returned}");
    // The tide is also true for a filter that estimates it.
    let learns = "sensor.log.current={ estimate = true, initial = [0, 0, 0], sigma = [\"0.5 m/s\", \"0.5 m/s\", 0], random_walk = \"2 cm/s/sqrt(s)\" }";
    let (rms, estimated) = ran(&text, &[turning[1], learns]);
    let water = estimated.iter().find(|e| e.name == "log.current").unwrap();
    // Within 4σ, as above. The random walk keeps σ at some centimetres per second.
    assert!(
        (water.value[0] + 0.3).abs() < 4.0 * water.sigma[0] && water.sigma[0] < 0.1,
        "{:?} ± {:?}",
        water.value,
        water.sigma
    );
    assert!(rms < 0.2, "{rms}");
}

#[test]
fn a_declination_that_was_left_out_turns_the_heading_by_it() {
    let w = Workspace::new("truth-declination");
    w.fusion(&["new", "mine", "--from", "boat"]).success();
    let heading = |sets: &[&str]| {
        w.fusion(&[&["run", "mine.toml", "--out", "out"], sets].concat()).success();
        let summary: serde_json::Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
        summary["score"]["heading_rmse_deg"].as_f64().unwrap()
    };
    let right = heading(&[]);
    // A parameter that may be left out gives the Earth's field: `truth` accepts it all the same. A boat with a velocity
    // receiver has little other information about its heading.
    let wrong = heading(&["--set", "simulation.sensor.magnetometer.truth.declination=11.5 deg"]);
    assert!(right < 1.5 && wrong > right + 2.0 && wrong < 9.0, "{right}° {wrong}°");
}

/// A value that is not a parameter, and a value in its own table.
#[test]
fn a_compass_has_a_declination_and_a_deviation_that_the_filter_does_not_know() {
    let compass = DRIVE.replace(
        "[initial.start]",
        "[sensor.compass]\ntype = \"heading\"\nsource = \"compass\"\nnoise = { sigma = \"0.5 deg\" }\n[initial.start]",
    );
    let compass = compass.replace(
        "[variant.arm",
        "[simulation.sensor.compass]\nrate = \"5 Hz\"\nwhite = \"0.5 deg\"\n[variant.arm",
    );
    let heading = |truth: &[&str]| {
        let summary = run(&design(&compass, truth), &Options::default(), &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
        summary.score().unwrap().heading_rmse_deg.unwrap()
    };
    // Fixes of 5 cm and gyros determine the heading to some tenths of a degree. The compass, 5 Hz with 0.5°, is used
    // all the same.
    let right = heading(&[]);
    let declined = heading(&["simulation.sensor.compass.truth.declination=8 deg"]);
    let deviates = heading(&["simulation.sensor.compass.truth.deviation.sin=8 deg"]);
    assert!(right < 0.3 && declined > 2.0 && deviates > 1.0, "{right} {declined} {deviates}");
}

#[test]
fn mistakes_of_a_truth_are_shown_at_their_place() {
    let w = Workspace::new("truth-mistakes");
    for (truth, said) in [
        ("lever_rm = [0, 0, 0]", "did you mean `lever_arm`?"),
        ("noise = \"1 m\"", "`noise` is no figure of `gnss`"),
        ("lever_arm = [0, 0]", "3"),
        ("lever_arm = [0, 0, \"1 s\"]", "length"),
        (
            "lever_arm = { estimate = true, initial = [0, 0, 0], sigma = 1 }",
            "what is true is a value",
        ),
    ] {
        w.write(
            "drive.toml",
            DRIVE.replace("[variant.arm", &format!("truth = {{ {truth} }}\n[variant.arm")),
        );
        let shown = stderr(&w.fusion(&["check", "drive.toml"]).code(2));
        assert!(shown.contains(said) && shown.contains("drive.toml:35:"), "{truth}: {shown}");
        assert_eq!(shown.matches("error:").count(), 1, "{truth}: {shown}");
    }
}

#[test]
fn whoever_changes_the_instrument_with_the_belief_is_told() {
    let w = Workspace::new("truth-shared");
    w.write("drive.toml", DRIVE);
    const TOLD: &str = "the simulated instrument `gnss` has this `lever_arm` too";
    let said = |args: &[&str]| stderr(&w.fusion(args).success());
    assert!(!said(&["run", "drive.toml"]).contains(TOLD));
    let by_variant = said(&["run", "drive.toml", "--variant", "arm"]);
    assert!(by_variant.contains(TOLD) && by_variant.contains("drive.toml:36:"), "{by_variant}");
    assert!(said(&["run", "drive.toml", "--set", "sensor.gnss.lever_arm=[1, 0, 0]"]).contains(TOLD));
    let truth = ["--set", "simulation.sensor.gnss.truth.lever_arm=[0, 0, 0]"];
    assert!(!said(&[&["run", "drive.toml", "--variant", "arm"], &truth[..]].concat()).contains(TOLD));
    // An estimated parameter cannot be a wrong declaration.
    assert!(!said(&["run", "drive.toml", "--set", ESTIMATED]).contains(TOLD));
    // The same holds for a table with an estimated part.
    let compass = "[sensor.compass]\ntype = \"heading\"\nsource = \"compass\"\nnoise = { sigma = \"0.5 deg\" }\n[initial.start]";
    let simulated = "[simulation.sensor.compass]\nrate = \"5 Hz\"\nwhite = \"0.5 deg\"\n[variant.arm";
    w.write(
        "compass.toml",
        DRIVE.replace("[initial.start]", compass).replace("[variant.arm", simulated),
    );
    let deviates = |sin: &str| {
        said(&[
            "run",
            "compass.toml",
            "--set",
            &format!("sensor.compass.deviation={{ sin = {sin} }}"),
        ])
    };
    assert!(deviates("\"2 deg\"").contains("has this `deviation` too"));
    assert!(!deviates("{ estimate = true, initial = 0, sigma = \"3 deg\" }").contains("has this `deviation` too"));
}

#[test]
fn a_preset_that_the_figures_of_a_part_leave_nothing_of_is_told() {
    let w = Workspace::new("truth-preset");
    w.fusion(&["new", "mine", "--from", "person"]).success();
    let said = |args: &[&str]| stderr(&w.fusion(&[&["run", "mine.toml"], args].concat()).success());
    let idle = said(&["--set", "simulation.imu.preset=perfect"]);
    assert!(idle.contains("the preset \"perfect\" changes nothing"), "{idle}");
    assert!(!said(&[]).contains("preset"));
}
