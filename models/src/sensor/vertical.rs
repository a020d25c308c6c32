//! The height of a point of the body: the common part of height, depth and pressure sensors.
//!
//! Height     `h_a = h_b − e₃ᵀ C_nb l_ba_b` \[m\], above the ellipsoid
//! Jacobian   ∂/∂δr = [0 0 −1],  ∂/∂δφ_b = e₃ᵀ C_nb [l ×],  ∂/∂l = −e₃ᵀ C_nb

use fusion_core::geometry::so3::{rotation, skew};
use fusion_core::linear::Jacobian;
use fusion_core::model::Literal;
use fusion_core::state::{Attitude, Geodetic, Param, Quantity, Vector, View};
use nalgebra::RowVector3;

/// A point of the body whose height a sensor measures.
#[derive(Debug, Literal)]
pub struct Vertical {
    position: Quantity<Geodetic>,
    attitude: Option<Quantity<Attitude>>,
    lever_arm: Param<Vector<3>>,
}

impl Vertical {
    /// Height above the ellipsoid \[m\].
    pub(super) fn height(&self, at: &View<'_>) -> f64 {
        let height = at.get(&self.position).height;
        self.attitude
            .as_ref()
            .map_or(height, |a| height - (at.get(a) * at.get(&self.lever_arm)).z)
    }

    /// Adds `slope` times the derivative of the height to row 0.
    pub(super) fn jacobian(&self, at: &View<'_>, slope: f64, h: &mut Jacobian) {
        h.add(0, &self.position, &RowVector3::new(0.0, 0.0, -slope));
        if let Some(attitude) = &self.attitude {
            let down = rotation(&at.get(attitude)).row(2) * slope;
            h.add(0, attitude, &(down * skew(&at.get(&self.lever_arm))));
            h.add(0, &self.lever_arm, &-down);
        }
    }

    #[cfg(test)]
    pub(super) fn fixed(height: f64, attitude: nalgebra::UnitQuaternion<f64>, lever_arm: nalgebra::Vector3<f64>) -> Self {
        Self {
            position: Quantity::Fixed(Geodetic::new(0.6, 2.2, height)),
            attitude: Some(Quantity::Fixed(attitude)),
            lever_arm: Param::Fixed(lever_arm),
        }
    }
}

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError};
    use crate::param::VectorParam;
    use crate::units::dim;
    use crate::vocabulary::state;
    use nalgebra::Vector3;

    impl Vertical {
        pub(crate) fn build(b: &mut Build<'_>, lever_arm: &VectorParam<dim::Length>) -> Result<Self, BuildError> {
            let lever_arm = b.param("lever_arm", lever_arm)?;
            let at_the_body = matches!(&lever_arm, Param::Fixed(l) if *l == Vector3::zeros());
            Ok(Self {
                position: b.quantity(state::POSITION)?,
                attitude: if at_the_body { None } else { Some(b.quantity(state::ATTITUDE)?) },
                lever_arm,
            })
        }
    }
}
