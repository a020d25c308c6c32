//! The velocity of the body from the speeds of two tracks.
//!
//! Velocity   u = (1 − i)(v_l y_r − v_r y_l)/(y_r − y_l) forward with the centres of rotation of the tracks at
//!            y_l < 0 < y_r to the right, i slip; 0 to the right and 0 down
//! Valid      the same slip on both sides; no sliding sideways
//! Not here   estimated parameters: the sensor `track_odometry` has gauge, centre and slip as parameters
//! Source     Martínez et al. 2005, Approximating kinematics for tracked mobile robots

use fusion_core::literal;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::View;
use fusion_core::time::Time;

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct TrackVelocity {
    /// The shares of the left and the right track in the speed ahead.
    shares: [f64; 2],
}
memory!(TrackVelocity { ; shares });

impl Stage for TrackVelocity {
    fn row(&mut self, _: usize, time: Time, row: &[f64], _: Option<&View<'_>>, out: &mut Emitter<'_>) {
        let ahead: f64 = row.iter().zip(&self.shares).map(|(speed, share)| speed * share).sum();
        if ahead.is_finite() {
            out.emit(time, &[ahead, 0.0, 0.0]);
        }
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
    use crate::units::{Positive, Quantity, dim};
    use crate::vocabulary::channel;
    use schemars::JsonSchema;

    /// Computes the velocity of the body from the speeds of its two tracks, for sensors that take velocities.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct TrackVelocitySpec {
        /// The stream with the speeds `left` and `right`.
        source: String,
        /// Slip of both tracks: the share of their speed that is lost.
        #[serde(default)]
        slip: Quantity<dim::Ratio>,
        /// Distance between the centres of rotation of the two tracks; needed if `centre` is not 0.
        gauge: Option<Positive<dim::Length>>,
        /// The middle between these centres, to the right of the body origin.
        #[serde(default)]
        centre: Quantity<dim::Length>,
    }

    crate::register!(
        Stage,
        "track_velocity",
        TrackVelocitySpec,
        r#"
source = "track_speeds"
slip = "4 %"
gauge = "4.15 m"
centre = "5 cm"
"#
    );

    #[typetag::deserialize(name = "track_velocity")]
    impl StageSpec for TrackVelocitySpec {
        fn inputs(&self) -> Vec<Listen> {
            vec![Listen {
                source: self.source.clone(),
                channels: vec![channel::LEFT_TRACK, channel::RIGHT_TRACK],
            }]
        }

        fn output(&self) -> Vec<Channel> {
            vec![channel::BODY_VELOCITY]
        }

        fn build(&self, _: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            let (slip, centre) = (self.slip.si(), self.centre.si());
            if slip >= 1.0 {
                return Err(BuildError::at(
                    "slip",
                    "the slip must be less than 1: with 1 the tracks turn and the vehicle stands",
                )
                .help("write the share of speed that is lost, e.g. \"5 %\""));
            }
            let aside = match self.gauge {
                Some(gauge) => centre / gauge.si(),
                None if centre == 0.0 => 0.0,
                None => return Err(BuildError::at("centre", "a centre aside needs `gauge`")),
            };
            Ok(Box::new(TrackVelocity {
                shares: [(1.0 - slip) * (0.5 + aside), (1.0 - slip) * (0.5 - aside)],
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, BuildError, StageSpec};
    use crate::earth::Gravity;
    use fusion_core::state::LayoutBuilder;

    /// The speed ahead for these track speeds.
    fn ahead(fields: &str, tracks: [f64; 2]) -> Result<f64, BuildError> {
        let spec: TrackVelocitySpec = toml::from_str(&format!("source = 'tracks'\n{fields}")).unwrap();
        let mut layout = LayoutBuilder::new();
        let mut build = Build {
            name: "velocity",
            layout: &mut layout,
            origin: None,
            gravity: Gravity::default(),
        };
        let mut stage = spec.build(&mut build)?;
        let mut out = Emitter::default();
        stage.row(0, Time::default(), &tracks, None, &mut out);
        let row: Vec<f64> = out.rows().next().unwrap().1.to_vec();
        assert_eq!(row[1..], [0.0, 0.0]);
        Ok(row[0])
    }

    #[test]
    fn the_speed_ahead_is_the_mean_of_the_tracks_less_their_slip() {
        // 4 ε: rounding.
        let close = |fields: &str, tracks, want: f64| assert!((ahead(fields, tracks).unwrap() - want).abs() < 1e-15, "{fields}");
        close("", [0.3, 0.3], 0.3);
        close("slip = 0.1", [0.3, 0.1], 0.18);
        // (v_l y_r − v_r y_l)/B with y = 0.5 ± 2.
        close("gauge = 4\ncentre = 0.5", [0.5, 0.1], (0.5 * 2.5 + 0.1 * 1.5) / 4.0);
        assert_eq!(ahead("centre = 0.5", [0.0; 2]).unwrap_err().field, "centre");
        assert_eq!(ahead("slip = 1", [0.0; 2]).unwrap_err().field, "slip");
    }
}
