//! Quality of service as ROS 2 has it.

use rustdds::policy::{Durability, History, Reliability};
use rustdds::{Duration, QosPolicies, QosPolicyBuilder};
use schemars::JsonSchema;
use serde::Deserialize;

/// The quality of service of a subscription.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Reading {
    /// Best effort, which all publishers offer: a message that is lost is not sent again.
    #[default]
    SensorData,
    /// A message that is lost is sent again. Publishers of sensor data may not offer it.
    Reliable,
}

/// A writer waits at most for this time until older messages have left.
const LONGEST_WAIT: Duration = Duration::from_millis(100);

/// That of a subscription or of a publisher that keeps its latest messages.
pub(crate) fn qos(is_reliable: bool, depth: i32) -> QosPolicies {
    let reliability = if is_reliable {
        Reliability::Reliable {
            max_blocking_time: LONGEST_WAIT,
        }
    } else {
        Reliability::BestEffort
    };
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth })
        .build()
}
