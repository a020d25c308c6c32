//! Recordings one after the other, for a process without input.

use super::*;
use crate::belief::Belief;
use crate::filter::tests::{Direct, declare};
use crate::filter::{Backend, Filter};
use crate::gate::Open;
use crate::linear::Transition;
use crate::loss::Quadratic;
use crate::memory::{Memory, Tape};
use crate::model::{Input, Process, Size};
use crate::state::{Declaration, Dynamics, Layout, LayoutBuilder, Scalar, Slot, StateRole};
use crate::time::Time;
use alloc::sync::Arc;
use nalgebra::Matrix1;

/// A position that walks.
#[derive(Debug)]
struct Walk(Slot<Scalar>);

impl Process for Walk {
    fn input_dim(&self) -> usize {
        0
    }
    fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
    fn linearise(&self, _: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
        out.noise(self.0, self.0, &Matrix1::new(dt));
    }
}

/// Begins at the first row.
#[derive(Debug)]
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
        let block = layout.block("position").unwrap();
        belief.x[block.storage] = self.0.unwrap();
    }
}

/// Positions on stream 0, and on stream 1 the number that a calibration is.
fn runner() -> Runner {
    runner_from(First(None), vec![port(0)])
}

/// The same with an initialiser of `inputs`.
fn runner_from(first: First, inputs: Vec<Port>) -> Runner {
    let mut b = LayoutBuilder::new();
    let position = declare::<Scalar>(&mut b, "position", 0.0, &[1.0], Dynamics::Process);
    let scale = b.declare::<Scalar>(Declaration {
        name: "scale".to_owned(),
        owner: String::new(),
        unit: "",
        initial: 1.0,
        sigma: vec![0.5],
        role: StateRole::Calibration,
        dynamics: Dynamics::Constant,
    });
    let process: Arc<dyn Process> = Arc::new(Walk(position));
    let filter = Filter::new(Arc::new(b.finish()), process.clone(), Backend::default(), Size::same(1));
    let mut runner = Runner::new(Box::new(filter), process, 0.0);
    for (stream, slot) in [("position", position), ("scale", scale.unwrap())] {
        let stream = runner.add_stream(stream, 1);
        runner.add_sensor(Sensor {
            name: stream.to_string(),
            model: Arc::new(Direct(slot)),
            port: port(stream),
            offset: None,
            constant: Vec::new(),
            noise: Noise::diagonal(&[0.1]),
            quality: None,
            gate: Box::new(Open),
            loss: Arc::new(Quadratic),
            switch: None,
        });
    }
    runner.add_initialiser(InitialiserUnit {
        name: "first".to_owned(),
        initialiser: Box::new(first),
        inputs,
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

/// Two seconds at a position of 5, the calibration measured once as 2; from `again` on at a position of 90. Returns
/// the reported starts, and the belief at the end.
fn told(runner: &mut Runner, again: i64) -> (Vec<String>, Belief) {
    let mut told = Vec::new();
    let mut observer = |event: &Event<'_>| match event {
        Event::Started { belief, .. } => told.push(format!("started {} at {}", belief.time, belief.x[0])),
        Event::Stopped { .. } => told.push("stopped".to_owned()),
        _ => {}
    };
    let second = |s: i64| Time::from_nanos(s * 1_000_000_000);
    let rows = [(0, 0, 5.0), (0, 1, 5.0), (1, 2, 2.0), (0, again, 90.0), (0, again + 1, 90.0)];
    for (stream, at, value) in rows {
        runner.feed(&Row::new(stream, second(at), &[value]), &mut observer).unwrap();
    }
    runner.finish(&mut observer).unwrap();
    let belief = runner.belief().clone();
    (told, belief)
}

#[test]
fn a_long_silence_separates_recordings_and_calibration_is_kept() {
    let mut apart = runner();
    apart.restart_after(5.0);
    let (starts, belief) = told(&mut apart, 8);
    assert_eq!(starts, ["started 0.000000 s at 5", "started 8.000000 s at 90"]);
    // 0.25/(0.25 + 0.01) of the way from 1 to 2; rounding.
    assert!((belief.x[1] - (1.0 + 0.25 / 0.26)).abs() < 1e-15, "{:?}", belief.x);
    assert_eq!(belief.x[0], 90.0);
}

#[test]
fn a_silence_within_a_recording_and_one_that_nothing_is_declared_of_are_bridged() {
    let mut together = runner();
    together.restart_after(5.0);
    let (starts, belief) = told(&mut together, 7);
    assert_eq!(starts, ["started 0.000000 s at 5"]);
    assert!(belief.x[0] > 80.0 && belief.x[0] < 90.0, "{:?}", belief.x);
    assert_eq!(told(&mut runner(), 100).0, ["started 0.000000 s at 5"]);
}

/// A minute at 5 with the calibration measured as 2, then senseless positions and calibrations for 20 s. Returns the
/// reported ends and starts.
fn lost(runner: &mut Runner) -> Vec<String> {
    let mut told = Vec::new();
    let mut observer = |event: &Event<'_>| match event {
        Event::Started { belief, .. } => told.push(format!("started {} at {:.3}", belief.time, belief.x[1])),
        Event::GaveUp { since, time } => told.push(format!("gave up {}", time.seconds_since(*since))),
        _ => {}
    };
    for s in 0..80_i64 {
        let (time, sign) = (Time::from_nanos(s * 1_000_000_000), if s % 2 == 0 { 1.0 } else { -1.0 });
        let [position, scale] = if s < 60 { [5.0, 2.0] } else { [1e6 * sign, 50.0] };
        runner.feed(&Row::new(0, time, &[position]), &mut observer).unwrap();
        runner.feed(&Row::new(1, time, &[scale]), &mut observer).unwrap();
    }
    runner.finish(&mut observer).unwrap();
    told
}

#[test]
fn a_filter_that_is_lost_for_long_starts_anew_with_the_calibration_of_before() {
    assert_eq!(lost(&mut runner()), ["started 0.000000 s at 1.000"]);
    let mut patient = runner();
    patient.restart_lost(30.0);
    assert_eq!(lost(&mut patient).len(), 1);
    let mut hasty = runner();
    hasty.restart_lost(5.0);
    let told = lost(&mut hasty);
    assert_eq!(
        told[..2],
        ["started 0.000000 s at 1.000".to_owned(), "gave up 5".to_owned()],
        "{told:?}"
    );
    // Measured sixty times as 2 with an R of 0.01.
    let scale: f64 = told[2].rsplit(' ').next().unwrap().parse().unwrap();
    assert!((scale - 2.0).abs() < 0.01, "{told:?}");
    // An initialiser that reads nothing would put the vehicle where it was in the beginning.
    let mut fixed = runner_from(First(Some(5.0)), Vec::new());
    fixed.restart_lost(5.0);
    assert_eq!(lost(&mut fixed).len(), 1);
}
