//! Gaps, spikes and jumps of the input, with a body on a line whose acceleration is measured at 100 Hz.

use super::*;
use crate::belief::Belief;
use crate::filter::tests::{Direct, Track, declare};
use crate::filter::{Backend, Filter};
use crate::gate::Open;
use crate::linear::Transition;
use crate::loss::Quadratic;
use crate::memory::{Memory, Tape};
use crate::model::{Gap, Input, Process, Size};
use crate::state::{Block, Declaration, Dynamics, Layout, LayoutBuilder, Scalar, StateRole, View};
use crate::time::{Time, nanos};
use alloc::sync::Arc;
use nalgebra::Matrix1;

mod realign;
mod spikes;

/// A body that may change its acceleration by 2 m/s², and coasts at constant velocity.
#[derive(Debug)]
struct Agile(Track);

impl Process for Agile {
    fn input_dim(&self) -> usize {
        1
    }
    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        self.0.propagate(x, input, dt);
    }
    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        self.0.linearise(x, input, dt, out);
    }
    fn agility(&self) -> &[f64] {
        &[2.0]
    }
    fn coast(&self, x: &mut [f64], gap: &Gap, _: &[f64], sample: &mut [f64], out: &mut Transition) -> bool {
        let dt = gap.duration();
        sample[0] = 0.0;
        self.0.propagate(x, &Input::held(&[0.0]), dt);
        out.set(self.0.position, self.0.velocity, &Matrix1::new(dt));
        // Noise of the velocity: 1 m²/s³, up to 4 m²/s².
        out.noise_up_to(self.0.velocity, &nalgebra::Vector1::new(dt), &nalgebra::Vector1::new(4.0));
        true
    }
}

/// Accelerations on stream 0; positions on stream 1.
fn runner(buffer: f64) -> Runner {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 0.0, &[1.0], Dynamics::Process);
    let velocity = declare::<Scalar>(&mut b, "velocity", 0.0, &[1.0], Dynamics::Process);
    b.declare::<Scalar>(Declaration {
        name: "scale".to_owned(),
        owner: String::new(),
        unit: "",
        initial: 1.0,
        sigma: vec![0.5],
        role: StateRole::Calibration,
        dynamics: Dynamics::Constant,
    })
    .unwrap();
    let sigma = 0.1;
    let process: Arc<dyn Process> = Arc::new(Agile(Track { position, velocity, sigma }));
    let filter = Filter::new(Arc::new(b.finish()), process.clone(), Backend::default(), Size::same(1));
    let mut runner = Runner::new(Box::new(filter), process, buffer);
    runner.add_stream("acceleration", 1);
    runner.add_stream("position", 1);
    runner.set_input(port(0));
    runner.add_sensor(Sensor {
        name: "position".to_owned(),
        model: Arc::new(Direct(position)),
        port: port(1),
        offset: None,
        constant: Vec::new(),
        noise: Noise::diagonal(&[1.0]),
        quality: None,
        gate: Box::new(Open),
        loss: Arc::new(Quadratic),
        switch: None,
    });
    runner
}

fn port(stream: StreamId) -> Port {
    Port {
        stream,
        columns: vec![0],
        delay: 0,
    }
}

fn centi(k: i64) -> Time {
    Time::from_nanos(k * 10_000_000)
}

type Rows = Vec<(StreamId, Time, f64)>;

/// Accelerations of 1 m/s² every 10 ms but where `silent`, and positions every 200 ms, a little later.
fn rows(length: i64, silent: core::ops::Range<i64>) -> Rows {
    let mut rows = Vec::new();
    for k in 0..length {
        if !silent.contains(&k) {
            rows.push((0, centi(k), 1.0));
        }
        if k % 20 == 13 {
            let t = k as f64 * 0.01;
            rows.push((1, centi(k).shifted(nanos(0.004)), 0.5 * t * t));
        }
    }
    rows
}

fn feed(runner: &mut Runner, rows: &Rows, observer: &mut dyn Observer) {
    feed_from(0, runner, rows, observer);
}

