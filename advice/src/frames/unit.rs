//! Compares inertial units with the motion that attitudes and velocities show.

use super::clock::{self, Clocks};
use super::compare::Compared;
use super::judge::Judge;
use super::log::Told;
use super::log::Track;
use super::mistake::shifted;
use super::motion::{self, Attitudes, GRAVITY, Velocities};
use super::regression::{self, ENOUGH, FAR, Fits, Known, NEAR, Pairs, known};
use super::upright::Upright;
use super::world::Moved;
use fusion::config::{Diagnostics, Node};
use fusion_models::units::Duration;
use nalgebra::Vector3;

/// An attitude to compare the instruments with.
pub(super) struct Seen {
    pub(super) source: usize,
    pub(super) name: String,
    pub(super) attitudes: Attitudes,
}

/// The motion of a unit that other channels show: by an attitude, or else by a course.
#[derive(Clone, Copy)]
pub(super) struct Shown<'a> {
    pub(super) attitude: Option<&'a Seen>,
    pub(super) moved: Option<&'a Moved>,
    /// The delay of its stamps \[s\].
    pub(super) shift: f64,
}

impl Shown<'_> {
    /// The rotation, over at least `seconds` if a course shows it.
    fn turns(&self, seconds: f64) -> Vec<Told> {
        match (self.attitude, self.moved) {
            (Some(seen), _) => seen.attitudes.turns().collect(),
            (None, moved) => moved.map_or_else(Vec::new, |moved| moved.velocities.course_rates(seconds)),
        }
    }

    /// The specific force, likewise.
    fn forces(&self, seconds: f64) -> Vec<Told> {
        match (self.attitude, self.moved) {
            (Some(seen), moved) => seen.attitudes.forces(moved.map(|m| &m.velocities)),
            (None, moved) => moved.map_or_else(Vec::new, |moved| moved.velocities.course_forces(seconds)),
        }
    }

    /// The lag of a channel.
    fn lag(&self, track: &Track, told: &[Told]) -> f64 {
        let seek = if self.attitude.is_some() { clock::sought } else { clock::usual };
        seek(track, told, self.shift)
    }

    /// The shift to report: the clock shift, or an early lag that smoothing in both directions does not explain \[s\].
    fn early(&self, lag: f64) -> f64 {
        if self.attitude.is_some() && lag - self.shift < -0.25 {
            lag
        } else {
            self.shift
        }
    }

    /// The fits of a channel. Also returns whether slow motion, which is asked for if a course shows the motion,
    /// replaced a result.
    fn fits(&self, track: &Track, fast: &[Told], slow: impl Fn() -> Vec<Told>, lag: f64) -> (Fits, bool) {
        let mut fits = track.fits(fast, lag);
        let is_doubtful = self.attitude.is_none() && doubt(&mut fits, &track.fits(&slow(), lag));
        (fits, is_doubtful)
    }
}

/// The axes of a specific force that the data determine, and the factor by which it is too small.
type Force = (Known, f64);

