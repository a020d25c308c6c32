//! The undisturbed run: the properties of its streams, when it moves, how wrong it is.

use super::catalogue::Catalogue;
use super::errors::Errors;
use fusion::assembly::StreamLayout;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::Summary;
use fusion::score::{EpochError, ReferenceEpoch};
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::runner::{Event, Halt};
use fusion_core::state::Manifold;
use fusion_core::time::{Time, nanos};
use fusion_models::block::Shape;
use nalgebra::UnitQuaternion;

/// The spacing of the kept estimates \[ns\]: they replace a reference, and show motion.
const SPACING: i64 = 100_000_000;

/// Properties of a stream.
#[derive(Clone, Debug, Default)]
pub(super) struct Learnt {
    /// The stamps of its rows: in order of arrival during the run, sorted and without duplicates after it.
    pub(super) times: Vec<Time>,
    /// Rows with only finite numbers.
    count: usize,
    /// For each number of a row: sum, sum of squares about the first value, sum of squared changes.
    sums: Vec<[f64; 3]>,
    first: Vec<f64>,
    last: Vec<f64>,
    /// Squared distance between rows \[m²\], by channel.
    moved: Vec<f64>,
}

impl Learnt {
    fn add(&mut self, time: Time, values: &[f64], layout: &StreamLayout) {
        self.times.push(time);
        if !values.iter().all(|v| v.is_finite()) {
            return;
        }
        if self.count == 0 {
            self.first = values.to_vec();
            self.last = values.to_vec();
            self.sums = vec![[0.0; 3]; values.len()];
            self.moved = vec![0.0; layout.channels.len()];
        }
        self.count += 1;
        for (k, sums) in self.sums.iter_mut().enumerate() {
            let (off, change) = (values[k] - self.first[k], values[k] - self.last[k]);
            *sums = [sums[0] + off, sums[1] + off * off, sums[2] + change * change];
        }
        for (moved, channel) in self.moved.iter_mut().zip(&layout.channels) {
            let range = channel.offset..channel.offset + channel.width;
            *moved += match channel.shape {
                Shape::Geodetic => Geodetic::read(&values[range.clone()])
                    .difference(&Geodetic::read(&self.last[range]))
                    .norm_squared(),
                Shape::Angle => math::powi(so3::wrap_angle(values[range.start] - self.last[range.start]), 2),
                Shape::Vector | Shape::Quaternion => 0.0,
            };
        }
        self.last.copy_from_slice(values);
    }

    /// The largest standard deviation of a channel's numbers.
    pub(super) fn spread(&self, layout: &StreamLayout, channel: usize) -> f64 {
        let n = self.count.max(1) as f64;
        self.greatest(layout, channel, |[sum, squares, _]| squares / n - math::powi(sum / n, 2))
    }

    /// The RMS change between two rows: metres for a place, an angle for an attitude.
    pub(super) fn change(&self, layout: &StreamLayout, channel: usize) -> f64 {
        let n = (self.count.max(2) - 1) as f64;
        match layout.channels[channel].shape {
            Shape::Geodetic | Shape::Angle => math::sqrt(self.moved.get(channel).copied().unwrap_or(0.0) / n),
            Shape::Vector => self.greatest(layout, channel, |[.., changes]| changes / n),
            // A rotation by φ changes a component by at most φ/2.
            Shape::Quaternion => 2.0 * self.greatest(layout, channel, |[.., changes]| changes / n),
        }
    }

    fn greatest(&self, layout: &StreamLayout, channel: usize, variance: impl Fn([f64; 3]) -> f64) -> f64 {
        let c = &layout.channels[channel];
        let sums = self.sums.get(c.offset..c.offset + c.width).unwrap_or_default();
        sums.iter().map(|s| math::sqrt(variance(*s).max(0.0))).fold(0.0, f64::max)
    }
}