/// The first of `rows` being number `first`.
fn feed_from(first: usize, runner: &mut Runner, rows: &[(StreamId, Time, f64)], observer: &mut dyn Observer) {
    for (number, (stream, time, value)) in rows.iter().enumerate() {
        let values = [*value];
        let row = Row {
            number: (first + number) as u64,
            ..Row::new(*stream, *time, &values)
        };
        runner.feed(&row, observer).unwrap();
    }
}

/// An event as text that shows every bit.
fn text(event: &Event<'_>) -> String {
    match event {
        Event::Estimate { belief } => format!("Estimate {} {:?} {:?}", belief.time, belief.x, belief.covariance.to_dense()),
        // Only the arrival may differ.
        Event::Updated { update, time, row, .. } => format!("Updated {time} {:?} {}", update.residual, row.number),
        Event::Discarded {
            consumer, time, row, why, ..
        } => format!("Discarded {consumer} {time} {} {why:?}", row.number),
        other => format!("{other:?}"),
    }
}

/// Feeds rows and the end; every event as text that shows every bit.
fn told(runner: &mut Runner, rows: &Rows) -> Vec<String> {
    let mut told = Vec::new();
    let mut observer = |event: &Event<'_>| told.push(text(event));
    feed(runner, rows, &mut observer);
    runner.finish(&mut observer).unwrap();
    told
}

fn belief_after(rows: &Rows) -> Belief {
    let mut runner = runner(0.0);
    feed(&mut runner, rows, &mut |_: &Event<'_>| {});
    runner.finish(&mut |_: &Event<'_>| {}).unwrap();
    runner.belief().clone()
}

fn only_input(rows: Rows) -> Rows {
    rows.into_iter().filter(|row| row.0 == 0).collect()
}

#[test]
fn through_a_gap_the_velocity_stays_and_its_uncertainty_grows_as_the_vehicle_is_agile() {
    // Samples up to 1 s, then from 1.5 s on: the first of these covers 10 ms.
    let belief = belief_after(&only_input(rows(152, 101..150)));
    let (v, p) = (1.0 + 0.02, 0.5 + 0.49 + 0.5 * 0.02 * 0.02 + 0.02);
    // 1e-12: rounding of 150 steps.
    assert!((belief.x[1] - v).abs() < 1e-12 && (belief.x[0] - p).abs() < 1e-12, "{:?}", belief.x);
    // σ_v² = 1 + 102 samples of (0.1·0.01)² + 0.49 s of coasting.
    let variance = belief.covariance.to_dense()[1 + 3];
    assert!((variance - (1.0 + 102e-6 + 0.49)).abs() < 1e-12, "{variance}");
    // After 10 s it has come to its bound.
    let long = belief_after(&only_input(rows(1102, 101..1100)));
    let variance = long.covariance.to_dense()[1 + 3];
    assert!((variance - (4.0 + 2e-6)).abs() < 1e-12, "{variance}");
}

#[test]
fn a_sample_stands_for_up_to_ten_intervals() {
    // Nine samples are missing, 100 ms: the next sample covers all of it.
    let belief = belief_after(&only_input(rows(120, 101..110)));
    assert!((belief.x[1] - 1.19).abs() < 1e-12, "{:?}", belief.x);
    // Ten are missing: the next sample covers 10 ms.
    let belief = belief_after(&only_input(rows(120, 101..111)));
    assert!((belief.x[1] - 1.09).abs() < 1e-12, "{:?}", belief.x);
}

#[test]
fn a_gap_is_heldand_measurements_in_it_are_used_at_their_own_times() {
    let mut told = Vec::new();
    let mut observer = |event: &Event<'_>| match event {
        Event::Coasting { since, time } => {
            assert_eq!(*since, centi(100));
            told.push(("coasting", *time));
        }
        Event::Resumed { since, time } => {
            assert_eq!(*since, centi(100));
            told.push(("resumed", *time));
        }
        Event::Updated { time, .. } => told.push(("updated", *time)),
        _ => {}
    };
    let mut runner = runner(0.0);
    feed(&mut runner, &rows(160, 101..150), &mut observer);
    let gap: Vec<_> = told.into_iter().filter(|(_, t)| *t > centi(100) && *t <= centi(150)).collect();
    let late = |k: i64| centi(k).shifted(nanos(0.004));
    let wanted = [
        ("coasting", centi(110)),
        ("updated", late(113)),
        ("coasting", centi(120)),
        ("coasting", centi(130)),
        ("updated", late(133)),
        ("coasting", centi(140)),
        ("resumed", centi(149)),
    ];
    assert_eq!(gap, wanted);
}

#[test]
fn any_order_of_arrival_gives_the_same_bits_through_a_gap() {
    let mut rows = rows(300, 101..150);
    // A spike, a step that stays, and a suspect before the gap.
    let inputs = rows.iter_mut().filter(|row| row.0 == 0);
    for (k, row) in inputs.enumerate() {
        row.2 = match k {
            40 | 100 => -50.0,
            180.. => 9.0,
            _ => row.2,
        };
    }
    let wanted = told(&mut runner(0.1), &rows);
    for kind in ["Coasting", "Resumed", "Spike"] {
        assert!(wanted.iter().any(|e| e.contains(kind)), "{kind}");
    }
    let sorted = |mut events: Vec<String>| {
        events.sort_unstable();
        events
    };
    for seed in 1..6_i64 {
        // Each row up to 100 ms late; numbers follow the rows.
        let mut order: Vec<usize> = (0..rows.len()).collect();
        order.sort_by_key(|&i| rows[i].1.nanos() + (i as i64 * 7919 * seed).rem_euclid(100_000_000));
        let mut events = Vec::new();
        let mut shuffled = runner(0.1);
        let mut observer = |event: &Event<'_>| match event {
            Event::Estimate { belief } => {
                events.push(format!(
                    "Estimate {} {:?} {:?}",
                    belief.time,
                    belief.x,
                    belief.covariance.to_dense()
                ));
            }
            Event::Updated { update, time, row, .. } => events.push(format!("Updated {time} {:?} {}", update.residual, row.number)),
            Event::Discarded {
                consumer, time, row, why, ..
            } => events.push(format!("Discarded {consumer} {time} {} {why:?}", row.number)),
            other => events.push(format!("{other:?}")),
        };
        for &i in &order {
            let values = [rows[i].2];
            let row = Row {
                number: i as u64,
                ..Row::new(rows[i].0, rows[i].1, &values)
            };
            shuffled.feed(&row, &mut observer).unwrap();
        }
        shuffled.finish(&mut observer).unwrap();
        assert_eq!(sorted(events), sorted(wanted.clone()), "seed {seed}");
    }
}

