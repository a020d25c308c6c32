use crate::support::{DESIGN, Workspace, fixes, snapshot, stderr};
use predicates::prelude::predicate;

const PROCESS: &str = "[process]\ntype = \"constant_velocity\"\nacceleration_noise = \"0.5 m/s^2/sqrt(Hz)\"\nposition_sigma = \"10 m\"\nvelocity_sigma = \"5 m/s\"\n";
const INITIAL: &str = "[initial.fix]\ntype = \"first_fix\"\nsource = \"gnss\"\nposition_sigma = \"5 m\"\nvelocity_sigma = \"1 m/s\"\n";

const INERTIAL: &str = r#"[run]
origin = { latitude = "47 deg", longitude = "8 deg" }

[process]
type = "attitude_only"
source = "imu"
gyro_noise = "0.1 deg/sqrt(s)"

[initial.start]
type = "explicit"
attitude = [0, 0, 0]
attitude_sigma = "1 deg"

[simulation]
trajectory = [{ type = "rest", duration = "60 s" }]

[simulation.imu]
rate = "100 Hz"
"#;

/// The output of the command for a design in which `from` was replaced by `to`, which must be wrong.
fn wrong(name: &str, from: &str, to: &str) {
    wrong_text(name, &replaced(from, to));
}

fn replaced(from: &str, to: &str) -> String {
    assert!(DESIGN.contains(from), "{from}");
    DESIGN.replacen(from, to, 1)
}

fn wrong_text(name: &str, design: &str) {
    let w = Workspace::new(&format!("mistake-{name}"));
    w.write("design.toml", design);
    complain(name, &w, &["run", "design.toml"]);
}

/// The output for this content of gnss.csv.
fn wrong_data(name: &str, data: &str) {
    let w = Workspace::new(&format!("mistake-{name}"));
    w.write("gnss.csv", data);
    complain(name, &w, &["run", "design.toml"]);
}

/// The output for these arguments with the sound design.
fn wrong_argument(name: &str, args: &[&str]) {
    let w = Workspace::new(&format!("mistake-{name}"));
    complain(name, &w, args);
}

fn complain(name: &str, w: &Workspace, args: &[&str]) {
    let placed = predicate::function(is_placed).fn_name("a place");
    let advising = predicate::function(advises).fn_name("advice");
    let ran = w.fusion(args).code(2).stdout("").stderr(placed).stderr(advising);
    snapshot(name, &stderr(&ran));
}

/// The place: in the file, the row of the data, or the file or argument by name.
fn is_placed(text: &str) -> bool {
    let elsewhere = [
        "--> ./gnss.csv:",
        "--> command line:",
        "`nothing.toml`",
        "`design.toml`",
        "--> ./gnss.csv\n",
        "--> design.toml\n",
    ];
    text.contains(" --> design.toml:") && text.contains('^') || elsewhere.iter().any(|e| text.contains(e))
}

/// The advice: a suggestion, or the expected value.
fn advises(text: &str) -> bool {
    let advice = [
        "= help:",
        "did you mean",
        "expected",
        "wanted",
        "needs `",
        "takes `",
        "missing `",
        "duplicate key",
        "this file ",
    ];
    advice.iter().any(|a| text.contains(a))
}

/// gnss.csv with line `line` (from 1) replaced.
fn with_line(line: usize, text: &str) -> String {
    let data = fixes();
    let lines = data.lines().enumerate().map(|(k, l)| if k + 1 == line { text } else { l });
    lines.map(|l| format!("{l}\n")).collect()
}

#[test]
fn syntax() {
    wrong("syntax", "unit = \"m/s\"", "unit = \"m/s");
    wrong(
        "duplicate_table",
        "[variant.ekf]",
        "[sensor.gnss]\ntype = \"height\"\n\n[variant.ekf]",
    );
    wrong(
        "duplicate_key",
        "source = \"gnss\"\nnoise",
        "source = \"gnss\"\nsource = \"imu\"\nnoise",
    );
}

