//! The start of a filter in a simulated world, drawn about the truth.
//!
//! A kinematic block whose start is declared, not found from data, starts at x̂ = x ⊞ δ. Here x is the true value
//! at that instant and δ a draw from the declared covariance of the block, in the canonical chart: an
//! attitude is turned by a rotation vector in body axes. So the initial errors of filters agree with their
//! declared covariance, with another draw for each seed.

use super::random::Random;
use super::simulator::Known;
use super::spec::SimulationSpec;
use super::world::{OpenLoop, Truth};
use crate::block::BuildError;
use crate::earth::{Gravity, LocalFrame};
use fusion_core::belief::Belief;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::runner::Initialiser;
use fusion_core::state::{Block, Layout, StateRole};
use fusion_core::time::Time;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Writes the drawn start; goes after all other initialisers.
#[derive(Clone, Debug)]
pub struct DrawnStart {
    begins: Begins,
    frame: LocalFrame,
    gravity: Gravity,
    blocks: Vec<(Block, Known)>,
    seed: u64,
}
memory!(DrawnStart { ; begins, frame, gravity, blocks, seed });

/// Writes the true motion at `time` into the kinematic blocks of the state `x` with this `layout`, for a filter that starts
/// at that time in the world of `spec`.
///
/// # Errors
/// [`BuildError`] within `[simulation]`.
pub fn write_true_motion(
    spec: &SimulationSpec,
    layout: &Layout,
    (origin, gravity): (Geodetic, Gravity),
    time: Time,
    x: &mut [f64],
) -> Result<(), BuildError> {
    let truth = Begins::of(spec, (origin, gravity), spec.seed)?.truth(time);
    for block in layout.blocks().iter().filter(|b| b.role == StateRole::Kinematic) {
        if let Some(known) = Known::of(layout, block)? {
            known.write(&truth, &LocalFrame::new(origin), gravity, x);
        }
    }
    Ok(())
}

/// The truth when the filter starts.
#[derive(Clone, Debug)]
enum Begins {
    /// On a trajectory.
    On(Arc<OpenLoop>),
    /// In a vehicle, which stands until then.
    Standing(Truth),
}

impl Begins {
    fn of(spec: &SimulationSpec, (origin, gravity): (Geodetic, Gravity), seed: u64) -> Result<Self, BuildError> {
        Ok(if spec.vehicle.is_some() {
            Self::Standing(*spec.world(origin, gravity, seed, None)?.truth())
        } else {
            Self::On(Arc::new(OpenLoop::new(spec.trajectory()?, spec.plane(origin, gravity))))
        })
    }

    fn truth(&self, time: Time) -> Truth {
        match self {
            Self::On(trajectory) => trajectory.truth_at(time),
            Self::Standing(truth) => *truth,
        }
    }
}

impl DrawnStart {
    /// For a filter with the state `layout` in the world of `spec`. The blocks that initialisers `found`
    /// from data keep their values.
    ///
    /// # Errors
    /// [`BuildError`] within `[simulation]`, for example if no block is left to draw.
    pub fn new(
        spec: &SimulationSpec,
        layout: &Layout,
        (origin, gravity): (Geodetic, Gravity),
        found: &[&str],
        seed: u64,
    ) -> Result<Self, BuildError> {
        let mut blocks = Vec::new();
        let moved = layout.blocks().iter().filter(|b| b.role == StateRole::Kinematic);
        for block in moved.filter(|b| !found.contains(&b.name.as_str())) {
            blocks.extend(Known::of(layout, block)?.map(|known| (block.clone(), known)));
        }
        if blocks.is_empty() {
            let message = "there is no start to draw: initialisers find all of it from data, which have their own errors";
            let help = "declare the start, `type = \"explicit\"` under [initial.NAME], or remove `draw_start`";
            return Err(BuildError::at("draw_start", message).help(help));
        }
        Ok(Self {
            begins: Begins::of(spec, (origin, gravity), seed)?,
            frame: LocalFrame::new(origin),
            gravity,
            blocks,
            seed,
        })
    }
}

impl Initialiser for DrawnStart {
    fn row(&mut self, _: usize, _: Time, _: &[f64]) {}

    fn waits_for(&self) -> Option<String> {
        None
    }

    fn write(&self, time: Time, _: &Layout, belief: &mut Belief) {
        let truth = self.begins.truth(time);
        for (block, known) in &self.blocks {
            known.write(&truth, &self.frame, self.gravity, &mut belief.x);
            let d = block.kind.dim();
            let spread = DMatrix::from_row_slice(d, d, &belief.covariance.block(block)).symmetric_eigen();
            let mut random = Random::new(self.seed, &format!("start/{}", block.name));
            let along = spread.eigenvalues.map(|variance| math::sqrt(variance.max(0.0)) * random.normal());
            let delta: DVector<f64> = spread.eigenvectors * along;
            block.kind.plus(&mut belief.x[block.storage_range()], delta.as_slice());
        }
    }
}
