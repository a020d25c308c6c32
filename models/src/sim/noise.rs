//! Errors of simulated measurements, in residual space.
//!
//! e = white + first-order Gauss-Markov + a constant drawn once per run, one number per residual
//! row; `z ← z ⊞ e` by the model's own `perturb`. Then, where a resolution is stated, z is
//! brought to the nearest step, counted from the first true value.

use super::random::{Markov, Random};
use crate::block::BuildError;
use crate::units::{Dimension, PerAxis, Positive, dim, range};
use fusion_core::Time;
use fusion_core::math;
use fusion_core::model::Measurement;
use schemars::JsonSchema;

/// How a sensor is simulated: when it measures, and with which errors.
#[derive(Clone, Debug, serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorErrorSpec {
    /// Measurements per second; at most 1e9 of them in a run.
    pub(super) rate: Positive<dim::Frequency>,
    /// When the first measurement is valid, after the start of the run.
    #[serde(default)]
    pub(super) start: crate::units::NonNegative<dim::Duration>,
    /// 1σ of white noise, per residual row.
    white: Option<PerAxis>,
    /// A slowly varying error.
    markov: Option<MarkovSpec>,
    /// 1σ of a constant error, drawn once per run, per residual row.
    bias_sigma: Option<PerAxis>,
    /// Least step of the measured value, per residual row.
    resolution: Option<PerAxis>,
}

/// A first-order Gauss-Markov error.
#[derive(Clone, Debug, serde::Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MarkovSpec {
    /// Stationary 1σ, per residual row.
    sigma: PerAxis,
    /// Correlation time.
    correlation_time: Positive<dim::Duration>,
}

/// The sizes of the errors of one sensor, per residual row, in SI; 0 for an error that is not declared.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorErrors {
    /// 1σ of white noise.
    pub white: Vec<f64>,
    /// Stationary 1σ of the slowly varying error.
    pub markov: Vec<f64>,
    /// Its correlation time \[s\].
    pub tau: f64,
    /// 1σ of the constant error.
    pub bias: Vec<f64>,
    /// Least step of the measured value.
    pub resolution: Vec<f64>,
}

impl SensorErrorSpec {
    /// The sizes of the errors of a sensor with residual rows of those dimensions.
    ///
    /// # Errors
    /// A dimension or a count of rows that does not fit; the field is within the sensor's table.
    pub fn errors(&self, rows: &[Dimension]) -> Result<SensorErrors, BuildError> {
        let si = |given: Option<&PerAxis>, field: &str| match given {
            Some(given) => per_row(given, rows, field),
            None => Ok(vec![0.0; rows.len()]),
        };
        Ok(SensorErrors {
            white: si(self.white.as_ref(), "white")?,
            markov: si(self.markov.as_ref().map(|m| &m.sigma), "markov.sigma")?,
            tau: self.markov.as_ref().map_or(1.0, |m| m.correlation_time.si()),
            bias: si(self.bias_sigma.as_ref(), "bias_sigma")?,
            resolution: si(self.resolution.as_ref(), "resolution")?,
        })
    }
}

/// The errors of one sensor as they run: stateful, seeded.
#[derive(Clone, Debug)]
pub struct SensorError {
    white: Vec<f64>,
    markov: Option<Markov>,
    bias: Vec<f64>,
    resolution: Vec<f64>,
    random: Random,
    last: Option<Time>,
    first_value: Vec<f64>,
    error: Vec<f64>,
}

/// The non-negative values for the rows of a residual.
fn per_row(given: &PerAxis, rows: &[Dimension], field: &str) -> Result<Vec<f64>, BuildError> {
    given.si::<range::NonNegative>(rows).map_err(|e| BuildError::quantity(field, &e))
}

impl SensorError {
    /// The errors of the sensor `name` with residual rows of those dimensions.
    ///
    /// # Errors
    /// A dimension or a count of rows that does not fit; the field is within the sensor's table.
    pub fn new(spec: &SensorErrorSpec, name: &str, rows: &[Dimension], seed: u64) -> Result<Self, BuildError> {
        let random = |part: &str| Random::new(seed, &format!("sensor/{name}/{part}"));
        let errors = spec.errors(rows)?;
        let (markov, mut constant) = (spec.markov.is_some(), random("bias"));
        Ok(Self {
            white: errors.white,
            markov: markov.then(|| Markov::new(errors.markov, errors.tau, random("markov"))),
            bias: errors.bias.iter().map(|sigma| sigma * constant.normal()).collect(),
            resolution: errors.resolution,
            random: random("white"),
            last: None,
            first_value: Vec::new(),
            error: vec![0.0; rows.len()],
        })
    }

    /// The lasting part of a residual row's error now: the constant part, and the part that varies slowly.
    pub(super) fn lasting(&self, row: usize) -> f64 {
        self.bias[row] + self.markov.as_ref().map_or(0.0, |m| m.state()[row])
    }