#[test]
fn names() {
    wrong("unknown_table", "[sensor.gnss]", "[sensors.gnss]");
    wrong(
        "unknown_key",
        "source = \"gnss\"\nnoise",
        "lever_rm = [0, 0, 1]\nsource = \"gnss\"\nnoise",
    );
    wrong(
        "unknown_common_key",
        "source = \"gnss\"\nnoise",
        "source = \"gnss\"\nenable = true\nnoise",
    );
    wrong("unknown_block", "\"gnss_position\"", "\"gnss_positon\"");
    wrong("unknown_process", "\"constant_velocity\"", "\"constant_speed\"");
    wrong("unknown_gate", "{ type = \"nis\", probability = 0.999 }", "{ type = \"chi2\" }");
    wrong("unknown_backend", "[process]", "[filter]\nbackend = \"ekff\"\n\n[process]");
    wrong("no_type", "type = \"gnss_position\"\n", "");
    wrong("no_source_key", "source = \"gnss\"\nnoise", "noise");
    wrong("unknown_source", "source = \"gnss\"\nnoise", "source = \"gnns\"\nnoise");
    wrong(
        "source_and_stage_of_one_name",
        "[variant.ekf]",
        "[stage.gnss]\ntype = \"periodic\"\nsource = \"gnss\"\nrate = \"1 Hz\"\n\n[variant.ekf]",
    );
}

/// A second sensor in addition to the sound sensor. `gnss` has further fields of the sound sensor.
fn wrong_pair(name: &str, gnss: &str, speed: &str) {
    let speed = format!("[sensor.speed]\ntype = \"gnss_velocity\"\nsource = \"gnss\"\n{speed}\nnoise = {{ sigma = \"0.1 m/s\" }}\n");
    let text = replaced("source = \"gnss\"\nnoise", &format!("source = \"gnss\"\n{gnss}noise"));
    wrong_text(name, &text.replacen("[initial.fix]", &format!("{speed}\n[initial.fix]"), 1));
}

#[test]
fn sensors_that_go_with_others() {
    wrong_pair("only_with_unknown", "", "only_with = \"gnns\"");
    wrong_pair("only_with_each_other", "only_with = \"speed\"\n", "only_with = \"gnss\"");
    wrong_pair("only_with_itself", "", "only_with = \"speed\"");
    wrong_pair("only_with_of_no_shape", "", "only_with = 5");
}

#[test]
fn values() {
    wrong(
        "wrong_type",
        "source = \"gnss\"\nnoise",
        "horizontal = \"yes\"\nsource = \"gnss\"\nnoise",
    );
    wrong("unknown_unit", "position_sigma = \"5 m\"", "position_sigma = \"5 metres\"");
    wrong("wrong_dimension", "position_sigma = \"5 m\"", "position_sigma = \"5 deg\"");
    wrong("noise_of_wrong_dimension", "sigma = \"2 m\"", "sigma = \"2 m/s\"");
    wrong("noise_of_wrong_count", "sigma = \"2 m\"", "sigma = [\"2 m\", \"3 m\"]");
    wrong("negative_noise", "sigma = \"2 m\"", "sigma = \"-2 m\"");
    let bare = |name: &str, to: &str| wrong(name, "{ sigma = \"2 m\" }", to);
    bare("bare_noise_of_wrong_dimension", "\"2 m/s\"");
    bare("bare_noise_of_wrong_count", "[\"2 m\", \"3 m\"]");
    bare("bare_noise_without_a_known_unit", "\"2 metres\"");
    bare("bare_zero_noise", "0");
    bare("noise_of_a_wrong_type", "true");
    bare("noise_with_an_unknown_key", "{ sigm = \"2 m\" }");
    wrong("zero_noise", "sigma = \"2 m\"", "sigma = 0");
    wrong("out_of_range", "\"0.5 m/s^2/sqrt(Hz)\"", "\"-0.5 m/s^2/sqrt(Hz)\"");
    wrong(
        "lost_before_degraded",
        "[sensor.gnss]",
        "[health]\nrejected = { degraded = \"1 min\" }\n\n[sensor.gnss]",
    );
    wrong("probability_above_one", "probability = 0.999", "probability = 1.5");
    wrong("probability_of_a_gate_too_small", "probability = 0.999", "probability = 0.3");
    wrong(
        "parameter_without_sigma",
        "source = \"gnss\"\nnoise",
        "lever_arm = { estimate = true, initial = [0, 0, 1] }\nsource = \"gnss\"\nnoise",
    );
    wrong(
        "vector_too_short",
        "source = \"gnss\"\nnoise",
        "lever_arm = [0, 1]\nsource = \"gnss\"\nnoise",
    );
    wrong(
        "time_offset_of_years",
        "source = \"gnss\"\nnoise",
        "time_offset = { estimate = true, initial = 1e9, sigma = 1 }\nsource = \"gnss\"\nnoise",
    );
    wrong("channel_of_wrong_unit", "unit = \"m/s\"", "unit = \"deg/s\"");
}

