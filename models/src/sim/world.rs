//! The simulated world: the truth, step by step.
//!
//! A world is advanced from instant to instant. An open-loop trajectory is the simplest case; a
//! vehicle with a controller that uses the filter's own estimate is the general case.
//!
//! A trajectory is on the plane that touches the ellipsoid at the origin. Level at the origin
//! is not level 10 km away, where that plane is 8 m above the ellipsoid. If the process treats the Earth as this
//! plane ([`Gravity::Flat`]), level is the same everywhere: true velocity and attitude are in
//! the axes at the origin.

use super::closed_loop::Script;
use super::control::Seen;
use super::inverse::{self, Sample};
use super::record::Record;
use super::segment::Motion;
use super::trajectory::Trajectory;
use crate::earth::frames::rotation_en;
use crate::earth::{Gravity, LocalFrame};
use crate::process::strapdown::mechanisation::Nav;
use core::fmt::Debug;
use fusion_core::Time;
use fusion_core::geometry::wgs84::Geodetic;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// The truth at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// The instant; a world starts at time 0.
    pub time: Time,
    /// Position, velocity, attitude.
    pub nav: Nav,
    /// Mean angular rate and specific force over the step that led here.
    pub imu: Sample,
}

/// A world that is advanced step by step.
pub trait World: Debug + Send {
    /// The truth now.
    fn truth(&self) -> &Truth;

    /// Advances to `to`, not before now, and returns the truth then. Instants rather than
    /// steps, so that no rounding adds up.
    fn advance(&mut self, to: Time) -> &Truth;

    /// When it ends; for a steered world this may become known only during the run.
    fn end(&self) -> Time {
        Time::MAX
    }

    /// Whether it is the same in every run: no seed and no filter influences it.
    fn is_given(&self) -> bool {
        false
    }

    /// How often it must be [steered](Self::steer) \[Hz\]; `None` if nothing influences it.
    fn control_rate(&self) -> Option<f64> {
        None
    }

    /// Whether the vehicle's own estimate makes a difference `now`.
    fn listens(&self, now: Time) -> bool {
        let _ = now;
        true
    }

    /// Receives the vehicle's own estimate `now`; `None` before its filter has started.
    fn steer(&mut self, now: Time, seen: Option<&Seen>) {
        let _ = (now, seen);
    }

    /// The present speeds of its vehicle's left and right track \[m/s\], if it runs on tracks.
    fn tracks(&self) -> Option<[f64; 2]> {
        None
    }

    /// The commands that its vehicle has had, up to now.
    fn script(&self) -> Option<Script> {
        None
    }

    /// How well it was steered, up to now.
    fn record(&self) -> Option<Record> {
        None
    }
}

/// The plane that a world lies on.
#[derive(Clone, Debug)]
pub struct Plane {
    frame: LocalFrame,
    /// From the local axes to Earth-centred axes; `None` if the Earth is a plane.
    c_el: Option<Matrix3<f64>>,
    gravity: Gravity,
    /// The inertial unit from the point that moves along the path, in body axes \[m\].
    unit: Vector3<f64>,
}

impl Plane {
    /// The plane that touches the Earth at `origin`.
    #[must_use]
    pub fn new(origin: Geodetic, gravity: Gravity) -> Self {
        let is_flat = matches!(gravity, Gravity::Flat(_));
        Self {
            frame: LocalFrame::new(origin),
            c_el: (!is_flat).then(|| rotation_en(origin.lat, origin.lon)),
            gravity,
            unit: Vector3::zeros(),
        }
    }

    /// The same for an inertial unit at this place of a vehicle, whose reference point moves along the path.
    #[must_use]
    pub fn carrying(self, unit: Vector3<f64>) -> Self {
        Self { unit, ..self }
    }

    /// The gravity over it.
    #[must_use]
    pub const fn gravity(&self) -> Gravity {
        self.gravity
    }

    /// Geodetic position, and velocity and attitude in the axes there, of the inertial unit where the vehicle has a motion
    /// in local axes; in those where the Earth is a plane.
    #[must_use]
    pub fn nav(&self, motion: &Motion) -> Nav {
        let motion = &motion.carried_at(&self.unit);
        let position = self.frame.to_geodetic(&motion.position);
        let Some(c_el) = &self.c_el else {
            return Nav {
                position,
                v_eb_n: motion.velocity,
                q_nb: motion.attitude(),
            };
        };
        let c_nl = rotation_en(position.lat, position.lon).tr_mul(c_el);
        let q_nl = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(c_nl));
        let mut q_nb = q_nl * motion.attitude();
        q_nb.renormalize();
        Nav {
            position,
            v_eb_n: c_nl * motion.velocity,
            q_nb,
        }
    }
}

/// A fixed trajectory, without control.
#[derive(Debug)]
pub struct OpenLoop {
    trajectory: Trajectory,
    plane: Plane,
    truth: Truth,
}

/// The step that the first inertial sample, which no step led to, is computed over \[s\].
pub(super) const FIRST_STEP: f64 = 1e-3;

impl OpenLoop {
    /// `trajectory` over `plane`.
    #[must_use]
    pub fn new(trajectory: Trajectory, plane: Plane) -> Self {
        let truth = Truth {
            time: Time::default(),
            nav: plane.nav(&trajectory.at(0.0)),
            imu: Sample::default(),
        };
        let mut world = Self { trajectory, plane, truth };
        world.truth = world.truth_at(Time::default());
        world
    }

