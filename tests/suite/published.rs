//! The published tables: a hundred runs of each filter, as `fusion compare FILE -n 100` prints them.
//!
//! The figures are those of the UKF-M project (Brossard, Barrau, Bonnabel 2019) and of an independent
//! implementation of the same benchmarks, with the spread of its batches of a hundred runs. RMSE is over
//! all times and runs, NEES over its dimension; in the plane NEES counts after 20 s.

use fusion::campaign::{Pooled, monte_carlo};
use fusion::config::Document;
use fusion::design::Design;
use fusion::run::Options;
use std::path::Path;

fn pooled(name: &str) -> Pooled {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("configs/published/{name}.toml"));
    let document = Document::load(&file).unwrap_or_else(|d| panic!("{d}"));
    let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
    let campaign = monte_carlo(&design, &Options::default(), 100, 1, 0, &|_| {});
    campaign.unwrap_or_else(|d| panic!("{d}")).pooled()
}

fn within(value: Option<f64>, low: f64, high: f64) -> bool {
    value.is_some_and(|v| (low..high).contains(&v))
}

#[test]
fn localisation_with_an_unknown_heading_is_as_published_for_the_plain_error_state() {
    let all = pooled("localisation-2d");
    // Attitude 13.1° ± 1.2°, position 0.96 m ± 0.20 m: three times the spread of batches. NEES is
    // heavy-tailed: it is far above 1.
    assert!(within(all.attitude, 9.5, 16.7) && within(all.position, 0.36, 1.56), "{all:?}");
    assert!(
        within(all.nees[0], 10.0, f64::INFINITY) && within(all.nees[2], 2.0, f64::INFINITY),
        "{all:?}"
    );
}

#[test]
fn inertial_navigation_with_landmarks_is_as_published_for_the_plain_error_state() {
    let all = pooled("inertial-landmarks");
    // Attitude 3.01° ± 0.14°, position 0.80 m ± 0.06 m, NEES of attitude 10.1 ± 1.9: four times the
    // spread of batches. That of the position, 268 ± 42, is heavy-tailed: it is far above 1.
    assert!(within(all.attitude, 2.4, 3.6) && within(all.position, 0.56, 1.04), "{all:?}");
    assert!(
        within(all.nees[2], 2.5, 18.0) && within(all.nees[0], 100.0, f64::INFINITY),
        "{all:?}"
    );
}
