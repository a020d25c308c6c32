//! A sensor that rows of another stream switch: a random walk, seen by one sensor.

use super::*;
use crate::filter::tests::{Direct, Still, declare, second};
use crate::filter::{Backend, Filter};
use crate::gate::Open;
use crate::loss::Quadratic;
use crate::memory::{recall, save};
use crate::model::{Process, Size};
use crate::state::{Dynamics, LayoutBuilder, Scalar};
use crate::time::Time;
use alloc::sync::Arc;

const FIXES: StreamId = 0;
const COMMANDS: StreamId = 1;
/// The declared 1σ of a fix.
const SIGMA: f64 = 2.0;

fn runner() -> Runner {
    let mut b = LayoutBuilder::new();
    let x = declare::<Scalar>(&mut b, "x", 0.0, &[1.0], Dynamics::RandomWalk { psd: vec![0.01] });
    let process: Arc<dyn Process> = Arc::new(Still);
    let filter = Filter::new(Arc::new(b.finish()), process.clone(), Backend::default(), Size::same(1));
    let mut runner = Runner::new(Box::new(filter), process, 0.0);
    runner.add_stream("fixes", 1);
    runner.add_stream("commands", 2);
    let port = |stream, columns| Port { stream, columns, delay: 0 };
    runner.add_sensor(Sensor {
        name: "fix".into(),
        model: Arc::new(Direct(x)),
        port: port(FIXES, vec![0]),
        offset: None,
        constant: Vec::new(),
        noise: Noise::diagonal(&[SIGMA]),
        quality: None,
        gate: Box::new(Open),
        loss: Arc::new(Quadratic),
        switch: Some(Switch {
            port: port(COMMANDS, vec![0, 1]),
            has_use: true,
            has_noise: true,
        }),
    });
    runner
}

/// The runner that goes back for rows up to three seconds late.
fn rewinding() -> Runner {
    let mut settled = runner();
    settled.rewind(runner(), 3.0, 0.5);
    settled
}

/// The seconds of the fixes that were used, each with its 1σ, of those that were not, and of refused commands.
type Heard = (Vec<(i64, f64)>, Vec<i64>, Vec<i64>);

/// Feeds rows (stream, second, numbers) in this order; `ends` ends the log.
fn fed(runner: &mut Runner, rows: &[(StreamId, i64, &[f64])], ends: bool) -> Heard {
    let (mut used, mut off, mut refused) = (Vec::new(), Vec::new(), Vec::new());
    let whole = |time: &Time| time.nanos() / 1_000_000_000;
    let mut observer = |event: &Event<'_>| match event {
        Event::Updated { update, time, .. } => used.push((whole(time), update.noise[0].sqrt())),
        Event::Discarded {
            consumer: "fix",
            time,
            why: Discard::SwitchedOff,
            ..
        } => off.push(whole(time)),
        Event::Discarded {
            input: 1,
            time,
            why: Discard::OutOfRange { column: 1 },
            ..
        } => refused.push(whole(time)),
        Event::Discarded { time, why, .. } => assert_eq!((*why, *time), (Discard::BeforeStart, second(0))),
        _ => {}
    };
    for &(stream, time, row) in rows {
        runner.feed(&Row::new(stream, second(time), row), &mut observer).unwrap();
    }
    if ends {
        runner.finish(&mut observer).unwrap();
    }
    (used, off, refused)
}

const NAN: f64 = f64::NAN;

/// Off from 2 s on; on with three times the 1σ from 4 s on. The commands at 6 s to 8 s change nothing.
const ROWS: [(StreamId, i64, &[f64]); 15] = [
    (FIXES, 0, &[0.0]),
    (FIXES, 1, &[0.1]),
    (COMMANDS, 2, &[0.0, NAN]),
    (FIXES, 2, &[0.2]),
    (FIXES, 3, &[0.3]),
    (FIXES, 4, &[0.4]),
    (COMMANDS, 4, &[1.0, 3.0]),
    (FIXES, 5, &[0.5]),
    (COMMANDS, 6, &[NAN, NAN]),
    (FIXES, 6, &[0.6]),
    (COMMANDS, 7, &[NAN, -1.0]),
    (FIXES, 7, &[0.7]),
    (COMMANDS, 8, &[NAN, 0.0]),
    (FIXES, 8, &[0.8]),
    (FIXES, 9, &[0.9]),
];

#[test]
fn a_command_holds_from_its_time_on_until_the_next_one() {
    let (used, off, refused) = fed(&mut rewinding(), &ROWS, true);
    let three = |second| (second, 3.0 * SIGMA);
    let expected = [(1, SIGMA), three(4), three(5), three(6), three(7), three(8), three(9)];
    assert_eq!(used, expected);
    assert_eq!((off, refused), (vec![2, 3], vec![7, 8]));
}

#[test]
fn a_command_that_comes_late_gives_the_result_of_time_order_when_the_runner_goes_back() {
    let mut in_order = rewinding();
    let heard = fed(&mut in_order, &ROWS, true);
    let mut late = ROWS.to_vec();
    // The command of 2 s comes after the fix of 4 s.
    let command = late.remove(2);
    late.insert(5, command);
    let mut going_back = rewinding();
    assert_eq!(fed(&mut going_back, &late, true), heard);
    assert_eq!(going_back.belief().x, in_order.belief().x);
    let newest = |runner: &Runner| runner.rewinds().unwrap().count;
    assert!(newest(&going_back) > newest(&in_order));
}

#[test]
fn a_command_that_comes_too_late_holds_from_its_arrival_on() {
    let rows: [(StreamId, i64, &[f64]); 5] = [
        (FIXES, 0, &[0.0]),
        (FIXES, 1, &[0.1]),
        (FIXES, 2, &[0.2]),
        (COMMANDS, 1, &[0.0, NAN]),
        (FIXES, 3, &[0.3]),
    ];
    let (used, off, _) = fed(&mut runner(), &rows, true);
    assert_eq!(used, [(1, SIGMA), (2, SIGMA)]);
    assert_eq!(off, [3]);
}

#[test]
fn a_command_is_part_of_the_memory() {
    let mut whole = runner();
    let expected = fed(&mut whole, &ROWS, true);
    for cut in 1..ROWS.len() {
        let (mut first, mut rest) = (runner(), runner());
        let (mut heard, mut bytes) = (fed(&mut first, &ROWS[..cut], false), Vec::new());
        save(&mut first, &mut bytes);
        recall(&mut rest, &bytes).unwrap();
        let then = fed(&mut rest, &ROWS[cut..], true);
        heard.0.extend(then.0);
        heard.1.extend(then.1);
        heard.2.extend(then.2);
        assert_eq!(heard, expected, "cut before row {cut}");
        assert_eq!(rest.belief().x, whole.belief().x);
    }
}
