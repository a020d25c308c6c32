//! Simulated odometry in the plane: speeds ahead and to the right, rate of turn.
//!
//! True       the constant speeds and rate that lead on one arc from the pose at one sample to that at
//!            the next: with φ the change of heading and d the way in the axes of the first pose,
//!            u = V(φ)⁻¹ d/T, r = φ/T, V the first two rows and columns of Γ₁(φ e₃)
//! Measured   plus white noise, sampled: σ = N/√T for a density N, T the interval of the sample
//! Not here   slip, scale and bias of the wheels

use super::random::Random;
use crate::earth::LocalFrame;
use crate::process::strapdown::mechanisation::Nav;
use crate::units::{NonNegative, Positive, dim};
use fusion_core::Time;
use fusion_core::geometry::{gamma::gamma, so3, wgs84::Geodetic};
use fusion_core::math;
use fusion_core::state::wrap;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

/// The simulated odometry of a vehicle on level ground.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OdometryErrorSpec {
    /// Samples per second; at most 1e9 samples in a run.
    pub(super) rate: Positive<dim::Frequency>,
    /// White noise density of the speed ahead: 1σ of a sample over the root of `rate`.
    #[serde(default)]
    forward_noise: NonNegative<dim::PositionRandomWalk>,
    /// White noise density of the speed to the right.
    #[serde(default)]
    sideways_noise: NonNegative<dim::PositionRandomWalk>,
    /// White noise density of the yaw rate.
    #[serde(default)]
    yaw_rate_noise: NonNegative<dim::AngleRandomWalk>,
}

impl OdometryErrorSpec {
    /// The densities of white noise of the speed ahead, of the speed to the right, and of the yaw rate, in SI.
    #[must_use]
    pub fn noise(&self) -> [f64; 3] {
        [self.forward_noise.si(), self.sideways_noise.si(), self.yaw_rate_noise.si()]
    }
}

/// The odometry as it runs: stateful, seeded.
#[derive(Clone, Debug)]
pub(super) struct Odometry {
    /// Densities: ahead, to the right, of the turn.
    noise: [f64; 3],
    period: f64,
    random: Random,
    /// The plane it drives on.
    frame: LocalFrame,
    last: Option<(Time, Pose)>,
}

/// Position in the axes of the plane \[m\], heading \[rad\].
type Pose = (Vector3<f64>, f64);

impl Odometry {
    pub(super) fn new(spec: &OdometryErrorSpec, origin: Geodetic, seed: u64) -> Self {
        Self {
            noise: spec.noise(),
            period: 1.0 / spec.rate.si(),
            random: Random::new(seed, "odometry"),
            frame: LocalFrame::new(origin),
            last: None,
        }
    }

    /// Measures over the interval that ends at `time` with the body at `nav`. The first
    /// sample has no interval: it is the sample of a body at rest.
    pub(super) fn measure(&mut self, time: Time, nav: &Nav) -> [f64; 3] {
        let pose = (self.frame.to_ned(&nav.position), so3::to_rpy(&nav.q_nb).z);
        let before = self.last.replace((time, pose));
        let (exact, dt) = match before {
            Some((then, from)) if time > then => {
                let dt = time.seconds_since(then);
                (arc_between(&from, &pose, dt), dt)
            }
            _ => ([0.0; 3], self.period),
        };
        let mut measured = exact;
        for (value, density) in measured.iter_mut().zip(self.noise) {
            *value += density / math::sqrt(dt) * self.random.normal();
        }
        measured
    }
}

/// Speeds ahead and to the right \[m/s\] and rate of turn \[rad/s\] of the arc between two level poses.
fn arc_between((from, start): &Pose, (to, end): &Pose, dt: f64) -> [f64; 3] {
    let turn = wrap(end - start);
    let way = to - from;
    let in_body = so3::from_rpy(0.0, 0.0, *start).inverse_transform_vector(&Vector3::new(way.x, way.y, 0.0));
    // About the down axis, Γ₁ keeps the down component: its inverse is the inverse in the plane.
    let mean = gamma(1, &Vector3::new(0.0, 0.0, turn)).try_inverse().unwrap_or_default() * in_body;
    [mean.x / dt, mean.y / dt, turn / dt]
}
