//! Prediction over outages: further runs of each log, in which rows are withheld for a declared time.
//!
//! ```text
//! rows of the log   ─────────────────────────────────────▶ time
//! first replay      used │ D withheld │ used D │ D withheld │ …
//! second replay     used │   used D   │ D withheld │ used D │ …
//! ```
//!
//! Each instant is in an outage of one of the two replays. Only the first row of a sensor after an outage counts: its
//! innovation is the drift, and its S is what the filter expects of it. The likelihood of such a row is a proper score of
//! the prediction, as that of the next row is. The sum of both is a composite likelihood: it has its maximum at the true
//! noises, and the sandwich gives its intervals.
//!
//! A replay has all other rows of the log, so that its outages begin with the filter in use.
//!
//! Source     Varin, Reid, Firth 2011 (Statistica Sinica 21, 5): composite likelihood; Gneiting, Raftery 2007 (JASA
//!            102, 359): proper scores

use super::trials::{Gain, Part, Score, Trials};
use super::white;
use fusion::config::{Diagnostic, Edit};
use fusion::design::Design;
use fusion_core::math;

/// An outage of instruments, over which a tuned filter has to predict.
#[derive(Clone, Debug, PartialEq)]
pub struct Outage {
    /// How long it lasts \[s\].
    pub duration: f64,
    /// The source or the sensor that is silent; `None` for all instruments.
    pub of: Option<String>,
}

/// The prediction of the first rows of a sensor after outages, on parts of the log that were not seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Coasting {
    /// The sensor.
    pub sensor: String,
    /// How many outages.
    pub outages: usize,
    /// The RMS of the innovations with the declared noises, in the unit of the sensor.
    pub declared: f64,
    /// The same with the noises that the other parts give.
    pub found: f64,
    /// The gain in ln L.
    pub nats: f64,
}

/// A run of a log with outages.
#[derive(Clone, Debug)]
pub(super) struct Replay {
    pub(super) log: usize,
    pub(super) duration: f64,
    edits: Vec<Edit>,
}

impl Replay {
    pub(super) fn edits(&self) -> &[Edit] {
        &self.edits
    }
}

/// The replays of all logs, by their runs without outages.
pub(super) fn replays(design: &Design, trials: &Trials<'_>, score: &Score, outage: &Outage) -> Result<Vec<Replay>, Diagnostic> {
    let sensors = design.sensors.iter().enumerate().filter(|(k, _)| trials.densities[*k].is_some());
    let is_silent = |name: &str, source: &str| outage.of.as_deref().is_none_or(|of| of == name || of == source);
    let mut tables: Vec<String> = sensors
        .filter(|(_, sensor)| is_silent(&sensor.name, &sensor.block.common.source))
        .map(|(k, _)| white::table(design, k))
        .collect();
    tables.sort();
    tables.dedup();
    if tables.is_empty() {
        let of = outage.of.as_deref().unwrap_or_default();
        return Err(Diagnostic::error(format!(
            "an outage of `{of}`: no instrument has this name, and no source of an instrument"
        )));
    }
    let duration = outage.duration;
    let mut made = Vec::new();
    for log in 0..score.logs().len() {
        let (from, to) = score.span(log);
        for first in [from + duration, from + 2.0 * duration] {
            if first + duration >= to {
                continue;
            }
            let window = format!(
                "{{ from = \"{first:?} s\", duration = \"{duration:?} s\", every = \"{:?} s\" }}",
                2.0 * duration
            );
            let edit = |table: &String| {
                let fault = format!("{{ type = \"outage\", window = {window} }}");
                Edit::set(format!("{table}.fault.withheld_by_tune"), fault)
            };
            made.push(Replay {
                log,
                duration,
                edits: tables.iter().map(edit).collect(),
            });
        }
    }
    if made.is_empty() {
        return Err(Diagnostic::error(format!("no outage of {duration} s fits into the log")));
    }
    Ok(made)
}

/// How each sensor is predicted after outages, with the noises of the other parts.
pub(super) fn coasting(design: &Design, trials: &Trials<'_>, declared: &Score, unseen: &[(Part, Score)]) -> Vec<Coasting> {
    let of = |sensor: usize| {
        let density = trials.densities[sensor]?;
        let mut own = Coasting {
            sensor: design.sensors[sensor].name.clone(),
            outages: 0,
            declared: 0.0,
            found: 0.0,
            nats: 0.0,
        };
        for (part, score) in unseen {
            for run in trials.logs.len()..declared.runs.len() {
                let (Some(one), Some(other)) = (&declared.runs[run].0[sensor], &score.runs[run].0[sensor]) else {
                    continue;
                };
                for k in (0..one.len()).filter(|k| part.holds(trials.log_of(run), one.times[*k])) {
                    let Some(at) = other.at(one.numbers[k]) else { continue };
                    let ((r, l), (r_new, l_new)) = (one.innovation(k), other.innovation(at));
                    own.outages += 1;
                    own.declared += r.iter().map(|r| r * r).sum::<f64>();
                    own.found += r_new.iter().map(|r| r * r).sum::<f64>();
                    own.nats += density.log(r_new, l_new) - density.log(r, l);
                }
            }
        }
        let count = own.outages as f64;
        (own.declared, own.found) = (math::sqrt(own.declared / count), math::sqrt(own.found / count));
        (own.outages > 0).then_some(own)
    };
    (0..trials.densities.len()).filter_map(of).collect()
}

/// Whether the rows after outages lose more likelihood than the 1σ of this loss. Rows after one outage count together: they
/// have one drift.
pub(super) fn is_worse(gains: &[Gain], duration: f64) -> bool {
    let mut gains: Vec<&Gain> = gains.iter().filter(|gain| gain.is_after_outage).collect();
    gains.sort_by(|a, b| a.time.total_cmp(&b.time));
    let each: Vec<f64> = gains
        .chunk_by(|a, b| b.time - a.time < 0.5 * duration)
        .map(|rows| rows.iter().map(|gain| gain.nats).sum())
        .collect();
    let count = each.len() as f64;
    let sum: f64 = each.iter().sum();
    if each.len() < 2 {
        return sum < 0.0;
    }
    let squares: f64 = each.iter().map(|gain| math::powi(gain - sum / count, 2)).sum();
    sum < -math::sqrt(squares * count / (count - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_within_chance_is_no_loss_and_rows_of_one_outage_count_together() {
        let alternating = |loss: f64, rows: usize| -> Vec<Gain> {
            let of = |k: i32| Gain {
                sensor: 0,
                time: 100.0 * f64::from(k),
                is_after_outage: true,
                nats: f64::from(k % 2) * 2.0 - 1.0 - loss,
            };
            (0..10).flat_map(|k| vec![of(k); rows]).collect()
        };
        // Ten outages of ±1: 1σ of the sum is √10 · √(10/9) = 3.3.
        assert!(!is_worse(&alternating(0.3, 1), 30.0));
        assert!(is_worse(&alternating(0.4, 1), 30.0));
        // Twice the same rows do not halve the variance of the mean.
        assert!(!is_worse(&alternating(0.3, 2), 30.0));
    }
}
