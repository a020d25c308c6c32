//! Central differences on a layout, with an estimate of their error.

use crate::state::{AxisUnit, Block, Kind, Layout};

/// The step along axis `k` of a block of `kind` whose stored value is `x`.
#[must_use]
pub fn step(kind: Kind, k: usize, x: &[f64]) -> f64 {
    match kind.axis(k) {
        AxisUnit::Metre => 1.0,
        AxisUnit::MetrePerSecond => 0.1,
        AxisUnit::Radian => 1e-2,
        // Unknown units: a step in proportion, and small beside 1.
        AxisUnit::Other => 1e-3 * x.iter().fold(1.0, |m: f64, v| m.max(v.abs())),
    }
}

/// Rounding of a stored value of `kind`, in tangent units.
pub(super) fn rounding(kind: Kind, x: &[f64]) -> f64 {
    match kind {
        // An ulp of longitude near π is 2.8e-9 m.
        Kind::Geodetic => 4e-9,
        Kind::Attitude => 4.0 * f64::EPSILON,
        _ => 2.0 * f64::EPSILON * x.iter().fold(0.0, |m: f64, v| m.max(v.abs())).max(1e-3),
    }
}

/// One column of a numeric Jacobian.
pub(super) struct Column {
    pub(super) value: Vec<f64>,
    /// The largest difference between the two extrapolations over the column, and what the
    /// function's own rounding may add to it.
    pub(super) doubt: f64,
    /// The smallest step taken.
    pub(super) step: f64,
}

/// Writes a value at x, relative to the value at the base point, in tangent units.
pub(super) type Function<'a> = dyn FnMut(&[f64], &mut [f64]) -> Result<(), String> + 'a;

/// The derivative of `f` along axis `k` of `block` at `x`.
pub(super) fn column(layout: &Layout, block: &Block, k: usize, x: &[f64], rows: usize, f: &mut Function<'_>) -> Result<Column, String> {
    let h = step(block.kind, k, &x[block.storage_range()]);
    let jitter = jitter(layout, block, k, x, rows, h, f)?;
    let mut difference = |h: f64| -> Result<Vec<f64>, String> {
        let (mut plus, mut minus) = (vec![0.0; rows], vec![0.0; rows]);
        let mut realised = 0.0;
        for (sign, out) in [(1.0, &mut plus), (-1.0, &mut minus)] {
            let (mut moved, mut delta, mut back) = (x.to_vec(), vec![0.0; layout.dim()], vec![0.0; layout.dim()]);
            delta[block.tangent + k] = sign * h;
            layout.plus(&mut moved, &delta);
            // The step that was stored, which rounding keeps from being h exactly.
            layout.minus(&moved, x, &mut back);
            realised += sign * back[block.tangent + k];
            f(&moved, out)?;
        }
        Ok(plus.iter().zip(&minus).map(|(p, m)| (p - m) / realised).collect())
    };
    let (coarse, middle, fine) = (difference(h)?, difference(0.5 * h)?, difference(0.25 * h)?);
    // Two extrapolations of fourth order; how they differ bounds truncation and rounding.
    let extrapolated = |c: &[f64], f: &[f64]| c.iter().zip(f).map(|(c, f)| (4.0 * f - c) / 3.0).collect::<Vec<_>>();
    let (rough, value) = (extrapolated(&coarse, &middle), extrapolated(&middle, &fine));
    let doubt = rough.iter().zip(&value).fold(0.0, |m: f64, (r, v)| m.max((r - v).abs()));
    let doubt = doubt + 8.0 * jitter / (0.25 * h);
    Ok(Column {
        value,
        doubt,
        step: 0.25 * h,
    })
}

/// How far `f` rounds near `x`: second differences over steps so short that a smooth function
/// has none. For example, Earth-centred coordinates round to 1e-9 m, even in a small difference.
fn jitter(layout: &Layout, block: &Block, k: usize, x: &[f64], rows: usize, h: f64, f: &mut Function<'_>) -> Result<f64, String> {
    let mut largest = 0.0_f64;
    for short in [1.0e-4, 1.7e-4, 2.3e-4, 3.1e-4, 4.3e-4, 5.9e-4, 7.3e-4, 8.9e-4] {
        let mut sum = vec![0.0; rows];
        for sign in [1.0, -1.0] {
            let (mut moved, mut delta, mut out) = (x.to_vec(), vec![0.0; layout.dim()], vec![0.0; rows]);
            delta[block.tangent + k] = sign * short * h;
            layout.plus(&mut moved, &delta);
            f(&moved, &mut out)?;
            sum.iter_mut().zip(&out).for_each(|(s, o)| *s += o);
        }
        largest = sum.iter().fold(largest, |m, s| m.max(s.abs()));
    }
    Ok(largest)
}

/// Whether `value` is a number of at most `limit` in size.
pub(super) fn within(value: f64, limit: f64) -> bool {
    value.abs() <= limit
}

/// Fails unless every number is finite.
pub(super) fn finite(what: &str, values: &[f64]) -> Result<(), String> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(i) => Err(format!("{what} is not finite: element {i} is {}", values[i])),
        None => Ok(()),
    }
}
