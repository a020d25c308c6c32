//! The axes of a magnetometer: how the field turns in the body has to be how the body turns in the field.
//!
//! ```text
//! Δ(P m) = −ω Δt × (P m̄ − b)     over each interval in which the unit turns
//! ```
//!
//! m is measured, ω the angular rate of the inertial unit, b the field of the body, found by least squares. P is each of the signed
//! permutations of the axes, those of a left hand too. P and −P turn alike: which it is, is told by the field of the Earth, which
//! points down north of the equator and up south of it. Strength and unit of the field do not matter. A vehicle that turns about one
//! axis only leaves several P; then nothing is said.

use super::judge::turned;
use super::log::Track;
use super::mistake::{Axes, DECLARED};
use nalgebra::{Matrix3, Vector3};

/// Intervals that are tried \[s\]: short ones for what is turned by hand, longer ones where vehicles turn less than noise does.
const STEPS: [f64; 2] = [0.1, 0.5];
/// The rate from which on one tells \[rad/s\].
const TURNING: f64 = 0.1;
/// Parts of the log, and intervals of one at least.
const PARTS: usize = 10;
const ENOUGH: usize = 20;
/// Axes are others where these leave less than so much of what the declared ones leave unexplained, in all of the log and in nearly
/// each part of it ...
const BETTER: f64 = 0.3;
const PARTS_BETTER: usize = 8;
/// ... and less than so much of all: what is disturbed, or stamped late, follows no axes.
const EXPLAINED: f64 = 0.3;
/// Axes that leave less than so many times what the best ones do may be those.
const ALIKE: f64 = 2.0;

/// What the data say of the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Told {
    /// The declared ones explain it as well as any.
    AsDeclared,
    /// These do.
    Other(Axes),
    /// Too few turns, about too few axes, or a field that follows no axes.
    Untold,
}

/// How much of the field points along gravity, at least, where its sign tells.
const STEEP: f64 = 0.2;

/// Sums over intervals, of one choice of axes.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Of c², c = Δ(P m) + ω Δt × P m̄.
    cc: f64,
    /// Of Wᵀc, W = \[ω Δt ×\], and of WᵀW.
    wc: Vector3<f64>,
    ww: Matrix3<f64>,
}

impl Sums {
    fn plus(&self, other: &Self) -> Self {
        Self {
            cc: self.cc + other.cc,
            wc: self.wc + other.wc,
            ww: self.ww + other.ww,
        }
    }

    /// The best field of the body.
    fn body(&self) -> Vector3<f64> {
        // About an axis that it does not turn about nothing tells of it.
        let ridge = Matrix3::identity() * (1e-6 * self.ww.trace());
        (self.ww + ridge)
            .try_inverse()
            .map_or_else(Vector3::zeros, |inverse| inverse * self.wc)
    }

    /// What that leaves of it.
    fn left(&self) -> f64 {
        self.cc - self.wc.dot(&self.body())
    }
}

/// An interval: the change of the field, its mean, the angle turned, and where down is.
struct Interval {
    change: Vector3<f64>,
    mean: Vector3<f64>,
    angle: Vector3<f64>,
    down: Vector3<f64>,
}

/// Judges the axes of a field by the rates and forces of a unit, on this side of the equator, where that is known; also how many
/// intervals tell of it.
pub(super) fn judge(field: &Track, rates: &Track, forces: &Track, is_north: Option<bool>) -> (Told, usize) {
    let judged = STEPS.map(|step| judge_by(&intervals(field, rates, forces, step), is_north));
    judged.into_iter().find(|(told, _)| *told != Told::Untold).unwrap_or(judged[0])
}

