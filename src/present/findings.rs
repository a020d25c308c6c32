//! What to look at next: advice that follows from the statistics of a run.
//!
//! Each finding names its evidence in figures and the setting to change. The order is that of a search: what a
//! gate refused is not in the other figures, so it comes first; then errors that are larger than the filter
//! says, then those that are smaller.
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, §5.4 (what a mean NEES or NIS outside its band means).

use super::judged::NEES;
use super::number::short;
use super::tree::Section;
use crate::observe::SensorStatistics;
use crate::run::Summary;
use crate::score::{Consistency, Verdict};

/// The share of rejected measurements from which on a gate does more than to remove outliers; a gate of 99 %
/// refuses 1 % of the good ones.
const REJECTED: f64 = 0.05;
/// Fewer measurements say little about a share: of 20, one rejected is already 5 %.
const FEW: u64 = 20;
/// The mean statistic over its degrees of freedom from which on it is worth a change: errors are then
/// √1.5 = 1.22 times the 1σ of the filter.
const LARGE: f64 = 1.5;
/// The same below: errors are √0.5 = 0.71 times the 1σ.
const SMALL: f64 = 0.5;
/// The share of independent samples below which a series counts as correlated: a first-order process with the
/// correlation 1/2 from one sample to the next has (1 − 1/2) / (1 + 1/2).
const CORRELATED: f64 = 1.0 / 3.0;

/// What was found, a sentence each, the first to look at first; none of a consistent run.
#[must_use]
pub fn findings(summary: &Summary) -> Vec<String> {
    let rejected = summary.sensors.iter().filter_map(rejected);
    let nees = summary.score.iter().flat_map(|score| {
        let all = [&score.nees_position, &score.nees_velocity, &score.nees_attitude];
        NEES.into_iter().zip(all).filter_map(|(name, c)| errors(name, c.as_ref()?))
    });
    let judged = || summary.sensors.iter().filter_map(|s| Some((s.name.as_str(), s.nis.as_ref()?)));
    let large = judged().filter_map(|(name, nis)| large(name, nis));
    let small = judged().filter_map(|(name, nis)| small(name, nis));
    rejected.chain(nees).chain(large).chain(small).collect()
}

/// The findings as they are shown.
pub(super) fn section(summary: &Summary) -> Section {
    let mut section = Section::new("What to look at next", []);
    section.notes = findings(summary).into_iter().map(|f| format!("- {f}")).collect();
    if section.notes.is_empty() { Section::default() } else { section }
}

/// A gate that refuses more than outliers.
fn rejected(s: &SensorStatistics) -> Option<String> {
    let all = s.accepted + s.reacquired + s.rejected;
    // Rejected rows that a declared fault disturbed are what the gate is there for.
    let good = s.rejected - s.disturbed.map_or(0, |d| d.caught).min(s.rejected);
    let share = good as f64 / all as f64;
    (all >= FEW && share > REJECTED).then(|| {
        format!(
            "The gate of `{}` rejected {good} of {all} measurements ({:.0} %): look at its time stamps, lever arm and \
             axes; if they are right, `noise` is too small.",
            s.name,
            100.0 * share
        )
    })
}

/// Errors against the reference that are larger than the covariance says.
fn errors(name: &str, c: &Consistency) -> Option<String> {
    (c.verdict() == Some(Verdict::Overconfident) && ratio(c) > LARGE).then(|| {
        format!(
            "{name} is {} of {}: errors are {} times the 1σ of the filter; the noise of the process is too small, or \
             an error of a sensor is not modelled.",
            short(c.mean),
            c.dof,
            short(ratio(c).sqrt())
        )
    })
}

/// Innovations that are larger than the filter expects.
fn large(sensor: &str, nis: &Consistency) -> Option<String> {
    (nis.verdict() == Some(Verdict::Overconfident) && ratio(nis) > LARGE).then(|| {
        format!(
            "NIS of `{sensor}` is {} of {}: its innovations are larger than expected; raise its `noise`, or the noise \
             of the process, or estimate the error that it has.",
            short(nis.mean),
            nis.dof
        )
    })
}

/// Innovations that are smaller than the filter expects.
fn small(sensor: &str, nis: &Consistency) -> Option<String> {
    if nis.verdict() != Some(Verdict::Conservative) || ratio(nis) >= SMALL {
        return None;
    }
    let what = if nis.independent < CORRELATED * nis.count as f64 {
        "its error is correlated in time; declare `bias` with a `correlation_time` where the sensor has one"
    } else {
        "its innovations are smaller than expected; lower its `noise`"
    };
    Some(format!("NIS of `{sensor}` is {} of {}: {what}.", short(nis.mean), nis.dof))
}

/// The mean over what it should be.
fn ratio(c: &Consistency) -> f64 {
    c.mean / c.dof as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::Disturbed;
    use crate::score::Score;

    fn nis(mean: f64, independent: f64) -> Consistency {
        Consistency {
            mean,
            dof: 3,
            count: 300,
            independent,
            band: (2.7, 3.3),
        }
    }

    fn sensor(nis: Consistency) -> SensorStatistics {
        SensorStatistics {
            name: "gnss".to_owned(),
            accepted: 300,
            nis: Some(nis),
            ..SensorStatistics::default()
        }
    }

    fn found(sensors: Vec<SensorStatistics>) -> Vec<String> {
        findings(&Summary {
            sensors,
            ..Summary::default()
        })
    }

    #[test]
    fn a_consistent_sensor_has_no_finding() {
        assert!(found(vec![sensor(nis(3.0, 300.0))]).is_empty());
        // Outside the band, but too near to be worth a change.
        assert!(found(vec![sensor(nis(3.6, 300.0)), sensor(nis(2.4, 300.0))]).is_empty());
        assert!(section(&Summary::default()).is_empty());
    }

    #[test]
    fn a_small_nis_is_a_correlated_error_or_too_much_noise() {
        let all = found(vec![sensor(nis(0.07, 20.0)), sensor(nis(0.07, 280.0))]);
        let (correlated, white) = (&all[0], &all[1]);
        assert!(correlated.starts_with("NIS of `gnss` is 0.07"), "{correlated}");
        assert!(correlated.contains("`correlation_time`"), "{correlated}");
        assert!(white.contains("lower its `noise`"), "{white}");
    }

    #[test]
    fn a_large_nis_asks_for_more_noise() {
        let all = found(vec![sensor(nis(9.0, 300.0))]);
        assert!(all.len() == 1 && all[0].contains("raise its `noise`"), "{all:?}");
    }

    #[test]
    fn a_gate_that_rejects_good_rows_comes_first() {
        let refused = |caught| SensorStatistics {
            rejected: 60,
            disturbed: Some(Disturbed {
                caught,
                ..Disturbed::default()
            }),
            ..sensor(nis(9.0, 300.0))
        };
        let all = found(vec![refused(0)]);
        assert!(
            all.len() == 2 && all[0].contains("rejected 60 of 360 measurements (17 %)"),
            "{all:?}"
        );
        // Disturbed rows are rejected rightly.
        assert_eq!(found(vec![refused(60)]).len(), 1);
    }

    #[test]
    fn an_overconfident_position_is_told_with_its_ratio() {
        let score = |mean| Score {
            nees_position: Some(nis(mean, 300.0)),
            ..Score::default()
        };
        let of = |mean| {
            findings(&Summary {
                score: Some(score(mean)),
                ..Summary::default()
            })
        };
        let all = of(12.0);
        assert!(
            all.len() == 1 && all[0].contains("NEES position is 12") && all[0].contains("are 2"),
            "{all:?}"
        );
        assert!(of(3.0).is_empty());
    }
}
