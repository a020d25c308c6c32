//! Takes the steps of a run and sums them up, part by part of the log.

use super::element::{Change, Element};
use super::motion::{Follower, MOST_BLOCKS, MOST_SEGMENTS, Motion, most_alike, same_name};
use super::stacked::Stacked;
use fusion::observe::{Heard, RunEvent, RunObserver};
use fusion_core::belief::{Belief, own_dynamics};
use fusion_core::filter::{Step, Verdict};
use fusion_core::math;
use fusion_core::runner::{Event, Halt};
use fusion_core::state::{Attitude, Block, Dynamics, Kind, Layout, Manifold, StateRole};
use fusion_core::time::Time;
use nalgebra::DMatrix;
use std::sync::Arc;

/// The parts of the log with the measurements of some sensors.
#[derive(Debug)]
pub(super) struct Track {
    /// The numbers of the sensors that are left out.
    without: Vec<usize>,
    current: Option<Element>,
    pub(super) parts: Vec<Element>,
}

/// The updates of a sensor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Count {
    pub(super) used: u64,
    pub(super) rejected: u64,
}

/// Follows the outermost filter of a run. Its memory does not grow with the log.
///
/// Coordinates of the result: a state in units of its initial σ, and the attitude of the vehicle as tilt about north and
/// east and as heading.
#[derive(Debug)]
pub(super) struct Recorder {
    layout: Option<Arc<Layout>>,
    /// The first track has all sensors.
    pub(super) tracks: Vec<Track>,
    /// The stacked matrix since the latest start, and the best one before it.
    stacked: Option<Stacked>,
    pub(super) best: Option<Stacked>,
    follower: Follower,
    pub(super) motions: Vec<Motion>,
    pub(super) counts: Vec<Count>,
    /// The initial σ, in the coordinates of the result but in SI; empty before the first start.
    pub(super) sigma: Vec<f64>,
    /// The state where the present part begins, and at the latest estimate.
    first: Vec<f64>,
    last: Option<(Time, Vec<f64>)>,
    /// The sensor of the latest measurement.
    sensor: usize,
    changes: Vec<Change>,
}

impl Recorder {
    /// With a further track for each list of sensors that are left out together.
    pub(super) fn new(sensors: usize, without: Vec<Vec<usize>>) -> Self {
        let track = |without| Track {
            without,
            current: None,
            parts: Vec::new(),
        };
        Self {
            layout: None,
            tracks: [Vec::new()].into_iter().chain(without).map(track).collect(),
            stacked: None,
            best: None,
            follower: Follower::default(),
            motions: Vec::new(),
            counts: vec![Count::default(); sensors],
            sigma: Vec::new(),
            first: Vec::new(),
            last: None,
            sensor: 0,
            changes: Vec::new(),
        }
    }

    /// M of y = M x: from the tangent space at the state `x` to the coordinates of the result.
    fn coordinates(&self, layout: &Layout, x: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
        let scale: Vec<f64> = self.sigma.iter().map(|s| if *s > 0.0 { *s } else { 1.0 }).collect();
        let turn = turn(layout, x);
        let (mut to, mut from) = (turn.clone(), turn.transpose());
        for (i, scale) in scale.into_iter().enumerate() {
            to.row_mut(i).unscale_mut(scale);
            from.column_mut(i).scale_mut(scale);
        }
        (to, from)
    }

    fn start(&mut self, filter: &Heard, belief: &Belief) -> Result<(), Halt> {
        let layout = &filter.layout;
        let n = layout.dim();
        if self.sigma.is_empty() {
            let turn = turn(layout, &belief.x);
            let dense = DMatrix::from_row_slice(n, n, &belief.covariance.to_dense());
            let turned = &turn * dense * turn.transpose();
            self.sigma = turned.diagonal().iter().map(|v| math::sqrt(v.max(0.0))).collect();
            for block in layout.blocks().iter().filter(|block| is_heading(block)) {
                let own = &mut self.sigma[block.tangent_range()];
                let largest = own.iter().copied().fold(0.0, f64::max);
                // An axis without variance gets a rounding error by the rotation: ε of the variance of the others.
                own.iter_mut().filter(|s| **s < 1e-7 * largest).for_each(|s| *s = 0.0);
            }
        } else {
            self.cut()?;
            let from = self.motions.last().map_or(belief.time.seconds(), |motion| motion.to);
            let gap = Motion::gap(from, belief.time.seconds());
            let forgotten = forgotten(layout, &self.sigma, gap.duration());
            self.tracks.iter_mut().for_each(|track| track.parts.push(forgotten.clone()));
            self.motions.push(gap);
        }
        let (_, from) = self.coordinates(layout, &belief.x);
        let unknown: Vec<usize> = (0..n).filter(|i| self.sigma[*i] > 0.0).collect();
        self.end_stacked();
        self.stacked = Some(Stacked::new(from.select_columns(&unknown)));
        self.layout = Some(layout.clone());
        self.first.clone_from(&belief.x);
        self.last = None;
        self.tracks.iter_mut().for_each(|track| track.current = Some(Element::empty(n)));
        self.follower.start(belief.time);
        Ok(())
    }

