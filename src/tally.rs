//! What became of each sensor's measurements: counts, refusals of its gate, innovations.

use crate::assembly::SensorInfo;
use crate::score::Consistency;
use core::ops::Range;
use fusion_core::filter::{Update, Verdict};
use fusion_core::gate::Mode;
use fusion_core::runner::{Sensor, StreamId};
use fusion_core::time::Time;
use serde::Serialize;
use std::collections::VecDeque;

/// How the filter took the rows that declared faults changed, and the others.
///
/// Only numbers that the sensor itself reads count: its channel, and the 1σ that comes with it.
/// What a stage makes of a disturbed row is not known to be disturbed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Disturbed {
    /// Disturbed rows that were used.
    pub missed: u64,
    /// Disturbed rows that were rejected.
    pub caught: u64,
    /// Rows left alone that were rejected; of a recorded log some may be wrong by themselves.
    pub false_rejections: u64,
}

/// Measurements rejected one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Refusal {
    /// Time of the first \[s\].
    pub from: f64,
    /// How many.
    pub measurements: u64,
    /// From the first to the next measurement that was used, or to the end of the run \[s\].
    pub seconds: f64,
}

/// The innovations r = z ⊟ h(x̂) of accepted measurements, sensor minus navigation before the
/// measurement was used; from `[reference] from` on, where the design has it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Innovations {
    /// Measurements counted.
    pub count: u64,
    /// Name per residual row; empty where they have none.
    pub axis: &'static [&'static str],
    /// SI unit per residual row.
    pub unit: Vec<String>,
    /// Root mean square per residual row; 0 where none is counted.
    pub rms: Vec<f64>,
    /// Largest magnitude per residual row; 0 where none is counted.
    pub max: Vec<f64>,
}

/// What became of a sensor's measurements.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SensorTally {
    /// The sensor.
    pub name: String,
    /// Measurements that corrected the estimate.
    pub accepted: u64,
    /// Those its gate rejected.
    pub rejected: u64,
    /// Those its gate believed against the estimate.
    pub readopted: u64,
    /// Those without a value at the estimate, or that could not be used.
    pub unusable: u64,
    /// Of disturbed rows, where a declared fault may change what it reads.
    pub disturbed: Option<Disturbed>,
    /// The most measurements rejected in a row; none where none was rejected.
    pub longest_refusal: Option<Refusal>,
    /// Whether its gate was in denial at the end.
    pub ends_denied: bool,
    /// Mean NIS of those accepted, with its band; a gate that cuts into the good ones lowers it.
    pub nis: Option<Consistency>,
    /// Innovations of those accepted.
    pub innovations: Innovations,
}

/// Follows one sensor through a run.
#[derive(Debug)]
pub(crate) struct Follower {
    tally: SensorTally,
    nis: Vec<f64>,
    /// Sums of the squared innovations, per residual row.
    squares: Vec<f64>,
    /// Innovations count from here on.
    from: Option<Time>,
    stream: StreamId,
    columns: Vec<usize>,
    delay: i64,
    /// Times of validity of disturbed rows that have not been judged, in order.
    disturbed: VecDeque<Time>,
    /// The first of the measurements that are being rejected, and how many they are.
    refusal: Option<(Time, u64)>,
}

impl Follower {
    /// Of `sensor`, whose rows may be `disturbable`: streams and columns of them.
    pub(crate) fn new(sensor: &Sensor, info: &SensorInfo, from: Option<Time>, disturbable: &[(StreamId, Range<usize>)]) -> Self {
        let m = info.rows.len();
        let mut follower = Self {
            tally: SensorTally {
                name: info.name.clone(),
                innovations: Innovations {
                    count: 0,
                    axis: info.axes,
                    unit: info.rows.iter().map(ToString::to_string).collect(),
                    rms: vec![0.0; m],
                    max: vec![0.0; m],
                },
                ..SensorTally::default()
            },
            nis: Vec::new(),
            squares: vec![0.0; m],
            from,
            stream: sensor.port.stream,
            columns: sensor.port.columns.iter().chain(&sensor.noise.sigma_columns).copied().collect(),
            delay: sensor.port.delay,
            disturbed: VecDeque::new(),
            refusal: None,
        };
        let may_be = disturbable.iter().any(|(stream, columns)| follower.reads(*stream, columns));
        follower.tally.disturbed = may_be.then(Disturbed::default);
        follower
    }

