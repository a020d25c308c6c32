//! The arithmetic of the budget against a recursion over one covariance of everything.

mod augmented;
mod seeds;

use super::spread::Spread;
use nalgebra::DMatrix;

/// A filter of position and velocity with three sources: a velocity that is drawn once, white noise of a row, and a
/// slow error of the input. All together in one covariance of [e; t], by plain products.
#[test]
fn the_sources_add_up_to_the_covariance_of_everything_together() {
    let (n, dt) = (2, 0.1);
    let phi = DMatrix::from_row_slice(2, 2, &[1.0, dt, 0.0, 1.0]);
    let (h, k) = ([1.0, 0.0], [0.3, 0.2]);
    let g = [dt * dt / 2.0, dt];
    let (decay, slow, white, first) = (0.99, 0.04, 0.25, 9.0);
    let mut spread = Spread::new(n, 2, &[(None, first), (Some(0), 0.0), (Some(1), slow)]);
    let mut whole = DMatrix::zeros(5, 5);
    (whole[(2, 2)], whole[(4, 4)]) = (first, slow);
    spread.act(0, &[0.0, 1.0]);
    let start = {
        let mut m = DMatrix::identity(5, 5);
        m[(1, 2)] = 1.0;
        m
    };
    whole = &start * whole * start.transpose();
    for _ in 0..200 {
        spread.age(2, decay, slow * (1.0 - decay * decay));
        spread.carry(&[(0, 1, dt)]);
        spread.act(2, &g);
        spread.correct(&h, &k);
        spread.age(1, 0.0, white);
        spread.act(1, &k);

        let mut m = DMatrix::identity(5, 5);
        m[(3, 3)] = 0.0;
        m[(4, 4)] = decay;
        whole = &m * whole * m.transpose();
        whole[(3, 3)] = white;
        whole[(4, 4)] += slow * (1.0 - decay * decay);
        let mut m = DMatrix::identity(5, 5);
        m.view_mut((0, 0), (2, 2)).copy_from(&phi);
        (0..2).for_each(|i| m[(i, 4)] = g[i]);
        whole = &m * whole * m.transpose();
        let mut m = DMatrix::identity(5, 5);
        for i in 0..2 {
            (0..2).for_each(|j| m[(i, j)] -= k[i] * h[j]);
            m[(i, 3)] = k[i];
        }
        whole = &m * whole * m.transpose();
    }
    for axis in 0..n {
        let a = [(axis, 1.0)];
        let (response, t) = spread.along(0, &a);
        let sum = response * response * t + spread.variance(0, &a) + spread.variance(1, &a);
        // The bar: rounding of some thousand products, which the filter forgets.
        let relative = sum / whole[(axis, axis)] - 1.0;
        assert!(relative.abs() < 3e-15, "axis {axis}: {relative:e}");
    }
    assert!((spread.along(2, &[(1, 1.0)]).0 / whole[(1, 4)] - 1.0).abs() < 3e-15);
}

#[test]
fn a_new_value_forgets_the_errors_of_its_axes_only() {
    let mut spread = Spread::new(2, 1, &[(None, 1.0)]);
    spread.act(0, &[1.0, 2.0]);
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        spread.add(0, i, j, 4.0);
    }
    spread.forget(0..1);
    let along = |axis| (spread.along(0, &[(axis, 1.0)]).0, spread.variance(0, &[(axis, 1.0)]));
    assert_eq!((along(0), along(1)), ((0.0, 0.0), (2.0, 4.0)));
    assert_eq!(spread.variance(0, &[(0, 1.0), (1, 1.0)]), 4.0);
}
