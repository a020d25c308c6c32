//! Faults of a source: declared disturbances of its rows, recorded or simulated.
//!
//! A fault sees the rows of one source in order. It leaves a row unchanged, changes its numbers or its stamp, withholds
//! it, delays it or repeats it. Windows are in the time of the log. They refer to the original stamp of the row, even
//! if another fault changes that stamp.
//!
//! Seeds      the effect of a random fault on a row depends only on its seed and on the stamp of the row: another
//!            outage, a later start or a thinned source leave all other disturbances unchanged. Rows with the same
//!            stamp are disturbed alike
//! Metres     positions are disturbed in metres north, east, down; attitudes by a rotation vector in
//!            body axes; everything else in its own unit
//! Not here   faults that depend on the truth

#![cfg(feature = "declare")]

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

/// The outcome of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowOutcome {
    /// It is unchanged.
    Untouched,
    /// Its numbers were changed.
    Disturbed,
    /// It never arrives.
    Withheld,
    /// Its stamp is changed.
    Restamped {
        /// The change of its stamp \[ns\]; not zero.
        by: i64,
    },
    /// It arrives later, with its own stamp.
    Delayed {
        /// The delay \[ns\]; above zero.
        by: i64,
    },
    /// It arrives more than once.
    Repeated {
        /// The number of additional copies; above zero.
        copies: u32,
    },
}

/// A fault that acts on one source.
pub trait Fault: Debug + Send {
    /// The columns that it makes wrong: those that it may change, or all of them if it changes the stamp. Empty if it
    /// changes neither.
    fn columns(&self) -> Range<usize>;

    /// Sees the next row; `time` is the stamp that the source gave it.
    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome;
}

/// All numbers of a row.
fn all_columns(channels: &[ProvidedChannel]) -> Range<usize> {
    0..channels.iter().map(|c| c.offset + c.channel.width).max().unwrap_or(0)
}

/// The context in which a fault is built.
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
    /// When it may act.
    fn windows(&self) -> Windows;

    /// When it makes the source silent, for the drift per outage; `None` if the fault is not an outage.
    fn outage(&self) -> Option<&Windows> {
        None
    }

    /// Builds the fault.
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
