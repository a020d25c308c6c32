//! A gate that knows how false measurements behave, for a bank of hypotheses.

use super::{Answer, Gate, GateInput, Nis, Odds, Recovery};
use crate::covariance::cholesky;
use crate::math;
use crate::model::Literal;
use crate::model::literal::call;
use alloc::string::String;
use alloc::vec::Vec;
use core::f64::consts::PI;

/// How false measurements occur: one by one, or as a track that agrees with itself.
///
/// A measurement is good or false, and the next measurement depends on this (a Markov chain with two
/// states). A good measurement is distributed as the innovation, N(0, S). The first false measurement of a track may
/// be anywhere within `reach`. Later ones move at a constant velocity, seen from the estimate, up to
/// their noise and `wander`. Good measurements between them do not end a track: the sensor may receive two vehicles
/// in turn. After Reid, *An algorithm for tracking multiple targets*, IEEE TAC 24
/// (1979), with a track of false measurements in place of independent clutter.
#[derive(Clone, Copy, Debug, Literal, PartialEq)]
#[literal(at = "fusion_core::gate")]
pub struct FalseTracks {
    /// The probability that a measurement is false after a good one, in (0, 1).
    pub rate: f64,
    /// The probability that a measurement is good after a false one, in (0, 1).
    pub ends: f64,
    /// How far from the estimate a false measurement may be, in the unit of the residual.
    pub reach: f64,
    /// How fast a false track may move, seen from the estimate: 1σ per row, in the unit of the residual per
    /// second. It includes the error of the estimate's own velocity.
    pub speed: f64,
    /// The random walk of that velocity within a second: 1σ per row.
    pub wander: f64,
    /// The probability that a good measurement finds the estimate wrong beyond its covariance.
    pub lost: f64,
}

/// The share of the false measurements after a false one that jump away from the track.
const JUMPS: f64 = 0.01;

/// The share of the false measurements after a good one that do not return to the earlier false track.
const ANOTHER: f64 = 0.5;

/// One row of a false track: its residual and the rate of that, with their covariance.
#[derive(Clone, Copy, Debug, Default)]
struct Along {
    residual: f64,
    rate: f64,
    /// Variance of the residual, covariance of both, variance of the rate.
    p: [f64; 3],
}

crate::memory!(Along { residual, rate, p });

impl Along {
    /// At the first false measurement.
    const fn begun(residual: f64, noise: f64, speed: f64) -> Self {
        Self {
            residual,
            rate: 0.0,
            p: [noise, 0.0, speed * speed],
        }
    }

    /// `dt` later; the rate is a random walk of intensity `q`.
    fn moved(self, dt: f64, q: f64) -> Self {
        let [a, b, c] = self.p;
        Self {
            residual: self.residual + self.rate * dt,
            rate: self.rate,
            p: [
                a + dt * (2.0 * b + dt * (c + q * dt / 3.0)),
                b + dt * (c + 0.5 * q * dt),
                c + q * dt,
            ],
        }
    }

    fn corrected(self, residual: f64, noise: f64) -> Self {
        let [a, b, c] = self.p;
        let (s, off) = (a + noise, residual - self.residual);
        Self {
            residual: self.residual + a / s * off,
            rate: self.rate + b / s * off,
            p: [a * noise / s, b * noise / s, c - b * b / s],
        }
    }
}

/// A false track, row by row.
#[derive(Clone, Debug, Default)]
struct Track {
    time: f64,
    rows: Vec<Along>,
}

crate::memory!(Track { time, rows });

/// A measurement at hand, kept until it is known what became of it.
#[derive(Clone, Debug, Default)]
struct AtHand {
    time: f64,
    residual: Vec<f64>,
    /// Of each row.
    noise: Vec<f64>,
    /// By how much the estimate moves if it is used, as the sensor sees it.
    shift: Vec<f64>,
}

/// A NIS gate outside a bank; inside a bank, a gate that gives the odds of a measurement.
///
/// Inside a bank, its own test is not used: hypotheses are weighted by [`Gate::odds`]. Each hypothesis has a
/// copy of the gate, with the memory of the measurements that are false in this hypothesis.
#[derive(Clone, Debug)]
pub struct Hypotheses {
    tracks: FalseTracks,
    alone: Nis,
    /// Where the latest measurement was false.
    track: Track,
    is_false: bool,
    at_hand: AtHand,
}

crate::memory!(Hypotheses { alone, track, is_false; tracks, at_hand });

