//! Heading from a compass, for gyros too poor to gyrocompass.
//!
//! ψ = the mean direction of the headings of the last `duration` + declination. With `levelling`
//! earlier in the file, roll and pitch are those it found. Valid while the body keeps its heading.

use super::write_yaw;
use alloc::collections::VecDeque;
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
pub struct Compass {
    sigma: f64,
    declination: f64,
    duration: f64,
    since: Option<Time>,
    headings: VecDeque<(Time, f64)>,
}
memory!(Compass { since, headings; sigma, declination, duration });

impl Compass {
    fn heading(&self) -> f64 {
        // The direction of the mean vector knows no seam at ±π.
        let (sin, cos) = self
            .headings
            .iter()
            .fold((0.0, 0.0), |(s, c), (_, psi)| (s + math::sin(*psi), c + math::cos(*psi)));
        wrap(math::atan2(sin, cos) + self.declination)
    }

    fn is_ready(&self) -> bool {
        let last = self.headings.back().map(|(t, _)| *t);
        self.since
            .zip(last)
            .is_some_and(|(since, last)| last.seconds_since(since) >= self.duration)
    }
}

impl Initialiser for Compass {
    fn row(&mut self, _: usize, time: Time, row: &[f64]) {
        self.since.get_or_insert(time);
        self.headings.push_back((time, row[0]));
        while self.headings.front().is_some_and(|(t, _)| time.seconds_since(*t) > self.duration) {
            self.headings.pop_front();
        }
    }

    fn waits_for(&self) -> Option<String> {
        (!self.is_ready()).then(|| format!("{} s of headings", self.duration))
    }

    fn write(&self, _: Time, layout: &Layout, belief: &mut Belief) {
        if !self.headings.is_empty() {
            write_yaw(layout, belief, self.heading(), self.sigma);
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
    use crate::units::{self, NonNegative, Positive, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// Heading from a compass, averaged.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct CompassSpec {
        /// A stream with a `heading` channel: a compass, the stage `compass`, an attitude filter.
        source: String,
        /// 1σ of the heading that it gives, correlated errors included.
        sigma: NonNegative<dim::Angle>,
        /// Where the compass's north lies clockwise from true north: the magnetic declination.
        #[serde(default)]
        declination: units::Angle,
        /// How long headings are averaged.
        #[serde(default = "one_second")]
        duration: Positive<dim::Duration>,
    }

    fn one_second() -> Positive<dim::Duration> {
        Positive::try_from_si(1.0).unwrap_or_else(|_| unreachable!("one is positive"))
    }

    crate::register!(
        Initialiser,
        "compass",
        CompassSpec,
        r#"
source = "compass"
sigma = "3 deg"
declination = "-8 deg"
duration = "1 s"
"#
    );

    #[typetag::deserialize(name = "compass")]
    impl InitialiserSpec for CompassSpec {
        fn inputs(&self) -> Vec<Listen> {
            let heading = channel::HEADING;
            vec![Listen {
                source: self.source.clone(),
                channels: vec![heading],
            }]
        }

        fn writes(&self) -> Vec<&'static str> {
            vec![state::HEADING.as_str()]
        }

        fn build(&self, _: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
            Ok(Box::new(Compass {
                sigma: self.sigma.si(),
                declination: self.declination.si(),
                duration: self.duration.si(),
                since: None,
                headings: VecDeque::new(),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    #[test]
    fn headings_about_the_seam_average_to_the_south_and_old_ones_are_forgotten() {
        let (declination, duration) = (-0.1, 1.0);
        let mut compass = Compass {
            sigma: 0.05,
            declination,
            duration,
            since: None,
            headings: VecDeque::new(),
        };
        for k in 0..30 {
            let psi = if k < 10 {
                1.0
            } else {
                (if k % 2 == 0 { 1.0 } else { -1.0 }) * (PI - 0.05)
            };
            assert_eq!(compass.waits_for().is_none(), k > 10, "{k}");
            compass.row(0, Time::from_seconds(f64::from(k) * 0.1), &[psi]);
        }
        // 11 headings remain, 6 of one kind: 1e-2 rad for the odd one, 0.05/11.
        assert!(wrap(compass.heading() - (PI - 0.1)).abs() < 1e-2, "{}", compass.heading());
    }
}
