//! Speeds of the wheels or tracks on both sides.

use super::draft::{Draft, number};
use crate::inspect::numbers::{Vec3, median};
use crate::inspect::signal::{Kind, Signal};
use crate::inspect::{Inspection, Log};

/// The speeds of both sides.
pub(super) struct Sides {
    pub(super) log: usize,
    /// The way for one unit of the columns \[m\]; `None` if they are speeds.
    radius: Option<f64>,
}

impl Inspection {
    /// The speeds of both sides, if no column has the speed itself. Rates of turn need the radius of the wheels, which
    /// positions show.
    pub(super) fn sides(&self) -> Option<Sides> {
        let log = self.with(Kind::Wheels).filter(|_| self.with(Kind::Speed).is_none())?;
        match self.logs[log].signal(Kind::Wheels)?.unit.as_str() {
            "rad/s" | "deg/s" => Some(Sides {
                log,
                radius: Some(self.radius(&self.logs[log])?),
            }),
            _ => Some(Sides { log, radius: None }),
        }
    }

    /// The median of the speed of the positions over the mean rate of both sides, in motion \[m\].
    fn radius(&self, log: &Log) -> Option<f64> {
        let ((_, track), rates) = (self.position.as_ref()?, log.values(Kind::Wheels)?);
        let t = log.stamps();
        let radii = track.moving().filter_map(|(at, _, speed)| {
            let row = t.partition_point(|t| *t <= at).checked_sub(1)?;
            let rate = 0.5 * (rates[row][0] + rates[row][1]).abs();
            (rate > 0.0).then_some(speed / rate)
        });
        Some(median(radii)).filter(|radius| radius.is_finite() && t.is_sorted())
    }

    /// The forward speeds \[m/s\] for a process that moves with them.
    pub(super) fn forward(&self) -> Option<(usize, Vec<Vec3>)> {
        if let Some(k) = self.with(Kind::Speed) {
            return Some((k, self.logs[k].values(Kind::Speed)?));
        }
        let Sides { log, radius } = self.sides()?;
        let ahead = |v: Vec3| [0.5 * radius.unwrap_or(1.0) * (v[0] + v[1]), 0.0, 0.0];
        Some((log, self.logs[log].values(Kind::Wheels)?.into_iter().map(ahead).collect()))
    }

    /// The sensor of both sides.
    pub(super) fn tracks(&self, draft: &mut Draft) {
        let Some(sides) = self.sides() else { return };
        draft.part("tracks");
        self.source(draft, "wheels", sides.log, &[Kind::Wheels], None);
    }

    /// The channels of both sides.
    pub(super) fn side_channels(&self, draft: &mut Draft, log: &Log, signal: &Signal) {
        let radius = self.sides().and_then(|sides| sides.radius);
        for (side, name) in ["left", "right"].iter().zip(signal.names(&log.table)) {
            draft.set(&format!("{side}.column"), name);
            let why = if let Some(radius) = radius {
                draft.set(&format!("{side}.unit"), "m/s");
                draft.set(&format!("{side}.scale"), number(&format!("{:.4}", radius * signal.factor)));
                "; `scale`: the radius that gives the speed between the positions"
            } else {
                let unit = if signal.unit.is_empty() { "m/s" } else { signal.unit.as_str() };
                draft.set(&format!("{side}.unit"), unit);
                ""
            };
            draft.reason(side, &format!("guessed {}{why}", signal.why));
        }
    }
}
