//! A heading that a gap has lost.

use super::*;
use crate::state::{Angle, Slot};

/// Turns by its input; in a gap by a radian a second.
#[derive(Debug)]
struct Turning(Slot<Angle>);

impl Process for Turning {
    fn input_dim(&self) -> usize {
        1
    }
    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        self.0.write(&(self.0.read(x) + input.sample[0] * dt), x);
    }
    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}
    fn coast(&self, _: &mut [f64], gap: &Gap, _: &[f64], sample: &mut [f64], out: &mut Transition) -> bool {
        sample[0] = 0.0;
        out.noise_up_to(self.0, &nalgebra::Vector1::new(gap.duration()), &nalgebra::Vector1::new(3.0));
        true
    }
}

/// Gives the heading from its latest row: 1σ 0.2 rad.
#[derive(Clone, Debug)]
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

/// Rates on stream 0, courses on stream 1; the course is read by an initialiser of `inputs`.
fn turning(inputs: Vec<Port>) -> Runner {
    let mut b = LayoutBuilder::new();
    let heading = declare::<Angle>(&mut b, "heading", 0.0, &[0.1], Dynamics::Process);
    let offset = declare::<Scalar>(&mut b, "offset", 7.0, &[0.5], Dynamics::Process);
    let process: Arc<dyn Process> = Arc::new(Turning(heading));
    let filter = Filter::new(Arc::new(b.finish()), process.clone(), Backend::default(), Size::same(1));
    let mut runner = Runner::new(Box::new(filter), process, 0.0);
    runner.add_stream("rate", 1);
    runner.add_stream("course", 1);
    runner.add_stream("offset", 1);
    runner.set_input(port(0));
    runner.add_sensor(Sensor {
        name: "offset".to_owned(),
        model: Arc::new(Direct(offset)),
        port: port(2),
        offset: None,
        constant: Vec::new(),
        noise: Noise::diagonal(&[1.0]),
        quality: None,
        gate: Box::new(Open),
        loss: Arc::new(Quadratic),
        switch: None,
    });
    runner.add_initialiser(InitialiserUnit {
        name: "course".to_owned(),
        initialiser: Box::new(Course(inputs.is_empty().then_some(2.5))),
        inputs,
    });
    runner
}

/// Rates of zero for 10 s but where `silent`, a course of 0.1 rad every second, and of 2.0 rad from 5 s on.
fn drive(silent: core::ops::Range<i64>) -> Rows {
    let mut rows = Vec::new();
    for k in 0..1000 {
        if !silent.contains(&k) {
            rows.push((0, centi(k), 0.0));
        }
        if k % 100 == 50 && !silent.contains(&k) {
            rows.push((1, centi(k), if k < 500 { 0.1 } else { 2.0 }));
        }
    }
    rows
}

/// The heading and its 1σ, then the offset and its 1σ, after the rows.
fn end(mut runner: Runner, rows: &Rows) -> [f64; 4] {
    feed(&mut runner, rows, &mut |_: &Event<'_>| {});
    runner.finish(&mut |_: &Event<'_>| {}).unwrap();
    let (belief, p) = (runner.belief(), runner.belief().covariance.to_dense());
    [belief.x[0], p[0].sqrt(), belief.x[1], p[3].sqrt()]
}

#[test]
fn a_heading_that_a_gap_has_lost_is_found_by_its_initialiser_and_all_else_stays() {
    // Three seconds of a radian a second: 1.7 rad. The course of the start was 0.1 rad.
    assert_eq!(end(turning(vec![port(1)]), &drive(400..700)), [2.0, 0.2, 7.0, 0.5]);
}

#[test]
fn a_heading_that_a_gap_has_kept_is_left_alone() {
    // 0.1 s: the start's 0.2 rad and 0.3 rad of the gap. No gap: the start's.
    for (silent, sigma) in [(0..0, 0.2), (400..411, 0.2_f64.hypot(0.11_f64.sqrt()))] {
        let [heading, found, ..] = end(turning(vec![port(1)]), &drive(silent));
        // 1e-12: rounding.
        assert!(heading == 0.1 && (found - sigma).abs() < 1e-12, "{heading} {found}");
    }
}

#[test]
fn what_a_designer_wrote_of_the_start_is_not_true_after_a_gap() {
    let [heading, sigma, ..] = end(turning(Vec::new()), &drive(400..700));
    assert!(heading == 2.5 && sigma > 1.5, "{heading} {sigma}");
}

#[test]
fn a_runner_that_waits_for_a_heading_is_restored_bit_for_bit() {
    let rows = drive(400..700);
    let wanted = end(turning(vec![port(1)]), &rows);
    let at = rows.iter().position(|row| row.1 > centi(710)).unwrap();
    let (mut first, mut second) = (turning(vec![port(1)]), turning(vec![port(1)]));
    feed(&mut first, &rows[..at].to_vec(), &mut |_: &Event<'_>| {});
    let mut bytes = Vec::new();
    crate::memory::save(&mut first, &mut bytes);
    crate::memory::restore(&mut second, &bytes).unwrap();
    assert_eq!(end(second, &rows[at..].to_vec()), wanted);
}
