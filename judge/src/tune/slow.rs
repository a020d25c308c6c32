//! Slow errors of sensors that a design leaves out, from the autocorrelation of innovations.
//!
//! A sensor whose block has a `bias` is run with such a state: the declared one, or one whose variance is so small that
//! nothing changes. The run then shows how innovations answer a unit error of that state, and so which slow error
//! explains their autocorrelation.
//!
//! Innovations determine σ²/τ of a slow error: how fast it changes. σ and τ alone show only over times that are long
//! compared with τ, in which the filter must not follow the error.

mod fit;
mod response;

use self::fit::{RATIO, fit};
use self::response::Response;
use super::parameter::{Parameter, written};
use super::record::{Recorder, Rows};
use super::white;
use crate::likelihood::{densities, whitened};
use fusion::config::{Diagnostics, Document, Edit};
use fusion::design::Design;
use fusion::run::{Options, run_sharing};
use fusion_core::consistency::chi_square_quantile;
use fusion_core::math;
use fusion_models::sim::SharedCourse;
use statrs::statistics::{Data, Median};

/// A slow error of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SlowError {
    /// The sensor.
    pub sensor: String,
    /// Its 1σ along each axis of the sensor's `bias`.
    pub sigma: Vec<f64>,
    /// The unit of the 1σ, SI.
    pub unit: &'static str,
    /// Its correlation time \[s\].
    pub correlation_time: f64,
    /// The 95 % interval of the correlation time \[s\]; infinite if the log is too short to limit it.
    pub interval: (f64, f64),
    /// Whether it is in addition to a slow error that the design declares.
    pub is_further: bool,
}

/// A slow error is proposed if chance alone makes one for any sensor with this probability.
const CHANCE: f64 = 0.05;

/// The 1σ of the state whose response is wanted, in SI: its variance is below rounding of that of any noise.
const ABSENT: &str = "1e-9";

/// The slow errors that the innovations of the log show beyond those that are states already, each with the edits that give
/// it a state.
pub(super) fn slow_errors(document: &Document, options: &Options) -> Result<Vec<(SlowError, Vec<Edit>)>, Diagnostics> {
    let design = Design::read(document.clone())?;
    let mut recorder = Recorder::new(&design, &densities(&design), None);
    run_sharing(&design, options, &SharedCourse::default(), &mut [&mut recorder])?;
    let heard = recorder
        .sensors
        .into_iter()
        .enumerate()
        .filter_map(|(k, rows)| Some((k, rows.filter(|rows| rows.len() >= white::FEWEST)?)));
    let heard: Vec<(usize, Rows)> = heard.collect();
    let mut found = Vec::new();
    for (sensor, rows) in &heard {
        let name = &design.sensors[*sensor].name;
        let Some(trial) = Trial::of(document, name, rows)? else { continue };
        let span = (rows.times[0], rows.times[rows.len() - 1]);
        let interval = (span.1 - span.0) / rows.len() as f64;
        // From the time between two rows to the length of the log; the first is white noise.
        let count = math::ln(rows.len() as f64) / math::ln(RATIO);
        let taus = (0..=count as i32).map(|k| interval * math::powi(RATIO, k));
        let taus = [0.0].into_iter().chain(taus).collect();
        let mut response = Response::new(*sensor, format!("{name}.bias"), taus, rows.len(), span);
        run_sharing(&trial.design, options, &SharedCourse::default(), &mut [&mut response])?;
        let fit = fit(&response.products, response.taus(), CHANCE / heard.len() as f64);
        if let Some(fit) = fit {
            found.extend(trial.edits(name, &fit, &response));
        }
    }
    Ok(found)
}

/// A design in which the response of a sensor to a slow error is seen.
struct Trial {
    design: Design,
    /// The bias zero, in TOML; `None` if the bias is a state already.
    zero: Option<&'static str>,
    /// The noise of the sensor, and the factor by which it is raised.
    noise: Vec<Parameter>,
    raised: f64,
}

