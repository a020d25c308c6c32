//! Compares each block of the state with the truth of a simulation: biases, lever arms, latencies.

use super::Consistency;
use super::nees::{NeesSeries, nees};
use fusion_core::belief::Belief;
use fusion_core::math;
use fusion_core::state::{Block, Dynamics, Layout, StateRole};
use fusion_core::time::Time;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// The score of a block, for each axis of its tangent space and in its unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BlockScore {
    /// The block.
    pub name: String,
    /// True if it is a parameter or a sensor error, which the process does not move.
    pub is_parameter: bool,
    /// Unit of a tangent coordinate, SI.
    pub unit: Cow<'static, str>,
    /// Root mean square of the error.
    pub rms: Vec<f64>,
    /// Mean of the filter's own 3σ.
    pub three_sigma: Vec<f64>,
    /// Share of the errors inside their own 3σ; NaN for an axis that is not estimated.
    #[schemars(with = "Vec<Option<f64>>")]
    pub inside: Vec<f64>,
    /// The last error: estimate minus truth.
    pub error: Vec<f64>,
    /// The filter's 1σ there.
    pub sigma: Vec<f64>,
    /// NEES of the block.
    pub nees: Option<Consistency>,
    /// Epochs at which the NEES was not defined.
    pub nees_undefined: usize,
}

/// Scores the blocks of a filter against a true state in its layout.
#[derive(Debug)]
pub(crate) struct BlockScorer {
    followers: Box<[Follower]>,
    /// Errors count from this time.
    from: Option<Time>,
}

#[derive(Debug)]
struct Follower {
    block: Block,
    count: f64,
    squares: DVector<f64>,
    sigmas: DVector<f64>,
    /// Epochs at which the axis was estimated, and the number of them with the error inside 3σ.
    estimated: DVector<f64>,
    inside: DVector<f64>,
    last: (DVector<f64>, DVector<f64>),
    nees: NeesSeries,
    /// The first and the latest estimate.
    span: Option<(Time, Time)>,
}

fusion_core::memory!(BlockScorer { followers; from });
fusion_core::memory!(Follower { count, squares, sigmas, estimated, inside, last, nees, span; block });

impl BlockScorer {
    /// For the blocks of `layout` with `is_known`, from the time `from`.
    #[must_use]
    pub fn new(layout: &Layout, from: Option<Time>, is_known: impl Fn(&str) -> bool) -> Self {
        let known = layout.blocks().iter().filter(|b| is_known(&b.name));
        Self {
            followers: known.map(Follower::new).collect(),
            from,
        }
    }

    /// Takes an estimate and the `truth` at its time, in storage order.
    pub fn add(&mut self, belief: &Belief, truth: &[f64]) {
        if self.from.is_none_or(|from| belief.time >= from) {
            self.followers.iter_mut().for_each(|f| f.add(belief, truth));
        }
    }

    /// The scores, in order of the layout; empty if no estimate had a known truth.
    #[must_use]
    pub fn finish(self) -> Vec<BlockScore> {
        self.followers.into_iter().filter_map(Follower::finish).collect()
    }
}

impl Follower {
    fn new(block: &Block) -> Self {
        let none = || DVector::zeros(block.kind.dim());
        Self {
            block: block.clone(),
            count: 0.0,
            squares: none(),
            sigmas: none(),
            estimated: none(),
            inside: none(),
            last: (none(), none()),
            nees: NeesSeries::default(),
            span: None,
        }
    }

    fn add(&mut self, belief: &Belief, truth: &[f64]) {
        self.span = Some((self.span.map_or(belief.time, |(first, _)| first), belief.time));
        let (kind, storage, d) = (self.block.kind, self.block.storage_range(), self.block.kind.dim());
        let (error, sigma) = &mut self.last;
        kind.minus(&belief.x[storage.clone()], &truth[storage], error.as_mut_slice());
        // Nearly all blocks have three axes.
        let found = if d == 3 {
            let (mut p, at) = (Matrix3::zeros(), self.block.tangent);
            belief.covariance.copy_to(at, at, &mut p);
            (0..3).for_each(|k| sigma[k] = p[(k, k)]);
            nees(&Vector3::new(error[0], error[1], error[2]), &p, &Matrix3::zeros())
        } else {
            let p = DMatrix::from_row_slice(d, d, &belief.covariance.block(&self.block));
            sigma.copy_from(&p.diagonal());
            nees(error, &p, &DMatrix::zeros(d, d))
        };
        self.nees.add(found);
        self.count += 1.0;
        for (k, (e, s)) in error.iter().zip(sigma.iter_mut()).enumerate() {
            // `s` is still a variance here.
            let is_estimated = f64::from(*s != 0.0);
            *s = math::sqrt(s.max(0.0));
            self.squares[k] += e * e;
            self.sigmas[k] += *s;
            self.inside[k] += f64::from(e.abs() <= 3.0 * *s) * is_estimated;
            self.estimated[k] += is_estimated;
        }
    }

    fn finish(self) -> Option<BlockScore> {
        let Self { block, count, .. } = self;
        let span = self.span.map_or(0.0, |(first, latest)| latest.seconds_since(first));
        // A slow error hardly changes within its correlation time; see `Rules::slowest`.
        let most = match block.dynamics {
            Dynamics::GaussMarkov { tau, .. } => 1.0 + span / tau,
            _ => f64::INFINITY,
        };
        let list = |v: DVector<f64>| v.data.into();
        (count > 0.0).then(|| BlockScore {
            name: block.name,
            is_parameter: block.role != StateRole::Kinematic,
            unit: block.unit.into(),
            rms: list((self.squares / count).map(math::sqrt)),
            three_sigma: list(self.sigmas * (3.0 / count)),
            inside: list(self.inside.component_div(&self.estimated)),
            error: list(self.last.0),
            sigma: list(self.last.1),
            nees: self.nees.consistency().map(|c| c.at_most(most)),
            nees_undefined: self.nees.undefined(),
        })
    }
}
