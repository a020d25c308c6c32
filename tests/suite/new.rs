//! `fusion new`: the designs that it writes run at once, and their filters are consistent.

use crate::support::{Workspace, stderr, stdout};
use fusion::config::Document;
use fusion::design::Design;
use fusion::run::Options;
use fusion_judge::campaign::{Runs, monte_carlo};
use std::path::Path;

const VEHICLES: [&str; 6] = ["car", "drone", "boat", "rover", "auv", "person"];

#[test]
fn every_template_is_listed() {
    let w = Workspace::new("new-list");
    let list = stdout(&w.fusion(&["new", "--list"]).success());
    let templates = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/templates");
    let mut names: Vec<String> = std::fs::read_dir(templates)
        .unwrap()
        .map(|e| e.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort_unstable();
    let mut expected = VEHICLES;
    expected.sort_unstable();
    assert_eq!(names, expected);
    for name in names {
        assert!(list.contains(&format!("  {name} ")), "{name} is not listed:\n{list}");
    }
}

#[test]
fn what_is_written_stands_alone_and_its_filter_knows_its_errors() {
    for vehicle in VEHICLES {
        let w = Workspace::new(&format!("new-{vehicle}"));
        let said = stdout(&w.fusion(&["new", "mine", "--from", vehicle]).success());
        assert!(said.contains("fusion run mine.toml"), "{said}");
        // With its variants.
        w.fusion(&["check", "mine.toml"]).success();
        let text = w.read("mine.toml");
        assert!(!text.contains("../") && !text.contains("NAME.toml"), "{vehicle}");
        let document = Document::load(&w.path("mine.toml")).unwrap_or_else(|d| panic!("{vehicle}: {d}"));
        let design = Design::read(document).unwrap_or_else(|d| panic!("{vehicle}: {d}"));
        let campaign = monte_carlo(&design, &Options::default(), 0..5, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{vehicle}: {d}"));
        for (what, nees) in ["position", "velocity", "attitude"].iter().zip(campaign.campaign.pooled().nees) {
            // An error that is constant in a run counts once: five runs with three axes have 15 degrees of freedom, and
            // χ²/15 is within 0.31 … 2.19 with 99 %.
            let nees = nees.unwrap();
            assert!(
                (0.31..2.19).contains(&nees),
                "{vehicle}: NEES of {what} over its dimension is {nees}"
            );
        }
    }
}

/// As the comments of a template say: rows from a file, and no world. The parts contain the errors of their sensors.
#[test]
fn a_template_goes_on_with_a_log() {
    let w = Workspace::new("new-log");
    w.fusion(&["new", "mine", "--from", "person"]).success();
    let text = w.read("mine.toml");
    let (filter, _) = text.split_once("\n[simulation]").unwrap();
    let log = "
        [source.imu]
        type = 'csv'
        path = 'shoe.csv'
        time = { column = 't' }
        channels.specific_force = { columns = ['ax', 'ay', 'az'], unit = 'm/s^2' }
        channels.angular_rate = { columns = ['gx', 'gy', 'gz'], unit = 'rad/s' }";
    w.write("mine.toml", format!("{filter}\n{log}\n"));
    let checked = stdout(&w.fusion(&["check", "mine.toml"]).success());
    assert!(checked.contains("shoe.csv"), "{checked}");
}

/// A foot does not observe its heading: the σ of the start remains.
#[test]
fn a_heading_that_nothing_tells_stays_unknown_on_a_foot() {
    let w = Workspace::new("new-heading");
    w.fusion(&["new", "mine", "--from", "person"]).success();
    let last = |sets: &[&str]| {
        let known = "initial.start.attitude_sigma=[\"0.5 deg\", \"0.5 deg\", \"20 deg\"]";
        let args = ["run", "mine.toml", "--out", "out", "--set", known].into_iter();
        w.fusion(&args.chain(sets.iter().copied()).collect::<Vec<_>>()).success();
        let text = w.read("out/estimates.csv");
        let mut lines = text.lines();
        let column = lines.next().unwrap().split(',').position(|name| name == "sigma_yaw_deg").unwrap();
        lines.last().unwrap().split(',').nth(column).unwrap().parse::<f64>().unwrap()
    };
    // Gyros whose bias is measured at each stance see a part of the Earth's rotation: 10.3 deg remain, and NEES of the
    // attitude is 0.9 of 1 over 20 seeds.
    let kept = last(&[]);
    assert!((8.0..20.0).contains(&kept), "{kept}");
    // The coordinates and the discretisation keep it: measured 3.3 and 1.6 deg without one of them.
    for lost in ["filter.backend=error_state", "process.discretisation=first_order"] {
        let left = last(&["--set", lost]);
        assert!(left < 0.6 * kept, "{lost}: {left}");
    }
}

/// A swing of the foot is fast: the error of Φ for a turn of 2.5° per step adds up from stride to stride.
#[test]
fn a_walk_of_many_strides_is_known_as_well_as_a_short_one() {
    let w = Workspace::new("new-strides");
    w.fusion(&["new", "mine", "--from", "person"]).success();
    let text = w.read("mine.toml");
    assert_eq!(text.matches("strides = 20").count(), 3);
    w.write("mine.toml", text.replace("strides = 20", "strides = 90"));
    let design = Design::read(Document::load(&w.path("mine.toml")).unwrap()).unwrap();
    let campaign = monte_carlo(&design, &Options::default(), 0..5, 1, 0, &|_| {}).unwrap();
    let [position, _, attitude] = campaign.campaign.pooled().nees.map(Option::unwrap);
    // As above. With Φ = I − [ωΔt ×] for the attitude they were 305 and 27 at twice the rate.
    assert!(
        (0.31..2.19).contains(&position) && (0.31..2.19).contains(&attitude),
        "{position} {attitude}"
    );
}

#[test]
fn the_filters_of_the_variants_of_a_template_know_their_errors() {
    for (vehicle, variant) in [
        ("car", "tunnel"),
        ("drone", "jammed"),
        ("boat", "jammed"),
        ("rover", "no-gnss"),
        ("auv", "silent"),
        ("auv", "ship_heading"),
        ("auv", "ship"),
    ] {
        let w = Workspace::new(&format!("new-{vehicle}-{variant}"));
        w.fusion(&["new", "mine", "--from", vehicle]).success();
        let campaign = |variants: &[&str]| {
            let mut document = Document::load(&w.path("mine.toml")).unwrap();
            variants.iter().for_each(|v| document.overlay(&format!("variant.{v}")).unwrap());
            let design = Design::read(document).unwrap_or_else(|d| panic!("{vehicle}: {d}"));
            monte_carlo(&design, &Options::default(), 0..2, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{vehicle}: {d}"))
        };
        let (base, changed) = (campaign(&[]), campaign(&[variant]));
        let position = |c: &Runs| c.spread(|r| r.position_rmse).unwrap().mean;
        // 1 mm: the variant has an effect. Its size varies: slow errors of the receiver are the largest part, with
        // fixes or without.
        assert!((position(&changed) - position(&base)).abs() > 1e-3, "{vehicle} {variant}");
        for nees in changed.campaign.pooled().nees {
            let nees = nees.unwrap();
            // Two runs with three axes have 6 degrees of freedom, see above: χ²/6 is within 0.05 … 3.74 with 99.8 %.
            assert!((0.05..3.74).contains(&nees), "{vehicle} {variant}: {nees}");
        }
    }
}

#[test]
fn a_boat_finds_the_current_that_carries_it() {
    let w = Workspace::new("new-current");
    w.fusion(&["new", "mine", "--from", "boat"]).success();
    w.fusion(&["run", "mine.toml", "--out", "out"]).success();
    let summary: serde_json::Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
    let blocks = summary["score"]["blocks"].as_array().unwrap();
    let current = blocks.iter().find(|block| block["name"] == "log.current").unwrap();
    let parameter = |name: &str| {
        summary["parameters"]
            .as_array()
            .unwrap()
            .iter()
            .find(|p| p["name"] == name)
            .unwrap()
            .clone()
    };
    let estimate = parameter("log.current");
    for (axis, truth) in [(0, 0.4), (1, -0.2)] {
        let of = |value: &serde_json::Value, key: &str| value[key][axis].as_f64().unwrap();
        let (error, sigma) = (of(current, "error"), of(current, "sigma"));
        // The error is against the current of `sea` after its tide. The initial 0.5 m/s has become a tenth; the bound
        // is 4σ of it.
        assert!((of(&estimate, "value") - error - truth).abs() < 1e-3, "{estimate} {current}");
        assert!(sigma < 0.05 && error.abs() < 4.0 * sigma, "{current}");
    }
}

#[test]
fn a_foot_that_stands_in_every_stride_ends_where_the_person_does() {
    let w = Workspace::new("new-foot");
    w.fusion(&["new", "mine", "--from", "person"]).success();
    let end = |variant: &[&str]| {
        w.fusion(&[&["run", "mine.toml", "--out", "out"], variant].concat()).success();
        let summary: serde_json::Value = serde_json::from_str(&w.read("out/summary.json")).unwrap();
        summary["score"]["position"]["rms"]
            .as_array()
            .unwrap()
            .iter()
            .map(|rms| rms.as_f64().unwrap().powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let (updated, free) = (end(&[]), end(&["--variant", "free"]));
    // 92 m of path: foot-mounted units are known to reach 2 % of it. Without updates the biases of this unit, 0.12
    // deg/s and 5 mg, make it drift: ½ 0.05 m/s² (90 s)² is 200 m, the RMS over the time a half of that.
    assert!(updated < 2.0 && free > 50.0, "{updated} m with updates, {free} m without");
}

#[test]
fn nothing_is_overwritten() {
    let w = Workspace::new("new-twice");
    w.fusion(&["new", "mine.toml", "--from", "car"]).success();
    let written = w.read("mine.toml");
    assert!(stderr(&w.fusion(&["new", "mine", "--from", "boat"]).code(2)).contains("`mine.toml` exists"));
    assert_eq!(w.read("mine.toml"), written);
    // Identical parts are shared. A changed part stops the command before it writes anything.
    w.fusion(&["new", "other", "--from", "car"]).success();
    w.write("parts/gate/nis.toml", "# mine\n");
    assert!(stderr(&w.fusion(&["new", "third", "--from", "car"]).code(2)).contains("is another one"));
    assert!(!w.path("third.toml").exists());
    assert_eq!(w.read("parts/gate/nis.toml"), "# mine\n");
}

#[test]
fn a_part_of_the_library_is_written_with_what_it_includes_and_an_unknown_one_is_named() {
    let w = Workspace::new("new-part");
    w.fusion(&["new", "mine", "--from", "boat"]).success();
    let exchanged = w.read("mine.toml").replace("parts/gnss/zed-f9p.toml", "parts/gnss/neo-m8.toml");
    w.write("mine.toml", exchanged);
    let missing = stderr(&w.fusion(&["check", "mine.toml"]).code(2));
    assert!(missing.contains("`fusion new --part gnss/neo-m8`"), "{missing}");
    let said = stdout(&w.fusion(&["new", "--part", "gnss/neo-m8"]).success());
    assert!(said.contains("\"parts/gnss/neo-m8.toml\""), "{said}");
    w.fusion(&["check", "mine.toml"]).success();
    let unknown = stderr(&w.fusion(&["new", "--part", "gnss/neo-m9"]).code(2));
    assert!(unknown.contains("did you mean `gnss/neo-m8`?"), "{unknown}");
    // Every file of the library is listed, by kind.
    let list = stdout(&w.fusion(&["new", "--list"]).success());
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/parts");
    for kind in std::fs::read_dir(library)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.is_dir())
    {
        let line = list
            .lines()
            .find(|l| l.split_whitespace().next() == kind.file_name().unwrap().to_str());
        for part in std::fs::read_dir(&kind).unwrap() {
            let name = part.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned();
            assert!(line.is_some_and(|line| line.contains(&name)), "{name}: {list}");
        }
    }
}
