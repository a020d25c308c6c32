//! Calibrations that moved far while the innovations of a sensor were larger than chance allows.
//!
//! ```text
//! innovations ─▶ Page's test ─▶ a stretch: from the first of them that is too large to the last
//! estimates ───▶ how far calibrations were from where they began: |x − x₀| in units of σ₀, the 1σ at the beginning
//! ```
//!
//! A consistent filter moves a calibration by a random amount of variance σ₀² − σ² ≤ σ₀², in independent steps. The
//! farthest point exceeds a limit at most twice as often as the last point does (reflection principle). Innovations
//! that are k times too large move the calibration k times as far, and leave σ unchanged. The calibration is then less
//! accurate than its 1σ.
//!
//! Not here   which 1σ is wrong, that of the sensor or that of the calibration: both make innovations too large

use super::page::Page;
use super::{Entry, Filters, Heard, Listed, RunEnd, RunEvent, RunObserver, SectionObserver, Summary};
use core::ops::Range;
use fusion_core::belief::Belief;
use fusion_core::consistency::chi_square_quantile;
use fusion_core::filter::{Update, Verdict};
use fusion_core::math;
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};
use fusion_core::state::{Block, Dynamics, Kind, StateRole};
use fusion_core::time::Time;
use schemars::JsonSchema;
use serde::Serialize;
use std::sync::Arc;

/// A consistent filter moves an axis of a calibration less far with this probability. It holds 0.999 for the last step
/// and for any step before it.
const PROBABILITY: f64 = 0.9995;

/// A stretch of innovations that are larger than chance allows, and the calibrations that moved with them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Excess {
    /// The sensor of the innovations.
    pub sensor: String,
    /// Time of the first measurement \[s\].
    pub from: f64,
    /// Time of the last measurement \[s\].
    pub to: f64,
    /// Measurements that were used in the stretch.
    pub measurements: u64,
    /// Their mean NIS, each weighted by its loss.
    pub nis: f64,
    /// The mean NIS of a consistent filter.
    pub dof: usize,
    /// The calibrations that moved, the farthest first.
    pub moved: Vec<Moved>,
}

/// A calibration that moved.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Moved {
    /// The block.
    pub name: String,
    /// True if it has several axes.
    pub is_vector: bool,
    /// The axis that moved farthest, in units of its 1σ; axes count from 0.
    pub axis: usize,
    /// Its value at the beginning; 0 for an attitude and a geodetic position.
    pub from: f64,
    /// Its value where it was farthest from `from`. For an attitude and a geodetic position: its change.
    pub to: f64,
    /// Its 1σ at the beginning.
    pub sigma: f64,
    /// How far it moved, in units of `sigma`.
    pub sigmas: f64,
    /// The unit of `from`, `to` and `sigma`.
    pub unit: String,
}

impl Excess {
    /// Returns true if this calibration moved.
    #[must_use]
    pub fn moves(&self, name: &str) -> bool {
        self.moved.iter().any(|m| m.name == name)
    }
}

fusion_core::memory!(Excess {
    from,
    to,
    measurements,
    nis,
    dof,
    moved;
    sensor
});
fusion_core::memory!(Moved {
    name,
    is_vector,
    axis,
    from,
    to,
    sigma,
    sigmas,
    unit
});

/// Follows the sensors and the calibrations of all filters.
#[derive(Debug)]
pub(crate) struct Excesses(Box<[Followed]>);

impl Excesses {
    /// Follows these filters.
    #[must_use]
    pub fn new(filters: &Filters) -> Self {
        Self(filters.iter().map(Followed::new).collect())
    }

    /// For each sensor, the stretch in which a calibration moved farthest. Sensors without a far move are left out.
    fn excesses(self) -> Vec<Excess> {
        let all = self.0.into_iter().flat_map(|mut filter| {
            filter.close_all();
            filter.sensors
        });
        all.filter_map(|sensor| Some(sensor.worst).filter(|worst| !worst.moved.is_empty()))
            .collect()
    }
}

impl Listed for Excess {
    const NAME: &'static str = "excesses";
}

