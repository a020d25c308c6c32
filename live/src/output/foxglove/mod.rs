//! A server for Foxglove, and for other programs that speak its WebSocket protocol.
//!
//! | topic | message | when |
//! |---|---|---|
//! | `/fix` | `foxglove.LocationFix` | each estimate with a position |
//! | `/pose` | `foxglove.PoseInFrame` | as `/fix` |
//! | `/tf` | `foxglove.FrameTransform`: `map` to `base_link` | as `/fix` |
//! | `/estimate` | `fusion.Estimate`, the line of the output `json` | each estimate |
//! | `/health` | `foxglove.Log` | at a change, and to a new subscriber |
//! | `/innovations/SENSOR` | `fusion.Innovation`: residual, its 1σ, NIS | each estimate after a new measurement |
//!
//! Messages are JSON with JSON schemas. The axes are those of REP 103: `map` is east, north, up from the origin of local
//! coordinates, `base_link` forward, left, up. Without a date, time zero is 1970-01-01.
//!
//! A client that reads slowly loses the oldest messages of each channel; no other client and no estimate waits for it. A
//! client that breaks the protocol is closed with a reason.
//!
//! Source    <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>, `foxglove.websocket.v1`
//! Own       the SDK of Foxglove brings 125 packages and its own thread pool
//! Not here  requests that change the filter; compression; TLS

mod messages;
mod protocol;
mod queue;
mod server;
#[cfg(test)]
mod tests;

use super::line::Line;
use super::{About, Outgoing, Output, OutputSpec};
use crate::link::Sender;
use fusion::core::time::Time;
use fusion::models::register;
use fusion::output::pose::Pose;
use fusion::output::{EstimateClock, Origin};
use messages::{ESTIMATE, FIX, FrameTransform, HEALTH, Innovation, LocationFix, Log, POSE, PoseInFrame, SENSORS, TRANSFORM};
use protocol::{advertise, server_info};
use queue::Message;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use server::{Count, PATIENCE, Server};
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{SystemTime, UNIX_EPOCH};

/// A server to which Foxglove connects, at `ws://127.0.0.1:8765`: the position on a map, the pose, the estimate, the health
/// and the innovations of each sensor.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FoxgloveSpec {
    /// The own address and port. With `"0.0.0.0:8765"` other computers can connect.
    #[serde(default = "standard_port")]
    listen: SocketAddr,
}

register! { Output, "foxglove", FoxgloveSpec, r#"listen = "127.0.0.1:8765""# }

fn standard_port() -> SocketAddr {
    (Ipv4Addr::LOCALHOST, 8765).into()
}

#[typetag::deserialize(name = "foxglove")]
impl OutputSpec for FoxgloveSpec {
    fn link(&self) -> Option<&str> {
        None
    }

    fn open(&self, about: &About) -> io::Result<Box<dyn Output>> {
        Ok(Box::new(Foxglove::open(self.listen, about)?))
    }
}

struct Foxglove {
    server: Server,
    clock: EstimateClock,
    origin: Origin,
    /// The health that was sent last.
    health: String,
    /// For each sensor, the measurement that was sent last.
    sensors: Vec<(Option<Time>, u64, u64)>,
}

impl Foxglove {
    fn open(listen: SocketAddr, about: &About) -> io::Result<Self> {
        let started = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let channels = messages::channels(&about.sensors);
        let greetings = [server_info(&about.description, started.as_nanos()), advertise(&channels)];
        Ok(Self {
            server: Server::start(listen, greetings, channels.len(), PATIENCE)?,
            clock: about.clock,
            origin: about.origin.clone(),
            health: String::new(),
            sensors: vec![Default::default(); about.sensors.len()],
        })
    }

    fn publish(&self, channel: usize, time: u64, message: impl Serialize) -> io::Result<()> {
        self.server.publish(channel, time, || Ok(serde_json::to_vec(&message)?))
    }
}

impl Output for Foxglove {
    fn send(&mut self, estimate: &Outgoing, _to: Option<&mut dyn Sender>) -> io::Result<()> {
        let time = u64::try_from(self.clock.unix_nanos(estimate.time)).unwrap_or_default();
        let solution = estimate.solution.unwrap_or_default();
        if let Some(fix) = LocationFix::of(time, &solution) {
            self.publish(FIX, time, fix)?;
            if let Some(pose) = Pose::of(&solution, &self.origin) {
                self.publish(POSE, time, PoseInFrame::of(time, &pose))?;
                self.publish(TRANSFORM, time, FrameTransform::of(time, &pose))?;
            }
        }
        self.publish(ESTIMATE, time, Line::of(estimate, self.clock))?;
        let health = messages::health(estimate);
        if health != self.health {
            let payload = serde_json::to_vec(&Log::of(time, estimate.health, &health))?;
            self.server.publish_latest(HEALTH, Message { time, payload });
            self.health = health;
        }
        for (k, (sensor, sent)) in estimate.sensors.iter().zip(&mut self.sensors).enumerate() {
            let newest = (sensor.time, sensor.used, sensor.rejected);
            if core::mem::replace(sent, newest) != newest {
                let make = || Ok(serde_json::to_vec(&Innovation::of(sensor))?);
                self.server.publish(SENSORS + k, time, make)?;
            }
        }
        Ok(())
    }

    fn status(&self) -> Option<String> {
        let Count { clients, dropped } = self.server.count();
        let clients = match clients {
            0 => "no client".to_owned(),
            1 => "1 client".to_owned(),
            many => format!("{many} clients"),
        };
        let lost = if dropped > 0 {
            format!(", {dropped} messages dropped for slow clients")
        } else {
            String::new()
        };
        Some(format!("{clients} at ws://{}{lost}", self.server.address))
    }
}
