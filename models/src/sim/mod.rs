//! Simulated worlds: truth, perfect inertial sensors, their errors, and every other sensor.
//!
//! Truth is a [`World`], advanced step by step; an open-loop [`Trajectory`] of timed segments is
//! its simplest case. [`inverse`] finds what perfect inertial sensors read along it, [`ImuError`]
//! spoils that, and each sensor's own h(x) plus a [`SensorError`] gives its rows: the model that
//! the filter linearises is the model that is simulated. [`Simulator`] merges all of it into rows
//! in order of their stamps.
//!
//! What is absent here: no estimator, no file, no global generator. A run is a function of its
//! declaration and one seed.

mod imu_error;
pub mod inverse;
mod noise;
mod odometry;
mod profile;
mod random;
mod segment;
mod simulator;
mod spec;
mod start;
mod trajectory;
mod world;

pub use imu_error::{AccelerometerErrorSpec, GyroErrorSpec, ImuError, ImuErrorSpec, ImuPreset};
pub use noise::{SensorError, SensorErrorSpec};
pub use odometry::OdometryErrorSpec;
pub use segment::{Junction, Motion, Segment, SegmentSpec};
pub use simulator::{
    IMU, ODOMETRY, REFERENCE, Setup, SimulatedSensor, SimulatedStream, Simulator, UNITS, odometry_channels, reference_channels,
};
pub use spec::{SimulationSpec, StartSpec};
pub use start::DrawnStart;
pub use trajectory::Trajectory;
pub use world::{OpenLoop, Truth, World};
