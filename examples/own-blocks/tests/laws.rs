//! The block of this crate under the laws of the framework, and at work in its design with the section of this crate.

#![expect(clippy::unwrap_used, reason = "helpers of tests are tests")]

use fusion::config::Document;
use fusion::design::Design;
use fusion::models::registry;
use fusion::models::testing::check;
use fusion::run::{Options, Summary, run};
use own_blocks::speeds::Speeds;

#[test]
fn the_block_obeys_the_laws_of_its_role() {
    fusion::models::link();
    own_blocks::link();
    let own = registry::all().into_iter().find(|r| r.name == "range_rate").unwrap();
    check(own).unwrap();
    registry::refuse_duplicates().unwrap();
}

#[test]
fn range_rate_carries_the_position_through_an_outage() {
    own_blocks::link();
    let with = summary(&[]);
    let without = summary(&["sensor.range_rate.noise.sigma=1 km/s"]);
    let sensor = with.sensors().iter().find(|s| s.name == "range_rate").unwrap();
    assert!(sensor.accepted > 700 && sensor.nis.as_ref().unwrap().is_consistent(), "{with:?}");
    // The trajectory has 10 m/s.
    let speeds = with.get::<Speeds>().unwrap();
    assert!((speeds.largest[0] - 10.0).abs() < 0.5, "{speeds:?}");
    let drift = |s: &Summary| s.score().unwrap().drift[0].max_horizontal;
    assert!(drift(&with) < 0.7 * drift(&without), "{with:?}\n{without:?}");
}

/// Runs the design with values set.
fn summary(values: &[&str]) -> Summary {
    let (mut document, mistakes) = Document::parse("design.toml", include_str!("../design.toml"));
    assert_eq!(mistakes, []);
    values.iter().for_each(|value| document.set(value).unwrap());
    run(&Design::read(document).unwrap(), &Options::default(), &mut |_| {}).unwrap()
}
