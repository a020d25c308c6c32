//! What is true in a run, free of errors: as the world goes on, or as recorded once for all seeds.

use super::super::world::{Truth, World};
use super::clock::{Clocks, Source};
use super::unit::{IdealUnit, Reading};
use fusion_core::Time;
use std::sync::{Arc, OnceLock};

/// The most that a course may take of memory \[byte\]: two hours and a half of samples at 100 Hz. A longer one
/// is made anew in every run.
const MOST_BYTES: f64 = 64.0 * 1024.0 * 1024.0;

/// What is true at the instants of a run, which does not depend on its seed.
#[derive(Debug)]
struct Course {
    /// At every instant at which something else than the inertial unit is read; at first that of the start.
    truths: Vec<Truth>,
    /// What the inertial unit reads.
    readings: Vec<Reading>,
}

/// What runs of one simulated design with other seeds have in common: where nothing influences the trajectory,
/// the truth and the samples of the inertial unit before their errors. The first run that
/// [shares](super::Simulator::share) it makes it.
#[derive(Debug, Default)]
pub struct SharedCourse(OnceLock<Arc<Course>>);

impl SharedCourse {
    /// Whether there is one: a run has shared what it has in common with others.
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

/// How far a recorded course has come.
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

    /// What is true now.
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

    /// At `time`, which has come, the inertial unit has a sample: adds those that are known then.
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

    /// Adds the sample that the end of the run leaves without its second.
    pub(super) fn release(&mut self, out: &mut Vec<Reading>) {
        match self.recorded {
            Some(_) => self.read(Time::MAX, out),
            None => self.unit.iter_mut().for_each(|unit| unit.release(out)),
        }
    }

    /// Goes by what is `shared` from now, the start, on; `clocks` tell the instants.
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
