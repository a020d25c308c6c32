//! Which axes of the motion each sensor measures, and when each axis was last measured.
//!
//! | a row of H contains | it measures |
//! |---|---|
//! | a share of the position | these axes of the position |
//! | the velocity without the position | these axes of the velocity |
//! | neither | the largest axes of the attitude, or of other motion |
//!
//! A share is |H_ij| σ_j. A share far below the 1σ of the innovation does not count: the rate of the Earth depends on
//! the latitude, but gyros do not measure the position. Position and velocity along one axis count as one: if either
//! is measured, the motion along that axis is held. The attitude is held by sensors that measure it, and through the
//! motion by sensors that measure position or velocity.

use crate::belief::Belief;
use crate::linear::Jacobian;
use crate::math;
use crate::memory::{Memory, Tape};
use crate::state::{AxisUnit, Block, Dynamics, Kind, Layout, StateRole};
use crate::time::Time;
use alloc::vec::Vec;

/// In a row of H, a share does not count if it is below this fraction of the largest share, or of the innovation's
/// 1σ. Examples are the curvature of the earth and a negligible lever arm. A share of 1e-3 of the 1σ needs a million
/// measurements to give any information.
const LEAST: f64 = 1e-3;
/// Within a block, an axis with this fraction of the largest share counts as measured too.
const BESIDE: f64 = 0.1;
/// The number of axes that a set has room for. The axes of the motion come first in a layout.
const ROOM: usize = u64::BITS as usize;

/// Axes of the tangent space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Axes(u64);

impl Memory for Axes {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.remember(tape);
    }
}

impl Axes {
    /// All axes: the value until the measured axes are known.
    pub(super) const ALL: Self = Self(u64::MAX);

    /// The axes of both.
    pub(super) const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    fn list(self) -> impl Iterator<Item = usize> {
        let mut rest = self.0;
        core::iter::from_fn(move || {
            let axis = (rest != 0).then(|| rest.trailing_zeros() as usize)?;
            rest &= rest - 1;
            Some(axis)
        })
    }
}

/// When an axis was measured last, and the period of the sensor that measured it \[s\].
#[derive(Clone, Copy, Debug, Default)]
struct Latest {
    time: Option<Time>,
    period: f64,
}
crate::memory!(Latest { time, period });

/// The kind of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sort {
    /// Anything else than motion.
    Parameter,
    /// Along this axis.
    Position(usize),
    Velocity(usize),
    Other,
}

/// Follows which axes are measured.
#[derive(Clone, Debug)]
pub(super) struct Aid {
    sorts: Vec<Sort>,
    /// 1σ of each axis, lately.
    sigma: Vec<f64>,
    /// Measurements by any sensor, and by a sensor from outside.
    by_any: Vec<Latest>,
    by_outside: Vec<Latest>,
    /// When a sensor from outside was last used.
    outside: Option<Time>,
    start: Time,
}

impl Memory for Aid {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        tape.numbers(&mut self.sigma);
        self.by_any.as_mut_slice().remember(tape);
        self.by_outside.as_mut_slice().remember(tape);
        self.outside.remember(tape);
        self.start.remember(tape);
    }
}

impl Aid {
    pub(super) fn new(layout: &Layout) -> Self {
        let n = layout.dim().min(ROOM);
        let mut sorts = vec![Sort::Parameter; layout.dim()];
        for block in layout.blocks().iter().filter(|b| b.role == StateRole::Kinematic) {
            for (k, axis) in block.tangent_range().enumerate() {
                sorts[axis] = sort(block, k);
            }
        }
        sorts.truncate(n);
        Self {
            sorts,
            sigma: vec![0.0; n],
            by_any: vec![Latest::default(); n],
            by_outside: vec![Latest::default(); n],
            outside: None,
            start: Time::MIN,
        }
    }

    /// The filter starts from this belief.
    pub(super) fn start(&mut self, belief: &Belief) {
        self.start = belief.time;
        self.outside = None;
        self.by_any.fill(Latest::default());
        self.by_outside.fill(Latest::default());
        self.hear(belief);
    }

    /// Notes how well each axis is known.
    pub(super) fn hear(&mut self, belief: &Belief) {
        for (axis, sigma) in self.sigma.iter_mut().enumerate() {
            *sigma = math::sqrt(belief.covariance.element(axis, axis).max(0.0));
        }
    }

    /// The axes that a sensor with this H and these 1σ of its innovations measures.
    pub(super) fn axes(&self, h: &Jacobian, sigma: &[f64]) -> Axes {
        let rows = sigma
            .iter()
            .enumerate()
            .take(h.rows())
            .map(|(row, sigma)| self.axes_of(h.row(row), *sigma));
        Axes(rows.fold(0, |all, of| all | of))
    }