    /// Spoils the true value `z` of `model` at `time`; times must not decrease.
    pub fn spoil(&mut self, model: &dyn Measurement, time: Time, z: &mut [f64]) {
        if let Some(markov) = &mut self.markov {
            if let Some(last) = self.last {
                markov.advance(time.seconds_since(last));
            }
            self.last = Some(time);
        }
        for (i, e) in self.error.iter_mut().enumerate() {
            let slow = self.markov.as_ref().map_or(0.0, |m| m.state()[i]);
            *e = self.white[i] * self.random.normal() + slow + self.bias[i];
        }
        if self.resolution.iter().all(|step| *step <= 0.0) {
            model.perturb(z, &self.error);
            return;
        }
        if self.first_value.is_empty() {
            self.first_value.extend_from_slice(z);
        }
        model.perturb(z, &self.error);
        model.residual(z, &self.first_value, &mut self.error);
        for (e, step) in self.error.iter_mut().zip(&self.resolution) {
            if *step > 0.0 {
                *e = math::round(*e / step) * step;
            }
        }
        z.copy_from_slice(&self.first_value);
        model.perturb(z, &self.error);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Dimensional;
    use fusion_core::linear::Jacobian;
    use fusion_core::model::{Size, Undefined};
    use fusion_core::state::View;

    #[derive(Debug)]
    struct Plain;

    impl Measurement for Plain {
        fn size(&self) -> Size {
            Size::same(2)
        }
        fn predict(&self, _: &View<'_>, _: &mut [f64]) -> Result<(), Undefined> {
            Ok(())
        }
        fn jacobian(&self, _: &View<'_>, _: &mut Jacobian) -> Result<(), Undefined> {
            Ok(())
        }
    }

    const ROWS: [Dimension; 2] = [dim::Length::KIND.dimension; 2];

    fn errors(text: &str, seed: u64) -> Result<SensorError, BuildError> {
        SensorError::new(&toml::from_str(text).unwrap(), "gnss", &ROWS, seed)
    }

    /// `n` errors of the first row, 1 s apart.
    fn series(text: &str, seed: u64, n: u32) -> Vec<f64> {
        let mut errors = errors(text, seed).unwrap();
        let draw = |k| {
            let mut z = [10.0, 20.0];
            errors.spoil(&Plain, Time::from_seconds(f64::from(k)), &mut z);
            z[0] - 10.0
        };
        (0..n).map(draw).collect()
    }

    fn sigma(x: &[f64]) -> f64 {
        (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
    }

    #[test]
    fn white_slow_and_constant_parts_have_their_sigmas() {
        // 2 %: 1/√(2·20000) = 0.5 % of 1σ.
        let white = series("rate = 1\nwhite = ['1 m', '3 m']", 1, 20_000);
        assert!((sigma(&white) - 1.0).abs() < 0.02, "{}", sigma(&white));
        let slow = series("rate = 1\nmarkov = { sigma = '0.8 m', correlation_time = '60 s' }", 1, 200_000);
        // 10 %: n/2τ = 1667 independent samples, 1.7 % of 1σ.
        assert!((sigma(&slow) / 0.8 - 1.0).abs() < 0.1, "{}", sigma(&slow));
        let pairs: f64 = slow.windows(2).map(|w| w[0] * w[1]).sum();
        // 2e-3: √((1 − φ²)/n) = 4e-4 of 1σ; φ = 0.98347 for τ = 60 s.
        assert!((pairs / slow.iter().map(|x| x * x).sum::<f64>() - 0.983_47).abs() < 2e-3);
        let constant: Vec<f64> = (0..2000).map(|seed| series("rate = 1\nbias_sigma = '2 m'", seed, 2)[1]).collect();
        // 8 %: 1/√4000 = 1.6 % of 1σ.
        assert!((sigma(&constant) / 2.0 - 1.0).abs() < 0.08, "{}", sigma(&constant));
        assert_eq!(
            series("rate = 1\nbias_sigma = '2 m'", 7, 2)[0],
            constant[7],
            "the same all through a run"
        );
    }

    #[test]
    fn adding_a_slow_error_leaves_the_white_one_as_it_was() {
        let white = series("rate = 1\nwhite = 1", 1, 100);
        let both = series("rate = 1\nwhite = 1\nmarkov = { sigma = 0.8, correlation_time = 60 }", 1, 100);
        let slow = series("rate = 1\nmarkov = { sigma = 0.8, correlation_time = 60 }", 1, 100);
        for ((w, s), b) in white.iter().zip(&slow).zip(&both) {
            assert!((w + s - b).abs() < 1e-13); // rounding at 10
        }
    }

    #[test]
    fn a_resolution_leaves_whole_steps() {
        let coarse = series("rate = 1\nwhite = 1\nresolution = '0.1 m'", 1, 100);
        for (c, exact) in coarse.iter().zip(series("rate = 1\nwhite = 1", 1, 100)) {
            assert!((c * 10.0 - (c * 10.0).round()).abs() < 1e-9 && (c - exact).abs() <= 0.05 + 1e-9);
        }
    }

    #[test]
    fn wrong_units_and_counts_name_the_field() {
        let field = |text| errors(text, 1).unwrap_err().field;
        assert_eq!(field("rate = 1\nwhite = '1 deg'"), "white");
        assert_eq!(field("rate = 1\nbias_sigma = [1, 2, 3]"), "bias_sigma");
        assert_eq!(field("rate = 1\nmarkov = { sigma = -1, correlation_time = 1 }"), "markov.sigma");
    }
}