    /// The sensor.
    pub(crate) fn name(&self) -> &str {
        &self.tally.name
    }

    fn reads(&self, stream: StreamId, columns: &Range<usize>) -> bool {
        stream == self.stream && self.columns.iter().any(|c| columns.contains(c))
    }

    /// Hears of a row in which faults changed the numbers `disturbed`; rows of a stream come in
    /// order of their stamps.
    pub(crate) fn row(&mut self, stream: StreamId, time: Time, disturbed: &[Range<usize>]) {
        if disturbed.iter().any(|columns| self.reads(stream, columns)) {
            self.disturbed.push_back(time.shifted(-self.delay));
        }
    }

    /// Whether the row valid at `time` was disturbed. Faults go by stamps, so rows of one stamp
    /// are alike.
    fn was_disturbed(&mut self, time: Time) -> bool {
        while self.disturbed.front().is_some_and(|t| *t < time) {
            self.disturbed.pop_front();
        }
        self.disturbed.front() == Some(&time)
    }

    /// Hears what became of a measurement.
    pub(crate) fn judged(&mut self, time: Time, update: &Update<'_>) {
        let was_disturbed = self.was_disturbed(time);
        let tally = &mut self.tally;
        let is_used = match update.verdict {
            Verdict::Accepted => {
                tally.accepted += 1;
                self.nis.push(update.nis);
                true
            }
            Verdict::Readopted => {
                tally.readopted += 1;
                true
            }
            Verdict::Rejected => {
                tally.rejected += 1;
                false
            }
            Verdict::Undefined(_) | Verdict::Unusable => {
                tally.unusable += 1;
                return;
            }
        };
        tally.ends_denied = update.mode == Mode::Denied;
        if let Some(d) = &mut tally.disturbed {
            d.missed += u64::from(is_used && was_disturbed);
            d.caught += u64::from(!is_used && was_disturbed);
            d.false_rejections += u64::from(!is_used && !was_disturbed);
        }
        if is_used {
            self.end_refusal(time);
        } else {
            self.refusal.get_or_insert((time, 0)).1 += 1;
        }
        if update.verdict == Verdict::Accepted && self.from.is_none_or(|from| time >= from) {
            self.tally.innovations.count += 1;
            let sums = self.squares.iter_mut().zip(&mut self.tally.innovations.max);
            for (r, (square, max)) in update.residual.iter().zip(sums) {
                *square += r * r;
                *max = max.max(r.abs());
            }
        }
    }

    fn end_refusal(&mut self, end: Time) {
        let Some((first, measurements)) = self.refusal.take() else { return };
        let refusal = Refusal {
            from: first.seconds(),
            measurements,
            seconds: end.seconds_since(first),
        };
        let size = |r: &Refusal| (r.measurements, r.seconds);
        let longest = &mut self.tally.longest_refusal;
        if longest.as_ref().is_none_or(|l| size(&refusal) > size(l)) {
            *longest = Some(refusal);
        }
    }