    fn axes_of(&self, row: &[f64], innovation: f64) -> u64 {
        let share = |axis: usize| row[axis].abs() * self.sigma[axis];
        let largest = |is_meant: fn(Sort) -> bool| {
            let meant = (0..self.sorts.len()).filter(|axis| is_meant(self.sorts[*axis]));
            meant.map(share).fold(0.0, f64::max)
        };
        let all = largest(|sort| sort != Sort::Parameter).max(innovation);
        let kinds: [fn(Sort) -> bool; 3] = [
            |sort| matches!(sort, Sort::Position(_)),
            |sort| matches!(sort, Sort::Velocity(_)),
            |sort| sort == Sort::Other,
        ];
        let Some(kind) = kinds.into_iter().find(|kind| largest(*kind) > LEAST * all) else {
            return 0;
        };
        let least = BESIDE * largest(kind);
        let measured = (0..self.sorts.len()).filter(|axis| kind(self.sorts[*axis]) && share(*axis) >= least);
        measured.fold(0, |set, axis| set | 1 << axis)
    }

    /// Notes that a sensor with the period `period` \[s\] was used.
    pub(super) fn used(&mut self, time: Time, axes: Axes, period: f64, is_outside: bool) {
        let latest = Latest { time: Some(time), period };
        for axis in axes.list().filter(|axis| *axis < self.sorts.len()) {
            self.by_any[axis] = latest;
            if is_outside {
                self.by_outside[axis] = latest;
            }
        }
        if is_outside {
            self.outside = Some(time);
        }
    }

    /// Whether sensors from outside have held the motion since `since`, along most of the directions that `axes`
    /// contain. If `axes` contain no direction, whether any such sensor has been used.
    pub(super) fn holds(&self, axes: Axes, since: Time) -> bool {
        let is_later = |time: Option<Time>| time.is_some_and(|time| time >= since);
        let of = |along: usize| axes.list().any(|axis| self.is_along(axis, along));
        let held = |along: &usize| (0..self.sorts.len()).any(|axis| self.is_along(axis, *along) && is_later(self.by_outside[axis].time));
        let told = (0..3).filter(|along| of(*along));
        let (all, held) = (told.clone().count(), told.filter(held).count());
        is_later(self.outside) && 2 * held >= all
    }

    /// Whether each of `axes` has been measured, by any sensor, within `time` \[s\].
    pub(super) fn measures(&self, axes: Axes, now: Time, time: f64) -> bool {
        let is_recent = |axis: usize| self.by_any[axis].time.is_some_and(|latest| now.seconds_since(latest) <= time);
        ![Axes(0), Axes::ALL].contains(&axes) && axes.list().all(is_recent)
    }

    /// Whether position and velocity have not been measured along most directions for longer than `time` \[s\] and
    /// three periods of the sensor that measured them last. False if no part of the motion continues by itself: then
    /// the input measures it.
    pub(super) fn is_missing(&self, now: Time, time: f64) -> bool {
        const PERIODS: f64 = 3.0;
        if !self.sorts.iter().any(|sort| matches!(sort, Sort::Velocity(_))) {
            return false;
        }
        let is_late = |from: Time, period: f64| now.seconds_since(from) > time.max(PERIODS * period);
        let is_held = |along: usize| {
            let mut along = (0..self.sorts.len()).filter(move |axis| self.is_along(*axis, along));
            along.any(|axis| !is_late(self.by_any[axis].time.unwrap_or(self.start), self.by_any[axis].period))
        };
        let there = (0..3).filter(|along| (0..self.sorts.len()).any(|axis| self.is_along(axis, *along)));
        let (all, held) = (there.clone().count(), there.filter(|along| is_held(*along)).count());
        2 * held < all
    }

    fn is_along(&self, axis: usize, along: usize) -> bool {
        matches!(self.sorts.get(axis), Some(Sort::Position(k) | Sort::Velocity(k)) if *k == along)
    }
}

/// The kind of axis `k` of a block that moves.
fn sort(block: &Block, k: usize) -> Sort {
    match block.kind.axis(k) {
        AxisUnit::Metre => Sort::Position(k),
        AxisUnit::MetrePerSecond => Sort::Velocity(k),
        // A vector with its own dynamics is a velocity, in separate axes.
        AxisUnit::Other if matches!(block.kind, Kind::Vector(_)) && block.dynamics != Dynamics::Process => Sort::Velocity(k),
        AxisUnit::Radian | AxisUnit::Other => Sort::Other,
    }
}
