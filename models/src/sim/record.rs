//! How well a controlled vehicle did what it was to do, by the truth.

use super::control::Goal;
use fusion_core::Time;
use fusion_core::geometry::so3::wrap_angle;
use fusion_core::math;
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One task as it was carried out. Errors are true minus wanted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Leg {
    /// The task.
    pub name: String,
    /// When it began \[s\].
    pub from: f64,
    /// When it ended, or the run \[s\].
    pub to: f64,
    /// The heading \[rad\], where one was to be held.
    pub heading: Option<HeadingErrors>,
    /// The distance from the line \[m\], where one was to be followed, right positive.
    pub across: Option<Errors>,
    /// From where it was to end to where it ended: north, east \[m\].
    pub miss: Option<[f64; 2]>,
}

/// Errors over a leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Errors {
    /// Root of the mean square.
    pub rms: f64,
    /// The largest, by its absolute value.
    pub max: f64,
    /// The last one, with its sign.
    pub last: f64,
}

/// Errors of a heading over a leg \[rad\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeadingErrors {
    /// The heading wanted at last.
    pub wanted: f64,
    /// The errors.
    pub errors: Errors,
    /// How far the heading went beyond what was wanted, seen from where it began; 0 where it did not.
    pub overshoot: f64,
}

/// Errors as they are added up.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    count: u32,
    square: f64,
    max: f64,
    last: f64,
}

impl Sum {
    fn add(&mut self, error: f64) {
        self.count += 1;
        self.square += error * error;
        self.max = self.max.max(error.abs());
        self.last = error;
    }

    fn errors(&self) -> Option<Errors> {
        (self.count > 0).then(|| Errors {
            rms: math::sqrt(self.square / f64::from(self.count)),
            max: self.max,
            last: self.last,
        })
    }
}

/// A leg while it is run.
#[derive(Clone, Debug)]
pub(super) struct Running {
    name: String,
    from: Time,
    heading: Sum,
    across: Sum,
    wanted: f64,
    target: Option<Vector2<f64>>,
    /// On which side of the heading wanted it began.
    side: Option<f64>,
    overshoot: f64,
}

impl Running {
    pub(super) fn new(name: String, target: Option<Vector2<f64>>, from: Time) -> Self {
        Self {
            name,
            from,
            target,
            heading: Sum::default(),
            across: Sum::default(),
            wanted: 0.0,
            side: None,
            overshoot: 0.0,
        }
    }

    /// The vehicle truly is at `position`, north and east, with `heading`.
    pub(super) fn add(&mut self, goal: &Goal, position: &Vector2<f64>, heading: f64) {
        match *goal {
            Goal::Stand => return,
            Goal::Heading { heading, .. } => self.wanted = heading,
            Goal::Line { from, course, .. } => {
                self.wanted = course;
                let (sin, cos) = math::sin_cos(course);
                let off = position - from;
                self.across.add(off.y * cos - off.x * sin);
            }
        }
        let error = wrap_angle(heading - self.wanted);
        self.heading.add(error);
        let side = *self.side.get_or_insert(-error.signum());
        self.overshoot = self.overshoot.max(side * error);
    }

    /// The leg where it ends at `to`, the vehicle truly being at `position`.
    pub(super) fn finish(&self, to: Time, position: &Vector2<f64>) -> Leg {
        Leg {
            name: self.name.clone(),
            from: self.from.seconds(),
            to: to.seconds(),
            heading: self.heading.errors().map(|errors| HeadingErrors {
                wanted: self.wanted,
                errors,
                overshoot: self.overshoot,
            }),
            across: self.across.errors(),
            miss: self.target.map(|target| (position - target).into()),
        }
    }
}

/// A mission as it was carried out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Record {
    /// The tasks, in order.
    pub legs: Vec<Leg>,
    /// Whether all of them were done before the end of the run.
    pub is_done: bool,
    /// From where the vehicle truly was at first to where it was at last: north, east, down \[m\].
    pub closure: [f64; 3],
    /// Length of its way \[m\].
    pub way: f64,
    /// The headings that the controller wanted, each with the time from which on \[s, rad\]; none where it wanted
    /// none. Changes below a tenth of a degree are left out. Drawn, not tabulated.
    #[serde(skip)]
    pub headings: Vec<(f64, Option<f64>)>,
    /// The path that the tasks asked for: the ends of each part, north and east of the origin of the run \[m\]. Drawn,
    /// not tabulated.
    #[serde(skip)]
    pub path: Vec<[[f64; 2]; 2]>,
}

/// A heading that has changed by less is the same \[rad\]: a tenth of a degree, the width of a drawn line.
const SAME_HEADING: f64 = 1.7e-3;

impl Record {
    /// From `now` on the vehicle is led to this heading.
    pub(super) fn steered(&mut self, now: Time, heading: Option<f64>) {
        let is_same = |last: Option<f64>| match last.zip(heading) {
            Some((last, wanted)) => wrap_angle(wanted - last).abs() < SAME_HEADING,
            None => last == heading,
        };
        if !self.headings.last().is_some_and(|(_, last)| is_same(*last)) {
            self.headings.push((now.seconds(), heading));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overshoot_is_counted_beyond_the_heading_wanted_whichever_way_the_turn_went() {
        for side in [1.0, -1.0] {
            let mut leg = Running::new("turn".to_owned(), None, Time::default());
            for heading in [0.0, 1.0, 1.75, 1.5, 1.6] {
                let goal = Goal::Heading {
                    heading: side * 1.6,
                    speed: 0.0,
                    to_go: None,
                };
                leg.add(&goal, &Vector2::zeros(), side * heading);
            }
            let heading = leg.finish(Time::from_seconds(5.0), &Vector2::zeros()).heading.unwrap();
            assert!((heading.overshoot - 0.15).abs() < 1e-12 && heading.errors.last.abs() < 1e-12); // rounding
            assert!((heading.errors.max - 1.6).abs() < 1e-12);
        }
    }

    #[test]
    fn a_heading_is_kept_from_when_it_is_wanted_until_it_changes() {
        let mut record = Record::default();
        let wanted = [Some(0.5), Some(0.5005), None, None, Some(0.5), Some(0.6)];
        for (k, heading) in wanted.into_iter().enumerate() {
            record.steered(Time::from_seconds(k as f64), heading);
        }
        assert_eq!(record.headings, [(0.0, Some(0.5)), (2.0, None), (4.0, Some(0.5)), (5.0, Some(0.6))]);
    }

    #[test]
    fn right_of_a_line_is_positive() {
        let mut leg = Running::new("line".to_owned(), None, Time::default());
        let goal = Goal::Line {
            from: Vector2::new(1.0, 0.0),
            course: core::f64::consts::FRAC_PI_2,
            speed: 1.0,
            to_go: 1.0,
        };
        leg.add(&goal, &Vector2::new(0.5, 7.0), 1.5);
        // To the east, south is to the right. 1e-12: rounding.
        assert!((leg.finish(Time::default(), &Vector2::zeros()).across.unwrap().last - 0.5).abs() < 1e-12);
    }
}
