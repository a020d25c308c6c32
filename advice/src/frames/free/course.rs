//! The estimates of parameters in a run, and the likelihood of its innovations.

use fusion::observe::{Heard, RunEvent, RunObserver};
use fusion_core::belief::Belief;
use fusion_core::filter::Update;
use fusion_core::math;
use fusion_core::runner::{Event, Halt};
use fusion_core::state::Block;
use fusion_core::time::Time;

/// A parameter counts as learnt if its σ falls below this fraction of its initial σ.
const LEARNT: f64 = 1.0 / 3.0;
/// If an estimate moves by more than this multiple of its initial σ, the filter has gone astray.
const ASTRAY: f64 = 4.0;
/// In the second half of the data a steady estimate stays within this fraction of its total change. An estimate that
/// keeps moving follows something else.
const STEADY: f64 = 0.3;
/// Estimates are looked at no more often than this \[s\].
const PERIOD: f64 = 1.0;
/// The number of parts of a run for measuring how far an estimate moves. The first part is skipped because it still
/// depends on the start.
pub(super) const STEPS: usize = 9;
/// The least number of parts that give a result.
const FEWEST: usize = 3;
/// A part that reduces the variance by less than this fraction gives no information about it.
const TAKEN: f64 = 0.01;
/// Innovations are summed up over parts of this length \[s\].
const PART: f64 = 20.0;
/// The most that one squared component of an innovation counts, in units of its σ². It limits the effect of outliers.
const MOST: f64 = 9.0;
/// The filter does not follow a sensor if the mean of its squared innovations exceeds this; 1 is expected.
const GROSS: f64 = 2.0;

/// The course of the parameters of the outermost filter over a run.
#[derive(Debug, Default)]
pub(super) struct Course {
    blocks: Vec<Block>,
    initial: Vec<f64>,
    /// Time, state, and 1σ of each axis.
    told: Vec<(Time, Vec<f64>, Vec<f64>)>,
    first: Option<Time>,
    /// For each sensor, its name and its parts.
    sensors: Vec<(String, Vec<Part>)>,
}

/// The innovations of a sensor over part of a log.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    measurements: f64,
    numbers: f64,
    /// Sum of the squares in units of σ.
    squares: f64,
    /// Sum of the squares in units of the declared noise alone.
    scatter: f64,
    /// −2 ln of their density, up to a constant.
    cost: f64,
}

/// The estimate of a parameter: for each axis the difference from the declared value, and the sum of both. For a
/// rotation both are the difference.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    pub(super) difference: Vec<f64>,
    pub(super) value: Vec<f64>,
    /// The filter's own 1σ, which assumes independent innovations.
    pub(super) own: Vec<f64>,
    /// 1σ, wider if the estimate moved more than the filter's own 1σ allows.
    pub(super) sigma: Vec<f64>,
    /// True if the filter's own 1σ became much smaller, so the data carry information.
    pub(super) is_learnt: Vec<bool>,
    /// True if the estimate stays near its last value in the second half.
    pub(super) is_steady: Vec<bool>,
    /// The largest distance from the start over the axes, in units of the initial 1σ.
    pub(super) away: f64,
}

impl Estimate {
    /// Returns true if the estimate moved further than its initial 1σ allows.
    pub(super) fn is_astray(&self) -> bool {
        self.away > ASTRAY
    }

    /// The declared value along an axis; zero for a rotation.
    pub(super) fn declared(&self, k: usize) -> f64 {
        self.value[k] - self.difference[k]
    }
}

/// The gain in likelihood of the innovations of one run over those of another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gain {
    /// The difference of −2 ln of their density.
    pub(super) total: f64,
    /// The share of the parts of the log that improve.
    pub(super) share: f64,
}

impl Course {
    fn look(&mut self, filter: &Heard, belief: &Belief) {
        if self.blocks.is_empty() {
            self.blocks = filter.layout.blocks().to_vec();
            self.initial = filter.layout.initial().to_vec();
        }
        let sigmas = self.blocks.iter().flat_map(|b| belief.covariance.sigmas(b)).collect();
        self.told.push((belief.time, belief.x.clone(), sigmas));
    }