impl Trial {
    /// With a bias that is absent, or the declared one, and with a noise that is raised as far as the innovations are larger
    /// than expected: the gate then passes the slow error, and the filter follows it less. `None` if the sensor has no bias,
    /// or one that is constant or wanders.
    fn of(document: &Document, name: &str, rows: &Rows) -> Result<Option<Self>, Diagnostics> {
        let mut raised_document = document.clone();
        let raised = math::sqrt(excess(rows).max(1.0));
        let noise = Parameter::select(document, &[format!("sensor.{name}.noise")]).unwrap_or_default();
        noise
            .iter()
            .try_for_each(|noise| raised_document.apply(&noise.times(raised, None)))?;
        let declared = |key: &str| document.root().at(&format!("sensor.{name}.bias.{key}")).is_some();
        let with_bias = |zero: &'static str| {
            let bias = format!("{{ estimate = true, initial = {zero}, sigma = {ABSENT}, correlation_time = \"1000 s\" }}");
            let mut with = raised_document.clone();
            with.apply(&Edit::set(format!("sensor.{name}.bias"), bias)).ok()?;
            Some((Design::read(with).ok()?, Some(zero)))
        };
        let design = match (declared("estimate"), declared("correlation_time")) {
            (true, true) => Some((Design::read(raised_document)?, None)),
            (true, false) => None,
            (false, _) => ["0", "[0, 0, 0]"].into_iter().find_map(with_bias),
        };
        Ok(design.map(|(design, zero)| Self {
            design,
            zero,
            raised: if noise.is_empty() { 1.0 } else { raised },
            noise,
        }))
    }

    /// The edits that give the slow error a state, and leave the white part of the noise. A state that the design has
    /// already gets the sum of both variances, and of both σ²/τ.
    fn edits(&self, name: &str, fit: &fit::Fit, response: &Response) -> Option<(SlowError, Vec<Edit>)> {
        let none = || (vec![0.0; fit.variance.len()], f64::INFINITY);
        let (declared, tau) = if self.zero.is_some() { none() } else { response.declared.clone()? };
        let before: Vec<f64> = declared.iter().map(|sigma| sigma * sigma).collect();
        let all: Vec<f64> = before.iter().zip(&fit.variance).map(|(before, own)| before + own).collect();
        let rate = before.iter().sum::<f64>() / tau + fit.variance.iter().sum::<f64>() / fit.tau;
        let correlation_time = all.iter().sum::<f64>() / rate;
        let sigma: Vec<f64> = all.iter().map(|v| math::sqrt(*v)).collect();
        let quantity = |value: f64, unit: &str| format!("\"{} {unit}\"", written(value, Some(3)));
        let each: Vec<String> = sigma.iter().map(|s| quantity(*s, response.unit)).collect();
        let sigma_in_toml = if each.len() == 1 {
            each.concat()
        } else {
            format!("[{}]", each.join(", "))
        };
        let time_in_toml = quantity(correlation_time, "s");
        let bias = format!("sensor.{name}.bias");
        let mut edits = match self.zero {
            Some(zero) => {
                let state = format!("{{ estimate = true, initial = {zero}, sigma = {sigma_in_toml}, correlation_time = {time_in_toml} }}");
                vec![Edit::set(bias, state)]
            }
            None => vec![
                Edit::set(format!("{bias}.sigma"), sigma_in_toml),
                Edit::set(format!("{bias}.correlation_time"), time_in_toml),
            ],
        };
        let white = self.raised * self.raised * fit.white;
        if white > 0.0 && white < 1.0 {
            edits.extend(self.noise.iter().map(|noise| noise.times(math::sqrt(white), Some(3))));
        }
        let slow = SlowError {
            sensor: name.to_owned(),
            sigma: fit.variance.iter().map(|v| math::sqrt(*v)).collect(),
            unit: response.unit,
            correlation_time: fit.tau,
            interval: fit.interval,
            is_further: self.zero.is_none(),
        };
        Some((slow, edits))
    }
}

/// By how much the median NIS of all rows, those that a gate rejected too, is above its expected value.
fn excess(rows: &Rows) -> f64 {
    let squares = (0..rows.len()).map(|k| {
        let (r, l) = rows.innovation(k);
        whitened(r, l).iter().map(|w| w * w).sum::<f64>()
    });
    let median = Data::new(squares.collect::<Vec<f64>>()).median();
    median / chi_square_quantile(0.5, rows.m as f64)
}
