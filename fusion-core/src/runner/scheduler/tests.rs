//! The scheduler alone: rows, samples and gaps are values, given by hand.

use super::sensors::Circumstances;
use super::*;
use crate::belief::Belief;
use crate::filter::tests::{Direct, declare};
use crate::filter::{Backend, Filter};
use crate::gate::Open;
use crate::health::State;
use crate::linear::Transition;
use crate::loss::Quadratic;
use crate::memory::{Memory, Tape};
use crate::model::{Gap, Input, Process, Size};
use crate::runner::consumer::Consumer;
use crate::runner::rows::Stored;
use crate::runner::{Discard, Event, Halt, Initialiser, InitialiserUnit, Noise, Observer, Port, Row, Sensor};
use crate::state::{Angle, Declaration, Dynamics, Layout, LayoutBuilder, Scalar, Slot, StateRole};
use crate::time::Time;
use alloc::sync::Arc;

/// Turns at the rate of its input, if it reads one. In a gap it may turn by a radian a second.
#[derive(Debug)]
struct Turning(Slot<Angle>, usize);

impl Process for Turning {
    fn input_dim(&self) -> usize {
        self.1
    }
    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let rate = input.sample.first().copied().unwrap_or(0.0);
        self.0.write(&(self.0.read(x) + rate * dt), x);
    }
    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}
    fn coast(&self, _: &mut [f64], gap: &Gap, _: &[f64], _: &mut [f64], out: &mut Transition) -> bool {
        out.noise_up_to(self.0, &nalgebra::Vector1::new(gap.duration()), &nalgebra::Vector1::new(3.0));
        true
    }
}

/// The heading of the latest row, with a 1σ of 0.2 rad.
#[derive(Debug)]
struct Course(Option<f64>);

impl Memory for Course {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
    }
}

impl Initialiser for Course {
    fn row(&mut self, _: usize, _: Time, row: &[f64]) {
        self.0 = Some(row[0]);
    }
    fn waits_for(&self) -> Option<String> {
        self.0.is_none().then(|| "a course".to_owned())
    }
    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        let block = layout.block("heading").unwrap();
        belief.x[block.storage] = self.0.unwrap();
        belief.covariance.set_sigmas(block, &[0.2]);
    }
}

const COURSE: (usize, usize) = (0, 0);

fn port() -> Port {
    Port {
        stream: 0,
        columns: vec![0],
        delay: 0,
    }
}

/// A heading with its initialiser, and a scale with its sensor. The process reads `input_dim` numbers.
fn scheduler(input_dim: usize) -> Scheduler {
    let mut b = LayoutBuilder::new();
    let heading = declare::<Angle>(&mut b, "heading", 0.0, &[0.1], Dynamics::Process);
    let scale = b.declare::<Scalar>(Declaration {
        name: "scale".to_owned(),
        owner: String::new(),
        unit: "",
        initial: 1.0,
        sigma: vec![0.5],
        role: StateRole::Calibration,
        dynamics: Dynamics::Constant,
    });
    let filter = Filter::new(
        Arc::new(b.finish()),
        Arc::new(Turning(heading, input_dim)),
        Backend::default(),
        Size::same(1),
    );
    let mut scheduler = Scheduler::new(Box::new(filter), input_dim);
    scheduler.add_sensor(Sensor {
        name: "scale".to_owned(),
        model: Arc::new(Direct(scale.unwrap())),
        port: port(),
        offset: None,
        constant: Vec::new(),
        noise: Noise::diagonal(&[0.1]),
        quality: None,
        gate: Box::new(Open),
        loss: Arc::new(Quadratic),
        switch: None,
    });
    scheduler.add_initialiser(InitialiserUnit {
        name: "course".to_owned(),
        initialiser: Box::new(Course(None)),
        inputs: vec![port()],
    });
    scheduler
}

fn second(s: i64) -> Time {
    Time::from_nanos(s * 1_000_000_000)
}

fn row(value: f64) -> Stored {
    let mut stored = Stored::default();
    stored.take(&Row::new(0, second(0), &[value]), second(0));
    stored
}

/// Keeps the events as short texts, and has a health.
#[derive(Debug, Default)]
struct Listener(Vec<String>, State);

