//! Simulated worlds: truth, perfect inertial sensors, their errors, and every other sensor.
//!
//! Truth is a [`World`], advanced step by step; an open-loop [`Trajectory`] of timed segments is
//! its simplest case, and in a [`ClosedLoop`] a [`Vehicle`] is steered by the filter's own estimate. [`inverse`] finds what perfect inertial sensors read along it, [`ImuError`]
//! spoils that, and each sensor's own h(x) plus a [`SensorError`] gives its rows: the model that
//! the filter linearises is the model that is simulated. [`Simulator`] merges all of it into rows
//! in order of their stamps.
//!
//! This module has no estimator, no file, no global generator. A run is a function of its
//! declaration and one seed.

#![cfg(feature = "declare")]

mod closed_loop;
mod constellation;
mod control;
mod imu_error;
pub mod inverse;
mod noise;
mod odometry;
mod profile;
mod random;
mod record;
mod sea;
mod segment;
mod ship;
mod simulator;
mod spec;
mod start;
mod task;
mod tracks;
mod trajectory;
mod vehicle;
mod world;

pub use closed_loop::{ClosedLoop, Crew, Script};
pub use constellation::ConstellationSpec;
pub use control::{Control, ControlSpec, Goal, Seen};
pub use imu_error::{AccelerometerErrorSpec, GyroErrorSpec, ImuError, ImuErrorSpec, ImuPreset, TriadErrors};
pub use noise::{SensorError, SensorErrorSpec, SensorErrors};
pub use odometry::OdometryErrorSpec;
pub use record::{Errors, HeadingErrors, Leg, Record};
pub use sea::{SeaSpec, WavesSpec};
pub use segment::{Junction, Motion, Segment, SegmentSpec};
pub use ship::{SHIP_STREAMS, ShipSpec, ship_channels, ship_instruments};
pub use simulator::{
    IMU, INSTRUMENTS, Next, ODOMETRY, REFERENCE, Setup, SharedCourse, SimulatedSensor, SimulatedStream, Simulator, TRACK_SPEEDS, UNITS,
    instruments, odometry_channels, reference_channels, track_channels,
};
pub use spec::{SimulationSpec, StartSpec};
pub use start::{DrawnStart, write_true_motion};
pub use task::{Task, TaskSpec};
pub use trajectory::Trajectory;
pub use vehicle::{Command, Vehicle, VehicleSpec};
pub use world::{OpenLoop, Plane, Truth, World};
