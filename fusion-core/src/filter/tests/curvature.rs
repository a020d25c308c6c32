//! Measurements of an attitude that is hardly known.

use super::*;
use crate::state::{Angle, Quantity, wrap};

/// 1σ of a heading of which nothing is known: that of a uniform distribution.
const UNKNOWN: f64 = core::f64::consts::PI / 1.732_050_807_568_877_2;

/// A vehicle in the plane: its heading, and its velocity north and east.
#[derive(Clone, Copy, Debug)]
struct Planar {
    heading: Slot<Angle>,
    velocity: Slot<Vector<2>>,
}

/// Its velocity to the right, which is zero.
#[derive(Debug)]
struct Sideways(Planar);

impl Measurement for Sideways {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let ((s, c), v) = (at.state(self.0.heading).sin_cos(), at.get(&Quantity::State(self.0.velocity)));
        value[0] = c * v.y - s * v.x;
        Ok(())
    }
    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let ((s, c), v) = (at.state(self.0.heading).sin_cos(), at.get(&Quantity::State(self.0.velocity)));
        h.add_slot(0, self.0.heading, &Matrix1::new(-c * v.x - s * v.y));
        h.add_slot(0, self.0.velocity, &SMatrix::<f64, 1, 2>::new(-s, c));
        Ok(())
    }
}

/// Its heading.
#[derive(Debug)]
struct Compass(Planar);

impl Measurement for Compass {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.state(self.0.heading);
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add_slot(0, self.0.heading, &Matrix1::new(1.0));
        Ok(())
    }
    fn residual(&self, z: &[f64], predicted: &[f64], r: &mut [f64]) {
        r[0] = wrap(z[0] - predicted[0]);
    }
    fn perturb(&self, z: &mut [f64], e: &[f64]) {
        z[0] = wrap(z[0] + e[0]);
    }
}

/// A filter that believes in a heading of zero, within `sigma`, and knows the velocity to 0.1 m/s.
fn heading_for(velocity: [f64; 2], sigma: f64) -> (Filter, Planar) {
    let mut b = LayoutBuilder::new();
    let planar = Planar {
        heading: declare::<Angle>(&mut b, "heading", 0.0, &[sigma], Dynamics::Constant),
        velocity: declare::<Vector<2>>(&mut b, "velocity", velocity.into(), &[0.1; 2], Dynamics::Constant),
    };
    (after_a_gap(filter(b, Still, 1)), planar)
}

fn after_a_gap(mut f: Filter) -> Filter {
    f.coast(second(1), 1.0, None).unwrap();
    f
}

#[test]
fn a_constraint_leaves_an_unknown_heading_within_3_sigma_and_finds_it() {
    for degrees in [-80.0_f64, -60.0, -30.0, 30.0, 60.0, 80.0] {
        let truth = degrees.to_radians();
        let (mut f, planar) = heading_for([10.0 * truth.cos(), 10.0 * truth.sin()], UNKNOWN);
        for k in 0..30 {
            accept(&mut f, &Sideways(planar), &[0.0], &[0.05 * 0.05]);
            let (error, sigma) = (wrap(planar.heading.read(&f.belief().x) - truth), dense(&f)[(0, 0)].sqrt());
            assert!(error.abs() < 3.0 * sigma, "{degrees}°, after {k}: {error} rad, 1σ {sigma}");
        }
        // 0.1 m/s of 10 m/s.
        assert!(dense(&f)[(0, 0)].sqrt() < 0.02, "{degrees}°");
    }
}

#[test]
fn a_compass_is_linear_whatever_the_heading() {
    for sigma in [0.1, UNKNOWN, core::f64::consts::PI] {
        let (mut f, planar) = heading_for([10.0, 0.0], sigma);
        accept(&mut f, &Compass(planar), &[0.3], &[0.01]);
        let (p, r) = (sigma * sigma, 0.01);
        // 1e-12: rounding.
        assert!((dense(&f)[(0, 0)] / (p * r / (p + r)) - 1.0).abs() < 1e-12, "{sigma}");
    }
}

#[test]
fn sigma_points_and_every_form_take_an_unknown_heading() {
    for backend in [Backend::ERROR_STATE, Backend::IEKF, Backend::UKF] {
        for form in [FormKind::Joseph, FormKind::Udu, FormKind::SquareRoot] {
            let (f, planar) = heading_for([10.0, 1.0], UNKNOWN);
            let f = Filter::new(Arc::clone(f.layout()), Arc::new(Still), Backend { form, ..backend }, Size::same(1));
            let mut f = after_a_gap(f);
            let mut before = UNKNOWN * UNKNOWN;
            for _ in 0..30 {
                let verdict = accept(&mut f, &Sideways(planar), &[0.0], &[0.05 * 0.05]).verdict;
                let now = dense(&f)[(0, 0)];
                assert!(verdict == Verdict::Accepted && now <= before, "{backend:?}");
                before = now;
            }
        }
    }
}
