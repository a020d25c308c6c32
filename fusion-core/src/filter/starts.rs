//! The starts of a bank with an unobserved heading: all round, in even steps.

use crate::belief::Belief;
use crate::math;
use crate::state::{Attitude, Block, Kind, Layout, Manifold, StateRole};
use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};
use core::ops::Range;
use nalgebra::{Matrix3, Vector3};

/// A heading that a start may leave open: the heading of an attitude, or a separate angle.
struct Open {
    /// The block's axes in the tangent space.
    axes: Range<usize>,
    /// The turn in these axes; for an attitude only the first three numbers count.
    turn: Vector3<f64>,
    /// 1σ \[rad\].
    sigma: f64,
}

/// Whether the block is an angle: by its kind, or a number in radians.
pub(super) fn is_angle(block: &Block) -> bool {
    match block.kind {
        Kind::Attitude | Kind::Angle => true,
        Kind::Scalar => block.unit == "rad",
        _ => false,
    }
}

impl Open {
    /// The heading of the block, if it has one.
    fn of(block: &Block, belief: &Belief) -> Option<Self> {
        let turn = match block.kind {
            // Down in body axes: a turn about it changes the heading.
            Kind::Attitude if block.role == StateRole::Kinematic => {
                Attitude::read(&belief.x[block.storage_range()]).inverse_transform_vector(&Vector3::z())
            }
            Kind::Attitude => return None,
            _ if is_angle(block) => Vector3::x(),
            _ => return None,
        };
        let axes = block.tangent_range();
        let variance = match axes.len() {
            3 => turn.dot(&(belief.covariance.marginal_at::<3>(axes.start) * turn)),
            _ => belief.covariance.variance(axes.start),
        };
        let sigma = math::sqrt(variance.max(0.0));
        Some(Self { axes, turn, sigma })
    }

    /// M: shrinks the turn to `to` times its σ, and leaves everything at right angles to it.
    fn shrink(&self, p: &mut [f64], n: usize, to: f64) {
        let m = Matrix3::identity() - self.turn * self.turn.transpose() * (1.0 - to);
        let (at, size) = (self.axes.start, self.axes.len());
        // P ← M P Mᵀ: the rows, then the columns.
        for (along, across) in [(n, 1), (1, n)] {
            for other in 0..n {
                let place = |i: usize| (at + i) * along + other * across;
                let v = m * Vector3::from_fn(|i, _| if i < size { p[place(i)] } else { 0.0 });
                (0..size).for_each(|i| p[place(i)] = v[i]);
            }
        }
    }
}

/// The beliefs of a start that is tried with `starts` headings: `belief` turned all round in even steps, each with a
/// σ of half a step, and ln of its probability by the belief. The turned block is the attitude, or the first angle
/// whose σ is more than half a step; `None` if there is neither.
pub(super) fn headings(belief: &Belief, layout: &Layout, starts: usize) -> Option<Vec<(Belief, f64)>> {
    let step = TAU / starts as f64;
    if starts < 2 {
        return None;
    }
    let wide = |block: &Block| {
        Open::of(block, belief)
            .filter(|open| open.sigma > 0.5 * step)
            .map(|open| (block.clone(), open))
    };
    let (block, open) = layout.blocks().iter().find_map(wide)?;
    let mut p = belief.covariance.to_dense();
    open.shrink(&mut p, layout.dim(), 0.5 * step / open.sigma);
    let turned = |k: usize| {
        let turn = k as f64 * step;
        let turn = if turn > PI { turn - TAU } else { turn };
        let mut belief = belief.clone();
        let delta = open.turn * turn;
        block
            .kind
            .plus(&mut belief.x[block.storage_range()], &delta.as_slice()[..open.axes.len()]);
        belief.covariance.set_whole(&p);
        (belief, -0.5 * (turn / open.sigma) * (turn / open.sigma))
    };
    Some((0..starts).map(turned).collect())
}
