//! Sensors whose time offset is estimated: a body on a line, with fixes that come late by an unknown time.

use super::*;
use crate::belief::Belief;
use crate::filter::tests::{Direct, Track, declare};
use crate::filter::{Backend, Filter};
use crate::gate::{Gate, OnlyWith, Open};
use crate::loss::Quadratic;
use crate::model::{Process, Size};
use crate::state::{Dynamics, LayoutBuilder, Quantity, Scalar, Slot, View};
use crate::time::{Time, nanos};
use alloc::sync::Arc;

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
        switch: None,
    }
}

/// Accelerations on stream 0; position and velocity on stream 1. `sensors` are made of the slots of position and
/// velocity, and of those of their offsets.
fn runner_of(buffer: f64, sensors: impl FnOnce([Slot<Scalar>; 2], [Slot<Scalar>; 2]) -> Vec<Sensor>) -> Runner {
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
    sensors([position, velocity], offsets)
        .into_iter()
        .for_each(|s| runner.add_sensor(s));
    runner
}

/// Position and velocity are late by an unknown time, between `least` and `most`.
fn allowing(buffer: f64, least: f64, most: f64) -> Runner {
    runner_of(buffer, |[position, velocity], offsets| {
        let mut sensors = vec![
            sensor("velocity", (1, 1), velocity, offsets[0], Some(1)),
            sensor("position", (1, 0), position, offsets[1], None),
        ];
        for s in &mut sensors {
            s.port.delay = nanos(most);
            s.offset.iter_mut().for_each(|o| (o.least, o.most) = (least, most));
        }
        sensors
    })
}

fn runner(buffer: f64) -> Runner {
    allowing(buffer, -MOST, MOST)
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
        let runner = || allowing(0.5, -most, most);
        // The buffer, the longest delay, and from the earliest of the follower to the latest of its leader.
        assert_eq!(nanos(runner().lag()), nanos(0.5 + most + 2.0 * most));
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
        let (_, used) = fed(&mut allowing(0.0, least, most), &rows());
        let (time, stamp) = used.last().unwrap();
        assert_eq!(stamp.nanos() - time.nanos(), nanos(edge));
    }
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
    let delay = nanos(0.6);
    // Rows come in the order of the runner outside, by the earliest time at which they may be valid.
    let inside = runner_of(0.0, |[_, velocity], offsets| {
        let mut sensor = sensor("velocity", (1, 1), velocity, offsets[0], None);
        sensor.port.delay = 0;
        vec![sensor]
    });
    let block = inside.estimator().layout().block("late").unwrap().clone();
    let mut outer = runner_of(0.0, |_, _| Vec::new());
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
