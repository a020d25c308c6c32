//! Compares velocities and positions with one another. If two contradict each other, the other motion channels decide
//! which is right.

use super::clock;
use super::compare::{Compared, sized};
use super::declared::Declaration;
use super::heading::Turned;
use super::judge::{Comparison, Judge};
use super::log::{Told, Track};
use super::mistake::{self, Remedy, differing, turned};
use super::motion::{MIN_SPEED, Velocities, course, headings, slopes};
use super::place;
use super::regression::{FAR, Fit, Fits, NEAR, Pairs, fits, known, vote, wrong_across, wrong_factor};
use super::unit::LONG;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use nalgebra::Vector3;

/// Positions further than this from the origin of the design are wrong \[m\].
const FROM_ORIGIN: f64 = 1e6;
/// ... and further than this from the reference, horizontally and in height. Heights above the sea and above the
/// ellipsoid differ by less.
const FROM_REFERENCE: f64 = 1e3;
const HEIGHT: f64 = 150.0;
/// Mean velocities over this time are also compared, because noise of positions then has less effect \[s\].
const STRIDE: f64 = 5.0;

/// The velocity of a source, or the slope of its position.
pub(super) struct Moved {
    pub(super) track: Track,
    pub(super) name: String,
    pub(super) is_reference: bool,
    pub(super) velocities: Velocities,
}

impl Moved {
    fn is_position(&self) -> bool {
        self.track.channel == "position"
    }

    fn told(&self, seconds: f64) -> Vec<Told> {
        if self.is_position() {
            slopes(&self.track, seconds)
        } else {
            self.velocities.means(seconds)
        }
    }

    /// The agreement of this track, as measured, with another, as expected. For each axis it is the clearest fit over
    /// short and long intervals.
    fn beside(&self, other: &Self) -> Fits {
        let [fast, slow] = [0.0, STRIDE].map(|seconds| {
            let told = other.told(seconds).into_iter();
            let pairs: Pairs = told
                .filter_map(|(from, to, v)| Some((v, self.velocities.mean(from, to)?)))
                .collect();
            fits(&pairs)
        });
        let clearest = core::array::from_fn(|row| match (fast[row], slow[row]) {
            (Some(fast), Some(slow)) if slow.certainty > fast.certainty => Some(slow),
            (fast, slow) => fast.or(slow),
        });
        resolved(clearest)
    }

    /// Pairs of heading and course, while it moves.
    pub(super) fn headings(&self, track: &Track) -> Vec<(f64, f64)> {
        let pairs = headings(track).into_iter().filter_map(|(t, heading)| {
            let v = self.velocities.at(t).filter(|v| v.xy().norm() > MIN_SPEED)?;
            Some((heading, course(&v)))
        });
        pairs.collect()
    }
}

/// Removes the axes with too few samples. Motion faster than the sample rate looks slow. Then velocity and slope agree
/// up to some factor, with either sign. A wrong unit gives a known factor, or the same factor on another axis.
fn resolved(fits: Fits) -> Fits {
    let factor = |row: usize| fits[row].and_then(|f| f.wrong_factor(FAR));
    let is_alone = |row: usize, of: f64| {
        let mut others = (0..3).filter(|other| *other != row).filter_map(factor);
        others.all(|other| math::ln(other / of).abs() > SHARED)
    };
    let is_resolved = |row: usize, fit: &Fit| match factor(row) {
        Some(of) if is_alone(row, of) => (fit.axis, fit.negative) == (row, false) && mistake::is_of_velocities(of),
        _ => true,
    };
    core::array::from_fn(|row| fits[row].filter(|fit| is_resolved(row, fit)))
}

/// Factors of two axes are equal if their logarithms differ by less than this.
const SHARED: f64 = 0.25;

