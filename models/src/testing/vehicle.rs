//! Laws of simulated vehicles.

use crate::registry::Registration;
use crate::sim::{Command, Junction, Motion, Vehicle, VehicleSpec};
use fusion_core::math;
use nalgebra::Vector3;

/// A step \[s\].
const DT: f64 = 0.01;
/// Steps tried.
const STEPS: u32 = 3000;

/// A vehicle starts at rest where it is put and stays there without a command; under one it moves, its
/// position is the integral of a velocity that is linear within a step, and a seed is a run.
pub(super) fn check(r: &Registration) -> Result<(), String> {
    let spec: Box<dyn VehicleSpec> = r.spec()?;
    let start = Junction {
        position: Vector3::new(3.0, -2.0, 1.0),
        heading: 0.7,
        speed: 0.0,
    };
    let build = |seed| spec.build(&start, seed).map_err(|e| format!("its example does not build: {e}"));
    let mut vehicle = build(1)?;
    let at_first = vehicle.motion();
    (0..STEPS).for_each(|_| vehicle.step(&Command::default(), DT));
    let left = vehicle.motion();
    if at_first.position != start.position || at_first.rpy.z != start.heading || at_first.velocity.norm() > 0.0 {
        return Err(format!("it does not start where it is put, at rest: {at_first:?}"));
    }
    if left.position != at_first.position || left.rpy != at_first.rpy {
        return Err(format!("it moves without a command: {left:?}"));
    }
    let path = drive(build(1)?.as_mut())?;
    if drive(build(1)?.as_mut())? != path {
        return Err("the same seed gives another run".to_owned());
    }
    let moved = (path[path.len() - 1].position - start.position).norm();
    let is_finite = path.iter().all(|m| m.position.norm().is_finite() && m.rpy.norm().is_finite());
    if is_finite && moved > 0.0 {
        Ok(())
    } else {
        Err(format!("under a command it moves by {moved} m"))
    }
}

fn drive(vehicle: &mut dyn Vehicle) -> Result<Vec<Motion>, String> {
    let mut path = vec![vehicle.motion()];
    for k in 0..STEPS {
        let command = Command {
            speed: 0.2,
            turn: 0.1 * math::sin(0.001 * f64::from(k)),
        };
        vehicle.step(&command, DT);
        let (before, after) = (path[path.len() - 1], vehicle.motion());
        let off = after.position - before.position - 0.5 * (before.velocity + after.velocity) * DT;
        // 1e-12 m: rounding at some metres.
        if off.norm() > 1e-12 {
            return Err(format!(
                "step {k}: its position is no integral of its velocity, by {} m",
                off.norm()
            ));
        }
        path.push(after);
    }
    Ok(path)
}
