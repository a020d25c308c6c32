//! Pairs of poses a distance apart, and the error from one to the other.

use super::{Pose, PosePair, degrees};
use nalgebra::UnitQuaternion;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Part of the distance by which a pair of [`Pairs::All`] may miss it.
const TOLERANCE: f64 = 0.1;

/// Which pairs of poses are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pairs {
    /// Each begins where the one before ends.
    #[default]
    Consecutive,
    /// One from every pose on: they overlap, and are not independent.
    All,
}

/// The way from each pose to the next \[m\].
pub(super) fn steps(pairs: &[PosePair], of: fn(&PosePair) -> &Pose) -> Vec<f64> {
    let step = |two: &[PosePair]| (of(&two[1]).position - of(&two[0]).position).norm();
    pairs.windows(2).map(step).collect()
}

impl Pairs {
    /// The first and the last pose of each pair, by the way from each pose to the next.
    pub(super) fn apart(self, steps: &[f64], distance: f64) -> Vec<[usize; 2]> {
        if self == Self::Consecutive {
            return consecutive(steps, distance);
        }
        let mut way = vec![0.0];
        for step in steps {
            way.push(way[way.len() - 1] + step);
        }
        let pair = |from| Some([from, nearest(&way, from, distance)?]);
        (0..way.len()).filter_map(pair).collect()
    }
}

/// Each ends at the first pose that is at least as far along the way.
fn consecutive(steps: &[f64], distance: f64) -> Vec<[usize; 2]> {
    let (mut found, mut from, mut since) = (Vec::new(), 0, 0.0);
    for (k, step) in steps.iter().enumerate() {
        since += step;
        if since >= distance {
            found.push([from, k + 1]);
            (from, since) = (k + 1, 0.0);
        }
    }
    found
}

/// The first of the poses after `from` whose distance along the way comes nearest, if it is near enough.
fn nearest(way: &[f64], from: usize, distance: f64) -> Option<usize> {
    let miss = |k: usize| (way[k] - way[from] - distance).abs();
    let reaches = way.partition_point(|w| *w < way[from] + distance);
    let before = reaches.checked_sub(1).map(|k| way.partition_point(|w| *w < way[k]).max(from + 1));
    let found = [before, Some(reaches)]
        .into_iter()
        .flatten()
        .filter(|k| (from + 1..way.len()).contains(k));
    let nearest = found.min_by(|a, b| miss(*a).total_cmp(&miss(*b)))?;
    (miss(nearest) <= TOLERANCE * distance).then_some(nearest)
}

/// Length of the translation \[m\] and angle \[deg\] of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j); without attitudes the axes
/// of both bodies are those of the trajectories, which are then aligned.
pub(super) fn error(from: &PosePair, to: &PosePair) -> (f64, Option<f64>) {
    let moved = |of: fn(&PosePair) -> &Pose| {
        let [from, to] = [of(from), of(to)];
        let back = from.attitude.map(|q| q.inverse());
        let turned = back.zip(to.attitude).map(|(back, q)| back * q);
        (
            back.unwrap_or_else(UnitQuaternion::identity) * (to.position - from.position),
            turned,
        )
    };
    let ((estimated, turned), (true_one, truly)) = (moved(|pair| &pair.estimate), moved(|pair| &pair.reference));
    let angle = truly.zip(turned).map(|(q, p)| degrees(&(q.inverse() * p)));
    ((estimated - true_one).norm(), angle)
}
