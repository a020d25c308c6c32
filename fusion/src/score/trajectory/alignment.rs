//! The rigid motion that brings an estimated trajectory closest to the reference.

use super::{Pose, PosePair};
use core::fmt;
use fusion_core::geometry::so3;
use fusion_core::math;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The constant difference between two trajectories that is removed before they are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Alignment {
    /// Nothing.
    None,
    /// A turn about the vertical, and a translation: SE(2) with the height (4 degrees of freedom).
    #[default]
    Yaw,
    /// Any turn, and a translation: SE(3).
    Se3,
}

impl fmt::Display for Alignment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "not aligned",
            Self::Yaw => "yaw and position aligned",
            Self::Se3 => "SE(3) aligned",
        })
    }
}

/// A rigid motion: x ↦ R x + t.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    rotation: UnitQuaternion<f64>,
    translation: Vector3<f64>,
}

impl Motion {
    /// The pair with its estimate moved.
    pub(super) fn aligned(&self, pair: &PosePair) -> PosePair {
        PosePair {
            estimate: Pose {
                position: self.rotation * pair.estimate.position + self.translation,
                attitude: pair.estimate.attitude.map(|q| self.rotation * q),
            },
            ..*pair
        }
    }
}

impl Alignment {
    pub(super) const ALL: [Self; 3] = [Self::None, Self::Yaw, Self::Se3];

    /// The motion of the estimate with the least sum of squared distances; `None` if the positions do not determine it.
    /// This is the case for a single point and, for `Se3`, for a line.
    ///
    /// With C = Σ (q_k − q̄)(p_k − p̄)ᵀ: yaw by tan ψ = (C₁₀ − C₀₁)/(C₀₀ + C₁₁); R = U diag(1, 1, ±1) Vᵀ of C = U D Vᵀ,
    /// with the sign of det U det V (Umeyama 1991, eqs. 38 to 43, without scale).
    pub(super) fn of(self, pairs: &[PosePair]) -> Option<Motion> {
        let n = pairs.len() as f64;
        let mean = |of: fn(&PosePair) -> &Pose| pairs.iter().map(|pair| of(pair).position).sum::<Vector3<f64>>() / n;
        let (p, q) = (mean(|pair| &pair.estimate), mean(|pair| &pair.reference));
        let product = |pair: &PosePair| (pair.reference.position - q) * (pair.estimate.position - p).transpose();
        let c: Matrix3<f64> = pairs.iter().map(product).sum::<Matrix3<f64>>() / n;
        let rotation = match self {
            Self::None => {
                return Some(Motion {
                    rotation: UnitQuaternion::identity(),
                    translation: Vector3::zeros(),
                });
            }
            Self::Yaw => {
                let (sin, cos) = (c[(1, 0)] - c[(0, 1)], c[(0, 0)] + c[(1, 1)]);
                (math::hypot(sin, cos) > f64::EPSILON).then(|| so3::from_rpy(0.0, 0.0, math::atan2(sin, cos)))?
            }
            Self::Se3 => umeyama(&c)?,
        };
        Some(Motion {
            rotation,
            translation: q - rotation * p,
        })
    }
}

/// The rotation from the covariance `c` of two sets of points. As in evo, it is `None` if fewer than two of its
/// singular values are above the rounding of 1 m².
fn umeyama(c: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    if c.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let svd = c.svd(true, true);
    let (mut u, v_t) = (svd.u?, svd.v_t?);
    if svd.singular_values.iter().filter(|d| **d > f64::EPSILON).count() < 2 {
        return None;
    }
    if u.determinant() * v_t.determinant() < 0.0 {
        let least = svd.singular_values.imin();
        u.column_mut(least).neg_mut();
    }
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * v_t)))
}