#[test]
fn what_is_missing() {
    wrong("no_process", PROCESS, "");
    wrong("no_noise", "noise = { sigma = \"2 m\" }\n", "");
    wrong("empty_noise", "noise = { sigma = \"2 m\" }", "noise = {}");
    wrong("noise_not_reported", "{ sigma = \"2 m\" }", "{ from_source = true }");
    wrong("missing_field", "acceleration_noise = \"0.5 m/s^2/sqrt(Hz)\"\n", "");
    wrong("missing_state", "\"gnss_position\"", "\"zero_angular_rate\"");
    wrong(
        "missing_channel",
        "[source.gnss.channels.velocity]\ncolumns = [\"vn\", \"ve\", \"vd\"]\nunit = \"m/s\"\n",
        "",
    );
    let strapdown = "[process]\ntype = \"strapdown\"\nsource = \"gnss\"\ngyro = { noise = 1e-4 }\naccelerometer = { noise = 1e-3 }\n";
    let imu = "angular_rate = { columns = [\"vn\", \"ve\", \"vd\"], unit = \"rad/s\" }\nspecific_force = { columns = [\"vn\", \"ve\", \"vd\"], unit = \"m/s^2\" }\n";
    let inertial = replaced(PROCESS, strapdown).replace(
        "[source.gnss.channels.position]",
        &format!("[source.gnss.channels]\n{imu}\n[source.gnss.channels.position]"),
    );
    wrong_text("uninitialised_state", &inertial);
    wrong_text("no_initialiser", &inertial.replace(INITIAL, ""));
    wrong("no_origin", "origin = { latitude = \"47 deg\", longitude = \"8 deg\" }\n", "");
    wrong_text("no_data", &DESIGN[..DESIGN.find("[source.gnss]").unwrap()]);
    let restart = inertial.replace("[run]\n", "[run]\nrestart_after = \"5 s\"\n");
    wrong_text("restart_of_a_process_with_input", &restart);
    wrong_text("no_input", &inertial.replacen("source = \"gnss\"\ngyro", "gyro", 1));
    wrong("input_for_nobody", "acceleration_noise", "source = \"gnss\"\nacceleration_noise");
}