impl Judge<'_> {
    /// Judges each inertial unit.
    pub(super) fn instruments(&mut self, velocities: &[Moved], attitude: Option<&Seen>) {
        let moved = velocities.first();
        for track in self.all("specific_force") {
            let rates = self.beside(&track, "angular_rate");
            let shift = rates.as_ref().map_or(0.0, |rates| self.clocks(rates, velocities, attitude));
            let shown = Shown { attitude, moved, shift };
            let force = self.force(&track, rates.as_ref(), shown);
            if let Some(rates) = rates {
                self.rates(&rates, Some((&track, force)), shown);
            }
        }
        for rates in self.all("angular_rate") {
            if self.beside(&rates, "specific_force").is_none() {
                let shift = self.clocks(&rates, velocities, attitude);
                self.rates(&rates, None, Shown { attitude, moved, shift });
            }
        }
    }

    /// Compares the stamps of a unit with those of each source that measures rotation. Returns the delay of that
    /// source's stamps \[s\].
    fn clocks(&mut self, rates: &Track, velocities: &[Moved], attitude: Option<&Seen>) -> f64 {
        let mut told: Vec<(usize, &str, Vec<Told>)> = Vec::new();
        if let Some(seen) = attitude {
            told.push((seen.source, &seen.name, seen.attitudes.turns().collect()));
        }
        for moved in velocities {
            if told.iter().all(|(source, ..)| *source != moved.track.source) {
                told.push((moved.track.source, &moved.name, moved.velocities.course_rates(0.0)));
            }
        }
        told.retain(|(source, ..)| *source != rates.source);
        let seen = attitude.map(|seen| seen.source);
        let clocks: Vec<Clocks> = told
            .iter()
            .map(|(source, _, legs)| clock::compare(rates, legs, &self.delays(*source, |_| true), seen != Some(*source)))
            .collect();
        let apart = told.iter().zip(&clocks).filter_map(|((source, name, _), clocks)| match clocks {
            // A declared delay is not a clock error.
            Clocks::Apart(shift) => {
                let declared = self.delays(*source, |kind| kind.ends_with("velocity"));
                Some((*source, *name, shift - declared.first().unwrap_or(&0.0)))
            }
            _ => None,
        });
        // If a source agrees with the unit, the other sources are wrong. Otherwise the unit is.
        let (all, unit): (Vec<(usize, &str, f64)>, _) = (apart.collect(), self.name(rates));
        let wrong: Vec<_> = if clocks.contains(&Clocks::Together) {
            all.iter().map(|(source, name, by)| (*source, -by, &unit[..], *name)).collect()
        } else {
            all.first()
                .map(|(_, name, by)| (rates.source, *by, *name, &unit[..]))
                .into_iter()
                .collect()
        };
        for (source, by, with, what) in wrong {
            let named = &self.design.sources[source];
            let way = if by > 0.0 { "early" } else { "late" };
            let message = format!(
                "the stamps of `{}` are about {:.2} s {way}: shifted by that, `{what}` agrees best with `{with}`",
                named.name,
                by.abs()
            );
            let told = shifted(named, by, message, ", or find out which of the two clocks is wrong");
            self.found.mistakes.push(told);
        }
        match clocks.first() {
            Some(Clocks::Apart(shift)) => *shift,
            _ => 0.0,
        }
    }

    /// The delays that the design declares for sensors of a type that read a source \[s\].
    fn delays(&self, source: usize, is_asked: impl Fn(&str) -> bool) -> Vec<f64> {
        let name = &self.design.sources[source].name;
        let says = |node: &Node, key: &str, is: &dyn Fn(&str) -> bool| node.get(key).and_then(Node::as_str).is_some_and(is);
        let sensors = self.design.sensors.iter().map(|sensor| &sensor.node);
        let of = sensors.filter(|node| says(node, "source", &|source| source == name) && says(node, "type", &is_asked));
        let declared = of.filter_map(|node| {
            let offset = node.get("time_offset")?;
            let offset: Duration = offset.get("initial").unwrap_or(offset).read(&mut Diagnostics::new())?;
            Some(offset.si())
        });
        declared.collect()
    }

    /// Compares a specific force with gravity and with the motion, for times at which the gyros show hardly any
    /// rotation. Returns the correction.
    fn force(&mut self, track: &Track, rates: Option<&Track>, shown: Shown<'_>) -> Force {
        let mut fast = shown.forces(0.0);
        let lag = shown.lag(track, &fast);
        // A foot swings between two attitude samples. Then neither these samples nor the midpoint between them give the
        // mean.
        if let Some(rates) = rates.filter(|_| shown.attitude.is_some()) {
            fast.retain(|told| turns_little(rates, told, lag));
        }
        let (mut fits, is_doubtful) = shown.fits(track, &fast, || shown.forces(SLOW), lag);
        let mut with = match (shown.attitude, shown.moved) {
            (Some(seen), _) => format!("gravity in the attitude of `{}`", seen.name),
            (None, Some(moved)) => format!("the accelerations of {}", moved.name),
            (None, None) => "gravity".to_owned(),
        };
        let mut factor = 1.0;
        if let Some(upright) = Upright::of(track) {
            fits[2] = Some(upright.fit());
            // Gravity determines the unit better than accelerations do.
            factor = if upright.is_wrong() { GRAVITY / upright.size } else { 1.0 };
            fits.iter_mut().take(2).flatten().for_each(|f| f.factor = [factor; 2]);
            if shown.attitude.is_none() && shown.moved.is_some() {
                with = format!("gravity and {with}");
            }
        }
        let lack = match track.pairs(&fast, lag).len() {
            _ if shown.attitude.is_none() && shown.moved.is_none() => ALONE.to_owned(),
            0 => LONG.to_owned(),
            count => format!("not judged: both show {count} intervals of little turn, {ENOUGH} are needed"),
        };
        let compared = Compared {
            with: &with,
            limit: if factor == 1.0 { FAR } else { NEAR },
            lack: &lack,
            shift: shown.early(lag),
            ..Compared::default()
        };
        self.compare(track, &fits, &compared);
        if let (None, Some(moved), [None, None, Some(_)]) = (shown.attitude, shown.moved, &fits) {
            self.list(track, &format!("the accelerations of {}", moved.name), 0, FAST);
        }
        if is_doubtful {
            self.list(track, &format!("the accelerations over {SLOW} s"), 0, WAVES);
        }
        (known(&fits), factor)
    }

    /// Compares angular rates with the rotation of the attitude, or of the course and of gravity.
    fn rates(&mut self, track: &Track, force: Option<(&Track, Force)>, shown: Shown<'_>) {
        let with = match (shown.attitude, shown.moved) {
            (Some(seen), _) => format!("the turns of `{}`", seen.name),
            (None, Some(moved)) => format!("the turns of {}", moved.name),
            (None, None) => return self.list(track, "turns that something else shows", 0, ALONE),
        };
        let fast = shown.turns(0.0);
        let lag = shown.lag(track, &fast);
        let (mut fits, is_doubtful) = shown.fits(track, &fast, || shown.turns(SLOW), lag);
        let axes = force.and_then(|(_, (known, _))| Some([known[0]?, known[1]?, known[2]?]));
        if let (false, None, Some(moved), Some((forces, right))) = (is_doubtful, shown.attitude, shown.moved, force) {
            let tilts = regression::fits(&tilts(track, forces, right, lag, &moved.velocities));
            (fits[0], fits[1]) = (tilts[0], tilts[1]);
        }
        // A correct attitude determines all axes of a unit that turns about all axes.
        let doubt = shown.attitude.filter(|_| known(&fits).contains(&None));
        let doubt = doubt.map(|seen| {
            format!(
                "if `{}` is wrong, check the order of its numbers, `inverse` and its axes",
                seen.name
            )
        });
        let (limit, lack) = if shown.attitude.is_some() { (NEAR, LONG) } else { (FAR, FAST) };
        let compared = Compared {
            with: &with,
            limit,
            lack,
            shift: shown.early(lag),
            axes,
            or: doubt.as_deref(),
            ..Compared::default()
        };
        self.compare(track, &fits, &compared);
        if is_doubtful {
            self.list(track, &format!("the turns over {SLOW} s"), 0, WAVES);
        }
    }
}

