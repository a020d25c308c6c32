//! Time offsets that are estimated: when a row is valid, and how fast the state moved then.
//!
//! A row of such a sensor is queued at the earliest time at which it may be valid, stamp − `most`. When the runner
//! reaches that time, it reads the offset τ̂ and queues the row again at stamp − τ̂. By then exactly the rows that
//! are valid earlier have been used: τ̂ does not depend on the order of arrival. The offset may have changed by the
//! time the row is served, or the row came late from a stage. Then [`Lateness`] corrects the rest to first order.
//!
//! The rate of the state is taken under an input averaged over [`WINDOW`] about the time of validity, as far after it
//! as before. A single sample is mostly noise; its square would count as information about τ. A mean over the past
//! alone is not enough: it contains the noise that is in the velocity too, and τ̂ would be wrong by q/E[a²] for white
//! acceleration noise of density q. The half after the time of validity gives the opposite error, and the two halves
//! cancel.

use super::intake::Taken;
use super::rows::{Consumer, Entry};
use super::{Runner, Sensor};
use crate::filter::Lateness;
use crate::memory::{Memory, Tape};
use crate::model::Input;
use crate::state::{Quantity, Scalar};
use crate::time::{Time, nanos};
use std::collections::VecDeque;

/// Over how long the input is averaged \[s\].
const WINDOW: f64 = 0.1;
/// Rows of the input that are kept at least, however long they are.
const FEWEST: usize = 4;

/// The time offset of a sensor whose rows cannot simply be queued at their time of validity: stamp
/// minus validity \[s\].
#[derive(Clone, Debug)]
pub struct Offset {
    /// Its value: a state, or a constant where rows come too late to be queued that early.
    pub value: Quantity<Scalar>,
    /// The least offset that is allowed for; a row with a smaller offset is served at this one.
    pub least: f64,
    /// The largest offset that is allowed for. [`Port::delay`](super::Port::delay) of its sensor contains it.
    pub most: f64,
}

impl Sensor {
    /// The shortest delay its rows may have \[ns\].
    pub(super) fn least_delay(&self) -> i64 {
        let play = self.offset.as_ref().map_or(0, |o| nanos((o.most - o.least).max(0.0)));
        self.port.delay.saturating_sub(play)
    }
}

/// A row of the input: mean rates over an interval.
#[derive(Clone, Debug, Default)]
struct Kept {
    start: Time,
    end: Time,
    values: Vec<f64>,
}
crate::memory!(Kept { start, end, values });

/// The latest rows of the input, and their mean.
#[derive(Clone, Debug, Default)]
pub(super) struct Window {
    rows: VecDeque<Kept>,
    spare: Vec<Kept>,
    /// A row that is still to come.
    coming: Vec<f64>,
    /// The input under which the rate is taken.
    sample: Vec<f64>,
    interval: f64,
}

impl Memory for Window {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.pooled(&mut self.rows, &mut self.spare);
    }
}

impl Window {
    /// Takes the row of the input that covers `start` to `end`.
    fn keep(&mut self, start: Time, end: Time, values: &[f64]) {
        let mut row = self.spare.pop().unwrap_or_default();
        (row.start, row.end) = (start, end);
        row.values.clear();
        row.values.extend_from_slice(values);
        self.rows.push_back(row);
        // Samples may wait for their neighbours before they are run over.
        let oldest = end.shifted(nanos(-3.0 * WINDOW));
        while self.rows.len() > FEWEST && self.rows.front().is_some_and(|row| row.end < oldest) {
            self.spare.extend(self.rows.pop_front());
        }
    }
}

impl Window {
    /// The offset of a row under the input as averaged last.
    pub(super) fn lateness<'a>(&'a self, offset: &'a Offset, assumed: f64) -> Lateness<'a> {
        Lateness {
            offset: &offset.value,
            assumed,
            input: Input {
                sample: &self.sample,
                interval: self.interval,
            },
        }
    }
}

impl Runner {
    /// Keeps the present row of the input, which ends at `time` and was taken.
    pub(super) fn keep_input(&mut self, taken: &Taken, time: Time) {
        let start = match taken {
            Taken::First => time,
            Taken::Sample => self.window.rows.back().map_or(time, |last| last.end),
            Taken::Resumes { start, .. } => *start,
        };
        if self.sensors.iter().any(|s| s.offset.is_some()) {
            self.window.keep(start, time, &self.value);
        }
    }

