//! Fixed parameters of sensors, and sensors that the filter does not follow.

use super::*;

#[test]
fn a_lever_arm_with_the_wrong_sign_is_named_on_the_car() {
    // The reference point is 1.2 m ahead of the inertial unit: if the reference is fused, its velocity has this lever
    // arm.
    let fused = |arm: &str| {
        vec![
            "source.gnss.path=\"pntos_cobra_car/derived/ref_20hz.csv.gz\"".to_owned(),
            "source.gnss.keep={ every = 20 }".to_owned(),
            format!("sensor.gnss_position.lever_arm={{ estimate = true, initial = {arm}, sigma = \"0.1 m\" }}"),
            "run.stop=\"1300 s\"".to_owned(),
        ]
    };
    let Some((design, options)) = car(false, &fused("[\"1.2 m\", 0, 0]")) else {
        return;
    };
    let (warnings, found) = told(&design, &options);
    assert_eq!(warnings, "", "{:?}", found.comparisons);
    let (design, options) = car(false, &fused("[\"-1.2 m\", 0, 0]")).unwrap();
    let (warnings, _) = told(&design, &options);
    assert!(
        warnings.contains("the lever arm of `gnss_position` has the wrong sign along x"),
        "{warnings}"
    );
    assert!(
        warnings.contains("write `lever_arm.initial = [\"1.2 m\", \"0 m\", \"0 m\"]`"),
        "{warnings}"
    );
    // The antenna's lever arm was found by fusing the log: 0, 0.3, −0.35 m. A 1σ of a metre declares no sign.
    for (sigma, is_told) in [("0.1 m", true), ("1 m", false)] {
        let arm = format!("sensor.gnss_position.lever_arm={{ estimate = true, initial = [0, \"-0.3 m\", 0], sigma = \"{sigma}\" }}");
        let (design, options) = car(true, &[arm]).unwrap();
        let (warnings, _) = told(&design, &options);
        assert_eq!(
            warnings.contains("the lever arm of `gnss_position` has the wrong sign along y"),
            is_told,
            "{sigma}: {warnings}"
        );
    }
}

#[test]
fn a_fixed_parameter_that_the_data_contradict_is_told_and_no_other() {
    let w = Workspace::new("frames-parameters");
    rough_sea(&w);
    // Each as declared for the log: 3.5 deg, 0, 0, −3 m ahead and 2.5 m above, none.
    for (set, told) in [
        ("sensor.magnetometer.declination=\"12 deg\"", "`declination` of `magnetometer`"),
        ("sensor.log.scale=0.1", "`scale` of `log`"),
        ("sensor.gnss_position.time_offset=\"0.3 s\"", "`time_offset` of `gnss_position`"),
        ("sensor.gnss_position.lever_arm=[0, 0, 0]", "`lever_arm` of `gnss_position`"),
        ("sensor.log.mounting=[0, 0, \"8 deg\"]", "`mounting` of `log`"),
        ("sensor.log.current=[0, 0, 0]", "`current` of `log`"),
    ] {
        let ran = w.fusion(&["check", "log/sea.toml", "--data", "log", "--set", set]).success();
        let warned = stderr(&ran);
        assert_eq!(warned.matches("warning[").count(), 1, "{set}:\n{warned}");
        assert!(
            warned.contains(&format!("warning[fixed-parameter]: {told} is declared as")),
            "{set}:\n{warned}"
        );
    }
    // Both sensors of the receiver use the same antenna.
    let set = "sensor.gnss_velocity.lever_arm=[0, 0, 0]";
    let ran = w.fusion(&["check", "log/sea.toml", "--data", "log", "--set", set]).success();
    let shared = "here stands `lever_arm = { shared = \"gnss_position.lever_arm\" }`";
    assert!(stderr(&ran).contains(shared), "{}", stderr(&ran));
    // A small error that is not chance.
    let set = "sensor.magnetometer.declination=\"5 deg\"";
    let ran = w
        .fusion(&["check", "log/sea.toml", "--data", "log", "--format", "json", "--set", set])
        .success();
    assert!(!stderr(&ran).contains("declination"), "{}", stderr(&ran));
    let listed = stdout(&ran);
    assert!(
        listed.contains("within 2 deg of what is declared, but") && listed.contains("find it as a state"),
        "{listed}"
    );
}

/// The log of a template, `log/design.toml`.
fn recorded(w: &Workspace, template: &str) {
    w.fusion(&["new", "mine", "--from", template]).success();
    w.fusion(&["record", "mine.toml", "--seed", "3", "--out", "log"]).success();
}

/// The warnings and the listed parameters, with these changes of a recorded log.
fn judged(w: &Workspace, sets: &[&str]) -> (String, String) {
    let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", *set]).collect();
    // With JSON, sentences are not wrapped.
    let args = [&["check", "log/design.toml", "--data", "log", "--format", "json"], &sets[..]].concat();
    let ran = w.fusion(&args).success();
    (stderr(&ran), stdout(&ran))
}

/// Each case gives one warning, which contains these words.
fn one_each(w: &Workspace, cases: &[(&[&str], &str, &str)]) {
    for (sets, told, help) in cases {
        let (warned, _) = judged(w, sets);
        assert_eq!(warned.matches("warning[").count(), 1, "{sets:?}:\n{warned}");
        assert!(warned.contains(told) && warned.contains(help), "{sets:?}:\n{warned}");
    }
}

