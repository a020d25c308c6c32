//! A trajectory: segments one after the other.

use super::sea::SeaSpec;
use super::segment::{Junction, Motion, Segment, SegmentSpec};
use crate::block::BuildError;

/// The motion as a function of time, in local north-east-down.
#[derive(Debug)]
pub struct Trajectory {
    start: Junction,
    /// When each segment starts \[s\], and the segment.
    segments: Vec<(f64, Box<dyn Segment>)>,
    duration: f64,
    sea: Option<SeaSpec>,
}

impl Trajectory {
    /// Builds the segments one after the other from `start`.
    ///
    /// # Errors
    /// [`BuildError`] whose field is `trajectory.i.…`, counted from 0, and whose message counts from 1.
    pub fn new(start: Junction, specs: &[Box<dyn SegmentSpec>]) -> Result<Self, BuildError> {
        let mut segments = Vec::with_capacity(specs.len());
        let (mut at, mut duration) = (start, 0.0);
        for (i, spec) in specs.iter().enumerate() {
            let segment = spec.build(&at).map_err(|mut e| {
                e.message = format!("segment {}: {}", i + 1, e.message);
                e.within(format!("trajectory.{i}"))
            })?;
            at = segment.end();
            let starts = duration;
            duration += segment.duration();
            segments.push((starts, segment));
        }
        if !(duration.is_finite() && duration > 0.0) {
            let help = "add a segment, such as { type = \"rest\", duration = \"60 s\" }";
            return Err(BuildError::at("trajectory", "the trajectory takes no time").help(help));
        }
        Ok(Self {
            start,
            segments,
            duration,
            sea: None,
        })
    }

    /// The same, in this sea.
    #[must_use]
    pub fn at_sea(self, sea: SeaSpec) -> Self {
        Self { sea: Some(sea), ..self }
    }

    /// Seconds from start to end.
    #[must_use]
    pub const fn duration(&self) -> f64 {
        self.duration
    }

    /// Where it starts.
    #[must_use]
    pub const fn start(&self) -> Junction {
        self.start
    }

    /// When each segment starts \[s\].
    pub fn starts(&self) -> impl Iterator<Item = f64> {
        self.segments.iter().map(|(starts, _)| *starts)
    }

    /// The motion `t` seconds after the start; held at the ends.
    #[must_use]
    pub fn at(&self, t: f64) -> Motion {
        let t = t.clamp(0.0, self.duration);
        let after = self.segments.partition_point(|(starts, _)| *starts <= t);
        let mut motion = match self.segments.get(after.saturating_sub(1)) {
            Some((starts, segment)) => segment.at((t - starts).min(segment.duration())),
            None => Motion::default(),
        };
        if let Some(sea) = &self.sea {
            sea.carry(t, &mut motion);
        }
        motion
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, PI};
    use nalgebra::Vector3;

    const START: Junction = Junction {
        position: Vector3::new(3.0, -2.0, 1.0),
        heading: 0.7,
        speed: 0.0,
    };

    #[derive(serde::Deserialize)]
    struct File {
        trajectory: Vec<Box<dyn SegmentSpec>>,
    }

    /// From segments as typetag reads them by itself: `{ rest = { … } }`.
    fn trajectory(start: Junction, segments: &str) -> Result<Trajectory, BuildError> {
        let file: File = toml::from_str(&format!("trajectory = [{segments}]")).unwrap();
        Trajectory::new(start, &file.trajectory)
    }

    fn from_origin(heading: f64, segments: &str) -> Trajectory {
        trajectory(
            Junction {
                position: Vector3::zeros(),
                heading,
                speed: 0.0,
            },
            segments,
        )
        .unwrap()
    }

    fn assert_ends(t: &Trajectory, position: [f64; 3], heading: f64) {
        let end = t.at(t.duration());
        // 1e-10 m, 1e-12 rad: rounding over minutes.
        assert!((end.position - Vector3::from(position)).norm() < 1e-10, "{}", end.position);
        assert!((end.rpy.z - heading).abs() < 1e-12, "{}", end.rpy.z);
    }

