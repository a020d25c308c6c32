//! Each reason is provoked once, and once almost.

mod innovations;
mod parameters;
mod silence;

use super::*;
use crate::belief::Belief;
use crate::covariance::FormKind;
use crate::filter::{FilterError, Rivals, Update, Verdict};
use crate::gate::Mode;
use crate::linear::Jacobian;
use crate::runner::{Event, RowId};
use crate::state::{Attitude, Declaration, Dynamics, Layout, LayoutBuilder, Manifold, Scalar, StateRole, Vector, Velocity};
use alloc::sync::Arc;
use nalgebra::{SVector, UnitQuaternion, Vector3};

const POSITION: usize = 0;
const SPEED: usize = 1;
/// Fed by a stage.
const WHEELS: usize = 2;
/// A stream that only a stage reads.
const STREAM: StreamId = 7;

/// Blocks of the layout.
const VELOCITY: usize = 1;
const BIAS: usize = 2;
const SLOW: usize = 3;

fn block<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value, sigma: &[f64], role: StateRole, dynamics: Dynamics) {
    let declaration = Declaration {
        name: name.to_owned(),
        owner: String::new(),
        unit: "",
        initial,
        sigma: sigma.to_vec(),
        role,
        dynamics,
    };
    b.declare::<M>(declaration).unwrap();
}

fn layout() -> Layout {
    let mut b = LayoutBuilder::new();
    let moves = || (StateRole::Kinematic, Dynamics::Process);
    let (role, dynamics) = moves();
    block::<Attitude>(&mut b, "attitude", UnitQuaternion::identity(), &[0.02; 3], role, dynamics);
    let (role, dynamics) = moves();
    block::<Velocity>(&mut b, "velocity", Vector3::zeros(), &[0.1; 3], role, dynamics);
    // 0.1 at first; a variance of 0.01 is added in 100 s.
    let walk = Dynamics::RandomWalk { psd: vec![1e-4; 2] };
    block::<Vector<2>>(&mut b, "bias", SVector::zeros(), &[0.1; 2], StateRole::Calibration, walk);
    let slow = Dynamics::GaussMarkov {
        sigma: vec![3.2],
        tau: 600.0,
    };
    block::<Scalar>(&mut b, "slow", 0.0, &[3.2], StateRole::Nuisance, slow);
    b.finish()
}

fn apart(apart: f64) -> Rivals {
    Rivals { apart, ..Rivals::NONE }
}

fn at(t: f64) -> Time {
    Time::from_seconds(t)
}

/// A filter that is aligned at 0 s, and its inputs.
struct Bench {
    layout: Arc<Layout>,
    monitor: Monitor,
    belief: Belief,
    /// By sensor, if it is known.
    jacobians: [Option<Jacobian>; 3],
    /// 1σ of the innovations of each row.
    innovation: f64,
    rivals: Rivals,
}

impl Bench {
    /// A bench that ignores whether the motion is measured.
    fn new() -> Self {
        Self::with(Limits {
            unaided: f64::INFINITY,
            ..Limits::DEFAULT
        })
    }

    fn with(limits: Limits) -> Self {
        Self::of(layout(), limits)
    }

    fn of(layout: Layout, limits: Limits) -> Self {
        let layout = Arc::new(layout);
        let sensor = |rows, is_outside| Watched { rows, is_outside };
        let sensors = [sensor(3, true), sensor(3, true), sensor(2, false)];
        let monitor = Monitor::new(limits, &layout, sensors, [STREAM]);
        let belief = Belief::initial(&layout, &FormKind::Joseph.form(), at(0.0));
        let mut bench = Self {
            layout,
            monitor,
            belief,
            jacobians: [const { None }; 3],
            innovation: 1.0,
            rivals: Rivals::NONE,
        };
        let belief = bench.belief.clone();
        bench.hear(&Event::Started {
            belief: &belief,
            rivals: Rivals::NONE,
        });
        assert_eq!(bench.monitor.health().state, State::Good);
        bench
    }

    fn hear(&mut self, event: &Event<'_>) -> bool {
        event.sign().is_some_and(|sign| self.monitor.hear(sign))
    }

    fn estimate(&mut self, t: f64) {
        self.belief.time = at(t);
        let belief = self.belief.clone();
        self.hear(&Event::Estimate { belief: &belief });
    }