impl Hypotheses {
    /// A gate before its first measurement. `probability` and `recovery` belong to the gate's own NIS test.
    #[must_use]
    pub fn new(tracks: FalseTracks, probability: f64, recovery: Recovery) -> Self {
        Self::from_literal(tracks, Nis::new(probability, recovery))
    }

    #[doc(hidden)]
    #[must_use]
    pub fn from_literal(tracks: FalseTracks, alone: Nis) -> Self {
        Self {
            tracks,
            alone,
            track: Track::default(),
            is_false: false,
            at_hand: AtHand::default(),
        }
    }

    /// Row `i` of the false track, at `time`.
    fn along(&self, i: usize, time: f64) -> Along {
        let dt = (time - self.track.time).max(0.0);
        self.track.rows[i].moved(dt, self.tracks.wander * self.tracks.wander)
    }

    /// ln of the density of a false measurement, given whether the latest measurement was false.
    fn false_density(&self, input: &GateInput<'_>) -> f64 {
        let m = input.residual.len();
        let anywhere = -(m as f64) * math::ln(2.0 * self.tracks.reach);
        if self.track.rows.len() != m {
            return anywhere;
        }
        let jumps = if self.is_false { JUMPS } else { ANOTHER };
        let time = input.time.seconds();
        let of_row = |i: usize| {
            let along = self.along(i, time);
            let variance = along.p[0] + input.noise[i * m + i];
            let off = input.residual[i] - along.residual;
            -0.5 * (off * off / variance + math::ln(2.0 * PI * variance))
        };
        let stays: f64 = (0..m).map(of_row).sum();
        log_sum(stays + math::ln(1.0 - jumps), anywhere + math::ln(jumps))
    }

    /// The measurement at hand is false: it begins a track, or updates the existing track.
    fn follow(&mut self) {
        let m = self.at_hand.residual.len();
        let time = self.at_hand.time;
        let goes_on = self.track.rows.len() == m && (0..m).all(|i| self.is_along(i, time));
        self.track.rows.resize(m, Along::default());
        for i in 0..m {
            let (residual, noise) = (self.at_hand.residual[i], self.at_hand.noise[i]);
            self.track.rows[i] = if goes_on {
                self.along(i, time).corrected(residual, noise)
            } else {
                Along::begun(residual, noise, self.tracks.speed)
            };
        }
        self.track.time = time;
    }

    /// Computes how far the measurement would move the estimate, seen through the sensor: by P S⁻¹ r, or by the whole
    /// residual if it `reacquires`.
    fn foresee_shift(&mut self, input: &GateInput<'_>, reacquires: bool) {
        let m = input.residual.len();
        self.at_hand.shift.clear();
        self.at_hand.shift.extend_from_slice(input.residual);
        let Some(y) = solve(input.innovation, input.residual).filter(|_| !reacquires) else {
            return;
        };
        for (row, shift) in input.predicted.chunks_exact(m).zip(&mut self.at_hand.shift) {
            *shift = row.iter().zip(&y).map(|(p, y)| p * y).sum();
        }
    }

    /// The measurement at hand has moved the estimate, from which the track is seen.
    fn seen_from_there(&mut self) {
        let (m, time) = (self.at_hand.shift.len(), self.at_hand.time);
        if self.track.rows.len() != m {
            return;
        }
        for i in 0..m {
            let along = self.along(i, time);
            let residual = along.residual - self.at_hand.shift[i];
            self.track.rows[i] = Along { residual, ..along };
        }
        self.track.time = time;
    }

    /// Whether row `i` of the measurement at hand continues the track; a row far from the track has jumped.
    fn is_along(&self, i: usize, time: f64) -> bool {
        let along = self.along(i, time);
        let off = self.at_hand.residual[i] - along.residual;
        off * off <= FAR * FAR * (along.p[0] + self.at_hand.noise[i])
    }
}

/// A measurement further from a false track than this number of σ begins another track.
const FAR: f64 = 5.0;

/// Rows of the largest residual that is weighed; more are judged by the gate's own test.
const ROWS: usize = 12;

/// L of s = L Lᵀ and y of L y = x, for an m-vector; `None` if `s` is not positive definite.
fn whitened(x: &[f64], s: &[f64]) -> Option<([f64; ROWS * ROWS], [f64; ROWS])> {
    let m = x.len();
    let (mut l, mut y) = ([0.0; ROWS * ROWS], [0.0; ROWS]);
    if m > ROWS || !cholesky(s, &mut l[..m * m], m) {
        return None;
    }
    for i in 0..m {
        let known: f64 = (0..i).map(|j| l[i * m + j] * y[j]).sum();
        y[i] = (x[i] - known) / l[i * m + i];
    }
    Some((l, y))
}

