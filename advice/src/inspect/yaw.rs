//! The convention of a recorded heading: its direction and its zero, from the course over ground.

use super::numbers::direction;
use super::track::Track;
use fusion_core::math;

/// A heading against the course.
#[derive(Clone, Copy, Debug)]
pub struct Yaw {
    /// The heading counts clockwise, as courses do.
    pub is_clockwise: bool,
    /// Course minus heading, counted clockwise \[rad\].
    pub offset: f64,
    /// The agreement of all differences: 1 is perfect, 0 means no agreement.
    pub agreement: f64,
}

impl Yaw {
    /// Whether the course determines the convention.
    pub(super) fn is_decided(&self) -> bool {
        /// Headings that do not depend on the course agree less.
        const DECIDED: f64 = 0.5;
        self.agreement >= DECIDED
    }

    /// From headings \[rad\] at stamps; `None` if the vehicle hardly moves.
    pub(super) fn of(t: &[f64], yaw: &[f64], track: &Track) -> Option<Self> {
        let pairs = track.moving().filter_map(|(at, v, _)| {
            let row = t.partition_point(|t| *t < at);
            let is_near = t.get(row).is_some_and(|t| t - at < 1.0) && yaw[row].is_finite();
            is_near.then(|| (math::atan2(v[1], v[0]), yaw[row]))
        });
        let pairs: Vec<(f64, f64)> = pairs.collect();
        if pairs.len() < 10 {
            return None;
        }
        let mean = |sign: f64| direction(pairs.iter().map(|(course, yaw)| course - sign * yaw));
        let (with, against) = (mean(1.0), mean(-1.0));
        let is_clockwise = with.0 >= against.0;
        let (agreement, offset) = if is_clockwise { with } else { against };
        Some(Self {
            is_clockwise,
            offset,
            agreement,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sense_and_the_origin_of_a_heading_are_found() {
        let t: Vec<f64> = (0..200).map(f64::from).collect();
        let course = |t: &f64| 0.05 * t + (0.1 * t).sin();
        let track = Track {
            t: t.clone(),
            velocity: t.iter().map(|t| [course(t).cos(), course(t).sin(), 0.0]).collect(),
            ..Track::default()
        };
        let of = |yaw: &dyn Fn(&f64) -> f64| Yaw::of(&t, &t.iter().map(yaw).collect::<Vec<_>>(), &track).unwrap();
        let nautical = of(&course);
        assert!(
            nautical.is_clockwise && nautical.offset.abs() < 1e-9 && nautical.agreement > 0.999,
            "{nautical:?}"
        );
        // From east, anti-clockwise: course = 90° - yaw.
        let east = of(&|t| core::f64::consts::FRAC_PI_2 - course(t));
        assert!(
            !east.is_clockwise && (east.offset - core::f64::consts::FRAC_PI_2).abs() < 1e-9,
            "{east:?}"
        );
    }
}
