//! Measurements taken outright: the state takes the measured value.
//!
//! Correction δ = H⁺ r,  H⁺ = Hᵀ (H Hᵀ)⁻¹: the smallest change of the state after which h, to first order,
//!            is the measurement. K = H⁺ does not depend on P, and no P is kept: P is zero throughout
//! Gates      see S = R. Estimates come without σ
//! Use        navigation by the latest value of each instrument: a position reset at a fix, an attitude from a
//!            reference. A baseline with which filters are compared

use super::rule::{Innovation, Problem, UpdateRule};
use crate::covariance::{cholesky, solve_rows};

/// Takes measurements outright, and keeps no covariance.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outright;

impl UpdateRule for Outright {
    fn name(&self) -> &'static str {
        "outright"
    }

    fn keeps_covariance(&self) -> bool {
        false
    }

    fn condition(&self, problem: &mut Problem<'_>, work: &mut Innovation) -> bool {
        let (m, n) = (work.rows, problem.layout.dim());
        let w = &mut work.work;
        let ld = w.ld;
        let squared = &mut work.trial.noise[..m * m];
        for i in 0..m {
            let row = work.jacobian.row(i);
            for j in 0..m {
                squared[i * m + j] = row.iter().zip(work.jacobian.row(j)).map(|(a, b)| a * b).sum();
            }
            let kt = &mut w.kt_mut()[i * ld..(i + 1) * ld];
            kt[..n].copy_from_slice(&row[..n]);
            kt[n..].fill(0.0);
        }
        // There is no such correction for rows that no state moves or that repeat each other.
        if !cholesky(squared, &mut w.l, m) {
            return false;
        }
        let l = core::mem::take(&mut w.l);
        solve_rows(&l, w.kt_mut(), m, ld);
        w.l = l;
        problem.covariance.clear();
        work.correct()
    }
}

#[cfg(test)]
mod tests {
    use crate::Time;
    use crate::filter::tests::declare;
    use crate::filter::{Backend, Estimator, Filter, Observed, UpdateKind, Verdict};
    use crate::gate::Open;
    use crate::linear::{Jacobian, Transition};
    use crate::loss::Quadratic;
    use crate::model::{Input, Measurement, Process, Size, Undefined};
    use crate::state::{Dynamics, LayoutBuilder, Quantity, Slot, Vector, View};
    use alloc::sync::Arc;
    use nalgebra::{Matrix1x2, Vector2};

    /// Moves by a metre a second and grows ever less certain.
    #[derive(Debug)]
    struct Drift(Slot<Vector<2>>);

    impl Process for Drift {
        fn input_dim(&self) -> usize {
            0
        }
        fn propagate(&self, x: &mut [f64], _: &Input<'_>, dt: f64) {
            let moved = self.0.read(x) + Vector2::new(dt, 0.0);
            self.0.write(&moved, x);
        }
        fn linearise(&self, _: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
            out.noise(self.0, self.0, &(nalgebra::Matrix2::identity() * dt));
        }
    }

    /// The row `a` of the state.
    #[derive(Debug)]
    struct Row(Quantity<Vector<2>>, Matrix1x2<f64>);

    impl Measurement for Row {
        fn size(&self) -> Size {
            Size::same(1)
        }
        fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
            value[0] = (self.1 * at.get(&self.0))[0];
            Ok(())
        }
        fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
            h.add(0, &self.0, &self.1);
            Ok(())
        }
    }

    #[test]
    fn the_state_becomes_what_is_measured_by_the_smallest_change_and_has_no_covariance() {
        let mut b = LayoutBuilder::new();
        let slot = declare::<Vector<2>>(&mut b, "place", Vector2::new(1.0, 2.0), &[5.0; 2], Dynamics::Process);
        let layout = Arc::new(b.finish());
        let backend = Backend {
            update: UpdateKind::Outright,
            ..Backend::ERROR_STATE
        };
        let mut filter = Filter::new(layout.clone(), Arc::new(Drift(slot)), backend, Size::same(1));
        filter.predict(Time::from_nanos(1_000_000_000), &Input::held(&[])).unwrap();
        let mut update = |row: Matrix1x2<f64>, value: f64| {
            let model = Row(slot.into(), row);
            let observed = Observed {
                sensor: 0,
                model: &model,
                value: &[value],
                noise: &[4.0],
                quality: None,
                derivative_input: None,
                lateness: None,
            };
            let update = filter.update(&observed, &mut Open, &[], &Quadratic);
            let (verdict, sigma) = (update.verdict, update.innovation_sigma[0]);
            let sigmas: Vec<f64> = layout.blocks().iter().flat_map(|b| filter.belief().covariance.sigmas(b)).collect();
            (verdict, sigma, slot.read(&filter.belief().x), sigmas)
        };
        let (verdict, sigma, x, sigmas) = update(Matrix1x2::new(1.0, 0.0), 7.0);
        assert_eq!((verdict, sigma, sigmas), (Verdict::Accepted, 2.0, vec![0.0; 2]));
        assert_eq!(x, Vector2::new(7.0, 2.0));
        // x + y = 11 from 9: one each. 4 ε: rounding of 1/√2 twice.
        let x = update(Matrix1x2::new(1.0, 1.0), 11.0).2;
        assert!((x - Vector2::new(8.0, 3.0)).amax() < 4e-15, "{x}");
        // A row that no state moves cannot be taken, and nothing changes.
        let (verdict, _, same, _) = update(Matrix1x2::new(0.0, 0.0), 1.0);
        assert_eq!((verdict, same), (Verdict::Unusable, x));
    }
}