fn judge_by(intervals: &[Interval], is_north: Option<bool>) -> (Told, usize) {
    let untold = (Told::Untold, intervals.len());
    if intervals.len() < PARTS * ENOUGH {
        return untold;
    }
    // One of each pair of opposites.
    let all: Vec<Axes> = permutations().into_iter().filter(|axes| !axes[0].1).collect();
    let part = |p: usize| p * intervals.len() / PARTS..(p + 1) * intervals.len() / PARTS;
    let parts: Vec<Vec<Sums>> = (0..PARTS)
        .map(|p| all.iter().map(|axes| sums(axes, &intervals[part(p)])).collect())
        .collect();
    let whole: Vec<Sums> = (0..all.len())
        .map(|k| parts.iter().fold(Sums::default(), |sum, part| sum.plus(&part[k])))
        .collect();
    let left: Vec<f64> = whole.iter().map(Sums::left).collect();
    let Some(best) = (0..all.len()).min_by(|a, b| left[*a].total_cmp(&left[*b])) else {
        return untold;
    };
    let declared = all.iter().position(|axes| *axes == DECLARED).unwrap_or(best);
    let change: f64 = intervals.iter().map(|i| i.change.norm_squared()).sum();
    let alike = left.iter().filter(|l| **l < ALIKE * left[best]).count();
    let better = parts.iter().filter(|part| part[best].left() < part[declared].left()).count();
    let is_other = left[best] < BETTER * left[declared] && better >= PARTS_BETTER;
    let told = if left[best] > EXPLAINED * change {
        Told::Untold
    } else if alike == 1 && (is_other || best == declared) {
        // Of what points up where it has to point down all signs are wrong.
        let down = steepness(&all[best], whole[best].body(), intervals);
        match is_north.filter(|_| down.abs() > STEEP).map(|is_north| (down > 0.0) == is_north) {
            Some(true) if is_other => Told::Other(all[best]),
            Some(false) => Told::Other(all[best].map(|(axis, negative)| (axis, !negative))),
            Some(true) => Told::AsDeclared,
            None if is_other => Told::Untold,
            None => Told::AsDeclared,
        }
    } else if left[declared] < ALIKE * left[best] {
        Told::AsDeclared
    } else {
        Told::Untold
    };
    (told, intervals.len())
}

/// How much of the Earth's field points down: from −1 to 1.
fn steepness(axes: &Axes, body: Vector3<f64>, intervals: &[Interval]) -> f64 {
    let earth = |i: &Interval| turned(&i.mean, axes) - body;
    let (along, size) = intervals.iter().fold((0.0, 0.0), |(along, size), i| {
        let earth = earth(i);
        (along + earth.dot(&i.down), size + earth.norm())
    });
    along / size
}

fn intervals(field: &Track, rates: &Track, forces: &Track, step: f64) -> Vec<Interval> {
    let (Some(first), Some(last)) = (field.times.first(), field.times.last()) else {
        return Vec::new();
    };
    let steps = ((last - first) / step) as usize;
    let at = |k: usize| first + step * k as f64;
    let of = |k: usize| {
        let (before, after) = (field.mean(at(k), at(k + 1))?, field.mean(at(k + 1), at(k + 2))?);
        // Between the middles of both.
        let rate = rates.mean(at(k) + 0.5 * step, at(k + 1) + 0.5 * step)?;
        let down = -forces.mean(at(k), at(k + 2))?.try_normalize(1.0)?;
        (rate.norm() > TURNING).then(|| Interval {
            change: after - before,
            mean: (before + after) / 2.0,
            angle: rate * step,
            down,
        })
    };
    (0..steps.saturating_sub(1)).filter_map(of).collect()
}

fn sums(axes: &Axes, intervals: &[Interval]) -> Sums {
    intervals.iter().fold(Sums::default(), |sum, i| {
        let c = turned(&i.change, axes) + i.angle.cross(&turned(&i.mean, axes));
        let w = i.angle.cross_matrix();
        sum.plus(&Sums {
            cc: c.norm_squared(),
            wc: w.transpose() * c,
            ww: w.transpose() * w,
        })
    })
}

