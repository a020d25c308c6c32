//! The navigators of a tracked vehicle under water: a published one as printed, hardened, and what they are
//! compared with.

use fusion::config::Document;
use fusion::core::filter::Step;
use fusion::core::runner::{Event, Halt};
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run};
use std::path::Path;

fn design(changes: &[&str], variants: &[&str]) -> Design {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/tracked-navigators.toml");
    let mut document = Document::load(&path).unwrap_or_else(|d| panic!("{d}"));
    for variant in variants {
        document.overlay(&format!("variant.{variant}")).unwrap();
    }
    changes.iter().for_each(|change| document.set(change).unwrap());
    Design::read(document).unwrap_or_else(|d| panic!("{d}"))
}

/// The share of each innovation that the first correction by every sensor takes: the diagonal of HK, by the number
/// of its rows.
#[derive(Default)]
struct FirstGains(Vec<Vec<f64>>);

impl RunObserver for FirstGains {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter {
            event:
                Event::Step(Step::Corrected {
                    jacobian,
                    gain,
                    residual,
                    correction,
                    ..
                }),
            ..
        } = event
        else {
            return Ok(());
        };
        let (m, n) = (residual.len(), correction.len());
        let share = |j: usize| jacobian.row(j).iter().zip(&gain[j * n..]).map(|(h, k)| h * k).sum();
        self.0.push((0..m).map(share).collect());
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        true
    }
}

#[test]
fn the_first_gains_of_the_printed_matrices_are_those_of_the_paper() {
    // P0 and R as printed at d = 30 m. Q is left out: the gains are those of the first instant, before it acts.
    let q = ["process.position_noise=0", "process.accelerometer.noise=0", "process.gyro.noise=0"];
    let end = [
        "simulation.trajectory=[{ type = \"rest\", duration = \"2 s\" }]",
        "reference.from=0",
    ];
    let design = design(&[&q[..], &end[..]].concat(), &["chna-literal"]);
    let options = Options::default();
    let mut gains = FirstGains::default();
    Run::open(&design, &options).unwrap().go(&mut [&mut gains], &mut |_| {}).unwrap();
    // The fix; depth, speeds and attitude of the same epoch.
    let wanted: [&[f64]; 4] = [&[0.9174, 0.9174], &[0.5], &[0.0588; 3], &[0.9901, 0.9901, 0.5]];
    for wanted in wanted {
        let found = gains.0.iter().find(|g| {
            // 2 %: what 0.05 m/s, and a tilt of 1 deg under gravity, add in the tenths of a second before.
            g.len() == wanted.len() && g.iter().zip(wanted).all(|(g, w)| (g / w - 1.0).abs() < 0.02)
        });
        assert!(found.is_some(), "{wanted:?} is not among {:?}", gains.0);
    }
}