    /// Queues a row at its time of validity by the current estimate of the offset.
    pub(super) fn aim(&mut self, sensor: usize, entry: Entry) {
        let s = &self.sensors[sensor];
        let x = &self.estimator.belief().x;
        let Some(offset) = &s.offset else { return };
        let tau = offset.value.stored(x).unwrap_or(offset.most).max(offset.least).min(offset.most);
        let earliest = self.rows.get(entry.row).stamp().shifted(-s.port.delay);
        let time = earliest.shifted(nanos(offset.most - tau)).max(entry.time);
        let consumer = Consumer::Sensor(self.ranks[sensor], sensor);
        self.queue.put(Entry { time, consumer, ..entry });
    }

    /// The offset by which a row of `sensor` would be valid at `time`, at which it is served. `None` for a sensor
    /// without an offset, and in a gap of the input, where the rate is unknown. Averages the input about that time;
    /// `held` is the current sample.
    pub(super) fn assumed_offset(&mut self, sensor: usize, row: usize, time: Time, held: Option<Input<'_>>) -> Option<f64> {
        let s = &self.sensors[sensor];
        let most = s.offset.as_ref()?.most;
        let earliest = self.rows.get(row).stamp().shifted(-s.port.delay);
        self.average_input(time, held)?;
        Some(most - time.seconds_since(earliest))
    }

