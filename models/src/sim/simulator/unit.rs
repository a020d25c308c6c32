//! An inertial unit without errors, between two of its samples.

use super::super::inverse::{self, Correction, Sample, before_correction, pair_before_correction};
use super::super::world::Truth;
use crate::earth::Gravity;
use crate::process::strapdown::mechanisation::Nav;
use fusion_core::Time;
use fusion_core::model::Process;

/// A sample without errors: the mean over the interval that ends at its stamp.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// The instant at which it is known: later than its stamp for the first of a pair.
    pub(super) known: Time,
    pub(super) stamp: Time,
    pub(super) sample: Sample,
    /// Length of the interval \[s\].
    pub(super) interval: f64,
}

/// Makes the samples that a process with its corrections brings back to the truth.
#[derive(Debug)]
pub(super) struct IdealUnit {
    correction: Correction,
    gravity: Gravity,
    period: f64,
    last: Option<(Time, Nav)>,
    /// The sample before, and the length of its interval \[s\].
    previous: (Sample, f64),
    /// The first of a pair: stamp, wanted sample, length.
    held: Option<(Time, Sample, f64)>,
}

impl IdealUnit {
    /// A unit with `rate` samples per second \[Hz\].
    pub(super) fn new(process: &dyn Process, gravity: Gravity, rate: f64) -> Self {
        Self {
            correction: Correction::of(process),
            gravity,
            period: 1.0 / rate,
            last: None,
            previous: (Sample::default(), 0.0),
            held: None,
        }
    }

    /// Adds the samples that are known once the world has come to `truth`.
    pub(super) fn read(&mut self, truth: &Truth, out: &mut Vec<Reading>) {
        let time = truth.time;
        // The first sample opens the first interval; no step led to it.
        let (wanted, dt) = match self.last.replace((time, truth.nav)) {
            Some((before, nav)) => {
                let dt = time.seconds_since(before);
                (inverse::sample(&nav, &truth.nav, dt, self.gravity), dt)
            }
            None => (truth.imu, 0.0),
        };
        let mut put = |stamp, sample, interval| {
            out.push(Reading {
                known: time,
                stamp,
                sample,
                interval,
            });
        };
        match self.correction {
            Correction::Pairs if dt > 0.0 => match self.held.take() {
                None => self.held = Some((time, wanted, dt)),
                Some((stamp, first, first_dt)) => {
                    let [one, two] = pair_before_correction([(&first, first_dt), (&wanted, dt)]);
                    put(stamp, one, first_dt);
                    put(time, two, dt);
                }
            },
            Correction::Previous if dt > 0.0 => {
                let raw = before_correction((&self.previous.0, self.previous.1), (&wanted, dt));
                self.previous = (raw, dt);
                put(time, raw, dt);
            }
            _ => {
                self.previous = (wanted, 0.0);
                put(time, wanted, if dt > 0.0 { dt } else { self.period });
            }
        }
    }

    /// The stamp of a sample that waits for its second.
    pub(super) fn held(&self) -> Option<Time> {
        self.held.map(|(stamp, ..)| stamp)
    }

    /// Adds a sample that the end of the run leaves without its second.
    pub(super) fn release(&mut self, out: &mut Vec<Reading>) {
        out.extend(self.held.take().map(|(stamp, sample, interval)| Reading {
            known: Time::MAX,
            stamp,
            sample,
            interval,
        }));
    }
}
