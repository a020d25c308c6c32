//! A vehicle that is controlled by its own estimate.
//!
//! The vehicle moves in steps of a hundredth of a second, for any set of sensors. Within a step,
//! velocity and roll, pitch, heading change linearly with time, and position is the integral of
//! velocity. So a strapdown process reproduces the motion from the readings of perfect sensors at these instants.
//! A command holds from the step after the instant at which the controller gives it. The vehicle
//! stands while its filter has no estimate.

use super::control::{Control, Goal, Seen};
use super::inverse;
use super::record::{Record, Running};
use super::segment::Motion;
use super::task::Task;
use super::vehicle::{Command, Vehicle};
use super::world::{FIRST_STEP, Plane, Truth, World};
use fusion_core::Time;
use nalgebra::{Vector2, Vector3};
use std::collections::VecDeque;

/// A step of the vehicle \[ns\].
const STEP: i64 = 10_000_000;

/// Commands that a vehicle has received: given again, they produce the same motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Script {
    /// Each command with the instant from which it holds, in order.
    pub commands: VecDeque<(Time, Command)>,
    /// When the run ends.
    pub end: Time,
}

/// A controlled vehicle with its mission.
#[derive(Debug)]
pub struct ClosedLoop {
    vehicle: Box<dyn Vehicle>,
    control: Box<dyn Control>,
    rate: f64,
    /// The unfinished tasks; the first is in progress.
    tasks: VecDeque<Box<dyn Task>>,
    leg: Option<Running>,
    record: Record,
    /// The end of the requested path so far; `None` if only the run shows it.
    asked: Option<Vector2<f64>>,
    start: Vector3<f64>,
    command: Command,
    /// The past commands, or in a replay the commands to come.
    script: Script,
    is_replayed: bool,
    /// The ends of the step at hand.
    before: (Time, Motion),
    after: (Time, Motion),
    plane: Plane,
    truth: Truth,
    end: Time,
}

/// A mission, with its vehicle and controller.
#[derive(Debug)]
pub struct Crew {
    /// The vehicle.
    pub vehicle: Box<dyn Vehicle>,
    /// Its controller.
    pub control: Box<dyn Control>,
    /// How often the controller runs \[Hz\].
    pub rate: f64,
    /// The tasks, in order.
    pub tasks: Vec<Box<dyn Task>>,
    /// When the run ends at the latest \[s\].
    pub longest: f64,
}

impl ClosedLoop {
    /// `crew` over `plane`; the world ends with the last task.
    #[must_use]
    pub fn new(crew: Crew, plane: Plane) -> Self {
        let motion = crew.vehicle.motion();
        let nav = plane.nav(&motion);
        Self {
            vehicle: crew.vehicle,
            control: crew.control,
            rate: crew.rate,
            tasks: crew.tasks.into(),
            leg: None,
            record: Record::default(),
            asked: Some(motion.position.xy()),
            start: motion.position,
            command: Command::default(),
            script: Script::default(),
            is_replayed: false,
            before: (Time::default(), motion),
            after: (Time::default(), motion),
            truth: Truth {
                time: Time::default(),
                nav,
                imu: inverse::sample(&nav, &nav, FIRST_STEP, plane.gravity()),
            },
            plane,
            end: Time::from_seconds(crew.longest),
        }
    }

    /// The vehicle of `crew` under the commands of `script`; its controller is ignored.
    #[must_use]
    pub fn replayed(crew: Crew, plane: Plane, script: Script) -> Self {
        let end = script.end;
        Self {
            script,
            is_replayed: true,
            end,
            ..Self::new(crew, plane)
        }
    }

    /// From now on this command holds.
    fn ask(&mut self, command: Command) {
        if command != self.command {
            self.command = command;
            self.script.commands.push_back((self.after.0, command));
        }
    }

    /// How it moves at `time`, within the step at hand.
    fn motion_at(&self, time: Time) -> Motion {
        let ((t0, from), (t1, to)) = (&self.before, &self.after);
        let (dt, whole) = (time.seconds_since(*t0), t1.seconds_since(*t0));
        if whole <= 0.0 {
            return *to;
        }
        let rpy_rate = (to.rpy - from.rpy) / whole;
        if time == *t1 {
            return Motion { rpy_rate, ..*to };
        }
        let share = dt / whole;
        let change = to.velocity - from.velocity;
        Motion {
            position: from.position + (from.velocity + 0.5 * share * change) * dt,
            velocity: from.velocity + share * change,
            rpy: from.rpy + share * (to.rpy - from.rpy),
            rpy_rate,
            ..*to
        }
    }

    /// Where the vehicle truly is, north and east.
    fn place(&self) -> Vector2<f64> {
        let position = self.motion_at(self.truth.time).position;
        Vector2::new(position.x, position.y)
    }

    /// Ends the leg at hand, if there is one.
    fn end_leg(&mut self) {
        if let Some(leg) = self.leg.take() {
            let here = self.place();
            self.record.legs.push(leg.finish(self.truth.time, &here));
        }
    }

