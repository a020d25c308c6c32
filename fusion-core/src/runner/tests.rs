//! A sensor that is used only with another: scalars, a random walk seen by both.

use super::*;
use crate::filter::tests::{Direct, Still, Track, declare, second};
use crate::filter::{Backend, Filter, Verdict};
use crate::gate::{Gate, Mode, Nis, OnlyWith, Open, Recovery};
use crate::loss::Quadratic;
use crate::model::{Measurement, Process, Size, Undefined};
use crate::state::{Dynamics, LayoutBuilder, Scalar, Slot, View};
use crate::time::{Time, nanos};
use alloc::sync::Arc;

const WILD: f64 = 1000.0;

/// The outcome of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Outcome {
    sensor: usize,
    time: Time,
    verdict: Verdict,
    mode: Mode,
    nis: f64,
    statistic: f64,
    threshold: f64,
}

impl Outcome {
    fn is_used(&self) -> bool {
        self.verdict == Verdict::Accepted
    }
}

fn gate(gated: bool) -> Box<dyn Gate> {
    if gated {
        Box::new(Nis::new(0.99, Recovery::default()))
    } else {
        Box::new(Open)
    }
}

/// Sensors of one random walk, each a port with the number of its leader, gated where `gated`.
fn runner(sensors: &[(Port, Option<usize>, bool)], widths: &[usize], buffer: f64) -> Runner {
    runner_with(sensors, widths, buffer, |_, x| Arc::new(Direct(x)))
}

/// The same with the `model` of each sensor, by its number.
fn runner_with(
    sensors: &[(Port, Option<usize>, bool)],
    widths: &[usize],
    buffer: f64,
    model: impl Fn(usize, Slot<Scalar>) -> Arc<dyn Measurement>,
) -> Runner {
    let mut b = LayoutBuilder::new();
    let x = declare::<Scalar>(&mut b, "x", 0.0, &[1.0], Dynamics::RandomWalk { psd: vec![0.01] });
    let process: Arc<dyn Process> = Arc::new(Still);
    let filter = Filter::new(Arc::new(b.finish()), process.clone(), Backend::default(), Size::same(1));
    let mut runner = Runner::new(Box::new(filter), process, buffer);
    for (i, width) in widths.iter().enumerate() {
        runner.add_stream(&i.to_string(), *width);
    }
    for (i, (port, only_with, gated)) in sensors.iter().enumerate() {
        runner.add_sensor(Sensor {
            name: i.to_string(),
            model: model(i, x),
            port: port.clone(),
            offset: None,
            constant: Vec::new(),
            noise: Noise::diagonal(&[1.0]),
            quality: None,
            gate: match only_with {
                None => gate(*gated),
                Some(leader) => Box::new(OnlyWith::new(*leader, 10.0, gate(*gated))),
            },
            loss: Arc::new(Quadratic),
            switch: None,
        });
    }
    runner
}

fn port(stream: StreamId, column: usize, delay: f64) -> Port {
    Port {
        stream,
        columns: vec![column],
        delay: nanos(delay),
    }
}

/// Feeds rows in this order. Returns the outcomes of the measurements, and the state at the end.
fn fed(runner: &mut Runner, rows: &[(StreamId, Time, Vec<f64>)]) -> (Vec<Outcome>, Vec<f64>) {
    let mut outcomes = Vec::new();
    let mut observer = |event: &Event<'_>| match event {
        Event::Updated { sensor, update, time, .. } => outcomes.push(Outcome {
            sensor: *sensor,
            time: *time,
            verdict: update.verdict,
            mode: update.mode,
            nis: update.nis,
            statistic: update.statistic,
            threshold: update.threshold,
        }),
        Event::Discarded {
            consumer,
            time,
            why: Discard::Late { .. },
            ..
        } => panic!("{consumer} at {time} is late"),
        _ => {}
    };
    for (stream, time, row) in rows {
        runner.feed(&Row::new(*stream, *time, row), &mut observer).unwrap();
    }
    runner.finish(&mut observer).unwrap();
    (outcomes, runner.belief().x.clone())
}

/// The leader's value at second `k`: sometimes wild, and rejected for a while.
fn leading(k: i64) -> f64 {
    match k {
        3 | 6 => WILD,
        // Seven that contradict each other.
        10..=16 => WILD * (k % 2 * 2 - 1) as f64,
        _ => 0.0,
    }
}

