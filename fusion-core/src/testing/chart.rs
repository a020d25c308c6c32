//! Laws of charts and of the kinds of block.

use super::numeric::within;
use crate::chart::{Chart, Reset};
use crate::linear::BlockMatrix;
use crate::state::{AxisUnit, Block, Kind, Layout, Space};

/// ⊞ and ⊟ of a kind undo each other: (x ⊞ δ) ⊟ x = δ, and x ⊞ 0 = x.
///
/// `delta` is shorter than half a turn where the kind turns.
///
/// # Errors
/// A sentence with the numbers that disagree.
pub fn check_kind(kind: Kind, x: &[f64], delta: &[f64]) -> Result<(), String> {
    let (mut moved, mut still, mut back) = (x.to_vec(), x.to_vec(), vec![0.0; kind.dim()]);
    kind.plus(&mut moved, delta);
    kind.minus(&moved, x, &mut back);
    // 1e-8 m: a few ulps of longitude near π, 3e-9 m each; elsewhere a few roundings.
    let tolerance = if kind == Kind::Geodetic { 1e-8 } else { 1e-14 };
    let size = |v: &[f64]| v.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
    for i in 0..kind.dim() {
        if !within(back[i] - delta[i], tolerance * size(delta) * size(x)) {
            return Err(format!(
                "{kind:?}: (x ⊞ δ) ⊟ x differs from δ on axis {i}: {} instead of {}",
                back[i], delta[i]
            ));
        }
    }
    kind.plus(&mut still, &vec![0.0; kind.dim()]);
    kind.minus(&still, x, &mut back);
    match back.iter().position(|b| !within(*b, 1e-14 * size(x))) {
        Some(i) => Err(format!("{kind:?}: x ⊞ 0 moves axis {i} by {}", back[i])),
        None => Ok(()),
    }
}

/// The laws of a custom manifold at `x`, for the step `delta`: those of [`check_kind`], a step leads to a sane value,
/// and the Jacobian is the derivative of ⊞.
///
/// # Errors
/// A sentence with what is wrong.
pub fn check_space(space: &'static Space, x: &[f64], delta: &[f64]) -> Result<(), String> {
    let (name, kind, n) = (space.name, Kind::Custom(space), space.axes.len());
    let is_word = !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if !is_word {
        return Err(format!("`{name}`: a name has small letters, digits and `_` only"));
    }
    if !(1..=Space::MOST_AXES).contains(&n) {
        return Err(format!("`{name}` has {n} axes, and may have 1 to {}", Space::MOST_AXES));
    }
    let widths = [space.labels.len(), space.origin.len(), x.len()];
    if widths[0] != widths[1] || widths[0] != widths[2] || delta.len() != n {
        return Err(format!(
            "`{name}`: labels, origin and x have {widths:?} numbers, δ has {} of {n}",
            delta.len()
        ));
    }
    let mut moved = x.to_vec();
    kind.plus(&mut moved, delta);
    for (what, value) in [("the origin", space.origin), ("x", x), ("x ⊞ δ", &moved)] {
        if !kind.is_sane(value) {
            return Err(format!("`{name}`: {what}, {value:?}, is not sane"));
        }
    }
    check_kind(kind, x, delta)?;
    let mut jacobian = vec![0.0; n * n];
    (space.jacobian)(x, delta, &mut jacobian);
    // 1e-4 turns a second derivative of 1 into 1e-9 of the difference; rounding is 1e-16 / 1e-4 of the numbers.
    let h = 1e-4;
    for k in 0..n {
        let side = |sign: f64| {
            let (mut at, mut delta, mut out) = (x.to_vec(), delta.to_vec(), vec![0.0; n]);
            delta[k] += sign * h;
            kind.plus(&mut at, &delta);
            kind.minus(&at, &moved, &mut out);
            out
        };
        let (plus, minus) = (side(1.0), side(-1.0));
        for i in 0..n {
            let (analytic, numeric) = (jacobian[i * n + k], (plus[i] - minus[i]) / (2.0 * h));
            // 1e-6: h² / 6 of a third derivative of up to 100, and rounding of numbers up to 1e5.
            if !within(analytic - numeric, 1e-6 * analytic.abs().max(1.0)) {
                return Err(format!(
                    "`{name}`: the Jacobian is {analytic} at ({i}, {k}), and the derivative of ⊞ is {numeric}"
                ));
            }
        }
    }
    Ok(())
}

/// The laws of a chart at `x`, for the correction `delta`: T(x) is the derivative of its retraction;
/// the plain reset is T(x⁺)T(x⁻)⁻¹; the full reset is the derivative of the corrected state;
/// the difference undoes the correction.
///
/// A chart with more coordinates than the canonical chart has no square T: use [`check_reset`] for it.
///
/// # Errors
/// A sentence naming the block.
pub fn check_chart(layout: &Layout, chart: &dyn Chart, x: &[f64], delta: &[f64]) -> Result<(), String> {
    check_reset(layout, chart, x, delta)?;
    let n = layout.dim();
    let (mut t_before, mut t_after, mut reset) = (BlockMatrix::identity(n), BlockMatrix::identity(n), BlockMatrix::identity(n));
    let mut after = x.to_vec();
    chart.to_canonical(layout, x, &mut t_before);
    chart.correct(layout, &mut after, delta, Reset::Plain, &mut reset);
    chart.to_canonical(layout, &after, &mut t_after);
    // reset · T(x⁻) = T(x⁺), without an inverse.
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let carried: f64 = (0..n).map(|k| reset.get(i, k) * t_before.get(k, j)).sum();
        let wanted = t_after.get(i, j);
        // 1e-12: an inverse and two products of 3×3 matrices of condition up to 1e2. Besides, geodetic
        // positions of the group add up as metres do, to the 1e-5 by which their scale changes on the way.
        let scale = if is_geodetic(layout, i) { 1e-5 } else { 0.0 };
        if !within(carried - wanted, (1e-12 + scale) * size(&t_after, i, n)) {
            let name = name_of(layout, i);
            return Err(format!(
                "{chart:?}, `{name}`: reset·T(x⁻) has {carried} at ({i}, {j}), T(x⁺) has {wanted}"
            ));
        }
    }
    Ok(())
}