/// Writes its position from the first row.
#[derive(Clone, Debug)]
struct First(Option<f64>);

impl Memory for First {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
    }
}

impl Initialiser for First {
    fn row(&mut self, _: usize, _: Time, row: &[f64]) {
        self.0.get_or_insert(row[0]);
    }
    fn waits_for(&self) -> Option<String> {
        self.0.is_none().then(|| "a position".to_owned())
    }
    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        let block: &Block = layout.block("position").unwrap();
        belief.x[block.storage] = self.0.unwrap();
    }
}

#[test]
fn a_runner_that_takes_over_at_any_row_goes_on_bit_for_bit_through_spikes_and_gaps() {
    let mut rows = rows(400, 150..280);
    for spike in [60, 250] {
        rows[spike].2 = 1e3;
    }
    let wanted = told(&mut runner(0.05), &rows);
    for kind in ["Coasting", "Resumed", "Spike"] {
        assert!(wanted.iter().any(|event| event.contains(kind)), "{kind}");
    }
    let mut bytes = Vec::new();
    for at in 1..rows.len() {
        let (before, after) = rows.split_at(at);
        let mut events = Vec::new();
        let mut observer = |event: &Event<'_>| events.push(text(event));
        let mut first = runner(0.05);
        feed_from(0, &mut first, before, &mut observer);
        bytes.clear();
        crate::memory::save(&mut first, &mut bytes);
        let mut second = runner(0.05);
        crate::memory::restore(&mut second, &bytes).unwrap();
        feed_from(at, &mut second, after, &mut observer);
        second.finish(&mut observer).unwrap();
        assert_eq!(events, wanted, "taken over after row {at}");
    }
}