    /// The truth at `time`, independent of the world's present time. Its inertial sample is the mean over the
    /// millisecond that follows.
    #[must_use]
    pub fn truth_at(&self, time: Time) -> Truth {
        let at = |seconds: f64| self.plane.nav(&self.trajectory.at(seconds));
        let (here, next) = (at(time.seconds()), at(time.seconds() + FIRST_STEP));
        Truth {
            time,
            nav: here,
            imu: inverse::sample(&here, &next, FIRST_STEP, self.plane.gravity),
        }
    }

    /// The trajectory.
    #[must_use]
    pub const fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }
}

impl World for OpenLoop {
    fn truth(&self) -> &Truth {
        &self.truth
    }

    fn advance(&mut self, to: Time) -> &Truth {
        let dt = to.seconds_since(self.truth.time);
        if dt > 0.0 {
            let next = self.plane.nav(&self.trajectory.at(to.seconds()));
            self.truth = Truth {
                time: to,
                nav: next,
                imu: inverse::sample(&self.truth.nav, &next, dt, self.plane.gravity),
            };
        }
        &self.truth
    }

    fn end(&self) -> Time {
        Time::from_seconds(self.trajectory.duration())
    }

    fn is_given(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::segment::{Junction, SegmentSpec};
    use super::*;

    #[derive(serde::Deserialize)]
    struct File {
        trajectory: Vec<Box<dyn SegmentSpec>>,
    }

    #[test]
    fn far_from_the_origin_velocity_and_attitude_are_in_the_axes_there() {
        let file: File = toml::from_str("trajectory = [{ straight = { duration = 2000, speed = 30, acceleration = 3 } }]").unwrap();
        let start = Junction {
            position: Vector3::zeros(),
            heading: 0.8,
            speed: 0.0,
        };
        let trajectory = Trajectory::new(start, &file.trajectory).unwrap();
        let origin = Geodetic::new(0.63, 2.2593, 0.0);
        let mut world = OpenLoop::new(trajectory, Plane::new(origin, Gravity::default()));
        let before = world.advance(Time::from_seconds(1499.5)).nav;
        let here = world.advance(Time::from_seconds(1500.0)).nav;
        let after = world.advance(Time::from_seconds(1500.5)).nav;
        // 1e-12 m/s: rounding of three rotations. 45 km away the axes have turned by 7e-3 rad.
        let ahead = here.q_nb.inverse_transform_vector(&here.v_eb_n);
        assert!((ahead - Vector3::new(30.0, 0.0, 0.0)).norm() < 1e-12, "{ahead}");
        assert!(here.v_eb_n.z < -0.1, "the plane rises above the ellipsoid: {}", here.v_eb_n);
        // 1e-5 m/s: both charts end half a step away, (15 m)²/R = 3.5e-5 m of second order, which cancels.
        let moved = after.position.difference(&here.position) - before.position.difference(&here.position);
        assert!((moved - here.v_eb_n).norm() < 1e-5, "{moved}");
    }

    #[test]
    fn the_reference_point_keeps_to_the_path_and_the_unit_swings_round_it() {
        let text = "trajectory = [{ straight = { distance = 20, speed = 5, acceleration = 2 } }, { turn = { angle = 1.5, radius = 8 } }]";
        let file: File = toml::from_str(text).unwrap();
        let start = Junction {
            position: Vector3::new(3.0, -2.0, 0.0),
            heading: 0.3,
            speed: 0.0,
        };
        let plane = Plane::new(Geodetic::new(0.63, 2.2593, 0.0), Gravity::default());
        let unit = Vector3::new(1.2, -0.3, -0.4);
        let world = |plane| OpenLoop::new(Trajectory::new(start, &file.trajectory).unwrap(), plane);
        let (mut vehicle, mut carried) = (world(plane.clone()), world(plane.carrying(unit)));
        let (mut turning, mut fastest) = (0.0, 0.0);
        for k in 1..=400 {
            let time = Time::from_seconds(0.02 * f64::from(k));
            let (point, before) = (vehicle.advance(time).nav, carried.truth().nav);
            let truth = *carried.advance(time);
            // 1e-6 m: the axes at both places differ by a metre over the radius of the Earth.
            let arm = truth.nav.position.difference(&point.position) - point.q_nb * unit;
            assert!(arm.norm() < 1e-6, "{arm}");
            // The constraint of motion holds at the reference point: l from the unit to it is −unit.
            let w = (before.q_nb.inverse() * truth.nav.q_nb).scaled_axis() / 0.02;
            // In the middle of the step, where the mean rate is the rate.
            let (q, v) = (
                before.q_nb * UnitQuaternion::from_scaled_axis(w * 0.01),
                (before.v_eb_n + truth.nav.v_eb_n) * 0.5,
            );
            let there = q.inverse() * v + w.cross(&-unit);
            if time.seconds() < 5.0 || time.seconds() > 5.5 {
                // 1e-3 m/s: of second order in the step, and the rate of the Earth is not in it.
                assert!(there.y.abs() < 1e-3 && there.z.abs() < 1e-3, "{} s: {there}", time.seconds());
            }
            turning = f64::max(turning, (truth.nav.q_nb.inverse() * truth.nav.v_eb_n).y.abs());
            fastest = f64::max(fastest, w.z.abs());
        }
        // At the unit itself it does not: it moves sideways with the turn times 1.2 m, which is 5 m/s over 8 m on average.
        // 1e-2 m/s: the mean rate over a step, as above.
        assert!(turning > 0.75 && (turning - 1.2 * fastest).abs() < 1e-2, "{turning} {fastest}");
    }
}
