//! The figures of the sea trial of 4 h: fixes, and their distance from the filter.

use super::steered::design;
use fusion::core::filter::Verdict;
use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::health::State;
use fusion::core::runner::{Event, Halt};
use fusion::core::state::Manifold;
use fusion::core::time::Time;
use fusion::models::fault::Windows;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run};

/// Errors count from this time on \[s\].
const SETTLED: f64 = 60.0;

/// A fix and the estimate just before it.
#[derive(Clone, Copy)]
struct Fix {
    t: f64,
    place: Geodetic,
    estimate: Geodetic,
    /// Over the ground \[m\].
    apart: f64,
    is_used: bool,
}

/// Receives the data that the report draws.
#[derive(Default)]
struct Trial {
    fixes: Vec<Fix>,
    estimate: Option<Geodetic>,
    /// Estimates of the slip with their 1σ.
    slips: Vec<[f64; 2]>,
    /// North, east \[m/s\].
    fastest: [f64; 2],
}

impl RunObserver for Trial {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Estimate {
                filter, solution, belief, ..
            } => {
                if let Some(block) = filter.layout.block("tracks.slip") {
                    let sigma = belief.covariance.sigmas(block).next().unwrap_or(f64::NAN);
                    self.slips.push([belief.x[block.storage_range().start], sigma]);
                }
                self.estimate = solution.position.map(|(place, _)| place);
                for (k, most) in self.fastest.iter_mut().enumerate().filter(|_| solution.time.seconds() > SETTLED) {
                    *most = solution.velocity.map_or(*most, |(v, _)| most.max(v[k].abs()));
                }
            }
            RunEvent::Filter {
                event: Event::Updated {
                    sensor: 0, update, time, ..
                },
                ..
            } => self.fixes.extend(self.estimate.map(|estimate| Fix {
                t: time.seconds(),
                place: Geodetic::read(update.value),
                estimate,
                apart: update.residual[0].hypot(update.residual[1]),
                is_used: update.verdict != Verdict::Rejected,
            })),
            _ => {}
        }
        Ok(())
    }
}

/// Length of a path over the ground \[m\].
fn length(places: impl Iterator<Item = Geodetic>) -> f64 {
    let places: Vec<_> = places.collect();
    places.windows(2).map(|w| w[1].difference(&w[0]).xy().norm()).sum()
}

#[test]
fn the_figures_of_the_sea_trial_are_those_of_the_paper() {
    // Without wild fixes: the paper shows the distance of the other fixes from the filter.
    let design = design("uri-r-sea-trial.toml", &[], &["simulation.ship.usbl.fault.wild.rate=0"]);
    // The order of declaration: `sensor: 0` above is the USBL.
    let first = design.sensors.iter().position(|s| s.name == "usbl");
    let mut trial = Trial::default();
    let options = Options::default();
    let summary = Run::open(&design, &options)
        .unwrap()
        .go(&mut [&mut trial], &mut |_| {})
        .unwrap()
        .summary;
    assert_eq!(first, Some(0));
    assert!(summary.control().is_some_and(|c| c.is_done));

    // The slip of the vehicle is known for all four hours: 4 % on average.
    let is_inside = |[slip, sigma]: &[f64; 2]| (slip - 0.04).abs() <= 3.0 * sigma;
    let inside = trial.slips.iter().filter(|slip| is_inside(slip)).count() as f64 / trial.slips.len() as f64;
    let last = trial.slips.last().unwrap();
    println!(
        "slip: {:.2} ± {:.2} % at the end, inside 3σ {:.1} %",
        100.0 * last[0],
        100.0 * last[1],
        100.0 * inside
    );
    assert!(is_inside(last) && inside >= 0.95, "{last:?} {inside}");
    // The table of parameter errors says the same: the true slip is that of the simulated vehicle.
    let score = summary.score().unwrap();
    let scored = score.blocks.iter().find(|b| b.name == "tracks.slip").unwrap();
    // 1e-3: half its 1σ. The latest recorded estimate is some seconds older.
    assert!((scored.error[0] - (last[0] - 0.04)).abs() < 1e-3, "{scored:?} {last:?}");
    let spent = &summary.health()[0].spent;
    let good = spent.of(State::Good) / spent.total();
    println!("health: good {:.1} %", 100.0 * good);
    assert!(good >= 0.95, "{spent:?}");

    // Most intervals are near a second, and none is longer than five pings. 0.2 s: four σ of the spread.
    let intervals: Vec<f64> = trial.fixes.windows(2).map(|w| w[1].t - w[0].t).collect();
    let near = intervals.iter().filter(|t| **t < 1.5).count() as f64 / intervals.len() as f64;
    let longest = intervals.iter().fold(0.0, |m: f64, t| m.max(*t));
    println!("intervals: {:.0} % below 1.5 s, longest {longest:.2} s", 100.0 * near);
    assert!(near > 0.5 && (4.0..5.2).contains(&longest), "{near} {longest}");

    // The fixes are at most about a metre away from the filter, farthest while it trenches.
    let episodes = design.reference.as_ref().and_then(|r| r.block.episodes.clone()).unwrap();
    let is_during = |t: f64| Windows::contains(&episodes, Time::from_seconds(t));
    let counted = trial.fixes.iter().filter(|f| f.t > SETTLED && f.is_used);
    let (mut most, mut beyond, mut all) = ([0.0_f64; 2], 0, 0);
    for fix in counted.clone() {
        let part = &mut most[usize::from(is_during(fix.t))];
        *part = part.max(fix.apart);
        (beyond, all) = (beyond + u32::from(fix.apart > 1.0), all + 1);
    }
    println!(
        "fix to estimate: largest {:.2} m, trenching {:.2} m; {beyond} of {all} above 1 m",
        most[0], most[1]
    );
    // Noise of 0.3 m on each axis, doubled while trenching: one of 1900 fixes is beyond 1.38 m = 0.3 m √(2
    // ln(1900/0.05)) with a probability of 5 %.
    assert!(
        most[0] < most[1] && most[0] < 1.0 && most[1] < 1.38 && beyond * 500 < all,
        "{most:?} {beyond}"
    );

    // The path of the filter is shorter than that of the fixes, and nearly as long as the true path.
    let used = || counted.clone();
    let ratio = length(used().map(|f| f.estimate)) / length(used().map(|f| f.place));
    println!("length of the filter's way over that of the fixes: {ratio:.3}");
    assert!(ratio < 0.3, "{ratio}");

    // The paper: 0.3228 and 0.3944 m/s, read as north and east. 0.03 m/s: slip of 3 % and three σ of the estimate.
    println!("fastest: north {:.4}, east {:.4} m/s", trial.fastest[0], trial.fastest[1]);
    assert!(
        (trial.fastest[0] - 0.3228).abs() < 0.03 && (trial.fastest[1] - 0.3944).abs() < 0.03,
        "{:?}",
        trial.fastest
    );
}
