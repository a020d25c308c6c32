//! A filter inside a filter: a stage that hosts its own runner.
//!
//! The outer runner orders the rows. It hands them to the stage by time of validity, so the runner
//! inside has streams without delays and never holds a row back: a row is used by the time the stage
//! returns.
//!
//! After each row that moves the process inside, the estimate leaves as a row of the same time. It contains every
//! measurement of that time that the runner inside has received by then: the measurements of the driving row itself,
//! and of rows with the same time that arrived or are declared earlier. Later measurements with the same time enter
//! the next row. A process driven by time alone gives a row per measurement used.
//!
//! Events inside are reported to the outer observers as [`Event::Nested`].

use super::{Emitter, Event, Halt, Observer, Row, Runner, Stage, StreamId};
use crate::belief::Belief;
use crate::geometry::so3;
use crate::math;
use crate::state::{Attitude, Block, Manifold, View};
use crate::time::Time;
use alloc::string::String;
use alloc::vec::Vec;
use core::ops::Range;

/// The part of the estimate inside, or of the row that drove it, that leaves as numbers of a row.
#[derive(Clone, Debug)]
pub enum Outlet {
    /// The value of a block.
    State(Block),
    /// 1σ of a block along its tangent coordinates.
    Sigma(Block),
    /// These numbers of the signals' storage: the value of a signal.
    Signal(Range<usize>),
    /// Of an attitude block: the heading, its 1σ, and the 1σ of the tilt about north and about east
    /// \[rad\].
    Heading(Block),
    /// These numbers of the row that moves the process, as they came; for a process that is driven by
    /// an input of the stage.
    Passed(Range<usize>),
}

impl Outlet {
    /// Numbers that it gives.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::State(b) => b.storage_range().len(),
            Self::Sigma(b) => b.tangent_range().len(),
            Self::Signal(r) | Self::Passed(r) => r.len(),
            Self::Heading(_) => 4,
        }
    }
}

/// A stage that is a filter.
#[derive(Debug)]
pub struct Nested {
    runner: Runner,
    /// By input of the stage: the stream inside.
    streams: Vec<StreamId>,
    outlets: Vec<Outlet>,
    row: Vec<f64>,
}
crate::memory!(Nested { runner; streams, outlets, row });

impl Nested {
    /// Hosts `runner`. Input i of the stage feeds its stream `streams[i]`; rows that it emits consist of
    /// `outlets`.
    #[must_use]
    pub fn new(runner: Runner, streams: Vec<StreamId>, outlets: Vec<Outlet>) -> Self {
        Self {
            runner,
            streams,
            outlets,
            row: Vec::new(),
        }
    }

    /// The runner inside.
    #[must_use]
    pub const fn runner(&self) -> &Runner {
        &self.runner
    }

    /// Whether the estimate is to be emitted. For a driven process, the row valid at `time` must have moved the
    /// estimate there from `before`. If time alone moves the process, a measurement must have been `used`.
    fn is_due(&self, time: Time, before: Time, used: bool) -> bool {
        let now = self.runner.belief().time;
        let scheduler = self.runner.scheduler();
        let moved = if scheduler.is_driven() { now > before } else { used };
        // Signals at the start itself have no input yet.
        moved && now == time && scheduler.has_started_before(time)
    }

    /// Fills the row to emit; `driving` is the row that drove the process.
    fn fill(&mut self, driving: &[f64]) {
        self.row.clear();
        let estimator = self.runner.estimator_mut();
        for outlet in &self.outlets {
            match outlet {
                Outlet::State(b) => self.row.extend_from_slice(&estimator.belief().x[b.storage_range()]),
                Outlet::Sigma(b) => self.row.extend(estimator.belief().covariance.sigmas(b)),
                Outlet::Signal(r) => self.row.extend_from_slice(&estimator.view().signals()[r.clone()]),
                Outlet::Heading(b) => self.row.extend(heading(estimator.belief(), b)),
                Outlet::Passed(r) => self.row.extend_from_slice(&driving[r.clone()]),
            }
        }
    }
}

