//! Outputs: estimates that leave while the filter runs, in some format.

#[cfg(feature = "foxglove")]
mod foxglove;
mod json;
mod line;
#[cfg(feature = "mavlink")]
mod mavlink;
mod nmea;
#[cfg(test)]
mod testing;

#[cfg(feature = "foxglove")]
pub use foxglove::FoxgloveSpec;
pub use json::JsonSpec;
#[cfg(feature = "mavlink")]
pub use mavlink::MavlinkSpec;
pub use nmea::NmeaSpec;

use crate::link::Sender;
use core::fmt::Debug;
use fusion::core::health::State;
use fusion::core::time::Time;
use fusion::output::{EstimateClock, Origin};
use fusion::solution::Solution;
use std::io::{self, ErrorKind};
use std::sync::Arc;

/// An output as declared: the table `[output.NAME]`. A type registers itself as a block of the role `Output`, with
/// `fusion::models::register!`, in its own file.
#[typetag::deserialize]
pub trait OutputSpec: Debug + Send + Sync {
    /// The name of the link by which it sends; `None` if it has its own connection, such as a server.
    fn link(&self) -> Option<&str>;

    /// Opens it. It is called once.
    ///
    /// # Errors
    /// Its own connection cannot be opened.
    fn open(&self, about: &About) -> io::Result<Box<dyn Output>>;
}

/// The facts about a run that an output may need.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct About {
    /// The line with which the design describes itself.
    pub description: String,
    /// Where local coordinates start.
    pub origin: Origin,
    /// The time of the filter as a date.
    pub clock: EstimateClock,
    /// Its sensors, in the order of [`Outgoing::sensors`].
    pub sensors: Vec<String>,
}

/// Sends estimates, in its own thread. It may wait; the filter does not.
pub trait Output: Send {
    /// Sends an estimate: by `to`, or by its own connection.
    ///
    /// # Errors
    /// It could not be sent. It is counted, and the next one is tried.
    fn send(&mut self, estimate: &Outgoing, to: Option<&mut dyn Sender>) -> io::Result<()>;

    /// The parts of the health that a format may show: one line for `fusion live`, such as the number of its clients.
    fn status(&self) -> Option<String> {
        None
    }
}

/// The estimate of *now*, as it leaves.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Outgoing {
    /// The number of this estimate at this output, from 0.
    pub number: u64,
    /// Position, velocity and attitude, predicted to its time; `None` before the filter has started.
    pub solution: Option<Solution>,
    /// The time of the filter now.
    pub time: Time,
    /// The date now: GPS time \[ns\]; `None` if no source declares a date.
    pub gps_nanos: Option<i64>,
    /// How old the newest row is that the filter has used \[s\]; `None` before the first row.
    pub age: Option<f64>,
    /// The health of the filter.
    pub health: State,
    /// The reasons for it, in words.
    pub reasons: Arc<[String]>,
    /// The conditions that the filter still waits for before it can start.
    pub waits_for: Arc<[String]>,
    /// The sensors, in the order of [`About::sensors`].
    pub sensors: Arc<[SensorNow]>,
}

/// The state of a sensor.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct SensorNow {
    /// The time of its latest measurement.
    pub time: Option<Time>,
    /// Measurements used so far.
    pub used: u64,
    /// Measurements that its gate has rejected so far.
    pub rejected: u64,
    /// Whether the latest measurement was used.
    pub is_used: bool,
    /// The normalised innovation squared of the latest measurement: rᵀS⁻¹r.
    pub nis: Option<f64>,
    /// The residual of the latest measurement, in the units of its rows.
    pub residual: Vec<f64>,
    /// The predicted 1σ of that residual: √S_ii.
    pub sigma: Vec<f64>,
}

/// The open link of an output that sends by one.
fn opened(to: Option<&mut dyn Sender>) -> io::Result<&mut dyn Sender> {
    to.ok_or_else(|| io::Error::new(ErrorKind::NotConnected, "the link is not open"))
}
