//! Laws of controllers and of tasks.

use crate::registry::Registration;
use crate::sim::{Command, Control, ControlSpec, Goal, Seen, TaskSpec};
use fusion_core::Time;
use fusion_core::math;
use nalgebra::Vector2;

/// Instants tried.
const INSTANTS: i64 = 36_000;

fn seen(k: i64, position: Vector2<f64>, heading: f64) -> Seen {
    Seen {
        time: Time::from_nanos(k * 100_000_000),
        position,
        heading,
    }
}

/// A controller has a rate, asks for nothing where it is to stand, for finite things otherwise, turns
/// towards the heading it is to hold, and forgets with a new task what it has added up.
pub(super) fn control(r: &Registration) -> Result<(), String> {
    let spec: Box<dyn ControlSpec> = r.spec()?;
    let build = || spec.build().map_err(|e| format!("its example does not build: {e}"));
    if !(spec.rate().is_finite() && spec.rate() > 0.0) {
        return Err(format!("it runs at {} Hz", spec.rate()));
    }
    let mut control = build()?;
    if control.command(&Goal::Stand, &seen(0, Vector2::zeros(), 1.0)) != Command::default() {
        return Err("it moves where it is to stand".to_owned());
    }
    let goals = [-2.0, -0.5, 0.5, 2.0].map(|heading| Goal::Heading {
        heading,
        speed: 0.3,
        to_go: None,
    });
    for goal in &goals {
        let Goal::Heading { heading, .. } = *goal else { continue };
        let fresh = build()?.command(goal, &seen(0, Vector2::zeros(), 0.0));
        if !(fresh.turn * heading > 0.0 && fresh.speed.is_finite() && fresh.turn.is_finite()) {
            return Err(format!("to head {heading} rad from 0 it asks for {fresh:?}"));
        }
        let mut control = build()?;
        let first = held(control.as_mut(), goal, 0, heading - 0.1);
        control.begin();
        let again = held(control.as_mut(), goal, 50, heading - 0.1);
        // 1e-9: rounding of fifty sums.
        if (again - first).abs() > 1e-9 {
            return Err(format!(
                "a new task inherits what the one before has added up: {again} for {first} rad/s"
            ));
        }
    }
    Ok(())
}

/// The sum of what it asks for \[rad/s\] in fifty instants from number `from` on, while the heading stays.
fn held(control: &mut dyn Control, goal: &Goal, from: i64, heading: f64) -> f64 {
    let turn = |k| control.command(goal, &seen(from + k, Vector2::zeros(), heading)).turn;
    (0..50).map(turn).sum()
}

/// A task ends within an hour for a vehicle that does at once what is wanted.
pub(super) fn task(r: &Registration) -> Result<(), String> {
    let spec: Box<dyn TaskSpec> = r.spec()?;
    let mut task = spec.build().map_err(|e| format!("its example does not build: {e}"))?;
    if task.name().is_empty() {
        return Err("it has no name".to_owned());
    }
    let (mut position, mut heading) = (Vector2::zeros(), 0.3);
    task.begin(&seen(0, position, heading));
    for k in 0..INSTANTS {
        let run = match task.goal(&seen(k, position, heading)) {
            None => return Ok(()),
            Some(Goal::Stand) => 0.0,
            Some(Goal::Heading {
                heading: wanted, speed, ..
            }) => {
                heading = wanted;
                speed
            }
            Some(Goal::Line { course, speed, .. }) => {
                heading = course;
                speed
            }
        };
        position += Vector2::new(math::cos(heading), math::sin(heading)) * run * 0.1;
    }
    Err("it does not end within an hour".to_owned())
}
