//! Real recorded logs, scored against their references.
//!
//! The data are not part of the project. The tests look for them at `$FUSION_DATA`, by default `../shared/data`.
//! Without the data these tests say so and pass.

use fusion::config::Document;
use fusion::design::Design;
use fusion::run::{Options, Summary, run};
use fusion::score::Score;
use std::path::{Path, PathBuf};

/// The folder of the data, if it is there.
pub(super) fn data() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let dir = std::env::var_os("FUSION_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from);
    let found = dir.is_dir().then_some(dir);
    if found.is_none() {
        eprintln!("skipped: no recorded data at $FUSION_DATA or ../shared/data");
    }
    found
}

/// Returns true if the data exist. Otherwise it prints a message.
pub(super) fn recorded() -> bool {
    data().is_some()
}

/// `configs/real/NAME.toml` with variants and overrides; `None` without the data.
pub(super) fn real_design(name: &str, variants: &[&str], sets: &[&str]) -> Option<(Design, Options)> {
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/real");
    let options = Options {
        data: Some(data()?),
        base: base.clone(),
        ..Options::default()
    };
    let file = base.join(format!("{name}.toml"));
    let mut document = Document::load(&file).unwrap_or_else(|d| panic!("{d}"));
    for variant in variants {
        document.overlay(&format!("variant.{variant}")).unwrap();
    }
    sets.iter().for_each(|set| document.set(set).unwrap());
    Some((Design::read(document).unwrap_or_else(|e| panic!("{e}")), options))
}

