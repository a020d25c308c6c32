//! The axes of the state for which errors are split.

use super::spread::Spread;
use super::world::{Source, World};
use fusion_core::belief::Belief;
use fusion_core::geometry::so3;
use fusion_core::state::{Attitude, AxisUnit, Block, Kind, Layout, Manifold};

/// An axis of a block, as it is shown.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) state: String,
    /// Its name; empty for a block of one axis.
    pub(super) axis: String,
    pub(super) unit: &'static str,
    block: Block,
    k: usize,
    /// The errors of the world that are its true value.
    truth: Vec<usize>,
}

impl Axis {
    /// All axes of a layout.
    pub(super) fn all(layout: &Layout, world: &World) -> Vec<Self> {
        let of_block = |block: &Block| {
            let axes = (0..block.kind.dim()).map(|k| Self {
                state: block.name.clone(),
                axis: name(block.kind, k),
                unit: match block.kind.axis(k) {
                    AxisUnit::Metre => "m",
                    AxisUnit::MetrePerSecond => "m/s",
                    AxisUnit::Radian => "rad",
                    AxisUnit::Other => block.unit,
                },
                block: block.clone(),
                k,
                truth: {
                    let errors = world.errors.iter().enumerate();
                    let own = errors.filter(|(_, error)| error.estimated == Some(block.tangent + k));
                    own.map(|(number, _)| number).collect()
                },
            });
            axes.collect::<Vec<_>>()
        };
        layout.blocks().iter().flat_map(of_block).collect()
    }

    /// The axis in tangent coordinates at the estimate `x`: an attitude is shown as roll, pitch and yaw.
    pub(super) fn along(&self, x: &[f64]) -> Vec<(usize, f64)> {
        let first = self.block.tangent;
        if self.block.kind != Kind::Attitude {
            return vec![(first + self.k, 1.0)];
        }
        let rpy = so3::to_rpy(&Attitude::read(&x[self.block.storage_range()]));
        let rate = so3::euler_rate_of_body(rpy.x, rpy.y);
        (0..3).map(|j| (first + j, rate[(self.k, j)])).collect()
    }

    /// The variance along `a` that the filter reports.
    pub(super) fn reported(&self, a: &[(usize, f64)], belief: &Belief) -> f64 {
        let (first, d, p) = (self.block.tangent, self.block.kind.dim(), belief.covariance.block(&self.block));
        let of = |(i, by): &(usize, f64)| a.iter().map(|(j, other)| by * other * p[(i - first) * d + j - first]).sum::<f64>();
        a.iter().map(of).sum()
    }

    /// The variance that each source brings into the error along `a`. The errors that the axis estimates are its truth, so
    /// they count with the opposite sign.
    pub(super) fn variances(&self, a: &[(usize, f64)], world: &World, spread: &Spread) -> Vec<f64> {
        let of = |source: &Source| source.block.map_or(0.0, |block| spread.variance(block, a));
        let mut variances: Vec<f64> = world.sources.iter().map(of).collect();
        for (number, error) in world.errors.iter().enumerate() {
            let is_truth = self.truth.contains(&number);
            let is_drawn_once = world.sources[error.source].block.is_none();
            if is_drawn_once || is_truth {
                let (c, t) = spread.along(number, a);
                variances[error.source] += if is_drawn_once {
                    let left = c - f64::from(u8::from(is_truth));
                    left * left * t
                } else {
                    t - 2.0 * c
                };
            }
        }
        variances
    }
}

fn name(kind: Kind, k: usize) -> String {
    let names = match kind {
        Kind::Geodetic | Kind::Position | Kind::Velocity => ["north", "east", "down"],
        Kind::Attitude => ["roll", "pitch", "yaw"],
        _ => ["x", "y", "z"],
    };
    match kind.dim() {
        1 => String::new(),
        3 => names[k].to_owned(),
        _ => (k + 1).to_string(),
    }
}
