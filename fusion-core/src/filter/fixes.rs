//! Whether fixes of the horizontal position have agreed with the estimate lately.
//!
//! A wrong attitude shows in the position within seconds, and fixes are then rejected. So while successive fixes are
//! used, a sensor that measures the attitude alone is not believed against the estimate. This holds however well its
//! measurements agree with each other: a magnet near a compass is as constant as the field of the Earth.

use super::reacquire::Growing;
use crate::linear::Jacobian;
use crate::state::{AxisUnit, Block, Layout, StateRole};
use crate::time::Time;
use alloc::sync::Arc;

/// This number of successive fixes counts as agreement.
const ENOUGH: u32 = 5;
/// Fixes older than this \[s\] do not count. For slow fixes the limit is three intervals between them.
const RECENT: f64 = 10.0;
const INTERVALS: f64 = 3.0;

/// Follows the fixes that a filter uses.
#[derive(Clone, Debug)]
pub(super) struct Fixes {
    /// Axes of the horizontal position.
    horizontal: Arc<[usize]>,
    /// Fixes used since the last rejected one, the time of the latest, and the time of the one before it.
    in_a_row: u32,
    latest: Option<Time>,
    before: Option<Time>,
}
crate::memory!(Fixes { in_a_row, latest, before; horizontal });

impl Fixes {
    pub(super) fn of(layout: &Layout) -> Self {
        let is_place = |b: &&Block| b.kind.axis(0) == AxisUnit::Metre;
        let motion = layout.blocks().iter().filter(|b| b.role == StateRole::Kinematic);
        let horizontal = motion.filter(is_place).flat_map(|b| b.tangent_range().take(2));
        Self {
            horizontal: horizontal.collect(),
            in_a_row: 0,
            latest: None,
            before: None,
        }
    }

    /// Starts anew with another belief.
    pub(super) fn start(&mut self) {
        (self.in_a_row, self.latest, self.before) = (0, None, None);
    }

    /// Notes whether a measurement with this H was used.
    pub(super) fn hear(&mut self, time: Time, h: &Jacobian, is_used: bool) {
        let is_fix = !self.horizontal.is_empty() && self.horizontal.iter().all(|axis| h.sees(*axis));
        if !is_fix {
            return;
        }
        self.in_a_row = if is_used { self.in_a_row.saturating_add(1) } else { 0 };
        if is_used {
            self.before = self.latest.replace(time);
        }
    }

    /// Whether the fixes show that a measurement with this H is not to be believed against the estimate. `motion` has
    /// the axes of orientations and of all other motion.
    pub(super) fn contradict(&self, time: Time, h: &Jacobian, motion: &Growing) -> bool {
        let sees_any = |axes: &[usize]| axes.iter().any(|axis| h.sees(*axis));
        let interval = |latest: Time| self.before.map_or(0.0, |before| latest.seconds_since(before));
        let is_recent = |latest: Time| time.seconds_since(latest) <= RECENT.max(INTERVALS * interval(latest));
        let are_used = self.in_a_row >= ENOUGH && self.latest.is_some_and(is_recent);
        are_used && sees_any(&motion.angular) && !sees_any(&motion.linear)
    }
}
