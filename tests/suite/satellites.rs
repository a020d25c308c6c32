//! Raw GNSS: the published demonstration of a tightly coupled filter, and few satellites for a while, compared with the
//! position of a receiver.

use fusion::config::Document;
use fusion::design::Design;
use fusion::run::Options;
use fusion_judge::campaign::{RunRow, Runs, monte_carlo};
use std::path::Path;

/// Twenty runs of a design or of its variant, with the assignment `set`.
fn runs(file: &str, variant: Option<&str>, set: &str) -> Runs {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
    let mut document = Document::load(&path).unwrap_or_else(|d| panic!("{d}"));
    if let Some(variant) = variant {
        document.overlay(&format!("variant.{variant}")).unwrap_or_else(|d| panic!("{d:?}"));
    }
    if !set.is_empty() {
        document.set(set).unwrap_or_else(|d| panic!("{d:?}"));
    }
    let design = Design::read(document).unwrap_or_else(|d| panic!("{file}: {d}"));
    monte_carlo(&design, &Options::default(), 0..20, 1, 0, &|_| {}).unwrap_or_else(|d| panic!("{file}: {d}"))
}

/// The published draw has 3.485, 0.298, 3.015 m and 0.306 deg. The errors of the atmosphere, constant in a run, dominate
/// the position: its RMS in a run is the size of one normal number times that of all runs. The initial heading is wrong by
/// 1 deg in every run, so its RMS is nearly the same.
#[test]
fn the_published_demonstration_lies_among_twenty_draws() {
    let campaign = runs("published/groves-tight.toml", None, "");
    for (k, (axis, published)) in [("north", 3.485), ("east", 0.298), ("down", 3.015)].into_iter().enumerate() {
        let squares: f64 = campaign.rows.iter().map(|row| row.rms[k] * row.rms[k]).sum();
        let ratio = published / (squares / 20.0).sqrt();
        eprintln!("{axis}: the published draw is {ratio:.3} of the RMS of twenty draws");
        // The quantiles 0.025 and 0.975 of the size of a normal number.
        assert!((0.0313..2.24).contains(&ratio), "{axis}: {ratio}");
    }
    let mut heading: Vec<f64> = campaign.rows.iter().map(|row| row.attitude_rms[2]).collect();
    heading.sort_by(f64::total_cmp);
    eprintln!("heading: {heading:.3?} deg, published 0.306");
    // A draw lies outside of twenty others with a probability of 2/21.
    assert!(heading[0] < 0.306 && heading[19] > 0.306, "{heading:?}");
}

/// The RMS of the horizontal error of each run while few satellites are seen, in order of size.
fn horizontal(variant: Option<&str>, from: u32) -> Vec<f64> {
    let window = format!("reference.episodes=[{{ from = \"{from} s\", duration = \"30 s\" }}]");
    let campaign = runs("urban-canyon.toml", variant, &window);
    let during = |row: &RunRow| row.episodes.as_ref().map(|episodes| episodes.during.horizontal_rms);
    let mut all: Vec<f64> = campaign.rows.iter().map(|row| during(row).unwrap()).collect();
    all.sort_by(f64::total_cmp);
    all
}

/// The bars are those of the specification, for every run. Two satellites and a clock leave a direction to the inertial
/// unit alone, so the gain becomes less: a factor of 11, 6 and 2 here, between the medians.
#[test]
fn a_tightly_coupled_filter_stays_near_with_four_three_and_two_satellites() {
    for (satellites, from, bar, gain) in [(4, 60, 3.0, 8.0), (3, 110, 6.0, 3.0), (2, 160, 15.0, 1.3)] {
        let [tight, loose] = [None, Some("loose")].map(|variant| horizontal(variant, from));
        eprintln!("{satellites} satellites: tight {tight:.1?} m, loose {loose:.1?} m");
        assert!(tight[19] < bar, "{satellites}: {tight:?}");
        assert!(loose[10] > gain * tight[10], "{satellites}: {tight:?} {loose:?}");
    }
}
