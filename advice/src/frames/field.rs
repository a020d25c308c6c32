//! Checks the axes of a magnetometer against the gyros in the same unit. The change of the field in the body must match
//! the rotation of the body in the field.
//!
//! ```text
//! Δ(P m) = −k ω Δt × (P m̄ − b)     over each interval in which the unit turns
//! ```
//!
//! m is the measured field and ω the angular rate of the inertial unit. Least squares gives the field b of the body and
//! a factor k. P is each of the 24 rotations by quarter turns. k checks the gyros: it is 1 if they are right, another
//! number for another unit, and negative if they turn the wrong way. An odd number of wrong gyro signs gives negative
//! k, with axes turned by Pᵀ.
//!
//! An odd number of wrong signs of the field gives −P, which rotates like P. The field of the Earth decides between P
//! and −P: it points down north of the equator and up south of it. Strength and unit of the field do not matter. A
//! vehicle that turns about one axis only leaves several candidates P. Then only the common part of all candidates is
//! reported.

use super::compare::{Compared, sized};
use super::judge::Judge;
use super::log::Track;
use super::mistake::{self, Axes, DECLARED, Whole, complete, differing, handedness, turned};
use super::regression::Known;
use fusion_core::math;
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Vector3, Vector4};

/// Intervals to try \[s\]: a short one for a unit turned by hand, a longer one for vehicles, which turn less than the
/// noise in a short one.
const STEPS: [f64; 2] = [0.1, 0.5];
/// The least angular rate at which an interval counts \[rad/s\].
const TURNING: f64 = 0.1;
/// Number of parts of the log, and the least number of intervals in a part.
const PARTS: usize = 10;
const ENOUGH: usize = 20;
/// Other axes replace the declared ones if their residual is below this fraction of the declared axes' residual. This
/// must hold for the whole log, and the other axes must be better in at least `PARTS_BETTER` parts ...
const BETTER: f64 = 0.3;
const PARTS_BETTER: usize = 8;
/// ... and if their residual is below this fraction of the whole change. A disturbed or late field follows no axes.
const EXPLAINED: f64 = 0.3;
/// Axes are possible too if their residual is below this multiple of the best one.
const ALIKE: f64 = 2.0;

/// A gyro scale between one half and two is a scale error of the instrument, not another unit.
const SCALE: f64 = 2.0;
/// The factor by which gyros in degrees are too large if they are declared as radians.
const DEGREES: f64 = 180.0 / core::f64::consts::PI;

/// The verdict of the data on the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Told {
    /// The declared axes explain the field as well as any others. Rows that are `None` are not decided.
    AsDeclared(Known),
    /// The axes of the field are these instead.
    Other(Axes),
    /// The gyros turn the wrong way: their axes are these.
    Gyros(Known),
    /// The gyros are too small by a factor.
    Small(f64),
    /// Too few turns.
    Few,
    /// The field does not follow the gyros for any axes.
    Unexplained,
}

impl Told {
    const fn is_told(&self) -> bool {
        !matches!(self, Self::Few | Self::Unexplained)
    }
}

/// The least share of the field along gravity at which its sign counts.
const STEEP: f64 = 0.2;

/// Sums over intervals of least squares, for one choice of axes: d = J (k, k b) with d = Δ(P m), J = (w, \[ω Δt ×\]) and
/// w = −ω Δt × P m̄.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    dd: f64,
    jd: Vector4<f64>,
    jj: Matrix4<f64>,
}

impl Sums {
    fn of(axes: &Axes, intervals: &[Interval]) -> Self {
        let each = intervals.iter().map(|i| {
            let (d, w) = (turned(&i.change, axes), -i.angle.cross(&turned(&i.mean, axes)));
            let cross = i.angle.cross_matrix();
            let j = Matrix3x4::from_columns(&[w, cross.column(0).into(), cross.column(1).into(), cross.column(2).into()]);
            Self {
                dd: d.norm_squared(),
                jd: j.tr_mul(&d),
                jj: j.tr_mul(&j),
            }
        });
        each.fold(Self::default(), Self::plus)
    }

    fn plus(self, other: Self) -> Self {
        Self {
            dd: self.dd + other.dd,
            jd: self.jd + other.jd,
            jj: self.jj + other.jj,
        }
    }

    /// The best factor k of the gyros; zero if nothing turns.
    fn factor(&self) -> f64 {
        // The field of the body along an axis without rotation is not observable: the ridge keeps the matrix
        // invertible.
        let ridge = Matrix4::from_diagonal(&Vector4::new(0.0, 1.0, 1.0, 1.0)) * self.ridge();
        (self.jj + ridge).try_inverse().map_or(0.0, |inverse| (inverse * self.jd).x)
    }

