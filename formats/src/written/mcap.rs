//! MCAP with [messages of ROS 2](crate::ros::messages), for Foxglove and for programs that read bags. The health of the
//! filter is written where it changes.

use crate::ros::definition;
use crate::ros::messages::{Encoder, Frames, Kind, Message, Status};
use fusion::core::belief::Belief;
use fusion::core::health::State;
use fusion::core::time::Time;
use fusion::output::{EstimateClock, EstimateFormat, EstimateSink, Origin, OutputFile};
use fusion::solution::Solution;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io;

/// The topics of estimates begin with it.
const PREFIX: &str = "/estimate";

fusion::inventory::submit! {
    EstimateFormat {
        name: "mcap",
        ending: "mcap",
        about: "Odometry, NavSatFix, TF and diagnostics of ROS 2, for Foxglove and readers of bags",
        begin: |file, about| Ok(Box::new(Bag::begin(file, about.origin.clone(), about.clock)?)),
    }
}

struct Bag {
    log: Log,
    encoder: Encoder,
}

/// The file.
struct Log {
    bag: Writer<NoSeek<OutputFile>>,
    /// The channels, in the order of [`Kind::ALL`].
    channels: [u16; Kind::ALL.len()],
    count: u32,
}

impl core::fmt::Debug for Bag {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Bag").field("count", &self.log.count).finish_non_exhaustive()
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
        let mut channels = [0; Kind::ALL.len()];
        for (channel, kind) in channels.iter_mut().zip(Kind::ALL) {
            let text = definition(kind.message_type()).unwrap_or_default();
            let schema = bag
                .add_schema(kind.message_type(), "ros2msg", text.as_bytes())
                .map_err(io::Error::other)?;
            *channel = bag
                .add_channel(schema, &kind.topic(PREFIX), "cdr", &BTreeMap::new())
                .map_err(io::Error::other)?;
        }
        Ok(Self {
            log: Log { bag, channels, count: 0 },
            encoder: Encoder::new(origin, clock, Frames::default()),
        })
    }
}

impl Log {
    fn put(&mut self, kind: Kind, message: Option<Message<'_>>) -> io::Result<()> {
        let Some(Message { unix_nanos, bytes }) = message else {
            return Ok(());
        };
        let header = MessageHeader {
            channel_id: self.channels[kind as usize],
            sequence: self.count,
            log_time: unix_nanos,
            publish_time: unix_nanos,
        };
        self.count = self.count.wrapping_add(1);
        self.bag.write_to_known_channel(&header, bytes).map_err(io::Error::other)
    }
}

impl EstimateSink for Bag {
    fn write(&mut self, solution: &Solution, _belief: &Belief) -> io::Result<()> {
        self.log.put(Kind::Odometry, self.encoder.odometry(solution))?;
        self.log.put(Kind::Fix, self.encoder.fix(solution))?;
        self.log.put(Kind::Transform, self.encoder.transform(solution))
    }

    fn health(&mut self, time: Time, state: State, reasons: &[(&str, String)]) -> io::Result<()> {
        let filter = Status {
            level: state.into(),
            name: "filter".to_owned(),
            message: state.word().to_owned(),
            values: reasons.iter().map(|(word, text)| ((*word).to_owned(), text.clone())).collect(),
        };
        self.log.put(Kind::Diagnostics, Some(self.encoder.diagnostics(time, &[filter])))
    }

    fn finish(mut self: Box<Self>) -> io::Result<OutputFile> {
        self.log.bag.finish().map_err(io::Error::other)?;
        Ok(self.log.bag.into_inner().into_inner())
    }
}