    /// The goal of the first task that is not done yet.
    fn goal(&mut self, seen: &Seen) -> Option<Goal> {
        while let Some(task) = self.tasks.front_mut() {
            if self.leg.is_none() {
                task.begin(seen);
                let path = task.path(&self.asked.unwrap_or(seen.position));
                self.record.path.extend(path.map(|ends| ends.map(Into::into)));
                self.asked = if task.is_on_the_spot() {
                    self.asked
                } else {
                    path.map(|[_, end]| end)
                };
                self.control.begin();
                self.leg = Some(Running::new(task.name(), task.target(), self.truth.time));
            }
            if let Some(goal) = task.goal(seen) {
                return Some(goal);
            }
            self.end_leg();
            self.tasks.pop_front();
        }
        None
    }
}

impl World for ClosedLoop {
    fn truth(&self) -> &Truth {
        &self.truth
    }

    fn advance(&mut self, to: Time) -> &Truth {
        while self.after.0 < to {
            let due = |script: &Script, now| script.commands.front().is_some_and(|(from, _)| *from <= now);
            while self.is_replayed && due(&self.script, self.after.0) {
                self.command = self.script.commands.pop_front().map_or(self.command, |(_, command)| command);
            }
            self.before = self.after;
            self.vehicle.step(&self.command, STEP as f64 * 1e-9);
            let motion = self.vehicle.motion();
            self.record.way += (motion.position - self.before.1.position).norm();
            self.after = (self.before.0.shifted(STEP), motion);
        }
        let dt = to.seconds_since(self.truth.time);
        if dt > 0.0 {
            let nav = self.plane.nav(&self.motion_at(to));
            self.truth = Truth {
                time: to,
                nav,
                imu: inverse::sample(&self.truth.nav, &nav, dt, self.plane.gravity()),
            };
        }
        &self.truth
    }

    fn end(&self) -> Time {
        self.end
    }

    /// Those at the end of the step at hand.
    fn tracks(&self) -> Option<[f64; 2]> {
        self.vehicle.tracks()
    }

    fn control_rate(&self) -> Option<f64> {
        (!self.is_replayed).then_some(self.rate)
    }

    fn listens(&self, now: Time) -> bool {
        let stands = self.command == Command::default() && self.leg.is_some();
        !(stands && self.tasks.front().is_some_and(|task| task.is_idle(now)))
    }

    fn steer(&mut self, now: Time, seen: Option<&Seen>) {
        let Some(seen) = seen else {
            self.ask(Command::default());
            return;
        };
        let Some(goal) = self.goal(seen) else {
            self.ask(Command::default());
            self.record.is_done = true;
            self.end = self.end.min(now);
            return;
        };
        let command = self.control.command(&goal, seen);
        self.ask(command);
        self.record.steered(now, self.control.heading());
        let motion = self.motion_at(now.min(self.after.0));
        if let Some(leg) = &mut self.leg {
            leg.add(&goal, &Vector2::new(motion.position.x, motion.position.y), motion.rpy.z);
        }
    }

    fn script(&self) -> Option<Script> {
        (!self.is_replayed).then(|| Script {
            end: self.end,
            ..self.script.clone()
        })
    }

    fn record(&self) -> Option<Record> {
        if self.is_replayed {
            return None;
        }
        let mut record = self.record.clone();
        record
            .legs
            .extend(self.leg.as_ref().map(|leg| leg.finish(self.truth.time, &self.place())));
        record.closure = (self.motion_at(self.truth.time).position - self.start).into();
        Some(record)
    }
}

#[cfg(test)]
mod tests {
    use super::super::spec::SimulationSpec;
    use super::*;
    use crate::earth::Gravity;
    use crate::process::strapdown::mechanisation::step;
    use fusion_core::geometry::so3;
    use fusion_core::geometry::wgs84::Geodetic;

    const WORLD: &str = "longest = 300
        [vehicle.skid_steer]
        gauge = 0.55
        turn_slip = 1.5
        slip = { mean = 0.03, sigma = 0.03 }
        max_speed = 0.5
        max_acceleration = 0.8
        lag = 0.15
        terrain = { sigma = '1 deg', correlation_length = '2 m' }
        [control.autopilot]
        rate = 10
        heading = { proportional = 1.2, integral = 0.3, derivative = 0.2, max_rate = 0.4 }
        line = { look_ahead = 1.5, integral = 0.05 }
        [[mission]]
        wait = { duration = 2 }
        [[mission]]
        go_to = { to = [8, 3], speed = 0.3, radius = 1 }
        [[mission]]
        go_to = { to = [8, -6], from = [8, 3], speed = 0.3 }";

    fn world() -> Box<dyn World> {
        let spec: SimulationSpec = toml::from_str(WORLD).unwrap();
        spec.world(Geodetic::new(0.63, 2.2593, -23.0), Gravity::default(), 1, None).unwrap()
    }

    /// The true state in the plane, for a pilot with a perfect estimate.
    fn seen(world: &ClosedLoop) -> Seen {
        let motion = world.motion_at(world.truth.time);
        Seen {
            time: world.truth.time,
            position: Vector2::new(motion.position.x, motion.position.y),
            heading: motion.rpy.z,
        }
    }

