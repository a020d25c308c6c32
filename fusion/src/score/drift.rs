//! Drift in declared outages, scored for each window during the run.
//!
//! The window of an outage begins with the outage. It ends where the influence of the outage ends. This is the end of
//! the outage or, if later, the time of validity of the first new measurement. A new measurement was read from the
//! silent source, stamped after the outage, and used. Until then the estimate continues without the source.
//!
//! A late measurement may be stamped after the outage but valid inside it. It belongs to the window, but the error at
//! the end is the error before it. A window ends at the latest where the next window of its outage begins. If no sensor
//! reads the source, it ends with the outage.
//!
//! If the run ends inside a window, the window is scored to there and marked. A source that is always silent has no
//! window.

use super::comparison::Deviation;
use fusion_core::math;
use fusion_core::memory::{Memory, Tape};
use fusion_core::time::Time;
use fusion_models::fault::{Repeated, Window, Windows};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// The drift over one outage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Drift {
    /// Start of the outage \[s\].
    pub from: f64,
    /// The end of the outage, or of the run \[s\].
    pub to: f64,
    /// The end of the scored window: where the influence of the outage ended \[s\].
    pub until: f64,
    /// Largest horizontal error in it \[m\].
    pub max_horizontal: f64,
    /// Largest difference between the horizontal error and its value at the start, as vectors \[m\].
    pub growth: f64,
    /// Horizontal error at the last epoch before a measurement after it was used \[m\].
    pub end_horizontal: f64,
    /// The expected 1σ of this error along its direction, from filter and reference \[m\].
    pub end_sigma: f64,
    /// True if the run ended before the outage.
    pub is_cut: bool,
    /// The measurement that moved the estimate most while the source was silent.
    pub moved: Option<Moved>,
}

/// A measurement that moved the estimate.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Moved {
    /// The sensor.
    pub sensor: String,
    /// The time at which it was valid \[s\].
    pub time: f64,
    /// The change of the measured quantity, in 1σ of the estimate before it.
    pub sigmas: f64,
}

impl Drift {
    /// The error at the end divided by its 1σ. For a consistent filter its square is χ² of at most two degrees of
    /// freedom.
    #[must_use]
    pub fn end_ratio(&self) -> f64 {
        self.end_horizontal / self.end_sigma
    }

    /// The outage with the largest error at its end.
    #[must_use]
    pub fn worst(all: &[Self]) -> Option<&Self> {
        all.iter().max_by(|a, b| a.end_horizontal.total_cmp(&b.end_horizontal))
    }
}

/// A declared outage.
#[derive(Clone, Debug, PartialEq)]
pub struct Outage {
    /// The times at which its source is silent.
    pub windows: Windows,
    /// The sensors of the scored filter that read the source, by number.
    pub sensors: Vec<usize>,
}

/// Measurements used since the last epoch that needed them.
#[derive(Clone, Debug, Default)]
struct Used(VecDeque<(usize, Time, Time)>);

/// One repetition of an outage, and the window that is being scored.
#[derive(Clone, Debug)]
struct Tracked {
    repeated: Repeated,
    sensors: Vec<usize>,
    running: Option<Running>,
}

#[derive(Clone, Debug, Default)]
struct Running {
    window: Window,
    /// The time and the horizontal error at its start.
    first: (Time, [f64; 2]),
    /// The last epoch that belongs to it.
    last: Time,
    max: f64,
    growth: f64,
    /// The last error with its 1σ.
    end: (f64, f64),
    moved: Option<Moved>,
}

fusion_core::memory!(Drifts { tracked, used, found });
fusion_core::memory!(Tracked { running; repeated, sensors });
fusion_core::memory!(Running {
    window,
    first,
    last,
    max,
    growth,
    end,
    moved
});
fusion_core::memory!(Drift {
    from,
    to,
    until,
    max_horizontal,
    growth,
    end_horizontal,
    end_sigma,
    is_cut,
    moved
});
fusion_core::memory!(Moved { sensor, time, sigmas });

impl Memory for Used {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
    }
}

/// The drift of a run in its outages.
#[derive(Clone, Debug)]
pub(super) struct Drifts {
    tracked: Box<[Tracked]>,
    used: Used,
    found: Vec<Drift>,
}

