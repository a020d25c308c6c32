//! Observability along a motion: published ranks, and the motion that identifies a state.

use crate::real::real_design;
use crate::support::{Workspace, page, stdout, titles};
use fusion::config::Document;
use fusion::design::Design;
use fusion::run::Options;
use fusion_judge::observability::{Cause, DECISIVE, Observability, State, observability};

/// Fifteen states without errors of the instruments, so that everything is linearised at the truth.
const FIFTEEN: &str = r#"
[run]
origin = { latitude = "36.1 deg", longitude = "129.4 deg", height = "10 m" }
[process]
type = "strapdown"
source = "imu"
gyro = { noise = "0.1 deg/sqrt(h)", bias = { estimate = true, initial = [0, 0, 0], sigma = "10 deg/h" } }
accelerometer = { noise = "50 ug/sqrt(Hz)", bias = { estimate = true, initial = [0, 0, 0], sigma = "1 mg" } }
[sensor.position]
type = "gnss_position"
source = "gnss"
noise = { sigma = "0.1 m" }
[sensor.velocity]
type = "gnss_velocity"
source = "gnss"
noise = { sigma = "0.05 m/s" }
[sensor.heading]
type = "attitude"
part = "heading"
source = "compass"
noise = { sigma = "1 deg" }
enabled = false
[sensor.attitude]
type = "attitude"
source = "ahrs"
noise = { sigma = "1 deg" }
enabled = false
[initial.start]
type = "explicit"
position_sigma = "10 m"
velocity = [0, 0, 0]
velocity_sigma = "1 m/s"
attitude = [0, 0, 0]
attitude_sigma = ["1 deg", "1 deg", "10 deg"]
[simulation]
trajectory = [{ type = "rest", duration = "60 s" }]
[simulation.imu]
rate = "50 Hz"
[simulation.sensor.position]
rate = "1 Hz"
[simulation.sensor.velocity]
rate = "1 Hz"
[simulation.sensor.heading]
rate = "1 Hz"
[simulation.sensor.attitude]
rate = "1 Hz"
"#;

const REST: &str = r#"{ type = "rest", duration = "60 s" }"#;
const QUARTER: &str = r#"{ type = "rotate_in_place", angle = "90 deg", rate = "30 deg/s" }"#;
const RUN: &str = r#"{ type = "straight", distance = "200 m", speed = "10 m/s", acceleration = "1 m/s^2" }"#;
const TURN: &str = r#"{ type = "turn", angle = "90 deg", radius = "15 m" }"#;

fn design(sets: &[&str]) -> Design {
    let (mut document, mistakes) = Document::parse("fifteen.toml", FIFTEEN);
    assert!(mistakes.is_empty(), "{mistakes:?}");
    sets.iter().for_each(|set| document.set(set).unwrap());
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

fn trajectory(segments: &[&str]) -> String {
    format!("simulation.trajectory=[{}]", segments.join(", "))
}

fn found(sets: &[&str], without: &[Vec<String>]) -> Observability {
    observability(&design(sets), &Options::default(), without, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"))
}

fn state<'a>(found: &'a Observability, name: &str) -> &'a State {
    let named = found.states.iter().find(|state| state.name == name);
    named.unwrap_or_else(|| panic!("{:?}", found.states.iter().map(|s| &s.name).collect::<Vec<_>>()))
}

/// The motion of the segment that identifies a state, and the factor.
fn by(found: &Observability, name: &str) -> (String, f64) {
    match found.identified_by(state(found, name)) {
        Some((Cause::Segment(number), factor)) => (found.segments[number].motion.clone(), factor),
        other => panic!("{name}: {other:?} {found:?}"),
    }
}

