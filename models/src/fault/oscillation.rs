//! An oscillation on top of what a channel says: vibration.

use super::random::generator;
use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Axes, PerAxis, dim, range};
use core::f64::consts::TAU;
use core::ops::Range;
use fusion_core::math;
use fusion_core::time::Time;
use rand::RngExt;
use schemars::JsonSchema;

/// A sine is added to each axis of a channel: vibration, as an inertial unit samples it.
///
/// The frequency of each axis is drawn from the band, its phase too; both stay for the whole log.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OscillationSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// Amplitude per axis; metres for a position, an angle for an attitude.
    amplitude: PerAxis,
    /// Lowest and highest frequency.
    band: Axes<dim::Frequency, range::Positive, 2>,
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "oscillation",
    OscillationSpec,
    r#"
channel = "velocity"
amplitude = ["0.5 m/s", "0.35 m/s", "0.5 m/s"]
band = ["8 Hz", "11 Hz"]
"#
);

#[typetag::deserialize(name = "oscillation")]
impl FaultSpec for OscillationSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let target = Target::find(context, self.channel.as_deref())?;
        let axes = vec![target.dimension(); target.degrees()];
        let amplitude = self.amplitude.si::<range::NonNegative>(&axes);
        let amplitude = amplitude.map_err(|e| BuildError::quantity("amplitude", &e))?;
        let [low, high] = self.band.si();
        if low > high {
            return Err(BuildError::at("band", "the lowest frequency is above the highest").help("write `band = [lowest, highest]`"));
        }
        let mut random = generator(context.seed, Time::default());
        let sines = amplitude.into_iter().map(|amplitude| Sine {
            amplitude,
            rate: TAU * (low + (high - low) * random.random::<f64>()),
            phase: TAU * random.random::<f64>(),
        });
        let sines: Vec<Sine> = sines.collect();
        Ok(Box::new(Oscillation {
            by: vec![0.0; sines.len()],
            sines,
            target,
            window: self.window.clone(),
        }))
    }
}

#[derive(Debug)]
struct Sine {
    amplitude: f64,
    rate: f64,
    phase: f64,
}

#[derive(Debug)]
struct Oscillation {
    target: Target,
    sines: Vec<Sine>,
    by: Vec<f64>,
    window: Windows,
}

impl Fault for Oscillation {
    fn columns(&self) -> Range<usize> {
        self.target.columns()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        if !self.window.contains(time) {
            return RowOutcome::Untouched;
        }
        for (by, sine) in self.by.iter_mut().zip(&self.sines) {
            *by = sine.amplitude * math::sin(sine.rate * time.seconds() + sine.phase);
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
    fn each_axis_swings_with_its_amplitude_within_the_band() {
        let text = "channel = 'velocity'\namplitude = '0.5 m/s'\nband = ['8 Hz', '11 Hz']";
        let mut fault = build::<OscillationSpec>(text, 3).unwrap();
        let mut series = Vec::new();
        for k in 0..10_000 {
            let mut row = ROW;
            assert_eq!(fault.apply(Time::from_nanos(k * 1_000_000), &mut row), RowOutcome::Disturbed);
            let columns = fault.columns();
            series.push(row[columns.start] - ROW[columns.start]);
        }
        let most = series.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let crossings = series.windows(2).filter(|w| w[0] < 0.0 && w[1] >= 0.0).count();
        // Ten seconds; 1e-3 of the amplitude: a thousand samples a second.
        assert!((most - 0.5).abs() < 5e-4 && (80..=110).contains(&crossings), "{most} {crossings}");
    }
}
