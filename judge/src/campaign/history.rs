//! The errors of a run over time, in bins that the runs of a campaign share.

use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::score::{Deviation, EpochError, nees_of};
use fusion_core::math;
use fusion_core::runner::Halt;
use fusion_core::time::Time;
use serde::{Deserialize, Serialize};
use statrs::statistics::{Data, OrderStatistics};

/// The maximum number of bins, and the first width of a bin \[ns\]; it doubles when there are too many.
const BINS: i64 = 512;
const WIDTH: i64 = 100_000_000;

/// The first runs of a campaign whose errors over time are kept and shown: up to 60 kB for each.
pub const FANS: u64 = 1000;

/// The errors of position, velocity and attitude in a run, in bins of time.
///
/// The width of a bin is a power of two times a tenth of a second. A bin begins at a multiple of its width, so that the
/// bins of two runs match.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct History {
    width: i64,
    /// The number of the first bin.
    first: i64,
    bins: Vec<Bin>,
    /// The attitude error is the rotation to the reference; false if the mounting between the two is unknown.
    has_attitude: bool,
}

/// The errors of position, velocity, attitude in a bin.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Bin([OfQuantity; 3]);

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(from = "Packed", into = "Packed")]
struct OfQuantity {
    count: f64,
    /// Sum of the squared lengths of the error.
    squares: f64,
    /// The first NEES and its degrees of freedom: one per run and bin is independent of other runs.
    nees: Option<(f64, usize)>,
}

/// Without names: a part has a thousand in a row.
type Packed = (f64, f64, Option<(f64, usize)>);

impl From<Packed> for OfQuantity {
    fn from((count, squares, nees): Packed) -> Self {
        Self { count, squares, nees }
    }
}

impl From<OfQuantity> for Packed {
    fn from(OfQuantity { count, squares, nees }: OfQuantity) -> Self {
        (count, squares, nees)
    }
}

impl OfQuantity {
    fn add(&mut self, d: &Deviation) {
        self.count += 1.0;
        self.squares += d.error.norm_squared();
        if self.nees.is_none() {
            self.nees = nees_of(d).filter(|(_, dof)| *dof > 0);
        }
    }

    /// Adds a later part.
    fn join(&mut self, later: &Self) {
        self.count += later.count;
        self.squares += later.squares;
        self.nees = self.nees.or(later.nees);
    }
}

impl History {
    /// For a run of `design`, still without errors.
    #[must_use]
    pub fn new(design: &Design) -> Self {
        Self {
            width: WIDTH,
            first: 0,
            bins: Vec::new(),
            has_attitude: !design.reference.as_ref().is_some_and(|r| r.block.remove_mean_mounting),
        }
    }

    fn add(&mut self, time: Time, error: &EpochError) {
        let attitude = error.attitude.as_ref().filter(|_| self.has_attitude).map(|a| &a.body);
        let found = [error.position.as_ref(), error.velocity.as_ref(), attitude];
        let mut bin = time.nanos().div_euclid(self.width);
        if self.bins.is_empty() {
            self.first = bin;
        }
        // Epochs come in time order.
        while bin - self.first >= BINS {
            self.widen();
            bin = time.nanos().div_euclid(self.width);
        }
        let at = usize::try_from(bin - self.first).unwrap_or(0);
        if self.bins.len() <= at {
            self.bins.resize(at + 1, Bin::default());
        }
        for (own, d) in self.bins[at].0.iter_mut().zip(found) {
            if let Some(d) = d {
                own.add(d);
            }
        }
    }

    /// Doubles the width of the bins.
    fn widen(&mut self) {
        let first = self.first.div_euclid(2);
        let mut wide: Vec<Bin> = Vec::new();
        for (k, bin) in (self.first..).zip(&self.bins) {
            let at = usize::try_from(k.div_euclid(2) - first).unwrap_or(0);
            if wide.len() <= at {
                wide.resize(at + 1, Bin::default());
            }
            wide[at].0.iter_mut().zip(&bin.0).for_each(|(own, later)| own.join(later));
        }
        (self.width, self.first, self.bins) = (2 * self.width, first, wide);
    }
}

impl RunObserver for History {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Reference {
            filter,
            epoch,
            error: Some(error),
        } = event
            && filter.is_outermost()
        {
            self.add(epoch.time, error);
        }
        Ok(())
    }
}

/// The errors of several runs in a bin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Together {
    /// The middle of the bin \[s\].
    pub time: f64,
    /// The RMS length of the error in the bin, for every run that has one, in ascending order: metres, metres per
    /// second, or radians.
    pub errors: Vec<f64>,
    /// The mean NEES over the runs with the most degrees of freedom, these degrees, and the number of these runs.
    pub nees: Option<(f64, usize, usize)>,
}

