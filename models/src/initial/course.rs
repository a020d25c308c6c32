//! Heading from the GNSS course, once the vehicle moves.
//!
//! ψ = atan2(v_E, v_N) − the yaw of the vehicle's forward axis in the body frame. Valid for a
//! vehicle that drives forward without side slip; a boat in a current needs a compass.

use super::write_yaw;
use alloc::string::String;
use fusion_core::belief::Belief;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::Initialiser;
use fusion_core::state::{Layout, wrap};
use fusion_core::time::Time;

/// The runtime initialiser.
#[derive(Clone, Debug, Literal)]
pub struct Course {
    min_speed: f64,
    sigma: f64,
    mounting_yaw: f64,
    yaw: Option<f64>,
    /// The largest speed so far.
    fastest: f64,
}
memory!(Course { yaw, fastest; min_speed, sigma, mounting_yaw });

impl Initialiser for Course {
    fn row(&mut self, _: usize, _: Time, row: &[f64]) {
        // The latest course counts; a slow course is ignored.
        let speed = math::hypot(row[0], row[1]);
        let fast = speed >= self.min_speed;
        self.fastest = self.fastest.max(speed);
        self.yaw = fast.then(|| wrap(math::atan2(row[1], row[0]) - self.mounting_yaw));
    }

    fn waits_for(&self) -> Option<String> {
        let what = if self.fastest < self.min_speed {
            ", for the course"
        } else {
            " while all else is there"
        };
        let told = || {
            format!(
                "a GNSS speed of {} m/s{what}; the largest so far was {:.1} m/s",
                self.min_speed, self.fastest
            )
        };
        self.yaw.is_none().then(told)
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
    use crate::units::{Angle, NonNegative, Positive, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// Heading from the GNSS course, once the vehicle moves forward fast enough.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct CourseSpec {
        /// A stream with a `velocity` channel, north east down, or with `horizontal_velocity` if `horizontal` is true.
        source: String,
        /// Reads `horizontal_velocity`, for a receiver that does not measure the vertical velocity.
        #[serde(default)]
        horizontal: bool,
        /// Smallest horizontal speed at which the course is used.
        min_speed: Positive<dim::Speed>,
        /// 1σ of the resulting heading.
        sigma: NonNegative<dim::Angle>,
        /// Yaw of the vehicle's forward axis in the body frame.
        #[serde(default)]
        mounting_yaw: Angle,
    }

    crate::register!(
        Initialiser,
        "course",
        CourseSpec,
        r#"
source = "gnss"
min_speed = "3 m/s"
sigma = "8 deg"
mounting_yaw = "0 deg"
"#
    );

    #[typetag::deserialize(name = "course")]
    impl InitialiserSpec for CourseSpec {
        fn inputs(&self) -> Vec<Listen> {
            let velocity = if self.horizontal {
                channel::HORIZONTAL_VELOCITY
            } else {
                channel::VELOCITY
            };
            vec![Listen {
                source: self.source.clone(),
                channels: vec![velocity],
            }]
        }

        fn writes(&self) -> Vec<&'static str> {
            vec![state::HEADING.as_str()]
        }

        fn build(&self, _: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
            let (min_speed, sigma) = (self.min_speed.si(), self.sigma.si());
            Ok(Box::new(Course {
                min_speed,
                sigma,
                mounting_yaw: self.mounting_yaw.si(),
                yaw: None,
                fastest: 0.0,
            }))
        }
    }
}
