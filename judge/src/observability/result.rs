//! The information of a run about each state, and the part of the log from which it comes.

use super::element::{Element, conditioned};
use super::motion::Motion;
use super::recorder::{Recorder, Track, forgotten, is_heading};
use super::sensors::Sensor;
use fusion_core::math;
use fusion_core::state::{Block, Kind, Layout, StateRole};
use nalgebra::{DMatrix, DVector};
use std::fmt;

/// A state of the filter.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Its block.
    pub block: String,
    /// Its name: that of the block, and its axis.
    pub name: String,
    /// Its unit, SI.
    pub unit: &'static str,
    /// Its initial σ.
    pub sigma: f64,
    /// The smallest σ along the log, given all data, over the initial σ.
    pub left: f64,
    /// For each segment, the factor by which that σ is larger if the segment is left out.
    pub raised: Vec<f64>,
    /// For each kind of motion, the same if all of it is left out.
    pub raised_by_kind: Vec<f64>,
}

impl State {
    /// Whether the data determine it: the information about it is above 1, so that they leave less than half of the
    /// initial variance.
    #[must_use]
    pub fn is_identifiable(&self) -> bool {
        self.left * self.left < HALF
    }
}

/// The motion that identifies a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A segment, by its number in [`Observability::segments`].
    Segment(usize),
    /// All motion of a kind, by its number in [`Observability::kinds`].
    Kind(usize),
}

/// A motion identifies a state if the σ doubles without it: it gives three quarters of the information. A state that is
/// measured all the time loses up to half at the border of any segment.
pub const DECISIVE: f64 = 2.0;

/// A smaller effect on a σ is that of rounding: σ is the root of a difference of numbers of size 1 with an error of 1e-15
/// times the condition of the parts, at most 1e12.
const EFFECT: f64 = 1e-3;

/// Information 1 leaves half of the initial variance: 1 / (1 + 1).
const HALF: f64 = 0.5;

/// All motion of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionKind {
    /// Its name: `turns`, `rest`.
    pub name: &'static str,
    /// How long it lasts in all \[s\].
    pub seconds: f64,
}

/// A part of the log with one motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Begin \[s\].
    pub from: f64,
    /// End \[s\].
    pub to: f64,
    /// The motion in words; empty for a filter without position, velocity and attitude.
    pub motion: String,
}

impl fmt::Display for Segment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = |t: f64| fusion_tables::short(math::round(t));
        let time = format!("{} to {} s", seconds(self.from), seconds(self.to));
        if self.motion.is_empty() {
            f.write_str(&time)
        } else {
            write!(f, "{}, {time}", self.motion)
        }
    }
}

impl Segment {
    fn of(motion: &Motion) -> Self {
        Self {
            from: motion.from,
            to: motion.to,
            motion: motion.words(),
        }
    }
}

/// A direction of the state, and the information about it in units of the initial σ.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// The information; the initial σ alone is 0, and 1 leaves half of the variance.
    pub information: f64,
    /// For each state, its component in units of its initial σ; the largest is 1.
    pub components: Vec<f64>,
}

/// The updates of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorUse {
    /// Its name.
    pub name: String,
    /// Whether it has no data, and is a constraint that the design declares.
    pub is_constraint: bool,
    /// Updates that count.
    pub used: u64,
    /// Updates that a gate rejected, or that were not possible.
    pub rejected: u64,
}

/// The states without some sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Without {
    /// The sensors that are left out together.
    pub sensors: Vec<String>,
    /// As [`Observability::rank`].
    pub rank: usize,
    /// As [`State::left`], for each state.
    pub left: Vec<f64>,
}

/// The observability of a design along a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Observability {
    /// The states with an initial σ above zero.
    pub states: Vec<State>,
    /// The parts of the log, without the times in which the filter did not run.
    pub segments: Vec<Segment>,
    /// The kinds of motion in the log.
    pub kinds: Vec<MotionKind>,
    /// The directions of the state, the least known first, at the time at which most of them are known.
    pub directions: Vec<Direction>,
    /// The number of directions with information above 1.
    pub rank: usize,
    /// The rank of the stacked matrix in the arithmetic of the machine: every direction about which the measurements say
    /// anything at all, if the process had no noise. If the filter starts again, between the starts with the highest
    /// rank.
    pub exact_rank: usize,
    /// The singular values of the stacked matrix in units of the initial σ, the largest first.
    pub singular_values: Vec<f64>,
    /// The sensors.
    pub sensors: Vec<SensorUse>,
    /// The states without each list of sensors.
    pub without: Vec<Without>,
}

impl Observability {
    /// The motion that identifies a state, with the factor by which its σ grows without this motion. Among all segments
    /// and all kinds of motion whose factor is at least [`DECISIVE`], it is that with the largest effect per second: a
    /// turn rather than the straights that it joins. `None` if no motion is decisive, or if the state is not identifiable.
    #[must_use]
    pub fn identified_by(&self, state: &State) -> Option<(Cause, f64)> {
        let most = self.most_effective(state, DECISIVE);
        most.filter(|_| state.is_identifiable())
    }