#[test]
fn references_faults_and_simulations() {
    wrong(
        "unknown_reference",
        "[variant.ekf]",
        "[reference]\nsource = \"truth\"\n\n[variant.ekf]",
    );
    let own_sigma = "[reference]\nsource = \"truth\"\nsigma.velocity = { from_source = true }\n\n[source.truth]";
    let truth =
        DESIGN[DESIGN.find("type = \"csv\"").unwrap()..DESIGN.find("[variant.ekf]").unwrap()].replace("source.gnss", "source.truth");
    wrong(
        "reference_without_sigma",
        "[variant.ekf]",
        &format!("{own_sigma}\n{truth}\n[variant.ekf]"),
    );
    let gnss = "[reference.source.gnss]\nchannels = [\"position\", \"attitude\"]\n[reference.source.thruth]";
    let sources = format!("[reference]\nfrom = 1\n[reference.source.truth]\n{gnss}\n\n[source.truth]");
    wrong("reference_sources", "[variant.ekf]", &format!("{sources}\n{truth}\n[variant.ekf]"));
    let beside = "[reference]\nlever_arm = [1, 0, 0]\n[reference.source.truth]\n\n[source.truth]";
    wrong("reference_fields", "[variant.ekf]", &format!("{beside}\n{truth}\n[variant.ekf]"));
    wrong(
        "horizontal_position_with_a_height",
        "[source.gnss.channels.velocity]",
        "[source.gnss.channels.horizontal_position]\nlatitude = \"lat\"\nlongitude = \"lon\"\nheight = \"h\"\nunit = \"deg\"\n\n[source.gnss.channels.velocity]",
    );
    let speedometer = "[sensor.speed]\ntype = \"gnss_velocity\"\nsource = \"gnss\"\nnoise = { sigma = \"0.1 m/s\" }\n\n[source.gnss]";
    let flat = replaced("[source.gnss]", speedometer).replace("columns = [\"vn\", \"ve\", \"vd\"]", "columns = [\"vn\", \"ve\"]");
    wrong_text("velocity_without_its_vertical_part", &flat);
    wrong(
        "fault_on_unknown_channel",
        "[variant.ekf]",
        "[source.gnss.fault.ice]\ntype = \"frozen\"\nchannel = \"positon\"\nwindow = { from = \"3 s\" }\n\n[variant.ekf]",
    );
    wrong(
        "faults_that_are_no_table",
        "path = \"gnss.csv\"",
        "path = \"gnss.csv\"\nfault = \"outage\"",
    );
    wrong("stages_that_are_no_table", "[run]", "stage = \"periodic\"\n\n[run]");
    wrong(
        "unknown_fault",
        "[variant.ekf]",
        "[source.gnss.fault.tunnel]\ntype = \"outages\"\n\n[variant.ekf]",
    );
    let simulated = format!(
        "{}[simulation]\ntrajectory = [{{ type = \"rest\", duration = \"9 s\" }}]\n",
        &DESIGN[..DESIGN.find("[source.gnss]").unwrap()]
    );
    wrong_text(
        "simulated_sensor_misspelt",
        &format!("{simulated}[simulation.sensor.gnns]\nrate = \"1 Hz\"\n"),
    );
    wrong_text("sensor_not_simulated", &simulated);
    let simulated = format!("{}\n[simulation.sensor.gnss]\nrate = \"1 Hz\"\n", simulated.replace(INITIAL, ""));
    wrong_text("unknown_segment", &simulated.replace("\"rest\"", "\"resting\""));
    wrong_text(
        "segment_that_cannot_follow",
        &simulated.replace(
            "{ type = \"rest\", duration = \"9 s\" }",
            "{ type = \"turn\", angle = \"90 deg\", radius = \"5 m\" }",
        ),
    );
    wrong_text(
        "empty_trajectory",
        &simulated.replace("{ type = \"rest\", duration = \"9 s\" }", ""),
    );
}

#[test]
fn simulated_inertial_units() {
    let rate = "rate = \"100 Hz\"\n";
    wrong_text("rate_without_end", &INERTIAL.replace(rate, "rate = \"1e12 Hz\"\n"));
    let wrong = |name: &str, more: &str| wrong_text(name, &format!("{INERTIAL}{more}\n"));
    wrong(
        "imu_fault_on_unknown_channel",
        "fault.jump = { type = \"bias_step\", channel = \"specific_forces\", at = 1, value = 1 }",
    );
    wrong(
        "imu_fault_of_wrong_dimension",
        "fault.hum = { type = \"noise\", channel = \"angular_rate\", sigma = \"1 m/s\" }",
    );
    wrong("unknown_imu_fault", "fault.jump = { type = \"biasstep\" }");
    wrong(
        "stage_named_like_the_unit",
        "[stage.imu]\ntype = \"periodic\"\nsource = \"imu\"\nrate = \"1 Hz\"",
    );
    wrong("imu_key_misspelt", "falt.gap = { type = \"outage\", window = { to = 1 } }");
    let w = Workspace::new("mistake-imu_fault_from_the_command_line");
    w.write("design.toml", INERTIAL);
    let set = "simulation.imu.fault={ gap = { type = \"frozen\", channel = \"rate\", window = { to = 1 } } }";
    complain("imu_fault_from_the_command_line", &w, &["check", "design.toml", "--set", set]);
}

#[test]
fn a_gate_of_positions_on_another_sensor() {
    let text =
        replaced("\"gnss_position\"", "\"gnss_velocity\"").replace("type = \"nis\", probability = 0.999", "type = \"two_condition\"");
    wrong_text("two_condition_on_a_velocity", &text.replace("sigma = \"2 m\"", "sigma = \"2 m/s\""));
}