impl Judge<'_> {
    fn moved(&self, track: &Track) -> Moved {
        let name = self.named(track);
        let is_position = track.channel == "position";
        Moved {
            name: if is_position { format!("the slope of {name}") } else { name },
            is_reference: self.is_reference(track),
            velocities: if is_position {
                Velocities::slope(track)
            } else {
                Velocities::of(track)
            },
            track: track.clone(),
        }
    }

    fn remove(&mut self, track: &Track) {
        self.tracks.retain(|t| !t.is(track));
    }

    /// The positions of the filter's own data, and those of the reference.
    fn positions(&self) -> (Vec<Track>, Vec<Track>) {
        self.all("position").into_iter().partition(|t| !self.is_reference(t))
    }

    /// Compares positions with the origin and with the reference.
    pub(super) fn places(&mut self) {
        let origin: Option<Geodetic> = self.design.run.origin.map(Into::into);
        let from_origin = |track: &Track| Some(place::apart(track, |_| origin)?.0);
        for track in self.all("position") {
            if let Some(away) = from_origin(&track).filter(|away| *away > FROM_ORIGIN) {
                let near = self.declared_as(&track, |track| from_origin(track).is_some_and(|away| away < FROM_ORIGIN / 10.0));
                self.astray(&track, "`[run] origin`", &place::shown(away), near);
            }
        }
        let (own, references) = self.positions();
        for (track, reference) in own.iter().flat_map(|t| references.iter().map(move |r| (t, r))) {
            let apart = |track: &Track, from: &Track| place::apart(track, |t| place::at(from, t));
            let Some((across, height, samples)) = apart(track, reference) else {
                continue;
            };
            if across < FROM_REFERENCE && height < HEIGHT {
                let verdict = format!("{} apart, {} in height", place::shown(across), place::shown(height));
                let listed = Comparison::plain(self.named(track), &self.named(reference), samples, verdict);
                self.found.comparisons.push(listed);
                continue;
            }
            let [one, other] = [track, reference].map(|t| self.moved(t));
            let is_reference = self.trust(&one, &other) > self.trust(&other, &one);
            let (wrong, right) = if is_reference { (reference, track) } else { (track, reference) };
            let away = if across < FROM_REFERENCE {
                format!("{} away in height", place::shown(height))
            } else {
                format!("{} away", place::shown(across))
            };
            let near = self.declared_as(wrong, |changed| {
                apart(changed, right).is_some_and(|(across, height, _)| across < FROM_REFERENCE && height < HEIGHT)
            });
            self.astray(wrong, &format!("`{}`", self.name(right)), &away, near);
        }
    }

    /// A position is far from where it should be.
    fn astray(&mut self, track: &Track, from: &str, away: &str, near: Option<(Declaration, Track)>) {
        let message = format!("the positions of `{}` are {away} from {from}", self.name(track));
        let help = match &near {
            Some((other, _)) => other.remedy().after(&format!("the likely mistake is {}", other.wrong)),
            None => Remedy::words(format!("check the columns, their order, signs and unit, or {from}")),
        };
        self.accuse(track, "position-far", "latitude", message, help);
        self.list(track, &from.replace('`', ""), track.times.len(), away);
        self.put_right(track, near);
    }

    /// Continues with a corrected track, or without it.
    fn put_right(&mut self, track: &Track, right: Option<(Declaration, Track)>) {
        match right {
            Some((_, changed)) => self.replace(changed),
            None => self.remove(track),
        }
    }

    /// Compares each velocity with a position and corrects it, first those of the filter's own data.
    pub(super) fn velocities(&mut self) -> Vec<Moved> {
        for track in self.all("velocity") {
            let beside = self.beside(&track, "position");
            if let Some(position) = beside.or_else(|| self.positions().0.into_iter().next()) {
                self.pair(&track, &position);
            }
        }
        // A position without a velocity that agrees.
        let is_own = |t: &Track| !self.is_reference(t);
        if !self.all("velocity").iter().any(is_own) {
            let (own, references) = self.positions();
            if let [reference, ..] = &references[..] {
                own.iter().for_each(|position| self.pair(position, reference));
            }
        }
        let all = self.all("velocity").into_iter().chain(self.all("position"));
        let is_named = |m: &Moved| !m.is_position() || self.beside(&m.track, "velocity").is_none();
        let mut all: Vec<Moved> = all.map(|t| self.moved(&t)).filter(is_named).collect();
        all.retain(|m| m.velocities.times.len() > 1);
        all.sort_by_key(|m| m.is_reference);
        all
    }

    /// Compares a velocity, or the slope of a position, with a position, and corrects the wrong one.
    fn pair(&mut self, track: &Track, position: &Track) {
        let [one, other] = [track, position].map(|t| self.moved(t));
        let fits = one.beside(&other);
        let is_wrong = vote(&fits, NEAR) < 0;
        let trust = if is_wrong {
            self.trust(&one, &other) - self.trust(&other, &one)
        } else {
            0
        };
        // The declaration of the position that agrees with the velocity, if nothing else decides which is wrong.
        let undecided = || self.change(&other, &one).filter(|_| is_wrong && trust == 0 && !one.is_position());
        let change = undecided().map(|(change, _)| change);
        // A velocity is not wrong by the factor between degrees and radians, nor in north and east alone.
        let is_angle = change.as_ref().is_some_and(Declaration::is_unit) || wrong_across(&fits);
        let is_other = is_wrong && (trust > 0 || trust == 0 && !one.is_position() && is_angle);
        if is_other {
            self.slope(&other, &one, &other.beside(&one));
        } else if one.is_position() {
            self.slope(&one, &other, &fits);
        } else {
            let or = change.map(|change| format!("if it is the position that is wrong, {} there", change.remedy().words));
            self.velocity(&one, &other, &fits, or.as_deref());
        }
    }

    /// Reports a velocity beside a position, and corrects it. `or` is the advice if the position is wrong.
    fn velocity(&mut self, wrong: &Moved, right: &Moved, fits: &Fits, or: Option<&str>) {
        let compared = Compared {
            with: &right.name,
            is_world: true,
            limit: NEAR,
            lack: LONG,
            or,
            ..Compared::default()
        };
        let (axes, factor) = self.compare(&wrong.track, fits, &compared);
        if (axes, factor) == (mistake::DECLARED, 1.0) {
            return;
        }
        let put = |v: Vector3<f64>| turned(&v, &axes) * factor;
        let values = wrong.track.values.iter().map(|v| {
            let right = put(Vector3::new(v[0], v[1], v[2]));
            [right.x, right.y, right.z, v[3]]
        });
        self.replace(Track {
            values: values.collect(),
            way: wrong.track.way.iter().map(|(t, way)| (*t, put(*way))).collect(),
            ..wrong.track.clone()
        });
    }

    /// The declaration of a position that makes it agree with another motion.
    fn change(&self, wrong: &Moved, right: &Moved) -> Option<(Declaration, Track)> {
        let before = known(&wrong.beside(right));
        self.declared_as(&wrong.track, |changed| {
            let fits = self.moved(changed).beside(right);
            (0..3).all(|row| before[row].is_none() || known(&fits)[row].is_some()) && vote(&fits, NEAR) > 0
        })
    }

    /// Reports the slope of a position if the position is wrong, or if nothing is wrong.
    fn slope(&mut self, wrong: &Moved, right: &Moved, fits: &Fits) {
        let name = self.name(&wrong.track);
        let verdict = match vote(fits, NEAR) {
            _ if fits.iter().all(Option::is_none) => return,
            1 => "as declared".to_owned(),
            0 => "not decided: no agreement, or too little motion".to_owned(),
            _ => String::new(),
        };
        let mut listed = Comparison::along(name.clone(), &right.name, fits, verdict);
        if listed.verdict.is_empty() {
            let change = self.change(wrong, right);
            let axes = differing(&known(fits), true);
            listed.verdict = match (&change, wrong_factor(fits, NEAR)) {
                (Some((change, _)), _) => change.wrong.clone(),
                (None, _) if !axes.is_empty() => axes,
                (None, Some((small, _))) => sized(small),
                (None, None) => "north and east are in another unit".to_owned(),
            };
            let message = format!(
                "the position of `{name}` contradicts {} and what else shows the motion: {}",
                right.name, listed.verdict
            );
            let check = || Remedy::words("check the columns, their order, signs and unit");
            let help = change.as_ref().map_or_else(check, |(change, _)| change.remedy());
            self.accuse(&wrong.track, "position-form", "latitude", message, help);
            self.put_right(&wrong.track, change);
        }
        self.found.comparisons.push(listed);
    }

    /// The number of other motion channels that agree with this one, minus the number that contradict it; `other` is
    /// left out.
    fn trust(&self, moved: &Moved, other: &Moved) -> i32 {
        let is_asked = |t: &&Track| matches!(t.channel, "velocity" | "position") && !moved.track.is(t) && !other.track.is(t);
        let movers = self
            .tracks
            .iter()
            .filter(is_asked)
            .map(|t| vote(&moved.beside(&self.moved(t)), NEAR));
        let heads = self.tracks.iter().filter(|t| matches!(t.channel, "attitude" | "heading"));
        let heads = heads.map(|t| match Turned::of(&moved.headings(t)) {
            Some(turned) if turned.is_right() => 1,
            Some(turned) if turned.wrong().is_some() => -1,
            _ => 0,
        });
        let unit = |t: &Track| {
            let told = match t.channel {
                "angular_rate" => moved.velocities.course_rates(0.0),
                "specific_force" => moved.velocities.course_forces(0.0),
                _ => return 0,
            };
            vote(&t.fits(&told, clock::usual(t, &told, 0.0)), FAR)
        };
        movers.chain(heads).sum::<i32>() + self.tracks.iter().map(unit).sum::<i32>()
    }
}
