//! Two published tables, reproduced by the designs in configs/published.
//!
//! The figures are those of the UKF-M project's benchmarks `localization` and `inertial_navigation` (Brossard, Barrau,
//! Bonnabel 2019, github.com/CAOR-MINES-ParisTech/ukfm) and of an independent re-implementation of them: several
//! batches of 100 runs, ± between batches. A bound is three of these ± about the re-implementation. A figure that
//! depends on a few bad runs (the NEES of inconsistent filters) is checked by an inequality.

use fusion::config::Document;
use fusion::design::{Design, FilterSpec};
use fusion::run::{Options, run};
use fusion_judge::campaign::monte_carlo;
use std::path::PathBuf;

fn design(file: &str, backend: &str) -> Design {
    let path = [env!("CARGO_MANIFEST_DIR"), "configs", "published", file]
        .iter()
        .collect::<PathBuf>();
    let mut document = Document::load(&path).unwrap_or_else(|d| panic!("{d}"));
    document.set(&FilterSpec::table_of(backend).unwrap()).unwrap();
    Design::read(document).unwrap_or_else(|d| panic!("{backend}: {d}"))
}

/// RMSE of attitude \[deg\] and position \[m\], NEES of both over their dimension.
#[derive(Clone, Copy, Debug)]
struct Row {
    attitude: f64,
    position: f64,
    nees_attitude: f64,
    nees_position: f64,
}

/// The output of `fusion compare configs/published/FILE --backend BACKEND -n 100`.
fn table(file: &str, backend: &str) -> Row {
    let campaign = monte_carlo(&design(file, backend), &Options::default(), 0..100, 1, 0, &|_| {});
    let pooled = campaign.unwrap_or_else(|d| panic!("{backend}: {d}")).campaign.pooled();
    let row = Row {
        attitude: pooled.attitude.unwrap(),
        position: pooled.position.unwrap(),
        nees_attitude: pooled.nees[2].unwrap(),
        nees_position: pooled.nees[0].unwrap(),
    };
    eprintln!("{file} {backend}: {row:?}");
    row
}

/// Asserts that a figure is within `bound` of the wanted value.
#[track_caller]
fn near(found: f64, wanted: f64, bound: f64, what: &str) {
    assert!((found - wanted).abs() <= bound, "{what}: {found}, wanted {wanted} ± {bound}");
}

#[test]
fn localisation_in_the_plane_is_as_published() {
    const FILE: &str = "localisation-2d.toml";
    for backend in ["invariant", "left_invariant"] {
        let row = table(FILE, backend);
        near(row.attitude, 12.1, 3.0 * 0.7, backend);
        near(row.position, 0.46, 3.0 * 0.03, backend);
        near(row.nees_attitude, 0.94, 3.0 * 0.08, backend);
        near(row.nees_position, 0.98, 3.0 * 0.05, backend);
    }
    // Published once, without a spread: the spread of the invariant filter is used.
    let unscented = table(FILE, "right_invariant+unscented");
    near(unscented.attitude, 11.35, 3.0 * 0.7, "unscented");
    near(unscented.position, 0.45, 3.0 * 0.03, "unscented");
    near(unscented.nees_position, 1.01, 3.0 * 0.05, "unscented");
    let ekf = table(FILE, "ekf");
    near(ekf.attitude, 13.1, 3.0 * 1.2, "ekf");
    near(ekf.position, 0.96, 3.0 * 0.20, "ekf");
    assert!(ekf.nees_position > 10.0, "{ekf:?}");
}

#[test]
fn inertial_navigation_with_landmarks_is_as_published() {
    const FILE: &str = "inertial-landmarks.toml";
    let invariant = table(FILE, "invariant");
    near(invariant.attitude, 2.69, 3.0 * 0.10, "invariant");
    near(invariant.position, 0.241, 3.0 * 0.005, "invariant");
    near(invariant.nees_attitude, 1.11, 3.0 * 0.02, "invariant");
    near(invariant.nees_position, 1.22, 3.0 * 0.04, "invariant");
    let iterated = table(FILE, "invariant+iterated");
    near(iterated.attitude, 2.68, 3.0 * 0.10, "invariant, iterated");
    near(iterated.position, 0.232, 3.0 * 0.007, "invariant, iterated");
    near(iterated.nees_attitude, 0.98, 3.0 * 0.01, "invariant, iterated");
    near(iterated.nees_position, 0.98, 3.0 * 0.02, "invariant, iterated");
    let plain = table(FILE, "error_state");
    // The spread of the batches depends on a few bad runs: published 0.82, the re-implementation 0.80 ± 0.06, here 0.82
    // to 1.02 in four batches.
    near(plain.position, 0.80, 4.0 * 0.06, "error_state");
    assert!(
        plain.attitude > invariant.attitude && plain.nees_position > 100.0 && plain.nees_attitude > 5.0,
        "{plain:?}"
    );
    let again = table(FILE, "iekf");
    assert!(again.nees_position > 100.0, "in the wrong chart iteration gains nothing: {again:?}");
}

#[test]
fn with_the_full_reset_left_and_right_are_one_filter_and_without_it_they_are_two() {
    let run = |backend: &str| {
        let design = design("inertial-landmarks.toml", backend);
        let summary = run(&design, &Options::default(), &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
        let score = summary.score().unwrap();
        (score.position.unwrap().rms, score.nees_position.unwrap().mean)
    };
    let apart = |reset: &str| {
        let (left, right) = (run(&format!("left_invariant+{reset}")), run(&format!("right_invariant+{reset}")));
        let errors = left.0.iter().zip(&right.0).map(|(l, r)| (l - r).abs()).fold(0.0, f64::max);
        (errors, (left.1 / right.1 - 1.0).abs())
    };
    let (full, plain) = (apart("full"), apart("plain"));
    // 1e-9: rounding over 3000 predictions and 30 updates.
    assert!(full.0 < 1e-9 && full.1 < 1e-9, "{full:?}");
    assert!(plain.0 > 1e-5 && plain.1 > 1e-4, "{plain:?}");
}
