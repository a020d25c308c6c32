//! Estimates as messages of ROS 2: for bags, and for programs that listen.
//!
//! | message | topic | has |
//! |---|---|---|
//! | `nav_msgs/msg/Odometry` | `PREFIX/odometry` | pose in the world, velocity in the body, both with covariance |
//! | `sensor_msgs/msg/NavSatFix` | `PREFIX/fix` | latitude, longitude, height, with covariance |
//! | `tf2_msgs/msg/TFMessage` | `/tf` | the transform from the world to the body |
//! | `diagnostic_msgs/msg/DiagnosticArray` | `/diagnostics` | health |
//!
//! The axes are those of REP 103: the world is east, north, up from the origin of local coordinates, the body forward,
//! left, up. The angular velocity is not estimated: it is zero, and its variances are −1. Without a date, time zero is
//! 1970-01-01.

mod cdr;
mod covariance;
mod twist;

use cdr::Cdr;
use covariance::pose_covariance;
use fusion::core::health::State;
use fusion::core::time::Time;
use fusion::output::pose::{Pose, enu_covariance};
use fusion::output::{EstimateClock, Origin};
use fusion::solution::Solution;
use nalgebra::Matrix6;
use twist::Twist;

/// A kind of message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `nav_msgs/msg/Odometry`
    Odometry,
    /// `sensor_msgs/msg/NavSatFix`
    Fix,
    /// `tf2_msgs/msg/TFMessage`
    Transform,
    /// `diagnostic_msgs/msg/DiagnosticArray`
    Diagnostics,
}

impl Kind {
    /// All, in the order of their declaration.
    pub const ALL: [Self; 4] = [Self::Odometry, Self::Fix, Self::Transform, Self::Diagnostics];

    /// The type of the message, which has a [`definition`](super::definition).
    #[must_use]
    pub const fn message_type(self) -> &'static str {
        match self {
            Self::Odometry => "nav_msgs/msg/Odometry",
            Self::Fix => "sensor_msgs/msg/NavSatFix",
            Self::Transform => "tf2_msgs/msg/TFMessage",
            Self::Diagnostics => "diagnostic_msgs/msg/DiagnosticArray",
        }
    }

    /// The topic, below a prefix such as `/estimate` if it is not one of those that all nodes share.
    #[must_use]
    pub fn topic(self, prefix: &str) -> String {
        match self {
            Self::Odometry => format!("{prefix}/odometry"),
            Self::Fix => format!("{prefix}/fix"),
            Self::Transform => "/tf".to_owned(),
            Self::Diagnostics => "/diagnostics".to_owned(),
        }
    }
}

/// The names of the frames of the messages.
#[derive(Clone, Debug)]
pub struct Frames {
    /// East, north, up from the origin of local coordinates.
    pub world: String,
    /// Forward, left, up.
    pub body: String,
}

impl Default for Frames {
    /// `map` and `base_link`, the names of REP 105.
    fn default() -> Self {
        Self {
            world: "map".to_owned(),
            body: "base_link".to_owned(),
        }
    }
}

/// A message in CDR, with the four bytes that say so.
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// Its stamp: nanoseconds since 1970-01-01 UTC, without leap seconds.
    pub unix_nanos: u64,
    /// Its bytes.
    pub bytes: &'a [u8],
}

/// An element of a `DiagnosticArray`.
#[derive(Clone, Debug)]
pub struct Status {
    /// How bad it is.
    pub level: Level,
    /// The component that it describes.
    pub name: String,
    /// The state in words.
    pub message: String,
    /// Further values by name.
    pub values: Vec<(String, String)>,
}

/// The level of a [`Status`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Level {
    /// As expected.
    Ok,
    /// To be looked at.
    Warn,
    /// Not to be used.
    Error,
    /// Nothing is known of it now.
    Stale,
}

impl From<State> for Level {
    fn from(state: State) -> Self {
        match state {
            State::Good => Self::Ok,
            State::Aligning | State::Coasting | State::Degraded => Self::Warn,
            State::Lost => Self::Error,
        }
    }
}

/// Writes messages, one at a time into the same memory.
#[derive(Debug)]
pub struct Encoder {
    origin: Origin,
    clock: EstimateClock,
    frames: Frames,
    message: Cdr,
}

impl Encoder {
    /// Begins with the origin of local coordinates and the time of the estimates as a date.
    #[must_use]
    pub fn new(origin: Origin, clock: EstimateClock, frames: Frames) -> Self {
        Self {
            origin,
            clock,
            frames,
            message: Cdr::default(),
        }
    }

    /// Begins a message, and returns its stamp.
    fn begin(&mut self, time: Time) -> u64 {
        self.message.begin();
        u64::try_from(self.clock.unix_nanos(time)).unwrap_or_default()
    }

    fn message(&self, unix_nanos: u64) -> Message<'_> {
        let bytes = self.message.bytes();
        Message { unix_nanos, bytes }
    }

    /// Pose and velocity; `None` without a position.
    pub fn odometry(&mut self, solution: &Solution) -> Option<Message<'_>> {
        let pose = Pose::of(solution, &self.origin)?;
        let nanos = self.begin(solution.time);
        self.message.stamp(nanos);
        self.message.text(&self.frames.world);
        self.message.text(&self.frames.body);
        self.message.pose(&pose);
        self.message.numbers(pose_covariance(solution, &pose).transpose().as_slice());
        let Twist { velocity, covariance } = Twist::of(solution).unwrap_or_default();
        self.message.numbers(velocity.as_slice());
        self.message.numbers(&[0.0; 3]);
        let mut all = Matrix6::from_diagonal_element(-1.0);
        all.fixed_view_mut::<3, 3>(0, 0).copy_from(&covariance);
        self.message.numbers(all.transpose().as_slice());
        Some(self.message(nanos))
    }

    /// The position as a fix; `None` without a position.
    pub fn fix(&mut self, solution: &Solution) -> Option<Message<'_>> {
        let (place, covariance) = &solution.position?;
        let nanos = self.begin(solution.time);
        self.message.stamp(nanos);
        self.message.text(&self.frames.body);
        // The status of a fix without augmentation, by no named service.
        self.message.byte(0);
        self.message.whole16(0);
        self.message
            .numbers(&[place.lat.to_degrees(), place.lon.to_degrees(), place.height]);
        self.message.numbers(enu_covariance(covariance).transpose().as_slice());
        // All of the covariance is known.
        self.message.byte(3);
        Some(self.message(nanos))
    }

    /// The pose as a transform from the world to the body; `None` without a position.
    pub fn transform(&mut self, solution: &Solution) -> Option<Message<'_>> {
        let pose = Pose::of(solution, &self.origin)?;
        let nanos = self.begin(solution.time);
        self.message.length(1);
        self.message.stamp(nanos);
        self.message.text(&self.frames.world);
        self.message.text(&self.frames.body);
        self.message.pose(&pose);
        Some(self.message(nanos))
    }

    /// The states of components.
    pub fn diagnostics(&mut self, time: Time, components: &[Status]) -> Message<'_> {
        let nanos = self.begin(time);
        self.message.stamp(nanos);
        self.message.text("");
        self.message.length(components.len());
        for component in components {
            self.message.byte(component.level as u8);
            self.message.text(&component.name);
            self.message.text(&component.message);
            // No hardware.
            self.message.text("");
            self.message.length(component.values.len());
            for (name, value) in &component.values {
                self.message.text(name);
                self.message.text(value);
            }
        }
        self.message(nanos)
    }
}