/// Heading, its 1σ, and the 1σ of the tilt about north and east \[rad\].
fn heading(belief: &Belief, attitude: &Block) -> [f64; 4] {
    let q = Attitude::read(&belief.x[attitude.storage_range()]);
    let c_nb = so3::rotation(&q);
    let p_b = belief.covariance.marginal::<3>(attitude);
    let sigma = (c_nb * p_b * c_nb.transpose()).diagonal().map(math::sqrt);
    [so3::to_rpy(&q).z, sigma.z, sigma.x, sigma.y]
}

/// Reports the events inside to the outer observers.
struct Teller<'a, 'b> {
    out: &'a mut Emitter<'b>,
    used: bool,
}

impl Observer for Teller<'_, '_> {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        self.used |= matches!(event, Event::Updated { update, .. } if update.weight > 0.0);
        self.out.tell(event);
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        self.out.wants_steps()
    }
}

impl Stage for Nested {
    fn row(&mut self, input: usize, time: Time, row: &[f64], _: Option<&View<'_>>, out: &mut Emitter<'_>) {
        let Some(&stream) = self.streams.get(input) else { return };
        let everything = 0..row.len();
        let fed = Row {
            stream,
            time,
            values: row,
            number: out.row_number(),
            disturbed: if out.is_disturbed() {
                core::slice::from_ref(&everything)
            } else {
                &[]
            },
            arrival: None,
        };
        let before = self.runner.belief().time;
        let mut teller = Teller { out, used: false };
        // The widths are those of the ports, and an observer that stops is kept by the emitter.
        let fed = self.runner.feed(&fed, &mut teller);
        let used = teller.used;
        if fed.is_ok() && self.is_due(time, before, used) {
            self.fill(row);
            out.emit(time, &self.row);
        }
    }

    fn waits_for(&self) -> Vec<(String, String)> {
        if self.runner.started() {
            return Vec::new();
        }
        self.runner.waits_for()
    }

    fn finish(&mut self, out: &mut Emitter<'_>) {
        let mut teller = Teller { out, used: false };
        // An observer that stops is kept by the emitter.
        self.runner.finish(&mut teller).unwrap_or_default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::tests::{Direct, Still, declare, second};
    use crate::filter::{Backend, Estimator, Filter};
    use crate::gate::Open;
    use crate::linear::Transition;
    use crate::loss::Quadratic;
    use crate::model::{Input, Process, SignalsOut, Size};
    use crate::runner::{Discard, Noise, Port, Sensor, StageUnit};
    use crate::state::{Dynamics, LayoutBuilder, Scalar, Signal, Slot};
    use crate::time::nanos;
    use alloc::sync::Arc;
    use nalgebra::Matrix1;

    /// Moves at the rate that its input gives, and gives that rate as a signal.
    #[derive(Debug)]
    struct Moving(Slot<Scalar>, Signal<Scalar>);

    impl Process for Moving {
        fn input_dim(&self) -> usize {
            1
        }
        fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
            self.0.write(&(self.0.read(x) + input.sample[0] * dt), x);
        }
        fn linearise(&self, _: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
            out.noise(self.0, self.0, &Matrix1::new(0.1 * dt));
        }
        fn signals(&self, _: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
            out.set(self.1, &input.sample[0]);
        }
    }

    fn position(stream: StreamId, delay: i64, x: Slot<Scalar>) -> Sensor {
        Sensor {
            name: "position".to_owned(),
            model: Arc::new(Direct(x)),
            port: Port {
                stream,
                columns: vec![0],
                delay,
            },
            offset: None,
            constant: Vec::new(),
            noise: Noise::diagonal(&[0.5]),
            quality: None,
            gate: Box::new(Open),
            loss: Arc::new(Quadratic),
            switch: None,
        }
    }

    /// Driven by stream 0, column 1; a position on stream 1.
    fn inside(delay: i64) -> Runner {
        let mut b = LayoutBuilder::new();
        let x = declare::<Scalar>(&mut b, "x", 0.0, &[1.0], Dynamics::Process);
        let rate = b.signal("rate").unwrap();
        let process: Arc<dyn Process> = Arc::new(Moving(x, rate));
        let filter = Filter::new(Arc::new(b.finish()), process.clone(), Backend::default(), Size::same(1));
        let mut runner = Runner::new(Box::new(filter), process, 0.0);
        runner.add_stream("rates", 2);
        runner.add_stream("positions", 1);
        runner.set_input(Port {
            stream: 0,
            columns: vec![1],
            delay: 0,
        });
        runner.add_sensor(position(1, delay, x));
        runner
    }