    fn measured(&mut self, filter: &Heard, sensor: usize, time: Time, update: &Update<'_>) {
        if self.sensors.is_empty() {
            self.sensors = filter.sensors.iter().map(|s| (s.name.clone(), Vec::new())).collect();
        }
        let at = time.seconds_since(*self.first.get_or_insert(time)) / PART;
        let (Some((_, parts)), true) = (self.sensors.get_mut(sensor), update.nis.is_finite() && at >= 0.0) else {
            return;
        };
        let at = at as usize;
        if parts.len() <= at {
            parts.resize(at + 1, Part::default());
        }
        let numbers = update.innovation_sigma.len() as f64;
        let squares = update.nis.min(MOST * numbers);
        let spread: f64 = update.innovation_sigma.iter().map(|sigma| 2.0 * math::ln(*sigma)).sum();
        let part = &mut parts[at];
        part.measurements += 1.0;
        part.numbers += numbers;
        part.squares += squares;
        let noise = update.noise.iter().step_by(update.residual.len() + 1);
        let rows = update
            .residual
            .iter()
            .zip(noise)
            .filter(|(r, variance)| r.is_finite() && **variance > 0.0);
        part.scatter += rows.map(|(r, variance)| (r * r / variance).min(MOST)).sum::<f64>();
        part.cost += squares + spread;
    }

    /// Returns true if the filter does not follow the sensor.
    pub(super) fn is_gross(&self, sensor: &str) -> bool {
        let (numbers, squares) = self.sum(sensor, |part| part.squares);
        squares > GROSS * numbers
    }

    /// The declared noise of a sensor divided by the scatter of its innovations.
    pub(super) fn oversized(&self, sensor: &str) -> Option<f64> {
        let (numbers, scatter) = self.sum(sensor, |part| part.scatter);
        (scatter > 0.0).then(|| math::sqrt(numbers / scatter))
    }