    /// The motion that says most about a state, identifiable or not: that with the largest effect per second, as for
    /// [`Observability::identified_by`]. `None` if no motion has an effect on its σ.
    #[must_use]
    pub fn most_is_said_by(&self, state: &State) -> Option<(Cause, f64)> {
        self.most_effective(state, 1.0 + EFFECT)
    }

    fn most_effective(&self, state: &State, least: f64) -> Option<(Cause, f64)> {
        let segments = self.segments.iter().zip(&state.raised).enumerate();
        let segments = segments.map(|(number, (segment, raised))| (Cause::Segment(number), *raised, segment.to - segment.from));
        let kinds = self.kinds.iter().zip(&state.raised_by_kind).enumerate();
        let kinds = kinds.map(|(number, (kind, raised))| (Cause::Kind(number), *raised, kind.seconds));
        // Of equals the last one: a segment that is alone of its kind.
        let all = kinds.chain(segments).filter(|(_, raised, _)| *raised >= least);
        let effect = |(_, raised, seconds): &(Cause, f64, f64)| math::ln(*raised) / seconds;
        let most = all.max_by(|a, b| effect(a).total_cmp(&effect(b)))?;
        Some((most.0, most.1))
    }

    /// The name of a cause: the motion of a segment with its time, or the kind of motion.
    #[must_use]
    pub fn name_of(&self, cause: Cause) -> String {
        match cause {
            Cause::Segment(number) => self.segments.get(number).map_or_else(String::new, Segment::to_string),
            Cause::Kind(number) => self.kinds.get(number).map_or_else(String::new, |kind| kind.name.to_owned()),
        }
    }

    /// The states of a block.
    pub fn of_block<'a>(&'a self, block: &'a str) -> impl Iterator<Item = &'a State> {
        self.states.iter().filter(move |state| state.block == block)
    }

    /// The result of a recorder that has heard a run; `None` if the filter never started.
    pub(super) fn of(recorder: &mut Recorder, known_sensors: &[Sensor], lists: &[Vec<String>]) -> Option<Self> {
        let layout = recorder.layout()?;
        let sigma = recorder.sigma.clone();
        let axes: Vec<usize> = (0..layout.dim()).filter(|i| sigma[*i] > 0.0).collect();
        let view = View {
            layout: &layout,
            sigma: &sigma,
            axes: &axes,
        };
        let kinds = kinds(&recorder.motions);
        let left = view.left(&view.smoothed(&recorder.tracks.first()?.parts));
        let of_kind = |kind: &MotionKind| view.raised(recorder, &left, &|motion| motion.group() == Some(kind.name));
        let by_kind: Vec<Vec<f64>> = kinds.iter().map(of_kind).collect::<Option<_>>()?;
        recorder.join_segments();
        let (all, others) = recorder.tracks.split_first()?;
        let smoothed = view.smoothed(&all.parts);
        let left = view.left(&smoothed);
        let segments: Vec<&Motion> = recorder.motions.iter().filter(|motion| !motion.is_gap).collect();
        let left_out = |segment: &&Motion| view.raised(recorder, &left, &|motion| motion == *segment);
        let by_segment: Vec<Vec<f64>> = segments.iter().map(left_out).collect::<Option<_>>()?;
        let directions = view.directions(&smoothed);
        let stacked = recorder.best.as_ref()?;
        let sensors = recorder.counts.iter().zip(known_sensors).map(|(count, sensor)| SensorUse {
            name: sensor.name.clone(),
            is_constraint: sensor.is_constraint,
            used: count.used,
            rejected: count.rejected,
        });
        let remains = |(track, sensors): (&Track, &Vec<String>)| {
            let smoothed = view.smoothed(&track.parts);
            Without {
                sensors: sensors.clone(),
                rank: known(&view.directions(&smoothed)),
                left: view.left(&smoothed),
            }
        };
        Some(Self {
            states: view.states(&left, &by_segment, &by_kind),
            kinds,
            segments: segments.into_iter().map(Segment::of).collect(),
            rank: known(&directions),
            directions,
            exact_rank: stacked.rank(),
            singular_values: stacked.singular_values(),
            sensors: sensors.collect(),
            without: others.iter().zip(lists).map(remains).collect(),
        })
    }
}

/// The kinds of motion, in order of their first appearance.
fn kinds(motions: &[Motion]) -> Vec<MotionKind> {
    let mut kinds: Vec<MotionKind> = Vec::new();
    for motion in motions {
        let Some(name) = motion.group() else { continue };
        let seconds = motion.duration();
        match kinds.iter_mut().find(|kind| kind.name == name) {
            Some(kind) => kind.seconds += seconds,
            None => kinds.push(MotionKind { name, seconds }),
        }
    }
    kinds
}

/// The number of directions with information above 1.
fn known(directions: &[Direction]) -> usize {
    directions.iter().filter(|direction| direction.information > 1.0).count()
}