#[test]
fn all_mistakes_of_a_file_are_told_at_once() {
    let text = replaced("\"gnss_position\"", "\"gnss_positon\"")
        .replace("\"constant_velocity\"", "\"constant_speed\"")
        .replace("\"5 m\"", "\"5 deg\"")
        .replace("[variant.ekf]", "[varient.ekf]");
    wrong_text("several", &text);
}

/// One mistake found by the reader, one in the declaration of a source, one in the assembly and one in a data file.
#[test]
fn mistakes_of_every_step_are_told_at_once() {
    let second = "[source.truth]\ntype = \"csv\"\npath = \"truth.csv\"\ntime = { column = \"t\" }\n[source.truth.channels.position]\nlatitude = \"lat\"\n";
    let third = "[source.speed]\ntype = \"csv\"\npath = \"gnss.csv\"\ntime = { column = \"time\" }\n[source.speed.channels.speed]\ncolumn = \"vn\"\nunit = \"m/s\"\n";
    let text = replaced("velocity_sigma = \"1 m/s\"", "velocity_sigma = \"1 m\"")
        .replace("probability = 0.999", "probability = 0.3")
        .replace("[variant.ekf]", &format!("{second}{third}[variant.ekf]"));
    wrong_text("every_step", &text);
}

/// A mistake in the declaration of a source, of the process, of a sensor's noise, of a segment of the
/// trajectory, of a simulated sensor, and of a fault of each simulated stream.
#[test]
fn mistakes_of_a_simulated_world_are_told_with_the_others() {
    let log = "[source.log]\ntype = \"csv\"\npath = \"log.csv\"\ntime = { column = \"t\" }\n\
        [source.log.channels.position]\nlatitude = \"lat\"\n\n";
    let compass = "[sensor.compass]\ntype = \"heading\"\nsource = \"mag\"\nnoise = { sigma = \"1 m\" }\n\n";
    let text = INERTIAL
        .replace("\"0.1 deg/sqrt(s)\"", "\"0.1 deg\"")
        .replace("\"60 s\" }", "\"60 s\" }, { type = \"straight\", distance = \"50 m\" }")
        .replace("[initial.start]", &format!("{log}{compass}[initial.start]"))
        + "fault.jump = { type = \"spike\", channel = \"specific_forc\", value = [1, 0, 0], window = { from = 4, to = 6 } }\n\
        [simulation.sensor.compass]\nrate = \"1 Hz\"\nwhite = \"1 m\"\n\
        fault.hum = { type = \"noise\", sigma = \"1 m\" }\n";
    let w = Workspace::new("mistake-simulated");
    w.write("design.toml", &text);
    complain("simulated_world", &w, &["check", "design.toml"]);
    let [checked, ran] = ["check", "run"].map(|command| stderr(&w.fusion(&[command, "design.toml"]).code(2)));
    assert_eq!(checked, ran);
    assert_eq!(checked.matches("error: ").count(), 7, "{checked}");
}

/// If one block is wrong, the blocks that depend on it are not reported.
#[test]
fn what_follows_from_a_mistake_is_not_told() {
    let speed = "[sensor.speed]\ntype = \"gnss_velocity\"\nsource = \"gnss\"\nlever_arm = { shared = \"gnss.lever_arm\" }\nnoise = { sigma = \"0.1 m/s\" }\n\n[initial.fix]";
    let shared = replaced(
        "source = \"gnss\"\nnoise",
        "lever_arm = { estimate = true, initial = [0, 0, 1], sigma = \"1 m\" }\nsource = \"gnss\"\nnoise",
    )
    .replacen("[initial.fix]", speed, 1);
    let cases = [
        replaced("\"constant_velocity\"", "\"constant_speed\""),
        replaced("\"first_fix\"", "\"first_fixes\""),
        replaced("origin = { latitude = \"47 deg\"", "origin = { latitude = \"47 m\""),
        replaced("type = \"csv\"", "type = \"cvs\""),
        replaced("unit = \"m/s\"", "unit = \"m/s/s/s\""),
        shared.replacen("\"1 m\" }", "\"1 s\" }", 1),
    ];
    for text in cases {
        let w = Workspace::new("mistake-alone");
        w.write("design.toml", &text);
        let told = stderr(&w.fusion(&["run", "design.toml"]).code(2));
        assert_eq!(told.matches("error").count(), 1, "{told}");
    }
}

