//! Heading from the Earth's rotation at rest, by a unit that can do it.

use fusion::core::consistency::mean_band;
use fusion::run::{Options, run};

/// Runs whose squares are pooled.
const SEEDS: u64 = 20;

#[test]
fn a_gyrocompassed_heading_is_within_three_sigma() {
    let design = crate::steered::design("ins-gps-outlier.toml", &["gyrocompass"], &["reference.from=310", "run.stop=311"]);
    let mut squares = 0.0;
    for seed in 1..=SEEDS {
        let options = Options {
            seed: Some(seed),
            ..Options::default()
        };
        let summary = run(&design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
        let yaw = summary.score().unwrap().attitude_deg.unwrap();
        let (error, sigma) = (yaw.mean[2], yaw.three_sigma[2] / 3.0);
        // The design predicts 0.036°.
        assert!(
            (0.03..0.04).contains(&sigma) && error.abs() < 3.0 * sigma,
            "seed {seed}: {error}° ± {sigma}°"
        );
        squares += (error / sigma).powi(2);
    }
    let (low, high) = mean_band(0.99, 1, SEEDS as usize);
    let mean = squares / SEEDS as f64;
    assert!((low..high).contains(&mean), "{mean}: {low} to {high}");
}