/// The seconds at which a leader so led is not used: two more, until three have passed its gate.
const REFUSED: [i64; 11] = [3, 6, 10, 11, 12, 13, 14, 15, 16, 17, 18];

#[test]
fn a_measurement_is_rejected_with_its_leader_before_its_own_gate_is_asked() {
    let mut runner = runner(&[(port(0, 0, 0.0), None, true), (port(0, 1, 0.0), Some(0), true)], &[2], 0.0);
    // The follower is wild with the leader, and at 25 alone.
    let follower = |k: i64| if k == 25 { WILD } else { leading(k) };
    let rows: Vec<_> = (0..30).map(|k| (0, second(k), vec![leading(k), follower(k)])).collect();
    let (outcomes, _) = fed(&mut runner, &rows);
    let of = |sensor: usize| outcomes.iter().filter(move |o| o.sensor == sensor);
    let unused = |sensor: usize| of(sensor).filter(|o| !o.is_used()).map(|o| o.time).collect::<Vec<_>>();
    assert_eq!(unused(0), REFUSED.map(second));
    // Asked, its own gate would be in denial at 19 and 20 as well.
    assert_eq!(
        unused(1),
        [&REFUSED[..], &[25]].concat().into_iter().map(second).collect::<Vec<_>>()
    );
    for (leader, follower) in of(0).zip(of(1)) {
        assert_eq!((leader.time, leader.mode), (follower.time, follower.mode));
        if !leader.is_used() {
            assert!(follower.nis.is_finite());
            assert_eq!((follower.statistic, follower.threshold), (follower.nis, f64::INFINITY));
        }
    }
    assert!(of(1).any(|o| o.mode == Mode::Denied));
}

#[test]
fn the_latest_verdict_of_the_leader_holds_until_its_next_and_along_a_chain() {
    let ports = [
        (port(0, 0, 0.0), None, true),
        (port(1, 0, 0.0), Some(0), false),
        (port(1, 0, 0.0), Some(1), false),
        (port(1, 0, 0.0), None, false),
    ];
    let mut runner = runner(&ports, &[1, 1], 0.0);
    let mut rows = Vec::new();
    for k in 0..30 {
        rows.push((0, second(k), vec![leading(k)]));
        rows.extend([0.0, 0.4, 0.8].map(|s| (1, second(k).shifted(nanos(s)), vec![0.0])));
    }
    // Before the leader's first, nothing is held against its followers.
    rows.insert(0, (1, second(-1), vec![0.0]));
    rows.insert(0, (1, second(-2), vec![0.0]));
    let (outcomes, _) = fed(&mut runner, &rows);
    for o in outcomes.iter().filter(|o| o.sensor > 0) {
        let is_refused = o.sensor < 3 && REFUSED.contains(&o.time.nanos().div_euclid(1_000_000_000));
        assert_eq!(o.is_used(), !is_refused, "{o:?}");
    }
    // Three rows of three sensors a second, and two rows before; the first of these starts the filter.
    assert_eq!(outcomes.iter().filter(|o| o.sensor > 0).count(), 9 * 30 + 3);
}

#[test]
fn a_leader_that_falls_silent_after_a_refusal_holds_its_followers_for_ten_seconds() {
    let mut runner = runner(&[(port(0, 0, 0.0), None, true), (port(1, 0, 0.0), Some(0), false)], &[1, 1], 0.0);
    let mut rows = Vec::new();
    for k in 0..30 {
        if k <= 3 {
            rows.push((0, second(k), vec![leading(k)]));
        }
        rows.push((1, second(k), vec![0.0]));
    }
    let (outcomes, _) = fed(&mut runner, &rows);
    let refused: Vec<Time> = outcomes.iter().filter(|o| o.sensor == 1 && !o.is_used()).map(|o| o.time).collect();
    assert_eq!(refused, (3..13).map(second).collect::<Vec<_>>());
}