    /// The stacked matrix ends with the filter. That with the highest rank is kept.
    fn end_stacked(&mut self) {
        if let Some(stacked) = self.stacked.take()
            && self.best.as_ref().is_none_or(|best| best.rank() < stacked.rank())
        {
            self.best = Some(stacked);
        }
    }

    fn step(&mut self, step: &Step) {
        match step {
            Step::Predicted { transition, posterior, .. } => {
                let before: Vec<Change> = transition.noise_before().collect();
                let mut after: Vec<Change> = transition.noise_after().collect();
                self.changes.clear();
                let changes = transition.phi.changes().map(|(i, j, v)| (i.into(), j.into(), v));
                self.changes.extend(changes);
                // An axis that Φ clears was found anew by an initialiser, with the variance that it has now.
                let cleared = self.changes.iter().filter(|(i, j, v)| i == j && *v == -1.0);
                after.extend(cleared.map(|(i, ..)| (*i, *i, variance(posterior, *i))));
                for element in elements(&mut self.tracks) {
                    element.disturb(before.iter().copied());
                    element.carry(&self.changes);
                    element.disturb(after.iter().copied());
                }
                if let Some(stacked) = &mut self.stacked {
                    stacked.carry(&self.changes);
                }
            }
            Step::Inflated { prior, posterior } => {
                let growth = |i: usize| (variance(posterior, i) - variance(prior, i)).max(0.0);
                let growth: Vec<Change> = (0..prior.covariance.dim()).map(|i| (i, i, growth(i))).collect();
                elements(&mut self.tracks).for_each(|element| element.disturb(growth.iter().copied()));
            }
            Step::Corrected {
                prior,
                jacobian,
                noise,
                residual,
                reset,
                ..
            } => {
                let (m, n) = (residual.len(), prior.covariance.dim());
                let h = DMatrix::from_fn(m, n, |i, j| jacobian.get(i, j));
                let r = DMatrix::from_row_slice(m, m, noise);
                let sensor = self.sensor;
                for track in self.tracks.iter_mut().filter(|track| !track.without.contains(&sensor)) {
                    track.current.iter_mut().for_each(|element| element.measure(&h, &r));
                }
                self.stacked.iter_mut().for_each(|stacked| stacked.measure(&h, &r));
                if let Some(reset) = reset {
                    self.changes.clear();
                    self.changes.extend(reset.changes().map(|(i, j, v)| (i.into(), j.into(), v)));
                    elements(&mut self.tracks).for_each(|element| element.carry(&self.changes));
                    self.stacked.iter_mut().for_each(|stacked| stacked.carry(&self.changes));
                }
            }
        }
    }

    /// Ends the present part at the latest estimate.
    fn cut(&mut self) -> Result<(), Halt> {
        match self.follower.cut() {
            Some(motion) => self.close(motion),
            None => Ok(()),
        }
    }

    /// Ends the present part, of this motion, at the latest estimate.
    fn close(&mut self, motion: Motion) -> Result<(), Halt> {
        let (Some(layout), Some((_, x))) = (self.layout.clone(), self.last.take()) else {
            return Ok(());
        };
        let (_, from) = self.coordinates(&layout, &self.first);
        let (to, _) = self.coordinates(&layout, &x);
        for track in &mut self.tracks {
            let Some(current) = track.current.replace(Element::empty(layout.dim())) else {
                continue;
            };
            let part = current.in_coordinates(&from, &to);
            if !part.is_finite() {
                return Err("the information of the steps overflows: a σ or a noise of the design is far too small".into());
            }
            track.parts.push(part);
        }
        self.first.clone_from(&x);
        self.motions.push(motion);
        if self.motions.len() > MOST_BLOCKS {
            // Among very many starts, the first of them become one part.
            self.join(most_alike(&self.motions).unwrap_or(0));
        }
        Ok(())
    }

