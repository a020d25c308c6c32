//! Compares headings with courses.

use super::judge::{Comparison, Judge};
use super::log::Track;
use super::mistake::Remedy;
use super::world::Moved;
use crate::inspect::direction;
use fusion_core::math;

/// Agreement of headings with courses: length and direction of the mean of e^{i(course − heading)} and e^{i(course +
/// heading)}.
pub(super) struct Turned {
    pub(super) along: (f64, f64),
    pub(super) against: (f64, f64),
}

/// From this length of the mean, the agreement is not by chance.
const TIED: f64 = 0.9;

impl Turned {
    /// `None` if the course did not turn enough to distinguish `along` from `against`.
    pub(super) fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let mean = |of: fn(&(f64, f64)) -> f64| direction(pairs.iter().map(of));
        let has_turned = pairs.len() >= 50 && mean(|p| p.1).0 < 0.8;
        has_turned.then(|| Self {
            along: mean(|p| p.1 - p.0),
            against: mean(|p| p.1 + p.0),
        })
    }

    /// The mistake, and the text to write.
    pub(super) fn wrong(&self) -> Option<(String, Remedy)> {
        let quarters = |angle: f64| math::round(angle / core::f64::consts::FRAC_PI_2);
        let near = |angle: f64| (angle - quarters(angle) * core::f64::consts::FRAC_PI_2).abs() < 0.4;
        let ((along, offset), (against, sum)) = (self.along, self.against);
        if along > TIED && near(offset) && quarters(offset) != 0.0 {
            let degrees = quarters(offset) * 90.0;
            let help =
                format!("add {degrees} deg to the heading: an `offset`, a `rotation` or a `navigation_rotation`; or the vehicle moves so");
            return Some((format!("the course is {degrees}° clockwise of it"), Remedy::words(help)));
        }
        if against > TIED && along < 0.7 && near(sum) {
            let from = ["north", "east", "south", "west"][(quarters(sum) as i64).rem_euclid(4) as usize];
            let minus = "write a minus before the name of its column, as in `\"-NAME\"`";
            let help = match from {
                "east" => format!(
                    "from east-north-up, write `navigation_rotation = {{ axes = [\"y\", \"x\", \"-z\"] }}`; of roll, pitch, yaw: {minus}, with \
                     the `offset` `\"90 deg\"`"
                ),
                "north" => format!("{minus}, or of a quaternion the opposite of its `inverse`"),
                _ => format!("{minus}, with the `offset` `\"{} deg\"`", 90.0 * quarters(sum)),
            };
            return Some((format!("it is counted anti-clockwise from {from}"), Remedy::words(help)));
        }
        None
    }

    /// Returns true if the heading follows the course, with any rotation or sign.
    pub(super) fn is_tied(&self) -> bool {
        self.along.0.max(self.against.0) > TIED
    }

    /// Returns true if the heading agrees with the course as declared.
    pub(super) fn is_right(&self) -> bool {
        self.along.0 > TIED && self.wrong().is_none()
    }
}

impl Judge<'_> {
    /// Compares headings with the course. Returns true if they do not contradict each other.
    pub(super) fn heading(&mut self, track: &Track, moved: &Moved) -> bool {
        let (pairs, with) = (moved.headings(track), format!("the course of {}", moved.name));
        let Some(agreed) = Turned::of(&pairs) else {
            self.list(
                track,
                &with,
                0,
                "not judged: a course that goes round, at more than 2 m/s, would tell",
            );
            return true;
        };
        // A heading that does not follow the course may be in another unit.
        let follows = |other: &Track| Turned::of(&moved.headings(other)).is_some_and(|turned| turned.is_right());
        let other = || {
            let is_heading = track.channel == "heading" && !agreed.is_tied();
            let (other, _) = Some(track)
                .filter(|_| is_heading)
                .and_then(|track| self.declared_as(track, follows))?;
            Some((format!("it goes with the course as `{}`", other.listed()), other.remedy()))
        };
        let wrong = agreed.wrong().or_else(other);
        let verdict = wrong
            .as_ref()
            .map_or("as declared, or not tied to the course", |(what, _)| what.as_str());
        self.found.comparisons.push(Comparison {
            correlation: vec![agreed.along.0.max(agreed.against.0)],
            ..Comparison::plain(self.name(track), &with, pairs.len(), verdict)
        });
        let Some((what, help)) = wrong else { return true };
        let message = format!(
            "the heading of `{}` is not what is declared, clockwise from north: {what}",
            self.name(track)
        );
        self.accuse(track, "heading-form", "quaternion", message, help);
        false
    }
}