/// The same rows in three orders of arrival, under either numbering of the two sensors.
#[test]
fn of_rows_of_one_stamp_the_leader_is_judged_first_in_any_order_of_arrival_and_declaration() {
    // The leader's rows are valid `delay` before their stamp: every second, as the follower's are.
    for (first, delay) in [(0, 0.0), (1, 0.0), (0, 0.3), (1, 0.3)] {
        let mut ports = [(port(0, 0, delay), None, true), (port(1, 0, 0.0), Some(first), false)];
        ports.rotate_left(first);
        let leader = |k: i64| (0, second(k).shifted(nanos(delay)), vec![leading(k)]);
        let follower = |k: i64| (1, second(k), vec![0.5]);
        let leader_first: Vec<_> = (0..30).flat_map(|k| [leader(k), follower(k)]).collect();
        let follower_first: Vec<_> = (0..30).flat_map(|k| [follower(k), leader(k)]).collect();
        let wanted = fed(&mut runner(&ports, &[1, 1], 0.0), &leader_first);
        let unused = wanted.0.iter().filter(|o| o.sensor != first && !o.is_used()).map(|o| o.time);
        assert_eq!(unused.collect::<Vec<_>>(), REFUSED.map(second));
        assert_eq!(fed(&mut runner(&ports, &[1, 1], 0.0), &follower_first), wanted);
        // Up to 1.8 s late, by a fixed law of their number.
        let mut arrivals: Vec<_> = leader_first.iter().enumerate().collect();
        arrivals.sort_by_key(|(i, (_, time, _))| time.shifted((*i as i64 * 7919).rem_euclid(19) * nanos(0.1)));
        let shuffled: Vec<_> = arrivals.into_iter().map(|(_, row)| row.clone()).collect();
        assert_ne!(shuffled, leader_first);
        assert_eq!(fed(&mut runner(&ports, &[1, 1], 2.0), &shuffled), wanted);
    }
}

/// Both read the same rows, with no time for a second thought.
#[test]
fn of_one_row_the_leader_is_judged_first_under_either_number() {
    let mut runner = runner(&[(port(0, 1, 0.0), Some(1), false), (port(0, 0, 0.0), None, true)], &[2], 0.0);
    let rows: Vec<_> = (0..30).map(|k| (0, second(k), vec![leading(k), 0.0])).collect();
    let (outcomes, _) = fed(&mut runner, &rows);
    let unused = outcomes.iter().filter(|o| o.sensor == 0 && !o.is_used()).map(|o| o.time);
    assert_eq!(unused.collect::<Vec<_>>(), REFUSED.map(second));
    assert!(runner.lag() == 0.0, "one stream is not held back");
}

/// A measurement that has no value anywhere.
#[derive(Debug)]
struct Nowhere;

impl Measurement for Nowhere {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, _: &View<'_>, _: &mut [f64]) -> Result<(), Undefined> {
        Err(Undefined("anywhere"))
    }
    fn jacobian(&self, _: &View<'_>, _: &mut crate::linear::Jacobian) -> Result<(), Undefined> {
        Ok(())
    }
}

#[test]
fn a_leader_that_could_not_be_used_takes_its_follower_with_it() {
    let ports = [(port(0, 0, 0.0), None, false), (port(0, 0, 0.0), Some(0), false)];
    let mut runner = runner_with(&ports, &[1], 0.0, |sensor, x| match sensor {
        0 => Arc::new(Nowhere),
        _ => Arc::new(Direct(x)),
    });
    let (outcomes, _) = fed(&mut runner, &[(0, second(0), vec![0.0]), (0, second(1), vec![0.0])]);
    let [leader, follower] = outcomes[..] else { panic!("{outcomes:?}") };
    assert_eq!(leader.verdict, Verdict::Undefined(Undefined("anywhere")));
    assert_eq!((follower.verdict, follower.mode), (Verdict::Rejected, Mode::Track));
    assert!(follower.statistic.is_finite(), "{follower:?}");
}

/// Of one row the follower is valid first. The leader's verdict on the same row counts, not that on the
/// row before.
#[test]
fn a_follower_that_is_valid_before_its_leader_waits_for_the_verdict_on_its_own_row() {
    for delay in [0.2, 1.5] {
        let ports = [(port(0, 0, 0.0), None, true), (port(0, 1, delay), Some(0), false)];
        let rows: Vec<_> = (0..30).map(|k| (0, second(k), vec![leading(k), 0.0])).collect();
        let (outcomes, x) = fed(&mut runner(&ports, &[2], 0.0), &rows);
        let unused = outcomes.iter().filter(|o| o.sensor == 1 && !o.is_used());
        let stamps: Vec<_> = unused.map(|o| o.time.shifted(nanos(delay))).collect();
        assert_eq!(stamps, REFUSED.map(second), "{delay}");
        // A wild value would have left its trace, had a copy that looks ahead changed the original.
        assert!(x[0].abs() < 1.0, "{x:?}");
        // In any order of arrival within the buffer of 4 s.
        let mut arrivals: Vec<_> = rows.iter().enumerate().collect();
        arrivals.sort_by_key(|(i, (_, time, _))| time.shifted(nanos([1.6, 0.0, 3.2][i % 3])));
        let shuffled: Vec<_> = arrivals.into_iter().map(|(_, row)| row.clone()).collect();
        assert_ne!(shuffled, rows);
        let wanted = fed(&mut runner(&ports, &[2], 4.0), &rows);
        assert_eq!(fed(&mut runner(&ports, &[2], 4.0), &shuffled), wanted);
        assert_eq!(wanted, (outcomes, x));
    }
}

