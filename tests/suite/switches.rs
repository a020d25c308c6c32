//! A sensor that rows switch while the filter runs: from an operator or another program, or from a stage.

use super::support::Workspace;
use fusion::Navigator;
use fusion::core::runner::Event;

/// A walk seen by fixes; an operator switches them.
const DESIGN: &str = r#"
[process]
type = "constant_velocity"
acceleration_noise = "0.5 m/s^2/sqrt(Hz)"
position_sigma = "10 m"
velocity_sigma = "5 m/s"
[run]
origin = { latitude = "47 deg", longitude = "8 deg" }
[sensor.gnss]
type = "gnss_position"
source = "gnss"
noise = "2 m"
switch = { source = "operator", used = "trusted", noise = "doubt" }
[initial.fix]
type = "first_fix"
source = "gnss"
position_sigma = "5 m"
"#;

/// The time \[s\] of the latest belief after 60 fixes, and its 1σ of the position north \[m\]. The operator has sent these
/// numbers after 30 fixes.
fn ended(design: &str, command: Option<[f64; 2]>) -> (f64, f64) {
    let mut nav = Navigator::from_toml(design).unwrap_or_else(|d| panic!("{d}"));
    let place = [47_f64.to_radians(), 8_f64.to_radians(), 400.0];
    for second in 0..60 {
        if let Some(command) = command.filter(|_| second == 30) {
            nav.feed("operator", 30.0, &command).unwrap();
        }
        nav.feed("gnss", f64::from(second), &place).unwrap();
    }
    nav.finish(&mut |_: &Event<'_>| {}).unwrap();
    let belief = nav.belief().unwrap();
    (belief.time.seconds().round(), belief.covariance.to_dense()[0].sqrt())
}

#[test]
fn an_operator_switches_a_sensor_off_and_changes_its_noise() {
    let alone = ended(DESIGN, None);
    assert_eq!(alone.0, 59.0);
    assert_eq!(ended(DESIGN, Some([1.0, 1.0])), alone);
    // This process moves with its measurements alone.
    assert_eq!(ended(DESIGN, Some([0.0, 1.0])).0, 29.0);
    // After eight time constants (q / R)^(-1/4) the covariance is that of a declared noise of three times 2 m.
    let (doubted, declared) = (
        ended(DESIGN, Some([1.0, 3.0])).1,
        ended(&DESIGN.replace("\"2 m\"", "\"6 m\""), None).1,
    );
    assert!(
        doubted > 1.5 * alone.1 && (doubted / declared - 1.0).abs() < 0.01,
        "{alone:?} {doubted} {declared}"
    );
}

#[test]
fn a_run_counts_the_rows_of_a_sensor_that_was_switched_off() {
    let workspace = Workspace::new("switch");
    let csv: String = (0..40).map(|k| format!("{k},47,8,400\n")).collect();
    workspace.write("fixes.csv", format!("t,lat,lon,h\n{csv}"));
    workspace.write("mode.csv", "t,on,factor\n9.5,0,1\n19.5,1,2\n");
    let sources = r#"
[source.gnss]
type = "csv"
path = "fixes.csv"
time.column = "t"
channels.position = { latitude = "lat", longitude = "lon", height = "h", unit = "deg" }
[source.operator]
type = "csv"
path = "mode.csv"
time.column = "t"
channels.trusted = { columns = ["on"] }
channels.doubt = { columns = ["factor"] }
"#;
    workspace.write("d.toml", format!("{DESIGN}{sources}"));
    workspace.fusion(&["run", "d.toml", "--out", "out"]).success();
    let summary: serde_json::Value = serde_json::from_str(&workspace.read("out/summary.json")).unwrap();
    let counted = |number: usize| {
        let consumer = &summary["consumers"][number];
        (
            consumer["name"].as_str(),
            consumer["used"].as_u64(),
            consumer["switched_off"].as_u64(),
        )
    };
    assert_eq!(counted(0), (Some("gnss (input 2)"), Some(2), Some(0)));
    // The first fix starts the filter, and those from 10 s to 19 s are not used.
    assert_eq!(counted(2), (Some("gnss"), Some(29), Some(10)));
}

#[test]
fn a_switch_without_channels_or_without_its_source_is_a_mistake_at_its_place() {
    let told = |design: &str| Navigator::from_toml(design).unwrap_err().to_string();
    let none = told(&DESIGN.replace(", used = \"trusted\", noise = \"doubt\"", ""));
    assert!(
        none.contains("`switch` names no channel") && none.contains("design.toml:13"),
        "{none}"
    );
    let sources = "[source.gnss]\ntype = \"csv\"\npath = \"x.csv\"\ntime.column = \"t\"\n\
                   channels.position = { latitude = \"lat\", longitude = \"lon\", height = \"h\", unit = \"deg\" }\n";
    let unknown = told(&format!("{DESIGN}{sources}"));
    assert!(
        unknown.contains("no source or stage is called `operator`") && unknown.contains("design.toml:13"),
        "{unknown}"
    );
}
