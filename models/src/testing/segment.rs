//! Laws of the segments of a trajectory.

use crate::registry::Registration;
use crate::sim::{Junction, Motion, Segment, SegmentSpec};
use fusion_core::geometry::so3;
use nalgebra::Vector3;

/// Instants tried within a segment.
const INSTANTS: u32 = 500;
/// Half the step of a central difference \[s\].
const H: f64 = 1e-5;

/// A segment starts where the one before has ended, level and unaccelerated, ends so where it says,
/// and in between each quantity is the derivative of the one before, with finite jerk. One that is not
/// smooth may start and end turning.
pub(super) fn check(r: &Registration) -> Result<(), String> {
    let spec: Box<dyn SegmentSpec> = r.spec()?;
    let resting = Junction {
        position: Vector3::new(3.0, -2.0, 1.0),
        heading: 0.7,
        speed: 0.0,
    };
    let mut refusals = String::new();
    let mut accepted = false;
    for from in [resting, Junction { speed: 1.0, ..resting }] {
        match spec.build(&from) {
            Ok(segment) => {
                accepted = true;
                ends(segment.as_ref(), &from)
                    .and_then(|()| between(segment.as_ref()))
                    .map_err(|e| format!("from {} m/s: {e}", from.speed))?;
            }
            Err(e) => refusals += &format!("\nfrom {} m/s: {e}", from.speed),
        }
    }
    if accepted {
        Ok(())
    } else {
        Err(format!("it neither starts at rest nor at 1 m/s:{refusals}"))
    }
}

/// The joins at both ends.
fn ends(segment: &dyn Segment, from: &Junction) -> Result<(), String> {
    let duration = segment.duration();
    if !(duration > 0.0 && duration.is_finite()) {
        return Err(format!("it takes {duration} s"));
    }
    for (end, t, joined) in [("start", 0.0, *from), ("end", duration, segment.end())] {
        let Motion {
            position,
            velocity,
            acceleration,
            rpy,
            rpy_rate,
        } = segment.at(t);
        let ahead = joined.axes().0 * joined.speed;
        // 1e-12 m, rad; 1e-9 otherwise: rounding of polynomials over the whole duration.
        if (position - joined.position).norm() > 1e-12 || (rpy.z - joined.heading).abs() > 1e-12 {
            return Err(format!("at its {end} it is at {position}, heading {}, not at {joined:?}", rpy.z));
        }
        if (velocity - ahead).norm() > 1e-9 {
            return Err(format!("at its {end} it moves at {velocity} and not straight ahead"));
        }
        let jumps = if segment.is_smooth() {
            acceleration.norm().max(rpy_rate.norm())
        } else {
            0.0
        };
        if jumps.max(rpy.xy().norm()) > 1e-9 {
            return Err(format!("at its {end} it is not level, or accelerated, or turns"));
        }
    }
    Ok(())
}

/// Derivatives by central differences.
fn between(segment: &dyn Segment) -> Result<(), String> {
    for k in 1..INSTANTS {
        let t = segment.duration() * f64::from(k) / f64::from(INSTANTS);
        let (a, m, b) = (segment.at(t - H), segment.at(t), segment.at(t + H));
        let turned = so3::log(&(a.attitude().inverse() * b.attitude()));
        for (what, change, derivative) in [
            ("velocity", b.position - a.position, m.velocity),
            ("acceleration", b.velocity - a.velocity, m.acceleration),
            ("rate of roll, pitch and heading", b.rpy - a.rpy, m.rpy_rate),
            ("angular rate", turned, m.angular_rate()),
        ] {
            let numeric = change / (2.0 * H);
            // 1e-6: truncation H²/6 times third derivatives of up to 1e4, rounding 1e-14/H.
            if (numeric - derivative).norm() > 1e-6 {
                return Err(format!("at {t} s its {what} is {derivative}, by central differences {numeric}"));
            }
        }
        // 2H of the jerk, which is at most 80 m/s³ in the examples.
        if (b.acceleration - a.acceleration).norm() > 2.0 * H * 90.0 {
            return Err(format!("at {t} s its acceleration jumps"));
        }
    }
    Ok(())
}
