//! Compares headings with courses.

use super::mistake::Remedy;
use fusion_core::math;
/// Agreement of headings with courses: length and direction of the mean of e^{i(course − heading)} and e^{i(course +
/// heading)}.
pub(super) struct Turned {
    pub(super) along: (f64, f64),
    pub(super) against: (f64, f64),
}

/// From this length of the mean, the agreement is not by chance.
const TIED: f64 = 0.9;

impl Turned {
    /// `None` if the course did not turn enough to distinguish `along` from `against`.
    pub(super) fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| {
            let (s, c) = pairs
                .iter()
                .map(|p| math::sin_cos(of(p)))
                .fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
            (math::hypot(s, c) / pairs.len() as f64, math::atan2(s, c))
        };
        let has_turned = pairs.len() >= 50 && mean(&|p| p.1).0 < 0.8;
        has_turned.then(|| Self {
            along: mean(&|p| p.1 - p.0),
            against: mean(&|p| p.1 + p.0),
        })
    }

    /// The mistake, and the text to write.
    pub(super) fn wrong(&self) -> Option<(String, Remedy)> {
        let quarters = |angle: f64| math::round(angle / core::f64::consts::FRAC_PI_2);
        let near = |angle: f64| (angle - quarters(angle) * core::f64::consts::FRAC_PI_2).abs() < 0.4;
        let ((along, offset), (against, sum)) = (self.along, self.against);
        if along > TIED && near(offset) && quarters(offset) != 0.0 {
            let degrees = quarters(offset) * 90.0;
            let help =
                format!("add {degrees} deg to the heading: an `offset`, a `rotation` or a `navigation_rotation`; or the vehicle moves so");
            return Some((format!("the course is {degrees}° clockwise of it"), Remedy::words(help)));
        }
        if against > TIED && along < 0.7 && near(sum) {
            let from = ["north", "east", "south", "west"][(quarters(sum) as i64).rem_euclid(4) as usize];
            let minus = "write a minus before the name of its column, as in `\"-NAME\"`";
            let help = match from {
                "east" => format!(
                    "from east-north-up, write `navigation_rotation = {{ axes = [\"y\", \"x\", \"-z\"] }}`; of roll, pitch, yaw: {minus}, with \
                     the `offset` `\"90 deg\"`"
                ),
                "north" => format!("{minus}, or of a quaternion the opposite of its `inverse`"),
                _ => format!("{minus}, with the `offset` `\"{} deg\"`", 90.0 * quarters(sum)),
            };
            return Some((format!("it is counted anti-clockwise from {from}"), Remedy::words(help)));
        }
        None
    }

    /// Returns true if the heading follows the course, with any rotation or sign.
    pub(super) fn is_tied(&self) -> bool {
        self.along.0.max(self.against.0) > TIED
    }

    /// Returns true if the heading agrees with the course as declared.
    pub(super) fn is_right(&self) -> bool {
        self.along.0 > TIED && self.wrong().is_none()
    }
}
