//! Laws of gates and losses.

use super::memory::check_memory;
use super::random::Lcg;
use crate::gate::{Answer, Decision, Gate, GateInput, Mode};
use crate::loss::Loss;
use crate::math;
use crate::time::Time;

/// The weight is 1 at no residual, in (0, 1] everywhere, and never grows with the residual.
///
/// # Errors
/// A sentence with the residual at fault.
pub fn check_loss(loss: &dyn Loss) -> Result<(), String> {
    for dim in 1..=6 {
        let mut before = 1.0;
        if loss.weight(0.0, dim) != 1.0 {
            return Err(format!("a zero residual has weight {}, not 1", loss.weight(0.0, dim)));
        }
        for k in 0..=2400 {
            // 1e-4 to 1e8 standard deviations.
            let norm = math::powf(10_f64, f64::from(k) / 200.0 - 4.0);
            let w = loss.weight(norm, dim);
            if !(w > 0.0 && w <= 1.0) {
                return Err(format!("the weight at |r| = {norm}, dimension {dim}, is {w}, outside (0, 1]"));
            }
            if w > before {
                return Err(format!("the weight grows to {w} at |r| = {norm}, dimension {dim}"));
            }
            before = w;
        }
    }
    Ok(())
}

/// A gate that receives residuals in units of √S, with S = 2 m² and HPHᵀ = R = 1 m². The filter uses all accepted
/// measurements, unless `fails` is set.
struct Feed<'a> {
    make: &'a dyn Fn() -> Box<dyn Gate>,
    gate: Box<dyn Gate>,
    time: f64,
    dim: usize,
    fails: bool,
}

impl<'a> Feed<'a> {
    fn new(make: &'a dyn Fn() -> Box<dyn Gate>, dim: usize) -> Self {
        Self {
            make,
            gate: make(),
            time: 0.0,
            dim,
            fails: false,
        }
    }

    fn judge(&mut self, after: f64, sigmas: &[f64]) -> Answer {
        self.time += after;
        let mut answer = None;
        self.offer(sigmas, |gate, input| answer = Some(gate.judge(input)));
        let answer = answer.unwrap_or(NO_ANSWER);
        self.gate.settle(answer.decision != Decision::Reject && !self.fails);
        answer
    }

    /// The power of the test `after` seconds from the latest measurement, in units of √S.
    fn power(&mut self, after: f64) -> Vec<f64> {
        let (mut smallest, now) = (vec![f64::NAN; self.dim], self.time);
        self.time += after;
        self.offer(&ZERO, |gate, input| gate.power(input, &mut smallest));
        self.time = now;
        smallest.iter().map(|s| s / math::sqrt(2_f64)).collect()
    }

