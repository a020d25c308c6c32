//! The comparisons, one after the other: what was found wrong before is put right for those that follow.

use super::field::{self, Told};
use super::free;
use super::log::{self, Track};
use super::mistake::{self, Axes, at, complete, differing, names, remedy, unit};
use super::motion::{Attitudes, GRAVITY, MIN_SPEED, Velocities, course, headings};
use super::regression::{Fit, fit};
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::Design;
use crate::run::Options;
use nalgebra::Vector3;

/// What was compared, and what came of it.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The channel, `source.channel`, or what else is judged.
    pub what: String,
    /// With what.
    pub with: String,
    /// Samples.
    pub samples: usize,
    /// The correlation along each axis that could be compared.
    pub correlation: Vec<f64>,
    /// How much better another explanation is than what is declared, in standard errors, along
    /// the axes where the data can tell; zero where none is better.
    pub margin: f64,
    /// What the data say.
    pub verdict: String,
}

/// What recorded data say of the frames of a design.
#[derive(Debug, Default)]
pub struct Judged {
    /// What could be compared.
    pub comparisons: Vec<Comparison>,
    /// What is wrong, as warnings at the place of the declaration.
    pub mistakes: Diagnostics,
}

/// Compares the recorded channels of a design with one another, and its fixed parameters with what its filter estimates.
///
/// # Errors
/// What is wrong with the data.
pub fn judge(design: &Design, options: &Options) -> Result<Judged, Diagnostics> {
    if design.simulation.is_some() {
        return Ok(Judged::default());
    }
    let mut judge = Judge {
        design,
        tracks: log::read(design, options)?,
        found: Judged::default(),
    };
    let velocities = judge.velocities();
    let attitude = judge.attitude(&velocities);
    judge.instruments(&velocities, attitude.as_ref());
    judge.fields();
    let mut found = judge.found;
    // A parameter is told only by what is right otherwise.
    if found.mistakes.is_empty() {
        free::judge(design, options, &mut found)?;
    } else {
        found.comparisons.push(free::untried("not judged while something else is wrong"));
    }
    Ok(found)
}

struct Judge<'a> {
    design: &'a Design,
    tracks: Vec<Track>,
    found: Judged,
}

/// What is expected along some axes, with what was measured then.
#[derive(Default)]
struct Expected {
    rows: [(Vec<f64>, Vec<Vector3<f64>>); 3],
}

impl Expected {
    fn push(&mut self, row: usize, expected: f64, measured: Vector3<f64>) {
        self.rows[row].0.push(expected);
        self.rows[row].1.push(measured);
    }

    fn push_all(&mut self, expected: &Vector3<f64>, measured: Vector3<f64>) {
        (0..3).for_each(|row| self.push(row, expected[row], measured));
    }

    fn fits(&self) -> [Option<Fit>; 3] {
        [0, 1, 2].map(|row| fit(row, &self.rows[row].0, &self.rows[row].1))
    }
}

/// How late a velocity or an attitude may be stamped against the instruments \[s\]: receivers are late by up to half a
/// second, and what is smoothed in both directions is early.
const LAGS: [f64; 9] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, -0.1, -0.2];

/// The fits at the lag at which all axes together correlate best, whichever they are, with that lag.
fn aligned(at: impl Fn(f64) -> Expected) -> ([Option<Fit>; 3], f64) {
    let told = |fits: &[Option<Fit>; 3]| fits.iter().flatten().map(|f| f.correlation.powi(2)).sum::<f64>();
    let mut best = (at(0.0).fits(), 0.0);
    for lag in &LAGS[1..] {
        let fits = at(*lag).fits();
        if told(&fits) > told(&best.0) {
            best = (fits, *lag);
        }
    }
    best
}

/// Which axes the data tell.
fn known(fits: &[Option<Fit>; 3]) -> [Option<(usize, bool)>; 3] {
    [0, 1, 2].map(|row| {
        let fit = fits[row].filter(Fit::is_clear)?;
        let best = (fit.axis, fit.negative);
        (fit.is_other() || best == (row, false)).then_some(best)
    })
}

/// The velocity of a source, or the slope of its position.
struct Moved {
    name: String,
    is_reference: bool,
    velocities: Velocities,
}