impl Drifts {
    /// Follows these outages. Outages of several sources at the same times count as one.
    pub(super) fn new(outages: &[Outage]) -> Self {
        let mut tracked: Vec<Tracked> = Vec::new();
        for outage in outages {
            for repeated in outage.windows.each() {
                match tracked.iter_mut().find(|t| t.repeated == repeated) {
                    Some(known) => known.sensors.extend(&outage.sensors),
                    None => tracked.push(Tracked {
                        repeated,
                        sensors: outage.sensors.clone(),
                        running: None,
                    }),
                }
            }
        }
        Self {
            tracked: tracked.into(),
            used: Used::default(),
            found: Vec::new(),
        }
    }

    /// A measurement of `sensor`, stamped `stamp` and valid at `time`, was used.
    pub(super) fn used(&mut self, sensor: usize, stamp: Time, time: Time) {
        if self.tracked.iter().any(|t| t.sensors.contains(&sensor)) {
            self.used.0.push_back((sensor, stamp, time));
        }
    }

    /// Takes a measurement of `sensor`, called `name` and valid at `time`. It moved the measured quantity by `sigmas`
    /// of its 1σ. Measurements of the silent source are never part of its outage.
    pub(super) fn moved(&mut self, sensor: usize, name: &str, time: Time, sigmas: f64) {
        let others = self.tracked.iter_mut().filter(|t| !t.sensors.contains(&sensor));
        for running in others.filter_map(|t| t.running.as_mut()) {
            let is_most = running.moved.as_ref().is_none_or(|most| sigmas > most.sigmas);
            if time < running.window.to && sigmas > 0.0 && is_most {
                running.moved = Some(Moved {
                    sensor: name.to_owned(),
                    time: time.seconds(),
                    sigmas,
                });
            }
        }
    }

    /// The position error at the next epoch of the reference.
    pub(super) fn add(&mut self, time: Time, error: &Deviation) {
        for tracked in &mut self.tracked {
            self.found.extend(tracked.add(time, error, &self.used));
        }
        // Only measurements stamped after an outage can end it. For a future outage, only measurements valid after this
        // epoch can.
        let ends: Option<Time> = self.tracked.iter().filter_map(|t| Some(t.running.as_ref()?.window.to)).min();
        self.used
            .0
            .retain(|(_, stamp, valid)| *valid >= time || ends.is_some_and(|to| *stamp >= to));
    }

    /// All windows, in order of their start.
    pub(super) fn finish(mut self) -> Vec<Drift> {
        for tracked in &mut self.tracked {
            let is_outage = |r: &Running| r.last >= r.window.to || r.last > r.first.0 && r.window.from > Time::MIN;
            self.found.extend(tracked.running.take().filter(is_outage).map(Running::at_the_end));
        }
        self.found.sort_by(|a, b| a.from.total_cmp(&b.from).then(a.to.total_cmp(&b.to)));
        self.found
    }
}

impl Tracked {
    /// The drift of the window that ends before this epoch, if any.
    fn add(&mut self, time: Time, error: &Deviation, used: &Used) -> Option<Drift> {
        let begins = self.repeated.at(time);
        let is_another = |r: &Running| begins.is_some_and(|w| w.from != r.window.from);
        let is_over = |r: &Running| is_another(r) || time > r.window.to && self.ends_by(r.window.to, time, used);
        let is_over = self.running.as_ref().is_some_and(is_over);
        let ended = self.running.take_if(|_| is_over).map(Running::drift);
        if let (None, Some(window)) = (&self.running, begins) {
            self.running = Some(Running {
                window,
                first: (time, [error.error.x, error.error.y]),
                last: time,
                ..Running::default()
            });
        }
        // The error after the first measurement that follows an outage is not the error at its end.
        let is_overcome = self.running.as_ref().is_some_and(|r| self.ends_by(r.window.to, time, used));
        if let Some(running) = &mut self.running {
            running.add(time, error);
            if !is_overcome {
                running.end = error.horizontal();
            }
        }
        ended
    }

    /// Returns true if a measurement stamped after the outage, which lasts until `to`, was used by `time`. If no sensor
    /// reads the source: true if the outage is over.
    fn ends_by(&self, to: Time, time: Time, used: &Used) -> bool {
        let of_source = |(sensor, stamp, valid): &(usize, Time, Time)| self.sensors.contains(sensor) && *stamp >= to && *valid <= time;
        if self.sensors.is_empty() {
            time >= to
        } else {
            used.0.iter().any(of_source)
        }
    }
}