/// The exact ranks of stacked segments: Goshen-Meskin and Bar-Itzhack 1992 (IEEE TAES 28(4), 1056). For an acceleration
/// with unchanged heading they leave out terms of second order and have 14.
#[test]
fn the_ranks_of_fifteen_states_are_those_of_the_literature() {
    let heading = "sensor.heading.enabled=true";
    let attitude = "sensor.attitude.enabled=true";
    let turned = trajectory(&[REST, QUARTER, REST]);
    let run = trajectory(&[REST, RUN]);
    for (sets, rank) in [
        (&[][..], 12),
        (&[heading], 13),
        (&[attitude], 15),
        (&[&*turned], 15),
        (&[&*run], 15),
    ] {
        let found = found(sets, &[]);
        assert_eq!(
            (found.exact_rank, found.states.len()),
            (rank, 15),
            "{sets:?}: {:?}",
            found.singular_values
        );
        // Less is known in practice: the gyro bias about the vertical in all, and here it is 10 °/h.
        assert!(found.rank < 15, "{sets:?}");
    }
    let position = [
        "sensor.velocity.enabled=false",
        "process.gyro.bias=[0, 0, 0]",
        "process.accelerometer.bias=[0, 0, 0]",
    ];
    let nine = found(&position, &[]);
    assert_eq!((nine.exact_rank, nine.states.len()), (9, 9), "{:?}", nine.singular_values);
}

/// The paper calls one direction unobservable on a run straight ahead. Its singular value is the smallest, of second order.
#[test]
fn an_acceleration_without_a_turn_shows_one_direction_to_second_order_only() {
    let run = found(&[&trajectory(&[REST, RUN])], &[]);
    let last_two = &run.singular_values[13..];
    assert!(last_two[1] < 0.05 * last_two[0] && last_two[1] < 1.0, "{last_two:?}");
    assert!(state(&run, "accel bias y").left > 0.99);
    let least = &run.directions[0];
    let largest = least.components.iter().position(|c| *c == 1.0).unwrap();
    assert_eq!(run.states[largest].name, "accel bias y", "{least:?}");
}

#[test]
fn two_headings_tell_accelerometer_biases_from_tilt_and_the_turn_between_is_named() {
    let found = found(&[&trajectory(&[REST, QUARTER, REST])], &[]);
    for name in ["accel bias x", "accel bias y", "tilt about north"] {
        let (motion, factor) = by(&found, name);
        assert!(motion.starts_with("turns right by ") && factor >= 1.5, "{name}: {motion} {factor}");
    }
    assert!(!state(&found, "gyro bias z").is_identifiable());
}

#[test]
fn an_acceleration_identifies_the_heading_and_not_the_constant_speed_after_it() {
    let found = found(&[&trajectory(&[REST, RUN])], &[]);
    let (motion, factor) = by(&found, "heading");
    assert!(motion.starts_with("speeds up from 0") && factor >= 1.5, "{motion} {factor}");
}

#[test]
fn a_turn_identifies_a_lever_arm_except_its_height() {
    let lever = "sensor.position.lever_arm={ estimate = true, initial = [0, 0, 0], sigma = \"1 m\" }";
    let found = found(&[lever, &trajectory(&[REST, RUN, TURN, RUN])], &[]);
    for name in ["position lever arm x", "position lever arm y"] {
        let (motion, factor) = by(&found, name);
        assert!(motion.starts_with("turns right by ") && factor >= 1.5, "{name}: {motion} {factor}");
    }
    let height = state(&found, "position lever arm z");
    assert!(!height.is_identifiable() && found.identified_by(height).is_none(), "{height:?}");
    // It moves together with the height of the vehicle.
    let mut of_height = found.directions.iter().filter(|d| d.information < 1.0);
    let component = |components: &[f64], name: &str| {
        let place = found.states.iter().position(|s| s.name == name).unwrap();
        components[place]
    };
    assert!(
        of_height
            .any(|d| component(&d.components, "position lever arm z") == 1.0 && component(&d.components, "position down").abs() > 0.05),
        "{:?}",
        found.directions
    );
}