    fn offer(&mut self, sigmas: &[f64], to: impl FnOnce(&mut dyn Gate, &GateInput<'_>)) {
        let m = self.dim;
        let diagonal = |v: f64| (0..m * m).map(|i| if i % (m + 1) == 0 { v } else { 0.0 }).collect::<Vec<_>>();
        let (one, two) = (diagonal(1.0), diagonal(2.0));
        let residual: Vec<f64> = sigmas[..m].iter().map(|s| s * math::sqrt(2_f64)).collect();
        let input = GateInput {
            time: Time::from_seconds(self.time),
            residual: &residual,
            predicted: &one,
            noise: &one,
            innovation: &two,
            nis: sigmas[..m].iter().map(|s| s * s).sum(),
            unit_nis: &vec![0.5; m],
            quality: None,
            others: &[],
        };
        to(self.gate.as_mut(), &input);
    }

    /// A copy with another gate, restored from the memory of this gate.
    fn copy(&mut self) -> Result<Self, String> {
        let mut gate = (self.make)();
        check_memory(self.gate.as_mut(), gate.as_mut())?;
        Ok(Self { gate, ..*self })
    }
}

/// The answer if the gate was not asked.
const NO_ANSWER: Answer = Answer {
    decision: Decision::Reject,
    statistic: f64::NAN,
    threshold: f64::NAN,
    mode: Mode::Track,
};

/// Rows of the largest residual tried: beyond any sensor here.
const ROWS: usize = 20;
const ZERO: [f64; ROWS] = [0.0; ROWS];
const ABSURD: [f64; ROWS] = [1e4; ROWS];

/// The laws of the gates that `make` makes:
///
/// - A gate accepts residuals that agree and rejects absurd ones.
/// - A gate restored from another gate's memory gives the same answers.
/// - The power that a gate reports is correct.
/// - A gate never accepts residuals that contradict each other.
/// - After any history, of a fast or a slow sensor, a gate follows consistent residuals again. This also holds if
///   the filter could not follow them the first time.
///
/// A gate that reports an infinite threshold is open and may accept anything.
///
/// # Errors
/// A sentence with the circumstances.
pub fn check_gate(make: &dyn Fn() -> Box<dyn Gate>) -> Result<(), String> {
    for dim in [1, 2, 3, 6, ROWS] {
        let told = |law: &str| Err(format!("dimension {dim}: {law}"));
        let mut feed = Feed::new(make, dim);
        for _ in 0..3 {
            let answer = feed.judge(1.0, &ZERO);
            if answer.decision != Decision::Accept || answer.mode != Mode::Track {
                return told("a residual of zero is not accepted");
            }
            if !answer.statistic.is_finite() {
                return told("a residual of zero has no finite statistic");
            }
        }
        copies_agree(make, dim)?;
        power_is_told(&mut feed)?;
        let absurd = feed.judge(1.0, &ABSURD);
        if absurd.threshold == f64::INFINITY {
            continue;
        }
        if absurd.decision != Decision::Reject {
            return told("a residual of 10,000 sigma is not rejected");
        }
        if feed.judge(1.0, &[f64::NAN; ROWS]).decision != Decision::Reject {
            return told("a residual that is no number is not rejected");
        }
        // Interference: far out, and no two alike.
        let mut feed = Feed::new(make, dim);
        feed.judge(1.0, &ZERO);
        for k in 0..600_u32 {
            let far = ABSURD.map(|a| if k % 2 == 0 { a } else { -a } * (1.0 + f64::from(k)));
            if feed.judge(1.0, &far).decision != Decision::Reject {
                return told("ten minutes of contradictory absurd residuals end in one being believed");
            }
        }
        if (0..20).all(|_| feed.judge(1.0, &ZERO).decision == Decision::Reject) {
            return told("after interference, residuals of zero are not followed again");
        }
        // An estimate gone wrong: the sensor agrees with itself, however slow it is.
        for period in [0.1, 1.0, 10.0, 60.0] {
            let mut feed = Feed::new(make, dim);
            feed.judge(1.0, &ZERO);
            if (0..3600).all(|_| feed.judge(period, &ABSURD).decision == Decision::Reject) {
                return Err(format!(
                    "dimension {dim}: 3600 consistent residuals, one every {period} s, are locked out"
                ));
            }
        }
        let mut feed = Feed::new(make, dim);
        feed.judge(1.0, &ZERO);
        feed.fails = true;
        if (0..3600).all(|_| feed.judge(1.0, &ABSURD).decision == Decision::Reject) {
            return told("an hour of consistent residuals is locked out");
        }
        if feed.judge(1.0, &ABSURD).decision != Decision::Reacquire {
            return told("a sensor that the filter could not re-acquire is not offered again at once");
        }
        let mut feed = Feed::new(make, dim);
        feed.judge(1.0, &ZERO);
        feed.judge(3600.0, &ABSURD);
        if (0..30).all(|_| feed.judge(1.0, &ABSURD).decision == Decision::Reject) {
            return told("after a pause of an hour consistent residuals are locked out");
        }
    }
    Ok(())
}

fn copies_agree(make: &dyn Fn() -> Box<dyn Gate>, dim: usize) -> Result<(), String> {
    let mut random = Lcg::new(dim as u64);
    let mut original = Feed::new(make, dim);
    for _ in 0..200 {
        let sigmas = ZERO.map(|_| 6.0 * random.signed());
        let mut copy = original.copy()?;
        let (a, b) = (original.judge(1.0, &sigmas), copy.judge(1.0, &sigmas));
        if a != b {
            return Err(format!(
                "dimension {dim}: one with the memory of the gate answers {b:?} where the gate answers {a:?}"
            ));
        }
    }
    Ok(())
}

/// For each row, an error of 1.001 times the power is rejected, and an error of 0.999 times the power is not. If the
/// power is infinite, even an absurd error is not rejected.
fn power_is_told(feed: &mut Feed<'_>) -> Result<(), String> {
    for (i, smallest) in feed.copy()?.power(1.0).into_iter().enumerate() {
        let mut decide = |sigmas: f64| {
            let mut residual = ZERO;
            residual[i] = sigmas;
            Ok::<_, String>(feed.copy()?.judge(1.0, &residual).decision)
        };
        let is_told = if smallest == f64::INFINITY {
            decide(ABSURD[0])? == Decision::Accept
        } else {
            decide(1.001 * smallest)? == Decision::Reject && decide(0.999 * smallest)? == Decision::Accept
        };
        if !is_told {
            return Err(format!(
                "dimension {}: not so that {smallest} sigma in row {i} is the least that is refused",
                feed.dim
            ));
        }
    }
    Ok(())
}
