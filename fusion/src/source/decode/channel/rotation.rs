//! Fixed rotations as declared.

use crate::source::decode::spec::RotationSpec;
use fusion_core::geometry::so3;
use nalgebra::Matrix3;

/// The matrix of a rotation; `Err` is the key below the rotation and the reason.
pub(super) fn matrix(spec: &RotationSpec) -> Result<Matrix3<f64>, (String, String)> {
    match (&spec.rpy, &spec.axes) {
        (Some(rpy), None) => {
            let [roll, pitch, yaw] = rpy.si();
            Ok(so3::rotation(&so3::from_rpy(roll, pitch, yaw)))
        }
        (None, Some(axes)) => {
            let mut m = Matrix3::zeros();
            for (row, axis) in axes.iter().enumerate() {
                let (sign, letter) = axis.strip_prefix('-').map_or((1.0, axis.as_str()), |letter| (-1.0, letter));
                let column = ["x", "y", "z"].into_iter().position(|known| known == letter);
                let column = column.ok_or_else(|| (format!(".axes.{row}"), format!("{axis:?} is not an axis: x, y, z, -x, -y or -z")))?;
                m[(row, column)] = sign;
            }
            match m.determinant() {
                d if d > 0.5 => Ok(m),
                d if d < -0.5 => Err((
                    ".axes".to_owned(),
                    "these axes turn a right-handed frame into a left-handed one".to_owned(),
                )),
                _ => Err((".axes".to_owned(), "each of x, y and z must occur once".to_owned())),
            }
        }
        _ => Err((String::new(), "a rotation is given by `rpy` or by `axes`".to_owned())),
    }
}
