//! The bank of hypotheses.

use super::*;
use crate::filter::{Bank, BankLimits};
use crate::gate::{FalseTracks, Hypotheses, OnlyWith};
use crate::state::{Angle, Position, Velocity};
use crate::testing::check_memory;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

const TRACKS: FalseTracks = FalseTracks {
    rate: 0.01,
    ends: 0.2,
    reach: 2000.0,
    speed: 2.0,
    wander: 0.1,
    lost: 1e-9,
};

/// A vehicle whose velocity walks by `walk` m/s per √s in each axis, or not where the noise is drawn.
#[derive(Debug)]
struct Drift {
    position: Slot<Position>,
    velocity: Slot<Velocity>,
    walk: f64,
}

impl Process for Drift {
    fn input_dim(&self) -> usize {
        0
    }
    fn propagate(&self, x: &mut [f64], _: &Input<'_>, dt: f64) {
        let moved = self.position.read(x) + self.velocity.read(x) * dt;
        self.position.write(&moved, x);
    }
    fn linearise(&self, _: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
        let q = self.walk * self.walk * dt;
        out.set(self.position, self.velocity, &(Matrix3::identity() * dt));
        out.noise(self.velocity, self.velocity, &(Matrix3::identity() * q));
    }
}

const WALK: f64 = 0.03;

fn drifting() -> (Filter, Slot<Position>) {
    let mut b = LayoutBuilder::new();
    let position = declare::<Position>(&mut b, "position", Vector3::zeros(), &[1.0; 3], Dynamics::Process);
    let velocity = declare::<Velocity>(&mut b, "velocity", Vector3::new(1.0, 0.0, 0.0), &[0.1; 3], Dynamics::Process);
    let process = Drift {
        position,
        velocity,
        walk: WALK,
    };
    (filter(b, process, 3), position)
}

fn bank(limits: BankLimits, tracks: FalseTracks) -> (Bank, Slot<Position>) {
    let bank = Bank::new(limits, || {
        let gate = Hypotheses::new(tracks, 0.999, Recovery::default());
        (Box::new(drifting().0), vec![Box::new(gate)])
    });
    (bank, drifting().1)
}

/// z = position.
#[derive(Debug)]
struct Fix(Slot<Position>);

impl Measurement for Fix {
    fn size(&self) -> Size {
        Size::same(3)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value.copy_from_slice(at.state(self.0).as_slice());
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add_slot(0, self.0, &Matrix3::identity());
        Ok(())
    }
}

const NOISE: [f64; 9] = [0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 0.25];

fn offer(estimator: &mut dyn Estimator, gate: &mut dyn Gate, model: &dyn Measurement, z: &Vector3<f64>) -> Verdict {
    let observed = Observed {
        sensor: 0,
        model,
        value: z.as_slice(),
        noise: &NOISE,
        quality: None,
        derivative_input: None,
        lateness: None,
    };
    estimator.update(&observed, gate, &[], &Quadratic).verdict
}

fn noise(r: &mut Lcg, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| sigma * r.normal())
}

#[test]
fn without_doubt_a_bank_is_its_estimator_bit_for_bit() {
    let ((mut alone, position), (mut bank, _)) = (drifting(), bank(BankLimits::DEFAULT, TRACKS));
    let (model, mut r) = (Fix(position), Lcg::new(3));
    for k in 1..=200 {
        for estimator in [&mut alone as &mut dyn Estimator, &mut bank] {
            estimator.predict(second(k), &Input::held(&[])).unwrap();
        }
        let z = Vector3::new(k as f64, 0.0, 0.0) + noise(&mut r, 0.4);
        let verdicts = (offer(&mut alone, &mut Open, &model, &z), offer(&mut bank, &mut Open, &model, &z));
        assert_eq!(verdicts, (Verdict::Accepted, Verdict::Accepted));
        assert_eq!((alone.belief(), bank.count()), (bank.belief(), 1));
    }
}

