//! A rest test that no known motion passes.
//!
//! Tests     as in the stage `stationarity`: ten a second, each over the second before, several in a row
//! Limits    multiples of the limits of windows at rest, with the factor that finds most of the rest. The required
//!           number of tests in a row is twice the longest run of passed tests in motion
//! Mind      a car that creeps over smooth ground is shaken no more than a car with an idling engine. Limits alone do
//!           not separate the two, but the creeping car does not stay so quiet for long

use super::numbers::{Vec3, moments};
use fusion_core::math;

/// Length of a test, time between tests, and time around it in which the reported speed counts, because it may be late
/// [s].
const WINDOW: f64 = 1.0;
const STEP: f64 = 0.1;
const AROUND: f64 = 1.0;
/// Factors of the limits that are tried.
pub(super) const TIMES: [f64; 4] = [2.0, 1.5, 1.25, 1.0];
/// The required number of tests in a row: at least half a second, and not more than a short stop lasts.
const FEWEST: usize = 5;
const MOST: usize = 50;
/// The longest run in motion was seen in one log; a run that is longer by this factor is not expected.
const MARGIN: usize = 2;
/// A test that finds a smaller share of the rest is useless.
const USEFUL: f64 = 0.2;

/// A rest test and its results in the log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Limits are this factor times the deviations at rest.
    pub times: f64,
    /// The number of tests in a row that have to pass.
    pub persist: usize,
    /// The longest run of tests passed in motion, and when it ends \[s\].
    pub longest: (usize, f64),
    /// The share of the tests at rest that holds.
    pub share: f64,
}

impl Standing {
    /// From samples of a unit, the limits of windows at rest, and whether the vehicle stands at a time. Returns the
    /// best test; `None` if no other source reports rest and motion.
    pub(super) fn of(t: &[f64], samples: [&[Vec3]; 2], limits: [Vec3; 2], stands: &dyn Fn(f64) -> Option<bool>) -> Option<Self> {
        let tests = all(t, samples, limits, stands);
        let count = |stands: bool| tests.iter().filter(|test| test.stands == Some(stands)).count();
        let (resting, moving) = (count(true), count(false));
        let tried = TIMES.map(|times| {
            let runs = runs(&tests, times);
            let in_motion = tests.iter().zip(&runs).filter(|(test, _)| test.stands == Some(false));
            let longest = in_motion.fold(
                (0, 0.0),
                |longest, (test, run)| if *run > longest.0 { (*run, test.t) } else { longest },
            );
            let persist = FEWEST.max(MARGIN * longest.0);
            let held = tests
                .iter()
                .zip(&runs)
                .filter(|(test, run)| test.stands == Some(true) && **run >= persist);
            let share = held.count() as f64 / resting as f64;
            Self {
                times,
                persist,
                longest,
                share,
            }
        });
        // Of equal tests take the first: its limits are the widest.
        let best = tried
            .into_iter()
            .reduce(|best, other| if other.share > best.share { other } else { best });
        best.filter(|_| resting > 0 && moving > 0)
    }

    /// Whether it separates rest from motion.
    pub(super) fn is_useful(&self) -> bool {
        self.persist <= MOST && self.share > USEFUL
    }
}

struct Test {
    t: f64,
    /// The largest deviation over the limit of windows at rest.
    unrest: f64,
    /// Whether another source reports that it stands, or moves, all around the test.
    stands: Option<bool>,
}

fn all(t: &[f64], samples: [&[Vec3]; 2], limits: [Vec3; 2], stands: &dyn Fn(f64) -> Option<bool>) -> Vec<Test> {
    let (mut tests, mut begin, mut next) = (Vec::new(), 0, f64::NEG_INFINITY);
    for end in 0..t.len() {
        // A clock that went back restarts the tests.
        if end > 0 && t[end] < t[end - 1] {
            (begin, next) = (end, f64::NEG_INFINITY);
        }
        while t[end] - t[begin] >= WINDOW {
            begin += 1;
        }
        if t[end] < next || end - begin < 4 {
            continue;
        }
        next = t[end] + STEP * 0.999;
        let ratio = |k: usize, axis: usize| moments(samples[k][begin..=end].iter().map(|v| v[axis])).1 / limits[k][axis];
        let ratios = (0..6).map(|k| ratio(k / 3, k % 3));
        let steps = math::round((WINDOW + 2.0 * AROUND) / 0.5) as u32;
        let around = (0..=steps).map(|k| stands(t[end] - WINDOW - AROUND + 0.5 * f64::from(k)));
        tests.push(Test {
            t: t[end],
            unrest: ratios.fold(0.0, f64::max),
            stands: around.reduce(|a, b| a.filter(|_| a == b)).flatten(),
        });
    }
    tests
}

/// The number of consecutive passed tests, at each test.
fn runs(tests: &[Test], times: f64) -> Vec<usize> {
    let count = |run: &mut usize, test: &Test| {
        *run = if test.unrest <= times { *run + 1 } else { 0 };
        Some(*run)
    };
    tests.iter().scan(0, count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two minutes at 50 Hz: a minute of rest, then motion that is as quiet as rest for `quiet` seconds out of ten.
    fn creeping(quiet: f64) -> Option<Standing> {
        let t: Vec<f64> = (0..6000).map(|k| 0.02 * f64::from(k)).collect();
        let wave = |t: f64| if t < 60.0 || t.rem_euclid(10.0) < quiet { 0.01 } else { 0.5 } * (37.0 * t).sin();
        let samples: Vec<Vec3> = t.iter().map(|t| [wave(*t); 3]).collect();
        // A sine of 0.01 deviates by 0.0071.
        Standing::of(&t, [&samples, &samples], [[0.0072; 3]; 2], &|t| Some(t < 60.0))
    }

    #[test]
    fn motion_that_is_quiet_for_a_moment_asks_for_more_tests_in_a_row() {
        let never = creeping(0.0).unwrap();
        assert!(never.longest.0 <= 1 && never.persist == FEWEST && never.share > 0.98, "{never:?}");
        // Quiet for 2 s: a window of one second stays quiet for one second, which is eleven tests in a row.
        let short = creeping(2.0).unwrap();
        assert!(
            (9..=11).contains(&short.longest.0) && short.persist == 2 * short.longest.0,
            "{short:?}"
        );
        assert!(short.is_useful() && short.share > 0.9, "{short:?}");
    }

    #[test]
    fn motion_as_quiet_as_rest_leaves_no_test() {
        assert!(!creeping(9.0).unwrap().is_useful());
        assert_eq!(Standing::of(&[0.0, 1.0], [&[[0.0; 3]; 2]; 2], [[1.0; 3]; 2], &|_| None), None);
    }
}
