//! White noise on top of what a channel says.

use super::random::generator;
use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{PerAxis, range};
use core::ops::Range;
use fusion_core::time::Time;
use rand::RngExt;
use rand_distr::StandardNormal;
use schemars::JsonSchema;

/// White Gaussian noise is added to a channel.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// 1σ per axis; metres for a position, an angle for an attitude.
    sigma: PerAxis,
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "noise",
    NoiseSpec,
    r#"
channel = "position"
sigma = ["1 m", "1 m", "2 m"]
"#
);

#[typetag::deserialize(name = "noise")]
impl FaultSpec for NoiseSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let target = Target::find(context, self.channel.as_deref())?;
        let axes = vec![target.dimension(); target.degrees()];
        let sigma = self.sigma.si::<range::NonNegative>(&axes);
        let sigma = sigma.map_err(|e| BuildError::quantity("sigma", &e))?;
        let by = vec![0.0; sigma.len()];
        Ok(Box::new(Noise {
            target,
            sigma,
            by,
            window: self.window.clone(),
            seed: context.seed,
        }))
    }
}

#[derive(Debug)]
struct Noise {
    target: Target,
    sigma: Vec<f64>,
    by: Vec<f64>,
    window: Windows,
    seed: u64,
}

impl Fault for Noise {
    fn columns(&self) -> Range<usize> {
        self.target.columns()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        if !self.window.contains(time) {
            return RowOutcome::Untouched;
        }
        let mut random = generator(self.seed, time);
        for (by, sigma) in self.by.iter_mut().zip(&self.sigma) {
            *by = sigma * random.sample::<f64, _>(StandardNormal);
        }
        self.target.displace(row, &self.by);
        RowOutcome::Disturbed
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;
    use fusion_core::geometry::wgs84::Geodetic;

    #[test]
    fn a_position_is_disturbed_in_metres_with_the_declared_sigma() {
        let mut noise = build::<NoiseSpec>("channel = 'position'\nsigma = [1, '2 m', 3]", 3).unwrap();
        let truth = Geodetic {
            lat: ROW[0],
            lon: ROW[1],
            height: ROW[2],
        };
        let mut sums = [0.0; 3];
        const N: i64 = 4000;
        for k in 0..N {
            let mut row = ROW;
            assert_eq!(noise.apply(Time::from_nanos(k * 1_000_000), &mut row), RowOutcome::Disturbed);
            assert_eq!(row[3..], ROW[3..]);
            let d = Geodetic {
                lat: row[0],
                lon: row[1],
                height: row[2],
            }
            .difference(&truth);
            sums.iter_mut().zip(d.iter()).for_each(|(s, d)| *s += d * d);
        }
        for (sum, sigma) in sums.into_iter().zip([1.0, 2.0, 3.0]) {
            let found = (sum / N as f64).sqrt();
            // 1σ of an estimated sigma is 1/√(2N) = 1.1 %: 5σ.
            assert!((found / sigma - 1.0).abs() < 0.056, "{found} for {sigma}");
        }
    }

    #[test]
    fn a_wrong_dimension_sign_or_channel_is_named() {
        let said = |text| build::<NoiseSpec>(text, 1).unwrap_err();
        assert_eq!(
            said("channel = 'position'\nsigma = '1 deg'"),
            "sigma: \"1 deg\" is an angle [rad]; a length [m] is expected here, e.g. \"0.5 m\""
        );
        assert_eq!(
            said("channel = 'heading'\nsigma = -1"),
            r#"sigma: -1 is out of range; an angle [rad] of at least 0 is expected here, e.g. "5 deg""#
        );
        assert_eq!(
            said("channel = 'velocity'\nsigma = [1, 2]"),
            r#"sigma: 3 values, or one for all, are expected here, e.g. ["10 km/h", "10 km/h", "10 km/h"], not 2"#
        );
        assert_eq!(
            said("channel = 'speed'\nsigma = 1"),
            "channel: the source has no channel `speed` / its channels: `position`, `velocity`, `heading`, `attitude`"
        );
        assert_eq!(
            said("sigma = 1"),
            ": this fault does not say which channel it disturbs / add `channel = …`, one of `position`, `velocity`, \
             `heading`, `attitude`"
        );
    }
}