/// A recorded car in a town: many turns, none of which alone is decisive.
#[test]
fn the_turns_of_a_recorded_drive_identify_the_level_accelerometer_biases() {
    let Some((design, options)) = real_design("rtklib-drive", &[], &[]) else {
        return;
    };
    let found = observability(&design, &options, &[], &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
    for name in ["accel bias x", "accel bias y", "heading", "wheels mounting z"] {
        let Some((Cause::Kind(kind), factor)) = found.identified_by(state(&found, name)) else {
            panic!("{name}: {found:?}")
        };
        assert_eq!(found.kinds[kind].name, "turns", "{name}");
        assert!(factor >= DECISIVE, "{name}: {factor}");
    }
    assert!(found.segments.len() <= 16 && found.rank == found.states.len(), "{found:?}");
    let is_constraint = |name: &str| found.sensors.iter().any(|s| s.name == name && s.is_constraint && s.used > 0);
    assert!(is_constraint("wheels") && !is_constraint("gnss_position"), "{:?}", found.sensors);
}

#[test]
fn a_sensor_is_worth_what_is_not_known_without_it() {
    let sets = ["sensor.heading.enabled=true"];
    let lists = [vec!["heading".to_owned()], vec!["position".to_owned(), "velocity".to_owned()]];
    let with = found(&sets, &lists);
    let alone = found(&[], &[]);
    let [heading, gnss] = &with.without[..] else { panic!() };
    assert_eq!((with.rank, heading.rank), (alone.rank + 1, alone.rank));
    for (left, state) in heading.left.iter().zip(&alone.states) {
        // The same information, at estimates that differ by rounding.
        assert!((left - state.left).abs() < 1e-6, "{}: {left} {}", state.name, state.left);
    }
    let position = with.states.iter().position(|s| s.name == "position north").unwrap();
    assert!(gnss.left[position] > 0.999 && with.states[position].left < 0.1, "{gnss:?}");
}

/// A second start forgets the motion, and keeps what was learnt of the parameters.
#[test]
fn a_second_start_is_no_segment_and_parameters_are_learnt_on_over_it() {
    let rest = trajectory(&[r#"{ type = "rest", duration = "160 s" }"#]);
    let gap = "simulation.imu.fault.gap={ type = \"outage\", window = { from = \"60 s\", duration = \"40 s\" } }";
    let again = found(&[&rest, gap, "process.input.longest_gap=\"5 s\""], &[]);
    let spans: Vec<(f64, f64)> = again.segments.iter().map(|s| (s.from.round(), s.to.round())).collect();
    assert_eq!(spans, [(0.0, 65.0), (100.0, 160.0)]);
    let once = found(&[], &[]);
    assert_eq!((again.exact_rank, once.exact_rank), (12, 12));
    let left = |found: &Observability| state(found, "gyro bias x").left;
    // Twice the data: between half and all of the variance.
    assert!(left(&again) < 0.9 * left(&once), "{} {}", left(&again), left(&once));
    // The tilt starts anew, so nothing is learnt of what it hides.
    assert!(state(&again, "accel bias x").left > 0.99);
}

#[test]
fn the_command_shows_the_result_as_text_and_as_json() {
    let w = Workspace::new("observability");
    w.write("fifteen.toml", FIFTEEN);
    let turn = trajectory(&[REST, QUARTER, REST]);
    let args = ["check", "fifteen.toml", "--observability", "--without", "velocity", "--set", &turn];
    let text = stdout(&w.fusion(&args).success());
    for wanted in [
        "exact rank",
        "15 of 15",
        "gyro bias z",
        "turns right by",
        "without velocity",
        "σ left without a sensor",
    ] {
        assert!(text.contains(wanted), "{wanted}: {text}");
    }
    let shown = w.fusion(&[&args[..], &["--format", "json"]].concat()).success();
    assert_eq!(
        titles(&page(&shown)),
        [
            "Observability",
            "Least known directions",
            "States",
            "Segments",
            "Sensors",
            "σ left without a sensor"
        ]
    );
    let unknown = w
        .fusion(&["check", "fifteen.toml", "--observability", "--without", "velocty"])
        .code(2);
    let told = crate::support::stderr(&unknown);
    assert!(
        told.contains("no sensor of the filter is called `velocty`") && told.contains("`velocity`"),
        "{told}"
    );
}