impl Judge<'_> {
    fn node(&self, track: &Track) -> &Node {
        &self.design.sources[track.source].node
    }

    fn name(&self, track: &Track) -> String {
        format!("{}.{}", self.design.sources[track.source].name, track.channel)
    }

    fn is_reference(&self, track: &Track) -> bool {
        let name = &self.design.sources[track.source].name;
        self.design.reference.as_ref().is_some_and(|r| r.block.source.has(name))
    }

    fn all(&self, channel: &str) -> Vec<Track> {
        self.tracks.iter().filter(|t| t.channel == channel).cloned().collect()
    }

    fn beside(&self, track: &Track, channel: &str) -> Option<Track> {
        self.tracks
            .iter()
            .find(|t| t.source == track.source && t.channel == channel)
            .cloned()
    }

    /// Every velocity, compared with the position beside it, and put right; those of the filter's own data first.
    fn velocities(&mut self) -> Vec<Moved> {
        let mut all = Vec::new();
        for track in self.all("velocity") {
            let mut velocities = Velocities::of(&track);
            if let Some(position) = self.beside(&track, "position") {
                let slope = Velocities::slope(&position);
                let mut expected = Expected::default();
                let pairs = slope.times.iter().zip(&slope.values);
                pairs
                    .filter_map(|(t, v)| Some((v, velocities.at(*t)?)))
                    .for_each(|(v, m)| expected.push_all(v, m));
                let with = format!("the slope of {}", self.name(&position));
                let (axes, factor) = self.compare(&track, &with, &expected.fits(), true, LONG);
                velocities.values.iter_mut().for_each(|v| *v = turned(v, &axes) * factor);
            }
            let is_reference = self.is_reference(&track);
            all.push(Moved {
                name: self.name(&track),
                is_reference,
                velocities,
            });
        }
        for track in self.all("position") {
            if self.beside(&track, "velocity").is_none() {
                let name = format!("the slope of {}", self.name(&track));
                let is_reference = self.is_reference(&track);
                all.push(Moved {
                    name,
                    is_reference,
                    velocities: Velocities::slope(&track),
                });
            }
        }
        all.retain(|m| m.velocities.times.len() > 1);
        all.sort_by_key(|m| m.is_reference);
        all
    }

    /// Tells what the fits of a channel say, or what they lack; the axes and the factor that put it right.
    fn compare(&mut self, track: &Track, with: &str, fits: &[Option<Fit>; 3], is_world: bool, lack: &str) -> (Axes, f64) {
        let known = known(fits);
        let fitted = || fits.iter().flatten();
        if fitted().next().is_none() {
            self.untold(track, with, lack);
            return (mistake::DECLARED, 1.0);
        }
        let factors: Vec<f64> = fitted().filter_map(Fit::wrong_factor).collect();
        let clear = fitted().filter(|f| f.is_clear()).count();
        // Of one axis among several that were compared a factor may be one of that comparison.
        let factor = factors.first().copied().filter(|_| factors.len() == clear);
        let wrong = differing(&known, is_world);
        let verdict = match (wrong.is_empty(), factor) {
            _ if clear == 0 => "too little motion to tell".to_owned(),
            (true, None) => "as declared".to_owned(),
            (true, Some(factor)) => format!("too small by {factor:.3}"),
            (false, _) => wrong.clone(),
        };
        self.found.comparisons.push(Comparison {
            what: self.name(track),
            with: with.to_owned(),
            samples: fitted().map(|f| f.count).max().unwrap_or(0),
            correlation: fitted().map(|f| f.correlation).collect(),
            margin: fitted().filter(|f| f.is_clear()).map(|f| f.margin).fold(0.0, f64::max),
            verdict,
        });
        let whole = complete(known);
        if !wrong.is_empty() {
            let told = self.axes(track, with, &known, whole, is_world);
            self.found.mistakes.push(told);
        }
        if let Some(small) = factor {
            let told = self.factor(track, with, small);
            self.found.mistakes.push(told);
        }
        (whole.unwrap_or(mistake::DECLARED), factor.unwrap_or(1.0))
    }

    /// Lists a comparison that could not be made, with what would help.
    fn untold(&mut self, track: &Track, with: &str, why: &str) {
        self.found.comparisons.push(Comparison {
            what: self.name(track),
            with: with.to_owned(),
            samples: 0,
            correlation: Vec::new(),
            margin: 0.0,
            verdict: why.to_owned(),
        });
    }

    /// The axes of a channel are not those that are declared.
    fn axes(&self, track: &Track, with: &str, known: &[Option<(usize, bool)>; 3], whole: Option<Axes>, is_world: bool) -> Diagnostic {
        let node = self.node(track);
        let channel = node.at(&format!("channels.{}", track.channel));
        let what = if is_world { "north, east, down" } else { "forward, right, down" };
        let message = format!(
            "the axes of `{}` are not {what}: compared with {with}, {}",
            self.name(track),
            differing(known, is_world)
        );
        let help = match whole {
            Some(axes) => remedy(channel, &axes),
            None => {
                let unknown: Vec<&str> = (0..3).filter(|i| known[*i].is_none()).map(|i| names(is_world)[i]).collect();
                match unknown[..] {
                    [] => "two axes seem to be the same: check the columns".to_owned(),
                    _ => format!(
                        "change the columns or their signs; about {} these data say nothing",
                        unknown.join(" and ")
                    ),
                }
            }
        };
        at(node, track.channel, "columns", message).help(help)
    }

    /// The numbers of a channel are too small or too large by a factor.
    fn factor(&self, track: &Track, with: &str, small: f64) -> Diagnostic {
        let (by, size) = if small > 1.0 { (small, "small") } else { (1.0 / small, "large") };
        let message = format!("`{}` is too {size} by a factor of {by:.3}, compared with {with}", self.name(track));
        let position = with.contains(".position").then(|| unit("position", 1.0 / small, 1.0)).flatten();
        let help = unit(track.channel, small, track.rate).map(str::to_owned);
        let help = help.or_else(|| position.map(|p| format!("of the position {p}")));
        at(self.node(track), track.channel, "unit", message).help(help.unwrap_or_else(|| "check `unit` and `scale`".to_owned()))
    }

    /// The attitude that the instruments are compared with: one that does not contradict the course.
    fn attitude(&mut self, velocities: &[Moved]) -> Option<(String, Attitudes)> {
        let mut found = Vec::new();
        for track in self.all("attitude").into_iter().chain(self.all("heading")) {
            let is_reference = self.is_reference(&track);
            let is_right = velocities.first().is_none_or(|moved| self.heading(&track, moved));
            if is_right && track.channel == "attitude" {
                found.push((is_reference, self.name(&track), Attitudes::of(&track)));
            }
        }
        found.sort_by_key(|f| f.0);
        found.into_iter().next().map(|(_, name, attitudes)| (name, attitudes))
    }

    /// Compares headings with the course; whether they do not contradict each other.
    fn heading(&mut self, track: &Track, moved: &Moved) -> bool {
        let pairs = headings(track).into_iter().filter_map(|(t, heading)| {
            let v = moved.velocities.at(t).filter(|v| v.xy().norm() > MIN_SPEED)?;
            Some((heading, course(&v)))
        });
        let pairs: Vec<(f64, f64)> = pairs.collect();
        let Some(agreed) = Turned::of(&pairs) else {
            let why = "not judged: a course that goes round, at more than 2 m/s, would tell";
            self.untold(track, &format!("the course of {}", moved.name), why);
            return true;
        };
        let wrong = agreed.wrong();
        self.found.comparisons.push(Comparison {
            what: self.name(track),
            with: format!("the course of {}", moved.name),
            samples: pairs.len(),
            correlation: vec![agreed.along.0.max(agreed.against.0)],
            margin: 0.0,
            verdict: wrong
                .clone()
                .map_or_else(|| "as declared, or not tied to the course".to_owned(), |(what, _)| what),
        });
        let Some((what, help)) = wrong else { return true };
        let message = format!("the heading of `{}` is not clockwise from north: {what}", self.name(track));
        let told = at(self.node(track), track.channel, "quaternion", message).help(help);
        self.found.mistakes.push(told);
        false
    }

    /// Every inertial unit.
    fn instruments(&mut self, velocities: &[Moved], attitude: Option<&(String, Attitudes)>) {
        for track in self.all("specific_force") {
            let rates = self.beside(&track, "angular_rate");
            let force = self.force(&track, velocities.first(), attitude);
            if let Some(rates) = rates {
                self.rates(&rates, Some((&track, force)), velocities.first(), attitude);
            }
        }
        for rates in self.all("angular_rate") {
            if self.beside(&rates, "specific_force").is_none() {
                self.rates(&rates, None, velocities.first(), attitude);
            }
        }
    }

    /// Compares every magnetic field with the turns of the inertial unit, where nothing speaks against that.
    fn fields(&mut self) {
        let mut units = self.all("angular_rate").into_iter().filter(|rates| !self.is_reference(rates));
        let Some((rates, forces)) = units.find_map(|rates| self.beside(&rates, "specific_force").map(|forces| (rates, forces))) else {
            return;
        };
        let origin = self.design.run.origin.map(|place| place.latitude.si());
        let fix = || self.all("position").first().map(|track| track.values[0][0]);
        let is_north = origin.or_else(fix).map(|latitude| latitude > 0.0);
        for track in self.all("magnetic_field") {
            let with = format!("the turns of {}", self.name(&rates));
            if !self.found.mistakes.is_empty() {
                self.untold(&track, &with, "not judged while something else is wrong");
                continue;
            }
            let (told, samples) = field::judge(&track, &rates, &forces, is_north);
            let verdict = match &told {
                Told::AsDeclared => "as declared, or turned about the axis of the turns".to_owned(),
                Told::Untold => "not judged: a minute of turns about several axes, far from iron, would tell".to_owned(),
                Told::Other(axes) => differing(&axes.map(Some), false),
            };
            self.found.comparisons.push(Comparison {
                what: self.name(&track),
                with: with.clone(),
                samples,
                correlation: Vec::new(),
                margin: 0.0,
                verdict,
            });
            if let Told::Other(axes) = told {
                let mistake = self.axes(&track, &with, &axes.map(Some), Some(axes), false);
                self.found.mistakes.push(mistake);
            }
        }
    }

    /// Compares a specific force with gravity and with the motion; what puts it right.
    fn force(&mut self, track: &Track, moved: Option<&Moved>, attitude: Option<&(String, Attitudes)>) -> Force {
        let upright = Upright::of(track);
        let by = |lag: f64, seconds: f64| {
            let mut expected = Expected::default();
            match (attitude, moved) {
                (Some((_, attitudes)), moved) => {
                    let forces = attitudes.forces(moved.map(|m| &m.velocities));
                    let pairs = forces
                        .into_iter()
                        .filter_map(|(from, to, f)| Some((f, track.mean(from - lag, to - lag)?)));
                    pairs.for_each(|(f, m)| expected.push_all(&f, m));
                }
                (None, Some(moved)) => {
                    for leg in moved.velocities.strides(seconds) {
                        if let Some(((_, ahead), measured)) = leg.turn().zip(track.mean(leg.from - lag, leg.to - lag)) {
                            (0..2).for_each(|row| expected.push(row, ahead[row], measured));
                        }
                    }
                }
                (None, None) => {}
            }
            expected
        };
        let (mut fits, lag) = aligned(|lag| by(lag, 0.0));
        let is_doubtful = attitude.is_none() && doubt(&mut fits, &by(lag, SLOW).fits());
        let mut with = match (attitude, moved) {
            (Some((name, _)), _) => format!("gravity in the attitude of `{name}`"),
            (None, Some(moved)) => format!("the accelerations of {}", moved.name),
            (None, None) => "gravity".to_owned(),
        };
        let mut factor = 1.0;
        if let Some(upright) = upright {
            fits[2] = Some(upright.fit());
            // Gravity tells the unit better than accelerations do.
            factor = if upright.is_wrong() { GRAVITY / upright.size } else { 1.0 };
            fits.iter_mut().take(2).flatten().for_each(|f| f.factor = [factor; 2]);
            if attitude.is_none() && moved.is_some() {
                with = format!("gravity and {with}");
            }
        }
        self.compare(track, &with, &fits, false, LONG);
        if let (true, Some(moved), [None, None, Some(_)]) = (attitude.is_none(), moved, &fits) {
            let with = format!("the accelerations of {}", moved.name);
            self.untold(track, &with, FAST);
        }
        if is_doubtful {
            self.untold(track, &format!("the accelerations over {SLOW} s"), WAVES);
        }
        (known(&fits), factor)
    }

    /// Compares angular rates with the turns of the attitude, or of the course and of gravity.
    fn rates(&mut self, track: &Track, force: Option<(&Track, Force)>, moved: Option<&Moved>, attitude: Option<&(String, Attitudes)>) {
        let with = match (attitude, moved) {
            (Some((name, _)), _) => format!("the turns of `{name}`"),
            (None, Some(moved)) => format!("the turns of {}", moved.name),
            (None, None) => return,
        };
        let by = |lag: f64, seconds: f64| {
            let mut expected = Expected::default();
            if let Some((_, attitudes)) = attitude {
                let pairs = attitudes
                    .turns()
                    .filter_map(|(from, to, w)| Some((w, track.mean(from - lag, to - lag)?)));
                pairs.for_each(|(w, m)| expected.push_all(&w, m));
            } else if let Some(moved) = moved {
                for leg in moved.velocities.strides(seconds) {
                    if let Some(((rate, _), measured)) = leg.turn().zip(track.mean(leg.from - lag, leg.to - lag)) {
                        expected.push(2, rate, measured);
                    }
                }
            }
            expected
        };
        let (mut fits, lag) = aligned(|lag| by(lag, 0.0));
        let is_doubtful = attitude.is_none() && doubt(&mut fits, &by(lag, SLOW).fits());
        if let (false, None, Some(moved), Some((forces, right))) = (is_doubtful, attitude, moved, force) {
            let tilts = tilts(track, forces, right, lag, &moved.velocities).fits();
            (fits[0], fits[1]) = (tilts[0], tilts[1]);
        }
        let lack = if attitude.is_some() { LONG } else { FAST };
        self.compare(track, &with, &fits, false, lack);
        if is_doubtful {
            self.untold(track, &format!("the turns over {SLOW} s"), WAVES);
        }
    }
}

