//! Each reason is provoked once, and once almost.

use super::*;
use crate::covariance::FormKind;
use crate::filter::{FilterError, Update, Verdict};
use crate::gate::Mode;
use crate::linear::Jacobian;
use crate::runner::{Event, RowId};
use crate::state::{Attitude, Belief, Declaration, Dynamics, Layout, LayoutBuilder, Manifold, Scalar, StateRole, Vector, Velocity};
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

fn at(t: f64) -> Time {
    Time::from_seconds(t)
}

/// A filter that is aligned at 0 s, and what it is told.
struct Bench {
    layout: Layout,
    monitor: Monitor,
    belief: Belief,
    /// By sensor, where it is known.
    jacobians: [Option<Jacobian>; 3],
    /// 1σ of the innovations of each row.
    innovation: f64,
    rivals: f64,
}

impl Bench {
    /// Where it is no matter whether the motion is measured.
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
            rivals: 0.0,
        };
        let belief = bench.belief.clone();
        bench.hear(&Event::Started {
            belief: &belief,
            rivals: 0.0,
        });
        assert_eq!(bench.monitor.health().state, State::Good);
        bench
    }

    fn hear(&mut self, event: &Event<'_>) -> bool {
        self.monitor.hear(event)
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
            // A lever arm's attitude: much of the row, but not what it measures.
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
        rivals: 0.0,
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
        rivals: 1.8,
    });
    assert_eq!(bench.monitor.health().state, State::Aligning);
    assert_eq!(bench.reasons(), [Reason::Undecided]);
    let tell = |bench: &mut Bench, rivals: f64, t: f64| {
        bench.rivals = rivals;
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
        rivals: 0.0,
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
fn a_sigma_below_its_floor_degrades() {
    let mut bench = Bench::new();
    let block = bench.layout.blocks()[VELOCITY].clone();
    bench.belief.covariance.set_sigmas(&block, &[0.1, 1.01e-5, 0.1]);
    bench.estimate(1.0);
    assert_eq!(bench.reasons(), []);
    bench.belief.covariance.set_sigmas(&block, &[0.1, 0.99e-5, 0.1]);
    bench.estimate(2.0);
    assert_eq!(bench.reasons(), [Reason::Floor { block: VELOCITY }]);
}

#[test]
fn a_calibration_far_from_its_initial_value_degrades_unless_it_may_have_walked_there() {
    let mut bench = Bench::new();
    let bias = bench.layout.blocks()[BIAS].storage;
    bench.belief.x[bias + 1] = -0.49;
    bench.estimate(0.5);
    assert_eq!(bench.reasons(), []);
    bench.belief.x[bias + 1] = -0.51;
    bench.estimate(1.0);
    assert_eq!(bench.reasons(), [Reason::Calibration { block: BIAS }]);
    // 5 √(0.01 + 1e-4 · 100 s) = 0.707.
    bench.belief.x[bias + 1] = -0.7;
    bench.estimate(100.0);
    assert_eq!(bench.reasons(), []);
    bench.belief.x[bias + 1] = -0.72;
    bench.estimate(101.0);
    assert_eq!(bench.reasons(), [Reason::Calibration { block: BIAS }]);
}

#[test]
fn a_slow_error_many_of_its_stationary_sigmas_away_degrades() {
    let mut bench = Bench::new();
    let slow = bench.layout.blocks()[SLOW].storage;
    // 5 · 3.2.
    for (value, reasons) in [
        (-15.9, &[][..]),
        (-16.1, &[Reason::Calibration { block: SLOW }]),
        (16.1, &[Reason::Calibration { block: SLOW }]),
    ] {
        bench.belief.x[slow] = value;
        bench.estimate(bench.belief.time.seconds() + 1.0);
        assert_eq!(bench.reasons(), reasons, "{value}");
    }
}

#[test]
fn innovations_are_too_large_where_their_mean_is_and_not_where_one_is() {
    let mut bench = Bench::new();
    // 2.5² of 3 rows are 18.75.
    bench.updates(POSITION, 1, 60, Accepted, 18.0);
    assert_eq!(bench.reasons(), []);
    bench.updates(POSITION, 61, 90, Accepted, 20.0);
    assert_eq!(
        bench.reasons(),
        [Reason::Innovations {
            sensor: POSITION,
            lost: false
        }]
    );
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 10, Accepted, 3.0);
    bench.updates(POSITION, 11, 11, Accepted, 1e9);
    bench.updates(POSITION, 12, 30, Accepted, 3.0);
    bench.updates(POSITION, 31, 31, Accepted, f64::NAN);
    assert_eq!(bench.reasons(), []);
    bench.updates(POSITION, 32, 34, Accepted, 1e9);
    assert_eq!(
        bench.reasons(),
        [Reason::Innovations {
            sensor: POSITION,
            lost: true
        }]
    );
    // Half of ten measurements bring the mean back, and the reason is held for 5 s.
    bench.updates(POSITION, 35, 45, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
}

#[test]
fn innovations_of_a_fast_sensor_are_averaged_over_ten_seconds() {
    let mut bench = Bench::new();
    let told = |bench: &mut Bench, from: u32, to: u32, nis: f64| {
        for k in from..=to {
            let t = f64::from(k) * 0.01;
            bench.update(WHEELS, t, Accepted, nis);
            bench.estimate(t);
        }
        bench.reasons().to_vec()
    };
    // 4² σ for 3 s of 10 s: 16 − 13.5 e^{−0.3} = 6.0 < 9; for 9 s: 10.5.
    assert_eq!(told(&mut bench, 1, 300, 2.0 * 16.0), []);
    assert_eq!(
        told(&mut bench, 301, 900, 2.0 * 16.0),
        [Reason::Innovations {
            sensor: WHEELS,
            lost: false
        }]
    );
}

#[test]
fn a_sensor_rejected_for_long_degrades_where_its_covariance_does_not_explain_it() {
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 10, Accepted, 3.0);
    // 99.9 % of χ² of 3: 16.27. A follower of a rejected leader has a small one.
    bench.updates(POSITION, 11, 30, Rejected, 16.0);
    assert_eq!(bench.reasons(), []);
    bench.updates(POSITION, 31, 32, Rejected, 16.5);
    assert_eq!(bench.reasons(), []);
    bench.updates(POSITION, 33, 33, Rejected, 16.5);
    assert_eq!(
        bench.reasons(),
        [Reason::Rejected {
            sensor: POSITION,
            lost: false
        }]
    );
    bench.updates(POSITION, 34, 39, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
    // Three at 100 Hz are no streak.
    for k in 0..100 {
        bench.update(SPEED, 40.0 + 0.01 * f64::from(k), Rejected, 100.0);
        bench.estimate(40.0 + 0.01 * f64::from(k));
    }
    assert_eq!(bench.reasons(), []);
}

#[test]
fn rejections_on_either_side_of_a_long_pause_are_no_streak() {
    let mut bench = Bench::new();
    bench.updates(WHEELS, 1, 10, Accepted, 2.0);
    bench.updates(WHEELS, 11, 12, Rejected, 100.0);
    bench.updates(WHEELS, 100, 101, Rejected, 100.0);
    assert_eq!(bench.reasons(), []);
    bench.updates(WHEELS, 102, 102, Rejected, 100.0);
    assert_eq!(
        bench.reasons(),
        [Reason::Rejected {
            sensor: WHEELS,
            lost: false
        }]
    );
}

#[test]
fn two_sensors_rejected_at_once_degrade_at_once() {
    let mut bench = Bench::new();
    let rejected = |sensor| Reason::Rejected { sensor, lost: false };
    for sensor in [POSITION, SPEED, WHEELS] {
        bench.updates(sensor, 1, 10, Accepted, 2.0);
    }
    bench.update(POSITION, 11.0, Rejected, 100.0);
    bench.update(POSITION, 11.1, Rejected, 100.0);
    bench.update(WHEELS, 11.0, Rejected, 100.0);
    bench.update(WHEELS, 11.1, Rejected, 100.0);
    assert_eq!(bench.reasons(), []);
    // One of each comes by chance.
    bench.update(SPEED, 11.2, Rejected, 100.0);
    assert_eq!(bench.reasons(), []);
    bench.update(SPEED, 11.3, Rejected, 100.0);
    assert_eq!(bench.reasons(), [rejected(POSITION), rejected(SPEED)]);
    // Not by one that was rejected when it was last heard of, long ago.
    let mut bench = Bench::new();
    for sensor in [POSITION, SPEED] {
        bench.updates(sensor, 1, 10, Accepted, 2.0);
    }
    bench.update(POSITION, 11.0, Rejected, 100.0);
    bench.updates(SPEED, 11, 22, Accepted, 2.0);
    bench.update(SPEED, 22.5, Rejected, 100.0);
    assert_eq!(bench.reasons(), []);
    // One after the other, each used meanwhile.
    let mut bench = Bench::new();
    for (sensor, verdict) in [(POSITION, Rejected), (POSITION, Accepted), (SPEED, Rejected), (SPEED, Accepted)] {
        bench.update(sensor, 11.0, verdict, 100.0);
        assert_eq!(bench.reasons(), []);
    }
}

#[test]
fn a_filter_is_lost_when_all_that_comes_from_outside_has_been_rejected_for_long() {
    let lost = |sensor| Reason::Rejected { sensor, lost: true };
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 30, Rejected, 100.0);
    assert_eq!(bench.monitor.health().state, State::Degraded);
    // What a stage makes of the input does not support it.
    bench.update(WHEELS, 30.5, Accepted, 2.0);
    bench.updates(POSITION, 31, 31, Rejected, 100.0);
    assert_eq!(bench.reasons(), [lost(POSITION)]);
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 30, Rejected, 100.0);
    bench.update(SPEED, 30.5, Accepted, 2.0);
    bench.updates(POSITION, 31, 60, Rejected, 100.0);
    assert_eq!(
        bench.reasons(),
        [Reason::Rejected {
            sensor: POSITION,
            lost: false
        }]
    );
    // A pseudo-measurement alone does not make it so.
    let mut other = Bench::new();
    other.updates(WHEELS, 1, 60, Rejected, 100.0);
    assert_eq!(
        other.reasons(),
        [Reason::Rejected {
            sensor: WHEELS,
            lost: false
        }]
    );
    // Two that contradict it for so long need no third.
    for t in 61..=92 {
        bench.update(SPEED, f64::from(t), Rejected, 100.0);
        bench.update(POSITION, f64::from(t), Rejected, 100.0);
    }
    assert_eq!(bench.reasons(), [lost(POSITION), lost(SPEED)]);
}

