//! Topics of ROS 2 as links and outputs of [`fusion_live`], over DDS and without an installed ROS.
//!
//! ```text
//! topics ── DDS ──▶ link "ros2" ──▶ records of MCAP ──▶ sources of the type "mcap" ──▶ filter
//!                                                                                         │
//! nodes ◀── DDS ── Odometry, NavSatFix, TF, diagnostics ◀── output "ros2" ◀── estimates ──┘
//! ```
//!
//! A source reads a live topic as it reads a bag, with the same declaration. The messages stay CDR from end to end, so that
//! a link takes every type whose definition is known.
//!
//! ```toml
//! [link.robot]
//! type = "ros2"
//! topics = [{ topic = "/imu/data", type = "sensor_msgs/msg/Imu" }]
//! sources = ["imu"]
//!
//! [source.imu]
//! type = "mcap"
//! path = "drive.mcap"                # a bag with this topic, for runs that are not live
//! topic = "/imu/data"
//! channels.angular_rate = { columns = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"], unit = "rad/s" }
//!
//! [output.nodes]
//! type = "ros2"
//! rate = "20 Hz"
//! ```
//!
//! DDS is the crate [`rustdds`], which is Rust alone. Programs on one computer find each other at its loopback address,
//! programs on others by multicast at 239.255.0.1, as nodes of ROS 2 do.
//!
//! Not here   Zenoh (`rmw_zenoh`), services, actions, parameters, DDS Security, a node in `ros2 node list`: the message
//! that announces a node differs between Humble and later, and one of Jazzy crashes nodes of Humble with Fast DDS
//! (<https://github.com/ros2/rmw_fastrtps/issues/733>)

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod cdr;
mod link;
mod names;
mod output;
mod qos;
mod records;

pub use link::Ros2LinkSpec;
pub use names::{Domain, MessageType, TopicName};
pub use output::Ros2OutputSpec;

/// Links the blocks into a program; call it once, so that the linker keeps them.
pub const fn link() {}