/// The full reset of the correction `delta` is the derivative of the corrected state: a correction of
/// x⁻ by δ + η moves x⁺ by J η. The difference also undoes the correction.
///
/// # Errors
/// A sentence naming the block.
pub fn check_reset(layout: &Layout, chart: &dyn Chart, x: &[f64], delta: &[f64]) -> Result<(), String> {
    check_retraction(layout, chart, x)?;
    let n = layout.dim();
    let mut reset = BlockMatrix::identity(n);
    let (mut after, mut back) = (x.to_vec(), vec![0.0; n]);
    chart.correct(layout, &mut after, delta, Reset::Full, &mut reset);
    chart.difference(layout, &after, x, &mut back);
    for (i, (back, delta)) in back.iter().zip(delta).enumerate() {
        // 1e-12 of the numbers, and 1e-8 m for a few ulps of longitude.
        let tolerance = if is_geodetic(layout, i) { 1e-8 } else { 1e-12 };
        if !within(back - delta, tolerance * (1.0 + delta.abs()) * size(&reset, i, n)) {
            let name = name_of(layout, i);
            return Err(format!("{chart:?}, `{name}`: the difference is {back} for a correction by {delta}"));
        }
    }
    for (b, j) in axes(layout) {
        let h = step(b, j);
        let numeric = derivative(layout, chart, x, delta, &after, j, h);
        for (i, numeric) in numeric.iter().enumerate() {
            let analytic = reset.get(i, j);
            // 1e-7: h²/6 of a third derivative of up to 10 for h = 1e-4, rounding ε/h = 2e-12, of numbers as
            // large as in the row; 1e-5 of the scale of metres, which changes over the way.
            let relative = if is_geodetic(layout, i) { 1e-5 } else { 1e-7 };
            if !within(numeric - analytic, relative * size(&reset, i, n)) {
                let name = name_of(layout, i);
                return Err(format!(
                    "{chart:?}, `{name}`: reset ({i}, {j}) is {analytic}, numerically {numeric}"
                ));
            }
        }
    }
    Ok(())
}

/// The largest element of a row, at least one.
fn size(m: &BlockMatrix, row: usize, n: usize) -> f64 {
    (0..n).fold(1.0, |most: f64, j| most.max(m.get(row, j).abs()))
}

fn axes(layout: &Layout) -> impl Iterator<Item = (&Block, usize)> {
    layout.blocks().iter().flat_map(|b| b.tangent_range().map(move |j| (b, j)))
}

/// The step along an axis: 1 where ⊞ is addition or nearly so, as on the earth.
fn step(block: &Block, axis: usize) -> f64 {
    let turns = block.kind.axis(axis - block.tangent) == AxisUnit::Radian;
    if turns || matches!(block.kind, Kind::Custom(_)) {
        1e-4
    } else {
        1.0
    }
}

fn is_geodetic(layout: &Layout, axis: usize) -> bool {
    axes(layout).any(|(b, j)| j == axis && b.kind == Kind::Geodetic)
}

/// correct(x, δ) = x ⊞ δ to first order: the retraction's derivative is T, for the correction
/// goes in by T⁻¹.
fn check_retraction(layout: &Layout, chart: &dyn Chart, x: &[f64]) -> Result<(), String> {
    let zero = vec![0.0; layout.dim()];
    let largest = x.iter().fold(1.0, |most: f64, v| most.max(v.abs()));
    for (b, j) in axes(layout) {
        let h = step(b, j);
        let numeric = derivative(layout, chart, x, &zero, x, j, h);
        for (i, v) in numeric.iter().enumerate() {
            let wanted = f64::from(u8::from(i == j));
            // 1e-6: h²/6·f''' with f''' of up to 100 near the edge of the Euler chart, or as
            // large as the positions that turn with an invariant error.
            if !within(v - wanted, 1e-6 * largest) {
                return Err(format!(
                    "{chart:?}, `{}`: the retraction's derivative is {v} at ({i}, {j}) instead of {wanted}",
                    b.name
                ));
            }
        }
    }
    Ok(())
}

/// ∂(correct(x, at + η) ⊟ base)/∂η_j by central differences.
fn derivative(layout: &Layout, chart: &dyn Chart, x: &[f64], at: &[f64], base: &[f64], j: usize, h: f64) -> Vec<f64> {
    let n = layout.dim();
    let mut ends = [vec![0.0; n], vec![0.0; n]];
    for (sign, out) in [1.0, -1.0].into_iter().zip(&mut ends) {
        let (mut delta, mut moved, mut unused) = (at.to_vec(), x.to_vec(), BlockMatrix::identity(n));
        delta[j] += sign * h;
        chart.correct(layout, &mut moved, &delta, Reset::Plain, &mut unused);
        layout.minus(&moved, base, out);
    }
    ends[0].iter().zip(&ends[1]).map(|(p, m)| (p - m) / (2.0 * h)).collect()
}

fn name_of(layout: &Layout, axis: usize) -> &str {
    layout
        .blocks()
        .iter()
        .find(|b| b.tangent_range().contains(&axis))
        .map_or("?", |b| b.name.as_str())
}