    /// The mean of the input about `time`; `None` if input is missing there.
    fn average_input(&mut self, time: Time, held: Option<Input<'_>>) -> Option<()> {
        let Some(input) = &self.input else { return Some(()) };
        let foreknown = self.foreknown;
        let window = &mut self.window;
        let newest = window.rows.back()?.end;
        let latest = window.rows.back().map_or(&[][..], |row| &row.values);
        let held = held.unwrap_or(Input::held(latest));
        window.sample.clear();
        window.sample.extend_from_slice(held.sample);
        window.interval = held.interval;
        // Rows that are certainly present by now, for any order of arrival.
        let certain = time.shifted(foreknown);
        let half = time.shifted(nanos(0.5 * WINDOW));
        let coming = || {
            let rows = self.queue.iter().take_while(move |e| e.time <= certain);
            let rows = rows.filter(move |e| e.consumer == Consumer::Input && e.time > newest);
            let mut from = newest;
            rows.take_while(move |e| core::mem::replace(&mut from, e.time) < half)
        };
        let last = coming().last().map_or(newest, |e| e.time);
        self.seen = self.seen.max(if last < half { certain } else { last });
        let end = last.min(half).max(time);
        let start = end.shifted(nanos(-WINDOW));
        let rates = self.process.rates();
        let (sample, mut total) = (&mut window.sample, 0.0);
        let mut add = |from: Time, to: Time, values: &[f64]| {
            let weight = to.min(end).seconds_since(from.max(start));
            if weight > 0.0 {
                if total == 0.0 {
                    sample[rates.clone()].fill(0.0);
                }
                total += weight;
                rates.clone().for_each(|k| sample[k] += weight * values[k]);
            }
        };
        window.rows.iter().for_each(|row| add(row.start, row.end, &row.values));
        let mut from = newest;
        for entry in coming() {
            input.port.gather(&self.rows.get(entry.row).values, &mut window.coming);
            if input.is_plausible(&window.coming, self.process.as_ref()) {
                add(from, entry.time, &window.coming);
            }
            from = entry.time;
        }
        if total == 0.0 {
            return None;
        }
        sample[rates].iter_mut().for_each(|mean| *mean /= total);
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::Belief;
    use crate::filter::tests::{Direct, Track, declare};
    use crate::filter::{Backend, Filter};
    use crate::gate::{Gate, OnlyWith, Open};
    use crate::loss::Quadratic;
    use crate::model::{Process, Size};
    use crate::runner::{Emitter, Event, Nested, Noise, Outlet, Port, Row, Stage, StageUnit, StreamId};
    use crate::state::{Dynamics, LayoutBuilder, Slot, View};
    use std::sync::Arc;

    /// The true delays of the two sensors \[s\].
    const TRUE: [f64; 2] = [0.31, 0.12];

    fn acceleration(t: f64) -> f64 {
        1.5 * (0.9 * t).sin()
    }

    fn velocity(t: f64) -> f64 {
        1.5 / 0.9 * (1.0 - (0.9 * t).cos())
    }

    fn position(t: f64) -> f64 {
        1.5 / 0.9 * (t - (0.9 * t).sin() / 0.9)
    }

    /// Slots of position, velocity and two offsets that start from 0.
    struct States {
        builder: LayoutBuilder,
        position: Slot<Scalar>,
        velocity: Slot<Scalar>,
        offsets: [Slot<Scalar>; 2],
    }

    fn states() -> States {
        let mut builder = LayoutBuilder::new();
        let mut state = |name: &str, sigma: f64, dynamics| declare::<Scalar>(&mut builder, name, 0.0, &[sigma], dynamics);
        let position = state("position", 0.1, Dynamics::Process);
        let velocity = state("velocity", 0.1, Dynamics::Process);
        let offsets = ["late", "later"].map(|name| state(name, 0.1, Dynamics::Constant));
        States {
            builder,
            position,
            velocity,
            offsets,
        }
    }

    /// The largest offset that most tests allow for, in either direction [s].
    const MOST: f64 = 0.6;

    fn sensor(name: &str, port: (StreamId, usize), x: Slot<Scalar>, offset: Slot<Scalar>, leader: Option<usize>) -> Sensor {
        Sensor {
            name: name.to_owned(),
            model: Arc::new(Direct(x)),
            port: Port {
                stream: port.0,
                columns: vec![port.1],
                delay: nanos(MOST),
            },
            offset: Some(Offset {
                value: offset.into(),
                least: -MOST,
                most: MOST,
            }),
            constant: Vec::new(),
            noise: Noise::diagonal(&[0.02]),
            quality: None,
            gate: leader.map_or(Box::new(Open) as Box<dyn Gate>, |leader| {
                Box::new(OnlyWith::new(leader, 10.0, Box::new(Open)))
            }),
            loss: Arc::new(Quadratic),
        }
    }

    /// Accelerations on stream 0; position and velocity on stream 1, both late by an unknown time.
    fn runner(buffer: f64) -> Runner {
        let States {
            builder,
            position,
            velocity,
            offsets,
        } = states();
        let process: Arc<dyn Process> = Arc::new(Track {
            position,
            velocity,
            sigma: 0.02,
        });
        let filter = Filter::new(Arc::new(builder.finish()), process.clone(), Backend::default(), Size::same(1));
        let mut runner = Runner::new(Box::new(filter), process, buffer);
        runner.add_stream("imu", 1);
        runner.add_stream("fix", 2);
        runner.set_input(Port {
            stream: 0,
            columns: vec![0],
            delay: 0,
        });
        runner.add_sensor(sensor("velocity", (1, 1), velocity, offsets[0], Some(1)));
        runner.add_sensor(sensor("position", (1, 0), position, offsets[1], None));
        runner
    }

    type Rows = Vec<(StreamId, Time, Vec<f64>)>;

    /// A minute at 100 Hz, fixes five times a second.
    fn rows() -> Rows {
        let mut rows = Vec::new();
        for k in 0..6000_i64 {
            let t = k as f64 * 0.01;
            let time = Time::from_seconds(t);
            rows.push((0, time, vec![acceleration(t - 0.005)]));
            if k % 20 == 7 && t > 1.0 {
                rows.push((
                    1,
                    time.shifted(3_000_000),
                    vec![position(t + 0.003 - TRUE[1]), velocity(t + 0.003 - TRUE[0])],
                ));
            }
        }
        rows
    }

    /// The belief at the end, and when the measurements of the velocity were used, with their stamps.
    fn fed(runner: &mut Runner, rows: &Rows) -> (Belief, Vec<(Time, Time)>) {
        let mut used = Vec::new();
        let mut observer = |event: &Event<'_>| match event {
            Event::Updated { sensor: 0, time, row, .. } => used.push((*time, row.stamp)),
            Event::Discarded { consumer, time, .. } => panic!("{consumer} at {time} is discarded"),
            _ => {}
        };
        for (stream, time, row) in rows {
            runner.feed(&Row::new(*stream, *time, row), &mut observer).unwrap();
        }
        runner.finish(&mut observer).unwrap();
        (runner.belief().clone(), used)
    }

    #[test]
    fn offsets_are_found_from_afar_and_rows_are_used_when_they_are_valid() {
        let (belief, used) = fed(&mut runner(0.0), &rows());
        for (k, wanted) in TRUE.iter().enumerate() {
            let (tau, axis) = (belief.x[2 + k], 2 + k);
            let sigma = belief.covariance.to_dense()[axis * 4 + axis].sqrt();
            // 3σ; the data have no noise, so the error is far smaller than the filter allows for.
            assert!((tau - wanted).abs() < 3.0 * sigma && sigma < 0.005, "{tau} {wanted} {sigma}");
        }
        let (time, stamp) = used.last().unwrap();
        let applied = stamp.seconds_since(*time);
        // The change by the last updates: a tenth of 1σ.
        assert!((applied - belief.x[2]).abs() < 5e-4, "{applied} {}", belief.x[2]);
        assert!(used[0].1.seconds_since(used[0].0).abs() < 1e-9, "the first by the initial value");
    }

