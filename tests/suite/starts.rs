//! Starts at any moment of a recorded drive: what is estimated after a minute is as certain as it is said to be.

use super::real::{real, recorded};
use fusion::run::{FinalState, Summary};

/// Moments of a log \[s\], and the random walks that its design declares for biases of gyros and accelerometers.
struct Starts {
    design: &'static str,
    moments: [f64; 5],
    /// Its last row \[s\].
    last: f64,
    walks: [f64; 2],
}

/// Squares of the differences between `early` and the `end` of the log, `seconds` later, over the variance of the former
/// and what the axis may have walked since.
fn squares(starts: &Starts, early: &[FinalState], end: &[FinalState], seconds: f64) -> Vec<(String, f64)> {
    let of_block = |block: &FinalState| {
        // An error of the receiver that returns to zero by itself is another one at the end.
        let known = !block.start_sigma.is_empty() && block.value.len() == block.sigma.len();
        let end = end.iter().find(|b| b.name == block.name).filter(|_| known)?;
        let walk = ["gyro_bias", "accel_bias"]
            .iter()
            .position(|name| block.name == *name)
            .map_or(0.0, |i| starts.walks[i]);
        let axis = |k: usize| {
            let variance = block.sigma[k].powi(2) + walk.powi(2) * seconds;
            (format!("{} {k}", block.name), (block.value[k] - end.value[k]).powi(2) / variance)
        };
        Some(
            (0..block.sigma.len())
                .filter(|k| block.sigma[*k] > 0.0)
                .map(axis)
                .collect::<Vec<_>>(),
        )
    };
    early.iter().filter_map(of_block).flatten().collect()
}

fn judge(starts: &Starts) {
    let run = |sets: &[String]| -> Summary {
        let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
        real(starts.design, &[], &sets).unwrap()
    };
    let mut all = Vec::new();
    for moment in starts.moments {
        let start = format!("run.start=\"{moment} s\"");
        let whole = run(&[start.clone()]);
        let begun = whole.started.unwrap();
        let early = run(&[start, format!("run.stop=\"{} s\"", begun + 60.0)]);
        let squares = squares(starts, &early.parameters, &whole.parameters, starts.last - begun - 60.0);
        for (axis, square) in &squares {
            assert!(*square <= 25.0, "{} from {moment} s, {axis}: {:.1} σ", starts.design, square.sqrt());
        }
        all.extend(squares.into_iter().map(|(_, square)| square));
    }
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    eprintln!("{}: mean square {mean:.2}", starts.design);
    assert!((0.3..3.0).contains(&mean), "{}: {mean}", starts.design);
}

#[test]
fn a_minute_after_any_start_parameters_are_within_five_sigma_of_where_they_end() {
    if !recorded() {
        return;
    }
    // Moments in motion, every fourth of twenty; the initialisers wait for the next rest.
    judge(&Starts {
        design: "rtklib-drive",
        moments: [75.0, 137.5, 198.0, 280.7, 338.7],
        last: 552.0,
        walks: [1e-5, 5e-5],
    });
    judge(&Starts {
        design: "pntos-car",
        moments: [285.3, 730.3, 1222.3, 1668.3, 2168.3],
        last: 2602.0,
        walks: [9.4e-6, 1.32e-4],
    });
}
