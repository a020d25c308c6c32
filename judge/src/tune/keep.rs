//! Which noises keep their declared value: those that the log does not identify, and those whose change gains little.

use super::climb::{Point, climb};
use super::outage::is_worse;
use super::trials::{Gain, Part, Score, Trials};
use super::{End, PRIOR, all_rows, white};
use crate::likelihood::difference;
use fusion::config::Diagnostics;
use fusion::design::Design;
use fusion_core::consistency::chi_square_quantile;

/// A variance v has the 1σ 2σv, if σ is the 1σ of the logarithm of its root. Above this σ, 0 lies within 1.96 of them.
pub(super) const DOUBT: f64 = 0.255;
/// A value is refuted if keeping it costs a likelihood that chance alone costs with this probability.
const CHANCE: f64 = 0.05;

/// Gives parameters that are not identifiable their declared value, and finds the others anew. If that costs more
/// likelihood than chance does, the parameter that is farthest from its declared value does not keep it: it has the value
/// nearest to the declared one that the log does not refute.
pub(super) fn keep(
    trials: &Trials<'_>,
    design: &Design,
    mut point: Point,
    progress: &(dyn Fn(u64, f64) + Sync),
) -> Result<End, Diagnostics> {
    let d = trials.parameters.len();
    let mut sigmas = point.sigmas();
    for (j, sigma) in sigmas.iter_mut().enumerate() {
        if *sigma > DOUBT && *sigma <= 1.0 && !is_needed(trials, &point, j, progress)? {
            *sigma = f64::INFINITY;
        }
    }
    let best = trials.log_likelihood(&point.score, &all_rows);
    let mut refuted = Vec::new();
    loop {
        let kept: Vec<usize> = (0..d).filter(|j| sigmas[*j] > 1.0 && !refuted.contains(j)).collect();
        if kept.is_empty() {
            break;
        }
        let pinned: Vec<(usize, f64)> = kept.iter().map(|j| (*j, 0.0)).collect();
        let other = climb(trials, point.pinned(&pinned), progress)?;
        let cost = best - trials.log_likelihood(&other.score, &all_rows);
        if cost <= 0.5 * chi_square_quantile(1.0 - CHANCE, kept.len() as f64) {
            point = other;
            break;
        }
        let far = |j: &usize| point.theta[*j].abs();
        refuted.extend(kept.iter().copied().max_by(|a, b| far(a).total_cmp(&far(b))));
    }
    for j in &refuted {
        point = limit(trials, point, *j, progress)?;
    }
    let (point, unseen) = simplest(trials, point, &sigmas, progress)?;
    Ok(End {
        independence: white::judge(design, trials, &point.score),
        point,
        sigmas,
        refuted,
        unseen,
    })
}

/// Moves a parameter that is not identifiable towards its declared value, as far as the log does not refute it: to the end
/// of the interval of its likelihood ratio. The likelihood is almost flat around the maximum, so the maximum itself is
/// arbitrary. The end of the interval is not: it is a limit, right with the probability of the test.
///
/// Source     Cox, Hinkley 1974, *Theoretical Statistics*, §7.2: limits by the likelihood ratio
fn limit(trials: &Trials<'_>, best: Point, j: usize, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<Point, Diagnostics> {
    /// After so many halvings the limit is known to a sixteenth of the way to the declared value.
    const HALVINGS: usize = 4;
    let allowed = 0.5 * chi_square_quantile(1.0 - CHANCE, 1.0);
    let highest = trials.log_likelihood(&best.score, &all_rows);
    let far = best.theta[j];
    let (mut refuted, mut kept, mut point) = (0.0, 1.0, best);
    for _ in 0..HALVINGS {
        let share = 0.5 * (refuted + kept);
        let other = climb(trials, point.pinned(&[(j, share * far)]), progress)?;
        if highest - trials.log_likelihood(&other.score, &all_rows) <= allowed {
            (kept, point) = (share, other);
        } else {
            refuted = share;
        }
    }
    Ok(point)
}

/// The innovations of each part with the noises that the other parts give.
fn unseen(trials: &Trials<'_>, point: &Point) -> Result<Vec<(Part, Score)>, Diagnostics> {
    let parts = point.score.parts(trials.settings.folds).into_iter();
    parts.map(|part| Ok((part, trials.at(&point.without(&part))?))).collect()
}

/// The gains of each part from the innovations `declared` to those with the noises of the other parts.
pub(super) fn gains<'a>(trials: &Trials<'_>, declared: impl Iterator<Item = &'a Score>, unseen: &[(Part, Score)]) -> Vec<Gain> {
    let each = unseen.iter().zip(declared);
    each.flat_map(|((part, score), declared)| trials.gains(declared, score, &|log, time| part.holds(log, time)))
        .collect()
}