#[test]
fn an_estimate_is_told_once_per_epoch_after_the_measurements_of_its_time() {
    let mut runner = runner(&[(port(0, 0, 0.0), None, false), (port(1, 0, 0.0), None, false)], &[1, 1], 0.0);
    let mut told: Vec<(&str, Time)> = Vec::new();
    let mut listen = |event: &Event<'_>| match event {
        Event::Estimate { belief } => told.push(("estimate", belief.time)),
        Event::Updated { time, .. } => told.push(("updated", *time)),
        _ => {}
    };
    for k in 0..4 {
        runner.feed(&Row::new(0, second(k), &[0.0]), &mut listen).unwrap();
        runner.feed(&Row::new(1, second(k), &[1.0]), &mut listen).unwrap();
    }
    runner.finish(&mut listen).unwrap();
    // The rows of second 0 start the filter.
    let wanted: Vec<_> = (1..4)
        .flat_map(|k| ["updated", "updated", "estimate"].map(|what| (what, second(k))))
        .collect();
    assert_eq!(told, wanted);
}

#[test]
fn a_measurement_tells_what_was_measured_predicted_and_where_it_came_from() {
    let mut runner = runner(&[(port(0, 1, 0.25), None, false)], &[2], 0.0);
    let mut told = Vec::new();
    let mut listen = |event: &Event<'_>| {
        if let Event::Updated { update, time, row, .. } = event {
            told.push((update.value[0], update.predicted[0], update.noise[0], *time, *row));
        }
    };
    for k in 0..3 {
        let whole = 0..k as usize;
        let row = Row {
            number: 10 + k as u64,
            disturbed: core::slice::from_ref(&whole),
            ..Row::new(0, second(k), &[5.0, 7.0])
        };
        runner.feed(&row, &mut listen).unwrap();
    }
    runner.finish(&mut listen).unwrap();
    let (value, predicted, noise, time, row) = told[1];
    assert_eq!((value, noise, time), (7.0, 1.0, second(2).shifted(-nanos(0.25))));
    // The first update has moved the estimate towards 7.
    assert!(told[0].1 == 0.0 && predicted > 3.0);
    let wanted = RowId {
        stream: 0,
        number: 12,
        stamp: second(2),
        arrival: second(2),
        disturbed: true,
    };
    assert_eq!(row, wanted);
    // Only the first column of row 11 was disturbed, which the sensor does not read.
    assert!(!told[0].4.disturbed);
}

#[test]
fn an_observer_that_fails_stops_the_run_and_the_next_is_not_told() {
    #[derive(Debug)]
    struct Full;
    impl Observer for Full {
        fn on(&mut self, _: &Event<'_>) -> Result<(), Halt> {
            Err("disk full".into())
        }
    }
    let mut runner = runner(&[(port(0, 0, 0.0), None, false)], &[1], 0.0);
    let mut told = 0;
    let mut count = |_: &Event<'_>| told += 1;
    let mut observers = Observers::default();
    let mut full = Full;
    observers.add(&mut full);
    observers.add(&mut count);
    let error = runner.feed(&Row::new(0, second(0), &[0.0]), &mut observers).unwrap_err();
    assert_eq!(error.to_string(), "disk full");
    assert_eq!(told, 0);
}