/// The end of an outage of 460 s in which the vehicle drifts as its process says. After it, fixes 700 m away agree
/// with each other and with the motion for 20 s. Returns the verdicts of the true fixes that follow for `after` s,
/// the distance at the end, and the largest number of hypotheses.
fn after_an_outage(
    estimator: &mut dyn Estimator,
    gate: &mut dyn Gate,
    position: Slot<Position>,
    seed: u64,
    after: i64,
) -> (Vec<Verdict>, f64) {
    let (model, mut r) = (Fix(position), Lcg::new(seed));
    let (mut truth, mut velocity) = (Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0) + noise(&mut r, 0.1));
    let aside = Vector3::new(0.0, 700.0, 0.0);
    let mut verdicts = Vec::new();
    let end = 20 + 460 + 20 + after;
    for k in 1..=end {
        truth += velocity;
        velocity += noise(&mut r, WALK);
        estimator.predict(second(k), &Input::held(&[])).unwrap();
        let shift = match k {
            ..=20 | 501.. => Some(Vector3::zeros()),
            21..=480 => None,
            _ => Some(aside),
        };
        let Some(shift) = shift else { continue };
        let verdict = offer(estimator, gate, &model, &(truth + shift + noise(&mut r, 0.5)));
        if k > 500 {
            verdicts.push(verdict);
        }
    }
    (verdicts, (position.read(&estimator.belief().x) - truth).norm())
}

/// Shorter than the 30 s after which the gate re-acquires.
const AFTER: i64 = 29;

#[test]
fn a_false_track_after_an_outage_does_not_capture_the_bank() {
    let is_used = |v: &Verdict| matches!(v, Verdict::Accepted | Verdict::Reacquired);
    let (mut captured, mut slowest) = ([0, 0], 0);
    for seed in 0..40 {
        let ((alone, position), (mut bank, _)) = (drifting(), bank(BankLimits::DEFAULT, TRACKS));
        let (verdicts, distance) = after_an_outage(&mut bank, &mut Open, position, seed, AFTER);
        captured[0] += u32::from(distance > 10.0);
        slowest = slowest.max(verdicts.iter().position(is_used).unwrap_or(usize::MAX));
        let (mut alone, mut gate) = (alone, Nis::new(0.999, Recovery::default()));
        captured[1] += u32::from(after_an_outage(&mut alone, &mut gate, position, seed, AFTER).1 > 10.0);
    }
    // After a pause, the gate believes five fixes that agree, and then rejects the true fixes for 30 s.
    println!("{captured:?} {slowest}");
    assert!(captured[0] == 0 && captured[1] > 30, "{captured:?}");
    // The true fixes need the same 20 s to outweigh the false fixes, and a few more for the cost of the switch.
    assert!(slowest <= 28, "the first true fix that counts is number {slowest}");
}

#[test]
fn an_estimate_that_is_wrong_beyond_its_covariance_is_found_again_by_true_fixes() {
    let tracks = FalseTracks {
        ends: 0.3,
        lost: 1e-4,
        ..TRACKS
    };
    let (mut bank, position) = bank(BankLimits::DEFAULT, tracks);
    let (model, mut r) = (Fix(position), Lcg::new(8));
    let (mut most, mut found) = (1, None);
    for k in 1..=120 {
        bank.predict(second(k), &Input::held(&[])).unwrap();
        // From 20 s on the vehicle is 300 m from where it can be.
        let aside = if k > 20 { 300.0 } else { 0.0 };
        let z = Vector3::new(k as f64, aside, 0.0) + noise(&mut r, 0.5);
        let verdict = offer(&mut bank, &mut Open, &model, &z);
        most = most.max(bank.count());
        if k > 20 && found.is_none() && verdict == Verdict::Reacquired {
            found = Some(k - 20);
        }
    }
    // A false track has to pay for continuing and for being found: 1e-4, and the velocity, which a lost estimate does
    // not know either.
    let found = found.unwrap();
    assert!((12..=60).contains(&found), "{found} s");
    assert!((2..=20).contains(&most), "{most}");
    assert!((position.read(&bank.belief().x) - Vector3::new(120.0, 300.0, 0.0)).norm() < 2.0);
    assert_eq!(bank.count(), 1, "nothing is in doubt at the end");
}

/// A walker who goes forward at a known speed; its heading turns the velocity.
#[derive(Debug)]
struct Walker {
    position: Slot<Position>,
    attitude: Slot<Attitude>,
}