/// What would have given enough samples to judge by a course ...
const FAST: &str = "not judged: a minute of turns at more than 2 m/s would tell";
/// ... and by what needs none.
const LONG: &str = "not judged: both together for a minute would tell";

/// Longer than waves, and than the steps of a walk \[s\]: what is read off a course has to be true over such intervals too.
const SLOW: f64 = 15.0;
/// What is said where it is not.
const WAVES: &str = "not decided: waves, or other fast motion, say something else";

/// Replaces what fast motion says against the declaration, where slow motion is long enough to tell and does not say the
/// same, by what slow motion says; whether there was anything to replace.
///
/// Means over an interval between two velocities are right however long it is. But an antenna on a mast moves against the
/// boat as it rolls, once or twice between two fixes.
fn doubt(fast: &mut [Option<Fit>; 3], slow: &[Option<Fit>; 3]) -> bool {
    let mut is_doubtful = false;
    for (fast, slow) in fast.iter_mut().zip(slow) {
        let Some(told) = fast.as_ref().filter(|fit| fit.is_other()) else {
            continue;
        };
        let is_confirmed = slow.as_ref().map_or(told.correlation >= PLAIN, |slow| {
            (told.axis, told.negative) == (slow.axis, slow.negative) && slow.certainty >= SLIGHT
        });
        if !is_confirmed {
            (*fast, is_doubtful) = (slow.filter(|s| !s.is_other()), true);
        }
    }
    is_doubtful
}

