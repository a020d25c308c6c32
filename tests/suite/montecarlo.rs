//! Campaigns: the same results on any number of threads, and as separate runs.

use crate::support::{Workspace, stderr, stdout};
use fusion::design::Design;
use fusion::run::{Options, Smoothing, run};
use fusion_judge::campaign::{monte_carlo, seed_of};

/// A shipped design.
fn design(file: &str, set: &[&str]) -> Design {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/").to_owned() + file;
    let mut document = fusion::config::Document::load(path.as_ref()).unwrap_or_else(|d| panic!("{d}"));
    set.iter().for_each(|set| document.set(set).unwrap_or_else(|d| panic!("{d:?}")));
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

/// A short run, with GNSS stamps between the samples of the inertial unit.
const SETS: [&str; 3] = [
    "run.stop=30",
    "simulation.sensor.position.start=0.123",
    "simulation.imu.preset=\"consumer\"",
];

#[test]
fn a_campaign_is_the_same_on_one_thread_and_on_two() {
    let design = design("ins-gps.toml", &SETS);
    let table = |threads| {
        let campaign = monte_carlo(&design, &Options::default(), 5, 7, threads, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
        assert_eq!(campaign.pace.threads, threads);
        assert_eq!(campaign.pace.epochs, 5 * campaign.rows[0].epochs);
        let mut table = Vec::new();
        campaign.write(&mut table).unwrap();
        String::from_utf8(table).unwrap()
    };
    assert_eq!(table(1), table(2));
}

#[test]
fn what_runs_share_changes_no_bit_of_them() {
    for set in [&SETS[..], &[SETS[0], "process.integrator=\"two_sample\""]] {
        let design = design("ins-gps.toml", set);
        let campaign = monte_carlo(&design, &Options::default(), 3, 1, 2, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
        for row in &campaign.rows {
            let options = Options {
                seed: Some(seed_of(1, row.run)),
                smooth: Smoothing::Never,
                ..Options::default()
            };
            let alone = run(&design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
            let score = alone.score.unwrap();
            // Debug prints every digit.
            assert_eq!(format!("{:?}", score.blocks), format!("{:?}", row.blocks));
            assert_eq!((score.position.unwrap().rms, alone.epochs), (row.rms, row.epochs));
        }
    }
}

/// Runs whose filters report that they are lost are counted, and named for repetition.
#[test]
fn lost_runs_are_told_with_their_seeds() {
    let w = Workspace::new("montecarlo-lost");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps.toml");
    let campaign = ["montecarlo", design, "-n", "3", "--set", "run.stop=60", "--out", "out"];
    let ran = w.fusion(&campaign).success();
    assert!(!stderr(&ran).contains("health:"), "{}", stderr(&ran));
    assert!(
        stdout(&ran).contains(" over 3 runs: NEES over its degrees of freedom, of "),
        "{}",
        stdout(&ran)
    );
    // Limits that no filter meets.
    let limits = "health.innovations={ degraded = 0.1, lost = 0.2 }";
    let ran = w.fusion(&[&campaign[..], &["--set", limits]].concat()).success();
    let told = stderr(&ran);
    assert!(told.contains("health: of 3 runs the filter was lost in 3; repeat one"), "{told}");
    let seed = seed_of(1, 0).to_string();
    assert!(told.contains(&seed), "{told}");
    let again = ["run", design, "--set", "run.stop=60", "--set", limits, "--seed", &seed, "--strict"];
    w.fusion(&again).code(3);
    let runs = w.read("out/runs.csv");
    let column = runs.lines().next().unwrap().split(',').position(|c| c == "worst_health").unwrap();
    assert!(runs.lines().skip(1).all(|row| row.split(',').nth(column) == Some("lost")), "{runs}");
    assert!(w.read("out/montecarlo.html").contains("health at worst"));
}