impl SectionObserver for Excesses {
    fn finish(self: Box<Self>, _: &RunEnd<'_>) -> Result<Entry, Halt> {
        Ok(self.excesses().into())
    }
}

impl Summary {
    /// For each sensor: of all stretches with innovations larger than chance allows, the stretch in which a
    /// calibration moved farthest. Empty for one of many runs.
    #[must_use]
    pub fn excesses(&self) -> &[Excess] {
        self.list()
    }
}

fusion_core::memory!(Followed { latest, is_due, sensors; calibrations });
fusion_core::memory!(Known { time, x, variance });
fusion_core::memory!(Stretch {
    page,
    began,
    before,
    farthest,
    peak,
    is_due,
    is_beyond,
    sum,
    count,
    to,
    at_peak,
    worst;
    dof
});

impl Memory for Excesses {
    fn remember(&mut self, tape: &mut fusion_core::memory::Tape<'_>) {
        self.0.remember(tape);
    }
}

/// A filter.
#[derive(Debug)]
struct Followed {
    calibrations: Arc<[Calibration]>,
    /// The latest estimate after a measurement.
    latest: Known,
    /// True if a measurement was used since then.
    is_due: bool,
    sensors: Box<[Stretch]>,
}

/// A block that is followed, and its place in [`Known`].
#[derive(Debug)]
struct Calibration {
    block: Block,
    name: String,
    storage: Range<usize>,
    tangent: Range<usize>,
}

/// All calibrations at a time.
#[derive(Clone, Debug, Default)]
struct Known {
    time: Time,
    x: Vec<f64>,
    variance: Vec<f64>,
}

/// The current stretch of a sensor.
#[derive(Debug, Default)]
struct Stretch {
    page: Page,
    /// Time of its first measurement.
    began: Option<Time>,
    /// The calibrations before its first measurement.
    before: Known,
    /// For each calibration, the point farthest from `before`; 0 σ before the first estimate.
    farthest: Vec<Moved>,
    peak: f64,
    /// True if the next estimate is at the peak.
    is_due: bool,
    /// True if the sum exceeded the alarm limit.
    is_beyond: bool,
    /// The sum of the NIS of its measurements, and their number.
    sum: f64,
    count: u64,
    to: Time,
    /// The same at the peak.
    at_peak: (f64, u64),
    dof: usize,
    worst: Excess,
}

impl Followed {
    fn new(filter: &Heard) -> Self {
        let (mut storage, mut tangent) = (0, 0);
        // A calibration of a sensor is named `sensor.calibration`. Biases of the input are skipped: every sensor moves
        // them.
        let is_of_sensor = |b: &&Block| b.role == StateRole::Calibration && b.name.contains('.');
        let blocks = filter.layout.blocks().iter().filter(is_of_sensor);
        let calibrations = blocks.map(|block| {
            let of = |from: &mut usize, range: Range<usize>| {
                let own = *from..*from + range.len();
                *from = own.end;
                own
            };
            Calibration {
                name: filter.named(&block.name),
                storage: of(&mut storage, block.storage_range()),
                tangent: of(&mut tangent, block.tangent_range()),
                block: block.clone(),
            }
        });
        let sensors = filter.sensors.iter().map(|sensor| Stretch {
            dof: sensor.residual,
            worst: Excess {
                sensor: sensor.name.clone(),
                dof: sensor.residual,
                ..Excess::default()
            },
            ..Stretch::default()
        });
        Self {
            calibrations: calibrations.collect(),
            latest: Known::default(),
            is_due: false,
            sensors: sensors.collect(),
        }
    }

    /// The filter starts from this belief, or the displayed hypothesis changed: the moves until then are judged.
    fn restart(&mut self, belief: Option<&Belief>) {
        self.close_all();
        self.is_due = false;
        match belief {
            Some(belief) => {
                self.latest.hear(&self.calibrations, belief);
                let each = self.calibrations.iter().flat_map(|c| c.tangent.clone().zip(&c.block.sigma));
                each.for_each(|(axis, declared)| self.latest.variance[axis] = self.latest.variance[axis].max(declared * declared));
            }
            None => self.latest.x.clear(),
        }
    }

