//! Whether innovations are independent, and the thinning of rows that makes them so.

use super::record::Rows;
use super::trials::{Score, Trials};
use crate::likelihood::{BLOCKS, Density, block, whitened};
use fusion::config::{Diagnostic, Diagnostics, Edit};
use fusion::design::Design;
use fusion_core::consistency::{chi_square_quantile, chi_square_tail};
use fusion_core::math;

/// Autocorrelations up to this lag are tested together.
const LAGS: usize = 5;
/// With fewer rows than five for each tested lag, the test says nothing (Hyndman, Athanasopoulos 2021, §5.4).
pub(super) const FEWEST: usize = 5 * LAGS;
/// A gated sensor is judged by the innovations that a good row has with this probability.
const GOOD: f64 = 0.99;

/// The share of parts of a log in which σ is at most `varies` times the average, if the designer declares none.
const COVERED: f64 = 0.95;

/// The independence of the innovations of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Independence {
    /// The sensor.
    pub sensor: String,
    /// Rows that counted.
    pub rows: usize,
    /// One row in so many was used.
    pub one_in: u32,
    /// The probability of such autocorrelations if the innovations are white (Ljung, Box 1978, Biometrika 65, 297).
    pub whiteness: f64,
    /// The probability of so many large NIS if they are χ² (Kolmogorov and Smirnov, one-sided). Small ones leave the
    /// filter conservative, and refute nothing.
    pub distribution: f64,
    /// The factor by which the noise overweights the rows of the whole log: their mean square over the expected one,
    /// times the sum of their autocorrelations. Up to 1, the noise covers a correlation, and the rows may be correlated.
    /// Far above 1, an error lasts that has no state.
    pub overweighted: f64,
    /// How much larger σ is than on average, in one of twenty parts of a log such as this one, or in the share of parts that
    /// [`Settings::cover`](super::Settings::cover) leaves out; 1 if nothing refutes that σ is constant. No refusal follows
    /// from it: one noise cannot describe such a sensor.
    pub varies: f64,
    /// Whether nothing refutes that the rows are used as what they are.
    pub is_white: bool,
    /// The stage that makes its rows, if no sensor of the design reads an instrument itself. Rows of a stage are never
    /// independent: it averages or filters its input, or selects rows by their values.
    pub stage: Option<String>,
}

/// The share of the rows of a stream that is used.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Thinned {
    /// The table of the stream in the design.
    table: String,
    one_in: u32,
    /// The time of a row that stays, and the time between two rows \[s\].
    first: f64,
    interval: f64,
}

impl Thinned {
    /// The edit that withholds the other rows.
    pub(super) fn edit(&self) -> Edit {
        let (every, period) = (f64::from(self.one_in), self.interval);
        let window = format!(
            "{{ from = \"{:?} s\", duration = \"{:?} s\", every = \"{:?} s\" }}",
            self.first + 0.5 * period,
            (every - 1.0) * period,
            every * period
        );
        Edit::set(
            format!("{}.fault.thinned", self.table),
            format!("{{ type = \"drop\", rate = \"100 %\", window = {window} }}"),
        )
    }
}

/// The table of the stream of a sensor.
pub(super) fn table(design: &Design, sensor: usize) -> String {
    let (name, source) = (&design.sensors[sensor].name, &design.sensors[sensor].block.common.source);
    // A simulated instrument has the name of the sensor or of its stream.
    let simulated = [name, source].map(|name| format!("simulation.sensor.{name}"));
    let is_there = |path: &&String| design.simulation.is_some() && design.document.root().at(path).is_some();
    simulated
        .iter()
        .find(is_there)
        .cloned()
        .unwrap_or_else(|| format!("source.{source}"))
}

/// The independence of each sensor with rows.
pub(super) fn judge(design: &Design, trials: &Trials<'_>, score: &Score) -> Vec<Independence> {
    let of = |sensor: usize| {
        let gated = trials.densities[sensor]? != Density::Normal;
        let logs = score
            .logs()
            .iter()
            .filter_map(|(sensors, from)| Some((sensors[sensor].as_ref()?, *from)));
        let logs: Vec<(&Rows, f64)> = logs.collect();
        let all: Vec<Vec<Vec<f64>>> = logs.iter().map(|(rows, from)| counted(rows, *from)).collect();
        let rows: usize = all.iter().map(Vec::len).sum();
        let m = all.iter().flatten().next()?.len();
        let limit = if gated {
            chi_square_quantile(GOOD, m as f64)
        } else {
            f64::INFINITY
        };
        let whiteness = ljung_box(&all, math::sqrt(limit));
        let distribution = kolmogorov(all.iter().flatten().map(|w| w.iter().map(|w| w * w).sum()), m, limit);
        let blocks = logs.iter().flat_map(|(rows, from)| squares(rows, *from, limit)).collect::<Vec<_>>();
        let varies = variation(&blocks, m, trials.settings.cover.unwrap_or(COVERED), trials.settings.false_refusal);
        let overweighted = all.iter().map(|log| overweight(log)).fold(0.0, f64::max);
        let stream = table(design, sensor);
        let thinned = trials.thinning.iter().flatten().find(|t| t.table == stream);
        let limit = trials.settings.false_refusal;
        Some(Independence {
            sensor: design.sensors[sensor].name.clone(),
            rows,
            one_in: thinned.map_or(1, |t| t.one_in),
            whiteness,
            distribution,
            overweighted,
            varies,
            is_white: (whiteness > limit || overweighted <= 1.0) && distribution > limit,
            stage: None,
        })
    };
    (0..trials.densities.len()).filter_map(of).collect()
}

