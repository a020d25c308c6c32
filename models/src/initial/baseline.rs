//! Heading from the line between two fixes, for receivers that report no velocity.
//!
//! ψ = atan2(ΔE, ΔN) from an earlier fix at least `min_distance` away and at most `max_age` old.
//! Valid for a vehicle that has driven forward and about straight over that line.

use super::write_yaw;
use alloc::collections::VecDeque;
use alloc::string::String;
use fusion_core::belief::Belief;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::Initialiser;
use fusion_core::state::{Layout, Manifold};
use fusion_core::time::Time;

/// The runtime initialiser.
#[derive(Clone, Debug, Literal)]
pub struct Baseline {
    min_distance: f64,
    max_age: f64,
    sigma: f64,
    fixes: VecDeque<(Time, Geodetic)>,
    yaw: Option<f64>,
}
memory!(Baseline { fixes, yaw; min_distance, max_age, sigma });

impl Initialiser for Baseline {
    fn row(&mut self, _: usize, time: Time, row: &[f64]) {
        // Without a height the line is that at the height zero: its direction is the same.
        let here = Geodetic::read(&[row[0], row[1], row.get(2).copied().unwrap_or(0.0)]);
        while self.fixes.front().is_some_and(|(t, _)| time.seconds_since(*t) > self.max_age) {
            self.fixes.pop_front();
        }
        // The shortest line that is long enough: the latest course, not an old one.
        let lines = self.fixes.iter().rev().map(|(_, there)| here.difference(there));
        let long = lines.into_iter().find(|d| math::hypot(d.x, d.y) >= self.min_distance);
        self.yaw = long.map(|d| math::atan2(d.y, d.x));
        self.fixes.push_back((time, here));
    }

    fn waits_for(&self) -> Option<String> {
        self.yaw
            .is_none()
            .then(|| format!("two fixes {} m apart, for the course", self.min_distance))
    }

    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        if let Some(yaw) = self.yaw {
            write_yaw(layout, belief, yaw, self.sigma);
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, InitialiserSpec, Listen};
    use crate::de::DeserializeSpec;
    use crate::units::{NonNegative, Positive, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// Heading from the line between two fixes, for receivers that report no velocity.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct BaselineSpec {
        /// A stream with a `position` channel, or with `horizontal_position` where `horizontal` says so.
        source: String,
        /// Reads `horizontal_position`: fixes without a height.
        #[serde(default)]
        horizontal: bool,
        /// Smallest distance between the two fixes.
        min_distance: Positive<dim::Length>,
        /// Largest time between the two fixes.
        max_age: Positive<dim::Duration>,
        /// 1σ of the heading that it gives.
        sigma: NonNegative<dim::Angle>,
    }

    crate::register!(
        Initialiser,
        "baseline",
        BaselineSpec,
        r#"
source = "gnss"
min_distance = "4 m"
max_age = "15 s"
sigma = "12 deg"
"#
    );

    #[typetag::deserialize(name = "baseline")]
    impl InitialiserSpec for BaselineSpec {
        fn inputs(&self) -> Vec<Listen> {
            vec![Listen {
                source: self.source.clone(),
                channels: vec![if self.horizontal {
                    channel::HORIZONTAL_POSITION
                } else {
                    channel::POSITION
                }],
            }]
        }

        fn writes(&self) -> Vec<&'static str> {
            vec![state::HEADING.as_str()]
        }

        fn build(&self, _: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
            Ok(Box::new(Baseline {
                min_distance: self.min_distance.si(),
                max_age: self.max_age.si(),
                sigma: self.sigma.si(),
                fixes: VecDeque::new(),
                yaw: None,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn the_course_is_that_of_the_latest_long_enough_line() {
        let mut b = Baseline {
            min_distance: 4.0,
            max_age: 15.0,
            sigma: 0.2,
            fixes: VecDeque::new(),
            yaw: None,
        };
        let origin = Geodetic {
            lat: 0.7,
            lon: -1.2,
            height: 0.0,
        };
        let mut fix = |t: f64, n: f64, e: f64| {
            let mut row = [0.0; 3];
            Geodetic::write(&origin.offset(&Vector3::new(n, e, 0.0)), &mut row);
            b.row(0, Time::from_seconds(t), &row);
            b.yaw
        };
        assert_eq!(fix(0.0, 0.0, 0.0), None);
        assert_eq!(fix(1.0, 3.0, 0.0), None, "3 m are too short");
        // East from here on: from (3, 0) to (3, 5) is the latest line of 4 m.
        let yaw = fix(2.0, 3.0, 5.0).unwrap();
        assert!(
            (yaw - core::f64::consts::FRAC_PI_2).abs() < 1e-6,
            "the meridians converge by 1e-6 over metres: {yaw}"
        );
        assert_eq!(fix(60.0, 100.0, 5.0), None, "the earlier fixes are too old");
        // A fix without a height counts as well: 10 m north of the last one.
        let mut row = [0.0; 3];
        Geodetic::write(&origin.offset(&Vector3::new(110.0, 5.0, 0.0)), &mut row);
        b.row(0, Time::from_seconds(61.0), &row[..2]);
        assert!(b.yaw.unwrap().abs() < 1e-4, "{:?}", b.yaw);
    }
}
