//! Hold: a position that stands still and may be anywhere at the next fix.
//!
//! State      `position` (geodetic) as a random walk
//! Φ          I;  Q = walk²·Δt
//! Use        with a walk far above the fix noise, the latest fix held: the baseline that every
//!            filter should beat

use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::model::{Input, Literal, Process};

/// The runtime model: the block's own dynamics are all there is.
#[derive(Debug, Literal)]
pub struct Hold;

impl Process for Hold {
    fn input_dim(&self) -> usize {
        0
    }

    fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}

    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, ProcessSpec};
    use crate::de::DeserializeSpec;
    use crate::units::{Axes, dim, range};
    use crate::vocabulary::state;
    use fusion_core::geometry::wgs84::Geodetic as Place;
    use fusion_core::state::Dynamics;
    use schemars::JsonSchema;

    /// A position that stays constant between fixes; with a large random walk, that of the latest fix.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct HoldSpec {
        /// Random walk of the position, north east down.
        walk: Axes<dim::PositionRandomWalk, range::NonNegative>,
        /// Initial 1σ of position, around the origin or the position that an initialiser gives.
        position_sigma: Axes<dim::Length, range::NonNegative>,
    }

    crate::register!(
        Process,
        "hold",
        HoldSpec,
        r#"
walk = "100 m/sqrt(s)"
position_sigma = "10 m"
"#
    );

    #[typetag::deserialize(name = "hold")]
    impl ProcessSpec for HoldSpec {
        fn input(&self) -> Vec<Channel> {
            Vec::new()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
            let place = b.origin.unwrap_or(Place {
                lat: 0.0,
                lon: 0.0,
                height: 0.0,
            });
            let psd = self.walk.si().map(|w| w * w).to_vec();
            b.declare(
                state::POSITION,
                "m",
                place,
                self.position_sigma.si().to_vec(),
                Dynamics::RandomWalk { psd },
            )?;
            Ok(Box::new(Hold))
        }
    }
}