    fn close_all(&mut self) {
        self.sensors.iter_mut().for_each(Stretch::close);
    }

    fn updated(&mut self, sensor: usize, time: Time, update: &Update<'_>) {
        if update.rivals.changed.is_some() {
            return self.restart(None);
        }
        if !matches!(update.verdict, Verdict::Accepted | Verdict::Reacquired) || self.calibrations.is_empty() {
            return;
        }
        self.is_due = true;
        if !self.latest.x.is_empty() {
            self.sensors[sensor].hear(time, update.nis * update.weight, &self.latest);
        }
    }

    fn estimated(&mut self, belief: &Belief) {
        if !core::mem::take(&mut self.is_due) {
            return;
        }
        self.latest.hear(&self.calibrations, belief);
        for sensor in self.sensors.iter_mut().filter(|sensor| sensor.is_due) {
            sensor.is_due = false;
            sensor.visit(&self.latest, &self.calibrations);
        }
    }
}

impl Known {
    fn hear(&mut self, calibrations: &[Calibration], belief: &Belief) {
        self.time = belief.time;
        self.x.clear();
        self.variance.clear();
        for Calibration { block, .. } in calibrations {
            self.x.extend_from_slice(&belief.x[block.storage_range()]);
            self.variance.extend(belief.covariance.variances(block));
        }
    }
}

impl Stretch {
    fn hear(&mut self, time: Time, nis: f64, latest: &Known) {
        let was_quiet = self.page.since.is_none();
        let told = self.page.hear(time, nis, self.dof as f64);
        if self.page.since.is_none() {
            return self.close();
        }
        if was_quiet {
            self.before.clone_from(latest);
            self.began = Some(time);
        }
        self.sum += nis;
        self.count += 1;
        self.is_beyond |= told.is_some();
        if self.page.sum > self.peak {
            (self.peak, self.to, self.is_due) = (self.page.sum, time, true);
            self.at_peak = (self.sum, self.count);
        } else if self.is_beyond && self.page.sum < self.peak - Page::ALARM {
            // A fall of this size is as improbable by chance as an alarm.
            self.close();
        }
    }

    /// Records how far the calibrations are from where they began.
    fn visit(&mut self, latest: &Known, calibrations: &[Calibration]) {
        self.farthest.resize_with(calibrations.len(), Moved::default);
        for (farthest, calibration) in self.farthest.iter_mut().zip(calibrations) {
            let moved = calibration.moved(&self.before, latest);
            if moved.sigmas > farthest.sigmas {
                *farthest = moved;
            }
        }
    }

    /// Ends the stretch, and keeps it if a calibration moved farther than in the worst stretch so far.
    fn close(&mut self) {
        if let (true, Some(since)) = (self.is_beyond, self.began) {
            let limit = math::sqrt(chi_square_quantile(PROBABILITY, 1.0));
            let mut moved = core::mem::take(&mut self.farthest);
            moved.retain(|m| m.sigmas > limit);
            moved.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
            let farthest = |moved: &[Moved]| moved.first().map_or(0.0, |m| m.sigmas);
            if farthest(&moved) > farthest(&self.worst.moved) {
                let (sum, count) = self.at_peak;
                self.worst = Excess {
                    from: since.seconds(),
                    to: self.to.seconds(),
                    measurements: count,
                    nis: sum / count as f64,
                    moved,
                    ..core::mem::take(&mut self.worst)
                };
            }
        }
        (self.page, self.began) = (Page::default(), None);
        (self.peak, self.is_due, self.is_beyond) = (0.0, false, false);
        (self.sum, self.count, self.at_peak) = (0.0, 0, (0.0, 0));
        self.farthest.clear();
    }
}

