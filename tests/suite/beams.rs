//! A Doppler log whose beams are lost and return one by one.

use fusion::config::Document;
use fusion::design::Design;
use fusion::run::{Options, Summary, run};
use std::path::Path;

/// `configs/ins-gps.toml` with a Doppler log and this seed. Only the first `beams` beams ever have an echo.
fn drive(beams: usize, seed: u64, sets: &[&str]) -> Summary {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    let mut document = Document::load(&file).unwrap_or_else(|d| panic!("{d}"));
    document.overlay("variant.doppler").unwrap();
    for beam in 1..=4 {
        let window = if beam > beams { "{ from = 0 }" } else { "{ from = 0, to = 1e-3 }" };
        let set = format!("simulation.sensor.dvl.fault.lost_{beam}.window={window}");
        document.set(&set).unwrap();
    }
    sets.iter().for_each(|set| document.set(set).unwrap());
    let design = Design::read(document).unwrap_or_else(|e| panic!("{e}"));
    let options = Options {
        seed: Some(seed),
        ..Options::default()
    };
    run(&design, &options, &mut |_| {}).unwrap_or_else(|e| panic!("{e}"))
}

const SEEDS: u64 = 8;

#[test]
fn each_beam_that_is_left_is_used_and_the_filter_knows_what_it_is_worth() {
    let mut before = f64::INFINITY;
    for beams in 0..=4 {
        let (mut nees, mut squares) = (0.0, 0.0);
        for seed in 1..=SEEDS {
            let summary = drive(beams, seed, &[]);
            for beam in 1..=4 {
                let name = format!("dvl.beam_{beam}");
                let sensor = summary.sensors().iter().find(|s| s.name == name).unwrap();
                // The first beams: all measurements except one per mille, which the gate may reject. The other beams:
                // none.
                let used = sensor.accepted;
                assert_eq!(beam <= beams, used > 500, "{name} of {beams}: {used}");
            }
            let score = summary.score().unwrap();
            nees += score.nees_velocity.unwrap().mean / SEEDS as f64;
            squares += score.velocity.unwrap().rms.iter().map(|v| v * v).sum::<f64>() / SEEDS as f64;
        }
        let rms = squares.sqrt();
        eprintln!("{beams} beams: velocity {:.1} cm/s, NEES {nees:.2}", 100.0 * rms);
        // Eight runs with a dozen independent errors each, on three axes: 1σ of their mean is √(6/96) = 0.25; the bound
        // is 3σ. Without beams only fixes determine the velocity, and it is not tested.
        assert!(beams == 0 || (nees - 3.0).abs() < 0.75, "{beams} beams: NEES {nees}");
        assert!(rms < before, "{beams} beams: {rms} after {before}");
        before = rms;
    }
}

#[test]
fn a_beam_that_sees_a_fish_is_rejected_alone() {
    let fish = "simulation.sensor.dvl.fault.fish={ type = \"spike\", channel = \"beam_2\", value = [0.5], window = { from = \"50 s\", duration = \"8 s\" } }";
    let summary = drive(4, 1, &[fish]);
    let rejected = |beam: usize| {
        let name = format!("dvl.beam_{beam}");
        summary.sensors().iter().find(|s| s.name == name).unwrap().rejected
    };
    // 40 measurements of the beam. Of some 500 of each other beam, one in a thousand is usual, more than three are not.
    assert!(
        [1, 3, 4].iter().all(|beam| rejected(*beam) <= 3),
        "{:?}",
        [1, 2, 3, 4].map(rejected)
    );
    assert!((40..=43).contains(&rejected(2)), "{}", rejected(2));
}