const FORWARD: Vector3<f64> = Vector3::new(1.0, 0.0, 0.0);

impl Process for Walker {
    fn input_dim(&self) -> usize {
        0
    }
    fn propagate(&self, x: &mut [f64], _: &Input<'_>, dt: f64) {
        let moved = self.position.read(x) + self.attitude.read(x) * FORWARD * dt;
        self.position.write(&moved, x);
    }
    fn linearise(&self, x: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
        let c = self.attitude.read(x).to_rotation_matrix();
        out.set(self.position, self.attitude, &(-c.matrix() * FORWARD.cross_matrix() * dt));
    }
}

fn walking() -> (Filter, Slot<Position>, Slot<Attitude>) {
    let mut b = LayoutBuilder::new();
    let position = declare::<Position>(&mut b, "position", Vector3::zeros(), &[0.1; 3], Dynamics::Process);
    let attitude = declare::<Attitude>(
        &mut b,
        "attitude",
        UnitQuaternion::identity(),
        &[1e-3, 1e-3, 1.8],
        Dynamics::Process,
    );
    (filter(b, Walker { position, attitude }, 3), position, attitude)
}

#[test]
fn of_twelve_headings_the_true_one_survives() {
    let mut worst = [0.0_f64; 2];
    for seed in 0..30 {
        let mut r = Lcg::new(seed);
        let truth = UnitQuaternion::from_euler_angles(0.0, 0.0, core::f64::consts::PI * r.signed());
        let z: Vec<Vector3<f64>> = (1..=60).map(|k| truth * FORWARD * f64::from(k) + noise(&mut r, 0.5)).collect();
        for (worst, starts) in worst.iter_mut().zip([12, 1]) {
            let (f, position, attitude) = walking();
            let start = f.belief().clone();
            let limits = BankLimits {
                starts,
                ..BankLimits::DEFAULT
            };
            let mut bank = Bank::new(limits, || (Box::new(walking().0), vec![Box::new(Open)]));
            bank.set_belief(start);
            assert_eq!(bank.count(), starts);
            // The declared 1σ, which a full turn cuts off.
            assert_eq!(bank.rivals().apart > 1.0, starts > 1, "{}", bank.rivals().apart);
            for (k, z) in (1..).zip(&z) {
                bank.predict(second(k), &Input::held(&[])).unwrap();
                // Another start may be shown, but a fix without a gate is never rejected.
                assert_eq!(offer(&mut bank, &mut Open, &Fix(position), z), Verdict::Accepted);
            }
            assert!(bank.rivals().apart < 0.02, "{}", bank.rivals().apart);
            let error = attitude.read(&bank.belief().x).angle_to(&truth);
            *worst = worst.max(error.to_degrees());
        }
    }
    // 0.5 m over 60 fixes of up to 60 m: 0.3° of 1σ at most.
    assert!(worst[0] < 1.5 && worst[1] > 10.0, "{worst:?}");
}

#[test]
fn a_bank_in_doubt_continues_bit_for_bit_from_what_it_remembers() {
    let ((mut original, position), (mut twin, _)) = (bank(BankLimits::DEFAULT, TRACKS), bank(BankLimits::DEFAULT, TRACKS));
    let (model, mut r) = (Fix(position), Lcg::new(5));
    let mut next = |k: i64| {
        let aside = if (20..50).contains(&k) { 40.0 } else { 0.0 };
        Vector3::new(k as f64, aside, 0.0) + noise(&mut r, 0.5)
    };
    let go = |bank: &mut Bank, k: i64, z: &Vector3<f64>| {
        bank.predict(second(k), &Input::held(&[])).unwrap();
        offer(bank, &mut Open, &model, z)
    };
    let mut most = 0;
    for k in 1..=80 {
        let z = next(k);
        go(&mut original, k, &z);
        most = most.max(original.count());
        if k % 7 == 0 {
            check_memory(&mut original, &mut twin).unwrap();
            let z = next(k);
            let verdicts = [go(&mut original, k, &z), go(&mut twin, k, &z)];
            assert_eq!(
                (verdicts[0], original.belief(), original.count()),
                (verdicts[1], twin.belief(), twin.count())
            );
        }
    }
    assert!(most > 1, "it was in doubt: {most}");
}