    /// Makes one part of a part and the next.
    fn join(&mut self, first: usize) {
        let next = self.motions.remove(first + 1);
        self.motions[first] = self.motions[first].then(&next);
        for track in &mut self.tracks {
            let next = track.parts.remove(first + 1);
            track.parts[first] = track.parts[first].then(&next);
        }
    }

    /// The end of the run: ends the last part.
    pub(super) fn finish(&mut self) -> Result<(), Halt> {
        self.cut()?;
        self.join_names();
        self.end_stacked();
        Ok(())
    }

    /// Joins the parts to the segments of the result.
    pub(super) fn join_segments(&mut self) {
        let joinable = |motions: &[Motion]| motions.iter().filter(|motion| !motion.is_gap).count();
        while joinable(&self.motions) > MOST_SEGMENTS
            && let Some(pair) = most_alike(&self.motions)
        {
            self.join(pair);
        }
        self.join_names();
    }

    /// Joins neighbours with the same name.
    fn join_names(&mut self) {
        while let Some(pair) = same_name(&self.motions) {
            self.join(pair);
        }
    }

    /// The layout of the filter; `None` if it never started.
    pub(super) fn layout(&self) -> Option<Arc<Layout>> {
        self.layout.clone()
    }
}

impl RunObserver for Recorder {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Filter { filter, event } if filter.is_outermost() => match event {
                Event::Started { belief, .. } => self.start(filter, belief)?,
                Event::Updated { sensor, update, .. } => {
                    self.sensor = *sensor;
                    let count = &mut self.counts[*sensor];
                    match update.verdict {
                        Verdict::Accepted | Verdict::Reacquired => count.used += 1,
                        _ => count.rejected += 1,
                    }
                }
                Event::Step(step) => self.step(step),
                _ => {}
            },
            RunEvent::Estimate { filter, solution, belief } if filter.is_outermost() && self.layout.is_some() => {
                self.last = Some((belief.time, belief.x.clone()));
                if let Some(motion) = self.follower.take(belief.time, solution) {
                    self.close(motion)?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        true
    }
}

fn variance(belief: &Belief, axis: usize) -> f64 {
    belief.covariance.marginal_at::<1>(axis).x
}

fn elements(tracks: &mut [Track]) -> impl Iterator<Item = &mut Element> {
    tracks.iter_mut().filter_map(|track| track.current.as_mut())
}

/// The rotation from the tangent space at the state `x` to one in which the attitude error of the motion is about north,
/// east and down, instead of the axes of the body.
fn turn(layout: &Layout, x: &[f64]) -> DMatrix<f64> {
    let mut turn = DMatrix::identity(layout.dim(), layout.dim());
    for block in layout.blocks().iter().filter(|block| is_heading(block)) {
        let (q, at) = (Attitude::read(&x[block.storage_range()]), block.tangent);
        turn.view_mut((at, at), (3, 3)).copy_from(q.to_rotation_matrix().matrix());
    }
    turn
}

/// Whether a block is the attitude of the vehicle.
pub(super) fn is_heading(block: &Block) -> bool {
    block.kind == Kind::Attitude && block.role == StateRole::Kinematic
}

/// A time without any data, in the coordinates of the result: the motion starts again with its initial σ, and parameters
/// follow their own dynamics.
pub(super) fn forgotten(layout: &Layout, sigma: &[f64], seconds: f64) -> Element {
    let mut part = Element::empty(layout.dim());
    for block in layout.blocks() {
        for (k, i) in block.tangent_range().enumerate() {
            // The rate of an integral moves it as far as its initial σ allows.
            let is_moved = block.role == StateRole::Kinematic || matches!(block.dynamics, Dynamics::Integral { .. });
            let (decay, added) = if is_moved {
                (0.0, sigma[i] * sigma[i])
            } else {
                own_dynamics(block, k, seconds)
            };
            let scale = if sigma[i] > 0.0 { sigma[i] * sigma[i] } else { 1.0 };
            part.transition[(i, i)] = decay;
            part.noise[(i, i)] = added / scale;
        }
    }
    part
}