/// Observes the undisturbed run.
#[derive(Debug)]
pub(super) struct Survey {
    layouts: Vec<StreamLayout>,
    /// By stream.
    pub(super) streams: Vec<Learnt>,
    pub(super) started: Option<Time>,
    /// Its estimates, about 0.1 s apart.
    pub(super) estimates: Vec<ReferenceEpoch>,
    /// The longest pause between two of all its estimates \[s\].
    pub(super) longest_pause: f64,
    last_estimate: Option<Time>,
    epochs: Vec<EpochError>,
    /// The rotation that the attitude errors exclude.
    pub(super) mounting: UnitQuaternion<f64>,
    /// RMS of the innovations of each sensor.
    pub(super) innovations: Vec<(String, Vec<f64>)>,
    /// In time order; empty without a reference.
    pub(super) errors: Vec<Errors>,
    /// The times of declared faults \[s\].
    declared: Vec<(f64, f64)>,
}

impl Survey {
    pub(super) fn new(layouts: Vec<StreamLayout>) -> Self {
        Self {
            streams: vec![Learnt::default(); layouts.len()],
            layouts,
            started: None,
            estimates: Vec::new(),
            longest_pause: 0.0,
            last_estimate: None,
            epochs: Vec::new(),
            mounting: UnitQuaternion::identity(),
            innovations: Vec::new(),
            errors: Vec::new(),
            declared: Vec::new(),
        }
    }

    /// Ends the survey with the result of the run.
    pub(super) fn finish(&mut self, summary: &Summary) {
        for learnt in &mut self.streams {
            learnt.times.sort_unstable();
            learnt.times.dedup();
        }
        let told = summary.sensors().iter().filter(|s| s.innovations.count > 0);
        self.innovations = told.map(|s| (s.name.clone(), s.innovations.rms.clone())).collect();
        self.declared = summary.faults().iter().map(|w| (w.from, w.to)).collect();
        let mounting = summary.score().and_then(|score| score.mounting_deg);
        let [roll, pitch, yaw] = mounting.unwrap_or_default().map(f64::to_radians);
        self.mounting = so3::from_rpy(roll, pitch, yaw);
        let epochs = core::mem::take(&mut self.epochs);
        self.errors = epochs.iter().map(|e| Errors::of(e, &self.mounting)).collect();
    }

    /// The errors at this epoch.
    pub(super) fn errors_at(&self, time: Time) -> Option<&Errors> {
        let at = self.errors.binary_search_by_key(&time, |e| e.time).ok()?;
        self.errors.get(at)
    }

    /// The latest stamp of all streams.
    pub(super) fn end(&self) -> Time {
        let last = self.streams.iter().filter_map(|s| s.times.last());
        last.copied().max().unwrap_or_default()
    }

    /// The last time at which the undisturbed run has an error; without a reference, the end.
    pub(super) fn judged_end(&self) -> Time {
        self.errors.last().map_or(self.end(), |e| e.time)
    }

    /// The moment of the faults: the declared one, or the first suitable one after the filter has converged. It is
    /// suitable if it [is free](Self::is_free), and the vehicle moves for 5 s before and after it. If no moment is
    /// free, it is the first moment in motion; if the vehicle never moves, it is half-way.
    pub(super) fn moment(&self, catalogue: &Catalogue, from: Option<Time>) -> Time {
        if let Some(at) = catalogue.at {
            return Time::from_seconds(at);
        }
        let started = self.started.unwrap_or_default();
        // A log or a reference that ends early leaves the filter less time to converge.
        let latest = self.judged_end().shifted(-nanos(catalogue.span())).max(started);
        let settled = started.shifted(nanos(catalogue.settle)).min(latest);
        let earliest = settled.max(from.unwrap_or(Time::MIN));
        let speeds: Vec<(Time, f64)> = self.estimates.iter().filter_map(|e| Some((e.time, e.velocity?.norm()))).collect();
        let squares = speeds.iter().map(|(_, v)| v * v).sum::<f64>();
        let moving = 0.5 * math::sqrt(squares / speeds.len().max(1) as f64);
        let (mut since, mut found) = (None, None);
        for (time, speed) in speeds {
            if speed < moving {
                since = None;
                continue;
            }
            let since = *since.get_or_insert(time);
            let middle = time.shifted(-5_000_000_000);
            if since.max(earliest) <= middle && time.seconds_since(since) >= 10.0 {
                if self.is_free(catalogue, middle) {
                    return middle;
                }
                found.get_or_insert(middle);
            }
        }
        let end = self.judged_end();
        found.unwrap_or_else(|| Time::from_seconds(0.5 * (earliest.min(end).seconds() + end.seconds())))
    }