/// Runs it.
pub(super) fn real(name: &str, variants: &[&str], sets: &[&str]) -> Option<Summary> {
    let (design, options) = real_design(name, variants, sets)?;
    Some(run(&design, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{e}")))
}

/// The largest horizontal error in every outage of `seconds`, from each of `starts`, one every `every` seconds.
fn outages(name: &str, starts: &[u32], seconds: u32, every: u32) -> Option<Vec<f64>> {
    outages_of(name, &[], starts, (seconds, every), "filter.backend=error_state")
}

/// The same for a design with further `variants` and one key `set`.
fn outages_of(name: &str, variants: &[&str], starts: &[u32], (seconds, every): (u32, u32), set: &str) -> Option<Vec<f64>> {
    let variants = [&["outages"], variants].concat();
    let mut drifts = Vec::new();
    for start in starts {
        let window =
            format!("source.gnss.fault.outage.window={{ from = \"{start} s\", duration = \"{seconds} s\", every = \"{every} s\" }}");
        let summary = real(name, &variants, &[&window, set])?;
        drifts.extend(summary.score().unwrap().drift.iter().map(|d| d.max_horizontal));
    }
    drifts.sort_by(f64::total_cmp);
    Some(drifts)
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// NEES of position and of velocity, with the ideal value 3, as required for the recorded logs.
fn is_honest(score: &Score) {
    for nees in [score.nees_position.unwrap(), score.nees_velocity.unwrap()] {
        assert!((1.5..=5.0).contains(&nees.mean) && nees.dof == 3, "{nees:?}");
    }
    assert_eq!(score.nees_undefined, [0; 3]);
}

#[test]
fn the_car_with_single_point_gnss_is_within_its_bounds() {
    let Some(summary) = real("pntos-car", &[], &[]) else { return };
    let score = summary.score().unwrap();
    // Bounds of the specification; a prototype reached 1.41 m, 0.07 deg, 0.37 deg.
    assert!(score.horizontal_rms <= 1.60, "{}", score.horizontal_rms);
    let attitude = score.attitude_deg.unwrap();
    assert!(
        attitude.rms[0] <= 0.08 && attitude.rms[1] <= 0.08 && attitude.rms[2] <= 0.40,
        "{attitude:?}"
    );
    // The filter is consistent: NEES of position and velocity within a factor of 2 of 3. The horizontal RMS before the
    // slow GNSS error was a state is 1.405 m; the bound is 3 % above it.
    is_honest(score);
    assert!(score.horizontal_rms <= 1.447, "{}", score.horizontal_rms);
    // Every row that a source delivered is in exactly one count of each of its consumers.
    let of_sources = summary.consumers().iter().filter_map(|c| {
        let source = summary.sources().iter().find(|s| s.name == c.stream)?;
        Some((c, source.used))
    });
    for (c, delivered) in of_sources {
        let counted: u64 = c.outcomes().iter().map(|(_, count)| count).sum();
        assert_eq!((c.rows, counted), (delivered, delivered), "{c:?}");
    }
    let fixes = summary.consumers().iter().find(|c| c.name == "gnss_position").unwrap();
    assert!(fixes.used == 2470 && fixes.before_run > 50 && fixes.before_start > 50, "{fixes:?}");
    // It starts by itself, at the first fix in motion.
    assert!((130.0..136.0).contains(&summary.start().started.unwrap()));
}

#[test]
fn the_car_drifts_little_in_a_minute_without_gnss() {
    let Some(drifts) = outages("pntos-car", &[300, 360, 420], 60, 180) else {
        return;
    };
    assert!(drifts.len() >= 36, "{}", drifts.len());
    // 10 % above RMS 6.09 m and median 3.90 m, the values before the slow GNSS error was a state. The specification
    // requires 9 m and 6.5 m.
    assert!(
        rms(&drifts) <= 6.70 && drifts[drifts.len() / 2] <= 4.29,
        "{} {drifts:?}",
        rms(&drifts)
    );
    // Other starts, which were not used for tuning, are equally good.
    let Some(others) = outages("pntos-car", &[320, 390], 60, 180) else {
        return;
    };
    assert!(rms(&others) <= 9.0, "{} {others:?}", rms(&others));
}

#[test]
fn the_drive_with_rtk_is_within_centimetres_between_its_fixes() {
    let Some(summary) = real("rtklib-drive", &[], &[]) else { return };
    let score = summary.score().unwrap();
    assert!(
        score.epochs > 1300 && score.horizontal_rms <= 0.038,
        "{} of {}",
        score.horizontal_rms,
        score.epochs
    );
    is_honest(score);
}

#[test]
fn the_drive_drifts_little_in_half_a_minute_without_gnss() {
    let Some(drifts) = outages("rtklib-drive", &[120, 145, 170], 30, 75) else {
        return;
    };
    assert!(drifts.len() >= 15, "{}", drifts.len());
    // RMS 5.26 m and median 3.16 m, including outages cut by the end of the log. The specification requires 16 m and 8
    // m.
    assert!(
        rms(&drifts) <= 5.46 && drifts[drifts.len() / 2] <= 3.55,
        "{} {drifts:?}",
        rms(&drifts)
    );
}

#[test]
fn an_invariant_chart_drifts_no_more_where_the_constraints_are_honest() {
    let drift = |variants: &[&str], backend: &str| {
        let set = format!("filter.backend={backend}");
        outages_of("rtklib-drive", variants, &[120, 145, 170], (30, 75), &set).map(|drifts| rms(&drifts))
    };
    // RMS of 16 outages: 4.94 m and 4.84 m. It was 5.00 m and 6.35 m with a vertical constraint that is contradicted by
    // more than its 1σ for eight seconds.
    let Some(body) = drift(&["loose-constraint"], "error_state") else {
        return;
    };
    let invariant = drift(&["loose-constraint"], "invariant").unwrap();
    assert!(body <= 5.2 && invariant <= 1.02 * body, "{invariant} of {body}");
}

#[test]
fn the_attitude_reference_knows_its_errors_where_nothing_disturbs_it() {
    let Some(summary) = real("broad", &[], &[]) else { return };
    let own = summary.score().unwrap();
    let cascaded = real("broad", &["cascaded"], &[]).unwrap();
    for score in [own, cascaded.score().unwrap(), &cascaded.inside()[0].score] {
        let nees = score.nees_attitude.unwrap();
        // 3 is ideal; a factor of 2, as required.
        assert!((1.5..=6.0).contains(&nees.mean), "{nees:?}");
    }
    // Measured 1.15° and 0.50°, and 5 %; the cascade has 1.58° and 0.51°.
    let [heading, inclination] = [own.heading_rmse_deg, own.inclination_rmse_deg].map(Option::unwrap);
    assert!(heading < 1.21 && inclination < 0.53, "{heading} {inclination}");
}

#[test]
fn the_robot_is_consistent_in_every_sensor() {
    let Some(summary) = real("husky", &[], &[]) else { return };
    for sensor in summary.sensors() {
        let nis = sensor.nis.as_ref().unwrap();
        assert!(nis.count > 900 && nis.is_consistent(), "{}: {nis:?}", sensor.name);
    }
}

#[test]
fn the_hand_held_unit_is_consistent_with_motion_capture() {
    let mut means = Vec::new();
    for seed in ["run.seed=2", "run.seed=3", "run.seed=4", "run.seed=5"] {
        let Some(summary) = real("tumvi", &[], &[seed]) else { return };
        let score = summary.score().unwrap();
        let (p, v) = (score.nees_position.unwrap(), score.nees_velocity.unwrap());
        assert!(p.is_consistent() && v.is_consistent(), "{seed}: {p:?} {v:?}");
        means.push((p.mean, v.mean));
    }
    // Over all seeds together the means are closer to 3.
    let mean = |f: fn(&(f64, f64)) -> f64| means.iter().map(f).sum::<f64>() / means.len() as f64;
    assert!(
        (2.6..3.4).contains(&mean(|m| m.0)) && (2.6..3.4).contains(&mean(|m| m.1)),
        "{means:?}"
    );
}

#[test]
fn every_backend_gives_the_same_run_to_linearisation_error() {
    // The charts differ at second order in the correction. This is a few per cent of a σ for a correction of a few
    // degrees, and below one per mille of the error on a running filter.
    for (name, tolerance) in [("rtklib-drive", 2e-3), ("tumvi", 2e-2)] {
        let Some(body) = real(name, &[], &[]) else { return };
        let body = body.score().unwrap().horizontal_rms;
        for backend in ["ekf", "error_state", "iekf", "invariant", "ukf"] {
            let set = format!("filter.backend={backend}");
            let other = real(name, &[], &[&set]).unwrap().score().unwrap().horizontal_rms;
            assert!((other / body - 1.0).abs() < tolerance, "{name} {backend}: {other} {body}");
        }
        for chart in ["navigation", "additive_euler", "additive_quaternion", "body", "left_invariant"] {
            let set = format!("filter.chart={chart}");
            let other = real(name, &[], &[&set]).unwrap().score().unwrap().horizontal_rms;
            assert!((other / body - 1.0).abs() < tolerance, "{name} {chart}: {other} {body}");
        }
    }
}

#[test]
fn both_covariance_forms_give_the_same_run_to_rounding() {
    let joseph = real("rtklib-drive", &[], &["filter.form=joseph"]);
    let standard = real("rtklib-drive", &[], &["filter.form=standard"]);
    let (Some(joseph), Some(standard)) = (joseph, standard) else {
        return;
    };
    let (joseph, standard) = (joseph.score().unwrap().horizontal_rms, standard.score().unwrap().horizontal_rms);
    // 50,000 steps of rounding at 1e-16, amplified by the conditioning of P.
    assert!((joseph - standard).abs() < 1e-9, "{joseph} {standard}");
}

#[test]
fn the_two_condition_gate_bears_outliers_and_a_false_track() {
    // Bounds of the specification: 1.02 and 1.35 times the clean run.
    for (name, bound) in [("pntos-car", 1.02), ("rtklib-drive", 1.35)] {
        let horizontal = |variants: &[&str], sets: &[&str]| Some(real(name, variants, sets)?.score().unwrap().horizontal_rms);
        let Some(clean) = horizontal(&[], &["run.seed=1"]) else { return };
        for seed in ["run.seed=1", "run.seed=2", "run.seed=3"] {
            let gated = horizontal(&["outliers", "gated"], &[seed]).unwrap();
            assert!(gated <= bound * clean, "{name} {seed}: {gated} of {clean}");
        }
        // The design has its own gate.
        let ungated = [
            "run.seed=1",
            "sensor.gnss_position.gate={ type = \"none\" }",
            "sensor.gnss_velocity.gate={ type = \"none\" }",
        ];
        let open = horizontal(&["outliers"], &ungated).unwrap();
        assert!(open > 1.5 * clean, "{name}: without the gate {open} of {clean}");
    }
}

#[test]
fn a_field_that_is_wrong_turns_the_heading_less_than_in_the_cascade() {
    let heading = |variants: &[&str]| Some(real("broad", variants, &[])?.score().unwrap().heading_rmse_deg.unwrap());
    // Where the body moves, the field differs from that of the start by 8 % and 3° of dip, and by 2.9° in direction.
    // The magnet turns it by 10°. Measured 1.18° and 1.43°, and 5 %; the cascade has 2.08° and 1.81°.
    let Some(moved) = heading(&["trial_15"]) else { return };
    let beside = heading(&["trial_31"]).unwrap();
    assert!(moved < 1.24 && beside < 1.50, "{moved} {beside}");
    // Measured 1.9° and 2.7°.
    let [moved, beside] = ["trial_15", "trial_31"].map(|trial| heading(&[trial, "wary"]).unwrap());
    assert!(moved < 1.94 && beside < 2.79, "wary: {moved} {beside}");
    // A filter that accepts every field is overconfident: measured 118 and 9.9.
    let nees = |variants: &[&str]| real("broad", variants, &[]).unwrap().score().unwrap().nees_attitude.unwrap().mean;
    let (gated, believing) = (nees(&["trial_31"]), nees(&["trial_31", "ungated"]));
    assert!(believing > 5.0 * gated, "every field believed: {believing}, gated {gated}");
}
