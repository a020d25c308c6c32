//! Laws of gates and losses.

use super::random::Lcg;
use crate::gate::{Answer, Decision, Gate, GateInput, Mode};
use crate::loss::Loss;
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
            let norm = 10_f64.powf(f64::from(k) / 200.0 - 4.0);
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

/// A gate fed with residuals in units of √S, in metres of S = 2, HPHᵀ = R = 1.
struct Feed {
    gate: Box<dyn Gate>,
    time: f64,
    dim: usize,
}

impl Feed {
    fn new(gate: &dyn Gate, dim: usize) -> Self {
        Self {
            gate: gate.boxed_clone(),
            time: 0.0,
            dim,
        }
    }

    fn judge(&mut self, after: f64, sigmas: &[f64]) -> Answer {
        self.time += after;
        let m = self.dim;
        let diagonal = |v: f64| (0..m * m).map(|i| if i % (m + 1) == 0 { v } else { 0.0 }).collect::<Vec<_>>();
        let (one, two) = (diagonal(1.0), diagonal(2.0));
        let residual: Vec<f64> = sigmas[..m].iter().map(|s| s * 2_f64.sqrt()).collect();
        let nis = sigmas[..m].iter().map(|s| s * s).sum();
        let time = Time::from_seconds(self.time);
        self.gate.judge(&GateInput {
            time,
            residual: &residual,
            predicted: &one,
            noise: &one,
            innovation: &two,
            nis,
            others: &[],
        })
    }
}

/// Rows of the largest residual tried: beyond any sensor here.
const ROWS: usize = 20;
const ZERO: [f64; ROWS] = [0.0; ROWS];
const ABSURD: [f64; ROWS] = [1e4; ROWS];

/// A gate accepts what agrees and rejects what is absurd; a copy answers as the original; what
/// contradicts itself is never believed; and whatever happened, consistent residuals are
/// followed again. A gate that reports an infinite threshold is open and may accept anything.
///
/// # Errors
/// A sentence with the circumstances.
pub fn check_gate(gate: &dyn Gate) -> Result<(), String> {
    for dim in [1, 2, 3, 6, ROWS] {
        let told = |law: &str| Err(format!("dimension {dim}: {law}"));
        let mut feed = Feed::new(gate, dim);
        for _ in 0..3 {
            let answer = feed.judge(1.0, &ZERO);
            if answer.decision != Decision::Accept || answer.mode != Mode::Track {
                return told("a residual of zero is not accepted");
            }
            if !answer.statistic.is_finite() {
                return told("a residual of zero has no finite statistic");
            }
        }
        copies_agree(gate, dim)?;
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
        let mut feed = Feed::new(gate, dim);
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
        // An estimate gone wrong: the sensor agrees with itself.
        let mut feed = Feed::new(gate, dim);
        feed.judge(1.0, &ZERO);
        if (0..3600).all(|_| feed.judge(1.0, &ABSURD).decision == Decision::Reject) {
            return told("an hour of consistent residuals is locked out");
        }
        let mut feed = Feed::new(gate, dim);
        feed.judge(1.0, &ZERO);
        feed.judge(3600.0, &ABSURD);
        if (0..30).all(|_| feed.judge(1.0, &ABSURD).decision == Decision::Reject) {
            return told("after a pause of an hour consistent residuals are locked out");
        }
    }
    Ok(())
}

fn copies_agree(gate: &dyn Gate, dim: usize) -> Result<(), String> {
    let mut random = Lcg::new(dim as u64);
    let mut original = Feed::new(gate, dim);
    for _ in 0..200 {
        let sigmas = ZERO.map(|_| 6.0 * random.signed());
        let mut copy = Feed {
            gate: original.gate.boxed_clone(),
            time: original.time,
            dim,
        };
        let (a, b) = (original.judge(1.0, &sigmas), copy.judge(1.0, &sigmas));
        if a != b {
            return Err(format!(
                "dimension {dim}: a copy of the gate answers {b:?} where the gate answers {a:?}"
            ));
        }
    }
    Ok(())
}