impl Calibration {
    /// The axis that has moved farthest.
    fn moved(&self, before: &Known, after: &Known) -> Moved {
        let elapsed = after.time.seconds_since(before.time);
        let (from, to) = (&before.x[self.storage.clone()], &after.x[self.storage.clone()]);
        let mut difference = vec![0.0; self.tangent.len()];
        self.block.kind.minus(to, from, &mut difference);
        let has_values = self.block.kind.is_linear() || self.block.kind == Kind::Angle;
        let axes = difference.iter().zip(&before.variance[self.tangent.clone()]).enumerate();
        let sigmas = axes.map(|(axis, (moved, variance))| {
            let sigma = math::sqrt(variance.max(0.0) + self.wandered(axis, elapsed));
            (axis, sigma, if sigma > 0.0 { moved.abs() / sigma } else { 0.0 })
        });
        let Some((axis, sigma, sigmas)) = sigmas.max_by(|a, b| a.2.total_cmp(&b.2)) else {
            return Moved::default();
        };
        let from = if has_values { from[axis] } else { 0.0 };
        Moved {
            name: self.name.clone(),
            is_vector: difference.len() > 1,
            axis,
            from,
            to: from + difference[axis],
            sigma,
            sigmas,
            unit: self.block.unit.to_owned(),
        }
    }

    /// The variance of the random walk of an axis over this time.
    fn wandered(&self, axis: usize, elapsed: f64) -> f64 {
        match &self.block.dynamics {
            Dynamics::Process | Dynamics::Constant => 0.0,
            // Its rate moves it without limit.
            Dynamics::Integral { .. } => f64::INFINITY,
            Dynamics::RandomWalk { psd } => psd[axis] * elapsed,
            Dynamics::GaussMarkov { sigma, .. } => sigma[axis] * sigma[axis],
        }
    }
}

impl RunObserver for Excesses {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Estimate { filter, belief, .. } => self.0[filter.number].estimated(belief),
            RunEvent::Filter {
                filter,
                event: Event::Started { belief, .. },
            } => self.0[filter.number].restart(Some(belief)),
            RunEvent::Filter {
                filter,
                event: Event::Updated { sensor, update, time, .. },
            } => self.0[filter.number].updated(*sensor, *time, update),
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solution::{SolutionReader, Solved};
    use fusion_core::covariance::FormKind;
    use fusion_core::filter::Rivals;
    use fusion_core::gate::Mode;
    use fusion_core::memory::{restore, save};
    use fusion_core::runner::RowId;

    /// A receiver whose latency is a state of 0 ± 50 ms.
    fn filters() -> Filters {
        let nav = crate::Navigator::from_toml(
            "[process]
            type = 'constant_velocity'
            acceleration_noise = 1
            position_sigma = 10
            velocity_sigma = 5
            [sensor.gnss]
            type = 'gnss_velocity'
            source = 'gnss'
            time_offset = { estimate = true, initial = 0, sigma = '50 ms' }
            noise = '5 cm/s'
            [initial.start]
            type = 'explicit'
            position = { latitude = 0.8, longitude = 0.1 }
            position_sigma = 5
            velocity = [0, 0, 0]
            velocity_sigma = 1
            [run]
            origin = { latitude = 0.8, longitude = 0.1 }",
        );
        Filters::of(nav.unwrap_or_else(|d| panic!("{d}")).assembly())
    }

    /// Starts at 0 s and hears one measurement per second: its NIS, and the latency after it.
    fn heard(filters: &Filters, seconds: u32, of: &dyn Fn(u32) -> (f64, f64), saved_at: Option<u32>) -> Vec<Excess> {
        let filter = filters.outermost().unwrap();
        let block = filter.layout.blocks().iter().find(|b| b.name == "gnss.time_offset").unwrap();
        let mut belief = Belief::initial(&filter.layout, &FormKind::Joseph.form(), Time::default());
        let mut all = Excesses::new(filters);
        let mut reader = SolutionReader::new(&filter.layout, filter.process.clone());
        let rivals = Rivals::NONE;
        let event = &Event::Started { belief: &belief, rivals };
        all.on(&RunEvent::Filter { filter, event }).unwrap();
        for k in 1..=seconds {
            let (nis, latency) = of(k);
            let time = Time::from_seconds(f64::from(k));
            let update = Update {
                verdict: Verdict::Accepted,
                value: &[],
                predicted: &[],
                noise: &[],
                residual: &[0.0; 3],
                innovation_sigma: &[],
                innovation_factor: &[],
                nis,
                statistic: nis,
                threshold: f64::INFINITY,
                mode: Mode::Track,
                power: &[],
                weight: 1.0,
                rivals,
                jacobian: None,
            };
            let row = RowId {
                stream: 0,
                number: 0,
                stamp: time,
                arrival: time,
                disturbed: false,
            };
            let event = &Event::Updated {
                sensor: 0,
                update,
                time,
                row,
            };
            all.on(&RunEvent::Filter { filter, event }).unwrap();
            belief.time = time;
            belief.x[block.storage_range()][0] = latency;
            let (solution, belief) = (&Solved::new(&mut reader, &belief), &belief);
            all.on(&RunEvent::Estimate { filter, solution, belief }).unwrap();
            if saved_at == Some(k) {
                let (mut bytes, mut twin) = (Vec::new(), Excesses::new(filters));
                save(&mut all, &mut bytes);
                restore(&mut twin, &bytes).unwrap();
                all = twin;
            }
        }
        all.excesses()
    }