    /// The number of components of a sensor, and the sum of `what` over its parts.
    fn sum(&self, sensor: &str, what: impl Fn(&Part) -> f64) -> (f64, f64) {
        // Each beam of a Doppler log is a separate sensor.
        let is_of = |name: &str| {
            name.strip_prefix(sensor)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let of = self.sensors.iter().filter(|(name, _)| is_of(name)).flat_map(|(_, parts)| parts);
        of.fold((0.0, 0.0), |sum, part| (sum.0 + part.numbers, sum.1 + what(part)))
    }

    pub(super) fn is_any_gross(&self) -> bool {
        self.sensors.iter().any(|(name, _)| self.is_gross(name))
    }

    /// The gain over `before`, scaled to the number of measurements there. A sensor without measurements in a part gets
    /// the worst possible cost.
    pub(super) fn gain(&self, before: &Self) -> Gain {
        let parts: Vec<f64> = self.gains(before).collect();
        let better = parts.iter().filter(|gain| **gain > 0.0).count();
        Gain {
            total: if self.sensors.is_empty() {
                f64::NEG_INFINITY
            } else {
                parts.iter().sum()
            },
            share: better as f64 / parts.len().max(1) as f64,
        }
    }

    /// The parts of the log.
    fn parts(&self) -> usize {
        self.sensors.iter().map(|(_, parts)| parts.len()).max().unwrap_or(0)
    }

    /// The gain over `before` in each part.
    fn gains<'c>(&'c self, before: &'c Self) -> impl Iterator<Item = f64> + 'c {
        let of = move |part: usize| {
            let pairs = before.sensors.iter().zip(&self.sensors);
            let gains = pairs.filter_map(|((_, before), (_, now))| {
                let before = before.get(part).filter(|p| p.measurements > 0.0)?;
                let now = now.get(part).filter(|p| p.measurements > 0.0);
                let cost = now.map_or(MOST * before.numbers, |p| p.cost / p.measurements * before.measurements);
                Some(before.cost - cost)
            });
            gains.sum::<f64>()
        };
        (0..before.parts()).map(of)
    }

    /// The estimate of the state `name`. `declared` is the declared value; without it the initial value is the base.
    pub(super) fn estimate(&self, name: &str, declared: Option<&[f64]>) -> Option<Estimate> {
        let block = self.blocks.iter().find(|b| b.name == name)?;
        let ((start, ..), (end, last, sigma)) = (self.told.first()?, self.told.last()?);
        let initial = &self.initial[block.storage_range()];
        let from = |x: &[f64], base: &[f64]| {
            let mut out = vec![0.0; block.tangent_range().len()];
            block.kind.minus(&x[block.storage_range()], base, &mut out);
            out
        };
        let base = declared
            .filter(|d| block.kind.storage() == block.kind.dim() && d.len() == initial.len())
            .unwrap_or(initial);
        let (difference, way) = (from(last, base), from(last, initial));
        let half = end.seconds_since(*start) / 2.0;
        let second = self.told.iter().filter(|(t, ..)| end.seconds_since(*t) <= half);
        let second: Vec<Vec<f64>> = second.map(|(_, x, _)| from(x, base)).collect();
        let is_steady = |k: usize| second.iter().all(|d| (d[k] - difference[k]).abs() <= STEADY * difference[k].abs());
        let own = sigma[block.tangent_range()].to_vec();
        let axis = block.tangent_range().start;
        let path = |k: usize| -> Vec<(f64, f64)> {
            let told = self.told.iter().map(|(_, x, sigma)| (from(x, base)[k], sigma[axis + k]));
            told.collect()
        };
        let sigma = own.iter().enumerate().map(|(k, own)| own * excess(&path(k))).collect();
        let is_learnt = |(sigma, first): (&f64, &f64)| *sigma > 0.0 && *sigma < LEARNT * first;
        let away = way
            .iter()
            .zip(&block.sigma)
            .map(|(d, first)| d.abs() / first.max(f64::MIN_POSITIVE));
        Some(Estimate {
            value: if block.kind.storage() != block.kind.dim() {
                difference.clone()
            } else {
                last[block.storage_range()].to_vec()
            },
            is_learnt: own.iter().zip(&block.sigma).map(is_learnt).collect(),
            is_steady: (0..difference.len()).map(is_steady).collect(),
            away: away.fold(0.0, f64::max),
            difference,
            own,
            sigma,
        })
    }
}

/// The factor by which an estimate of a constant moves more than its 1σ allows; at least 1. `path` is the estimate with
/// its 1σ over time.
///
/// If the filter is right, an estimate with variance P, and later P', moves by N(0, P − P') in between. This is true
/// for any other states of the filter. Correlated errors move the estimate further. The factor is the root mean square
/// of this excess, over parts of the run that are longer than the correlation. The error of the estimate is larger by
/// the same factor.
fn excess(path: &[(f64, f64)]) -> f64 {
    let at = |part: usize| path[part * (path.len() - 1) / STEPS];
    let step = |part: usize| {
        let ((from, before), (to, after)) = (at(part), at(part + 1));
        let (before, taken) = (math::powi(before, 2), math::powi(before, 2) - math::powi(after, 2));
        (taken > TAKEN * before).then(|| math::powi(to - from, 2) / taken)
    };
    let squares: Vec<f64> = (1..STEPS).filter_map(step).collect();
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    if squares.len() < FEWEST { 1.0 } else { math::sqrt(mean.max(1.0)) }
}

/// A run to compare with the run of the declared design. It stops when it can no longer reach the limits.
pub(super) struct Trial<'a> {
    pub(super) course: Course,
    before: &'a Course,
    limits: Limits,
    /// Parts of the log that were checked.
    parts: usize,
    pub(super) is_hopeless: bool,
}

/// The gain that a run needs to be reported.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// The least share of the parts of the log that must improve.
    pub(super) share: f64,
    /// The run also stops if it has lost more than this.
    pub(super) loss: f64,
}

impl<'a> Trial<'a> {
    pub(super) fn new(before: &'a Course, limits: Limits) -> Self {
        Self {
            course: Course::default(),
            before,
            limits,
            parts: 0,
            is_hopeless: false,
        }
    }

    /// Checks the limits again when another part is complete.
    fn look(&mut self) {
        let parts = self.course.parts();
        // Measurements of the previous part may still arrive.
        let complete = parts.saturating_sub(2);
        if complete <= self.parts {
            return;
        }
        self.parts = complete;
        let gains: Vec<f64> = self.course.gains(self.before).take(complete).collect();
        let worse = gains.iter().filter(|gain| **gain <= 0.0).count() as f64;
        let most = self.before.parts() as f64;
        self.is_hopeless = worse > (1.0 - self.limits.share) * most || gains.iter().sum::<f64>() < -self.limits.loss;
    }
}

impl RunObserver for Trial<'_> {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        self.course.on(event)?;
        self.look();
        if self.is_hopeless { Err("it explains less".into()) } else { Ok(()) }
    }
}