#[test]
fn variants_that_are_not_asked_for() {
    let variants = "[variant.slip]\nsensor.gns.noise.sigma = \"3 m\"\nfilter.form = \"josef\"\n\n[variant.cut]\nsensor.gnss.source = \"gnns\"\n\n[variant.ekf]";
    let w = Workspace::new("mistake-variants");
    w.write("design.toml", replaced("[variant.ekf]", variants));
    complain("variants_checked", &w, &["check", "design.toml", "--variant", "ekf"]);
    // They do not stop the run of another variant.
    let warned = stderr(&w.fusion(&["run", "design.toml"]).success());
    assert!(
        warned.contains("warning: variant `slip`: ") && warned.contains("warning: variant `cut`: "),
        "{warned}"
    );
    let asked = stderr(&w.fusion(&["run", "design.toml", "--variant", "slip"]).code(2));
    assert!(
        asked.contains("error: unknown name `josef`") && !asked.contains("variant `slip`: "),
        "{asked}"
    );
    // A variant that is meant for use on top of another variant is correct there.
    let layers = "[variant.far]\nsensor.gnss.gate.min_distance = \"9 m\"\n\n[variant.robust]\nsensor.gnss.gate = { type = \"two_condition\", \
                  probability = 0.99, min_distance = \"5 m\" }\n\n[variant.ekf]";
    w.write("design.toml", replaced("[variant.ekf]", layers));
    let warned = stderr(&w.fusion(&["run", "design.toml"]).success());
    assert!(!warned.contains("variant `far`"), "{warned}");
    w.fusion(&["check", "design.toml", "--variant", "far"]).code(2);
    // A mistake of the base is not repeated for each variant.
    w.write("design.toml", replaced("sigma = \"2 m\"", "sigma = \"2 s\""));
    let once = stderr(&w.fusion(&["check", "design.toml"]).code(2));
    assert_eq!(once.matches("is expected here").count(), 1, "{once}");
}

#[test]
fn tables_are_no_arrays() {
    wrong(
        "array_for_a_place",
        "origin = { latitude = \"47 deg\", longitude = \"8 deg\" }",
        "origin = [0, 0, 0]",
    );
    wrong(
        "array_for_a_block",
        "gate = { type = \"nis\", probability = 0.999 }",
        "gate = [0.999]",
    );
}

#[test]
fn command_line() {
    let w = Workspace::new("override-makes-tables");
    w.fusion(&[
        "check",
        "design.toml",
        "--set",
        "filter.backend=ekf",
        "--set",
        "reference.source=gnss",
    ])
    .success();
    wrong_argument(
        "override_of_unknown_sensor",
        &["run", "design.toml", "--set", "sensor.gns.noise.sigma=1"],
    );
    wrong_argument(
        "override_of_unknown_table",
        &["run", "design.toml", "--set", "senser.gnss.noise.sigma=1"],
    );
    wrong_argument(
        "override_of_unknown_key",
        &["run", "design.toml", "--set", "sensor.gnss.horizontl=true"],
    );
    wrong_argument(
        "override_of_wrong_dimension",
        &["run", "design.toml", "--set", "sensor.gnss.noise.sigma=3 deg"],
    );
    wrong_argument("override_without_value", &["run", "design.toml", "--set", "sensor.gnss.enabled"]);
    wrong_argument("unknown_variant", &["run", "design.toml", "--variant", "ekv"]);
    wrong_argument("unreadable_design", &["run", "nothing.toml"]);
    let w = Workspace::new("mistake-not_utf8");
    w.write("design.toml", b"[run]\ndescription = \"\xe9t\xe9\"\n");
    complain("not_utf8", &w, &["run", "design.toml"]);
}