#[test]
fn what_a_sensor_said_is_old_when_it_has_been_silent_for_as_long_as_innovations_are_averaged() {
    // The pseudo-measurement of a stage that has become silent; it is told for 5 s more.
    let mut bench = Bench::new();
    bench.updates(WHEELS, 1, 60, Accepted, 20.0);
    let told = Reason::Innovations {
        sensor: WHEELS,
        lost: false,
    };
    assert_eq!(bench.reasons(), [told]);
    for (t, reasons) in [(70.0, &[told][..]), (75.0, &[told]), (75.1, &[])] {
        bench.estimate(t);
        assert_eq!(bench.reasons(), reasons, "{t}");
    }
    let mut bench = Bench::new();
    bench.updates(WHEELS, 1, 60, Rejected, 100.0);
    bench.estimate(75.1);
    assert_eq!(bench.reasons(), []);
    // One from outside is silent then; a filter that it has lost stays lost.
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 60, Rejected, 100.0);
    bench.estimate(90.1);
    let lost = Reason::Rejected {
        sensor: POSITION,
        lost: true,
    };
    let silent = Reason::Silent {
        sensor: POSITION,
        replaced: false,
    };
    assert_eq!(bench.reasons(), [lost, silent]);
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
fn a_reacquired_sensor_degrades_until_it_is_proven() {
    let mut bench = Bench::new();
    bench.updates(POSITION, 1, 1, Reacquired, 100.0);
    assert_eq!(bench.reasons(), [Reason::Reacquired { sensor: POSITION }]);
    bench.updates(POSITION, 2, 16, Accepted, 3.0);
    assert_eq!(bench.reasons(), [Reason::Reacquired { sensor: POSITION }]);
    bench.updates(POSITION, 17, 17, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
    // A slow one takes five measurements.
    bench.update(SPEED, 20.0, Reacquired, 100.0);
    for k in 1..5 {
        bench.update(SPEED, 20.0 + 20.0 * f64::from(k), Accepted, 3.0);
    }
    assert!(bench.reasons().contains(&Reason::Reacquired { sensor: SPEED }));
}

/// A minute in good health, five seconds of rejected measurements, during which the bias moves by
/// `pull`; the NIS of them says whether the covariance explains it. The bias walks by 0.01² a second, with a σ of 0.02.
fn pulled(pull: f64, nis: f64) -> Bench {
    let mut bench = Bench::new();
    let block = bench.layout.blocks()[BIAS].clone();
    bench.belief.covariance.set_sigmas(&block, &[0.02; 2]);
    bench.updates(POSITION, 1, 70, Accepted, 3.0);
    bench.belief.x[block.storage] += pull;
    bench.updates(POSITION, 71, 75, Rejected, nis);
    bench
}

#[test]
fn a_parameter_that_was_pulled_away_is_told_until_it_is_learnt_anew() {
    let is_told = |bench: &Bench| bench.reasons().contains(&Reason::Pulled { block: BIAS });
    // The rejections are told from 73 s on. Its value of 30 s is looked back at then, and it may have
    // walked by 5 √(43 s · 0.01²/s) = 0.328.
    let mut bench = pulled(0.34, 100.0);
    assert!(is_told(&bench));
    // The rejections are told until 80 s. From then on a second leaves 0.02²/(0.02² + 0.01²) = 0.8 of
    // the pull: 0.34 · 0.8⁹ is beyond twice the σ, 0.34 · 0.8¹⁰ is not.
    bench.updates(POSITION, 76, 89, Accepted, 3.0);
    assert_eq!(bench.reasons(), [Reason::Pulled { block: BIAS }]);
    bench.updates(POSITION, 90, 91, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
    // What comes back is right at once.
    let mut bench = pulled(-0.34, 100.0);
    assert!(is_told(&bench));
    bench.updates(POSITION, 76, 80, Accepted, 3.0);
    let at = bench.layout.blocks()[BIAS].storage;
    bench.belief.x[at] = 0.039;
    bench.updates(POSITION, 81, 82, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
}

#[test]
fn a_parameter_that_its_covariance_lets_move_or_that_no_sensor_contradicts_is_not_pulled() {
    let not_told = |bench: Bench| !bench.reasons().contains(&Reason::Pulled { block: BIAS });
    assert!(not_told(pulled(0.32, 100.0)));
    // A follower of a rejected leader.
    assert!(not_told(pulled(0.4, 16.0)));
}

#[test]
fn a_sensor_that_falls_silent_degrades_after_thirty_of_its_own_periods() {
    let mut bench = Bench::new();
    for (sensor, period) in [(POSITION, 10.0), (SPEED, 0.1), (WHEELS, 0.1)] {
        for k in 0..5 {
            bench.update(sensor, period * f64::from(k), Accepted, 3.0);
        }
    }
    let silent = |sensor| Reason::Silent { sensor, replaced: false };
    // From 0.4 s on, for 5 s at least. What a stage emits may pause.
    bench.estimate(5.35);
    assert_eq!(bench.reasons(), []);
    bench.estimate(5.45);
    assert_eq!(bench.reasons(), [silent(SPEED)]);
    bench.estimate(339.0);
    assert_eq!(bench.reasons(), [silent(SPEED)]);
    bench.estimate(341.0);
    assert_eq!(bench.reasons(), [silent(POSITION), silent(SPEED)]);
}

#[test]
fn a_stream_of_a_stage_that_falls_silent_degrades() {
    let mut bench = Bench::new();
    for k in 0..10 {
        bench.monitor.row(STREAM, at(f64::from(k)));
        bench.monitor.row(STREAM + 1, at(0.1 * f64::from(k)));
    }
    bench.estimate(38.9);
    assert_eq!(bench.reasons(), []);
    bench.estimate(39.1);
    assert_eq!(bench.reasons(), [Reason::StreamSilent { stream: STREAM }]);
    bench.monitor.row(STREAM, at(40.0));
    bench.estimate(45.0);
    assert_eq!(bench.reasons(), []);
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
fn a_filter_is_lost_where_what_is_used_meanwhile_does_not_hold_most_of_the_motion() {
    let rejected = |lost| Reason::Rejected { sensor: POSITION, lost };
    for (others, lost) in [
        (&[0, 1, 2][..], true),
        (&[DOWN], true),
        (&[NORTH, EAST], false),
        (&[NORTH, EAST, DOWN], false),
    ] {
        let mut bench = Bench::new();
        bench.measures(POSITION, &[NORTH, EAST, DOWN]);
        bench.measures(SPEED, others);
        for t in 1..=31 {
            bench.update(SPEED, f64::from(t), Accepted, 3.0);
            bench.updates(POSITION, t, t, Rejected, 100.0);
        }
        assert!(bench.reasons().contains(&rejected(lost)), "{others:?}: {:?}", bench.reasons());
    }
    // A compass that alone is rejected is not right against all else.
    let mut bench = Bench::new();
    bench.measures(POSITION, &[NORTH, EAST, DOWN]);
    bench.measures(SPEED, &[2]);
    for t in 1..=60 {
        bench.update(POSITION, f64::from(t), Accepted, 3.0);
        bench.updates(SPEED, t, t, Rejected, 100.0);
    }
    assert_eq!(
        bench.reasons(),
        [Reason::Rejected {
            sensor: SPEED,
            lost: false
        }]
    );
}

#[test]
fn a_silent_sensor_degrades_unless_others_measure_what_it_does() {
    let silent = |replaced| Reason::Silent { sensor: SPEED, replaced };
    for (axes, replaced) in [
        (&[NORTH, EAST, DOWN][..], true),
        (&[NORTH], true),
        (&[2], false),
        (&[NORTH, 2], false),
    ] {
        let mut bench = Bench::new();
        bench.measures(POSITION, &[NORTH, EAST, DOWN]);
        bench.measures(SPEED, axes);
        bench.updates(SPEED, 1, 5, Accepted, 3.0);
        bench.updates(POSITION, 6, 34, Accepted, 3.0);
        assert_eq!(bench.reasons(), []);
        bench.updates(POSITION, 35, 36, Accepted, 3.0);
        assert_eq!(bench.reasons(), [silent(replaced)], "{axes:?}");
        let state = if replaced { State::Good } else { State::Degraded };
        assert_eq!(bench.monitor.health().state, state);
        // The other one away as well, for 30 of the periods of the first.
        if replaced {
            bench.estimate(66.1);
            assert!(bench.reasons().contains(&silent(false)), "{:?}", bench.reasons());
        }
    }
}

#[test]
fn nothing_that_measures_position_or_velocity_for_half_a_minute_degrades() {
    let never_silent = Limits {
        silent: f64::INFINITY,
        ..Limits::DEFAULT
    };
    // From the start.
    let mut bench = Bench::with(never_silent);
    bench.estimate(29.9);
    assert_eq!(bench.reasons(), []);
    bench.estimate(30.1);
    assert_eq!(bench.reasons(), [Reason::Unaided]);
    // By what a stage says as by what comes from outside; one direction of three is not enough.
    for (sensor, axes, is_aided) in [
        (SPEED, &[NORTH, EAST, DOWN][..], true),
        (WHEELS, &[EAST, DOWN], true),
        (WHEELS, &[DOWN], false),
        (SPEED, &[0, 1, 2], false),
    ] {
        let mut bench = Bench::with(never_silent);
        bench.measures(sensor, axes);
        bench.updates(sensor, 1, 40, Accepted, 3.0);
        let expected = if is_aided { &[][..] } else { &[Reason::Unaided] };
        assert_eq!(bench.reasons(), expected, "{axes:?}");
        bench.estimate(70.1);
        assert_eq!(bench.reasons(), [Reason::Unaided]);
    }
    // Of 101 m/s of noise one tells nothing of 0.1 m/s, of 99 it does.
    for (innovation, is_aided) in [(99.0, true), (101.0, false)] {
        let mut bench = Bench::with(never_silent);
        bench.innovation = innovation;
        bench.measures(SPEED, &[NORTH, EAST, DOWN]);
        bench.updates(SPEED, 1, 40, Accepted, 3.0);
        assert_eq!(bench.reasons().is_empty(), is_aided, "{innovation}");
    }
    // Three of its own periods are no matter.
    let mut bench = Bench::with(never_silent);
    bench.measures(SPEED, &[NORTH, EAST, DOWN]);
    for t in [20.0, 40.0, 60.0, 80.0] {
        bench.update(SPEED, t, Accepted, 3.0);
    }
    bench.estimate(139.9);
    assert_eq!(bench.reasons(), []);
    bench.estimate(140.1);
    assert_eq!(bench.reasons(), [Reason::Unaided]);
}

#[test]
fn a_velocity_in_the_axes_of_a_vehicle_that_goes_on_by_itself_has_to_be_measured_too() {
    let mut b = LayoutBuilder::new();
    block::<Attitude>(
        &mut b,
        "attitude",
        UnitQuaternion::identity(),
        &[0.02; 3],
        StateRole::Kinematic,
        Dynamics::Process,
    );
    // A diver who swims: nobody knows how fast.
    let swims = Dynamics::GaussMarkov {
        sigma: vec![0.3; 3],
        tau: 20.0,
    };
    block::<Vector<3>>(&mut b, "body_velocity", SVector::zeros(), &[0.3; 3], StateRole::Kinematic, swims);
    let layout = b.finish();
    let limits = Limits {
        silent: f64::INFINITY,
        ..Limits::DEFAULT
    };
    let mut bench = Bench::of(layout.clone(), limits);
    bench.estimate(30.1);
    assert_eq!(bench.reasons(), [Reason::Unaided]);
    // By a log he does.
    let mut bench = Bench::of(layout, limits);
    bench.measures(SPEED, &[NORTH, EAST, DOWN]);
    bench.updates(SPEED, 1, 40, Accepted, 3.0);
    assert_eq!(bench.reasons(), []);
}
