//! Compares velocities and positions with one another. If two contradict each other, the other motion channels decide
//! which is right.

use super::clock;
use super::heading::Turned;
use super::judge::{Compared, Comparison, Expected, Judge, LONG, known, sized, turned, wrong_factor};
use super::log::Track;
use super::mistake::{self, Remedy, Whole, at, complete, differing};
use super::motion::{MIN_SPEED, Told, Velocities, course, headings, slopes};
use super::place::{self, Change};
use super::regression::{FAR, Fit, NEAR};
use fusion::config::{Diagnostic, Node};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;

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

    fn is(&self, track: &Track) -> bool {
        self.track.source == track.source && self.track.channel == track.channel
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
    fn beside(&self, other: &Self) -> [Option<Fit>; 3] {
        let [fast, slow] = [0.0, STRIDE].map(|seconds| {
            let mut expected = Expected::default();
            let told = other.told(seconds).into_iter();
            let pairs = told.filter_map(|(from, to, v)| Some((v, self.velocities.mean(from, to)?)));
            pairs.for_each(|(v, m)| expected.push_all(&v, m));
            expected.fits()
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

/// Returns true if fits contradict the declaration.
pub(super) fn is_contradicted(fits: &[Option<Fit>; 3], limit: f64) -> bool {
    let known = known(fits);
    let is_other = |row: usize| known[row].is_some_and(|k| k != (row, false));
    (0..3).any(is_other) || wrong_factor(fits, limit).is_some() || wrong_across(fits)
}

/// Returns true if only north and east are wrong by a factor: angles in another unit.
fn wrong_across(fits: &[Option<Fit>; 3]) -> bool {
    let wrong = |row: usize| fits[row].is_some_and(|f| f.wrong_factor(NEAR).is_some());
    wrong(0) && wrong(1) && !wrong(2)
}

/// Removes the axes with too few samples. Motion faster than the sample rate looks slow. Then velocity and slope agree
/// up to some factor, with either sign. A wrong unit gives a known factor, or the same factor on another axis.
fn resolved(fits: [Option<Fit>; 3]) -> [Option<Fit>; 3] {
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

/// A vote for (1) or against (−1).
pub(super) fn vote(fits: &[Option<Fit>; 3], limit: f64) -> i32 {
    match known(fits) {
        _ if is_contradicted(fits, limit) => -1,
        [None, None, None] => 0,
        _ => 1,
    }
}

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

    /// Continues with the corrected track.
    fn replace(&mut self, track: Track) {
        self.mended.push((track.source, track.channel));
        if let Some(old) = self
            .tracks
            .iter_mut()
            .find(|t| t.source == track.source && t.channel == track.channel)
        {
            *old = track;
        }
    }

    fn remove(&mut self, track: &Track) {
        self.tracks.retain(|t| t.source != track.source || t.channel != track.channel);
    }

    /// Compares positions with the origin and with the reference.
    pub(super) fn places(&mut self) {
        let origin: Option<Geodetic> = self.design.run.origin.map(Into::into);
        let from_origin = |track: &Track| Some(place::apart(track, |_| origin)?.0);
        for track in self.all("position") {
            let Some(away) = from_origin(&track).filter(|away| *away > FROM_ORIGIN) else {
                continue;
            };
            let change = Change::ALL.into_iter().filter_map(|change| Some((change, change.of(&track)?)));
            let change = change.filter_map(|(change, track)| Some((from_origin(&track)?, change, track)));
            let nearest = change.filter(|c| c.0 < FROM_ORIGIN / 10.0).min_by(|a, b| a.0.total_cmp(&b.0));
            self.astray(
                &track,
                "`[run] origin`",
                &place::shown(away),
                nearest.map(|(_, change, track)| (change, track)),
            );
        }
        let (references, own): (Vec<Track>, Vec<Track>) = self.all("position").into_iter().partition(|t| self.is_reference(t));
        for (track, reference) in own.iter().flat_map(|t| references.iter().map(move |r| (t, r))) {
            let apart = |track: &Track| place::apart(track, |t| place::at(reference, t));
            let Some((across, height, samples)) = apart(track) else { continue };
            let with = self.named(reference);
            if across < FROM_REFERENCE && height < HEIGHT {
                self.found.comparisons.push(Comparison {
                    what: self.named(track),
                    with,
                    samples,
                    correlation: Vec::new(),
                    margin: 0.0,
                    verdict: format!("{} apart, {} in height", place::shown(across), place::shown(height)),
                });
                continue;
            }
            let [own, other] = [track, reference].map(|t| self.moved(t));
            let wrong = if self.trust(&own, &other) > self.trust(&other, &own) {
                reference
            } else {
                track
            };
            let right = if wrong.source == track.source { reference } else { track };
            let away = if across < FROM_REFERENCE {
                format!("{} away in height", place::shown(height))
            } else {
                format!("{} away", place::shown(across))
            };
            let change = Change::ALL.into_iter().find_map(|change| {
                let changed = change.of(wrong)?;
                let (across, height, _) = place::apart(&changed, |t| place::at(right, t))?;
                (across < FROM_REFERENCE && height < HEIGHT).then_some((change, changed))
            });
            self.astray(wrong, &format!("`{}`", self.name(right)), &away, change);
        }
    }

    /// A position is far from where it should be.
    fn astray(&mut self, track: &Track, from: &str, away: &str, change: Option<(Change, Track)>) {
        let (node, name) = (self.node(track), self.name(track));
        let message = format!("the positions of `{name}` are {away} from {from}");
        let channel = node.at("channels.position");
        let help = match &change {
            Some((change, _)) => {
                let fit = format!("they would fit {}", change.condition());
                match change.remedy(channel) {
                    Some(write) => write.after(&fit),
                    None => Remedy::words(fit),
                }
            }
            None => Remedy::words(format!("check the columns, their order, signs and unit, or {from}")),
        };
        let verdict = away.to_owned();
        let told = help.of(at("position-far", node, "position", "latitude", message), &self.table(track));
        self.found.mistakes.push(told);
        self.found.comparisons.push(Comparison {
            what: name,
            with: from.replace('`', ""),
            samples: track.times.len(),
            correlation: Vec::new(),
            margin: 0.0,
            verdict,
        });
        match change {
            Some((_, changed)) => self.replace(changed),
            None => self.remove(track),
        }
    }

    /// Compares each velocity with a position and corrects it, first those of the filter's own data.
    pub(super) fn velocities(&mut self) -> Vec<Moved> {
        for track in self.all("velocity") {
            let beside = self.beside(&track, "position");
            let own = self.all("position").into_iter().find(|p| !self.is_reference(p));
            if let Some(position) = beside.or(own) {
                self.pair(&track, &position);
            }
        }
        // A position without a velocity that agrees.
        let is_own = |t: &Track| !self.is_reference(t);
        if !self.all("velocity").iter().any(is_own) {
            let (references, own): (Vec<Track>, Vec<Track>) = self.all("position").into_iter().partition(|t| self.is_reference(t));
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
        let trusts = || self.trust(&one, &other) - self.trust(&other, &one);
        let angles = |wrong: &Moved| {
            matches!(
                self.change(wrong, if wrong.is(track) { &other } else { &one }),
                Some((Change::Factor(_), _))
            )
        };
        let is_wrong = is_contradicted(&fits, NEAR);
        let trust = if is_wrong { trusts() } else { 0 };
        let is_other = is_wrong
            && match trust {
                // A velocity is not wrong by the factor between degrees and radians, nor in north and east alone.
                0 => !one.is_position() && (wrong_across(&fits) || angles(&other)),
                by => by > 0,
            };
        let (wrong, right) = if is_other { (&other, &one) } else { (&one, &other) };
        let fits = if is_other { other.beside(&one) } else { fits };
        if wrong.is_position() {
            self.slope(wrong, right, &fits);
            return;
        }
        // If nothing else decides which of the two is wrong.
        let or = (is_wrong && trust == 0 && right.is_position())
            .then(|| self.change(right, wrong))
            .flatten();
        let or = or.and_then(|(change, _)| change.remedy(self.node(&right.track).at("channels.position")));
        let or = or.map(|remedy| format!("if it is the position that is wrong, {} there", remedy.words));
        let compared = Compared {
            with: &right.name,
            is_world: true,
            limit: NEAR,
            lack: LONG,
            shift: 0.0,
            axes: None,
            or: or.as_deref(),
        };
        let (axes, factor) = self.compare(&wrong.track, &fits, &compared);
        if (axes, factor) == (mistake::DECLARED, 1.0) {
            return;
        }
        let put = |v: nalgebra::Vector3<f64>| turned(&v, &axes) * factor;
        let values = wrong.track.values.iter().map(|v| {
            let right = put(nalgebra::Vector3::new(v[0], v[1], v[2]));
            [right.x, right.y, right.z, v[3]]
        });
        self.replace(Track {
            values: values.collect(),
            way: wrong.track.way.iter().map(|(t, way)| (*t, put(*way))).collect(),
            ..wrong.track.clone()
        });
    }

    /// The change of a position that makes it agree with another motion.
    fn change(&self, wrong: &Moved, right: &Moved) -> Option<(Change, Track)> {
        let channel = self.node(&wrong.track).at("channels.position");
        let fits = |track: &Track| self.moved(track).beside(right);
        let before = known(&fits(&wrong.track));
        Change::ALL.into_iter().find_map(|change| {
            change.remedy(channel)?;
            let changed = change.of(&wrong.track)?;
            let fits = fits(&changed);
            let is_told = (0..3).all(|row| before[row].is_none() || known(&fits)[row].is_some());
            (is_told && vote(&fits, NEAR) > 0).then_some((change, changed))
        })
    }

    /// Reports the slope of a position if the position is wrong, or if nothing is wrong.
    fn slope(&mut self, wrong: &Moved, right: &Moved, fits: &[Option<Fit>; 3]) {
        if fits.iter().all(Option::is_none) {
            return;
        }
        let name = self.name(&wrong.track);
        let known = known(fits);
        let list = |verdict: String| Comparison {
            what: name.clone(),
            with: right.name.clone(),
            samples: fits.iter().flatten().map(|f| f.count).max().unwrap_or(0),
            correlation: fits.iter().flatten().map(|f| f.correlation).collect(),
            margin: fits.iter().flatten().filter(|f| f.is_clear()).map(|f| f.margin).fold(0.0, f64::max),
            verdict,
        };
        if !is_contradicted(fits, NEAR) {
            let verdict = match known {
                [None, None, None] => "not decided: no agreement, or too little motion",
                _ => "as declared",
            };
            self.found.comparisons.push(list(verdict.to_owned()));
            return;
        }
        let change = self.change(wrong, right);
        let node = self.node(&wrong.track);
        let channel = node.at("channels.position");
        let whole = complete(known, |row, axis| fits[row].and_then(|f| f.leans(axis)));
        let says = match (&change, differing(&known, true)) {
            (Some((change, _)), _) => change.words(),
            (None, axes) if axes.is_empty() => {
                wrong_factor(fits, NEAR).map_or_else(|| "north and east are in another unit".to_owned(), |f| sized(f.0))
            }
            (None, axes) => axes,
        };
        let help = match &change {
            Some((change, _)) => change.remedy(channel),
            None => whole.and_then(|whole| local(channel, &whole)),
        };
        let message = format!(
            "the position of `{name}` contradicts {} and what else shows the motion: {says}",
            right.name
        );
        let help = help.unwrap_or_else(|| Remedy::words("check the columns, their order, signs and unit"));
        let told: Diagnostic = help.of(
            at("position-form", node, "position", "latitude", message),
            &self.table(&wrong.track),
        );
        self.found.comparisons.push(list(says));
        self.found.mistakes.push(told);
        match change {
            Some((_, changed)) => self.replace(changed),
            None => self.remove(&wrong.track),
        }
    }

    /// The number of other motion channels that agree with this one, minus the number that contradict it; `other` is
    /// left out.
    fn trust(&self, moved: &Moved, other: &Moved) -> i32 {
        let is_asked = |t: &&Track| matches!(t.channel, "velocity" | "position") && !moved.is(t) && !other.is(t);
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
            let fits = Expected::of(t, &told, clock::usual(t, &told, 0.0)).fits();
            vote(&fits, FAR)
        };
        movers.chain(heads).sum::<i32>() + self.tracks.iter().map(unit).sum::<i32>()
    }
}

/// The text for a position given by its distances from the origin. The expected value of a row is at the axis of
/// `whole`.
fn local(channel: Option<&Node>, whole: &Whole) -> Option<Remedy> {
    let keys = ["north", "east", if channel?.get("up").is_some() { "up" } else { "down" }];
    let columns = keys.iter().map(|key| channel?.get(key)?.as_str()).collect::<Option<Vec<&str>>>()?;
    // Up against down.
    let is_up = |row: usize| row == 2 && keys[2] == "up";
    let written = whole
        .axes
        .iter()
        .enumerate()
        .filter(|(row, (axis, negative))| row != axis || *negative);
    let written = written.map(|(row, (axis, negative))| {
        let (minus, name) = columns[*axis]
            .strip_prefix('-')
            .map_or((false, columns[*axis]), |name| (true, name));
        let is_negative = [minus, *negative, is_up(row), is_up(*axis)].iter().filter(|m| **m).count() % 2 == 1;
        (keys[row], format!("{:?}", mistake::signed(name, is_negative)))
    });
    Some(Remedy::write(&written.collect::<Vec<_>>()))
}