#[test]
fn a_runner_with_the_memory_of_another_continues_bit_for_bit() {
    let ports = [(port(0, 0, 0.0), None, true), (port(0, 1, 0.2), Some(0), true)];
    let rows: Vec<_> = (0..40).map(|k| (0, second(k), vec![leading(k), leading(k) * 0.5])).collect();
    for cut in [1, 7, 14, 25] {
        let mut original = runner(&ports, &[2], 0.5);
        let mut nobody = |_: &Event<'_>| {};
        for (stream, time, row) in &rows[..cut] {
            original.feed(&Row::new(*stream, *time, row), &mut nobody).unwrap();
        }
        let mut twin = runner(&ports, &[2], 0.5);
        crate::testing::check_memory(&mut original, &mut twin).unwrap();
        assert_eq!(fed(&mut original, &rows[cut..]), fed(&mut twin, &rows[cut..]), "cut at {cut}");
    }
}

#[test]
fn looking_ahead_sees_all_that_is_valid_by_then_in_any_order_of_arrival() {
    // The third sensor is late as well, has no gate, and moves the estimate about. So the decision of the leader's
    // gate depends on rows of this sensor that are stamped after the leader's row.
    let ports = [
        (port(0, 0, 0.0), None, true),
        (port(0, 1, 1.5), Some(0), false),
        (port(1, 0, 1.5), None, false),
    ];
    let mut rows = Vec::new();
    for k in 0..60 {
        rows.push((0, second(k), vec![3.0 * ((k * 7) % 5 - 2) as f64, 0.0]));
        rows.push((1, second(k).shifted(nanos(0.4)), vec![4.0 * ((k * 3) % 7 - 3) as f64]));
    }
    let wanted = fed(&mut runner(&ports, &[2, 1], 4.0), &rows);
    let refused = |sensor| wanted.0.iter().filter(move |o| o.sensor == sensor && !o.is_used()).count();
    assert!(refused(0) > 5 && refused(1) > 5, "{} {}", refused(0), refused(1));
    for law in [7919, 104_729, 1_299_709] {
        let mut arrivals: Vec<_> = rows.iter().enumerate().collect();
        arrivals.sort_by_key(|(i, (_, time, _))| time.shifted((*i as i64 * law).rem_euclid(39) * nanos(0.1)));
        let shuffled: Vec<_> = arrivals.into_iter().map(|(_, row)| row.clone()).collect();
        assert_eq!(fed(&mut runner(&ports, &[2, 1], 4.0), &shuffled), wanted, "{law}");
    }
}

#[test]
fn a_measurement_inside_an_interval_of_the_input_splits_it() {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 0.0, &[1.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 2.0, &[1.0], Dynamics::Process);
    let process: Arc<dyn Process> = Arc::new(Track {
        position,
        velocity,
        sigma: 0.1,
    });
    let filter = Filter::new(Arc::new(b.finish()), process.clone(), Backend::default(), Size::same(1));
    let mut runner = Runner::new(Box::new(filter), process.clone(), 0.0);
    runner.add_stream("imu", 1);
    runner.add_stream("fix", 1);
    runner.set_input(port(0, 0, 0.0));
    runner.add_sensor(Sensor {
        name: "fix".to_owned(),
        model: Arc::new(Direct(position)),
        port: port(1, 0, 0.0),
        offset: None,
        constant: Vec::new(),
        // So coarse that it does not move the estimate.
        noise: Noise::diagonal(&[1e9]),
        quality: None,
        gate: Box::new(Open),
        loss: Arc::new(Quadratic),
        switch: None,
    });
    let mut predicted = Vec::new();
    let mut listen = |event: &Event<'_>| {
        if let Event::Updated { update, time, .. } = event {
            predicted.push((time.seconds(), update.predicted[0]));
        }
    };
    for (stream, time, value) in [
        (0, 0.0, 0.0),
        (1, 0.25, 0.0),
        (1, 0.75, 0.0),
        (0, 1.0, 0.0),
        (0, 2.0, 0.0),
        (1, 1.5, 0.0),
    ] {
        let row = [value];
        runner.feed(&Row::new(stream, Time::from_seconds(time), &row), &mut listen).unwrap();
    }
    runner.finish(&mut listen).unwrap();
    // At 2 m/s; the fix at 1.5 s comes after the end of its interval and is late. 1e-9: the residue of a noise of
    // 1e9.
    let wanted = [(0.25, 0.5), (0.75, 1.5)];
    assert_eq!(predicted.len(), wanted.len());
    for (found, wanted) in predicted.iter().zip(wanted) {
        assert!(found.0 == wanted.0 && (found.1 - wanted.1).abs() < 1e-9, "{found:?} for {wanted:?}");
    }
}