    #[test]
    fn turns_end_where_the_arc_would_and_hold_its_radius_nearly() {
        for (angle, n, e) in [(90.0, 5.0, 5.0), (180.0, 0.0, 10.0), (-90.0, 5.0, -5.0), (270.0, -5.0, 5.0)] {
            let angle = f64::to_radians(angle);
            let text = format!("{{ straight = {{ distance = 20, speed = 1 }} }}, {{ turn = {{ angle = {angle}, radius = 5 }} }}");
            let t = from_origin(0.0, &text);
            assert_ends(&t, [20.0 + n, e, 0.0], angle);
            assert!((t.at(t.duration()).velocity.norm() - 1.0).abs() < 1e-14);
        }
        let t = from_origin(
            0.0,
            "{ straight = { distance = 20, speed = 1 } }, { turn = { angle = 1.5707963267948966, rate = '0.2 rad/s' } }",
        );
        assert_ends(&t, [25.0, 5.0, 0.0], FRAC_PI_2);
        let start = t.starts().nth(1).unwrap();
        let middle = t.at(0.5 * (start + t.duration()));
        // The ramps take their share: the steady arc is a fifth tighter.
        let radius = 1.0 / middle.acceleration.norm();
        assert!((3.9..4.0).contains(&radius), "{radius}");
    }

    #[test]
    fn banked_turn_feels_no_side_force() {
        let t = from_origin(
            0.0,
            "{ straight = { distance = 300, speed = 20, acceleration = 2 } }, { turn = { angle = 1.5, radius = 80, bank = true } }",
        );
        let start = t.starts().nth(1).unwrap();
        for k in 0..100 {
            let m = t.at(start + (t.duration() - start) * f64::from(k) / 100.0);
            let force = m.attitude().inverse() * (m.acceleration - Vector3::new(0.0, 0.0, crate::units::STANDARD_GRAVITY));
            assert!(force.y.abs() < 1e-12, "{}", force.y); // rounding at 10 m/s²
        }
    }

    #[test]
    fn the_u_path_ends_ninety_metres_east() {
        let t = from_origin(
            0.0,
            "{ rest = { duration = '60 s' } }, { straight = { distance = 55, speed = 1 } }, \
             { turn = { angle = '90 deg', radius = 5 } }, { straight = { distance = 80 } }, \
             { turn = { angle = '90 deg', radius = 5 } }, { straight = { distance = 55, end_speed = 0 } }",
        );
        assert_ends(&t, [0.0, 90.0, 0.0], PI);
        let turns: Vec<f64> = t.starts().collect();
        assert!((t.at(turns[3]).rpy.z - FRAC_PI_2).abs() < 1e-14);
        assert_eq!(t.at(59.9).velocity, Vector3::zeros());
        // 190 m + two arcs of 7.85 m at 1 m/s, 60 s of rest, 9.4 s for speeding up and braking.
        assert!((t.duration() - 275.1).abs() < 2.0, "{}", t.duration());
    }

    #[test]
    fn two_loops_close() {
        let side = "{ straight = { distance = 20, speed = 1 } }, { turn = { angle = '90 deg', radius = 5 } }";
        let rectangles = from_origin(0.3, &[side; 8].join(", "));
        assert_ends(&rectangles, [0.0; 3], 0.3 + 4.0 * PI);
        let half = "{ turn = { angle = '180 deg', radius = 5 } }";
        let circles = format!("{{ straight = {{ distance = 20, speed = 1 }} }}, {}", [half; 4].join(", "));
        assert_ends(&from_origin(0.0, &circles), [20.0, 0.0, 0.0], 4.0 * PI);
    }

    #[test]
    fn twenty_metres_east_slightly_crooked() {
        let t = from_origin(
            FRAC_PI_2,
            "{ rest = { duration = 10 } }, \
             { sine = { distance = '20 m', amplitude = '0.5 m', wavelength = '20 m', speed = '1 m/s', end_speed = 0 } }",
        );
        assert_ends(&t, [0.0, 20.0, 0.0], FRAC_PI_2);
        let north: Vec<f64> = (0..4000).map(|k| t.at(t.duration() * f64::from(k) / 4000.0).position.x).collect();
        // Right of east is south first. 1e-2: the fade moves the peak slightly.
        let (low, high) = north.iter().fold((0.0_f64, 0.0_f64), |(l, h), x| (l.min(*x), h.max(*x)));
        assert!((low + 0.5).abs() < 1e-2 && (high - 0.5).abs() < 1e-2, "{low} {high}");
        for k in 0..4000 {
            let m = t.at(t.duration() * f64::from(k) / 4000.0);
            let (s, c) = m.rpy.z.sin_cos();
            assert!((m.velocity.x * s - m.velocity.y * c).abs() < 1e-14, "the nose is along the path");
        }
    }