    /// The mean of a consistent filter is 3.
    fn consistent(k: u32) -> f64 {
        [0.5, 2.0, 4.0, 5.5][(k % 4) as usize]
    }

    #[test]
    fn a_latency_that_moves_with_innovations_too_large_is_told_with_both_ends_in_its_first_sigma() {
        let filters = filters();
        // NIS four times the expected value from 51 s to 100 s; meanwhile the latency moves to −0.2 s and stays there.
        let nis = |k: u32| if (51..=100).contains(&k) { 12.0 } else { consistent(k) };
        let latency = |k: u32| -0.004 * f64::from(k.clamp(50, 100) - 50);
        let of = |k: u32| (nis(k), latency(k));
        let all = heard(&filters, 300, &of, None);
        assert_eq!(all.len(), 1);
        let (excess, moved) = (&all[0], &all[0].moved[0]);
        assert_eq!(
            (excess.sensor.as_str(), excess.dof, moved.name.as_str()),
            ("gnss", 3, "gnss.time_offset")
        );
        // The start may include a few earlier measurements above the mean NIS.
        assert!(
            (46.0..=51.0).contains(&excess.from) && (100.0..=104.0).contains(&excess.to),
            "{excess:?}"
        );
        assert!((11.0..=12.0).contains(&excess.nis), "{excess:?}");
        assert!((moved.from, moved.to) == (0.0, -0.2) && moved.sigma == 0.05, "{moved:?}");
        // 1e-12: rounding.
        assert!((moved.sigmas - 4.0).abs() < 1e-12, "{moved:?}");
        // A restored run continues as if it had never been saved.
        assert_eq!(heard(&filters, 300, &of, Some(70)), all);
        // The end of the run ends the stretch.
        assert!((heard(&filters, 95, &of, None)[0].to - 95.0).abs() < 1e-9);
    }

    #[test]
    fn neither_alone_is_told() {
        let filters = filters();
        let large = |k: u32| if (51..=100).contains(&k) { 12.0 } else { consistent(k) };
        let far = |k: u32| -0.004 * f64::from(k.clamp(50, 100) - 50);
        assert_eq!(heard(&filters, 300, &|k| (consistent(k), far(k)), None), []);
        // A move by 3σ₀, which happens by chance once in 400 times.
        assert_eq!(heard(&filters, 300, &|k| (large(k), 0.75 * far(k)), None), []);
        // A far move, but two minutes after the innovations became normal again.
        let later = |k: u32| if k < 250 { 0.0 } else { -0.2 };
        assert_eq!(heard(&filters, 300, &|k| (large(k), later(k)), None), []);
    }

    #[test]
    fn a_calibration_that_comes_back_was_moved_all_the_same() {
        let filters = filters();
        let of = |k: u32| (12.0, if (20..30).contains(&k) { 0.25 } else { 0.0 });
        let all = heard(&filters, 60, &of, None);
        assert!(all[0].moved[0].to == 0.25 && (all[0].to - 60.0).abs() < 1e-9, "{all:?}");
    }
}