/// The innovations of the sensors that stages feed, with the declared noises: none of them is independent.
pub(super) fn of_stages(design: &Design, trials: &Trials<'_>) -> Result<Vec<Independence>, Diagnostics> {
    let score = trials.at(&vec![0.0; trials.parameters.len()])?;
    let stage = |sensor: &str| {
        design
            .sensors
            .iter()
            .find(|s| s.name == sensor)
            .map(|s| s.block.common.source.clone())
    };
    let refused = |own: Independence| Independence {
        is_white: false,
        stage: stage(&own.sensor),
        ..own
    };
    let found: Vec<Independence> = judge(design, trials, &score).into_iter().map(refused).collect();
    if found.is_empty() {
        Err(none_counts(design, trials, &score).into())
    } else {
        Ok(found)
    }
}

/// The error for a log without innovations, with the rows of each sensor that could have some.
fn none_counts(design: &Design, trials: &Trials<'_>, score: &Score) -> Diagnostic {
    let error = Diagnostic::error("no innovation counts");
    let heard = |sensor: usize| -> u32 {
        let each = score.logs().iter().filter_map(|(all, _)| all[sensor].as_ref());
        each.map(Rows::heard).sum()
    };
    let sensors = design.sensors.iter().enumerate().filter(|(k, _)| trials.densities[*k].is_some());
    let sensors: Vec<(&str, u32)> = sensors.map(|(k, sensor)| (&*sensor.name, heard(k))).collect();
    let names = |text: fn(&(&str, u32)) -> String| sensors.iter().map(text).collect::<Vec<_>>().join(", ");
    error.help(if sensors.is_empty() {
        "no sensor of the design measures: a constraint agrees with itself".to_owned()
    } else if sensors.iter().all(|(_, rows)| *rows == 0) {
        let names = names(|(name, _)| format!("`{name}`"));
        format!("no row of {names} reached the filter: `fusion run` shows what it waits for")
    } else {
        let rows = names(|(name, rows)| format!("{rows} rows of `{name}`"));
        let is_aligned = score.logs().iter().any(|(_, from)| from.is_finite());
        let why = if is_aligned {
            "are before the alignment, of a vehicle at rest, or without a covariance"
        } else {
            "came while the filter was not aligned: `fusion run` shows why it never was"
        };
        format!("{rows} {why}")
    })
}

/// The whitened innovations that count.
fn counted(rows: &Rows, from: f64) -> Vec<Vec<f64>> {
    let counted = (0..rows.len()).filter(|k| rows.times[*k] >= from);
    counted
        .map(|k| {
            let (r, l) = rows.innovation(k);
            whitened(r, l)
        })
        .collect()
}

/// Rows and sum of the NIS that count, for each of the blocks of time of a log. Larger values than `limit` count as it.
fn squares(rows: &Rows, from: f64, limit: f64) -> [(f64, f64); BLOCKS] {
    let span = (from, rows.times.last().map_or(from, |last| last.max(from)));
    let mut blocks = [(0.0, 0.0); BLOCKS];
    for k in (0..rows.len()).filter(|k| rows.times[*k] >= from) {
        let (r, l) = rows.innovation(k);
        let square: f64 = whitened(r, l).iter().map(|w| w * w).sum();
        let own = &mut blocks[block(span, rows.times[k])];
        *own = (own.0 + 1.0, own.1 + square.min(limit));
    }
    blocks
}

