//! Small dense factors and solves: S is at most as large as a measurement. No inverse is formed.

use super::dense::axpy;
use crate::math;

/// Lower Cholesky factor of the symmetric m×m matrix `s` into `l`; false if it is not positive
/// definite.
#[must_use]
pub fn cholesky(s: &[f64], l: &mut [f64], m: usize) -> bool {
    // Loops of the usual lengths are unrolled.
    match m {
        1 => factor(&s[..1], &mut l[..1], 1),
        2 => factor(&s[..4], &mut l[..4], 2),
        3 => factor(&s[..9], &mut l[..9], 3),
        6 => factor(&s[..36], &mut l[..36], 6),
        _ => factor(s, l, m),
    }
}

/// Computes the factors C D⁻¹ Cᵀ first: a column then waits for one division, not for a root and a division.
#[inline(always)]
fn factor(s: &[f64], l: &mut [f64], m: usize) -> bool {
    for j in 0..m {
        // C_ik / D_k is stored above the diagonal, in row k; later columns subtract it.
        for i in j..m {
            let mut sum = s[i * m + j];
            for k in 0..j {
                sum -= l[i * m + k] * l[k * m + j];
            }
            l[i * m + j] = sum;
        }
        let d = l[j * m + j];
        if !(d > 0.0 && d.is_finite()) {
            return false;
        }
        let inverse = 1.0 / d;
        for i in j + 1..m {
            l[j * m + i] = l[i * m + j] * inverse;
        }
    }
    for j in 0..m {
        let root = math::sqrt(l[j * m + j]);
        l[j * m + j] = root;
        for i in j + 1..m {
            l[i * m + j] /= root;
            l[j * m + i] = 0.0;
        }
    }
    true
}

/// Solves L y = b in place; L lower, m×m, row by row.
pub fn solve_lower(l: &[f64], b: &mut [f64], m: usize) {
    match m {
        1 => forward(&l[..1], &mut b[..1], 1),
        2 => forward(&l[..4], &mut b[..2], 2),
        3 => forward(&l[..9], &mut b[..3], 3),
        _ => forward(l, b, m),
    }
}

#[inline(always)]
fn forward(l: &[f64], b: &mut [f64], m: usize) {
    for i in 0..m {
        let mut sum = b[i];
        for k in 0..i {
            sum -= l[i * m + k] * b[k];
        }
        b[i] = sum / l[i * m + i];
    }
}

/// Solves (L Lᵀ) X = B in place for B of `m` rows of length `ld`.
pub fn solve_rows(l: &[f64], b: &mut [f64], m: usize, ld: usize) {
    for i in 0..m {
        let (done, rest) = b.split_at_mut(i * ld);
        let row = &mut rest[..ld];
        for k in 0..i {
            axpy(-l[i * m + k], &done[k * ld..(k + 1) * ld], row);
        }
        let inverse = 1.0 / l[i * m + i];
        row.iter_mut().for_each(|v| *v *= inverse);
    }
    for i in (0..m).rev() {
        let (head, tail) = b.split_at_mut((i + 1) * ld);
        let row = &mut head[i * ld..];
        for k in i + 1..m {
            axpy(-l[k * m + i], &tail[(k - i - 1) * ld..(k - i) * ld], row);
        }
        let inverse = 1.0 / l[i * m + i];
        row.iter_mut().for_each(|v| *v *= inverse);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cholesky_refuses_what_is_not_positive() {
        let mut l = [0.0; 4];
        assert!(cholesky(&[4.0, 2.0, 2.0, 3.0], &mut l, 2));
        assert_eq!(l, [2.0, 0.0, 1.0, 2_f64.sqrt()]);
        for bad in [
            [1.0, 1.0, 1.0, 1.0],
            [1.0, 2.0, 2.0, 1.0],
            [f64::NAN, 0.0, 0.0, 1.0],
            [f64::INFINITY, 0.0, 0.0, 1.0],
        ] {
            assert!(!cholesky(&bad, &mut l, 2), "{bad:?}");
        }
    }
}
