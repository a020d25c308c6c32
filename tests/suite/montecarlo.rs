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
        let campaign = monte_carlo(&design, &Options::default(), 0..5, 7, threads, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
        assert_eq!(campaign.campaign.pace.threads, threads);
        assert_eq!(campaign.campaign.pace.epochs, 5 * campaign.rows[0].epochs);
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
        let campaign = monte_carlo(&design, &Options::default(), 0..3, 1, 2, &|_| {}).unwrap_or_else(|d| panic!("{d}"));
        for row in &campaign.rows {
            let options = Options {
                seed: Some(seed_of(1, row.run)),
                smooth: Smoothing::Never,
                ..Options::default()
            };
            let alone = run(&design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
            let score = alone.score().unwrap();
            // Debug prints every digit.
            assert_eq!(format!("{:?}", score.blocks), format!("{:?}", row.blocks));
            assert_eq!((score.position.unwrap().rms, alone.counts().epochs), (row.rms, row.epochs));
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

/// A part is written for the merge even if all its runs fail; the whole campaign without a result is an error.
#[test]
fn a_campaign_without_a_result_is_an_error_and_its_part_is_none() {
    let w = Workspace::new("montecarlo-failed");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/real/auv.toml");
    let with = |args: &[&str]| w.fusion(&[&["montecarlo", design, "--data", "nowhere"], args].concat());
    let told = stderr(&with(&["-n", "2"]).code(2));
    assert!(told.contains("there is no such file") && told.contains("auv.toml:55"), "{told}");
    let part = with(&["--runs", "0..2", "--part", "a"]).success();
    assert!(stderr(&part).contains("2 of 2 runs failed"), "{}", stderr(&part));
    assert!(stdout(&part).contains("Failed runs"), "{}", stdout(&part));
    let told = stderr(&w.fusion(&["merge", "a"]).failure());
    assert!(
        told.contains("all runs have failed, the first one") && told.contains("auv.toml:55:8"),
        "{told}"
    );
}

/// The law of parts: any split, in any order, gives the bytes of one process.
#[test]
fn parts_of_a_campaign_make_the_whole_in_any_order() {
    let w = Workspace::new("montecarlo-parts");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps.toml");
    let with = |args: &[&str]| {
        let sets: Vec<&str> = SETS.iter().flat_map(|set| ["--set", set]).collect();
        w.fusion(&[&["montecarlo", design, "--seed", "7"], &sets[..], args].concat())
    };
    let whole = stdout(&with(&["-n", "5", "--out", "whole"]).success());
    for (runs, file) in [("0..1", "a"), ("1..4", "b"), ("4..5", "c")] {
        with(&["--runs", runs, "--part", file]).success();
    }
    let merged = stdout(&w.fusion(&["merge", "c", "a", "b", "--out", "merged"]).success());
    assert_eq!(w.read("whole/runs.csv"), w.read("merged/runs.csv"));
    assert!(tables(&whole).len() > 20, "{whole}");
    assert_eq!(tables(&whole), tables(&merged));
    // The page too, with the fans; the reports of the worst runs need the design.
    let html = |file: &str| -> Vec<String> {
        let differs = ["a href=\"worst-", "/a>", "code>", "/code>"];
        let text = w.read(file);
        let tags = text
            .split('<')
            .filter(|tag| !tag.contains("filter epochs in") && !differs.iter().any(|start| tag.starts_with(start)));
        tags.map(str::to_owned).collect()
    };
    assert!(w.read("whole/montecarlo.html").contains("worst-3.html"));
    assert!(w.read("merged/montecarlo.html").contains("--seed "));
    assert_eq!(html("whole/montecarlo.html"), html("merged/montecarlo.html"));

    with(&["--set", "run.stop=20", "--runs", "4..5", "--part", "other"]).success();
    let refused = |files: &[&str]| stderr(&w.fusion(&[&["merge"], files].concat()).failure());
    assert!(refused(&["a", "b", "other"]).contains("`other`: it belongs to another campaign: its design is"));
    assert!(refused(&["a", "c"]).contains("runs 1 to 3 are in no part: write them with `fusion montecarlo "));
    assert!(refused(&["a", "c"]).contains(" --seed 7 --runs 1..4 --part FILE`"));
    assert!(refused(&["c", "b"]).contains("runs 0 to 0 are in no part"));
    assert!(refused(&["a", "b", "a"]).contains("`a`: run 0 is in two parts"));
    assert!(refused(&[design]).contains("this is no part of a campaign"));
    let bytes = std::fs::read(w.path("b")).unwrap();
    std::fs::write(w.path("cut"), &bytes[..bytes.len() / 2]).unwrap();
    let cut = refused(&["a", "cut", "c"]);
    assert!(
        cut.contains("`cut`: it ends after 1 of 3 runs") && cut.contains(" --runs 1..4 --part cut`"),
        "{cut}"
    );
}

/// The printed text without its last lines, which have the pace and the files.
fn tables(page: &str) -> Vec<String> {
    page.lines()
        .take_while(|line| !line.contains("filter epochs in") && !line.contains("Written"))
        .map(str::to_owned)
        .collect()
}

/// Several designs over the same seeds are one work.
#[test]
fn parts_of_a_comparison_make_the_whole() {
    let w = Workspace::new("compare-parts");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps.toml");
    let with = |args: &[&str]| {
        let sets: Vec<&str> = SETS.iter().flat_map(|set| ["--set", set]).collect();
        w.fusion(&[&["compare", design, "--backend", "ekf,iekf"], &sets[..], args].concat())
    };
    let whole = stdout(&with(&["-n", "4"]).success());
    with(&["--runs", "0..1", "--part", "a"]).success();
    with(&["--runs", "1..4", "--part", "b"]).success();
    assert_eq!(whole, stdout(&w.fusion(&["merge", "b", "a"]).success()));
    assert!(whole.contains("of 4 runs"), "{whole}");
    w.fusion(&["montecarlo", design, "--runs", "4..5", "--part", "other"]).success();
    let told = stderr(&w.fusion(&["merge", "a", "b", "other"]).failure());
    assert!(
        told.contains("`other`: it belongs to another campaign: its command is `fusion montecarlo`"),
        "{told}"
    );
}
