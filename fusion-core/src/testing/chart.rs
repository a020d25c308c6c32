//! Laws of charts and of the kinds of block.

use super::numeric::within;
use crate::chart::Chart;
use crate::linear::BlockMatrix;
use crate::state::{Kind, Layout};

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

/// A chart's T(x) is the derivative of its retraction at `x`, and the reset it reports for the
/// correction `delta` is T(x⁺)T(x⁻)⁻¹.
///
/// Charts whose own coordinates outnumber the canonical ones have no square T; for them give
/// [`check_reset`] the factor of their projection instead.
///
/// # Errors
/// A sentence naming the block.
pub fn check_chart(layout: &Layout, chart: &dyn Chart, x: &[f64], delta: &[f64]) -> Result<(), String> {
    check_retraction(layout, chart, x)?;
    let n = layout.dim();
    let (mut t_before, mut t_after, mut reset) = (BlockMatrix::identity(n), BlockMatrix::identity(n), BlockMatrix::identity(n));
    let mut after = x.to_vec();
    chart.to_canonical(layout, x, &mut t_before);
    chart.correct(layout, &mut after, delta, &mut reset);
    chart.to_canonical(layout, &after, &mut t_after);
    // reset · T(x⁻) = T(x⁺), without an inverse.
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let carried: f64 = (0..n).map(|k| reset.get(i, k) * t_before.get(k, j)).sum();
        // 1e-12: an inverse and two products of 3×3 matrices of condition up to 1e2.
        if !within(carried - t_after.get(i, j), 1e-12 * (1.0 + t_after.get(i, j).abs())) {
            let name = name_of(layout, i);
            return Err(format!(
                "{chart:?}, `{name}`: reset·T(x⁻) has {carried} at ({i}, {j}), T(x⁺) has {}",
                t_after.get(i, j)
            ));
        }
    }
    Ok(())
}

/// In an additive chart a correction is a shift of coordinates: what moves x⁻ by δ + η moves x⁺
/// by J η, J the reset. Checked by central differences; `factor(block)` scales J where the
/// retraction projects back onto the manifold.
///
/// # Errors
/// A sentence naming the block.
pub fn check_reset(layout: &Layout, chart: &dyn Chart, x: &[f64], delta: &[f64], factor: f64) -> Result<(), String> {
    let n = layout.dim();
    let mut reset = BlockMatrix::identity(n);
    let mut after = x.to_vec();
    chart.correct(layout, &mut after, delta, &mut reset);
    for b in layout.blocks().iter().filter(|b| b.kind == Kind::Attitude) {
        for j in b.tangent_range() {
            let numeric = derivative(layout, chart, x, delta, &after, j, 1e-4);
            for i in b.tangent_range() {
                let analytic = reset.get(i, j) * factor;
                // 1e-7: h²/6·f''' with f''' of up to 10 for h = 1e-4, rounding ε/h = 2e-12.
                if !within(numeric[i] - analytic, 1e-7) {
                    return Err(format!(
                        "{chart:?}, `{}`: reset ({i}, {j}) is {analytic}, numerically {}",
                        b.name, numeric[i]
                    ));
                }
            }
        }
    }
    Ok(())
}

/// correct(x, δ) = x ⊞ δ to first order: the retraction's derivative is T, for the correction
/// goes in by T⁻¹.
fn check_retraction(layout: &Layout, chart: &dyn Chart, x: &[f64]) -> Result<(), String> {
    let zero = vec![0.0; layout.dim()];
    for (b, j) in layout.blocks().iter().flat_map(|b| b.tangent_range().map(move |j| (b, j))) {
        let h = if b.kind == Kind::Attitude { 1e-4 } else { 1.0 };
        let numeric = derivative(layout, chart, x, &zero, x, j, h);
        for (i, v) in numeric.iter().enumerate() {
            let wanted = f64::from(u8::from(i == j));
            // 1e-6: h²/6·f''' with f''' of up to 100 near the edge of the Euler chart.
            if !within(v - wanted, 1e-6) {
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
        chart.correct(layout, &mut moved, &delta, &mut unused);
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
