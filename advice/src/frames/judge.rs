//! The comparisons, one after the other: what was found wrong before is put right for those that follow.

use super::clock::{self, Clocks};
use super::free;
use super::heading::Turned;
use super::log::{self, Track};
use super::mistake::{self, Axes, Whole, at, complete, differing, names, remedy, unit};
use super::motion::{self, Attitudes, GRAVITY, Velocities};
use super::regression::{ENOUGH, FAR, Fit, NEAR, fit};
use super::upright::Upright;
use super::world::Moved;
use fusion::config::{Diagnostic, Diagnostics, Node};
use fusion::design::Design;
use fusion::run::Options;
use fusion_models::units::Duration;
use fusion_tables::short;
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

/// What is being tried.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// In words.
    pub what: &'a str,
    /// Runs that are done ...
    pub done: usize,
    /// ... of so many; what they say decides whether there will be more.
    pub all: usize,
}

/// Compares the recorded channels of a design with one another, and its fixed parameters with what its filter estimates;
/// `progress` hears what is being tried, from several threads.
///
/// # Errors
/// What is wrong with the data.
pub fn judge(design: &Design, options: &Options, progress: &(dyn Fn(Step<'_>) + Sync)) -> Result<Judged, Diagnostics> {
    if design.simulation.is_some() {
        return Ok(Judged::default());
    }
    let mut judge = Judge {
        design,
        options,
        tracks: log::read(design, options)?,
        found: Judged::default(),
        mended: Vec::new(),
    };
    let has_time = judge.stamps();
    judge.places();
    let velocities = judge.velocities();
    let attitude = judge.attitude(&velocities);
    judge.instruments(&velocities, attitude.as_ref());
    judge.fields();
    // What lies close together in time is read as its mean.
    if has_time {
        judge.ranges();
    }
    let mut found = judge.found;
    // A parameter is told only by what is right otherwise.
    if found.mistakes.is_empty() {
        free::judge(design, options, progress, &mut found)?;
    } else {
        found.comparisons.push(free::untried("not judged while something else is wrong"));
    }
    Ok(found)
}

pub(super) struct Judge<'a> {
    pub(super) design: &'a Design,
    pub(super) options: &'a Options,
    pub(super) tracks: Vec<Track>,
    pub(super) found: Judged,
    /// The tracks that were put right.
    pub(super) mended: Vec<(usize, &'static str)>,
}

/// What is expected along some axes, with what was measured then.
#[derive(Default)]
pub(super) struct Expected {
    rows: [(Vec<f64>, Vec<Vector3<f64>>); 3],
}

impl Expected {
    fn push(&mut self, row: usize, expected: f64, measured: Vector3<f64>) {
        self.rows[row].0.push(expected);
        self.rows[row].1.push(measured);
    }

    pub(super) fn push_all(&mut self, expected: &Vector3<f64>, measured: Vector3<f64>) {
        let rows = (0..3).filter(|row| expected[*row].is_finite());
        rows.for_each(|row| self.push(row, expected[row], measured));
    }

    /// What is told, with the means of what was measured `lag` before.
    pub(super) fn of(measured: &Track, told: &[motion::Told], lag: f64) -> Self {
        let mut expected = Self::default();
        let pairs = told
            .iter()
            .filter_map(|(from, to, v)| Some((v, measured.mean(from - lag, to - lag)?)));
        pairs.for_each(|(v, m)| expected.push_all(v, m));
        expected
    }

    /// Of how many intervals both tell.
    fn count(&self) -> usize {
        self.rows.iter().map(|(expected, _)| expected.len()).max().unwrap_or(0)
    }

    pub(super) fn fits(&self) -> [Option<Fit>; 3] {
        [0, 1, 2].map(|row| fit(row, &self.rows[row].0, &self.rows[row].1))
    }
}

/// Which axes the data tell.
pub(super) fn known(fits: &[Option<Fit>; 3]) -> [Option<(usize, bool)>; 3] {
    [0, 1, 2].map(|row| {
        let fit = fits[row].filter(Fit::is_clear)?;
        let best = (fit.axis, fit.negative);
        (fit.is_other() || best == (row, false)).then_some(best)
    })
}

/// The factor that all clear axes are wrong by: of one among several it may be one of that comparison. And how well its logarithm is
/// known.
pub(super) fn wrong_factor(fits: &[Option<Fit>; 3], limit: f64) -> Option<(f64, f64)> {
    let clear = || fits.iter().flatten().filter(|f| f.is_clear());
    let is_wrong = clear().all(|f| f.wrong_factor(limit).is_some());
    let first = clear().next().filter(|_| is_wrong)?;
    let [least, most] = first.factor;
    Some((first.wrong_factor(limit)?, (most / least).ln() / 2.0))
}

/// A factor in words.
pub(super) fn sized(small: f64) -> String {
    let (by, size) = if small > 1.0 { (small, "small") } else { (1.0 / small, "large") };
    format!("too {size} by a factor of {}", short(by))
}

/// What a channel is compared with, and how.
pub(super) struct Compared<'a> {
    pub(super) with: &'a str,
    pub(super) is_world: bool,
    /// The factor from which on the numbers are wrong.
    pub(super) limit: f64,
    /// What is said where nothing could be compared.
    pub(super) lack: &'a str,
    /// How much later the stamps are \[s\].
    pub(super) shift: f64,
    /// Which sign an axis has, where the data do not decide.
    pub(super) axes: Option<Axes>,
    /// What to do instead, if what it is compared with is wrong.
    pub(super) or: Option<&'a str>,
}

impl Judge<'_> {
    pub(super) fn node(&self, track: &Track) -> &Node {
        &self.design.sources[track.source].node
    }

    pub(super) fn name(&self, track: &Track) -> String {
        format!("{}.{}", self.design.sources[track.source].name, track.channel)
    }

    /// The name, of what was put right with a word on it.
    pub(super) fn named(&self, track: &Track) -> String {
        let is_mended = self.mended.contains(&(track.source, track.channel));
        self.name(track) + if is_mended { ", put right" } else { "" }
    }

    pub(super) fn is_reference(&self, track: &Track) -> bool {
        let name = &self.design.sources[track.source].name;
        self.design.reference.as_ref().is_some_and(|r| r.block.source.has(name))
    }

    pub(super) fn all(&self, channel: &str) -> Vec<Track> {
        self.tracks.iter().filter(|t| t.channel == channel).cloned().collect()
    }

    pub(super) fn beside(&self, track: &Track, channel: &str) -> Option<Track> {
        self.tracks
            .iter()
            .find(|t| t.source == track.source && t.channel == channel)
            .cloned()
    }

    /// Tells what the fits of a channel say, or what they lack; the axes and the factor that put it right.
    pub(super) fn compare(&mut self, track: &Track, fits: &[Option<Fit>; 3], compared: &Compared<'_>) -> (Axes, f64) {
        let known = known(fits);
        let fitted = || fits.iter().flatten();
        if fitted().next().is_none() {
            self.untold(track, compared.with, compared.lack);
            return (mistake::DECLARED, 1.0);
        }
        let factor = wrong_factor(fits, compared.limit);
        let wrong = differing(&known, compared.is_world);
        let mut verdict = match (wrong.is_empty(), factor) {
            _ if known == [None; 3] && is_unsigned(track) => {
                "not decided: no agreement, and none of its numbers changes its sign: are they 1σ?".to_owned()
            }
            _ if known == [None; 3] => "not decided: no agreement, or too little motion".to_owned(),
            (true, None) => "as declared".to_owned(),
            (true, Some((small, _))) => sized(small),
            (false, _) => wrong.clone(),
        };
        let open = mistake::of_rows(compared.is_world, |row| known[row].is_none());
        if known != [None; 3] && !open.is_empty() {
            let decided = mistake::of_rows(compared.is_world, |row| known[row].is_some());
            if wrong.is_empty() {
                verdict = format!("{decided} {verdict}");
            }
            verdict += &format!("; {open} not decided");
        }
        if compared.shift != 0.0 {
            verdict += &format!(", {:.2} s apart", compared.shift.abs());
        }
        self.found.comparisons.push(Comparison {
            what: self.name(track),
            with: compared.with.to_owned(),
            samples: fitted().map(|f| f.count).max().unwrap_or(0),
            correlation: fitted().map(|f| f.correlation).collect(),
            margin: fitted().filter(|f| f.is_clear()).map(|f| f.margin).fold(0.0, f64::max),
            verdict,
        });
        // The data, however little they say; else the rotation of what is in the same housing, where it says the same otherwise.
        let housing = compared
            .axes
            .filter(|axes| (0..3).all(|row| known[row].is_none_or(|k| k == axes[row])));
        let sign = |row: usize, axis: usize| {
            let leans = fits[row].and_then(|f| f.leans(axis));
            leans.or_else(|| housing.map(|axes| axes[row]).filter(|a| a.0 == axis).map(|a| a.1))
        };
        // A unit that is mounted otherwise is turned, not mirrored.
        let whole = complete(known, sign).map(|whole| if compared.is_world { whole } else { whole.turned() });
        if !wrong.is_empty() {
            let told = self.axes(track, &known, whole, compared);
            self.found.mistakes.push(told);
        }
        if let Some((small, within)) = factor {
            let told = self.factor(track, compared.with, small, within);
            self.found.mistakes.push(told);
        }
        (whole.map_or(mistake::DECLARED, |w| w.axes), factor.map_or(1.0, |f| f.0))
    }

    /// Lists a comparison that could not be made, with what would help.
    pub(super) fn untold(&mut self, track: &Track, with: &str, why: &str) {
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
    pub(super) fn axes(
        &self,
        track: &Track,
        known: &[Option<(usize, bool)>; 3],
        whole: Option<Whole>,
        compared: &Compared<'_>,
    ) -> Diagnostic {
        let node = self.node(track);
        let channel = node.at(&format!("channels.{}", track.channel));
        let &Compared { with, is_world, or, .. } = compared;
        let what = if is_world { "north, east, down" } else { "forward, right, down" };
        let message = format!(
            "the axes of `{}` are not {what}: compared with {with}, {}",
            self.name(track),
            differing(known, is_world)
        );
        let help = match whole {
            Some(Whole { axes, open }) => {
                let open = open.map(|row| mistake::of_rows(is_world, |other| other == row));
                let open = open.map_or_else(String::new, |row| {
                    let is = if is_world {
                        "kept as declared"
                    } else {
                        "that which makes the axes right-handed"
                    };
                    format!("; the sign of {row} is not decided by these data: it is {is}")
                });
                remedy(channel, &axes) + &open
            }
            None => {
                let unknown: Vec<&str> = (0..3).filter(|i| known[*i].is_none()).map(|i| names(is_world)[i]).collect();
                match unknown[..] {
                    [] => "two axes seem to be the same: check the columns".to_owned(),
                    _ if is_upside_down(track, known) => format!(
                        "a unit that is upside down has its gyros turned too: {}, and the gyros likewise; or name the axes in which it is mounted",
                        remedy(channel, &UPSIDE_DOWN)
                    ),
                    _ => format!(
                        "change the columns or their signs; about {} these data say nothing",
                        unknown.join(" and ")
                    ),
                }
            }
        };
        let or = or.map_or_else(String::new, |or| format!("; or, {or}"));
        at(node, track.channel, "columns", message).help(help + &or)
    }

    /// The numbers of a channel are too small or too large by a factor.
    pub(super) fn factor(&self, track: &Track, with: &str, small: f64, within: f64) -> Diagnostic {
        let message = format!("`{}` is {}, compared with {with}", self.name(track), sized(small));
        let node = self.node(track);
        let channel = node.at(&format!("channels.{}", track.channel));
        // A rate that a course is compared with slips and lags.
        let within = if track.channel == "velocity" { within.max(0.05) } else { 0.25 };
        let help = unit(channel, track.channel, small, within, track.rate);
        at(node, track.channel, "unit", message).help(help.unwrap_or_else(|| "check `unit` and `scale`".to_owned()))
    }

    /// The attitude that the instruments are compared with: one that does not contradict the course.
    fn attitude(&mut self, velocities: &[Moved]) -> Option<Seen> {
        let mut found = Vec::new();
        let moved = velocities.first().map(|moved| &moved.velocities);
        let attitudes: Vec<Track> = self
            .all("attitude")
            .into_iter()
            .filter_map(|track| self.redeclared(track, moved))
            .collect();
        for track in attitudes.into_iter().chain(self.all("heading")) {
            let is_reference = self.is_reference(&track);
            let is_right = velocities.first().is_none_or(|moved| self.heading(&track, moved));
            if is_right && track.channel == "attitude" {
                let seen = Seen {
                    source: track.source,
                    name: self.name(&track),
                    attitudes: Attitudes::of(&track),
                };
                found.push((is_reference, seen));
            }
        }
        found.sort_by_key(|f| f.0);
        found.into_iter().next().map(|(_, seen)| seen)
    }

    /// Compares headings with the course; whether they do not contradict each other.
    fn heading(&mut self, track: &Track, moved: &Moved) -> bool {
        let pairs = moved.headings(track);
        let Some(agreed) = Turned::of(&pairs) else {
            let why = "not judged: a course that goes round, at more than 2 m/s, would tell";
            self.untold(track, &format!("the course of {}", moved.name), why);
            return true;
        };
        let wrong = agreed.wrong().or_else(|| self.other_unit(track, moved, &agreed));
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
        let message = format!(
            "the heading of `{}` is not what is declared, clockwise from north: {what}",
            self.name(track)
        );
        let told = at(self.node(track), track.channel, "quaternion", message).help(help);
        self.found.mistakes.push(told);
        false
    }

    /// Of a heading that is not tied to the course, what is wrong and what to write, where it is in another unit.
    fn other_unit(&self, track: &Track, moved: &Moved, agreed: &Turned) -> Option<(String, String)> {
        let declared = self
            .node(track)
            .at(&format!("channels.{}.unit", track.channel))
            .and_then(Node::as_str)?;
        let unit = ["deg", "rad"].into_iter().find(|unit| *unit != declared)?;
        let written = format!("unit = {unit:?}");
        let other = self.read_as(track, std::slice::from_ref(&written)).filter(|_| !agreed.is_tied())?;
        let is_right = Turned::of(&moved.headings(&other))?.is_right();
        is_right.then(|| (format!("it goes with the course as {unit}"), format!("write `{written}`")))
    }

    /// Every inertial unit.
    fn instruments(&mut self, velocities: &[Moved], attitude: Option<&Seen>) {
        for track in self.all("specific_force") {
            let rates = self.beside(&track, "angular_rate");
            let shift = rates.as_ref().map_or(0.0, |rates| self.clocks(rates, velocities, attitude));
            let force = self.force(&track, rates.as_ref(), velocities.first(), attitude, shift);
            if let Some(rates) = rates {
                self.rates(&rates, Some((&track, force)), velocities.first(), attitude, shift);
            }
        }
        for rates in self.all("angular_rate") {
            if self.beside(&rates, "specific_force").is_none() {
                let shift = self.clocks(&rates, velocities, attitude);
                self.rates(&rates, None, velocities.first(), attitude, shift);
            }
        }
    }

    /// Compares the stamps of a unit with those of whatever tells of turns; by how much later what it is compared with is stamped \[s\].
    fn clocks(&mut self, rates: &Track, velocities: &[Moved], attitude: Option<&Seen>) -> f64 {
        let mut told: Vec<(usize, &str, Vec<motion::Told>)> = Vec::new();
        // What is late as declared is not late by its clock.
        let known = |source: usize| {
            self.delays(source, |kind| kind.ends_with("velocity"))
                .first()
                .copied()
                .unwrap_or(0.0)
        };
        let seen = attitude.map(|seen| seen.source);
        if let Some(seen) = attitude {
            told.push((seen.source, &seen.name, seen.attitudes.turns().collect()));
        }
        for moved in velocities {
            if told.iter().all(|(source, ..)| *source != moved.track.source) {
                told.push((moved.track.source, &moved.name, moved.velocities.course_rates(0.0)));
            }
        }
        told.retain(|(source, ..)| *source != rates.source);
        let clocks: Vec<Clocks> = told
            .iter()
            .map(|(source, _, legs)| clock::compare(rates, legs, &self.delays(*source, |_| true), seen != Some(*source)))
            .collect();
        let apart = told.iter().zip(&clocks).filter_map(|((source, name, _), clocks)| match clocks {
            Clocks::Apart(shift) => Some((*source, *name, *shift)),
            _ => None,
        });
        let is_alone = clocks.contains(&Clocks::Together);
        // Where something goes together with the unit, the others are wrong; else the unit is.
        let all: Vec<(usize, &str, f64)> = apart.collect();
        let mistakes: Vec<Diagnostic> = match (&all[..], is_alone) {
            (apart, true) => apart
                .iter()
                .map(|(source, name, shift)| self.shifted(*source, known(*source) - shift, &self.name(rates), name))
                .collect(),
            ([(source, name, shift), ..], false) => vec![self.shifted(rates.source, *shift - known(*source), name, &self.name(rates))],
            ([], false) => Vec::new(),
        };
        self.found.mistakes.extend(mistakes);
        match clocks.first() {
            Some(Clocks::Apart(shift)) => *shift,
            _ => 0.0,
        }
    }

    /// The delays that the design declares of what sensors of a type read of a source \[s\].
    fn delays(&self, source: usize, is_asked: impl Fn(&str) -> bool) -> Vec<f64> {
        let name = &self.design.sources[source].name;
        let of = self
            .design
            .sensors
            .iter()
            .filter(|s| s.node.get("source").and_then(Node::as_str) == Some(name))
            .filter(|s| s.node.get("type").and_then(Node::as_str).is_some_and(&is_asked));
        let declared = of.filter_map(|s| {
            let offset = s.node.get("time_offset")?;
            let offset: Duration = offset.get("initial").unwrap_or(offset).read(&mut Diagnostics::new())?;
            Some(offset.si())
        });
        declared.collect()
    }

    /// The stamps of a source are not those of another clock.
    fn shifted(&self, source: usize, shift: f64, with: &str, what: &str) -> Diagnostic {
        let named = &self.design.sources[source];
        let declared: Option<Duration> = named.node.at("time.offset").and_then(|n| n.read(&mut Diagnostics::new()));
        let way = if shift > 0.0 { "early" } else { "late" };
        let message = format!(
            "the stamps of `{}` are about {:.2} s {way}: shifted by that, `{what}` agrees best with `{with}`",
            named.name,
            shift.abs()
        );
        let offset = declared.map_or(0.0, Duration::si) + shift;
        let help = format!(
            "write `source.{}.time.offset = \"{offset:.2} s\"`, or find out which of the two clocks is wrong",
            named.name
        );
        let place = named
            .node
            .at("time.offset")
            .map_or_else(|| named.node.place_of("time"), Node::place);
        Diagnostic::warning(message).at(place).help(help)
    }

    /// Compares a specific force with gravity and with the motion, where the gyros tell that the unit hardly turns; what puts it
    /// right.
    fn force(&mut self, track: &Track, rates: Option<&Track>, moved: Option<&Moved>, attitude: Option<&Seen>, shift: f64) -> Force {
        let upright = Upright::of(track);
        let told = |seconds: f64| match (attitude, moved) {
            (Some(seen), moved) => seen.attitudes.forces(moved.map(|m| &m.velocities)),
            (None, Some(moved)) => moved.velocities.course_forces(seconds),
            (None, None) => Vec::new(),
        };
        let mut fast = told(0.0);
        let seek = if attitude.is_some() { clock::sought } else { clock::usual };
        let lag = seek(track, &fast, shift);
        // Of a foot that swings between two of its attitudes, neither they nor one half-way tell the mean.
        if let Some(rates) = rates.filter(|_| attitude.is_some()) {
            fast.retain(|told| turns_little(rates, told, lag));
        }
        let expected = Expected::of(track, &fast, lag);
        let mut fits = expected.fits();
        let (lack, is_alone) = (lack(expected.count()), attitude.is_none() && moved.is_none());
        let is_doubtful = attitude.is_none() && doubt(&mut fits, &Expected::of(track, &told(SLOW), lag).fits());
        let mut with = match (attitude, moved) {
            (Some(seen), _) => format!("gravity in the attitude of `{}`", seen.name),
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
        let compared = Compared {
            with: &with,
            is_world: false,
            limit: if factor == 1.0 { FAR } else { NEAR },
            lack: if is_alone { ALONE } else { &lack },
            shift: if attitude.is_some() { early(lag, shift) } else { shift },
            axes: None,
            or: None,
        };
        self.compare(track, &fits, &compared);
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
    fn rates(&mut self, track: &Track, force: Option<(&Track, Force)>, moved: Option<&Moved>, attitude: Option<&Seen>, shift: f64) {
        let with = match (attitude, moved) {
            (Some(seen), _) => format!("the turns of `{}`", seen.name),
            (None, Some(moved)) => format!("the turns of {}", moved.name),
            (None, None) => return self.untold(track, "turns that something else tells of", ALONE),
        };
        let told = |seconds: f64| match (attitude, moved) {
            (Some(seen), _) => seen.attitudes.turns().collect(),
            (None, Some(moved)) => moved.velocities.course_rates(seconds),
            (None, None) => Vec::new(),
        };
        let fast = told(0.0);
        let seek = if attitude.is_some() { clock::sought } else { clock::usual };
        let lag = seek(track, &fast, shift);
        let mut fits = Expected::of(track, &fast, lag).fits();
        let is_doubtful = attitude.is_none() && doubt(&mut fits, &Expected::of(track, &told(SLOW), lag).fits());
        let housing = force.and_then(|(_, (known, _))| Some([known[0]?, known[1]?, known[2]?]));
        if let (false, None, Some(moved), Some((forces, right))) = (is_doubtful, attitude, moved, force) {
            let tilts = tilts(track, forces, right, lag, &moved.velocities).fits();
            (fits[0], fits[1]) = (tilts[0], tilts[1]);
        }
        // An attitude that is right decides all axes of a unit that turns about all of them.
        let doubt = attitude.filter(|_| known(&fits).contains(&None));
        let doubt = doubt.map(|seen| {
            format!(
                "if `{}` is wrong, check the order of its numbers, `inverse` and its axes",
                seen.name
            )
        });
        let compared = Compared {
            with: &with,
            is_world: false,
            limit: if attitude.is_some() { NEAR } else { FAR },
            lack: if attitude.is_some() { LONG } else { FAST },
            shift: if attitude.is_some() { early(lag, shift) } else { shift },
            axes: housing,
            or: doubt.as_deref(),
        };
        self.compare(track, &fits, &compared);
        if is_doubtful {
            self.untold(track, &format!("the turns over {SLOW} s"), WAVES);
        }
    }
}

/// Whether a unit turns so little in an interval, `lag` before, that its attitude half-way tells the mean.
pub(super) fn turns_little(rates: &Track, (from, to, _): &motion::Told, lag: f64) -> bool {
    let rate = rates.mean_length(from - lag, to - lag);
    rate.is_none_or(|rate| rate * (to - from) < motion::MUCH)
}

/// Turned about the forward axis by half a turn.
const UPSIDE_DOWN: Axes = [(0, false), (1, true), (2, true)];

/// Whether of a unit gravity alone is known, and points up.
fn is_upside_down(track: &Track, known: &[Option<(usize, bool)>; 3]) -> bool {
    track.channel == "specific_force" && *known == [None, None, Some((2, true))]
}

/// Whether a velocity moves, and never the other way along any axis.
fn is_unsigned(track: &Track) -> bool {
    let one_way = |i: usize| track.values.iter().all(|v| v[i] >= 0.0) || track.values.iter().all(|v| v[i] <= 0.0);
    let moves = track.values.iter().any(|v| v[0] != 0.0 && v[1] != 0.0);
    track.channel == "velocity" && moves && (0..3).all(one_way)
}

/// An attitude that the instruments are compared with.
struct Seen {
    source: usize,
    name: String,
    attitudes: Attitudes,
}

/// What would have given enough samples to judge by a course ...
const FAST: &str = "not judged: a minute of turns at more than 2 m/s would tell";
/// ... and by what needs none.
pub(super) const LONG: &str = "not judged: both together for a minute would tell";
/// Where nothing else tells of motion.
const ALONE: &str = "not judged: an attitude, or a velocity of more than 2 m/s, would tell";

/// What is lacking where both tell of so many intervals.
fn lack(count: usize) -> String {
    match count {
        0 => LONG.to_owned(),
        count => format!("not judged: both tell of {count} intervals of little turn, {ENOUGH} are needed"),
    }
}

/// The shift that is told: that of the clocks, or a lag that is earlier than what is smoothed in both directions \[s\].
fn early(lag: f64, shift: f64) -> f64 {
    if lag - shift < -0.25 { lag } else { shift }
}

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