/// The factor that σ exceeds in a share of 1 − `covered` of the blocks, from rows and sum of the NIS of each; 1 if the
/// means of the blocks do not differ more than chance allows.
///
/// ```text
/// q_b = mean of block / mean of all;  Σ m n_b (q_b − 1)² / 2 ~ χ²(B − 1);  ln q_b = ln of its σ² + chance of 2/(m n_b)
/// ```
fn variation(blocks: &[(f64, f64)], m: usize, covered: f64, probability: f64) -> f64 {
    let filled: Vec<(f64, f64)> = blocks.iter().copied().filter(|(rows, sum)| *rows > 0.0 && *sum > 0.0).collect();
    let (rows, sum) = filled.iter().fold((0.0, 0.0), |all, own| (all.0 + own.0, all.1 + own.1));
    let weights = filled.iter().map(|(rows, _)| 0.5 * m as f64 * rows);
    let ratios: Vec<f64> = filled.iter().map(|(n, own)| own / n / (sum / rows)).collect();
    let chance: f64 = weights
        .clone()
        .zip(&ratios)
        .map(|(weight, q)| weight * math::powi(q - 1.0, 2))
        .sum();
    let count = filled.len() as f64;
    if count < 2.0 || chi_square_tail(chance, count - 1.0) > probability {
        return 1.0;
    }
    let mean = ratios.iter().map(|q| math::ln(*q)).sum::<f64>() / count;
    let variance = ratios.iter().map(|q| math::powi(math::ln(*q) - mean, 2)).sum::<f64>() / (count - 1.0);
    let by_chance = weights.map(|weight| 1.0 / weight).sum::<f64>() / count;
    // The square of a standard normal variable is below this where the variable is within ± the quantile.
    let above = math::sqrt(chi_square_quantile((2.0 * covered - 1.0).max(0.0), 1.0));
    math::exp(0.5 * above * math::sqrt((variance - by_chance).max(0.0)))
}

/// The probability of autocorrelations as large as these. Larger values than `limit` count as `limit`.
fn ljung_box(logs: &[Vec<Vec<f64>>], limit: f64) -> f64 {
    let (mut q, mut dof) = (0.0, 0.0);
    for log in logs.iter().filter(|log| log.len() >= FEWEST) {
        let n = log.len() as f64;
        for axis in 0..log[0].len() {
            let values: Vec<f64> = log.iter().map(|w| w[axis].clamp(-limit, limit)).collect();
            let own: f64 = values.iter().map(|v| v * v).sum();
            for lag in 1..=LAGS {
                let rho = values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>() / own;
                q += n * (n + 2.0) * rho * rho / (n - lag as f64);
            }
            dof += LAGS as f64;
        }
    }
    if dof > 0.0 { chi_square_tail(q, dof) } else { 1.0 }
}

/// Mean square times the sum of autocorrelations over all lags up to the first that is not positive. The axis with the
/// largest value counts.
fn overweight(log: &[Vec<f64>]) -> f64 {
    let m = log.first().map_or(0, Vec::len);
    let of = |axis: usize| {
        let values: Vec<f64> = log.iter().map(|w| w[axis]).collect();
        let own: f64 = values.iter().map(|v| v * v).sum();
        let rho = |lag: usize| values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>() / own;
        let sum: f64 = (1..values.len() / 2).map(rho).take_while(|rho| *rho > 0.0).sum();
        own / values.len() as f64 * (1.0 + 2.0 * sum)
    };
    (0..m).map(of).fold(0.0, f64::max)
}

/// The probability of a distribution as far above χ² with `m` degrees of freedom, below `limit`.
fn kolmogorov(squares: impl Iterator<Item = f64>, m: usize, limit: f64) -> f64 {
    let below = |x: f64| 1.0 - chi_square_tail(x, m as f64);
    let all = if limit.is_finite() { below(limit) } else { 1.0 };
    let mut shares: Vec<f64> = squares.filter(|x| *x <= limit).map(|x| below(x) / all).collect();
    shares.sort_by(f64::total_cmp);
    let n = shares.len() as f64;
    let distance = shares.iter().enumerate().map(|(k, share)| share - k as f64 / n).fold(0.0, f64::max);
    // Smirnov 1939: the limit for many values, which is above the probability for few.
    math::exp(-2.0 * n * distance * distance)
}

/// Thins the streams of sensors that are not white to one row in twice as many. Returns false if all are white, or if
/// too few rows would be left.
pub(super) fn thin(trials: &mut Trials<'_>, design: &Design, found: &[Independence], score: &Score) -> Result<bool, Diagnostics> {
    if found.is_empty() {
        return Err(none_counts(design, trials, score).into());
    }
    let is_dependent = |own: &&Independence| own.whiteness <= trials.settings.false_refusal && own.overweighted > 1.0;
    let dependent: Vec<&Independence> = found.iter().filter(is_dependent).filter(|own| own.rows >= 2 * FEWEST).collect();
    let sensors: Vec<usize> = dependent
        .iter()
        .filter_map(|own| design.sensors.iter().position(|s| s.name == own.sensor))
        .collect();
    Ok(thin_sensors(trials, design, &sensors, score))
}