    fn ridge(&self) -> f64 {
        1e-6 * self.jj.fixed_view::<3, 3>(1, 1).trace()
    }

    /// For this factor, the best field of the body multiplied by it, and the residual.
    fn with(&self, factor: f64) -> (Vector3<f64>, f64) {
        let body = self.jj.fixed_view::<3, 3>(1, 1) + Matrix3::identity() * self.ridge();
        let rest = self.jd.fixed_rows::<3>(1) - self.jj.fixed_view::<3, 1>(1, 0) * factor;
        let best = body.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * rest);
        let left = self.dd - 2.0 * factor * self.jd.x + math::powi(factor, 2) * self.jj.m11 - rest.dot(&best);
        (best, left)
    }
}

/// An interval: the change of the field, its mean, the rotation angle, and the down direction.
struct Interval {
    change: Vector3<f64>,
    mean: Vector3<f64>,
    angle: Vector3<f64>,
    down: Vector3<f64>,
}

/// Judges the axes of a field by the rates and forces of a unit, and the rates by the field. `is_north` is the
/// hemisphere, if known. Also returns the number of intervals used.
pub(super) fn judge(field: &Track, rates: &Track, forces: &Track, is_north: Option<bool>) -> (Told, usize) {
    let judged = STEPS.map(|step| judge_by(&intervals(field, rates, forces, step), is_north));
    let other = |factor: f64| {
        let rates = Track {
            values: rates.values.iter().map(|v| v.map(|v| v * factor)).collect(),
            ..rates.clone()
        };
        let by = |step| judge_by(&intervals(field, &rates, forces, step), is_north);
        let is_right = |(told, _): &(Told, usize)| matches!(told, Told::AsDeclared(_));
        let found = STEPS.into_iter().map(by).find(is_right);
        found.map(|(_, count)| (Told::Small(factor), count))
    };
    let told = judged.into_iter().find(|(told, _)| told.is_told());
    // In another unit the gyros may seem to rest.
    told.or_else(|| [DEGREES, 1.0 / DEGREES].into_iter().find_map(other))
        .unwrap_or(judged[0])
}

fn judge_by(intervals: &[Interval], is_north: Option<bool>) -> (Told, usize) {
    let count = intervals.len();
    if count < PARTS * ENOUGH {
        return (Told::Few, count);
    }
    let all: Vec<Axes> = permutations().into_iter().filter(|axes| handedness(axes) > 0.0).collect();
    let part = |p: usize| p * count / PARTS..(p + 1) * count / PARTS;
    let parts: Vec<Vec<Sums>> = (0..PARTS)
        .map(|p| all.iter().map(|axes| Sums::of(axes, &intervals[part(p)])).collect())
        .collect();
    let whole: Vec<Sums> = (0..all.len())
        .map(|k| parts.iter().fold(Sums::default(), |sum, part| sum.plus(part[k])))
        .collect();
    let factors: Vec<f64> = whole.iter().map(Sums::factor).collect();
    let left: Vec<f64> = whole.iter().zip(&factors).map(|(sums, factor)| sums.with(*factor).1).collect();
    let Some(best) = (0..all.len()).min_by(|a, b| left[*a].total_cmp(&left[*b])) else {
        return (Told::Few, count);
    };
    let change: f64 = intervals.iter().map(|i| i.change.norm_squared()).sum();
    if left[best] > EXPLAINED * change {
        return (Told::Unexplained, count);
    }
    let declared = all.iter().position(|axes| *axes == DECLARED).unwrap_or(best);
    let is_alike = |k: usize| left[k] < ALIKE * left[best];
    let alike = || (0..all.len()).filter(|k| is_alike(*k));
    let is_size = |factor: f64| (1.0 / SCALE..SCALE).contains(&factor);
    let is_sized = |k: usize| is_size(factors[k]);
    // The rows on which all possible axes agree.
    let agreed = || {
        let of = |k: usize| gyros(&all[k], factors[k] < 0.0);
        let first = of(best);
        [0, 1, 2].map(|row| alike().all(|k| of(k)[row] == first[row]).then_some(first[row]))
    };
    let better = parts
        .iter()
        .filter(|part| part[best].with(factors[best]).1 < part[declared].with(1.0).1)
        .count();
    let is_other = left[best] < BETTER * whole[declared].with(1.0).1 && better >= PARTS_BETTER;
    let told = if is_alike(declared) && is_sized(declared) {
        match alike().count() {
            1 => sided(&all[best], &whole[best], intervals, is_north, false),
            _ => Told::AsDeclared(agreed()),
        }
    } else if !is_other {
        Told::Unexplained
    } else if alike().all(|k| is_size(-factors[k])) {
        Told::Gyros(agreed())
    } else if is_alike(declared) && alike().all(|k| factors[k] > 0.0 && !is_sized(k)) {
        Told::Small(factors[declared])
    } else if alike().count() == 1 && is_sized(best) {
        sided(&all[best], &whole[best], intervals, is_north, true)
    } else {
        Told::Unexplained
    };
    (told, count)
}