impl RunObserver for Course {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Estimate { filter, belief, .. }
                if filter.is_outermost() && self.told.last().is_none_or(|(t, ..)| belief.time.seconds_since(*t) >= PERIOD) =>
            {
                self.look(filter, belief);
            }
            RunEvent::Filter {
                filter,
                event: Event::Updated { sensor, update, time, .. },
            } if filter.is_outermost() => self.measured(filter, *sensor, *time, update),
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Innovations of one sensor: the cost in each part of the log.
    fn course(costs: impl IntoIterator<Item = f64>) -> Course {
        let part = |cost| Part {
            measurements: 20.0,
            numbers: 60.0,
            squares: 60.0,
            scatter: 60.0,
            cost,
        };
        Course {
            sensors: vec![("gnss".to_owned(), costs.into_iter().map(part).collect())],
            ..Course::default()
        }
    }

    /// The number of parts out of 100 that a run receives before it stops. `cost` is its cost in each part; the cost
    /// before was 50.
    fn heard(limits: Limits, cost: impl Fn(usize) -> f64) -> usize {
        let before = course(vec![50.0; 100]);
        let mut trial = Trial::new(&before, limits);
        let parts = (1..=100).find(|parts| {
            trial.course = course((0..*parts).map(&cost));
            trial.look();
            trial.is_hopeless
        });
        parts.unwrap_or(100)
    }

    /// The errors of an estimate of a constant, zero. It is measured once a second for 900 s with an error of 1σ = 1,
    /// and the filter assumes white noise. Returns the estimate divided by its own 1σ, and divided by the wider 1σ.
    /// `decay` is the fraction of an error that remains after a second.
    fn errors(seed: u64, decay: f64) -> [f64; 2] {
        let mut random = fusion_core::testing::Lcg::new(seed);
        let (mut x, mut variance, mut error, mut path) = (0.0, 100.0_f64, 0.0, Vec::new());
        for _ in 0..900 {
            error = decay * error + (1.0 - decay * decay).sqrt() * random.normal();
            let gain = variance / (variance + 1.0);
            x += gain * (error - x);
            variance *= 1.0 - gain;
            path.push((x, variance.sqrt()));
        }
        let own = x / variance.sqrt();
        [own, own / excess(&path)]
    }

    #[test]
    fn the_true_value_is_within_three_sigma_where_errors_are_correlated() {
        let beyond = |decay: f64, which: usize| {
            let all = (1..=24).filter(|seed| errors(*seed, decay)[which].abs() > 3.0);
            all.count()
        };
        // White noise, and errors with a correlation time of 10 s: 900 s hold 45 of them.
        assert_eq!([beyond(0.0, 0), beyond(0.0, 1)], [0, 0]);
        let lasting = (-0.1_f64).exp();
        assert!(beyond(lasting, 0) >= 8, "the filter's own: {}", beyond(lasting, 0));
        // Seven squares determine the wider 1σ to about a quarter. Student's t with 7 degrees of freedom exceeds 3 once
        // in 50 times, and three times in 24 once in 80.
        assert!(beyond(lasting, 1) <= 2, "{}", beyond(lasting, 1));
        // White noise widens σ only a little: the mean of eight squares is rarely above 2.
        let widest = (1..=24)
            .map(|seed| errors(seed, 0.0))
            .map(|[own, wide]| own / wide)
            .fold(1.0, f64::max);
        assert!(widest < 2.0, "{widest}");
    }

    #[test]
    fn a_trial_stops_where_it_cannot_be_told_any_more() {
        let shared = Limits {
            share: 0.6,
            loss: f64::INFINITY,
        };
        // 41 of 100 parts are worse, and two parts may still be incomplete.
        assert_eq!(heard(shared, |_| 60.0), 43);
        assert_eq!(
            heard(shared, |part| if part % 5 < 2 { 60.0 } else { 40.0 }),
            100,
            "six parts of ten are better"
        );
        let soon = Limits { loss: 200.0, ..shared };
        assert_eq!(heard(soon, |_| 60.0), 23, "21 parts lose 210");
        assert_eq!(
            heard(soon, |part| if part < 20 { 60.0 } else { 0.0 }),
            100,
            "it loses 200, and gains 4000"
        );
    }
}