/// Where slow motion is too short to tell, the correlation from which on fast motion alone is believed: waves and the motion that
/// they cover share an axis in part, a mistake has it whole.
const PLAIN: f64 = 0.8;
/// Standard errors from which on slow motion confirms what fast motion is certain of.
const SLIGHT: f64 = 2.0;

/// Which axes of a specific force the data tell, and the factor that it is too small by.
type Force = ([Option<(usize, bool)>; 3], f64);

/// How gravity turns in the axes of a vehicle, which is what its roll and pitch rates do to it: the specific force
/// less the accelerations along the course, from one interval to the next. Of an axis of the force that is not known
/// nothing is expected.
fn tilts(rates: &Track, forces: &Track, (known, factor): Force, lag: f64, velocities: &Velocities) -> Expected {
    let mut expected = Expected::default();
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
        for (row, rate) in [-slope(1), slope(0)].into_iter().enumerate().filter(|(_, rate)| rate.is_finite()) {
            expected.push(row, rate, measured);
        }
    }
    expected
}

/// Axes as they should have been declared.
pub(super) fn turned(v: &Vector3<f64>, axes: &Axes) -> Vector3<f64> {
    Vector3::from_fn(|row, _| if axes[row].1 { -v[axes[row].0] } else { v[axes[row].0] })
}