/// The axes of the field, or their opposites: if the field points up where it should point down, all signs are wrong.
fn sided(axes: &Axes, sums: &Sums, intervals: &[Interval], is_north: Option<bool>, is_other: bool) -> Told {
    let factor = sums.factor();
    let down = steepness(axes, sums.with(factor).0 / factor, intervals);
    match is_north.filter(|_| down.abs() > STEEP).map(|is_north| (down > 0.0) == is_north) {
        Some(true) if is_other => Told::Other(*axes),
        Some(false) => Told::Other(axes.map(|(axis, negative)| (axis, !negative))),
        None if is_other => Told::Unexplained,
        _ => Told::AsDeclared(DECLARED.map(Some)),
    }
}

/// The axes of the gyros that explain the same data if the axes of the field are right: Pᵀ, or −Pᵀ.
fn gyros(axes: &Axes, is_reversed: bool) -> Axes {
    let mut gyros = DECLARED;
    for (row, (axis, negative)) in axes.iter().enumerate() {
        gyros[*axis] = (row, *negative != is_reversed);
    }
    gyros
}

/// The share of the Earth's field that points down, from −1 to 1.
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
        // Between the midpoints of both.
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

/// All signed permutations.
pub(super) fn permutations() -> Vec<Axes> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let signs = |order: [usize; 3]| (0..8).map(move |s: usize| core::array::from_fn(|row| (order[row], s >> row & 1 == 1)));
    ORDERS.into_iter().flat_map(signs).collect()
}

