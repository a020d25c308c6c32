//! The truth of a run, free of errors: computed as the world advances, or recorded once for all seeds.

use super::super::world::{Truth, World};
use super::clock::{Clocks, Source};
use super::unit::{IdealUnit, Reading};
use fusion_core::Time;
use std::sync::{Arc, OnceLock};

/// The most memory that a course may use \[byte\]: two hours and a half of samples at 100 Hz. A longer course
/// is computed again in every run.
const MOST_BYTES: f64 = 64.0 * 1024.0 * 1024.0;

/// The truth at the instants of a run, which does not depend on its seed.
#[derive(Debug)]
struct Course {
    /// The truth at the start, and at every instant at which another source than the inertial unit is read.
    truths: Vec<Truth>,
    /// The readings of the inertial unit.
    readings: Vec<Reading>,
}

/// The common part of runs of one simulated design with different seeds, if nothing influences the trajectory:
/// the truth, and the samples of the inertial unit before their errors. The first run that
/// [shares](super::Simulator::share) it makes it.
#[derive(Debug, Default)]
pub struct SharedCourse(OnceLock<Arc<Course>>);

impl SharedCourse {
    /// Whether a run has made it.
    #[must_use]
    pub fn is_made(&self) -> bool {
        self.0.get().is_some()
    }
}

/// The world and its inertial unit, free of errors.
#[derive(Debug)]
pub(super) struct ErrorFree {
    pub(super) world: Box<dyn World>,
    pub(super) unit: Option<IdealUnit>,
    recorded: Option<Recorded>,
}

/// The position in a recorded course.
#[derive(Debug)]
struct Recorded {
    course: Arc<Course>,
    truth: usize,
    reading: usize,
}

impl ErrorFree {
    pub(super) fn new(world: Box<dyn World>, unit: Option<IdealUnit>) -> Self {
        Self {
            world,
            unit,
            recorded: None,
        }
    }

    /// The truth now.
    pub(super) fn truth(&self) -> &Truth {
        let recorded = self.recorded.as_ref().and_then(|r| r.course.truths.get(r.truth));
        recorded.unwrap_or_else(|| self.world.truth())
    }

    /// Moves on to `time`.
    pub(super) fn advance(&mut self, time: Time) {
        let Some(Recorded { course, truth, .. }) = &mut self.recorded else {
            self.world.advance(time);
            return;
        };
        while course.truths.get(*truth + 1).is_some_and(|next| next.time <= time) {
            *truth += 1;
        }
    }

    /// At `time`, which is now, the inertial unit has a sample: adds the samples that are known by then.
    pub(super) fn read(&mut self, time: Time, out: &mut Vec<Reading>) {
        let Some(recorded) = &mut self.recorded else {
            let truth = self.world.truth();
            self.unit.iter_mut().for_each(|unit| unit.read(truth, out));
            return;
        };
        let known = recorded.course.readings[recorded.reading..].iter().take_while(|r| r.known <= time);
        let before = out.len();
        out.extend(known);
        recorded.reading += out.len() - before;
    }

    /// The stamp of a sample that is not known yet, if it may be in the past.
    pub(super) fn held(&self) -> Option<Time> {
        match &self.recorded {
            Some(recorded) => recorded.course.readings.get(recorded.reading).map(|next| next.stamp),
            None => self.unit.as_ref().and_then(IdealUnit::held),
        }
    }

    /// At the end of the run, adds the first sample of a pair that has no second sample.
    pub(super) fn release(&mut self, out: &mut Vec<Reading>) {
        match self.recorded {
            Some(_) => self.read(Time::MAX, out),
            None => self.unit.iter_mut().for_each(|unit| unit.release(out)),
        }
    }

    /// Uses the `shared` course from now on; called at the start. `clocks` give the instants.
    pub(super) fn share(&mut self, shared: &SharedCourse, clocks: &Clocks) {
        let [readings, truths] = clocks.rows(Source::Imu, self.world.end().seconds());
        let bytes = readings * size_of::<Reading>() as f64 + truths * size_of::<Truth>() as f64;
        if !self.world.is_given() || bytes.is_nan() || bytes > MOST_BYTES {
            return;
        }
        let course = shared.0.get_or_init(|| {
            let (truths, readings) = (Vec::with_capacity(truths as usize), Vec::with_capacity(readings as usize));
            Arc::new(self.record(clocks.clone(), Course { truths, readings }))
        });
        self.recorded = Some(Recorded {
            course: course.clone(),
            truth: 0,
            reading: 0,
        });
    }

    /// Goes to the end.
    fn record(&mut self, mut clocks: Clocks, mut course: Course) -> Course {
        let end = self.world.end();
        course.truths.push(*self.world.truth());
        while let Some((source, time)) = clocks.due().filter(|(_, time)| *time <= end) {
            clocks.tick(source);
            self.world.advance(time);
            if source == Source::Imu {
                self.read(time, &mut course.readings);
            } else if course.truths.last().is_none_or(|last| last.time < time) {
                course.truths.push(*self.world.truth());
            }
        }
        self.release(&mut course.readings);
        course
    }
}