    /// The tally of a run that ends at `end`.
    pub(crate) fn finish(mut self, end: Time) -> SensorTally {
        self.end_refusal(end);
        let innovations = &mut self.tally.innovations;
        let count = innovations.count.max(1) as f64;
        innovations.rms = self.squares.iter().map(|s| (s / count).sqrt()).collect();
        self.tally.nis = Consistency::of(&self.nis, innovations.unit.len());
        self.tally
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads columns 0 to 2 of stream 0, valid half a second before their stamps.
    fn follower() -> Follower {
        Follower {
            tally: SensorTally {
                disturbed: Some(Disturbed::default()),
                ..SensorTally::default()
            },
            nis: Vec::new(),
            squares: vec![0.0],
            from: Some(at(2.0)),
            stream: 0,
            columns: vec![0, 1, 2],
            delay: 500_000_000,
            disturbed: VecDeque::new(),
            refusal: None,
        }
    }

    fn at(t: f64) -> Time {
        Time::from_seconds(t)
    }

    fn judge(f: &mut Follower, t: f64, verdict: Verdict, residual: f64, mode: Mode) {
        let update = Update {
            verdict,
            value: &[],
            predicted: &[],
            noise: &[],
            residual: &[residual],
            innovation_sigma: &[],
            nis: 1.0,
            statistic: 1.0,
            threshold: 1.0,
            mode,
            weight: 1.0,
        };
        f.judged(at(t), &update);
    }

    #[test]
    fn a_row_counts_as_disturbed_at_its_own_time_and_in_its_own_columns() {
        use Verdict::{Accepted, Readopted, Rejected, Unusable};
        let mut f = follower();
        let (own, other) = (0..3, 3..6);
        for (stream, stamp, columns) in [(0, 1.0, &own), (0, 2.0, &other), (1, 2.0, &own)] {
            f.row(stream, at(stamp), core::slice::from_ref(columns));
        }
        for stamp in [3.0, 5.0, 5.0, 6.0, 7.0] {
            f.row(0, at(stamp), &[5..6, 2..4]);
        }
        // That of stamp 1 is never judged. Two share the stamp 5.
        let judged = [
            (1.5, Accepted),
            (2.5, Rejected),
            (4.5, Accepted),
            (4.5, Readopted),
            (5.5, Unusable),
            (6.5, Rejected),
            (7.5, Rejected),
        ];
        for (t, verdict) in judged {
            judge(&mut f, t, verdict, 0.0, Mode::Track);
        }
        let expected = Disturbed {
            missed: 2,
            caught: 2,
            false_rejections: 1,
        };
        assert_eq!(f.finish(at(8.0)).disturbed, Some(expected));
    }

    #[test]
    fn the_longest_refusal_ends_with_the_next_measurement_used_or_with_the_run() {
        use Verdict::{Accepted, Readopted, Rejected, Unusable};
        let mut f = follower();
        let verdicts = [Rejected, Accepted, Rejected, Unusable, Rejected, Readopted, Rejected, Rejected];
        for (t, verdict) in verdicts.into_iter().enumerate() {
            // Nothing is judged where a measurement is unusable: its mode says nothing.
            let mode = if verdict == Rejected { Mode::Denied } else { Mode::Track };
            judge(&mut f, t as f64, verdict, 0.0, mode);
        }
        judge(&mut f, 8.0, Unusable, 0.0, Mode::Track);
        let refusal = |from, seconds| {
            Some(Refusal {
                from,
                measurements: 2,
                seconds,
            })
        };
        let (mut early, mut late) = (follower(), follower());
        for f in [&mut early, &mut late] {
            f.refusal = Some((at(6.0), 2));
            f.tally.longest_refusal = refusal(2.0, 3.0);
        }
        // Of two with as many measurements the one that lasts longer; of equals the first.
        assert_eq!(early.finish(at(9.0)).longest_refusal, refusal(2.0, 3.0));
        assert_eq!(late.finish(at(9.5)).longest_refusal, refusal(6.0, 3.5));
        let tally = f.finish(at(9.0));
        assert_eq!((tally.longest_refusal, tally.ends_denied), (refusal(2.0, 3.0), true));
    }

    #[test]
    fn innovations_are_those_of_accepted_measurements_in_the_window() {
        use Verdict::{Accepted, Readopted, Rejected};
        let mut f = follower();
        f.tally.innovations.max = vec![0.0];
        let judged = [
            (1.0, Accepted, 50.0),
            (2.0, Accepted, 3.0),
            (3.0, Rejected, 90.0),
            (4.0, Readopted, 70.0),
            (5.0, Accepted, -4.0),
        ];
        for (t, verdict, r) in judged {
            judge(&mut f, t, verdict, r, Mode::Track);
        }
        let found = f.finish(at(6.0)).innovations;
        assert_eq!(
            (found.count, &found.rms[..], &found.max[..]),
            (2, &[12.5_f64.sqrt()][..], &[4.0][..])
        );
    }
}
