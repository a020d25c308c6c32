//! A slow error on top of what a channel says.

use super::random::generator;
use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{PerAxis, Positive, dim, range};
use core::ops::Range;
use fusion_core::math;
use fusion_core::time::{Time, nanos};
use rand::RngExt;
use rand_distr::StandardNormal;
use schemars::JsonSchema;

/// A channel wanders about what it should say: an error with a correlation in time, such as that of
/// reflected sound.
///
/// Normal numbers every `correlation_time`, and between them a smooth curve of the same 1σ.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WanderSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// 1σ per axis; metres for a position, an angle for an attitude.
    sigma: PerAxis,
    /// Time over which the error becomes another one.
    correlation_time: Positive<dim::Duration>,
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "wander",
    WanderSpec,
    r#"
channel = "position"
sigma = ["50 cm", "50 cm", "1 m"]
correlation_time = "20 s"
"#
);

#[typetag::deserialize(name = "wander")]
impl FaultSpec for WanderSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let target = Target::find(context, self.channel.as_deref())?;
        let axes = vec![target.dimension(); target.degrees()];
        let sigma = self.sigma.si::<range::NonNegative>(&axes);
        let sigma = sigma.map_err(|e| BuildError::quantity("sigma", &e))?;
        Ok(Box::new(Wander {
            by: vec![0.0; sigma.len()],
            target,
            sigma,
            // No two knots are closer.
            apart: nanos(self.correlation_time.si()).max(1),
            window: self.window.clone(),
            seed: context.seed,
        }))
    }
}

#[derive(Debug)]
struct Wander {
    target: Target,
    sigma: Vec<f64>,
    by: Vec<f64>,
    apart: i64,
    window: Windows,
    seed: u64,
}

impl Fault for Wander {
    fn columns(&self) -> Range<usize> {
        self.target.columns()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        if !self.window.contains(time) {
            return RowOutcome::Untouched;
        }
        let knot = time.nanos().div_euclid(self.apart);
        let share = time.nanos().rem_euclid(self.apart) as f64 / self.apart as f64;
        // On a quarter of a circle the weights of two independent numbers keep their variance.
        let (to, from) = math::sin_cos(core::f64::consts::FRAC_PI_2 * share);
        let at = |knot: i64| generator(self.seed, Time::from_nanos(knot.saturating_mul(self.apart)));
        let (mut a, mut b) = (at(knot), at(knot.saturating_add(1)));
        for (by, sigma) in self.by.iter_mut().zip(&self.sigma) {
            *by = sigma * (from * a.sample::<f64, _>(StandardNormal) + to * b.sample::<f64, _>(StandardNormal));
        }
        self.target.displace(row, &self.by);
        RowOutcome::Disturbed
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;

    #[test]
    fn the_error_has_its_sigma_and_moves_smoothly() {
        let text = "channel = 'velocity'\nsigma = '0.5 m/s'\ncorrelation_time = '20 s'";
        let mut fault = build::<WanderSpec>(text, 3).unwrap();
        let mut error = |k: i64| {
            let mut row = ROW;
            fault.apply(Time::from_nanos(k * 1_000_000_000), &mut row);
            let column = fault.columns().start;
            row[column] - ROW[column]
        };
        let series: Vec<f64> = (0..80_000).map(&mut error).collect();
        let power = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
        let steps: Vec<f64> = series.windows(2).map(|w| w[1] - w[0]).collect();
        // 5 %: 4000 independent knots, √(2/4000) = 2.2 % of a variance.
        assert!((power(&series) / 0.25 - 1.0).abs() < 0.1, "{}", power(&series));
        // Each of two numbers turns by π/40 of its size a second.
        let expected = 0.5 * core::f64::consts::PI / 40.0;
        assert!((power(&steps).sqrt() / expected - 1.0).abs() < 0.05, "{}", power(&steps).sqrt());
    }
}