/// All signed permutations.
fn permutations() -> Vec<Axes> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let signs = |order: [usize; 3]| (0..8).map(move |s: usize| core::array::from_fn(|row| (order[row], s >> row & 1 == 1)));
    ORDERS.into_iter().flat_map(signs).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Field, rates and forces of a unit that is turned about `about` axes, for 60 s, the field in axes that `axes` puts right.
    fn unit(about: usize, axes: &Axes) -> [Track; 3] {
        let track = |channel, values: Vec<[f64; 4]>| Track {
            source: 0,
            channel,
            times: (0..values.len()).map(|k| 0.01 * k as f64).collect(),
            values,
            rate: 100.0,
            integrates: true,
        };
        let mut attitude = nalgebra::UnitQuaternion::identity();
        let (mut rate_sum, mut field_sum, mut force_sum) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        let (mut rates, mut fields, mut forces) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..6000 {
            let t = 0.01 * f64::from(k);
            let all = [0.8 * (0.7 * t).sin(), 0.6 * (1.1 * t).cos(), 0.9 * (0.5 * t + 1.0).sin()];
            let rate = Vector3::from_fn(|i, _| if 2 - i < about { all[i] } else { 0.0 });
            attitude *= nalgebra::UnitQuaternion::from_scaled_axis(rate * 0.01);
            // In the body, with a field of its own.
            let field = attitude.inverse() * Vector3::new(19.0, 1.0, 44.0) + Vector3::new(3.0, -5.0, 2.0);
            // The declared axis that row i is found at reads row i.
            let mut declared = Vector3::zeros();
            (0..3).for_each(|i| declared[axes[i].0] = if axes[i].1 { -field[i] } else { field[i] });
            rate_sum += rate * 0.01;
            field_sum += declared * 0.01;
            force_sum += attitude.inverse() * Vector3::new(0.0, 0.0, -9.8) * 0.01;
            forces.push([force_sum.x, force_sum.y, force_sum.z, 0.0]);
            rates.push([rate_sum.x, rate_sum.y, rate_sum.z, 0.0]);
            fields.push([field_sum.x, field_sum.y, field_sum.z, 0.0]);
        }
        [
            track("magnetic_field", fields),
            track("angular_rate", rates),
            track("specific_force", forces),
        ]
    }

    fn told([field, rates, forces]: &[Track; 3], is_north: Option<bool>) -> Told {
        judge(field, rates, forces, is_north).0
    }

    #[test]
    fn every_signed_permutation_is_found_of_a_unit_that_turns_about_all_axes() {
        for axes in permutations() {
            let unit = unit(3, &axes);
            let expected = if axes == DECLARED { Told::AsDeclared } else { Told::Other(axes) };
            assert_eq!(told(&unit, Some(true)), expected, "{axes:?}");
            // South of the equator the same numbers mean the opposite axes.
            let opposite = axes.map(|(axis, negative)| (axis, !negative));
            let expected = if opposite == DECLARED {
                Told::AsDeclared
            } else {
                Told::Other(opposite)
            };
            assert_eq!(told(&unit, Some(false)), expected, "{axes:?}");
            // Where nobody knows where it is, only what is right in one of them is told.
            let is_right = [axes, opposite].contains(&DECLARED);
            let expected = if is_right { Told::AsDeclared } else { Told::Untold };
            assert_eq!(told(&unit, None), expected, "{axes:?}");
        }
    }

    #[test]
    fn a_unit_that_turns_about_one_axis_accuses_no_axes_that_may_be_right() {
        // Turned about the vertical by 90°: the same turns.
        let turned = unit(1, &[(1, false), (0, true), (2, false)]);
        assert_eq!(told(&turned, Some(true)), Told::AsDeclared);
        // Left-handed: wrong, but others are as good.
        let left = unit(1, &[(1, false), (0, false), (2, false)]);
        assert_eq!(told(&left, Some(true)), Told::Untold);
    }

    #[test]
    fn a_field_that_follows_no_axes_tells_nothing() {
        let mut unit = unit(3, &DECLARED);
        let mut random = fusion_core::testing::Lcg::new(3);
        let mut sum = [0.0; 4];
        for values in &mut unit[0].values {
            sum.iter_mut().take(3).for_each(|s| *s += random.unit());
            *values = sum;
        }
        assert_eq!(told(&unit, Some(true)), Told::Untold);
    }
}