/// ln N(x; 0, s) of an m-vector; `None` if `s` is not positive definite.
pub(crate) fn log_normal(x: &[f64], s: &[f64]) -> Option<f64> {
    let m = x.len();
    let (l, y) = whitened(x, s)?;
    let nis: f64 = y[..m].iter().map(|y| y * y).sum();
    let det: f64 = (0..m).map(|i| math::ln(l[i * m + i])).sum();
    Some(-0.5 * nis - det - 0.5 * m as f64 * math::ln(2.0 * PI))
}

/// S⁻¹ x of an m-vector; `None` if `s` is not positive definite.
fn solve(s: &[f64], x: &[f64]) -> Option<[f64; ROWS]> {
    let m = x.len();
    let (l, mut y) = whitened(x, s)?;
    for i in (0..m).rev() {
        let known: f64 = (i + 1..m).map(|j| l[j * m + i] * y[j]).sum();
        y[i] = (y[i] - known) / l[i * m + i];
    }
    Some(y)
}

/// ln(eᵃ + eᵇ).
pub(crate) fn log_sum(a: f64, b: f64) -> f64 {
    let (more, less) = if a > b { (a, b) } else { (b, a) };
    more + math::ln_1p(math::exp(less - more))
}

impl Literal for Hypotheses {
    /// Before its first measurement.
    fn expression(&self, out: &mut String) {
        call(out, "::fusion_core::gate::Hypotheses::from_literal", &[&self.tracks, &self.alone]);
    }
}