#[test]
fn an_angle_that_is_hardly_known_is_tried_all_round() {
    let make = || {
        let mut b = LayoutBuilder::new();
        declare::<Scalar>(&mut b, "bias", 0.0, &[5.0], Dynamics::Constant);
        let angle = declare::<Angle>(&mut b, "angle", 1.0, &[2.0], Dynamics::Constant);
        (filter(b, Still, 1), angle)
    };
    let (f, angle) = make();
    let limits = BankLimits {
        starts: 8,
        ..BankLimits::DEFAULT
    };
    let mut bank = Bank::new(limits, || (Box::new(make().0), vec![Box::new(Open)]));
    bank.set_belief(f.belief().clone());
    assert_eq!((bank.count(), angle.read(&bank.belief().x)), (8, 1.0));
    let sigma: Vec<f64> = bank
        .layout()
        .blocks()
        .iter()
        .flat_map(|b| bank.belief().covariance.sigmas(b))
        .collect();
    // Half of an eighth of a turn; rounding of a product.
    assert!(
        (sigma[1] - core::f64::consts::PI / 8.0).abs() < 1e-15 && sigma[0] == 5.0,
        "{sigma:?}"
    );
    // One that is known well enough is left as it is.
    let mut known = f.belief().clone();
    known.covariance.set_sigmas(&f.layout().blocks()[1].clone(), &[0.3]);
    bank.set_belief(known);
    assert_eq!(bank.count(), 1);
}

/// A start that may point anywhere: the angle is a number in radians.
fn pointing() -> (Filter, Slot<Scalar>) {
    let mut b = LayoutBuilder::new();
    let offset = Declaration {
        name: "offset".to_owned(),
        owner: String::new(),
        unit: "rad",
        initial: 0.0,
        sigma: vec![100.0],
        role: StateRole::Calibration,
        dynamics: Dynamics::Constant,
    };
    let offset = b.declare::<Scalar>(offset).unwrap();
    (filter(b, Still, 1), offset)
}

/// A bank of eight such starts.
fn all_round(gates: impl Fn() -> Vec<Box<dyn Gate>>) -> Bank {
    let limits = BankLimits {
        starts: 8,
        switch: 1.0,
        ..BankLimits::DEFAULT
    };
    let mut bank = Bank::new(limits, || (Box::new(pointing().0), gates()));
    bank.set_belief(pointing().0.belief().clone());
    bank
}

fn tell(bank: &mut Bank, sensor: usize, model: &dyn Measurement, value: f64, variance: f64) -> Verdict {
    let observed = Observed {
        sensor,
        model,
        value: &[value],
        noise: &[variance],
        quality: None,
        derivative_input: None,
        lateness: None,
    };
    bank.update(&observed, &mut Open, &[], &Quadratic).verdict
}

#[test]
fn headings_that_are_possible_count_where_the_angle_is_a_number_in_radians() {
    let mut bank = all_round(|| vec![Box::new(Open)]);
    let (offset, eighth) = (pointing().1, core::f64::consts::FRAC_PI_4);
    // Weights that are almost the same: the mean square of 0, 1, 1, 2, 2, 3, 3 and 4 eighths of a turn.
    let expected = eighth * (44.0_f64 / 8.0).sqrt();
    assert!((bank.rivals().apart - expected).abs() < 0.01 * expected, "{}", bank.rivals().apart);
    assert_eq!((bank.rivals().count, bank.rivals().changed), (8, None));
    assert!((bank.rivals().probability - 0.125).abs() < 0.01, "{:?}", bank.rivals());
    // Another hypothesis is shown, and to some of the others the other way round is shorter.
    tell(&mut bank, 0, &Direct(offset), -3.0 * eighth, 100.0);
    assert!((offset.read(&bank.belief().x) + 3.0 * eighth).abs() < 0.01);
    // The measurement has little weight: the weight of the furthest hypothesis falls by 5 %.
    assert!((bank.rivals().apart - expected).abs() < 0.02 * expected, "{}", bank.rivals().apart);
}

