//! The works to count: steps that have run once before, so that all memory is allocated.

use crate::backends::BACKENDS;
use crate::composed::{Composed, MARKOV, PLAIN, SCALES};
use crate::{kernel, rows};
use fusion::core::covariance::Kernel;
use fusion::core::filter::Backend;

/// Steps of one count.
const STEPS: usize = 20;

/// Runs a work with this name and this number of steps.
pub type Count<'a> = &'a dyn Fn(&str, usize, &mut dyn FnMut());

/// Runs every work once and then once more by `counted`; prints the kernel, then steps and name of each.
pub fn run(counted: fn(&mut dyn FnMut())) {
    println!("{}", Kernel::default().name());
    let count = |name: &str, steps: usize, work: &mut dyn FnMut()| {
        work();
        println!("{steps} {name}");
        counted(work);
    };
    let twenty = |name: &str, work: &mut dyn FnMut()| count(name, STEPS, work);
    for blocks in [5, 7] {
        let n = 3 * blocks;
        let mut own = kernel::Composed::new(blocks, 6);
        twenty(&format!("kernel/predict/n={n}"), &mut || own.predict(STEPS));
        for rows in [3, 6] {
            let mut own = kernel::Composed::new(blocks, rows);
            twenty(&format!("kernel/update/m={rows}/n={n}"), &mut || own.update(STEPS));
        }
    }
    for (what, sensors) in [("n=15", PLAIN), ("n=21", SCALES), ("n=21, Gauss-Markov", MARKOV)] {
        let mut own = Composed::warm(sensors, Backend::ERROR_STATE);
        twenty(&format!("filter/predict/{what}"), &mut || own.predictions(STEPS));
    }
    let mut own = Composed::warm(PLAIN, Backend::ERROR_STATE);
    twenty("filter/update/gnss_position/n=15", &mut || own.updates(STEPS));
    // All other backends.
    for (name, backend) in BACKENDS.into_iter().filter(|(_, backend)| *backend != Backend::ERROR_STATE) {
        let mut own = Composed::warm(PLAIN, backend);
        twenty(&format!("backend/predict/{name}/n=15"), &mut || own.predictions(STEPS));
        twenty(&format!("backend/update/{name}/n=15"), &mut || own.updates(STEPS));
    }
    rows::works(&count);
}