    /// Its value and 1σ, its signal and the first number of its row, seen by a filter outside as a
    /// measurement whose R is the filter's own.
    fn outside(stage: Box<dyn Stage>, delay: i64) -> Runner {
        let mut b = LayoutBuilder::new();
        let x = declare::<Scalar>(&mut b, "x", 0.0, &[1.0], Dynamics::RandomWalk { psd: vec![0.01] });
        let process: Arc<dyn Process> = Arc::new(Still);
        let filter = Filter::new(Arc::new(b.finish()), process.clone(), Backend::default(), Size::same(1));
        let mut runner = Runner::new(Box::new(filter), process, 0.0);
        runner.add_stream("rates", 2);
        runner.add_stream("positions", 1);
        runner.add_stream("filter", 4);
        let all = |stream, width, delay| Port {
            stream,
            columns: (0..width).collect(),
            delay,
        };
        runner.add_stage(StageUnit {
            name: "filter".to_owned(),
            stage,
            inputs: vec![all(0, 2, 0), all(1, 1, delay)],
            output: 2,
        });
        let mut sensor = position(2, 0, x);
        sensor.noise = Noise {
            covariance: vec![0.0],
            sigma_columns: vec![1],
            scale: 1.0,
        };
        runner.add_sensor(sensor);
        runner
    }

    fn nested() -> Box<dyn Stage> {
        let runner = inside(0);
        let block = runner.estimator().layout().block("x").unwrap().clone();
        let outlets = vec![
            Outlet::State(block.clone()),
            Outlet::Sigma(block),
            Outlet::Signal(0..1),
            Outlet::Passed(0..1),
        ];
        Box::new(Nested::new(runner, vec![0, 1], outlets))
    }

    /// Rates ten times a second, numbered; a position every second, between two of them.
    fn rows() -> Vec<(StreamId, Time, Vec<f64>)> {
        let mut rows = Vec::new();
        for k in 0..100_i64 {
            let time = second(0).shifted(k * nanos(0.1));
            rows.push((0, time, vec![k as f64, (k as f64 * 0.3).sin()]));
            if k % 10 == 3 {
                rows.push((1, time.shifted(nanos(0.05)), vec![0.1 * k as f64]));
            }
        }
        rows
    }

    fn feed(runner: &mut Runner, rows: &[(StreamId, Time, Vec<f64>)], observer: &mut dyn Observer) {
        for (stream, time, row) in rows {
            runner.feed(&Row::new(*stream, *time, row), observer).unwrap();
        }
    }

    fn sigma(belief: &Belief) -> f64 {
        belief.covariance.to_dense()[0].sqrt()
    }

    /// The updates and estimates in the events, as text that shows every bit.
    fn told(event: &Event<'_>) -> Option<String> {
        match event {
            Event::Updated { update, time, .. } => Some(format!("{time} {:?} {:?} {:?}", update.value, update.noise, update.nis)),
            Event::Estimate { belief } => Some(format!("{} {:?} {:?}", belief.time, belief.x, sigma(belief))),
            _ => None,
        }
    }

