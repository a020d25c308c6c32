//! The reference of a run.

use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::time::Time;
use nalgebra::{UnitQuaternion, Vector3};

/// One epoch of the reference.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReferenceEpoch {
    /// Its time.
    pub time: Time,
    /// The index of the source of the reference.
    pub source: usize,
    /// Position of the reference's point, if it has one at this time. Unknown latitude and longitude, or an unknown
    /// height, are NaN.
    pub position: Option<Geodetic>,
    /// Velocity \[m/s\], if it has one.
    pub velocity: Option<Vector3<f64>>,
    /// Attitude of the reference's body, if it has one.
    pub attitude: Option<UnitQuaternion<f64>>,
    /// The reference's own 1σ.
    pub sigma: ReferenceSigma,
}

fusion_core::memory!(ReferenceEpoch {
    time,
    source,
    position,
    velocity,
    attitude,
    sigma
});
fusion_core::memory!(ReferenceSigma {
    position,
    velocity,
    attitude
});

/// 1σ of the reference's own errors; 0 if unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceSigma {
    /// Of its position, north east down \[m\].
    pub position: Vector3<f64>,
    /// Of its velocity, north east down \[m/s\].
    pub velocity: Vector3<f64>,
    /// Of its attitude, about the axes of its body \[rad\].
    pub attitude: Vector3<f64>,
}

impl ReferenceEpoch {
    /// The position, and which of north, east and down are known; `estimate` gives the unknown ones.
    #[must_use]
    pub(crate) fn position_beside(&self, estimate: &Geodetic) -> Option<(Geodetic, [bool; 3])> {
        let own = self.position?;
        let (is_placed, has_height) = (own.lat.is_finite() && own.lon.is_finite(), own.height.is_finite());
        let across = if is_placed { own } else { *estimate };
        let height = if has_height { own.height } else { estimate.height };
        Some((Geodetic { height, ..across }, [is_placed, is_placed, has_height]))
    }
}

/// Computes velocities as the slope of a cubic fitted to the positions of `half` epochs on each side. Epochs whose
/// neighbours span more than `max_span` seconds get none.
///
/// Source: Savitzky, Golay 1964, for stamps that are not equidistant.
pub(crate) fn differentiate(epochs: &mut [ReferenceEpoch], half: usize, max_span: f64) {
    let slopes: Vec<Option<Vector3<f64>>> = (0..epochs.len())
        .map(|i| {
            let window = epochs.get(i.checked_sub(half)?..i + half + 1)?;
            let span = window.last()?.time.seconds_since(window.first()?.time);
            if span > max_span {
                return None;
            }
            let mut normal = nalgebra::Matrix4::<f64>::zeros();
            let mut right = nalgebra::Matrix4x3::<f64>::zeros();
            for e in window {
                let t = e.time.seconds_since(epochs[i].time) / span;
                let row = nalgebra::Vector4::new(1.0, t, t * t, t * t * t);
                normal += row * row.transpose();
                right += row * e.position?.difference(&epochs[i].position?).transpose();
            }
            let fit = normal.cholesky()?.solve(&right);
            Some(fit.row(1).transpose() / span)
        })
        .collect();
    for (epoch, slope) in epochs.iter_mut().zip(slopes) {
        epoch.velocity = epoch.velocity.or(slope);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(north: f64) -> Geodetic {
        let origin = Geodetic {
            lat: 0.6,
            lon: 0.1,
            height: 0.0,
        };
        origin.offset(&Vector3::new(north, 0.0, 0.0))
    }

    #[test]
    fn a_cubic_is_differentiated_exactly() {
        let mut epochs: Vec<ReferenceEpoch> = (0..21)
            .map(|k| {
                let t = k as f64 * 0.01;
                ReferenceEpoch {
                    time: Time::from_seconds(t),
                    position: Some(place(5.0 * t + 2.0 * t.powi(3))),
                    ..ReferenceEpoch::default()
                }
            })
            .collect();
        differentiate(&mut epochs, 6, 0.2);
        let v = epochs[10].velocity.unwrap();
        // 1e-6: the curvature of the Earth over a metre, and rounding over 0.12 s.
        assert!((v.x - (5.0 + 6.0 * 0.01)).abs() < 1e-6, "{v}");
        assert!(epochs[2].velocity.is_none());
    }
}