/// The sensors, of this number, that lose more likelihood than the 1σ of this loss; with too few rows for a σ, those that
/// lose. Each innovation has its highest expected likelihood at the true noises, for each sensor. So the gain of one sensor
/// cannot pay for the loss of another: if both are real, the design lacks a state, and the noise that is found replaces it.
pub(super) fn losing(sensors: usize, gains: &[Gain]) -> Vec<usize> {
    let is_loss = |sensor: &usize| {
        let own = difference(None, &sorted(gains, |gain| gain.sensor == *sensor && !gain.is_after_outage));
        own.nats < if own.sigma.is_nan() { 0.0 } else { -own.sigma }
    };
    (0..sensors).filter(is_loss).collect()
}

/// Whether a sensor loses, or the rows after outages do.
fn loses(trials: &Trials<'_>, gains: &[Gain]) -> bool {
    !losing(trials.densities.len(), gains).is_empty() || is_worse(gains, trials.outage())
}

/// Time and nats of some gains, in order of time.
fn sorted(gains: &[Gain], counts: impl Fn(&Gain) -> bool) -> Vec<(f64, f64)> {
    let mut rows: Vec<(f64, f64)> = gains
        .iter()
        .filter(|gain| counts(gain))
        .map(|gain| (gain.time, gain.nats))
        .collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    rows
}

/// Gives a noise its declared value back, unless the value that was found gains more likelihood on unseen parts than the
/// 1σ of this gain, by blocks of time, and no sensor loses.
///
/// Source     Breiman, Friedman, Olshen, Stone 1984, §3.4.3: of models within one standard error, the simplest
fn simplest(
    trials: &Trials<'_>,
    mut point: Point,
    sigmas: &[f64],
    progress: &(dyn Fn(u64, f64) + Sync),
) -> Result<(Point, Vec<(Part, Score)>), Diagnostics> {
    /// So many 1σ from its declared value a noise gains 50 nats, on any part.
    const CLEAR: f64 = 10.0;
    let mut best = unseen(trials, &point)?;
    let far = |j: &usize| (point.theta[*j] / sigmas[*j]).abs();
    let declared = trials.at(&vec![0.0; point.theta.len()])?;
    let is_suspect = loses(trials, &gains(trials, std::iter::repeat(&declared), &best));
    let is_clear = |j: &usize| !is_suspect && far(j) >= CLEAR;
    let mut doubtful: Vec<usize> = point.free().iter().copied().filter(|j| sigmas[*j] <= 1.0 && !is_clear(j)).collect();
    doubtful.sort_by(|a, b| far(a).total_cmp(&far(b)));
    for j in doubtful {
        let other = climb(trials, point.pinned(&[(j, 0.0)]), progress)?;
        let theirs = unseen(trials, &other)?;
        let gains = gains(trials, theirs.iter().map(|(_, declared)| declared), &best);
        let gain = difference(None, &sorted(&gains, |_| true));
        let is_small = gain.nats <= if gain.sigma.is_nan() { 0.0 } else { gain.sigma };
        if is_small || loses(trials, &gains) {
            (point, best) = (other, theirs);
        }
    }
    Ok((point, best))
}

/// Whether the log refutes that a noise is absent: a twentieth of it, with the others found anew, costs more likelihood
/// than chance does. The information at a maximum does not say this of a noise that is small.
fn is_needed(trials: &Trials<'_>, point: &Point, j: usize, progress: &(dyn Fn(u64, f64) + Sync)) -> Result<bool, Diagnostics> {
    let without = climb(trials, point.pinned(&[(j, point.theta[j] - PRIOR)]), progress)?;
    let cost = trials.log_likelihood(&point.score, &all_rows) - trials.log_likelihood(&without.score, &all_rows);
    Ok(cost > 0.5 * chi_square_quantile(1.0 - CHANCE, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_beyond_chance_of_any_sensor_is_found_however_much_another_one_gains() {
        let rows = |sensor: usize, count: u32, each: fn(u32) -> f64| {
            (0..count).map(move |k| Gain {
                sensor,
                time: f64::from(k),
                is_after_outage: false,
                nats: each(k),
            })
        };
        let mut gains: Vec<Gain> = rows(0, 400, |_| 10.0).collect();
        // A row in each block of time, ±1: 1σ of the sum is √20 · √(20/19) = 4.6. Sensor 1 loses 4, sensor 2 loses 6.
        gains.extend(rows(1, 20, |k| if k.is_multiple_of(2) { 0.8 } else { -1.2 }));
        gains.extend(rows(2, 20, |k| if k.is_multiple_of(2) { 0.7 } else { -1.3 }));
        // Too few rows for a σ.
        gains.extend(rows(3, 5, |_| -0.1));
        gains.extend(rows(4, 5, |_| 0.1));
        assert_eq!(losing(6, &gains), [2, 3]);
    }
}