    #[test]
    fn a_filter_inside_a_stage_does_what_it_does_alone_delays_included() {
        for delay in [0, nanos(0.25)] {
            let (mut alone, mut nested_events, mut emitted) = (Vec::new(), Vec::new(), Vec::new());
            let mut runner = inside(delay);
            feed(&mut runner, &rows(), &mut |e: &Event<'_>| alone.extend(told(e)));
            runner.finish(&mut |e: &Event<'_>| alone.extend(told(e))).unwrap();
            let mut outer = outside(nested(), delay);
            let mut observer = |e: &Event<'_>| match e {
                Event::Nested { stage, event } => {
                    assert_eq!(*stage, "filter");
                    nested_events.extend(told(event));
                }
                Event::Updated { update, time, .. } => emitted.push((*time, update.value[0], update.noise[0])),
                Event::Discarded {
                    consumer,
                    time,
                    why: Discard::Late { .. },
                    ..
                } => panic!("{consumer} at {time} is late"),
                _ => {}
            };
            feed(&mut outer, &rows(), &mut observer);
            outer.finish(&mut observer).unwrap();
            assert_eq!(nested_events, alone, "delay {delay}");
            // Every rate but the first, which opens the interval, and the second, which starts the filter outside.
            assert_eq!(emitted.len(), 98);
            let (time, value, variance) = *emitted.last().unwrap();
            let belief = runner.belief();
            assert_eq!((time, value, variance), (belief.time, belief.x[0], sigma(belief).powi(2)));
        }
    }

    #[test]
    fn signals_and_numbers_that_are_passed_are_those_of_the_driving_row() {
        let mut stage = nested();
        for (stream, time, row) in rows() {
            let mut out = Emitter::default();
            stage.row(stream, time, &row, None, &mut out);
            let emitted: Vec<_> = out.rows().map(|(t, row)| (t, row[2], row[3])).collect();
            // The filter starts at the first rate and reports no interval before it.
            let due = stream == 0 && row[0] > 0.0;
            assert_eq!(emitted, if due { vec![(time, row[1], row[0])] } else { vec![] });
        }
    }

    #[test]
    fn a_runner_with_the_memory_of_a_filter_inside_continues_bit_for_bit() {
        let mut original = outside(nested(), nanos(0.25));
        let rows = rows();
        feed(&mut original, &rows[..47], &mut |_: &Event<'_>| ());
        let mut twin = outside(nested(), nanos(0.25));
        crate::testing::check_memory(&mut original, &mut twin).unwrap();
        let mut ends = [Vec::new(), Vec::new()];
        for (runner, end) in [&mut original, &mut twin].into_iter().zip(&mut ends) {
            let mut observer = |e: &Event<'_>| end.push(format!("{e:?}"));
            feed(runner, &rows[47..], &mut observer);
            runner.finish(&mut observer).unwrap();
        }
        assert_eq!(ends[0], ends[1]);
    }

    #[test]
    fn an_observer_that_stops_at_an_event_inside_stops_the_run() {
        struct Stops;
        impl Observer for Stops {
            fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
                match event {
                    Event::Nested { .. } => Err("the disk is full".into()),
                    _ => Ok(()),
                }
            }
        }
        let mut runner = outside(nested(), 0);
        let result = rows()
            .iter()
            .try_for_each(|(stream, time, row)| runner.feed(&Row::new(*stream, *time, row), &mut Stops));
        assert_eq!(result.unwrap_err().to_string(), "the disk is full");
    }

    #[test]
    fn a_heading_is_told_with_the_sigma_about_down_and_the_tilt_about_north_and_east() {
        let mut b = LayoutBuilder::new();
        let q = so3::from_rpy(0.3, -1.2, 2.0);
        // The 1σ are 1, 2 and 3 hundredths about the body axes.
        declare::<Scalar>(&mut b, "other", 0.0, &[9.0], Dynamics::Constant);
        declare::<Attitude>(&mut b, "attitude", q, &[0.01, 0.02, 0.03], Dynamics::Constant);
        let layout = Arc::new(b.finish());
        let block = layout.block("attitude").unwrap().clone();
        let estimator = Filter::new(layout, Arc::new(Still), Backend::default(), Size::same(1));
        let c = so3::rotation(&q);
        let sigma = |axis: usize| (0..3).map(|i| (c[(axis, i)] * 0.01 * (i + 1) as f64).powi(2)).sum::<f64>().sqrt();
        let wanted = [2.0, sigma(2), sigma(0), sigma(1)];
        for (found, wanted) in heading(estimator.belief(), &block).iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-15, "{found} {wanted}"); // rounding
        }
    }

    #[test]
    fn an_outlet_is_as_wide_as_what_it_gives() {
        let mut b = LayoutBuilder::new();
        declare::<crate::state::Attitude>(
            &mut b,
            "attitude",
            nalgebra::UnitQuaternion::identity(),
            &[1.0; 3],
            Dynamics::Process,
        );
        let layout = b.finish();
        let attitude = || layout.blocks()[0].clone();
        let outlets = [
            (Outlet::State(attitude()), 4),
            (Outlet::Sigma(attitude()), 3),
            (Outlet::Heading(attitude()), 4),
            (Outlet::Signal(2..7), 5),
            (Outlet::Passed(1..3), 2),
        ];
        outlets
            .iter()
            .for_each(|(outlet, width)| assert_eq!(outlet.width(), *width, "{outlet:?}"));
    }
}