/// The bins over all runs of one quantity: position, velocity or attitude, by number.
#[must_use]
pub fn together(histories: &[History], quantity: usize) -> Vec<Together> {
    let width = histories.iter().map(|h| h.width).max().unwrap_or(WIDTH);
    let mut all: Vec<History> = histories.iter().filter(|h| !h.bins.is_empty()).cloned().collect();
    for history in &mut all {
        while history.width < width {
            history.widen();
        }
    }
    let first = all.iter().map(|h| h.first).min().unwrap_or(0);
    let end = all.iter().map(|h| h.first + h.bins.len() as i64).max().unwrap_or(0);
    let at = |bin: i64| Together::of(&all, quantity, bin, (bin as f64 + 0.5) * width as f64 * 1e-9);
    (first..end).map(at).filter(|bin| !bin.errors.is_empty()).collect()
}

impl Together {
    fn of(all: &[History], quantity: usize, bin: i64, time: f64) -> Self {
        let own = |h: &History| Some(h.bins.get(usize::try_from(bin - h.first).ok()?)?.0[quantity]);
        let found: Vec<OfQuantity> = all.iter().filter_map(own).filter(|q| q.count > 0.0).collect();
        let mut errors: Vec<f64> = found.iter().map(|q| math::sqrt(q.squares / q.count)).collect();
        errors.sort_by(f64::total_cmp);
        let most = found.iter().filter_map(|q| q.nees).map(|n| n.1).max();
        let nees = most.map(|dof| {
            let values: Vec<f64> = found.iter().filter_map(|q| q.nees).filter(|n| n.1 == dof).map(|n| n.0).collect();
            (values.iter().sum::<f64>() / values.len() as f64, dof, values.len())
        });
        Self { time, errors, nees }
    }

    /// The quantile of the errors at `share`, interpolated between two runs; NaN without errors.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        Data::new(self.errors.clone()).quantile(share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::score::ReferenceEpoch;
    use nalgebra::{Matrix3, Vector3};

    fn history(from: f64, seconds: f64, north: impl Fn(f64) -> f64) -> History {
        let mut history = History {
            width: WIDTH,
            first: 0,
            bins: Vec::new(),
            has_attitude: true,
        };
        for k in 0..(10.0 * seconds) as i64 {
            let t = from + 0.1 * k as f64 + 0.01;
            let error = EpochError {
                truth: ReferenceEpoch::default(),
                places: None,
                position: Some(Deviation {
                    error: Vector3::new(north(t), 0.0, 0.0),
                    own: Matrix3::identity() * 4.0,
                    reference: Matrix3::zeros(),
                    known: [true; 3],
                }),
                velocity: None,
                attitude: None,
                motion: None,
            };
            history.add(Time::from_seconds(t), &error);
        }
        history
    }

    #[test]
    fn bins_double_and_those_of_runs_of_other_lengths_match() {
        // 100 s need bins of 0.2 s, 30 s of 0.1 s: together they use the bins of the longer run.
        let (long, short) = (history(-20.0, 100.0, |_| 2.0), history(0.0, 30.0, |_| 6.0));
        assert_eq!((long.width, short.width), (2 * WIDTH, WIDTH));
        let all = together(&[long, short], 0);
        assert_eq!(all.len(), 500);
        let at = |t: f64| all.iter().find(|bin| (bin.time - t).abs() < 0.1).unwrap();
        assert_eq!(at(-10.05).errors, [2.0]);
        assert_eq!(at(10.05).errors, [2.0, 6.0]);
        assert_eq!((at(10.05).quantile(0.5), at(10.05).quantile(1.0)), (4.0, 6.0));
        // 4/4 and 36/4, three degrees of freedom each.
        assert_eq!(at(10.05).nees, Some((5.0, 3, 2)));
        assert!(together(&[], 0).is_empty());
    }

    #[test]
    fn memory_does_not_grow_with_the_run_and_no_epoch_is_lost() {
        let long = history(1e6, 5_000.0, |t| if (t - 1_002_000.01).abs() < 1e-3 { 3e3 } else { 0.0 });
        assert!(long.bins.len() <= BINS as usize);
        let counted: f64 = long.bins.iter().map(|bin| bin.0[0].count).sum();
        let squares: f64 = long.bins.iter().map(|bin| bin.0[0].squares).sum();
        assert_eq!((counted, squares), (50_000.0, 9e6));
    }
}