    /// Returns true if faults from `at` on, and the recovery after them, do not overlap a declared fault or the end of
    /// the log.
    pub(super) fn is_free(&self, catalogue: &Catalogue, at: Time) -> bool {
        let (from, to) = (at.seconds(), at.seconds() + catalogue.span());
        let is_apart = |(begin, end): &(f64, f64)| *end <= from || to <= *begin;
        to <= self.judged_end().seconds() && self.declared.iter().all(is_apart)
    }
}

impl RunObserver for Survey {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Row(row) => {
                if let (Some(learnt), Some(layout)) = (self.streams.get_mut(row.stream), self.layouts.get(row.stream)) {
                    learnt.add(row.time, row.values, layout);
                }
            }
            RunEvent::Filter { filter, event } => {
                if let Event::Started { belief, .. } = event
                    && filter.is_outermost()
                {
                    self.started.get_or_insert(belief.time);
                }
            }
            RunEvent::Estimate { filter, solution, belief } if filter.is_outermost() => {
                if let Some(last) = self.last_estimate.replace(belief.time) {
                    self.longest_pause = self.longest_pause.max(belief.time.seconds_since(last));
                }
                let is_next = |last: &ReferenceEpoch| belief.time.nanos().saturating_sub(last.time.nanos()) >= SPACING;
                if self.estimates.last().is_none_or(is_next) {
                    self.estimates.push(ReferenceEpoch {
                        time: belief.time,
                        position: solution.position.map(|(p, _)| p),
                        velocity: solution.velocity.map(|(v, _)| v),
                        attitude: solution.attitude.map(|(q, _)| q),
                        ..ReferenceEpoch::default()
                    });
                }
            }
            RunEvent::Reference {
                filter,
                error: Some(error),
                ..
            } if filter.is_outermost() => self.epochs.push(**error),
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::config::Document;
    use nalgebra::Vector3;

    #[test]
    fn faults_begin_apart_from_declared_ones_and_leave_the_time_to_recover() {
        let at = |seconds: f64, declared: Vec<(f64, f64)>| {
            let mut survey = Survey::new(Vec::new());
            survey.started = Some(Time::default());
            survey.declared = declared;
            let epoch = |k: i32| ReferenceEpoch {
                time: Time::from_seconds(f64::from(k)),
                velocity: Some(Vector3::new(1.0, 0.0, 0.0)),
                ..ReferenceEpoch::default()
            };
            survey.estimates = (0..seconds as i32).map(epoch).collect();
            survey.streams = vec![Learnt {
                times: vec![Time::from_seconds(seconds)],
                ..Learnt::default()
            }];
            let catalogue = Catalogue::read(Catalogue::built_in(), &Document::parse("empty", "").0).unwrap();
            let at = survey.moment(&catalogue, None);
            // The moment is a share of the run, so it is rounded.
            (at.seconds().round(), survey.is_free(&catalogue, at))
        };
        assert_eq!(at(600.0, Vec::new()), (60.0, true));
        // Each fault lasts for at most 45 s, and 30 s remain to recover.
        assert_eq!(at(600.0, vec![(80.0, 200.0)]), (200.0, true));
        assert_eq!(at(95.0, Vec::new()), (20.0, true));
        assert_eq!(at(600.0, vec![(0.0, 600.0)]), (60.0, false));
    }
}
