//! What goes wrong with a source: declared disturbances of its rows, recorded or simulated.
//!
//! A fault sees the rows of one source in order and leaves a row as it is, changes its numbers or
//! its stamp, withholds it, lets it come late or more than once. Windows are in the time of the log,
//! against the stamp that the source gave the row, whatever another fault makes of it.
//!
//! Seeds    what a random fault does to a row depends on its seed and the stamp of the row alone:
//!          another outage, a later start or a thinned source leave all other disturbances as
//!          they were. Rows of one stamp are disturbed alike
//! Metres   positions are disturbed in metres north, east, down; attitudes by a rotation vector in
//!          body axes; everything else in its own unit
//! Not here faults that depend on the truth

mod clock_jump;
mod duplicate;
mod frozen;
mod late;
mod noise;
mod not_a_number;
mod oscillation;
mod outage;
mod outliers;
mod ramp;
mod random;
mod scale;
mod shift;
mod swap;
mod target;
mod wander;
mod window;

pub use clock_jump::ClockJumpSpec;
pub use duplicate::DuplicateSpec;
pub use frozen::FrozenSpec;
pub use late::LateSpec;
pub use noise::NoiseSpec;
pub use not_a_number::NotANumberSpec;
pub use oscillation::OscillationSpec;
pub use outage::{DropSpec, OutageSpec};
pub use outliers::OutliersSpec;
pub use ramp::RampSpec;
pub use scale::ScaleSpec;
pub use shift::{BiasStepSpec, SpikeSpec};
pub use swap::SwapSpec;
pub use wander::WanderSpec;
pub use window::{Repeated, Window, Windows};

pub use crate::seed::derive_seed;

use crate::block::{BuildError, Channel};
use core::fmt::Debug;
use core::ops::Range;
use fusion_core::time::Time;

/// A channel as a source provides it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProvidedChannel {
    /// Name, width, dimension and shape.
    pub channel: Channel,
    /// Where its numbers begin in the row.
    pub offset: usize,
    /// Its values are valid this many nanoseconds before the stamp.
    pub delay_ns: i64,
}

/// What became of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It is as it was.
    Untouched,
    /// Its numbers were changed.
    Disturbed,
    /// It never arrives.
    Withheld,
    /// It says another time than its own.
    Restamped {
        /// What is added to its stamp \[ns\]; not zero.
        by: i64,
    },
    /// It arrives later, with its own stamp.
    Delayed {
        /// How much later \[ns\]; above zero.
        by: i64,
    },
    /// It arrives more than once.
    Repeated {
        /// How many times more; above zero.
        copies: u32,
    },
}

/// A fault at work on one source.
pub trait Fault: Debug + Send {
    /// The numbers of a row that it makes wrong: those that it may change, or all of them where it
    /// changes the stamp. Empty for one that changes neither.
    fn columns(&self) -> Range<usize>;

    /// Sees the next row; `time` is the stamp that the source gave it.
    fn apply(&mut self, time: Time, row: &mut [f64]) -> Outcome;
}

/// All numbers of a row.
fn all_columns(channels: &[ProvidedChannel]) -> Range<usize> {
    0..channels.iter().map(|c| c.offset + c.channel.width).max().unwrap_or(0)
}

/// What a fault is built for.
#[derive(Clone, Copy, Debug)]
pub struct FaultContext<'a> {
    /// The channels of the source.
    pub channels: &'a [ProvidedChannel],
    /// Its own seed, from [`derive_seed`].
    pub seed: u64,
}

/// A fault as declared.
#[typetag::deserialize]
pub trait FaultSpec: Debug + Send + Sync {
    /// When it may be at work.
    fn windows(&self) -> Windows;

    /// When the source is silent because of it, for the drift per outage; `None` for a fault that
    /// is no outage.
    fn outage(&self) -> Option<&Windows> {
        None
    }

    /// Makes the fault.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError>;
}

#[cfg(test)]
mod testing {
    use super::{FaultContext, ProvidedChannel};
    use crate::block::Channel;
    use crate::vocabulary::channel;

    /// A source of position, velocity, heading and attitude: 3 + 3 + 1 + 4 numbers.
    pub(super) fn channels() -> Vec<ProvidedChannel> {
        let channels = [channel::POSITION, channel::VELOCITY, channel::HEADING, channel::ATTITUDE];
        let mut offset = 0;
        let place = |channel: Channel| {
            let at = offset;
            offset += channel.width;
            ProvidedChannel {
                channel,
                offset: at,
                delay_ns: 0,
            }
        };
        channels.into_iter().map(place).collect()
    }

    pub(super) const ROW: [f64; 11] = [0.7, -1.4, 200.0, 1.0, 2.0, 3.0, 0.5, 1.0, 0.0, 0.0, 0.0];

    /// Reads a spec and builds it on [`channels`].
    pub(super) fn build<S: super::FaultSpec + serde::de::DeserializeOwned>(text: &str, seed: u64) -> Result<Box<dyn super::Fault>, String> {
        let spec: S = toml::from_str(text).map_err(|e| e.message().to_owned())?;
        let channels = channels();
        spec.build(&FaultContext { channels: &channels, seed }).map_err(|e| {
            let help = e.help.map(|h| format!(" / {h}")).unwrap_or_default();
            format!("{}: {}{help}", e.field, e.message)
        })
    }
}
