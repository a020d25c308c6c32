//! The position of a transponder, which an ultra-short-baseline system computes from range and angles.
//!
//! Measured   z = geodetic position of the transponder t: latitude, longitude \[rad\], height \[m\]
//! Predicted  h(x) = r_eb ⊕ (C_nb l_bt_b + b), as `gnss_position`
//! Noise      the source's own 1σ; or a share of the slant range d, because errors of angles grow with it: with
//!            `range_sigma = "slant_range"` and `noise = { from_source = true, scale = 0.1 }` 0.1 d north and
//!            east. If a paper prints "0.1 d" without a definition of d, the other meanings of d are here
//! Valid      as the acoustic system says; the rows of a late fix are valid before their stamp:
//!            `latency` of the source, or `time_offset`
//! Not here   ship and transceiver (the stage that makes the fix), sound speed (the sensor `usbl`)

#![cfg(feature = "declare")]

use super::gnss_position::Fix;
use crate::block::{Build, BuildError, Channel, NED, Reading, SensorSpec};
use crate::de::DeserializeSpec;
use crate::param::VectorParam;
use crate::units::{Dimension, Dimensional, dim};
use crate::vocabulary::channel;
use fusion_core::model::Measurement;
use schemars::JsonSchema;
use serde::Deserialize;

/// Position of an acoustic transponder, with its lever arm and a correlated error.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UsblPositionSpec {
    /// Transponder position in body axes, from the body origin (the IMU).
    #[serde(default)]
    lever_arm: VectorParam<dim::Length>,
    /// Correlated position error, north east down; give it a `correlation_time`.
    #[serde(default)]
    bias: VectorParam<dim::Length>,
    /// Use north and east only; a depth sensor measures the height better.
    #[serde(default)]
    horizontal: bool,
    /// The quantity that `noise.from_source` takes from the source. All but the first need `horizontal = true`.
    #[serde(default)]
    range_sigma: RangeSigma,
}

/// The source's measure of the quality of a fix; `noise.scale` is its factor.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum RangeSigma {
    /// 1σ north, east, down: the channel `position_sigma`.
    #[default]
    Reported,
    /// The slant range from transceiver to transponder: the channel `slant_range` \[m\]. A scale of 0.1 is a tenth of
    /// it, a scale of 0.00175 is an angle of 0.1°.
    SlantRange,
    /// The distance over the ground: the channel `horizontal_range` \[m\].
    HorizontalRange,
    /// The time since the previous fix: the channel `fix_interval` \[s\]; the scale is in m/s.
    FixInterval,
}

crate::register!(
    Sensor,
    "usbl_position",
    UsblPositionSpec,
    r#"
lever_arm = ["20 cm", 0, "-30 cm"]
bias = { estimate = true, initial = [0, 0, 0], sigma = "0.2 m", correlation_time = "20 s" }
horizontal = true
range_sigma = "slant_range"
"#
);

#[typetag::deserialize(name = "usbl_position")]
impl SensorSpec for UsblPositionSpec {
    fn reading(&self) -> Reading {
        Reading::Channel(channel::POSITION)
    }

    fn noise(&self) -> Vec<Dimension> {
        vec![dim::Length::KIND.dimension; self.axes().len()]
    }

    fn axes(&self) -> &'static [&'static str] {
        if self.horizontal { &NED[..2] } else { NED }
    }

    fn reported_sigma(&self) -> Option<Channel> {
        let length = dim::Length::KIND.dimension;
        Some(match self.range_sigma {
            RangeSigma::Reported => Channel::vector("position_sigma", 3, length),
            RangeSigma::SlantRange => Channel::vector("slant_range", 1, length),
            RangeSigma::HorizontalRange => Channel::vector("horizontal_range", 1, length),
            RangeSigma::FixInterval => Channel::vector("fix_interval", 1, dim::Duration::KIND.dimension),
        })
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
        if self.range_sigma != RangeSigma::Reported && !self.horizontal {
            let message = "a range says how good the fix is north and east, and nothing of its height";
            let help = "add `horizontal = true`; a sensor `depth` measures the height";
            return Err(BuildError::at("range_sigma", message).help(help));
        }
        Ok(Box::new(Fix::build(b, &self.lever_arm, &self.bias, self.axes().len())?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(text: &str) -> UsblPositionSpec {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn every_reading_of_d_is_a_channel_and_none_of_them_tells_of_the_height() {
        let readings = [
            ("reported", "position_sigma", 3),
            ("slant_range", "slant_range", 1),
            ("horizontal_range", "horizontal_range", 1),
            ("fix_interval", "fix_interval", 1),
        ];
        for (reading, name, width) in readings {
            let flat = spec(&format!("horizontal = true\nrange_sigma = '{reading}'"));
            let channel = flat.reported_sigma().unwrap();
            assert_eq!((&*channel.name, channel.width), (name, width));
            assert_eq!(flat.noise().len(), 2);
            let mut layout = fusion_core::state::LayoutBuilder::new();
            let whole = spec(&format!("range_sigma = '{reading}'"));
            let mut build = Build {
                name: "usbl",
                layout: &mut layout,
                origin: None,
                gravity: crate::earth::Gravity::default(),
            };
            let field = whole.build(&mut build).unwrap_err().field;
            // With `reported`, only the position is missing, which no process provides here.
            assert_eq!(field, if reading == "reported" { "" } else { "range_sigma" });
        }
    }
}