    #[test]
    fn any_order_of_arrival_within_the_buffer_gives_the_same_bits() {
        let rows = rows();
        // If `most` is small, rows are held back for less time than the window covers.
        for most in [MOST, 0.01] {
            let runner = || {
                let mut runner = runner(0.5);
                for s in &mut runner.sensors {
                    s.port.delay = nanos(most);
                    s.offset.iter_mut().for_each(|o| (o.least, o.most) = (-most, most));
                }
                runner.hold_back();
                runner
            };
            // The buffer, the longest delay, and from the earliest of the follower to the latest of its leader.
            assert_eq!(runner().lag, nanos(0.5 + most + 2.0 * most));
            let wanted = fed(&mut runner(), &rows);
            assert!(wanted.1.len() > 280);
            for law in 1..7_i64 {
                // Delays of any length up to the buffer; or some rows late by the whole buffer and the others not at
                // all.
                let late = |k: usize| match (k as i64 * 7919 * law).rem_euclid(51) {
                    n if law < 5 => n,
                    n => 50 * i64::from(n < 7),
                };
                let mut arrivals: Vec<_> = rows.iter().enumerate().collect();
                arrivals.sort_by_key(|(k, (_, time, _))| time.shifted(late(*k) * nanos(0.01)));
                let shuffled: Rows = arrivals.into_iter().map(|(_, row)| row.clone()).collect();
                let found = fed(&mut runner(), &shuffled);
                assert_eq!((found.0.x, found.1), (wanted.0.x.clone(), wanted.1.clone()), "{law}");
            }
        }
    }

    #[test]
    fn rows_whose_offset_leaves_what_is_allowed_for_are_used_at_the_edge_of_it() {
        // The velocity is late by 0.31 s.
        for (least, most, edge) in [(0.4, 0.6, 0.4), (-0.6, 0.1, 0.1)] {
            let mut runner = runner(0.0);
            for s in &mut runner.sensors {
                s.port.delay = nanos(most);
                s.offset.iter_mut().for_each(|o| (o.least, o.most) = (least, most));
            }
            runner.hold_back();
            let (_, used) = fed(&mut runner, &rows());
            let (time, stamp) = used.last().unwrap();
            assert_eq!(stamp.nanos() - time.nanos(), nanos(edge));
        }
    }

