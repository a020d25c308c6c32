//! The difference of likelihood between two designs, over the rows that both count.
//!
//! ```text
//! D = Σ dₖ,  dₖ = ln p₂(rₖ) − ln p₁(rₖ),   σ_D² = B/(B−1) Σ_b (D_b − D/B)²,  D_b over the b-th of B blocks of time
//! ```
//!
//! Neighbouring rows are correlated: they are of one motion, and one state. Sums over blocks that are long compared
//! with this correlation are independent.
//!
//! Source     Schmeiser 1982 (Operations Research 30(3), 556): batch means, ten to thirty batches

use super::Density;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion_core::health::State;
use fusion_core::math;
use fusion_core::runner::{Event, Halt};
use std::hash::{DefaultHasher, Hasher};

/// Blocks of time for an error: in the middle of what Schmeiser recommends. More blocks are shorter, fewer determine a
/// variance less.
pub(crate) const BLOCKS: usize = 20;

/// The likelihood of each row of a run.
#[derive(Debug)]
pub struct Terms {
    sensors: Vec<Sensor>,
    /// When the filter was good for the first time \[s\].
    aligned: Option<f64>,
}

#[derive(Clone, Debug)]
struct Sensor {
    name: String,
    density: Option<Density>,
    terms: Vec<Term>,
}

/// A row: its number in its source, when it is valid \[s\], ln p, and a hash of what was measured.
#[derive(Clone, Copy, Debug)]
struct Term {
    number: u64,
    time: f64,
    log: f64,
    measured: u64,
}

impl Terms {
    /// For a run of a design.
    #[must_use]
    pub fn new(design: &Design) -> Self {
        let sensors = design.sensors.iter().zip(super::densities(design));
        Self {
            sensors: sensors
                .map(|(sensor, density)| Sensor {
                    name: sensor.name.clone(),
                    density,
                    terms: Vec::new(),
                })
                .collect(),
            aligned: None,
        }
    }

    /// The time of the rows that count \[s\].
    pub(crate) fn span(&self) -> (f64, f64) {
        let times = self.sensors.iter().flat_map(|sensor| self.counted(sensor)).map(|term| term.time);
        times.fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), time| {
            (from.min(time), to.max(time))
        })
    }

    /// Its rows from a time on \[s\].
    pub(crate) fn after(&self, from: f64) -> Self {
        Self {
            aligned: Some(self.aligned.map_or(from, |aligned| aligned.max(from))),
            sensors: self.sensors.clone(),
        }
    }

    /// The rows of a sensor that count.
    fn counted<'a>(&self, sensor: &'a Sensor) -> &'a [Term] {
        let from = self.aligned.unwrap_or(f64::NEG_INFINITY);
        &sensor.terms[sensor.terms.partition_point(|term| term.time < from)..]
    }
}

impl RunObserver for Terms {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter { filter, event } = event else {
            return Ok(());
        };
        match event {
            Event::Health { health } if filter.is_outermost() && health.state == State::Good => {
                self.aligned = self.aligned.or(Some(health.since.seconds()));
            }
            Event::Updated {
                sensor, update, time, row, ..
            } if filter.is_outermost() => {
                let own = &mut self.sensors[filter.sensors[*sensor].design];
                if let Some(log) = own.density.and_then(|density| density.of_update(update)) {
                    own.terms.push(Term {
                        number: row.number,
                        time: time.seconds(),
                        log,
                        measured: hash(update.value),
                    });
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// The difference of ln L between two runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The sensor; `None` for all together.
    pub sensor: Option<String>,
    /// Rows that count in both runs.
    pub rows: usize,
    /// How much larger the second run's ln L is \[nats\].
    pub nats: f64,
    /// The 1σ of `nats`, by blocks of time; NaN with fewer rows than blocks.
    pub sigma: f64,
}

/// The differences from `first` to `second`, for each sensor that both have, and for all together. Rows are matched by
/// their number in their source, and count if both runs measured the same: two simulated worlds do not compare.
#[must_use]
pub fn differences(first: &Terms, second: &Terms) -> Vec<Difference> {
    let of = |one: &Sensor| {
        let other = second.sensors.iter().find(|other| other.name == one.name)?;
        // Rows that come late are not in the order of their numbers.
        let mut theirs = second.counted(other).to_vec();
        theirs.sort_by_key(|term| term.number);
        let matched = first.counted(one).iter().filter_map(|term| {
            let at = theirs.binary_search_by_key(&term.number, |other| other.number).ok()?;
            let other = theirs.get(at).filter(|other| other.measured == term.measured)?;
            Some((term.time, other.log - term.log))
        });
        let matched: Vec<(f64, f64)> = matched.collect();
        (!matched.is_empty()).then(|| (one.name.clone(), matched))
    };
    let each: Vec<(String, Vec<(f64, f64)>)> = first.sensors.iter().filter_map(of).collect();
    let mut all: Vec<(f64, f64)> = each.iter().flat_map(|(_, rows)| rows.iter().copied()).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let of_sensors = each.iter().map(|(name, rows)| difference(Some(name.clone()), rows));
    let together = (each.len() > 1).then(|| difference(None, &all));
    of_sensors.chain(together).collect()
}

/// The same for the same bits.
fn hash(value: &[f64]) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.iter().for_each(|v| hasher.write_u64(v.to_bits()));
    hasher.finish()
}

/// The sum of differences in order of time, and its 1σ.
pub(crate) fn difference(sensor: Option<String>, rows: &[(f64, f64)]) -> Difference {
    let (from, to) = (rows.first().map_or(0.0, |row| row.0), rows.last().map_or(0.0, |row| row.0));
    let mut blocks = [0.0; BLOCKS];
    for (time, nats) in rows {
        blocks[block((from, to), *time)] += nats;
    }
    let nats: f64 = blocks.iter().sum();
    let count = BLOCKS as f64;
    let squares: f64 = blocks.iter().map(|block| math::powi(block - nats / count, 2)).sum();
    let is_determined = rows.len() >= BLOCKS;
    Difference {
        sensor,
        rows: rows.len(),
        nats,
        sigma: if is_determined {
            math::sqrt(squares * count / (count - 1.0))
        } else {
            f64::NAN
        },
    }
}

/// The block of a time within a span.
pub(crate) fn block((from, to): (f64, f64), time: f64) -> usize {
    let at = (time - from) / (to - from) * BLOCKS as f64;
    // The last time is in the last block; a span without length has one block.
    if at.is_finite() {
        (at.max(0.0) as usize).min(BLOCKS - 1)
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::testing::Lcg;

    /// A sum of correlated terms has the variance of its blocks, not that of its terms.
    #[test]
    fn the_error_of_a_difference_holds_if_terms_are_correlated() {
        let mut random = Lcg::new(3);
        let (n, rho, runs) = (2000_usize, 0.9, 400);
        let (mut sums, mut variances) = (0.0, 0.0);
        for _ in 0..runs {
            let mut last = 0.0;
            let rows: Vec<(f64, f64)> = (0..n)
                .map(|k| {
                    last = rho * last + random.normal();
                    (k as f64, last)
                })
                .collect();
            let found = difference(None, &rows);
            sums += found.nats * found.nats;
            variances += found.sigma * found.sigma;
        }
        // 2 · σ of a ratio of two means over 400 runs: √(2/400) and √(2/19/400) give 0.15. A block of 100 terms lacks
        // 2ρ/(1 − ρ²)/100 = 9 % of the variance.
        let ratio = variances / sums;
        assert!((0.91_f64 - ratio).abs() < 0.15, "{ratio}");
    }
}