impl Observer for Listener {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        self.0.push(match event {
            Event::Started { belief, .. } => format!("started {}", belief.time),
            Event::Estimate { belief } => format!("estimate {}", belief.time),
            Event::Updated { time, .. } => format!("updated {time}"),
            Event::Discarded { consumer, time, why, .. } => format!("discarded {consumer} {time} {why:?}"),
            other => format!("{other:?}").split([' ', '{']).next().unwrap_or_default().to_owned(),
        });
        Ok(())
    }
    fn health(&self) -> Option<State> {
        Some(self.1)
    }
}

/// The events since the last call.
fn events(listener: &mut Listener) -> Vec<String> {
    core::mem::take(&mut listener.0)
}

/// The value and the 1σ of a block.
fn known(scheduler: &Scheduler, block: &str) -> (f64, f64) {
    let (belief, layout) = (scheduler.belief(), scheduler.estimator().layout());
    let block = layout.block(block).unwrap();
    let sigma = belief.covariance.sigmas(block).next().unwrap();
    (belief.x[block.storage], sigma)
}

/// A scheduler that a course of 0.1 rad has started at second 0.
fn started(input_dim: usize) -> (Scheduler, Listener) {
    let (mut scheduler, mut listener) = (scheduler(input_dim), Listener::default());
    let latest = &[0.0][..];
    scheduler
        .initialiser_row(COURSE, second(0), &row(0.1), Some(latest), &mut listener)
        .unwrap();
    assert_eq!(events(&mut listener), ["Taken", "started 0.000000 s"]);
    (scheduler, listener)
}

/// Measures the scale at `time`, to where the estimate is moved.
fn measure(scheduler: &mut Scheduler, time: Time, value: f64, listener: &mut Listener) {
    scheduler.hold(time, Some(&[0.0]), listener).unwrap();
    let measurement = Waiting {
        time,
        sensor: 0,
        row: 0,
        noise: 1.0,
    };
    scheduler
        .offer(&measurement, &row(value), &Circumstances::default(), listener)
        .unwrap();
    scheduler.begin_epoch(time);
}

#[test]
fn a_filter_starts_once_its_initialisers_and_its_input_are_there() {
    let (mut scheduler, mut listener) = (scheduler(1), Listener::default());
    scheduler.start_if_ready(second(0), Some(&[0.0]), &mut listener).unwrap();
    let feed = |scheduler: &mut Scheduler, s, value, latest, listener: &mut Listener| {
        scheduler.initialiser_row(COURSE, second(s), &row(value), latest, listener).unwrap();
    };
    feed(&mut scheduler, 1, f64::NAN, Some(&[0.0][..]), &mut listener);
    feed(&mut scheduler, 2, 0.1, None, &mut listener);
    assert!(!scheduler.is_running());
    assert_eq!(events(&mut listener), ["discarded course 1.000000 s NotFinite", "Taken"]);
    // The row of the input that opens the first interval.
    scheduler.start_if_ready(second(3), Some(&[0.0]), &mut listener).unwrap();
    assert_eq!(events(&mut listener), ["started 3.000000 s"]);
    assert_eq!(known(&scheduler, "heading"), (0.1, 0.2));
    // Measurements of that time have been used already, and the initialisers rest.
    assert!(!scheduler.has_started_before(second(3)) && scheduler.has_started_before(second(4)));
    feed(&mut scheduler, 4, 2.0, Some(&[0.0][..]), &mut listener);
    assert_eq!((known(&scheduler, "heading"), events(&mut listener)), ((0.1, 0.2), vec![]));
}

#[test]
fn a_process_that_time_alone_moves_starts_without_input() {
    let (mut scheduler, mut listener) = (scheduler(0), Listener::default());
    scheduler
        .initialiser_row(COURSE, second(1), &row(0.1), None, &mut listener)
        .unwrap();
    assert_eq!(events(&mut listener), ["Taken", "started 1.000000 s"]);
}