    /// Feeds these samples of a ramp, each the mean over its interval: a mean of them is the value in its
    /// middle.
    fn ramp(runner: &mut Runner, samples: core::ops::Range<i64>) {
        for k in samples {
            let (time, value) = (Time::from_nanos(k * 10_000_000), k as f64 - 0.5);
            runner.feed(&Row::new(0, time, &[value]), &mut |_: &Event<'_>| {}).unwrap();
        }
    }

    #[test]
    fn after_a_gap_the_input_is_averaged_from_where_it_resumed() {
        let mut runner = runner(0.0);
        runner.sensors.truncate(1);
        runner.hold_back();
        ramp(&mut runner, 0..300);
        ramp(&mut runner, 400..464);
        let now = runner.belief().time;
        assert_eq!(now, Time::from_seconds(4.03), "rows are held back for 0.6 s");
        runner.average_input(now, None).unwrap();
        // The first sample covers the 10 ms before it.
        let middle = 100.0 * 0.5 * (3.99 + now.seconds() + 0.05);
        let mean = runner.window.sample[0];
        // 100 ε of the sum of nine numbers of 400.
        assert!((mean - middle).abs() < 1e-10, "{mean} {middle}");
    }

    #[test]
    fn the_input_is_averaged_as_far_after_as_before() {
        let mut runner = runner(0.0);
        runner.sensors.truncate(1);
        runner.hold_back();
        ramp(&mut runner, 0..300);
        let now = runner.belief().time;
        assert_eq!(now, Time::from_seconds(2.39), "rows are held back for 0.6 s");
        for before in [0.0, 0.003, 0.008] {
            runner.average_input(now.shifted(nanos(-before)), None).unwrap();
            let middle = (now.seconds() - before) * 100.0;
            let mean = runner.window.sample[0];
            // 100 ε of the sum of ten numbers of 250.
            assert!((mean - middle).abs() < 1e-10, "{mean} {middle}");
        }
        // Without input the mean is `None`; a row that is NaN is left out.
        assert_eq!(runner.average_input(now.shifted(nanos(5.0)), None), None);
        let wrong = Time::from_seconds(3.0);
        runner.feed(&Row::new(0, wrong, &[f64::NAN]), &mut |_: &Event<'_>| {}).unwrap();
        ramp(&mut runner, 301..358);
        let now = runner.belief().time;
        assert!(now < wrong && wrong < now.shifted(nanos(0.05)), "{now}");
        runner.average_input(now, None).unwrap();
        assert!(runner.window.sample[0].is_finite());
    }

    /// Emits each row of its input as it is.
    #[derive(Clone, Debug)]
    struct Echo;
    crate::memory!(Echo {});

    impl Stage for Echo {
        fn row(&mut self, _: usize, time: Time, row: &[f64], _: Option<&View<'_>>, out: &mut Emitter<'_>) {
            out.emit(time, row);
        }
    }

    #[test]
    fn a_row_that_a_stage_emits_too_late_is_predicted_back_to_where_it_is_valid() {
        let States {
            builder,
            position,
            velocity,
            ..
        } = states();
        let process: Arc<dyn Process> = Arc::new(Track {
            position,
            velocity,
            sigma: 0.02,
        });
        let filter = Filter::new(Arc::new(builder.finish()), process.clone(), Backend::default(), Size::same(1));
        let mut runner = Runner::new(Box::new(filter), process, 0.0);
        for name in ["imu", "fix", "echo"] {
            runner.add_stream(name, 1);
        }
        let port = |stream, delay| Port {
            stream,
            columns: vec![0],
            delay,
        };
        runner.set_input(port(0, 0));
        runner.add_stage(StageUnit {
            name: "echo".to_owned(),
            stage: Box::new(Echo),
            inputs: vec![port(1, 0)],
            output: 2,
        });
        let offset = Offset {
            value: Quantity::Fixed(0.2),
            least: 0.2,
            most: 0.2,
        };
        let mut late = sensor("late", (2, 0), position, velocity, None);
        (late.port.delay, late.offset) = (nanos(0.2), Some(offset));
        late.noise = Noise::diagonal(&[1e9]);
        runner.add_sensor(late);
        let mut predicted = Vec::new();
        let mut observer = |event: &Event<'_>| {
            if let Event::Updated { update, time, .. } = event {
                predicted.push((time.seconds(), update.predicted[0]));
            }
        };
        for k in 0..500_i64 {
            let time = Time::from_seconds(k as f64 * 0.01);
            runner.feed(&Row::new(0, time, &[1.0]), &mut observer).unwrap();
            if k == 450 {
                runner.feed(&Row::new(1, time, &[0.0]), &mut observer).unwrap();
            }
        }
        runner.finish(&mut observer).unwrap();
        // ½ t² less 0.2 s at 4.5 m/s, and ½ ms of 1 m/s² by the step over which the rate is taken.
        let wanted = 0.5 * 4.5 * 4.5 - 0.2 * (4.5 + 0.5e-3);
        assert_eq!(predicted.len(), 1);
        let (time, value) = predicted[0];
        assert!(time == 4.5 && (value - wanted).abs() < 1e-6, "{time} {value} {wanted}");
    }

    #[test]
    fn a_filter_inside_a_stage_finds_the_offset_too() {
        let mut inside = runner(0.0);
        let delay = nanos(0.6);
        // Rows come in the order of the runner outside, by the earliest time at which they may be valid.
        inside.sensors.iter_mut().for_each(|s| s.port.delay = 0);
        inside.sensors.truncate(1);
        inside.sensors[0].gate = Box::new(Open);
        inside.hold_back();
        let block = inside.estimator().layout().block("late").unwrap().clone();
        let mut outer = runner(0.0);
        outer.sensors.clear();
        outer.add_stream("inside", 1);
        let port = |stream, width, delay| Port {
            stream,
            columns: (0..width).collect(),
            delay,
        };
        outer.add_stage(StageUnit {
            name: "inside".to_owned(),
            stage: Box::new(Nested::new(inside, vec![0, 1], vec![Outlet::State(block)])),
            inputs: vec![port(0, 1, 0), port(1, 2, delay)],
            output: 2,
        });
        let mut tau = f64::NAN;
        let mut observer = |event: &Event<'_>| {
            if let Event::Nested {
                event: Event::Estimate { belief },
                ..
            } = event
            {
                tau = belief.x[2];
            }
        };
        for (stream, time, row) in rows() {
            outer.feed(&Row::new(stream, time, &row), &mut observer).unwrap();
        }
        // 1σ at the end is 2 ms; the velocity alone, without noise.
        assert!((tau - TRUE[0]).abs() < 2e-3, "{tau}");
    }
}