/// Returns true if a unit turns so little in an interval, `lag` earlier, that the midpoint attitude gives the mean.
pub(super) fn turns_little(rates: &Track, (from, to, _): &Told, lag: f64) -> bool {
    let rate = rates.mean_length(from - lag, to - lag);
    rate.is_none_or(|rate| rate * (to - from) < motion::MUCH)
}

/// The data that would be enough to judge by a course ...
const FAST: &str = "not judged: a minute of turns at more than 2 m/s would tell";
/// ... and without a course.
pub(super) const LONG: &str = "not judged: both together for a minute would tell";
/// The text if no other channel measures motion.
const ALONE: &str = "not judged: an attitude, or a velocity of more than 2 m/s, would tell";

/// Longer than waves and than the steps of a walk \[s\]. A result from a course must also hold over such intervals.
const SLOW: f64 = 15.0;
/// The text if it does not hold.
const WAVES: &str = "not decided: waves, or other fast motion, say something else";

/// Checks fast motion against slow motion. If fast motion contradicts the declaration and slow motion does not confirm
/// it, the result of slow motion replaces it. Returns true if anything was replaced.
///
/// Means over an interval between two velocities are right for any length. But an antenna on a mast moves relative to a
/// rolling boat, once or twice between two fixes.
fn doubt(fast: &mut Fits, slow: &Fits) -> bool {
    let mut is_doubtful = false;
    for (fast, slow) in fast.iter_mut().zip(slow) {
        let Some(told) = fast.as_ref().filter(|fit| fit.is_other()) else {
            continue;
        };
        let is_confirmed = slow.as_ref().map_or(told.correlation >= PLAIN, |slow| {
            (told.axis, told.negative) == (slow.axis, slow.negative) && slow.confirms()
        });
        if !is_confirmed {
            (*fast, is_doubtful) = (slow.filter(|s| !s.is_other()), true);
        }
    }
    is_doubtful
}

/// The correlation at which fast motion alone is accepted, if slow motion is too short to decide. Waves and the slower
/// motion share an axis only in part; a mistake affects the whole axis.
const PLAIN: f64 = 0.8;
/// The rotation of gravity in the axes of a vehicle, which its roll and pitch rates cause. It is the change of the
/// specific force minus the accelerations along the course, from one interval to the next. An unknown axis of the force
/// gives no expected value.
fn tilts(rates: &Track, forces: &Track, (known, factor): Force, lag: f64, velocities: &Velocities) -> Pairs {
    let mut pairs = Pairs::new();
    let read = |f: &Vector3<f64>, row: usize| known[row].map_or(f64::NAN, |(axis, negative)| if negative { -f[axis] } else { f[axis] });
    let leaning = velocities.legs().filter_map(|leg| {
        let (_, ahead) = leg.turn()?;
        let f = forces.mean(leg.from - lag, leg.to - lag)? * factor;
        Some((leg, [read(&f, 0) - ahead[0], read(&f, 1) - ahead[1]]))
    });
    let leaning: Vec<_> = leaning.collect();
    for pair in leaning.windows(2) {
        let [(a, before), (b, after)] = pair else { continue };
        let (from, to) = ((a.from + a.to) / 2.0, (b.from + b.to) / 2.0);
        let Some(measured) = rates.mean(from - lag, to - lag).filter(|_| b.from <= a.to) else {
            continue;
        };
        let slope = |row: usize| (after[row] - before[row]) / (to - from) / GRAVITY;
        pairs.push((Vector3::new(-slope(1), slope(0), f64::NAN), measured));
    }
    pairs
}