    fn update(&mut self, sensor: usize, t: f64, verdict: Verdict, nis: f64) {
        let jacobian = self.jacobians[sensor].clone();
        let update = Update {
            verdict,
            value: &[],
            predicted: &[],
            noise: &[],
            residual: &[],
            innovation_sigma: &[self.innovation; 3],
            innovation_factor: &[],
            nis,
            statistic: nis,
            threshold: 0.0,
            mode: Mode::Track,
            power: &[],
            weight: 1.0,
            rivals: self.rivals,
            jacobian: jacobian.as_ref(),
        };
        let row = RowId {
            stream: 0,
            number: 0,
            stamp: at(t),
            arrival: at(t),
            disturbed: false,
        };
        let time = at(t);
        self.hear(&Event::Updated { sensor, update, time, row });
    }

    /// The sensor measures these axes, each alone.
    fn measures(&mut self, sensor: usize, axes: &[usize]) {
        let mut h = Jacobian::new(&self.layout, axes.len());
        h.reset(axes.len());
        for (row, axis) in axes.iter().enumerate() {
            h.add_element(row, *axis, 1.0);
            // A lever arm gives the attitude a large share of the row, but the row does not measure it.
            if *axis >= 3 {
                h.add_element(row, 0, 100.0);
            }
        }
        self.jacobians[sensor] = Some(h);
    }

    /// Once a second, from `from` to `to`.
    fn updates(&mut self, sensor: usize, from: u32, to: u32, verdict: Verdict, nis: f64) {
        for t in from..=to {
            self.update(sensor, f64::from(t), verdict, nis);
            self.estimate(f64::from(t));
        }
    }

    fn reasons(&self) -> &[Reason] {
        let health = self.monitor.health();
        let worst = health.reasons.iter().map(|r| r.state()).max();
        assert_eq!(health.state, worst.unwrap_or(State::Good));
        &health.reasons
    }
}

use Verdict::{Accepted, Reacquired, Rejected};

#[test]
fn a_filter_aligns_until_its_attitude_is_certain() {
    let mut bench = Bench::new();
    let uncertain = |bench: &mut Bench, sigma: f64| {
        let block = bench.layout.blocks()[0].clone();
        bench.belief.covariance.set_sigmas(&block, &[0.02, 0.02, sigma]);
    };
    uncertain(&mut bench, 0.5);
    let belief = bench.belief.clone();
    assert!(bench.hear(&Event::Started {
        belief: &belief,
        rivals: Rivals::NONE,
    }));
    assert_eq!(bench.monitor.health().state, State::Aligning);
    uncertain(&mut bench, 0.262); // 15 deg are 0.2618
    bench.estimate(1.0);
    assert_eq!(bench.monitor.health().state, State::Aligning);
    uncertain(&mut bench, 0.261);
    bench.estimate(2.0);
    assert_eq!((bench.monitor.health().state, bench.monitor.health().since), (State::Good, at(2.0)));
    // It falls back at twice as much.
    uncertain(&mut bench, 0.523);
    bench.estimate(3.0);
    assert_eq!(bench.monitor.health().state, State::Good);
    uncertain(&mut bench, 0.524);
    bench.estimate(4.0);
    assert_eq!(bench.monitor.health().state, State::Aligning);
}

#[test]
fn a_gap_of_the_input_is_coasting_until_the_input_is_back() {
    let mut bench = Bench::new();
    let gap = |bench: &mut Bench, to: f64| {
        let (since, time) = (at(10.0), at(to));
        bench.hear(&Event::Coasting { since, time });
    };
    gap(&mut bench, 10.2);
    assert_eq!(bench.reasons(), []);
    bench.estimate(10.21);
    assert_eq!(bench.reasons(), [Reason::InputGap]);
    gap(&mut bench, 12.0);
    assert_eq!(bench.monitor.health().since, at(10.21));
    let (since, time) = (at(10.0), at(13.0));
    bench.hear(&Event::Resumed { since, time });
    assert_eq!(bench.reasons(), []);
}

#[test]
fn a_filter_with_rival_attitudes_is_aligning() {
    let mut bench = Bench::new();
    let belief = bench.belief.clone();
    bench.hear(&Event::Started {
        belief: &belief,
        rivals: apart(1.8),
    });
    assert_eq!(bench.monitor.health().state, State::Aligning);
    assert_eq!(bench.reasons(), [Reason::Undecided]);
    let tell = |bench: &mut Bench, rivals: f64, t: f64| {
        bench.rivals = apart(rivals);
        bench.update(POSITION, t, Accepted, 1.0);
        bench.estimate(t + 0.2);
        bench.monitor.health().state
    };
    // 15°, and twice that once aligned.
    assert_eq!(tell(&mut bench, 0.27, 1.0), State::Aligning);
    assert_eq!(tell(&mut bench, 0.26, 2.0), State::Good);
    assert_eq!(tell(&mut bench, 0.5, 3.0), State::Good);
    assert_eq!(tell(&mut bench, 0.53, 4.0), State::Aligning);
}