/// The specific force of a body that keeps more or less upright.
struct Upright {
    axis: usize,
    negative: bool,
    size: f64,
    count: usize,
    steadiness: f64,
}

impl Upright {
    /// Its mean over seconds; `None` where the direction changes too much, or is along no axis.
    fn of(track: &Track) -> Option<Self> {
        let times = track.times.iter().zip(track.times.iter().skip(10));
        let seconds: Vec<Vector3<f64>> = times.step_by(10).filter_map(|(a, b)| track.mean(*a, *b)).collect();
        let mut sizes: Vec<f64> = seconds.iter().map(|f| f.norm()).collect();
        sizes.sort_by(f64::total_cmp);
        let size = *sizes.get(sizes.len() / 2)?;
        let mean = seconds.iter().sum::<Vector3<f64>>() / seconds.len() as f64;
        let axis = mean.iamax();
        let is_along = mean[axis].abs() > UPRIGHT * mean.norm() && mean.norm() > UPRIGHT * size && size > 0.0;
        (is_along && seconds.len() >= 10).then(|| Self {
            axis,
            negative: mean[axis] > 0.0,
            size,
            count: seconds.len(),
            steadiness: mean[axis].abs() / size,
        })
    }

    fn is_wrong(&self) -> bool {
        (self.size / GRAVITY).ln().abs() > 0.5
    }