    fn closed() -> ClosedLoop {
        let spec: SimulationSpec = toml::from_str(WORLD).unwrap();
        let crew = spec.crew(spec.vehicle.as_ref().unwrap().0.as_ref(), 1).unwrap();
        ClosedLoop::new(crew, Plane::new(Geodetic::new(0.63, 2.2593, -23.0), Gravity::default()))
    }

    #[test]
    fn perfect_inertial_sensors_reproduce_the_way_of_a_steered_vehicle() {
        let mut world = closed();
        let (mut nav, mut worst, mut k) = (world.truth.nav, [0.0_f64; 3], 0);
        while world.truth.time < world.end() {
            if k % 10 == 0 {
                let seen = seen(&world);
                world.steer(seen.time, Some(&seen));
            }
            k += 1;
            let truth = *world.advance(Time::from_nanos(k * STEP));
            nav = step(&nav, &truth.imu.rate, &truth.imu.force, 0.01, Gravity::default());
            let off = nav.position.difference(&truth.nav.position).norm();
            let slower = (nav.v_eb_n - truth.nav.v_eb_n).norm();
            let turned = so3::log(&(truth.nav.q_nb.inverse() * nav.q_nb)).norm();
            worst = [worst[0].max(off), worst[1].max(slower), worst[2].max(turned)];
        }
        assert!(world.record.is_done && k > 5000, "{k}");
        // 1e-5 m, 1e-6 m/s, 1e-10 rad: position is the integral of velocity. The rest is rounding,
        // which the vertical channel doubles every 400 s, and the curvature of the Earth.
        assert!(worst[0] < 1e-5 && worst[1] < 1e-6 && worst[2] < 1e-10, "{worst:?}");
    }

    #[test]
    fn a_line_is_reached_and_held_to_its_end() {
        let mut world = closed();
        let mut k = 0;
        while world.truth.time < world.end() {
            let seen = seen(&world);
            world.steer(seen.time, Some(&seen));
            k += 1;
            world.advance(Time::from_nanos(k * 10 * STEP));
        }
        let record = world.record().unwrap();
        assert!(record.is_done && record.legs.len() == 3, "{record:?}");
        assert_eq!(record.path, [[[0.0, 0.0], [8.0, 3.0]], [[8.0, 3.0], [8.0, -6.0]]]);
        let line = record.legs[2].across.unwrap();
        // Six look-ahead distances lie between the corner and the end. 10 cm: a slip of 3 % that differs from
        // side to side turns the vehicle by 0.6 deg/s, against which the heading law stands off by 1 deg.
        assert!(line.max > 0.2 && line.last.abs() < 0.1, "{line:?}");
        let end = world.motion_at(world.truth.time).position - world.start;
        // 2 cm along the line: it is left at the least speed of 5 cm/s, ten times a second.
        assert!((end.y + 6.0).abs() < 0.02 && (end.x - 8.0).abs() < 0.1, "{end}");
    }

    #[test]
    fn the_commands_of_a_run_lead_the_same_way_again() {
        let mut world = closed();
        let (mut way, mut k) = (Vec::new(), 0);
        while world.truth.time < world.end() {
            let seen = seen(&world);
            world.steer(seen.time, Some(&seen));
            k += 1;
            way.push(world.advance(Time::from_nanos(k * 10 * STEP)).nav.position);
        }
        let spec: SimulationSpec = toml::from_str(WORLD).unwrap();
        let crew = spec.crew(spec.vehicle.as_ref().unwrap().0.as_ref(), 1).unwrap();
        let plane = Plane::new(Geodetic::new(0.63, 2.2593, -23.0), Gravity::default());
        let mut again = ClosedLoop::replayed(crew, plane, world.script().unwrap());
        assert_eq!(again.end(), world.end());
        assert!(again.control_rate().is_none() && again.script().is_none());
        for (k, place) in way.iter().enumerate() {
            // Asked for at other instants.
            again.advance(Time::from_nanos((10 * k as i64 + 3) * STEP + 1234));
            assert_eq!(again.advance(Time::from_nanos((k as i64 + 1) * 10 * STEP)).nav.position, *place);
        }
    }

    #[test]
    fn what_is_true_does_not_depend_on_the_instants_that_are_asked_for() {
        let (mut coarse, mut fine) = (world(), world());
        for k in 1..=400 {
            let at = |ms: i64| Time::from_nanos(ms * 1_000_000);
            let seen = Seen {
                time: at(30 * k),
                position: Vector2::zeros(),
                heading: 0.2,
            };
            fine.advance(at(30 * k - 17));
            let (a, b) = (*coarse.advance(at(30 * k)), *fine.advance(at(30 * k)));
            assert_eq!((a.nav.position, a.nav.v_eb_n), (b.nav.position, b.nav.v_eb_n));
            coarse.steer(at(30 * k), Some(&seen));
            fine.steer(at(30 * k), Some(&seen));
        }
        assert!(coarse.truth().nav.v_eb_n.norm() > 0.1);
    }
}
