//! MCAP with messages of ROS 2, for Foxglove and for programs that read bags.
//!
//! | topic | message | has |
//! |---|---|---|
//! | `/estimate/odometry` | `nav_msgs/msg/Odometry` | pose in `map`, velocity in `base_link`, both with covariance |
//! | `/estimate/fix` | `sensor_msgs/msg/NavSatFix` | latitude, longitude, height, with covariance |
//! | `/tf` | `tf2_msgs/msg/TFMessage` | `map` to `base_link` |
//! | `/diagnostics` | `diagnostic_msgs/msg/DiagnosticArray` | health of the filter, where it changes |
//!
//! The axes are those of REP 103: `map` is east, north, up from the origin of local coordinates, `base_link` forward, left,
//! up. The angular velocity is not estimated: it is zero, and its variances are −1. Without a date of the log, time zero is
//! 1970-01-01.

mod cdr;
mod definitions;
mod twist;

use cdr::Cdr;
use definitions::{DIAGNOSTICS, FIX, ODOMETRY, TF};
use fusion::core::belief::Belief;
use fusion::core::health::State;
use fusion::core::time::Time;
use fusion::output::pose::{Pose, enu_covariance};
use fusion::output::{EstimateClock, EstimateFormat, EstimateSink, Origin, OutputFile};
use fusion::solution::Solution;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{WriteOptions, Writer};
use nalgebra::{Matrix3, Matrix6, Vector3};
use std::collections::BTreeMap;
use std::io;
use twist::{Twist, enu_from_frd};

/// The frames of the messages.
const WORLD: &str = "map";
const BODY: &str = "base_link";

fusion::inventory::submit! {
    EstimateFormat {
        name: "mcap",
        ending: "mcap",
        about: "Odometry, NavSatFix, TF and diagnostics of ROS 2, for Foxglove and readers of bags",
        begin: |file, about| Ok(Box::new(Bag::begin(file, about.origin.clone(), about.clock)?)),
    }
}

/// The channels of a bag, in the order in which they are made.
#[derive(Clone, Copy, Debug)]
enum Topic {
    Odometry,
    Fix,
    Tf,
    Diagnostics,
}

const TOPICS: [(&str, &str, &str); 4] = [
    ("/estimate/odometry", "nav_msgs/msg/Odometry", ODOMETRY),
    ("/estimate/fix", "sensor_msgs/msg/NavSatFix", FIX),
    ("/tf", "tf2_msgs/msg/TFMessage", TF),
    ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", DIAGNOSTICS),
];

struct Bag {
    bag: Writer<NoSeek<OutputFile>>,
    channels: [u16; 4],
    count: u32,
    origin: Origin,
    clock: EstimateClock,
    message: Cdr,
}

impl core::fmt::Debug for Bag {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Bag").field("count", &self.count).finish_non_exhaustive()
    }
}