#[test]
fn data_files() {
    wrong("data_file_missing", "path = \"gnss.csv\"", "path = \"gns.csv\"");
    wrong("column_missing", "height = \"h\"", "height = \"hgt\"");
    wrong("time_column_missing", "column = \"t\"", "column = \"time\"");
    wrong_data("empty_file", "");
    wrong_data("no_rows", "t,lat,lon,h,vn,ve,vd\n");
    wrong_data("cell_is_nan", &with_line(5, "3.0,nan,8.0,400.0,11.1,0.0,0.0"));
    wrong_data("cell_is_text", &with_line(5, "3.0,47.0,abc,400.0,11.1,0.0,0.0"));
    wrong_data("stamp_is_text", &with_line(5, "soon,47.0,8.0,400.0,11.1,0.0,0.0"));
    wrong_data("row_is_short", &with_line(5, "3.0,47.0"));
    wrong_data("decimal_comma", &with_line(5, "3.0,47,0,8.0,400.0,11.1,0.0,0.0"));
    wrong_data("time_goes_backwards", &with_line(5, "1.5,47.0,8.0,400.0,11.1,0.0,0.0"));
    wrong_data("stamps_repeat", &with_line(5, "2.0,47.0,8.0,400.0,11.1,0.0,0.0"));
}

#[test]
fn unlike_latencies_of_channels_that_are_used_together_are_refused_in_a_variant_too() {
    let w = Workspace::new("mistake-unlike-latencies");
    let world = INERTIAL.split("[simulation]").next().unwrap();
    let design = format!(
        "{}\n[source.imu]\ntype = \"csv\"\npath = \"imu.csv\"\ntime = {{ column = \"t\" }}\n[source.imu.channels]\n\
         angular_rate = {{ columns = [\"a\", \"b\", \"c\"], unit = \"rad/s\" }}\n\
         specific_force = {{ columns = [\"d\", \"e\", \"f\"], unit = \"m/s^2\" }}\n\
         [variant.late.source.imu.channels.specific_force]\nlatency = \"0.1 s\"\n",
        world.replace("attitude_only", "strapdown").replace(
            "gyro_noise = \"0.1 deg/sqrt(s)\"",
            "gyro.noise = \"0.1 deg/s/sqrt(Hz)\"\naccelerometer.noise = \"1 mg/sqrt(Hz)\""
        )
    );
    w.write("design.toml", design);
    let ran = w.fusion(&["check", "design.toml", "--variant", "late"]).code(2);
    let told = stderr(&ran);
    let expected = "this block needs `angular_rate` and `specific_force` of the same instant, but their latencies are 0 s and 0.1 s";
    assert!(told.contains(expected), "{told}");
    assert!(
        told.contains("write the same `latency` for both under [source.imu.channels]"),
        "{told}"
    );
}

#[test]
fn a_mistake_under_run_does_not_hide_where_the_data_are() {
    let w = Workspace::new("mistake-data-dir");
    let local = "[source.gnss.channels.position]\nnorth = \"vn\"\neast = \"ve\"\ndown = \"vd\"\n\n[source.gnss.channels.velocity]";
    let position =
        &DESIGN[DESIGN.find("[source.gnss.channels.position]").unwrap()..DESIGN.find("[source.gnss.channels.velocity]").unwrap()];
    let design = DESIGN.replacen(
        "origin = { latitude = \"47 deg\"",
        "data_dir = \"log\"\norigin = { latitude = \"4854 deg\"",
        1,
    );
    std::fs::create_dir_all(w.path("log")).unwrap();
    std::fs::rename(w.path("gnss.csv"), w.path("log/gnss.csv")).unwrap();
    for design in [
        design.replace(position, "").replacen("[source.gnss.channels.velocity]", local, 1),
        design,
    ] {
        w.write("design.toml", &design);
        let told = stderr(&w.fusion(&["run", "design.toml"]).code(2));
        assert!(told.contains("4854 deg") && told.matches("error: ").count() == 1, "{told}");
    }
}

#[test]
fn all_fields_that_a_block_misses_are_told_at_once() {
    let w = Workspace::new("mistake-missing-fields");
    w.write(
        "design.toml",
        replaced(PROCESS, "[process]\ntype = \"constant_velocity\"\nacceleration_nois = 1\n"),
    );
    let told = stderr(&w.fusion(&["check", "design.toml"]).code(2));
    for field in ["position_sigma", "velocity_sigma"] {
        assert!(told.contains(&format!("missing field `{field}`")), "{told}");
    }
    assert!(
        told.contains("did you mean `acceleration_noise`") && !told.contains("missing field `acceleration_noise`"),
        "{told}"
    );
}