/// The states with an initial σ.
struct View<'a> {
    layout: &'a Layout,
    sigma: &'a [f64],
    axes: &'a [usize],
}

impl View<'_> {
    /// The covariance at each border of the parts, given all of them, in units of the initial σ.
    fn smoothed(&self, parts: &[Element]) -> Vec<DMatrix<f64>> {
        let prior = self.sigma.iter().map(|s| f64::from(u8::from(*s > 0.0)));
        let n = self.sigma.len();
        let mut forward = vec![DMatrix::from_diagonal(&DVector::from_iterator(n, prior))];
        for part in parts {
            forward.extend(forward.last().map(|p| part.forward(p)));
        }
        let mut later = DMatrix::zeros(n, n);
        for (place, p) in forward.iter_mut().enumerate().rev() {
            *p = conditioned(p, &later);
            if let Some(part) = place.checked_sub(1).map(|before| &parts[before]) {
                later = part.backward(&later);
            }
        }
        let own = |p: DMatrix<f64>| p.select_rows(self.axes).select_columns(self.axes);
        forward.into_iter().map(own).collect()
    }

    /// The smallest σ of each state, over its initial σ.
    fn left(&self, smoothed: &[DMatrix<f64>]) -> Vec<f64> {
        let smallest = |i: usize| smoothed.iter().map(|p| p[(i, i)]).fold(f64::INFINITY, f64::min);
        (0..self.axes.len()).map(|i| math::sqrt(smallest(i).max(0.0))).collect()
    }

    /// The factor by which the smallest σ of each state, `all` with all parts, grows without the parts of some motions.
    fn raised(&self, recorder: &Recorder, all: &[f64], is_left_out: &dyn Fn(&Motion) -> bool) -> Option<Vec<f64>> {
        let mut parts = recorder.tracks.first()?.parts.clone();
        for (part, motion) in parts.iter_mut().zip(&recorder.motions).filter(|(_, motion)| is_left_out(motion)) {
            *part = forgotten(self.layout, self.sigma, motion.duration());
        }
        let without = self.left(&self.smoothed(&parts));
        Some(without.iter().zip(all).map(|(without, all)| without / all).collect())
    }

    /// The directions at the border at which most are known. Among equals, the smallest volume decides.
    fn directions(&self, smoothed: &[DMatrix<f64>]) -> Vec<Direction> {
        let at = |p: &DMatrix<f64>| {
            let eigen = p.clone().symmetric_eigen();
            let mut all: Vec<Direction> = eigen
                .eigenvalues
                .iter()
                .zip(eigen.eigenvectors.column_iter())
                .map(|(variance, vector)| Direction {
                    information: (1.0 / variance.max(f64::MIN_POSITIVE) - 1.0).max(0.0),
                    components: (vector / vector[vector.icamax()]).iter().copied().collect(),
                })
                .collect();
            all.sort_by(|a, b| a.information.total_cmp(&b.information));
            all
        };
        let order = |directions: &Vec<Direction>| {
            let volume: f64 = directions.iter().map(|d| math::ln(1.0 + d.information)).sum();
            (known(directions), volume)
        };
        let each = smoothed.iter().map(at).map(|directions| (order(&directions), directions));
        let best = each.max_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        best.map(|(_, directions)| directions).unwrap_or_default()
    }

    fn states(&self, left: &[f64], by_segment: &[Vec<f64>], by_kind: &[Vec<f64>]) -> Vec<State> {
        let blocks = self.layout.blocks().iter();
        let named = blocks.flat_map(|block| (0..block.kind.dim()).map(move |k| (block, k)));
        let known = named.filter(|(block, k)| self.axes.contains(&(block.tangent + k)));
        let states = known.zip(left).enumerate().map(|(place, ((block, k), left))| State {
            block: block.name.clone(),
            name: name(block, k),
            unit: block.unit,
            sigma: self.sigma[block.tangent + k],
            left: *left,
            raised: by_segment.iter().map(|raised| raised[place]).collect(),
            raised_by_kind: by_kind.iter().map(|raised| raised[place]).collect(),
        });
        states.collect()
    }
}

/// The name of axis `k` of a block.
fn name(block: &Block, k: usize) -> String {
    if is_heading(block) {
        return ["tilt about north", "tilt about east", "heading"][k].to_owned();
    }
    let words = block.name.replace(['_', '.'], " ");
    let is_motion = block.role == StateRole::Kinematic && !block.is_in_body_axes();
    let axis = match block.kind {
        kind if kind.dim() == 1 => return words,
        Kind::Geodetic => ["north", "east", "down"].get(k),
        Kind::Position | Kind::Velocity if is_motion => ["north", "east", "down"].get(k),
        kind if kind.dim() <= 3 => ["x", "y", "z"].get(k),
        _ => None,
    };
    axis.map_or_else(|| format!("{words} {}", k + 1), |axis| format!("{words} {axis}"))
}
