//! Takes the delay of the ionosphere out of pseudoranges of the L1 frequency.
//!
//! Angle     ψ = 0.0137/(E + 0.11) − 0.022; E, azimuth A, latitude φ and longitude λ in half turns, as all angles here
//! Pierced   φ_i = φ + ψ cos A within ±0.416,  λ_i = λ + ψ sin A/cos φ_i,  φ_m = φ_i + 0.064 cos(λ_i − 1.617)
//! Time      t = 43200 λ_i + time of the day in GPS time, within a day
//! Delay     c F \[5e-9 + a (1 − x²/2 + x⁴/24)\] for |x| < 1.57, else c F 5e-9; x = 2π (t − 50400)/p,
//!           a = max(0, Σ α_n φ_mⁿ), p = max(72000, Σ β_n φ_mⁿ), F = 1 + 16 (0.53 − E)³
//! Source    IS-GPS-200, §20.3.3.5.2.5

use super::satellite::{Body, Direction};
use crate::earth::SPEED_OF_LIGHT;
use core::f64::consts::{PI, TAU};
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::View;
use fusion_core::time::Time;

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct Klobuchar {
    body: Body,
    alpha: [f64; 4],
    beta: [f64; 4],
}
memory!(Klobuchar { ; body, alpha, beta });

/// A day in seconds and in nanoseconds.
const DAY: f64 = 86_400.0;

const DAY_NANOS: i64 = 86_400_000_000_000;

/// Σ c_n xⁿ.
fn polynomial(c: &[f64; 4], x: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// The delay \[m\] in a direction above the horizon; `day` is the time of the day in GPS time \[s\].
fn delay((alpha, beta): (&[f64; 4], &[f64; 4]), seen: &Direction, day: f64) -> f64 {
    let elevation = seen.elevation / PI;
    let psi = 0.0137 / (elevation + 0.11) - 0.022;
    let (sin, cos) = math::sin_cos(seen.azimuth);
    let latitude = math::clamp(seen.place.lat / PI + psi * cos, -0.416, 0.416);
    let longitude = seen.place.lon / PI + psi * sin / math::cos(latitude * PI);
    let magnetic = latitude + 0.064 * math::cos((longitude - 1.617) * PI);
    let local = 43_200.0 * longitude + day;
    let local = local - DAY * math::floor(local / DAY);
    let amplitude = polynomial(alpha, magnetic).max(0.0);
    let period = polynomial(beta, magnetic).max(72_000.0);
    let x = TAU * (local - 50_400.0) / period;
    let slant = 1.0 + 16.0 * math::powi(0.53 - elevation, 3);
    let by_day = if x.abs() < 1.57 {
        amplitude * (1.0 - x * x / 2.0 + math::powi(x, 4) / 24.0)
    } else {
        0.0
    };
    SPEED_OF_LIGHT * slant * (5e-9 + by_day)
}

impl Stage for Klobuchar {
    fn row(&mut self, _: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter<'_>) {
        let Some(seen) = self.body.sees(row, view).filter(|seen| seen.elevation >= 0.0) else {
            return;
        };
        let day = time.nanos().rem_euclid(DAY_NANOS) as f64 * 1e-9;
        let delay = delay((&self.alpha, &self.beta), &seen, day);
        out.emit(time, &[row[0] - delay, row[1], row[2], row[3]]);
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
    use schemars::JsonSchema;

    /// Takes the delay of the ionosphere out of pseudoranges of the L1 frequency, by the broadcast model of Klobuchar.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct KlobucharSpec {
        /// The stream of pseudoranges, with the positions of their satellites; its stamps are in GPS time.
        source: String,
        /// The four broadcast coefficients α of the amplitude, in seconds and half turns.
        alpha: [f64; 4],
        /// The four broadcast coefficients β of the period, in seconds and half turns.
        beta: [f64; 4],
    }

    crate::register!(
        Stage,
        "klobuchar",
        KlobucharSpec,
        r#"
source = "gps"
alpha = [3.82e-8, 1.49e-8, -1.79e-7, 0]
beta = [1.43e5, 0, -3.28e5, 1.13e5]
"#
    );

    #[typetag::deserialize(name = "klobuchar")]
    impl StageSpec for KlobucharSpec {
        fn inputs(&self) -> Vec<Listen> {
            listen(&self.source)
        }

        fn output(&self) -> Vec<Channel> {
            channels()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            for (field, numbers) in [("alpha", self.alpha), ("beta", self.beta)] {
                if !numbers.iter().all(|n| n.is_finite()) {
                    return Err(BuildError::at(field, "a coefficient is not finite"));
                }
            }
            Ok(Box::new(Klobuchar {
                body: Body::build(b)?,
                alpha: self.alpha,
                beta: self.beta,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::geometry::wgs84::Geodetic;

    #[test]
    fn the_delay_is_that_of_another_program() {
        // 40° north, 100° west, elevation 20°, azimuth 210°, 20:45 GPS time: 23.784 m by `ionmodel` of RTKLIB 2.4.3.
        let (alpha, beta) = ([3.82e-8, 1.49e-8, -1.79e-7, 0.0], [1.43e5, 0.0, -3.28e5, 1.13e5]);
        let seen = Direction {
            place: Geodetic::new(40f64.to_radians(), -100f64.to_radians(), 0.0),
            azimuth: 210f64.to_radians(),
            elevation: 20f64.to_radians(),
        };
        let found = delay((&alpha, &beta), &seen, 74_700.0);
        assert!((found - 23.784).abs() < 1e-3, "{found}");
        // At night 5 ns times the slant factor.
        let night = delay(
            (&alpha, &beta),
            &Direction {
                elevation: PI / 2.0,
                ..seen
            },
            30_000.0,
        );
        let slant = 1.0 + 16.0 * 0.03f64.powi(3);
        assert!((night - SPEED_OF_LIGHT * 5e-9 * slant).abs() < 1e-9, "{night}");
    }
}