impl Running {
    fn add(&mut self, time: Time, error: &Deviation) {
        let (_, [n, e]) = self.first;
        let [north, east] = [error.error.x, error.error.y];
        self.last = time;
        self.max = self.max.max(math::hypot(north, east));
        self.growth = self.growth.max(math::hypot(north - n, east - e));
    }

    /// The drift if the run ends here, possibly inside the outage.
    fn at_the_end(self) -> Drift {
        let (is_cut, last) = (self.last < self.window.to, self.last);
        let window = if is_cut { Window { to: last, ..self.window } } else { self.window };
        Drift {
            is_cut,
            ..Self { window, ..self }.drift()
        }
    }

    fn drift(self) -> Drift {
        let from = if self.window.from == Time::MIN {
            self.first.0
        } else {
            self.window.from
        };
        Drift {
            from: from.seconds(),
            to: self.window.to.seconds(),
            until: self.last.max(self.window.to).seconds(),
            max_horizontal: self.max,
            growth: self.growth,
            end_horizontal: self.end.0,
            end_sigma: self.end.1,
            is_cut: false,
            moved: self.moved,
        }
    }
}

#[cfg(test)]
impl Outage {
    /// An outage with a window as written in TOML.
    pub(super) fn of(window: &str, sensors: &[usize]) -> Self {
        #[derive(serde::Deserialize)]
        struct Holder {
            window: Windows,
        }
        Self {
            windows: toml::from_str::<Holder>(&format!("window = {window}")).unwrap().window,
            sensors: sensors.to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn t(seconds: f64) -> Time {
        Time::from_seconds(seconds)
    }

    /// An error with 1σ of 2 m north, 1 m east.
    fn deviation(north: f64, east: f64) -> Deviation {
        Deviation {
            error: Vector3::new(north, east, 9e9),
            own: Matrix3::from_diagonal(&Vector3::new(4.0, 1.0, 1.0)),
            ..Deviation::default()
        }
    }

    #[test]
    fn the_error_at_the_end_has_a_sigma_along_itself() {
        let mut drifts = Drifts::new(&[Outage::of("{ from = 1, to = 2 }", &[])]);
        // The epoch at 2 s is after the outage.
        for (time, north, east) in [(1.0, 7.0, 0.0), (1.5, 0.0, 9.0), (1.9, 3.0, 3.0), (2.0, 0.0, 0.1)] {
            drifts.add(t(time), &deviation(north, east));
        }
        let found = drifts.finish();
        let worst = Drift::worst(&found).unwrap();
        // 4 ε: rounding. Along north-east the variance is the mean of both variances.
        let close = |a: f64, b: f64| (a - b).abs() < 1e-15 * b;
        assert!(
            close(worst.end_horizontal, 18_f64.sqrt()) && close(worst.end_sigma, 2.5_f64.sqrt()),
            "{found:?}"
        );
        assert!(
            close(worst.end_ratio(), (18.0_f64 / 2.5).sqrt()) && worst.max_horizontal == 9.0,
            "{found:?}"
        );
    }

    /// Start, end and largest error of the outages of a run. The error of the run is its time in seconds after `start`,
    /// with an epoch every tenth of a second.
    fn run(window: &str, start: f64, used: &[(f64, f64)]) -> Vec<(f64, f64, f64)> {
        let mut drifts = Drifts::new(&[Outage::of(window, &[1])]);
        let mut used = used.iter().peekable();
        for k in 0..1000 {
            let since = f64::from(k) * 0.1;
            // A measurement valid between two epochs is used before the second epoch is reported.
            while let Some((stamp, valid)) = used.next_if(|(_, valid)| *valid <= since) {
                drifts.used(0, t(start + 0.5), t(start + 0.5));
                drifts.used(1, t(start + stamp), t(start + valid));
            }
            drifts.add(t(start + since), &deviation(since, 0.0));
        }
        let round = |v: f64| (v * 1e3).round() / 1e3;
        let found = drifts.finish();
        found
            .iter()
            .map(|d| (round(d.from - start), round(d.until - start), round(d.max_horizontal)))
            .collect()
    }

    #[test]
    fn a_window_ends_with_the_first_measurement_used_after_it() {
        // Fixes each second except from 20 to 30 s, used only from 33 s.
        let used: Vec<(f64, f64)> = (0..100).map(f64::from).filter(|s| *s < 20.0 || *s > 32.0).map(|s| (s, s)).collect();
        assert_eq!(run("{ from = 20, to = 30 }", 0.0, &used), [(20.0, 32.9, 32.9)]);
    }

    #[test]
    fn a_late_fix_that_is_valid_inside_the_outage_belongs_to_its_window() {
        // Half a second late: the fix stamped 30.2 s is valid at 29.7 s. The epochs up to 30 s count.
        let used: Vec<(f64, f64)> = (0..99)
            .map(|s| f64::from(s) + 0.2)
            .filter(|s| *s < 20.0 || *s > 30.0)
            .map(|s| (s, s - 0.5))
            .collect();
        let window = "{ from = 20, to = 30 }";
        assert_eq!(run(window, 0.0, &used), [(20.0, 30.0, 30.0)]);
        // But the error at its end is the error before the fix.
        let mut drifts = Drifts::new(&[Outage::of(window, &[1])]);
        for k in 190..320 {
            let time = 0.1 * f64::from(k);
            if k == 297 {
                drifts.used(1, t(30.2), t(29.65));
            }
            drifts.add(t(time), &deviation(time, 0.0));
        }
        let found = drifts.finish();
        // 1e-9: rounding of tenths.
        assert!((found[0].end_horizontal - 29.6).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn outages_are_scored_at_any_time_of_any_clock() {
        let used: Vec<(f64, f64)> = (0..100).map(|s| (f64::from(s), f64::from(s))).collect();
        let expected = [(20.0, 30.0, 30.0), (60.0, 70.0, 70.0)];
        for start in [0.0, -1e6, 1.7e9] {
            let window = format!("{{ from = {}, duration = 10, every = 40 }}", start + 20.0 - 40.0 * 1e4);
            assert_eq!(run(&window, start, &used), expected, "{start}");
        }
    }

    #[test]
    fn a_source_that_never_comes_back_counts_until_the_next_outage_and_to_the_end() {
        let expected = [(20.0, 59.9, 59.9), (60.0, 99.9, 99.9)];
        assert_eq!(run("{ from = 20, duration = 10, every = 40 }", 0.0, &[]), expected);
        // The last epoch is at 99.9 s.
        for window in ["{ from = 95, to = 105 }", "{ from = 95 }"] {
            assert_eq!(run(window, 0.0, &[]), [(95.0, 99.9, 99.9)], "{window}");
        }
        // A source that is always silent, and an outage that has just begun.
        assert_eq!(run("{}", 0.0, &[]), []);
        assert_eq!(run("{ from = 99.85, to = 105 }", 0.0, &[]), []);
    }

    #[test]
    fn an_outage_that_the_run_ends_in_is_marked_and_knows_what_moved_the_estimate_most() {
        let mut drifts = Drifts::new(&[Outage::of("{ from = 1, duration = 2.05, every = 10 }", &[0])]);
        for k in 0..125 {
            let time = 0.1 * f64::from(k);
            // Before, in, and after the first outage.
            let sigmas = [(5, 9.0), (15, 4.0), (20, 5.0), (25, 3.0), (35, 9.0)];
            sigmas
                .iter()
                .filter(|(at, _)| *at == k)
                .for_each(|(_, s)| drifts.moved(1, "standing", t(time), *s));
            // The source returns. Its first fix is valid before the end of the outage, whose last epoch is at 3 s.
            if k == 31 {
                drifts.moved(0, "gnss", t(3.04), 9.0);
                drifts.used(0, t(time), t(time));
            }
            drifts.add(t(time), &deviation(time, 0.0));
        }
        let found = drifts.finish();
        let said: Vec<(bool, Option<f64>)> = found.iter().map(|d| (d.is_cut, d.moved.as_ref().map(|m| m.time))).collect();
        assert_eq!(said, [(false, Some(2.0)), (true, None)]);
        // 1e-9: rounding of tenths.
        assert!(
            (found[1].to - 12.4).abs() < 1e-9 && (found[1].end_horizontal - 12.4).abs() < 1e-9,
            "{found:?}"
        );
    }
}
