//! Two Gauss-Newton steps: the measurement is linearised again where the first step leads.
//!
//! With x₁ = x̂ ⊞ δ₁ from the first step, r₁ and H₁ at x₁: δ = K₁ (r₁ + H₁ δ₁). For a linear
//! measurement r₁ = r − H δ₁, so that δ is the δ of one step.
//! Not here  the change of the tangent space between x̂ and x₁

use fusion::core::filter::{Innovation, Problem, UpdateRule};

/// Two linearisations per measurement.
#[derive(Clone, Copy, Debug, Default)]
pub struct Twice;

impl UpdateRule for Twice {
    fn name(&self) -> &'static str {
        "twice"
    }

    fn condition(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
        work.gain();
        if !work.correct() {
            return false;
        }
        // The report contains the innovation of the prediction.
        let (predicted, residual) = (work.predicted.clone(), work.residual.clone());
        let (first, mut x) = (work.correction.clone(), problem.x.to_vec());
        problem.layout.plus(&mut x, &first);
        let again = problem.linearise_at(&x, work).is_ok() && {
            for i in 0..work.rows {
                work.residual[i] += (0..first.len()).map(|j| work.jacobian.get(i, j) * first[j]).sum::<f64>();
            }
            work.project(problem.covariance);
            work.factor()
        };
        if again {
            work.gain();
        }
        let is_finite = again && work.correct();
        (work.predicted, work.residual) = (predicted, residual);
        if is_finite {
            work.condition(problem.covariance);
        }
        is_finite
    }
}