#[test]
fn after_a_gap_too_long_to_coast_the_initialisers_start_anew_and_calibration_is_kept() {
    let mut runner = runner(0.0);
    runner.limit_input(InputLimits {
        longest_gap: 2.0,
        ..InputLimits::default()
    });
    runner.add_initialiser(InitialiserUnit {
        name: "first".to_owned(),
        initialiser: Box::new(First(None)),
        inputs: vec![port(1)],
    });
    let rows = rows(900, 301..700);
    let mut told = Vec::new();
    let before: Rows = rows.iter().copied().filter(|row| row.1 < centi(200)).collect();
    let after: Rows = rows.iter().copied().filter(|row| row.1 >= centi(200)).collect();
    feed(&mut runner, &before, &mut |_: &Event<'_>| {});
    // As if it had been estimated.
    let mut belief = runner.belief().clone();
    let scale = runner.estimator().layout().block("scale").unwrap().clone();
    belief.x[scale.storage] = 1.25;
    belief.covariance.set_sigmas(&scale, &[0.01]);
    runner.estimator_mut().set_belief(belief);
    let mut observer = |event: &Event<'_>| match event {
        Event::Stopped { since, time } => told.push(format!("stopped {since} {time}")),
        Event::Started { belief, .. } => {
            let sigma = belief.covariance.to_dense()[8].sqrt();
            told.push(format!("started {} {:?} {sigma:.3}", belief.time, &belief.x));
        }
        Event::Resumed { .. } => told.push("resumed".to_owned()),
        _ => {}
    };
    feed(&mut runner, &after, &mut observer);
    // The position of 5.134 s was on its way when the filter stopped, and is the first after that for the
    // initialiser, whenever it came; the first sample after the gap is that at 7 s.
    let position = 0.5 * 5.13 * 5.13;
    let wanted = [
        "stopped 3.000000 s 5.100000 s".to_owned(),
        format!("started 7.000000 s {:?} 0.010", [position, 0.0, 1.25]),
    ];
    assert_eq!(told, wanted);
}

/// Feeds rows with `jumps` stamps an hour ahead from the hundredth on. Gives the events of unused rows and of a stop,
/// and the belief at the end.
fn jumping(jumps: usize, goes_back: bool) -> (Vec<String>, Belief) {
    let mut settled = runner(0.0);
    settled.limit_jumps(10.0);
    if goes_back {
        let mut live = runner(0.0);
        live.limit_jumps(10.0);
        settled.rewind(live, 1.0, 0.25);
    }
    let mut rows = rows(400, 0..0);
    rows[100..100 + jumps]
        .iter_mut()
        .for_each(|row| row.1 = row.1.shifted(nanos(3600.0)));
    let told = told(&mut settled, &rows);
    let kept = told.into_iter().filter(|e| e.starts_with("Discarded") || e.starts_with("Stopped"));
    (kept.collect(), settled.belief().clone())
}

#[test]
fn up_to_twenty_stamps_far_ahead_cost_their_rows_and_no_other() {
    for goes_back in [false, true] {
        for jumps in [1, 2, 3, 20] {
            let (told, belief) = jumping(jumps, goes_back);
            assert!(told.iter().all(|e| e.contains("TimeJump")) && told.len() == jumps, "{told:?}");
            assert_eq!(belief.time, centi(399));
            // As if they had not been there.
            let mut rows = rows(400, 0..0);
            rows.drain(100..100 + jumps);
            assert_eq!(belief.x, belief_after(&rows).x);
        }
    }
}

#[test]
fn a_jump_that_goes_on_is_a_gap() {
    for goes_back in [false, true] {
        let (told, belief) = jumping(320, goes_back);
        // The hour is too long to coast through.
        assert!(told.iter().any(|e| e.starts_with("Stopped")), "{told:?}");
        assert!(told.iter().all(|e| !e.contains("TimeJump")) && belief.time == centi(399).shifted(nanos(3600.0)));
    }
}