impl Gate for Hypotheses {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        let m = input.residual.len();
        self.at_hand.time = input.time.seconds();
        self.at_hand.residual.clear();
        self.at_hand.residual.extend_from_slice(input.residual);
        self.at_hand.noise.clear();
        self.at_hand.noise.extend((0..m).map(|i| input.noise[i * m + i]));
        let answer = self.alone.judge(input);
        self.foresee_shift(input, answer.statistic > answer.threshold);
        answer
    }

    fn settle(&mut self, is_used: bool) {
        if is_used {
            self.seen_from_there();
        } else {
            self.follow();
        }
        self.is_false = !is_used;
        self.alone.settle(is_used);
    }

    fn power(&self, input: &GateInput<'_>, smallest: &mut [f64]) {
        self.alone.power(input, smallest);
    }

    fn odds(&self, input: &GateInput<'_>) -> Option<Odds> {
        let FalseTracks { rate, ends, lost, .. } = self.tracks;
        let m = input.residual.len();
        let good = log_normal(input.residual, input.innovation)?;
        let becomes_false = if self.is_false { 1.0 - ends } else { rate };
        let is_good = math::ln(1.0 - becomes_false);
        Some(Odds {
            good: good + is_good,
            bad: self.false_density(input) + math::ln(becomes_false),
            lost: math::ln(lost) + is_good - m as f64 * math::ln(2.0 * self.tracks.reach),
        })
    }

    crate::literal!();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::check_gate;
    use crate::time::Time;

    const TRACKS: FalseTracks = FalseTracks {
        rate: 0.01,
        ends: 0.05,
        reach: 1000.0,
        speed: 1.0,
        wander: 0.1,
        lost: 1e-9,
    };

    fn gate() -> Hypotheses {
        Hypotheses::new(TRACKS, 0.999, Recovery::default())
    }

    fn input<'a>(time: f64, residual: &'a [f64; 2], predicted: &'a [f64; 4], innovation: &'a [f64; 4]) -> GateInput<'a> {
        GateInput {
            time: Time::from_seconds(time),
            residual,
            predicted,
            noise: &[1.0, 0.0, 0.0, 1.0],
            innovation,
            nis: 0.0,
            unit_nis: &[0.5; 2],
            quality: None,
            others: &[],
        }
    }

    #[test]
    fn by_itself_it_obeys_the_laws_of_gates() {
        check_gate(&|| Box::new(gate())).unwrap();
    }

    #[test]
    fn densities_are_those_of_the_normal_distribution() {
        // Of one row: (2π 4)^-½ e^(-9/8).
        let one = log_normal(&[3.0], &[4.0]).unwrap();
        assert!((one - (-9.0 / 8.0 - 0.5 * (8.0 * PI).ln())).abs() < 1e-14);
        // Of two with a correlation: by the inverse of S, det 3.
        let two = log_normal(&[1.0, -1.0], &[2.0, 1.0, 1.0, 2.0]).unwrap();
        assert!((two - (-1.0 - 0.5 * 3.0_f64.ln() - (2.0 * PI).ln())).abs() < 1e-14);
        assert_eq!(log_normal(&[1.0], &[-1.0]), None);
        assert!((log_sum(2.0_f64.ln(), 3.0_f64.ln()) - 5.0_f64.ln()).abs() < 1e-15);
        assert_eq!(log_sum(-1e9, 0.0), 0.0);
    }

    #[test]
    fn a_false_track_is_expected_to_go_on_where_it_was() {
        let (p, s) = ([1.0, 0.0, 0.0, 1.0], [2.0, 0.0, 0.0, 2.0]);
        let mut gate = gate();
        let fresh = gate.odds(&input(0.0, &[300.0, 0.0], &p, &s)).unwrap();
        // ln 0.01 - 2 ln 2000.
        assert!((fresh.bad - (0.01_f64.ln() - 2.0 * 2000.0_f64.ln())).abs() < 1e-12);
        assert!(fresh.good < fresh.lost && fresh.lost < fresh.bad, "{fresh:?}");
        gate.judge(&input(0.0, &[300.0, 0.0], &p, &s));
        gate.settle(false);
        let on = gate.odds(&input(1.0, &[300.0, 0.0], &p, &s)).unwrap();
        // ln 0.95 + ln(0.99 N(0; S) + …), S of two measurements, the velocity of the track, and its walk.
        let wanted = |variance: f64| 0.95_f64.ln() + 0.99_f64.ln() - (2.0 * PI * variance).ln();
        let first = 1.0 + 1.0 + 0.01 / 3.0;
        assert!((on.bad - wanted(first + 1.0)).abs() < 1e-5, "{} {}", on.bad, wanted(first + 1.0));
        // Position and velocity of the track become known, so its next measurement becomes more and more probable.
        let mut before = on.bad;
        for k in 1..20 {
            let residual = [300.0 + 0.7 * f64::from(k), 0.0];
            gate.judge(&input(f64::from(k), &residual, &p, &s));
            gate.settle(false);
            let next = [300.0 + 0.7 * f64::from(k + 1), 0.0];
            let on = gate.odds(&input(f64::from(k + 1), &next, &p, &s)).unwrap();
            assert!(k == 1 || on.bad > before - 1e-3, "{k}: {} {before}", on.bad);
            before = on.bad;
        }
        // A measurement of a well-known track is as probable as a good measurement: S is little more than R.
        assert!(before > wanted(1.6), "{before}");
        // A measurement at the expected place of the vehicle is good: the track has ended.
        let back = gate.odds(&input(20.0, &[0.5, 0.0], &p, &s)).unwrap();
        assert!(back.good > back.bad + 5.0, "{back:?}");
        gate.judge(&input(20.0, &[0.5, 0.0], &p, &s));
        gate.settle(true);
        // The track is remembered, a quarter of a metre nearer: the estimate has moved by P S⁻¹ r.
        let bad = |x: f64| gate.odds(&input(21.0, &[x, 0.0], &p, &s)).unwrap().bad;
        let place = 300.0 + 0.7 * 21.0 - 0.25;
        assert!(bad(place) > fresh.bad + 9.0, "{} {}", bad(place), fresh.bad);
        assert!(bad(place) > bad(place - 0.25) && bad(place) > bad(place + 0.25));
        // Half of the false measurements after a good one begin elsewhere; the track contributes nothing at −300.
        assert!((bad(-300.0) - (fresh.bad - 2.0_f64.ln())).abs() < 1e-9, "{}", bad(-300.0));
    }

    #[test]
    fn a_track_is_seen_from_where_the_estimate_has_gone() {
        let (p, s) = ([1.0, 0.5, 0.5, 2.0], [2.0, 0.5, 0.5, 3.0]);
        // A residual inside the test moves the estimate by P S⁻¹ r; a residual that re-acquires moves it by r.
        for (residual, moved) in [([1.0, -1.0], [2.25 / 5.75, -3.25 / 5.75]), ([100.0, 0.0], [100.0, 0.0])] {
            let mut gate = gate();
            gate.judge(&input(0.0, &[300.0, -20.0], &p, &s));
            gate.settle(false);
            let nis = if residual[0] > 50.0 { 1e4 } else { 1.0 };
            gate.judge(&GateInput {
                nis,
                ..input(1.0, &residual, &p, &s)
            });
            gate.settle(true);
            let seen = [gate.track.rows[0].residual, gate.track.rows[1].residual];
            assert!(
                (seen[0] - 300.0 + moved[0]).abs() < 1e-12 && (seen[1] + 20.0 + moved[1]).abs() < 1e-12,
                "{seen:?}"
            );
        }
    }
}