#[test]
fn an_epoch_is_reported_when_the_estimate_leaves_it() {
    let (mut scheduler, mut listener) = started(1);
    measure(&mut scheduler, second(1), 2.0, &mut listener);
    scheduler.end_epoch_before(second(1), &mut listener).unwrap();
    assert_eq!(events(&mut listener), ["updated 1.000000 s"]);
    measure(&mut scheduler, second(2), f64::INFINITY, &mut listener);
    let wanted = ["estimate 1.000000 s", "discarded scale 2.000000 s NotFinite"];
    assert_eq!(events(&mut listener), wanted);
    scheduler.end_epoch_before(second(3), &mut listener).unwrap();
    scheduler.tell_epoch(&mut listener).unwrap();
    assert_eq!(events(&mut listener), ["estimate 2.000000 s"]);
    // The estimate is later than this measurement.
    let late = Waiting {
        noise: 1.0,
        time: second(1),
        sensor: 0,
        row: 0,
    };
    scheduler.offer(&late, &row(2.0), &Circumstances::default(), &mut listener).unwrap();
    let why = Discard::Late { now: second(2) };
    assert_eq!(events(&mut listener), [format!("discarded scale 1.000000 s {why:?}")]);
}

#[test]
fn measurements_wait_in_order_and_are_served_up_to_a_time() {
    let (mut scheduler, _) = started(1);
    let waiting = |s, row| Waiting {
        noise: 1.0,
        time: second(s),
        sensor: 0,
        row,
    };
    [waiting(1, 7), waiting(2, 3), waiting(2, 4)]
        .into_iter()
        .for_each(|w| scheduler.wait(w));
    assert_eq!(scheduler.next_waiting(second(1)), Some(waiting(1, 7)));
    assert_eq!(scheduler.next_waiting(second(1)), None);
    assert_eq!(scheduler.next_waiting(second(2)), Some(waiting(2, 3)));
    assert_eq!(scheduler.waiting().copied().collect::<Vec<_>>(), [waiting(2, 4)]);
}

#[test]
fn a_filter_that_stops_starts_again_with_its_calibration_and_nothing_else() {
    let (mut scheduler, mut listener) = started(1);
    measure(&mut scheduler, second(1), 2.0, &mut listener);
    let scale = known(&scheduler, "scale");
    assert!(scale.0 > 1.9 && scale.1 < 0.1 && scheduler.outcome(0).is_some());
    scheduler.stop();
    assert!(!scheduler.is_running() && scheduler.outcome(0).is_none());
    events(&mut listener);
    // The initialiser has begun anew.
    scheduler.start_if_ready(second(2), Some(&[0.0]), &mut listener).unwrap();
    assert_eq!(events(&mut listener), Vec::<String>::new());
    scheduler
        .initialiser_row(COURSE, second(3), &row(2.0), Some(&[0.0]), &mut listener)
        .unwrap();
    assert_eq!(events(&mut listener), ["Taken", "started 3.000000 s"]);
    assert_eq!((known(&scheduler, "heading"), known(&scheduler, "scale")), ((2.0, 0.2), scale));
}

#[test]
fn a_long_silence_begins_another_recording_of_a_process_without_input() {
    for (input_dim, at, is_over) in [(0, 5, false), (0, 6, true), (1, 6, false)] {
        let (mut scheduler, mut listener) = started(input_dim);
        scheduler.restart_after(5.0);
        scheduler.begin_recording(second(at), &mut listener).unwrap();
        assert_eq!(scheduler.is_running(), !is_over, "{input_dim} {at}");
    }
}

#[test]
fn a_filter_that_has_been_lost_gives_up_with_the_calibration_of_its_last_good_health() {
    let (mut scheduler, mut listener) = started(1);
    let follow = |scheduler: &mut Scheduler, s, state, listener: &mut Listener| {
        scheduler.hold(second(s), Some(&[0.0]), listener).unwrap();
        listener.1 = state;
        scheduler.lost_since(listener)
    };
    assert_eq!(follow(&mut scheduler, 1, State::Lost, &mut listener), None, "no limit is declared");
    scheduler.restart_lost(5.0);
    // Beliefs are noted ten seconds apart; that of second 2 is the last but one.
    let good = |scheduler: &mut Scheduler, s, listener: &mut Listener| {
        assert_eq!(follow(scheduler, s, State::Good, listener), None);
        known(scheduler, "scale")
    };
    let wanted = good(&mut scheduler, 2, &mut listener);
    measure(&mut scheduler, second(3), 9.0, &mut listener);
    good(&mut scheduler, 12, &mut listener);
    assert_eq!(follow(&mut scheduler, 20, State::Lost, &mut listener), None);
    assert_eq!(follow(&mut scheduler, 24, State::Lost, &mut listener), None);
    // A moment of another state begins the count anew.
    assert_eq!(follow(&mut scheduler, 25, State::Degraded, &mut listener), None);
    assert_eq!(follow(&mut scheduler, 26, State::Lost, &mut listener), None);
    assert_eq!(follow(&mut scheduler, 31, State::Lost, &mut listener), Some(second(26)));
    scheduler.give_up();
    assert!(!scheduler.is_running());
    scheduler
        .initialiser_row(COURSE, second(40), &row(2.0), Some(&[0.0]), &mut listener)
        .unwrap();
    assert_eq!(known(&scheduler, "scale"), wanted);
}