    fn fit(&self) -> Fit {
        let is_declared = self.axis == 2 && !self.negative;
        Fit {
            axis: self.axis,
            negative: self.negative,
            correlation: self.steadiness,
            certainty: f64::INFINITY,
            margin: if is_declared { 0.0 } else { f64::INFINITY },
            factor: if self.is_wrong() { [GRAVITY / self.size; 2] } else { [1.0; 2] },
            count: self.count,
        }
    }
}

/// What keeps upright has gravity within 26° of an axis on average: cos 26°.
const UPRIGHT: f64 = 0.9;

/// How headings go with courses: length and direction of the mean of e^{i(course − heading)} and e^{i(course + heading)}.
struct Turned {
    along: (f64, f64),
    against: (f64, f64),
}

impl Turned {
    /// `None` where the course did not go round enough to tell one from the other.
    fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| {
            let (s, c) = pairs
                .iter()
                .map(|p| of(p).sin_cos())
                .fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
            (s.hypot(c) / pairs.len() as f64, s.atan2(c))
        };
        let has_turned = pairs.len() >= 50 && mean(&|p| p.1).0 < 0.8;
        has_turned.then(|| Self {
            along: mean(&|p| p.1 - p.0),
            against: mean(&|p| p.1 + p.0),
        })
    }

    /// What is wrong, and what to write.
    fn wrong(&self) -> Option<(String, String)> {
        const TIED: f64 = 0.9;
        let quarters = |angle: f64| (angle / core::f64::consts::FRAC_PI_2).round();
        let near = |angle: f64| (angle - quarters(angle) * core::f64::consts::FRAC_PI_2).abs() < 0.4;
        let ((along, offset), (against, sum)) = (self.along, self.against);
        if along > TIED && near(offset) && quarters(offset) != 0.0 {
            let degrees = quarters(offset) * 90.0;
            let help =
                format!("add {degrees} deg to the heading: an `offset`, a `rotation` or a `navigation_rotation`; or the vehicle moves so");
            return Some((format!("the course is {degrees}° clockwise of it"), help));
        }
        if against > TIED && along < 0.7 && near(sum) {
            let from = ["north", "east", "south", "west"][(quarters(sum) as i64).rem_euclid(4) as usize];
            let help = match from {
                "east" => {
                    "from east-north-up, write `navigation_rotation = { axes = [\"y\", \"x\", \"-z\"] }`; of roll, pitch, yaw: `\"-yaw\"` with the `offset` `\"90 deg\"`"
                }
                _ => "change the sign of the heading: `\"-yaw\"`, or of a quaternion the opposite of its `inverse`",
            };
            return Some((format!("it is counted anti-clockwise from {from}"), help.to_owned()));
        }
        None
    }
}
