//! A magnetometer next to an inertial unit: the Earth's field as it reads it, if it does.

use super::log::Log;
use super::numbers::{Integral, Vec3, by_half, median, norm};
use super::pair::dot;
use super::signal::Kind;
use super::size::STRENGTHS;
use fusion_core::math;
use nalgebra::{UnitQuaternion, Vector3};

/// The mean force is taken over this time before and after a field \[s\].
const STEADY: f64 = 0.5;
/// A step of the comparison ends when the gyros have turned by `TURNED`, which is more than the noise of the field
/// \[rad\]. A step longer than `LONGEST` is ignored, because the gyros drift \[s\].
const TURNED: f64 = 0.15;
const LONGEST: f64 = 2.0;
/// Fewer steps are not enough.
const ENOUGH: usize = 20;
/// The gyros and the field turn alike if the gyros explain at least this share of the turns of the field.
const EXPLAINED: f64 = 0.5;
/// Signs are possible, too, if they explain less than the best ones by at most this share.
const ALIKE: f64 = 0.1;

/// The Earth's field as a magnetometer reads it.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Median strength \[T\].
    pub strength: f64,
    /// Median angle below the plane perpendicular to the specific force \[rad\].
    pub dip: f64,
    /// The scatter of its length, 1σ by the median \[T\].
    pub scatter: f64,
    /// The share of its turns that the gyros explain: 1 is all.
    pub explained: f64,
}

/// The samples of a magnetometer and of gyros without their bias, side by side.
struct Side<'a> {
    t: &'a [f64],
    field: Vec<Vec3>,
    unit: &'a [f64],
    rate: Vec<Vec3>,
}

impl Field {
    /// From a log with a field and a log of the unit with a known gyro bias; `None` if one of them has no numbers.
    ///
    /// # Errors
    /// The reason why it is not used: it is not as strong as the Earth's, or does not turn as the gyros do.
    pub(super) fn of(log: &Log, unit: &Log, bias: Vec3) -> Option<Result<Self, String>> {
        let field = log.values(Kind::MagneticField)?;
        let (force, rate) = (unit.values(Kind::SpecificForce)?, unit.values(Kind::AngularRate)?);
        let force = Integral::of(unit.stamps(), &force);
        let dips = log.stamps().iter().zip(&field).filter_map(|(t, m)| {
            let up = force.mean(t - STEADY, t + STEADY)?;
            Some(math::asin((-dot(*m, up) / norm(*m) / norm(up)).clamp(-1.0, 1.0)))
        });
        let (strength, dip) = (median(field.iter().map(|m| norm(*m))), median(dips));
        if !STRENGTHS.contains(&strength) {
            let why = format!(
                "its median strength is {:.3} uT, and the field of the Earth has 22 to 67 uT",
                1e6 * strength
            );
            return Some(Err(why));
        }
        let scatter = by_half(field.iter().map(|m| (norm(*m) - strength).abs()));
        let side = Side {
            t: log.stamps(),
            field,
            unit: unit.stamps(),
            rate: rate.iter().map(|w| [0, 1, 2].map(|i| w[i] - bias[i])).collect(),
        };
        let explained = match side.explained([1.0; 3]) {
            Ok(explained) if explained >= EXPLAINED && dip.is_finite() => explained,
            Ok(explained) => return Some(Err(side.contradiction(explained))),
            Err(why) => return Some(Err(why)),
        };
        Some(Ok(Self {
            strength,
            dip,
            scatter,
            explained,
        }))
    }
}

impl Side<'_> {
    /// The share of the turns of the field that the gyros explain, with each gyro axis multiplied by a factor: 1 is
    /// all.
    fn explained(&self, factors: Vec3) -> Result<f64, String> {
        let (mut seen, mut left, mut count) = (0.0, 0.0, 0);
        let (mut from, mut turn) = (0, Some(UnitQuaternion::identity()));
        for to in 1..self.t.len() {
            turn = turn.and_then(|turn| Some(turn * self.turn(self.t[to - 1], self.t[to], factors)?));
            let is_whole = turn.is_some_and(|turn| turn.angle() > TURNED);
            if !is_whole && turn.is_some() && self.t[to] - self.t[from] < LONGEST {
                continue;
            }
            let (before, after) = (Vector3::from(self.field[from]), Vector3::from(self.field[to]));
            if let Some(turn) = turn.filter(|_| is_whole && (before + after).iter().all(|m| m.is_finite())) {
                count += 1;
                seen += (after - before).norm_squared();
                left += (turn * after - before).norm_squared();
            }
            (from, turn) = (to, Some(UnitQuaternion::identity()));
        }
        if count < ENOUGH {
            let turned = TURNED.to_degrees();
            return Err(format!(
                "the unit turns too little to compare it with the gyros: by {turned:.0} deg within {LONGEST:.0} s only {count} times"
            ));
        }
        Ok(1.0 - left / seen)
    }

    /// The turn of the unit from one time to another; `None` if its samples do not cover it.
    fn turn(&self, from: f64, to: f64, factors: Vec3) -> Option<UnitQuaternion<f64>> {
        let first = self.unit.partition_point(|t| *t <= from);
        let last = self.unit.partition_point(|t| *t < to);
        if first == 0 || last >= self.unit.len() {
            return None;
        }
        let mut turn = UnitQuaternion::identity();
        for k in first..=last {
            let dt = self.unit[k].min(to) - self.unit[k - 1].max(from);
            let rate = Vector3::from_fn(|i, _| factors[i] * self.rate[k][i]);
            if !(dt >= 0.0 && rate.iter().all(|w| w.is_finite())) {
                return None;
            }
            turn *= UnitQuaternion::from_scaled_axis(rate * dt);
        }
        Some(turn)
    }

    /// The gyro axis or magnetometer axis in which gyros and field contradict each other.
    fn contradiction(&self, explained: f64) -> String {
        let said = |of: f64| format!("{:.0} %", 100.0 * of.max(0.0));
        let why = format!("the gyros explain {} of its turns", said(explained));
        // A mirrored field axis looks like two gyro axes with the wrong sign: all axes except the mirrored one.
        let of = |axis: usize, of_gyro: f64| [0, 1, 2].map(|i| if i == axis { of_gyro } else { -of_gyro });
        let tried = (0..6).filter_map(|k| {
            let (axis, is_gyro) = (k % 3, k < 3);
            let found = self.explained(of(axis, if is_gyro { -1.0 } else { 1.0 })).ok()?;
            Some((found, ["x", "y", "z"][axis], is_gyro))
        });
        let tried: Vec<(f64, &str, bool)> = tried.collect();
        let best = tried.iter().map(|t| t.0).fold(f64::NEG_INFINITY, f64::max);
        if best < EXPLAINED {
            return why;
        }
        // Turns about one axis leave several signs possible.
        let alike = tried.iter().filter(|t| t.0 > best - ALIKE).map(|(_, axis, is_gyro)| {
            let what = if *is_gyro { "the gyros" } else { "the magnetometer" };
            format!("axis {axis} of {what}")
        });
        let alike = alike.collect::<Vec<_>>().join(", or ");
        format!("{why}, and {} if {alike} counts the other way", said(best))
    }
}