#[test]
fn an_attitude_that_a_gap_has_lost_is_replaced_by_that_of_the_initialisers_unless_they_agree() {
    let course = |scheduler: &mut Scheduler, s, value, listener: &mut Listener| {
        scheduler
            .initialiser_row(COURSE, second(s), &row(value), Some(&[0.0]), listener)
            .unwrap();
    };
    // After 0.2 s the 1σ is 0.49 rad, after three seconds 1.74 rad. An attitude of 0.52 rad is lost.
    for (gap, is_lost) in [(0.2, false), (3.0, true)] {
        let (mut scheduler, mut listener) = started(1);
        let before = known(&scheduler, "scale");
        scheduler
            .coast(Time::from_seconds(gap), Some(second(0)), None, &mut listener)
            .unwrap();
        let wanted = if is_lost { (2.0, 0.2) } else { known(&scheduler, "heading") };
        course(&mut scheduler, 4, 2.0, &mut listener);
        assert_eq!(
            (known(&scheduler, "heading"), known(&scheduler, "scale")),
            (wanted, before),
            "{gap}"
        );
        // The initialisers rest again.
        course(&mut scheduler, 5, 1.0, &mut listener);
        assert_eq!(known(&scheduler, "heading"), wanted);
    }
    // The filter has found its attitude itself, and the initialisers agree.
    let (mut scheduler, mut listener) = started(1);
    scheduler.coast(second(3), Some(second(0)), None, &mut listener).unwrap();
    let mut belief = scheduler.belief().clone();
    let heading = scheduler.estimator().layout().block("heading").unwrap().clone();
    belief.covariance.set_sigmas(&heading, &[0.05]);
    scheduler.estimator_mut().set_belief(belief);
    course(&mut scheduler, 4, 0.2, &mut listener);
    assert_eq!(known(&scheduler, "heading"), (0.1, 0.05));
}

#[test]
fn a_consumer_exists_if_a_unit_has_that_input() {
    let scheduler = scheduler(1);
    let exist = [Consumer::Initialiser(0, 0), Consumer::Aim(0), Consumer::Sensor(1, 0)];
    assert!(exist.iter().all(|consumer| scheduler.serves(*consumer)));
    let routes: Vec<Consumer> = scheduler.routes().map(|route| route.consumer).collect();
    assert_eq!(routes, [Consumer::Initialiser(0, 0), Consumer::Sensor(1, 0)]);
    let others = [
        Consumer::Input,
        Consumer::Initialiser(0, 1),
        Consumer::Stage(0, 0),
        Consumer::Sensor(0, 0),
        Consumer::Sensor(1, 1),
        Consumer::LAST,
    ];
    assert!(others.iter().all(|consumer| !scheduler.serves(*consumer)));
}

#[test]
fn a_scheduler_with_the_memory_of_another_is_in_the_same_phase() {
    let (mut running, mut listener) = started(1);
    measure(&mut running, second(1), 2.0, &mut listener);
    running.wait(Waiting {
        noise: 1.0,
        time: second(2),
        sensor: 0,
        row: 5,
    });
    let (mut aligning, _) = started(1);
    aligning.coast(second(3), Some(second(0)), None, &mut listener).unwrap();
    let (mut stopped, _) = started(1);
    stopped.stop();
    for original in [&mut running, &mut aligning, &mut stopped] {
        let mut twin = scheduler(1);
        crate::testing::check_memory(original, &mut twin).unwrap();
        assert_eq!(twin.is_running(), original.is_running());
        let [first, second] = [original, &mut twin].map(|scheduler| {
            let mut listener = Listener::default();
            scheduler
                .initialiser_row(COURSE, second(4), &row(2.0), Some(&[0.0]), &mut listener)
                .unwrap();
            (
                listener.0,
                known(scheduler, "heading"),
                scheduler.waiting().copied().collect::<Vec<_>>(),
            )
        });
        assert_eq!(first, second);
    }
}
