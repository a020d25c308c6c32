//! Rows for stages and initialisers: the vehicle is at rest, or drives straight ahead.

use super::ORIGIN;
use crate::block::{Channel, Shape};
use crate::earth::Gravity;
use crate::earth::rates::earth_rate_n;
use crate::vocabulary::channel;
use fusion_core::geometry::so3;
use fusion_core::math;
use fusion_core::state::{Geodetic, Manifold};
use fusion_core::testing::Lcg;
use nalgebra::Vector3;

/// The motion of the vehicle: drives north-east, or rests.
#[derive(Clone, Copy, Debug)]
pub(super) enum Motion {
    Rest,
    Drive,
}

impl Motion {
    pub(super) const ALL: [Self; 2] = [Self::Rest, Self::Drive];

    /// v_eb_n \[m/s\].
    fn velocity(self) -> Vector3<f64> {
        match self {
            Self::Rest => Vector3::zeros(),
            Self::Drive => Vector3::new(8.0, 6.0, 0.0),
        }
    }

    /// The numbers of `channels` at `seconds`, with a little noise on some channels.
    pub(super) fn row(self, channels: &[Channel], seconds: f64, random: &mut Lcg) -> Vec<f64> {
        let mut row = Vec::new();
        for channel in channels {
            let (numbers, noise) = self.numbers(channel, seconds);
            row.extend(numbers.into_iter().map(|v| v + noise * random.signed()));
        }
        row
    }

    /// The numbers of one channel, and the size of the noise on them.
    fn numbers(self, wanted: &Channel, seconds: f64) -> (Vec<f64>, f64) {
        let v = self.velocity();
        let q_nb = so3::from_rpy(0.0, 0.0, math::atan2(v.y, v.x));
        let in_body = |x: Vector3<f64>| q_nb.inverse_transform_vector(&x).as_slice().to_vec();
        match wanted {
            c if *c == channel::ANGULAR_RATE => (in_body(earth_rate_n(ORIGIN.lat)), 1e-4),
            c if *c == channel::SPECIFIC_FORCE => (in_body(-Gravity::default().vector_n(ORIGIN.lat, ORIGIN.height)), 1e-3),
            c if *c == channel::VELOCITY => (v.as_slice().to_vec(), 0.0),
            // High above the place of the rows.
            c if *c == channel::SATELLITE_POSITION => (vec![-2.0e7, 1.0e7, 1.4e7], 0.0),
            c if *c == channel::MAGNETIC_FIELD => (in_body(Vector3::new(3e-5, 0.0, 4e-5)), 0.0),
            c => match c.shape {
                Shape::Geodetic => {
                    let mut place = vec![0.0; 3];
                    Geodetic::write(&ORIGIN.offset(&(v * seconds)), &mut place);
                    (place, 0.0)
                }
                Shape::Quaternion => (vec![q_nb.w, q_nb.i, q_nb.j, q_nb.k], 0.0),
                Shape::Vector | Shape::Angle => (vec![0.5; c.width], 1e-3),
            },
        }
    }
}