#[test]
fn a_filter_that_has_stopped_is_lost_until_it_starts_again() {
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 5, Rejected, 1e4);
    let (since, time) = (at(5.0), at(6.0));
    bench.hear(&Event::Stopped { since, time });
    assert_eq!(bench.reasons(), [Reason::Stopped]);
    bench.belief.time = at(7.0);
    let belief = bench.belief.clone();
    bench.hear(&Event::Started {
        belief: &belief,
        rivals: Rivals::NONE,
    });
    assert_eq!(bench.reasons(), []);
}

#[test]
fn a_refused_step_and_an_unsound_belief_are_lost_for_a_while() {
    let mut bench = Bench::new();
    bench.estimate(1.0);
    bench.hear(&Event::Failed {
        error: FilterError::Diverged(at(1.0)),
    });
    assert_eq!(bench.reasons(), [Reason::Refused]);
    bench.estimate(6.0);
    assert_eq!(bench.reasons(), [Reason::Refused]);
    bench.estimate(6.1);
    assert_eq!(bench.reasons(), []);
    let sound = bench.belief.clone();
    bench.belief.x[5] = f64::NAN;
    bench.estimate(7.0);
    assert_eq!(bench.reasons(), [Reason::Unsound]);
    bench.belief = sound;
    bench.estimate(12.1);
    assert_eq!(bench.reasons(), []);
}

#[test]
fn a_stream_that_is_stamped_ahead_degrades_until_ten_seconds_after() {
    let mut bench = Bench::new();
    bench.estimate(1.0);
    bench.hear(&Event::Ahead {
        stream: STREAM,
        by: 1.0,
        time: at(1.0),
    });
    for (t, reasons) in [
        (1.2, &[Reason::Ahead { stream: STREAM }][..]),
        (11.0, &[Reason::Ahead { stream: STREAM }]),
        (11.2, &[]),
    ] {
        bench.estimate(t);
        let told: Vec<_> = bench
            .reasons()
            .iter()
            .filter(|r| matches!(r, Reason::Ahead { .. }))
            .copied()
            .collect();
        assert_eq!(told, reasons, "{t}");
    }
}

#[test]
fn a_monitor_with_the_memory_of_another_goes_on_as_that_one_would() {
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 4, Rejected, 50.0);
    let mut twin = Bench::new();
    crate::testing::check_memory(&mut bench.monitor, &mut twin.monitor).unwrap();
    for bench in [&mut bench, &mut twin] {
        bench.updates(POSITION, 5, 40, Rejected, 50.0);
    }
    crate::testing::check_memory(&mut bench.monitor, &mut twin.monitor).unwrap();
    assert_eq!(bench.monitor.health(), twin.monitor.health());
    assert_eq!(twin.monitor.health().state, State::Lost);
}

/// Axes of the velocity.
const NORTH: usize = 3;
const EAST: usize = 4;
const DOWN: usize = 5;

#[test]
fn a_filter_whose_hypotheses_all_reject_for_longer_than_false_measurements_last_is_lost() {
    // 5 Hz: 0.01 · 0.8ⁿ⁻¹ · 1.8 million measurements in 100 h are one at n = 45, or 9 s.
    for (by_all, expected) in [(true, [State::Degraded, State::Lost]), (false, [State::Degraded; 2])] {
        let mut bench = Bench::new();
        for k in 1..=75 {
            let t = 0.2 * f64::from(k);
            bench.rivals.rejected = by_all && k > 20;
            let verdict = if k > 20 { Verdict::Rejected } else { Verdict::Accepted };
            let nis = if k > 20 { 100.0 } else { 3.0 };
            bench.update(POSITION, t, verdict, nis);
            bench.estimate(t);
            // 43 and 47 rejections.
            match k {
                63 => assert_eq!(bench.monitor.health().state, expected[0]),
                67 => assert_eq!(bench.monitor.health().state, expected[1]),
                _ => {}
            }
        }
    }
}