#[test]
fn another_heading_that_is_shown_is_told_once_with_how_far_away_it_is() {
    let mut bank = all_round(|| vec![Box::new(Open)]);
    let (offset, eighth) = (pointing().1, core::f64::consts::FRAC_PI_4);
    // The heading that fits is three eighths of a turn from the first; the measurement hardly moves them.
    tell(&mut bank, 0, &Direct(offset), -3.0 * eighth, 100.0);
    let changed = bank.rivals().changed.unwrap();
    assert!((changed - 3.0 * eighth).abs() < 0.01, "{changed}");
    tell(&mut bank, 0, &Direct(offset), -3.0 * eighth, 100.0);
    assert_eq!(bank.rivals().changed, None);
}

/// z = sin of a state.
#[derive(Debug)]
struct Sine(Slot<Scalar>);

impl Measurement for Sine {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.state(self.0).sin();
        Ok(())
    }
    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add_slot(0, self.0, &Matrix1::new(at.state(self.0).cos()));
        Ok(())
    }
}

#[test]
fn what_is_left_out_with_another_measurement_leaves_the_weights_as_they_are() {
    let offset = pointing().1;
    for refuses in [true, false] {
        let mut bank = all_round(|| {
            let nis = || Box::new(Nis::new(0.999, Recovery::default()));
            vec![nis(), Box::new(OnlyWith::new(0, 10.0, nis()))]
        });
        let first = if refuses { 1e3 } else { 0.0 };
        let is_used = tell(&mut bank, 0, &Direct(offset), first, 100.0) == Verdict::Accepted;
        assert_eq!(is_used, !refuses);
        let before = (bank.count(), bank.rivals().apart);
        for _ in 0..20 {
            // Some hypotheses predict the measurement much better than others: S is from 1e-4 to 0.15.
            tell(&mut bank, 1, &Sine(offset), 0.3, 1e-4);
        }
        // 1e-9: rounding of logarithms.
        let stays = bank.count() == before.0 && (bank.rivals().apart - before.1).abs() < 1e-9;
        assert_eq!(stays, refuses, "{before:?} {} {}", bank.count(), bank.rivals().apart);
    }
}

/// A measurement that says nearly nothing about the angle; only its NIS differs from one value to the next.
const VAGUE: f64 = 1e6;

/// A bank of eight starts with two sensors: one with a `nis` gate, and its follower. The fix at zero was rejected by
/// the five starts that are a quarter of a turn or more away.
fn with_a_follower() -> Bank {
    let mut bank = all_round(|| {
        let nis = || Box::new(Nis::new(0.999, Recovery::default()));
        vec![nis(), Box::new(OnlyWith::new(0, 10.0, nis()))]
    });
    tell(&mut bank, 0, &Direct(pointing().1), 0.0, 0.01);
    bank
}

#[test]
fn a_follower_decides_nothing_between_those_that_reject_it_aside_and_those_that_use_it() {
    // NIS of 0, or of 9 in all three hypotheses that use it: better and worse than the expected 1, and accepted.
    for value in [0.0, 3.0 * VAGUE.sqrt()] {
        let mut bank = with_a_follower();
        let before = bank.rivals();
        assert!(before.count > 3, "{before:?}");
        for _ in 0..200 {
            tell(&mut bank, 1, &Direct(pointing().1), value, VAGUE);
        }
        let after = bank.rivals();
        assert_eq!(after.count, before.count, "{value}");
        // 200 such measurements move an angle known to 0.1 rad by less than 1e-3 rad.
        assert!((after.probability - before.probability).abs() < 1e-2, "{before:?} {after:?}");
    }
}

#[test]
fn a_follower_that_its_own_gate_rejects_counts_as_any_false_measurement() {
    let mut bank = with_a_follower();
    assert!(bank.belief().x[0].abs() < 0.5, "one that used the fix is shown");
    // No hypothesis explains it. Those that rejected the fix already expect that it is false.
    for _ in 0..3 {
        tell(&mut bank, 1, &Direct(pointing().1), 10.0 * VAGUE.sqrt(), VAGUE);
    }
    assert!(
        bank.belief().x[0].abs() > 0.5,
        "one that rejected the fix is shown: {}",
        bank.belief().x[0]
    );
}