#[test]
fn an_unconfirmed_jump_at_the_end_is_told() {
    let mut runner = runner(0.0);
    runner.limit_jumps(10.0);
    let mut rows = rows(50, 0..0);
    rows.push((0, centi(5000), 1.0));
    let told = told(&mut runner, &rows);
    assert_eq!(told.iter().filter(|e| e.contains("TimeJump")).count(), 1);
}

#[test]
fn without_input_nothing_piles_up() {
    let mut runner = runner(0.0);
    runner.limit_input(InputLimits {
        longest_gap: 1e6,
        ..InputLimits::default()
    });
    feed(&mut runner, &rows(100, 0..0), &mut |_: &Event<'_>| {});
    let mut bytes = Vec::new();
    let mut kept = |runner: &mut Runner| {
        bytes.clear();
        crate::memory::save(runner, &mut bytes);
        bytes.len()
    };
    let mut most = 0;
    for k in 0..2_000 {
        runner
            .feed(&Row::new(1, centi(100 + 20 * k), &[0.0]), &mut |_: &Event<'_>| {})
            .unwrap();
        // The first after the input waits for it; by the second the input is silent, and the coasting is known.
        let now = kept(&mut runner);
        if k < 4 {
            most = now.max(most);
        } else {
            assert!(now <= most, "{k}: {now} bytes");
        }
    }
    assert!(runner.belief().time > centi(100 + 20 * 1998));
}

#[test]
fn a_prediction_to_now_grows_uncertain_and_changes_nothing() {
    let mut runner = runner(0.5);
    assert_eq!(runner.predicted(centi(100)), None);
    feed(&mut runner, &rows(101, 0..0), &mut |_: &Event<'_>| {});
    let before = format!("{:?}", runner.belief());
    // Rows of half a second are held back; the prediction has used them.
    assert_eq!(runner.belief().time, centi(50));
    let sigma: Vec<f64> = [100, 150, 200, 400]
        .map(|k| runner.predicted(centi(k)).unwrap())
        .iter()
        .zip([100, 150, 200, 400])
        .map(|(belief, k)| {
            assert_eq!(belief.time, centi(k));
            belief.covariance.to_dense()[0].sqrt()
        })
        .collect();
    assert!(sigma.is_sorted() && sigma[3] > 2.0 * sigma[0], "{sigma:?}");
    assert_eq!(runner.predicted(centi(100 + 7000)), None, "longer than can be coasted");
    assert_eq!(format!("{:?}", runner.belief()), before);
    runner.finish(&mut |_: &Event<'_>| {}).unwrap();
    assert_eq!(runner.predicted(centi(100)).unwrap(), *runner.belief());
}

/// Counts the silences it hears of, and emits a row for each.
#[derive(Clone, Debug)]
struct Clock;
crate::memory!(Clock {});

impl Stage for Clock {
    fn row(&mut self, _: usize, _: Time, _: &[f64], _: Option<&View<'_>>, _: &mut Emitter<'_>) {}
    fn silence(&mut self, time: Time, _: &View<'_>, out: &mut Emitter<'_>) {
        out.emit(time, &[7.0]);
    }
}

#[test]
fn stages_on_the_input_hear_of_its_silence_and_what_they_emit_is_used_in_the_gap() {
    let mut runner = runner(0.0);
    let output = runner.add_stream("clock", 1);
    runner.add_stage(StageUnit {
        name: "clock".to_owned(),
        stage: Box::new(Clock),
        inputs: vec![port(0)],
        output,
    });
    let model = runner.sensors()[0].model.clone();
    runner.add_sensor(Sensor {
        name: "constraint".to_owned(),
        model,
        port: port(output),
        offset: None,
        constant: Vec::new(),
        noise: Noise::diagonal(&[1.0]),
        quality: None,
        gate: Box::new(Open),
        loss: Arc::new(Quadratic),
        switch: None,
    });
    let mut times = Vec::new();
    let mut observer = |event: &Event<'_>| match event {
        Event::Updated {
            sensor: 1, time, update, ..
        } => {
            assert_eq!(update.value, [7.0]);
            times.push(*time);
        }
        Event::Discarded { consumer, why, .. } => panic!("{consumer} {why:?}"),
        _ => {}
    };
    feed(&mut runner, &rows(160, 101..150), &mut observer);
    assert_eq!(times, [110, 120, 130, 140].map(centi));
}

/// The rows of the sensor from the third second on are stamped `ahead` seconds ahead, and arrive as before.
fn jumped(ahead: f64) -> Rows {
    let rows = rows(1000, 0..0);
    let jump = |(stream, time, value): (StreamId, Time, f64)| {
        let is_ahead = stream == 1 && time > centi(300);
        (stream, if is_ahead { time.shifted(nanos(ahead)) } else { time }, value)
    };
    rows.into_iter().map(jump).collect()
}

#[test]
fn a_sensor_whose_stamps_are_ahead_waits_for_the_input_and_does_not_starve_it() {
    let disordered = jumped(1.0);
    let mut ordered: Vec<_> = disordered.iter().copied().enumerate().collect();
    ordered.sort_by_key(|(_, row)| row.1);
    let mut told = Vec::new();
    let mut ahead = Vec::new();
    let mut unit = runner(0.0);
    let mut observer = |event: &Event<'_>| match event {
        Event::Ahead { stream, by, .. } => ahead.push((*stream, *by)),
        other => told.push(text(other)),
    };
    feed(&mut unit, &disordered, &mut observer);
    unit.finish(&mut observer).unwrap();
    // The result must be that of rows that come in the order of their stamps.
    let mut wanted = Vec::new();
    let mut observer = |event: &Event<'_>| wanted.push(text(event));
    let mut sorted = runner(0.0);
    for (number, (stream, time, value)) in ordered {
        let values = [value];
        let row = Row {
            number: number as u64,
            ..Row::new(stream, time, &values)
        };
        sorted.feed(&row, &mut observer).unwrap();
    }
    sorted.finish(&mut observer).unwrap();
    let used = |told: &[String]| told.iter().filter(|e| !e.starts_with("Health")).cloned().collect::<Vec<_>>();
    let (held, wanted) = (used(&told), used(&wanted));
    let differs = held.iter().zip(&wanted).find(|(a, b)| a != b);
    assert!(held.len() == wanted.len() && differs.is_none(), "{differs:?}");
    assert!(told.iter().all(|e| !e.starts_with("Discarded position") && !e.contains("Late")));
    // Each of 35 rows is reported when the next input shows that it is ahead: that is 6 ms later.
    assert_eq!(ahead.len(), 35);
    assert!(
        ahead.iter().all(|&(stream, by)| stream == 1 && (by - 0.994).abs() < 1e-9),
        "{ahead:?}"
    );
    assert!(told.iter().any(|e| e.contains("Ahead { stream: 1 }")), "health says it");
}

#[test]
fn rows_in_a_gap_of_the_input_are_not_ahead_of_it() {
    let mut ahead = 0;
    let mut coasted = Vec::new();
    let mut runner = runner(0.0);
    let mut observer = |event: &Event<'_>| match event {
        Event::Ahead { .. } => ahead += 1,
        Event::Coasting { time, .. } => coasted.push(*time),
        _ => {}
    };
    // Positions every 200 ms: by the second one the input is known to be silent.
    feed(&mut runner, &rows(340, 101..400), &mut observer);
    assert_eq!(ahead, 0);
    assert!(coasted.last().is_some_and(|time| *time >= centi(330)), "{coasted:?}");
}

#[test]
fn a_runner_saved_while_rows_are_ahead_goes_on_bit_for_bit() {
    let rows = jumped(1.0);
    let whole = told(&mut runner(0.0), &rows);
    // 507 rows are 4.8 s: five positions wait.
    let (mut first, mut second, mut bytes) = (runner(0.0), runner(0.0), Vec::new());
    let mut heard = Vec::new();
    feed_from(0, &mut first, &rows[..507], &mut |event: &Event<'_>| heard.push(text(event)));
    crate::memory::save(&mut first, &mut bytes);
    crate::memory::recall(&mut second, &bytes).unwrap();
    let mut observer = |event: &Event<'_>| heard.push(text(event));
    feed_from(507, &mut second, &rows[507..], &mut observer);
    second.finish(&mut observer).unwrap();
    assert_eq!(heard, whole);
}
