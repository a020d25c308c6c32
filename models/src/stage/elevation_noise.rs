//! The 1σ of pseudoranges by the elevation of their satellites, and an elevation mask.
//!
//! Noise    σ² = a² + b²/sin² E, E the elevation; a sensor uses it by `noise = { from_source = true }`
//! Mask     a row below it does not pass
//! Source   RTKLIB 2.4.2 manual, eq. E.6.24

use super::satellite::{Body, WIDTH};
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::View;
use fusion_core::time::Time;

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct ElevationNoise {
    body: Body,
    /// a and b \[m\].
    sigmas: [f64; 2],
    mask: f64,
}
memory!(ElevationNoise { ; body, sigmas, mask });

/// The 1σ \[m\] at an elevation \[rad\].
fn sigma([a, b]: [f64; 2], elevation: f64) -> f64 {
    math::hypot(a, b / math::sin(elevation))
}

impl Stage for ElevationNoise {
    fn row(&mut self, _: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter<'_>) {
        let Some(seen) = self.body.sees(row, view).filter(|seen| seen.elevation >= self.mask) else {
            return;
        };
        let mut with_sigma = [0.0; WIDTH + 1];
        with_sigma[..WIDTH].copy_from_slice(&row[..WIDTH]);
        with_sigma[WIDTH] = sigma(self.sigmas, seen.elevation);
        out.emit(time, &with_sigma);
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Listen, StageSpec};
    use crate::de::DeserializeSpec;
    use crate::stage::satellite::{channels, listen};
    use crate::units::{Dimensional, Positive, Quantity, dim};
    use schemars::JsonSchema;

    /// Gives pseudoranges a 1σ that grows towards the horizon, and drops low satellites.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct ElevationNoiseSpec {
        /// The stream of pseudoranges, with the positions of their satellites.
        source: String,
        /// The part a of the 1σ that is the same for every elevation.
        sigma: Positive<dim::Length>,
        /// The part b of the 1σ that is divided by the sine of the elevation.
        sigma_low: Positive<dim::Length>,
        /// Least elevation of a satellite that is used, more than 0; 10 deg by default.
        #[serde(default = "ten_degrees")]
        mask: Quantity<dim::Angle>,
    }

    fn ten_degrees() -> Quantity<dim::Angle> {
        Quantity::from_si(10f64.to_radians())
    }

    crate::register!(
        Stage,
        "elevation_noise",
        ElevationNoiseSpec,
        r#"
source = "gps"
sigma = "1 m"
sigma_low = "1 m"
mask = "10 deg"
"#
    );

    #[typetag::deserialize(name = "elevation_noise")]
    impl StageSpec for ElevationNoiseSpec {
        fn inputs(&self) -> Vec<Listen> {
            listen(&self.source)
        }

        fn output(&self) -> Vec<Channel> {
            let mut all = channels();
            let sigma = Channel::vector("", 1, dim::Length::KIND.dimension);
            let name = Channel::sigma_name(&all[0].name).into();
            all.push(Channel { name, ..sigma });
            all
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            let mask = self.mask.si();
            if mask <= 0.0 {
                let message = "at the horizon the noise is infinite: the mask must be above it";
                return Err(BuildError::at("mask", message).help("write 5 to 15 deg"));
            }
            Ok(Box::new(ElevationNoise {
                body: Body::build(b)?,
                sigmas: [self.sigma.si(), self.sigma_low.si()],
                mask,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_grows_towards_the_horizon() {
        // 4 ε: rounding.
        assert!((sigma([3.0, 4.0], core::f64::consts::FRAC_PI_2) - 5.0).abs() < 4e-15);
        assert!((sigma([3.0, 2.0], core::f64::consts::FRAC_PI_6) - 5.0).abs() < 4e-15);
    }
}