impl Judge<'_> {
    /// Compares each magnetic field with the rotation of the inertial unit, unless something contradicts this
    /// comparison.
    pub(super) fn fields(&mut self) {
        let mut units = self.all("angular_rate").into_iter().filter(|rates| !self.is_reference(rates));
        let Some((rates, forces)) = units.find_map(|rates| self.beside(&rates, "specific_force").map(|forces| (rates, forces))) else {
            return;
        };
        let origin = self.design.run.origin.map(|place| place.latitude.si());
        let fix = || self.all("position").first().map(|track| track.values[0][0]);
        let is_north = origin.or_else(fix).map(|latitude| latitude > 0.0);
        for track in self.all("magnetic_field") {
            let with = format!("the turns of {}", self.name(&rates));
            if !self.found.mistakes.is_empty() {
                self.list(&track, &with, 0, "not judged while something else is wrong");
                continue;
            }
            let (told, samples) = judge(&track, &rates, &forces, is_north);
            self.field(&track, &rates, &with, &told, samples);
        }
    }

    /// Reports the comparison of a magnetic field with the rotation of the inertial unit.
    fn field(&mut self, track: &Track, rates: &Track, with: &str, told: &Told, samples: usize) {
        let name = self.name(track);
        // The channel that is wrong.
        let (wrong, with) = match told {
            Told::Gyros(_) | Told::Small(_) => (rates, format!("the turns of {name}")),
            _ => (track, with.to_owned()),
        };
        let verdict = match told {
            Told::AsDeclared(known) => match mistake::of_rows(false, |row| known[row].is_none()) {
                open if open.is_empty() => "as declared".to_owned(),
                _ if known.iter().all(Option::is_none) => "not decided: other axes agree as well".to_owned(),
                open => format!(
                    "{} as declared; {open} not decided",
                    mistake::of_rows(false, |row| known[row].is_some())
                ),
            },
            Told::Few => "not judged: a minute of turns about several axes, far from iron, would tell".to_owned(),
            Told::Unexplained => "not decided: no axes of field or gyros explain how the field turns; small or very fast turns do not, \
                 nor does a field that iron disturbs"
                .to_owned(),
            Told::Other(axes) => differing(&axes.map(Some), false),
            Told::Gyros(known) => match differing(known, false) {
                known if known.is_empty() => "the wrong way round: which axis is not decided".to_owned(),
                known => known,
            },
            Told::Small(small) => sized(*small),
        };
        self.list(wrong, &with, samples, verdict);
        let compared = Compared {
            with: &with,
            ..Compared::default()
        };
        match told {
            Told::Other(axes) => self.axes(track, &axes.map(Some), Some(Whole { axes: *axes, open: None }), &compared),
            Told::Gyros(known) if *known != [None; 3] => self.axes(rates, known, complete(*known, |_, _| None), &compared),
            Told::Small(small) => self.factor(rates, &with, *small, 0.25),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Field, rates and forces of a unit that turns about `about` axes for 60 s. `axes` corrects the axes of the field.
    fn unit(about: usize, axes: &Axes) -> [Track; 3] {
        let track = |channel, values: Vec<[f64; 4]>| Track {
            source: 0,
            channel,
            times: (0..values.len()).map(|k| 0.01 * k as f64).collect(),
            values,
            rate: 100.0,
            integrates: true,
            way: Vec::new(),
        };
        let mut attitude = nalgebra::UnitQuaternion::identity();
        let (mut rate_sum, mut field_sum, mut force_sum) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        let (mut rates, mut fields, mut forces) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..6000 {
            let t = 0.01 * f64::from(k);
            let all = [0.8 * (0.7 * t).sin(), 0.6 * (1.1 * t).cos(), 0.9 * (0.5 * t + 1.0).sin()];
            let rate = Vector3::from_fn(|i, _| if 2 - i < about { all[i] } else { 0.0 });
            attitude *= nalgebra::UnitQuaternion::from_scaled_axis(rate * 0.01);
            // In the body, plus a field of the body itself.
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

    const RIGHT: Told = Told::AsDeclared([Some((0, false)), Some((1, false)), Some((2, false))]);

    fn told([field, rates, forces]: &[Track; 3], is_north: Option<bool>) -> Told {
        judge(field, rates, forces, is_north).0
    }

    #[test]
    fn every_signed_permutation_is_found_of_a_unit_that_turns_about_all_axes() {
        for axes in permutations() {
            let unit = unit(3, &axes);
            let expected = if axes == DECLARED { RIGHT } else { Told::Other(axes) };
            assert_eq!(told(&unit, Some(true)), expected, "{axes:?}");
            // South of the equator the same numbers mean the opposite axes.
            let opposite = axes.map(|(axis, negative)| (axis, !negative));
            let expected = if opposite == DECLARED { RIGHT } else { Told::Other(opposite) };
            assert_eq!(told(&unit, Some(false)), expected, "{axes:?}");
            // If the hemisphere is unknown, only a result that is right for one of them is reported.
            let is_right = [axes, opposite].contains(&DECLARED);
            let expected = if is_right { RIGHT } else { Told::Unexplained };
            assert_eq!(told(&unit, None), expected, "{axes:?}");
        }
    }

    #[test]
    fn a_unit_that_turns_about_one_axis_accuses_no_axes_that_may_be_right() {
        // Turned about the vertical by 90°: the same rotation.
        let turned = unit(1, &[(1, false), (0, true), (2, false)]);
        assert_eq!(told(&turned, Some(true)), Told::AsDeclared([None, None, Some((2, false))]));
        // Left-handed axes are wrong, but others explain the data as well.
        let left = unit(1, &[(1, false), (0, false), (2, false)]);
        assert_eq!(told(&left, Some(true)), Told::Unexplained);
    }

    /// The unit with gyros whose axis i reads axis `axes[i]` of the right gyros, times `factor`.
    fn with_gyros(axes: &Axes, factor: f64) -> [Track; 3] {
        let mut unit = unit(3, &DECLARED);
        for values in &mut unit[1].values {
            let right = *values;
            (0..3).for_each(|i| values[axes[i].0] = factor * if axes[i].1 { -right[i] } else { right[i] });
        }
        unit
    }

    #[test]
    fn gyros_that_turn_the_wrong_way_are_found_and_no_field_is_accused() {
        for axes in permutations().into_iter().filter(|axes| handedness(axes) < 0.0) {
            assert_eq!(told(&with_gyros(&axes, 1.0), Some(true)), Told::Gyros(axes.map(Some)), "{axes:?}");
        }
    }

    #[test]
    fn gyros_in_another_unit_are_found_by_the_field() {
        for factor in [DEGREES, 1.0 / DEGREES] {
            let Told::Small(small) = told(&with_gyros(&DECLARED, factor), Some(true)) else {
                panic!("{factor}: {:?}", told(&with_gyros(&DECLARED, factor), Some(true)));
            };
            // 10 %: over half a second of such rotation the arc differs from its chord.
            assert!((small * factor - 1.0).abs() < 0.1, "{factor}: {small}");
        }
        assert_eq!(
            told(&with_gyros(&DECLARED, 1.05), Some(true)),
            RIGHT,
            "5 % is an error of the scale, not another unit"
        );
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
        assert_eq!(told(&unit, Some(true)), Told::Unexplained);
    }
}