    #[test]
    fn the_distorted_square_reaches_its_corners_in_time() {
        let corners = [
            (0.0_f64, 0.0_f64, 0.0_f64),
            (70.0, -1.0, -17.5),
            (150.0, -16.0, -16.0),
            (180.0, -16.0, -7.5),
            (240.0, -15.0, 1.5),
            (307.0, 0.0, -6.0),
        ];
        let leg = |k: usize| {
            let ((t0, n0, e0), (t1, n1, e1)) = (corners[k], corners[k + 1]);
            ((e1 - e0).atan2(n1 - n0), f64::hypot(n1 - n0, e1 - e0), t1 - t0)
        };
        let (mut heading, mut segments) = (leg(0).0, Vec::new());
        let start = heading;
        for k in 0..5 {
            let (bearing, distance, time) = leg(k);
            let turn = fusion_core::state::wrap(bearing - heading);
            let turning = if k == 0 { 0.0 } else { 4.0 / 3.0 * turn.abs() / 0.5 };
            if k > 0 {
                segments.push(format!("{{ rotate_in_place = {{ angle = {turn}, rate = 0.5 }} }}"));
            }
            let bump = if k == 3 { 1.0 } else { 0.0 };
            if k == 3 {
                segments.push(
                    "{ bump = { duration = 1, height = -0.05, pitch = '8 deg', heading = '5 deg', velocity = [0.6, 0, 0] } }".to_owned(),
                );
            }
            // Speed v for which distance = v (T − 1.875 v/a); the second term is the loss in the two ramps.
            let (whole, ramp) = (time - turning - bump, 1.875 / 0.8);
            let speed = (whole - (whole * whole - 4.0 * ramp * distance).sqrt()) / (2.0 * ramp);
            segments.push(format!(
                "{{ straight = {{ distance = {distance}, speed = {speed}, end_speed = 0, acceleration = 0.8 }} }}"
            ));
            heading += turn;
        }
        let t = from_origin(start, &segments.join(", "));
        for (time, north, east) in corners {
            let height = if time > 180.5 { 0.05 } else { 0.0 };
            // 1e-9 m: rounding, and the slow end of a ramp where the corner is met a rounding late.
            assert!(
                (t.at(time).position - Vector3::new(north, east, height)).norm() < 1e-9,
                "{time} {}",
                t.at(time).position
            );
        }
        assert!((t.duration() - 307.0).abs() < 1e-9);
        let after = t.starts().find(|s| *s > 180.0 + 1e-9).unwrap();
        let jolt: Vec<Motion> = (0..1000).map(|k| t.at(after + f64::from(k) * 1e-3)).collect();
        let greatest = |f: fn(&Motion) -> f64| jolt.iter().map(f).fold(f64::MIN, f64::max);
        assert!((greatest(|m| m.velocity.x.abs()) - 0.6).abs() < 1e-4); // grid of 1 ms
        assert!((greatest(|m| m.rpy.y.to_degrees()) - 8.0).abs() < 1e-3);
    }

    #[test]
    fn a_climb_gains_its_height_with_the_nose_along_the_path() {
        let t = from_origin(
            0.0,
            "{ straight = { distance = 20, speed = 1 } }, { climb = { height = 3, distance = 20 } }",
        );
        assert_ends(&t, [40.0, 0.0, -3.0], 0.0);
        let middle = t.at(t.duration() - 10.0);
        assert!((middle.rpy.y - (-middle.velocity.z / middle.velocity.x).atan()).abs() < 1e-15 && middle.rpy.y > 0.2);
    }

    #[test]
    fn what_cannot_be_driven_names_the_segment_and_the_field() {
        let field = |segments| trajectory(START, segments).unwrap_err().field;
        assert_eq!(field("{ turn = { angle = 1, radius = 5 } }"), "trajectory.0");
        assert_eq!(
            field("{ straight = { distance = 20, speed = 1 } }, { rest = { duration = 1 } }"),
            "trajectory.1"
        );
        assert_eq!(field("{ straight = { distance = 1, speed = 1 } }"), "trajectory.0.distance");
        assert_eq!(field("{ straight = { distance = 20 } }"), "trajectory.0.speed");
        assert_eq!(
            field("{ straight = { distance = 20, speed = 1 } }, { turn = { angle = 7, radius = 5 } }"),
            "trajectory.1.angle"
        );
        assert_eq!(field(""), "trajectory");
    }

    #[test]
    fn the_ends_hold() {
        let t = from_origin(0.0, "{ straight = { distance = 20, speed = 1, end_speed = 0 } }");
        assert_eq!(t.at(-5.0), t.at(0.0));
        assert_eq!(t.at(1e3), t.at(t.duration()));
    }
}