impl Bag {
    fn begin(file: OutputFile, origin: Origin, clock: EstimateClock) -> io::Result<Self> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library("fusion")
            .compression(None)
            .disable_seeking(true);
        let mut bag = options.create(NoSeek::new(file)).map_err(io::Error::other)?;
        let mut channels = [0; 4];
        for (channel, (topic, message_type, definition)) in channels.iter_mut().zip(TOPICS) {
            let schema = bag
                .add_schema(message_type, "ros2msg", definition.as_bytes())
                .map_err(io::Error::other)?;
            *channel = bag.add_channel(schema, topic, "cdr", &BTreeMap::new()).map_err(io::Error::other)?;
        }
        Ok(Self {
            bag,
            channels,
            count: 0,
            origin,
            clock,
            message: Cdr::default(),
        })
    }

    /// Begins a message with its header; `None` for a message without one.
    fn header(&mut self, time: Time, frame: Option<&str>) -> u64 {
        let nanos = u64::try_from(self.clock.unix_nanos(time)).unwrap_or_default();
        self.message.begin();
        if let Some(frame) = frame {
            self.message.stamp(nanos);
            self.message.text(frame);
        }
        nanos
    }

    fn put(&mut self, topic: Topic, nanos: u64) -> io::Result<()> {
        let header = MessageHeader {
            channel_id: self.channels[topic as usize],
            sequence: self.count,
            log_time: nanos,
            publish_time: nanos,
        };
        self.count = self.count.wrapping_add(1);
        self.bag
            .write_to_known_channel(&header, self.message.bytes())
            .map_err(io::Error::other)
    }

    fn odometry(&mut self, solution: &Solution, pose: &Pose) -> io::Result<()> {
        let nanos = self.header(solution.time, Some(WORLD));
        self.message.text(BODY);
        self.message.pose(pose);
        self.message.numbers(pose_covariance(solution, pose).transpose().as_slice());
        let Twist { velocity, covariance } = Twist::of(solution).unwrap_or_default();
        self.message.numbers(velocity.as_slice());
        self.message.numbers(&[0.0; 3]);
        let mut all = Matrix6::from_diagonal_element(-1.0);
        all.fixed_view_mut::<3, 3>(0, 0).copy_from(&covariance);
        self.message.numbers(all.transpose().as_slice());
        self.put(Topic::Odometry, nanos)
    }

    fn fix(&mut self, solution: &Solution) -> io::Result<()> {
        let Some((place, covariance)) = &solution.position else {
            return Ok(());
        };
        let nanos = self.header(solution.time, Some(BODY));
        // The status of a fix without augmentation, by no named service.
        self.message.byte(0);
        self.message.whole16(0);
        self.message
            .numbers(&[place.lat.to_degrees(), place.lon.to_degrees(), place.height]);
        self.message.numbers(enu_covariance(covariance).transpose().as_slice());
        // All of the covariance is known.
        self.message.byte(3);
        self.put(Topic::Fix, nanos)
    }

    fn transform(&mut self, time: Time, pose: &Pose) -> io::Result<()> {
        let nanos = self.header(time, None);
        self.message.length(1);
        self.message.stamp(nanos);
        self.message.text(WORLD);
        self.message.text(BODY);
        self.message.pose(pose);
        self.put(Topic::Tf, nanos)
    }
}

impl EstimateSink for Bag {
    fn write(&mut self, solution: &Solution, _belief: &Belief) -> io::Result<()> {
        let Some(pose) = Pose::of(solution, &self.origin) else {
            return Ok(());
        };
        self.odometry(solution, &pose)?;
        self.fix(solution)?;
        self.transform(solution.time, &pose)
    }

    fn health(&mut self, time: Time, state: State, reasons: &[(&str, String)]) -> io::Result<()> {
        let nanos = self.header(time, Some(""));
        self.message.length(1);
        self.message.byte(match state {
            State::Good => 0,
            State::Lost => 2,
            State::Aligning | State::Coasting | State::Degraded => 1,
        });
        self.message.text("filter");
        self.message.text(state.word());
        self.message.text("");
        self.message.length(reasons.len());
        for (word, text) in reasons {
            self.message.text(word);
            self.message.text(text);
        }
        self.put(Topic::Diagnostics, nanos)
    }

    fn finish(mut self: Box<Self>) -> io::Result<OutputFile> {
        self.bag.finish().map_err(io::Error::other)?;
        Ok(self.bag.into_inner().into_inner())
    }
}

/// The covariance of position and attitude, in the axes of the world: rows x, y, z, then turns about these axes.
fn pose_covariance(solution: &Solution, pose: &Pose) -> Matrix6<f64> {
    let mut all = Matrix6::zeros();
    if let Some((_, covariance)) = &solution.position {
        all.fixed_view_mut::<3, 3>(0, 0).copy_from(&enu_covariance(covariance));
    }
    if let Some((_, covariance)) = &solution.attitude {
        let turn = enu_from_frd(pose);
        all.fixed_view_mut::<3, 3>(3, 3).copy_from(&(turn * covariance * turn.transpose()));
        let to_enu = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        let across = to_enu * solution.with_attitude[0] * turn.transpose();
        all.fixed_view_mut::<3, 3>(0, 3).copy_from(&across);
        all.fixed_view_mut::<3, 3>(3, 0).copy_from(&across.transpose());
    }
    all
}