/// Thins the streams of all sensors with enough rows. Returns false if no sensor has.
pub(super) fn thin_all(trials: &mut Trials<'_>, design: &Design, score: &Score) -> bool {
    let rows = |sensor: usize| {
        let each = score.logs().iter().filter_map(|(sensors, _)| sensors[sensor].as_ref());
        each.map(Rows::len).sum::<usize>()
    };
    let sensors: Vec<usize> = (0..design.sensors.len()).filter(|sensor| rows(*sensor) >= 2 * FEWEST).collect();
    thin_sensors(trials, design, &sensors, score)
}

fn thin_sensors(trials: &mut Trials<'_>, design: &Design, sensors: &[usize], score: &Score) -> bool {
    // Two sensors of one stream thin it once.
    let mut streams: Vec<(String, usize)> = sensors.iter().map(|sensor| (table(design, *sensor), *sensor)).collect();
    streams.sort();
    streams.dedup_by(|a, b| a.0 == b.0);
    let mut has_thinned = false;
    for (stream, sensor) in streams {
        for (log, thinning) in trials.thinning.iter_mut().enumerate() {
            if let Some(before) = thinning.iter_mut().find(|t| t.table == stream) {
                before.one_in *= 2;
                has_thinned = true;
                continue;
            }
            let Some(rows) = score.logs()[log].0[sensor].as_ref().filter(|rows| rows.len() > 1) else {
                continue;
            };
            let gaps = rows.times.windows(2).map(|pair| pair[1] - pair[0]);
            let mut gaps: Vec<f64> = gaps.filter(|gap| *gap > 0.0).collect();
            gaps.sort_by(f64::total_cmp);
            let Some(interval) = gaps.get(gaps.len() / 2).copied() else {
                continue;
            };
            thinning.push(Thinned {
                table: stream.clone(),
                one_in: 2,
                first: rows.times[0],
                interval,
            });
            has_thinned = true;
        }
    }
    has_thinned
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::testing::Lcg;

    /// `n` values, each with `rho` of the one before.
    fn series(n: usize, rho: f64, seed: u64) -> Vec<Vec<f64>> {
        let mut random = Lcg::new(seed);
        let mut last = 0.0;
        (0..n)
            .map(|_| {
                last = rho * last + (1.0 - rho * rho).sqrt() * random.normal();
                vec![last]
            })
            .collect()
    }

    #[test]
    fn white_series_pass_and_correlated_ones_do_not() {
        let p: Vec<f64> = (0..40)
            .map(|seed| ljung_box(&[series(400, 0.0, seed + 1)], f64::INFINITY))
            .collect();
        // Of forty probabilities, ten are below 0.25 on average; 1σ is 2.7.
        let low = p.iter().filter(|p| **p < 0.25).count();
        assert!((1..=19).contains(&low), "{p:?}");
        assert!(p.iter().all(|p| *p > 1e-4), "{p:?}");
        assert!(ljung_box(&[series(400, 0.5, 3)], f64::INFINITY) < 1e-6);
    }

    #[test]
    fn a_noise_that_changes_in_time_is_told_from_a_constant_one() {
        let blocks = |spread: f64, seed: u64| {
            let rows = series(2000, 0.0, seed);
            let sigma = |b: usize| (spread * (if b.is_multiple_of(2) { 1.0 } else { -1.0 })).exp();
            let of = |(b, rows): (usize, &[Vec<f64>])| (100.0, rows.iter().map(|w| (sigma(b) * w[0]).powi(2)).sum());
            rows.chunks(100).enumerate().map(of).collect::<Vec<(f64, f64)>>()
        };
        assert!((1..20).all(|seed| variation(&blocks(0.0, seed), 1, 0.95, 1e-3) == 1.0));
        // ln σ is ±0.5, with the deviation 0.5 √(20/19); 5 % of 2000 rows determine it to a tenth.
        let found = variation(&blocks(0.5, 1), 1, 0.95, 1e-3).ln();
        assert!((found / (1.645 * 0.513) - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn the_distribution_of_nis_is_told_from_a_wider_one() {
        let of = |scale: f64, seed: u64| {
            let squares: Vec<f64> = series(400, 0.0, seed).iter().map(|w| scale * w[0] * w[0]).collect();
            kolmogorov(squares.into_iter(), 1, f64::INFINITY)
        };
        assert!((1..20).all(|seed| of(1.0, seed) > 1e-3));
        assert!(of(2.0, 1) < 1e-4 && of(0.5, 1) > 0.1);
    }
}