#[test]
fn of_an_underwater_vehicle_the_cause_is_told_and_not_what_acts_like_it() {
    let w = Workspace::new("frames-auv");
    recorded(&w, "auv");
    // Attitude and mounting of the transceiver compensate each other: as states, both move away from the true values.
    let (warned, listed) = judged(&w, &[]);
    assert_eq!(warned, "");
    assert!(listed.contains("the data do not tell it from others: alone it is"), "{listed}");
    let cases: [(&[&str], &str, &str); 4] = [
        (
            &["sensor.usbl.time_offset=\"2 s\""],
            "`time_offset` of `usbl` is declared as",
            "where it is estimated, it becomes 0.0",
        ),
        (
            &["source.depth.channels.depth.column=\"-depth [m]\""],
            "`depth.depth` has a wrong sign",
            "write `column = \"depth [m]\"`",
        ),
        (
            &["sensor.dvl.mounting.initial=[0, 0, \"90 deg\"]"],
            "the axes of `dvl` are turned by -90 deg about down",
            "write `mounting = [\"0 deg\", \"0 deg\", \"0 deg\"]`",
        ),
        (
            &["sensor.usbl.attitude=[0, 0, \"90 deg\"]"],
            "the axes of `usbl` are turned by -90 deg about down",
            "write `attitude = [\"0 deg\", \"0 deg\", \"0 deg\"]`",
        ),
    ];
    one_each(&w, &cases);
}

#[test]
fn of_an_odometer_sign_unit_scale_and_delay_are_told() {
    let w = Workspace::new("frames-odometer");
    recorded(&w, "car");
    assert_eq!(judged(&w, &[]).0, "");
    what_is_tried_is_told(&w);
    let cases: [(&[&str], &str, &str); 6] = [
        (
            &["source.odometer.channels.speed.scale=-1"],
            "the numbers of `odometer` have the wrong sign",
            "change the sign",
        ),
        (
            &["source.odometer.channels.speed.scale=3.6"],
            "the numbers of `odometer` are too large by a factor of 3.5",
            "leave out `scale`",
        ),
        // Reported in preference to a mounting, which would have the same effect.
        (
            &["source.odometer.time.offset=\"-0.5 s\"", "sensor.odometer.time_offset=\"0.1 s\""],
            "`time_offset` of `odometer` is declared as",
            "in all the delay is 0.0",
        ),
        (
            &["source.odometer.time.offset=\"0.5 s\""],
            "`time_offset` of `odometer` is left out",
            "in all the delay is 0.0",
        ),
        // A declared latency that is too large is not a negative latency.
        (
            &["source.gnss.channels.position.latency=\"0.3 s\""],
            "`time_offset` of `gnss_position` is left out",
            "in all the delay is -0.00",
        ),
        // If the total is negative, the other clock is late.
        (
            &["source.imu.time.offset=\"0.2 s\""],
            "the stamps of `imu` are about 0.17 s late",
            "write `source.imu.time.offset = \"0.03 s\"`",
        ),
    ];
    one_each(&w, &cases);
}

/// For a sensor that the filter follows badly. The threads determine which trial ends last.
fn what_is_tried_is_told(w: &Workspace) {
    let file = w.path("log/design.toml");
    let (mut document, _) = Document::parse("design.toml", &w.read("log/design.toml"));
    assert!(document.compose(&file, Files::Disk).is_empty());
    document.set("source.odometer.time.offset=\"0.5 s\"").unwrap();
    let design = Design::read(document).unwrap_or_else(|e| panic!("{e}"));
    let options = Options {
        data: Some(w.path("log")),
        ..Options::default()
    };
    let steps = std::sync::Mutex::new(Vec::new());
    let heard = |step: fusion_advice::frames::Step<'_>| steps.lock().unwrap().push((step.what.to_owned(), step.done, step.all));
    let judged = judge(&design, &options, &heard).unwrap_or_else(|d| panic!("{d}"));
    let steps = steps.into_inner().unwrap();
    assert!(steps.iter().all(|(_, done, all)| done <= all), "{steps:?}");
    let is_ended = |(_, done, all): &&(String, usize, usize)| done == all && *all > 1;
    let ended = steps.iter().filter(is_ended).count();
    assert!(ended >= 2, "near what is declared, and far from it: {steps:?}, {}", judged.mistakes);
    assert!(steps.iter().any(|(what, ..)| what == "`time_offset` of `odometer`"), "{steps:?}");
}

#[test]
fn mirrored_columns_of_a_doppler_log_and_a_noise_that_leaves_no_weight_are_named() {
    let w = Workspace::new("frames-dvl");
    w.fusion(&["new", "mine", "--from", "auv"]).success();
    w.fusion(&["record", "mine.toml", "--out", "log"]).success();
    assert_eq!(warned(&w, &[]), "");
    let columns = |axes: [&str; 3]| {
        let named = axes.map(|axis| match axis.strip_prefix('-') {
            Some(axis) => format!("\"-body_velocity_{axis} [m/s]\""),
            None => format!("\"body_velocity_{axis} [m/s]\""),
        });
        format!("[{}]", named.join(", "))
    };
    let right = columns(["x", "y", "z"]);
    assert!(w.read("log/design.toml").contains(&right));
    for wrong in [["y", "x", "z"], ["-y", "-x", "z"], ["x", "-y", "z"]] {
        let warned = warned(&w, &[&format!("source.dvl.channels.body_velocity.columns={}", columns(wrong))]);
        assert_eq!(warned.matches("warning[").count(), 1, "{wrong:?}: {warned}");
        assert!(warned.contains(&format!("write `columns = {right}`")), "{wrong:?}: {warned}");
    }
    let noise = "sensor.depth.noise.sigma=\"1 km\"";
    let ran = w
        .fusion(&["check", "log/design.toml", "--data", "log", "--format", "json", "--set", noise])
        .success();
    assert!(
        stdout(&ran).contains("times the scatter of its innovations, so it hardly counts"),
        "{}",
        stdout(&ran)
    );
}
