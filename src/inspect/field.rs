//! A magnetometer beside an inertial unit: the Earth's field as it reads it, if it is that.

use super::log::Log;
use super::numbers::{Integral, Vec3, median, norm};
use super::pair::dot;
use super::signal::Kind;
use super::turn;

/// Fields of the Earth are so strong, iron included that a state can take \[T\].
const STRENGTHS: core::ops::Range<f64> = 15e-6..80e-6;
/// The turn of the field over that of the gyros, if they have the same axes.
const ALIKE: core::ops::Range<f64> = 0.7..1.4;
/// A step of the comparison [s]: the field turns by more than its noise meanwhile.
const STEP: f64 = 0.5;

/// What a magnetometer reads of the Earth's field.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Median strength \[T\].
    pub strength: f64,
    /// Median angle below the plane across the specific force \[rad\].
    pub dip: f64,
}

impl Field {
    /// Of a log with a field, and one of the unit; `None` where it is not as strong as the Earth's, or does not turn as
    /// the gyros do, whose bias is known.
    pub(super) fn of(log: &Log, unit: &Log, bias: Vec3) -> Option<Self> {
        let (t, field) = (log.stamps(), log.values(Kind::MagneticField)?);
        let (force, rate) = (unit.values(Kind::SpecificForce)?, unit.values(Kind::AngularRate)?);
        let (force, rate) = (Integral::of(unit.stamps(), &force), Integral::of(unit.stamps(), &rate));
        let before = |row: usize| t[row.saturating_sub(1)];
        let rates: Vec<Vec3> = (0..t.len())
            .map(|row| rate.mean(before(row), t[row]).unwrap_or([f64::NAN; 3]))
            .map(|rate| [0, 1, 2].map(|i| rate[i] - bias[i]))
            .collect();
        let dips = t.iter().zip(&field).filter_map(|(t, m)| {
            let up = force.mean(t - STEP, t + STEP)?;
            Some((-dot(*m, up) / norm(*m) / norm(up)).clamp(-1.0, 1.0).asin())
        });
        let found = Self {
            strength: median(field.iter().map(|m| norm(*m))),
            dip: median(dips),
        };
        let turns = turn::slope(&field, &rates, log.rate(), STEP)?;
        (STRENGTHS.contains(&found.strength) && ALIKE.contains(&turns) && found.dip.is_finite()).then_some(found)
    }
}
