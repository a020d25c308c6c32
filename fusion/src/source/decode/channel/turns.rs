//! Attitudes from angles in a declared sequence, and from matrices.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// How far the columns of a matrix may be from orthonormal: a few digits in a file.
const TOLERANCE: f64 = 1e-2;

/// The axes of three turns, each about an axis that the earlier turns have moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Turns([usize; 3]);

impl Turns {
    /// Reads an order such as `zyx`.
    pub(super) fn new(order: &str) -> Result<Self, String> {
        let axis = |letter: char| "xyz".find(letter.to_ascii_lowercase());
        let axes: Option<Vec<usize>> = order.chars().map(axis).collect();
        match axes.as_deref() {
            Some(&[a, b, c]) if a != b && b != c => Ok(Self([a, b, c])),
            _ => Err(format!(
                "{order:?} is no sequence of turns: three axes of x, y and z, none twice in a row, such as \"zyx\""
            )),
        }
    }

    /// The attitude, from body to navigation axes.
    pub(super) fn attitude(self, angles: &[f64]) -> UnitQuaternion<f64> {
        let turn = |(axis, angle): (usize, &f64)| UnitQuaternion::from_axis_angle(&Vector3::ith_axis(axis), *angle);
        self.0
            .into_iter()
            .zip(angles)
            .map(turn)
            .fold(UnitQuaternion::identity(), |before, turn| before * turn)
    }
}

/// The attitude of a matrix, row by row; `Err` explains why it is not a rotation.
pub(super) fn of_matrix(rows: &[f64]) -> Result<UnitQuaternion<f64>, String> {
    let m = Matrix3::from_row_slice(rows);
    let error = (m.transpose() * m - Matrix3::identity()).amax();
    if error > TOLERANCE {
        return Err(format!(
            "the matrix is not a rotation: its columns are not orthonormal by {error:.3}"
        ));
    }
    if m.determinant() < 0.0 {
        return Err("the matrix turns a right-handed frame into a left-handed one".to_owned());
    }
    Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m)))
}