#[test]
fn of_hypotheses_that_all_reject_none_wins_by_a_small_covariance() {
    let mut bank = all_round(|| vec![Box::new(Nis::new(0.999, Recovery::default()))]);
    let before = bank.rivals();
    for _ in 0..20 {
        // No sine is 9, and its S is from 1e-4 to 0.15.
        let verdict = tell(&mut bank, 0, &Sine(pointing().1), 9.0, 1e-4);
        assert_eq!((verdict, bank.rivals().rejected), (Verdict::Rejected, true));
    }
    let after = bank.rivals();
    assert_eq!(after.count, before.count);
    // 1e-9: rounding of logarithms.
    assert!((after.probability - before.probability).abs() < 1e-9, "{before:?} {after:?}");
}

#[test]
fn a_hypothesis_that_rejects_what_another_accepts_loses_a_million_at_each_measurement() {
    let nis = || vec![Box::new(Nis::new(0.999, Recovery::default())) as Box<dyn Gate>];
    let mut bank = all_round(nis);
    let (offset, eighth) = (pointing().1, core::f64::consts::FRAC_PI_4);
    // It fits the start at a quarter of a turn, and four others reject it; the neighbours of the start are 4 σ away.
    tell(&mut bank, 0, &Direct(offset), 2.0 * eighth, 1e-4);
    assert!((offset.read(&bank.belief().x) - 2.0 * eighth).abs() < 0.01);
    let mut told = 0;
    while bank.count() > 1 && told < 5 {
        tell(&mut bank, 0, &Direct(offset), 2.0 * eighth, 1e-4);
        told += 1;
    }
    // 1e-15, below which a hypothesis is dropped, is passed by the third.
    assert!(told <= 3, "{told} {}", bank.count());
}

#[test]
fn another_hypothesis_is_shown_once_it_is_more_probable_by_the_declared_factor() {
    let (offset, eighth) = (pointing().1, core::f64::consts::FRAC_PI_4);
    let mut needed = Vec::new();
    for switch in [10.0, 1e6] {
        let limits = BankLimits {
            starts: 8,
            switch,
            ..BankLimits::DEFAULT
        };
        let mut bank = Bank::new(limits, || (Box::new(pointing().0), vec![Box::new(Open)]));
        bank.set_belief(pointing().0.belief().clone());
        let mut ratio: f64 = 0.0;
        for k in 1.. {
            tell(&mut bank, 0, &Direct(offset), 4.0 * eighth, 25.0);
            if bank.rivals().changed.is_some() {
                needed.push(k);
                break;
            }
            // Half the NIS of the start that is shown, π²/25 at first, less as the measurements move it.
            ratio += 0.5 * (offset.read(&bank.belief().x) - 4.0 * eighth).powi(2) / 25.0;
            assert!(ratio < 1.2 * f64::ln(switch), "{k} {ratio}");
        }
    }

    assert!(needed[1] > needed[0], "{needed:?}");
}

#[test]
fn what_a_gate_rejects_in_doubt_is_also_followed_as_good() {
    let nis = || vec![Box::new(Nis::new(0.999, Recovery::default())) as Box<dyn Gate>];
    let (offset, half) = (pointing().1, core::f64::consts::FRAC_PI_8);
    // 4.2 σ from the last of the eight starts: a NIS of 17.6, which a gate with 0.999 rejects at 10.8. It is more
    // probably good than false, e^-8.3 against 1e-6.
    let value = core::f64::consts::PI + 4.2 * half;
    let mut bank = all_round(nis);
    for _ in 0..3 {
        tell(&mut bank, 0, &Direct(offset), value, 1e-6);
    }
    // The 1σ of the measurement is 1e-3.
    assert!((offset.read(&bank.belief().x) - value).abs() < 3e-3);
    // One start alone is the filter with its gate.
    let mut known = pointing().0.belief().clone();
    known.covariance.set_sigmas(&pointing().0.layout().blocks()[0].clone(), &[half]);
    let mut bank = Bank::new(BankLimits::DEFAULT, || (Box::new(pointing().0), nis()));
    bank.set_belief(known);
    let verdict = tell(&mut bank, 0, &Direct(offset), 4.2 * half, 1e-6);
    assert_eq!((verdict, bank.count()), (Verdict::Rejected, 1));
}
