use crate::support::{DESIGN, Workspace, snapshot, stderr, stdout};
use fusion::Navigator;
use fusion::config::Document;
use std::path::Path;

const SENSOR: &str = "[sensor.gnss]
type = \"gnss_position\"
source = \"gnss\"
noise = { sigma = \"2 m\" }
gate = { type = \"nis\", probability = 0.999 }
";

/// The small design with its sensor in a part, parts/gnss.toml.
fn composed(test: &str, part: &str) -> Workspace {
    let w = Workspace::new(&format!("include-{test}"));
    assert!(DESIGN.contains(SENSOR));
    let design = DESIGN.replace(SENSOR, "");
    w.write("design.toml", format!("include = [\"parts/gnss.toml\"]\n{design}"));
    std::fs::create_dir_all(w.path("parts")).unwrap();
    w.write("parts/gnss.toml", part);
    w
}

/// The files that a run with these arguments wrote.
fn results(w: &Workspace, args: &[&str]) -> [String; 2] {
    w.fusion(&[&["run"], args, &["--out", "out"]].concat()).success();
    ["out/estimates.csv", "out/updates.csv"].map(|file| w.read(file))
}

#[test]
fn a_design_of_parts_gives_the_results_of_the_whole() {
    let w = composed("same", SENSOR);
    w.write("whole.toml", DESIGN);
    assert_eq!(results(&w, &["design.toml"]), results(&w, &["whole.toml"]));
}

#[test]
fn a_mistake_in_a_part_is_shown_in_the_part() {
    let w = composed("mistake", &SENSOR.replace("\"2 m\"", "\"2 m/s\"").replace("source", "sorce"));
    let ran = w.fusion(&["run", "design.toml"]).code(2);
    snapshot("include_mistake_in_a_part", &stderr(&ran));
}

#[test]
fn a_part_with_a_syntax_error_is_shown_alone() {
    let w = composed("syntax", &SENSOR.replace("\"gnss\"", "\"gnss"));
    let ran = w.fusion(&["run", "design.toml"]).code(2);
    snapshot("include_syntax_error", &stderr(&ran));
}

#[test]
fn a_cycle_is_refused_with_its_chain() {
    let w = composed("cycle", &format!("include = [\"mast.toml\"]\n{SENSOR}"));
    w.write("parts/mast.toml", "include = [\"../parts/gnss.toml\"]\n");
    let ran = w.fusion(&["check", "design.toml"]).code(2);
    snapshot("include_cycle", &stderr(&ran));
}

#[test]
fn parts_that_are_not_there_or_not_named_are_mistakes() {
    let w = composed("missing", "");
    w.write("design.toml", format!("include = [\"parts/gns.toml\", 3]\n{DESIGN}"));
    let ran = w.fusion(&["check", "design.toml"]).code(2);
    snapshot("include_missing", &stderr(&ran));
}

#[test]
fn what_is_no_design_is_not_read() {
    let w = composed("limits", SENSOR);
    let said = |part: &str| {
        w.write("design.toml", format!("include = [\"{part}\"]\n{DESIGN}"));
        stderr(&w.fusion(&["check", "design.toml"]).code(2))
    };
    w.write("secret.txt", "root:x:0:0");
    let other = said("secret.txt");
    assert!(other.contains("does not end in `.toml`") && !other.contains("root:x"), "{other}");
    w.write("large.toml", "#".repeat((16 << 20) + 1));
    assert!(said("large.toml").contains("it is larger than 16 MiB"));
    // Each level includes the next one twice: 2^15 copies of the last.
    for level in 0..15 {
        let stage = |name: &str| format!("[stage.{name}]\ntype = \"filter\"\ninclude = [\"level{}.toml\"]\n", level + 1);
        w.write(&format!("level{level}.toml"), stage("a") + &stage("b"));
    }
    w.write(
        "level15.toml",
        "process = { type = \"attitude_only\", source = \"imu\", gyro_noise = 1e-4 }\n",
    );
    assert!(said("level0.toml").contains("more than 262144 values together"));
    if cfg!(unix) {
        // Neither waits for a writer that never opens the pipe.
        let made = std::process::Command::new("mkfifo").arg(w.path("pipe.toml")).status();
        assert!(made.unwrap().success());
        assert!(said("pipe.toml").contains("it is a pipe or a device"));
        w.write("design.toml", DESIGN);
        let pipe = w.path("pipe.toml");
        let resumed = w.fusion(&["run", "design.toml", "--resume", &pipe.to_string_lossy()]).code(2);
        assert!(stderr(&resumed).contains("it is no file"), "{}", stderr(&resumed));
    }
}

#[test]
fn what_a_file_says_wins_and_then_the_later_part() {
    let w = composed("order", "");
    w.write("parts/early.toml", SENSOR.replace("\"2 m\"", "\"7 m\"").replace("0.999", "0.9"));
    w.write(
        "parts/late.toml",
        "include = [\"early.toml\"]\n[sensor.gnss]\nnoise.sigma = \"5 m\"\ngate.probability = 0.95\n",
    );
    let design = DESIGN.replace(SENSOR, "[sensor.gnss]\nnoise.sigma = \"3 m\"\n");
    w.write(
        "design.toml",
        format!("include = [\"parts/early.toml\", \"parts/late.toml\"]\n{design}"),
    );
    let document = Document::load(&w.path("design.toml")).unwrap();
    let value = |path: &str| format!("{:?}", document.root().at(path).unwrap().value());
    assert_eq!(value("sensor.gnss.noise.sigma"), "String(\"3 m\")");
    assert_eq!(value("sensor.gnss.gate.probability"), "Float(0.95)");
    assert_eq!(value("sensor.gnss.type"), "String(\"gnss_position\")");
}

#[test]
fn overrides_and_variants_reach_into_parts() {
    let w = composed("override", SENSOR);
    w.write("whole.toml", DESIGN);
    let set = ["--set", "sensor.gnss.noise.sigma=4 m"];
    let whole = results(&w, &["whole.toml", set[0], set[1]]);
    assert_eq!(results(&w, &["design.toml", set[0], set[1]]), whole);
    w.write("parts/coarse.toml", "[sensor.gnss]\nnoise.sigma = \"4 m\"\n");
    let design = w.read("design.toml");
    w.write(
        "design.toml",
        format!("{design}\n[variant.coarse]\ninclude = [\"parts/coarse.toml\"]\n"),
    );
    assert_eq!(results(&w, &["design.toml", "--variant", "coarse"]), whole);
    let wrong = w.fusion(&["run", "design.toml", "--set", "sensor.gnss.noise.sigma=4 s"]).code(2);
    snapshot("include_override_of_a_part", &stderr(&wrong));
}

#[test]
fn the_resolved_design_is_a_design_with_the_same_results() {
    let w = composed("resolved", SENSOR);
    let args = ["design.toml", "--variant", "ekf", "--set", "sensor.gnss.noise.sigma=4 m"];
    let flat = stdout(&w.fusion(&[&["check", "--resolved"], &args[..]].concat()).success());
    snapshot("resolved", &flat);
    w.write("flat.toml", &flat);
    assert_eq!(results(&w, &["flat.toml"]), results(&w, &args));
    assert_ne!(results(&w, &["flat.toml"]), results(&w, &["design.toml"]));
}

#[test]
fn a_program_reads_parts_from_a_file_or_a_folder() {
    let w = composed("program", SENSOR);
    let text = w.read("design.toml");
    let refused = Navigator::from_toml(&text).unwrap_err().to_string();
    assert!(
        refused.contains("--> design.toml:1:1") && refused.contains("Navigator::from_file"),
        "{refused}"
    );
    assert_eq!(refused.matches("error").count(), 1, "{refused}");
    Navigator::from_file(w.path("design.toml")).unwrap();
    Navigator::from_toml_in(w.path(""), &text).unwrap();
    let elsewhere = Navigator::from_toml_in(w.path("parts"), &text).unwrap_err().to_string();
    assert!(elsewhere.contains("there is no such file"), "{elsewhere}");
}

#[test]
fn the_built_in_design_finds_its_parts_from_anywhere() {
    let w = Workspace::new("include-built-in");
    // Except the second line, which names the file.
    let checked = |args: &[&str]| {
        let lines = stdout(&w.fusion(&[&["check"], args].concat()).success());
        lines
            .lines()
            .enumerate()
            .filter(|(k, _)| *k != 1)
            .map(|(_, l)| l.to_owned())
            .collect::<Vec<_>>()
    };
    let built_in = checked(&[]);
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/demonstration.toml");
    assert_eq!(built_in, checked(&[file]));
}

#[test]
fn shipped_designs_of_parts_are_the_same_when_flat() {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    for name in ["ins-gps", "ins-gps-outlier", "real/pntos-car", "real/rtklib-drive"] {
        let document = Document::load(&configs.join(format!("{name}.toml"))).unwrap();
        let flat = document.flat();
        let (again, mistakes) = Document::parse("flat.toml", &flat);
        assert_eq!(mistakes, []);
        let without_comments = |text: String| {
            text.lines()
                .map(|l| l.split("  # ").next().unwrap().trim_end().to_owned() + "\n")
                .collect::<String>()
        };
        assert_eq!(without_comments(again.flat()), without_comments(flat), "{name}");
    }
}

/// A filter that follows the attitude of another filter inside a stage, whose tables are `inside`.
fn cascade(inside: &str) -> String {
    format!(
        "[process]
type = \"attitude_only\"
source = \"attitude\"
gyro_noise = 1e-2
[sensor.attitude]
type = \"attitude\"
source = \"attitude\"
noise = {{ from_source = true }}
[initial.start]
type = \"explicit\"
attitude = [0, 0, 0]
attitude_sigma = 1
[stage.attitude]
type = \"filter\"
{inside}
"
    )
}

#[test]
fn a_filter_inside_a_stage_may_lie_in_a_file_of_its_own() {
    let w = Workspace::new("include-nested");
    let own = "[process]
type = \"attitude_only\"
source = \"imu\"
gyro_noise = 1e-3
[initial.level]
type = \"levelling\"
source = \"imu\"
duration = 1
tilt_sigma = 0.03
";
    w.write("attitude.toml", own);
    w.write("apart.toml", cascade("include = [\"attitude.toml\"]"));
    w.write(
        "whole.toml",
        cascade(
            &own.replace("[process]", "[stage.attitude.process]")
                .replace("[initial", "[stage.attitude.initial"),
        ),
    );
    let flat = |file: &str| Document::load(&w.path(file)).unwrap().flat();
    let values = |file: &str| {
        let text = flat(file);
        let lines = text
            .lines()
            .map(|line| line.split(" #").next().unwrap_or_default().trim().to_owned());
        let mut lines: Vec<String> = lines.filter(|line| !line.is_empty()).collect();
        lines.sort();
        lines
    };
    assert_eq!(values("apart.toml"), values("whole.toml"));
    assert!(Navigator::from_file(w.path("apart.toml")).is_ok());
    // A mistake in the inner file is shown at its place in that file.
    w.write("attitude.toml", own.replace("gyro_noise", "gyro_nose"));
    let mistakes = Navigator::from_file(w.path("apart.toml")).unwrap_err().to_string();
    assert!(mistakes.contains("attitude.toml:4:1"), "{mistakes}");
}
