//! Runs the comparisons in order. Each mistake found is corrected for the later comparisons.

use super::clock::{self, Clocks};
use super::free;
use super::heading::Turned;
use super::log::{self, Track};
use super::mistake::{self, Axes, Remedy, Whole, at, complete, differing, names, remedy, unit};
use super::motion::{self, Attitudes, GRAVITY, Velocities};
use super::regression::{ENOUGH, FAR, Fit, NEAR, fit};
use super::upright::Upright;
use super::world::Moved;
use fusion::config::{Diagnostic, Diagnostics, Edit, Node};
use fusion::design::Design;
use fusion::run::Options;
use fusion_core::math;
use fusion_models::units::Duration;
use fusion_tables::short;
use nalgebra::Vector3;

/// A comparison and its result.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The channel, `source.channel`, or another item that is judged.
    pub what: String,
    /// The other side of the comparison.
    pub with: String,
    /// Samples.
    pub samples: usize,
    /// The correlation along each axis that could be compared.
    pub correlation: Vec<f64>,
    /// How much better another explanation is than the declared one, in standard errors. It covers the axes that the
    /// data determine; zero if no other explanation is better.
    pub margin: f64,
    /// The result in words.
    pub verdict: String,
}

/// The results for the frames of a design.
#[derive(Debug, Default)]
pub struct Judged {
    /// The comparisons that were possible.
    pub comparisons: Vec<Comparison>,
    /// The mistakes, as warnings at the place of the declaration.
    pub mistakes: Diagnostics,
}

/// The current trial.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// The trial in words.
    pub what: &'a str,
    /// The number of runs that are finished ...
    pub done: usize,
    /// ... out of this number. Their results decide whether more runs follow.
    pub all: usize,
}

/// Compares the recorded channels of a design with one another, and its fixed parameters with its filter's estimates.
/// Several threads report each trial to `progress`.
///
/// # Errors
/// Errors in the data.
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
    // Values that are close together in time are averaged.
    if has_time {
        judge.ranges();
    }
    let mut found = judge.found;
    // Parameters are judged only if everything else is right.
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
    /// The tracks that were corrected.
    pub(super) mended: Vec<(usize, &'static str)>,
}

/// The expected values along some axes, with the values measured at the same time.
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

    /// The expected values, with the means of the values measured `lag` earlier.
    pub(super) fn of(measured: &Track, told: &[motion::Told], lag: f64) -> Self {
        let mut expected = Self::default();
        let pairs = told
            .iter()
            .filter_map(|(from, to, v)| Some((v, measured.mean(from - lag, to - lag)?)));
        pairs.for_each(|(v, m)| expected.push_all(v, m));
        expected
    }

    /// The number of intervals with both values.
    fn count(&self) -> usize {
        self.rows.iter().map(|(expected, _)| expected.len()).max().unwrap_or(0)
    }

    pub(super) fn fits(&self) -> [Option<Fit>; 3] {
        [0, 1, 2].map(|row| fit(row, &self.rows[row].0, &self.rows[row].1))
    }
}

/// The axes that the data determine.
pub(super) fn known(fits: &[Option<Fit>; 3]) -> [Option<(usize, bool)>; 3] {
    [0, 1, 2].map(|row| {
        let fit = fits[row].filter(Fit::is_clear)?;
        let best = (fit.axis, fit.negative);
        (fit.is_other() || best == (row, false)).then_some(best)
    })
}

/// The factor by which all clear axes are wrong, and the accuracy of its logarithm. A wrong factor on only one of
/// several axes may come from the comparison itself.
pub(super) fn wrong_factor(fits: &[Option<Fit>; 3], limit: f64) -> Option<(f64, f64)> {
    let clear = || fits.iter().flatten().filter(|f| f.is_clear());
    let is_wrong = clear().all(|f| f.wrong_factor(limit).is_some());
    let first = clear().next().filter(|_| is_wrong)?;
    let [least, most] = first.factor;
    Some((first.wrong_factor(limit)?, math::ln(most / least) / 2.0))
}

/// A factor in words.
pub(super) fn sized(small: f64) -> String {
    let (by, size) = if small > 1.0 { (small, "small") } else { (1.0 / small, "large") };
    format!("too {size} by a factor of {}", short(by))
}

/// The other side of a comparison, and its settings.
pub(super) struct Compared<'a> {
    pub(super) with: &'a str,
    pub(super) is_world: bool,
    /// The least factor at which the numbers are wrong.
    pub(super) limit: f64,
    /// The text if nothing could be compared.
    pub(super) lack: &'a str,
    /// The delay of the stamps \[s\].
    pub(super) shift: f64,
    /// The axes that give the signs if the data do not decide them.
    pub(super) axes: Option<Axes>,
    /// The advice if the other side of the comparison is wrong.
    pub(super) or: Option<&'a str>,
}

impl Judge<'_> {
    pub(super) fn node(&self, track: &Track) -> &Node {
        &self.design.sources[track.source].node
    }

    /// The path of the table of a channel in the design.
    pub(super) fn table(&self, track: &Track) -> String {
        format!("source.{}.channels.{}", self.design.sources[track.source].name, track.channel)
    }

    pub(super) fn name(&self, track: &Track) -> String {
        format!("{}.{}", self.design.sources[track.source].name, track.channel)
    }

    /// The name, with a remark if the track was corrected.
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

    /// Reports the result of the fits of a channel, or what they lack. Returns the axes and the factor that correct it.
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
        // The data come first, even if they are few. If they agree with the rotation of the housing, this rotation
        // decides the rest.
        let housing = compared
            .axes
            .filter(|axes| (0..3).all(|row| known[row].is_none_or(|k| k == axes[row])));
        let sign = |row: usize, axis: usize| {
            let leans = fits[row].and_then(|f| f.leans(axis));
            leans.or_else(|| housing.map(|axes| axes[row]).filter(|a| a.0 == axis).map(|a| a.1))
        };
        // A different mounting turns a unit but does not mirror it.
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

    /// Lists a comparison that was not possible, with advice on what would help.
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

    /// The axes of a channel differ from the declared ones.
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
                remedy(channel, &axes).and(&open)
            }
            None => {
                let unknown: Vec<&str> = (0..3).filter(|i| known[*i].is_none()).map(|i| names(is_world)[i]).collect();
                match unknown[..] {
                    [] => Remedy::words("two axes seem to be the same: check the columns"),
                    _ if is_upside_down(track, known) => Remedy::words(format!(
                        "a unit that is upside down has its gyros turned too: {}, and the gyros likewise; or name the axes in which it is mounted",
                        remedy(channel, &UPSIDE_DOWN).words
                    )),
                    _ => Remedy::words(format!(
                        "change the columns or their signs; about {} these data say nothing",
                        unknown.join(" and ")
                    )),
                }
            }
        };
        let or = or.map_or_else(String::new, |or| format!("; or, {or}"));
        help.and(&or)
            .of(at("axes", node, track.channel, "columns", message), &self.table(track))
    }

    /// The numbers of a channel are too small or too large by a factor.
    pub(super) fn factor(&self, track: &Track, with: &str, small: f64, within: f64) -> Diagnostic {
        let message = format!("`{}` is {}, compared with {with}", self.name(track), sized(small));
        let node = self.node(track);
        let channel = node.at(&format!("channels.{}", track.channel));
        // A rate compared with a course includes slip and lag, so its tolerance is wide.
        let within = if track.channel == "velocity" { within.max(0.05) } else { 0.25 };
        let help = unit(channel, track.channel, small, within, track.rate);
        let help = help.unwrap_or_else(|| Remedy::words("check `unit` and `scale`"));
        help.of(at("unit", node, track.channel, "unit", message), &self.table(track))
    }

    /// The attitude to compare the instruments with. It must not contradict the course.
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

    /// Compares headings with the course. Returns true if they do not contradict each other.
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
        let told = at("heading-form", self.node(track), track.channel, "quaternion", message);
        let told = help.of(told, &self.table(track));
        self.found.mistakes.push(told);
        false
    }

    /// For a heading that does not follow the course: the mistake and its correction, if it is in another unit.
    fn other_unit(&self, track: &Track, moved: &Moved, agreed: &Turned) -> Option<(String, Remedy)> {
        let declared = self
            .node(track)
            .at(&format!("channels.{}.unit", track.channel))
            .and_then(Node::as_str)?;
        let unit = ["deg", "rad"].into_iter().find(|unit| *unit != declared)?;
        let value = format!("{unit:?}");
        let other = self.read_as(track, &[("unit", value.clone())]).filter(|_| !agreed.is_tied())?;
        let is_right = Turned::of(&moved.headings(&other))?.is_right();
        is_right.then(|| (format!("it goes with the course as {unit}"), Remedy::write(&[("unit", value)])))
    }

    /// Judges each inertial unit.
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

    /// Compares the stamps of a unit with those of each source that measures rotation. Returns the delay of that
    /// source's stamps \[s\].
    fn clocks(&mut self, rates: &Track, velocities: &[Moved], attitude: Option<&Seen>) -> f64 {
        let mut told: Vec<(usize, &str, Vec<motion::Told>)> = Vec::new();
        // A declared delay is not a clock error.
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
        // If a source agrees with the unit, the other sources are wrong. Otherwise the unit is.
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

    /// The delays that the design declares for sensors of a type that read a source \[s\].
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

    /// The stamps of a source disagree with another clock.
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
        let edit = Edit::set(format!("source.{}.time.offset", named.name), format!("\"{offset:.2} s\""));
        let help = format!("{edit}, or find out which of the two clocks is wrong");
        let place = named
            .node
            .at("time.offset")
            .map_or_else(|| named.node.place_of("time"), Node::place);
        Diagnostic::warning(message).at(place).rule("clock").help(help).edits(vec![edit])
    }

    /// Compares a specific force with gravity and with the motion, for times at which the gyros show hardly any
    /// rotation. Returns the correction.
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
        // A foot swings between two attitude samples. Then neither these samples nor the midpoint between them give the
        // mean.
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
            // Gravity determines the unit better than accelerations do.
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

    /// Compares angular rates with the rotation of the attitude, or of the course and of gravity.
    fn rates(&mut self, track: &Track, force: Option<(&Track, Force)>, moved: Option<&Moved>, attitude: Option<&Seen>, shift: f64) {
        let with = match (attitude, moved) {
            (Some(seen), _) => format!("the turns of `{}`", seen.name),
            (None, Some(moved)) => format!("the turns of {}", moved.name),
            (None, None) => return self.untold(track, "turns that something else shows", ALONE),
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
        // A correct attitude determines all axes of a unit that turns about all axes.
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

/// Returns true if a unit turns so little in an interval, `lag` earlier, that the midpoint attitude gives the mean.
pub(super) fn turns_little(rates: &Track, (from, to, _): &motion::Told, lag: f64) -> bool {
    let rate = rates.mean_length(from - lag, to - lag);
    rate.is_none_or(|rate| rate * (to - from) < motion::MUCH)
}

/// A rotation by 180° about the forward axis.
const UPSIDE_DOWN: Axes = [(0, false), (1, true), (2, true)];

/// Returns true if only gravity is known for the unit, and it points up.
fn is_upside_down(track: &Track, known: &[Option<(usize, bool)>; 3]) -> bool {
    track.channel == "specific_force" && *known == [None, None, Some((2, true))]
}

/// Returns true if a velocity moves, but never in both directions along any axis.
fn is_unsigned(track: &Track) -> bool {
    let one_way = |i: usize| track.values.iter().all(|v| v[i] >= 0.0) || track.values.iter().all(|v| v[i] <= 0.0);
    let moves = track.values.iter().any(|v| v[0] != 0.0 && v[1] != 0.0);
    track.channel == "velocity" && moves && (0..3).all(one_way)
}

/// An attitude to compare the instruments with.
struct Seen {
    source: usize,
    name: String,
    attitudes: Attitudes,
}

/// The data that would be enough to judge by a course ...
const FAST: &str = "not judged: a minute of turns at more than 2 m/s would tell";
/// ... and without a course.
pub(super) const LONG: &str = "not judged: both together for a minute would tell";
/// The text if no other channel measures motion.
const ALONE: &str = "not judged: an attitude, or a velocity of more than 2 m/s, would tell";

/// The missing data, if both channels share this number of intervals.
fn lack(count: usize) -> String {
    match count {
        0 => LONG.to_owned(),
        count => format!("not judged: both show {count} intervals of little turn, {ENOUGH} are needed"),
    }
}

/// The shift to report: the clock shift, or an early lag that smoothing in both directions does not explain \[s\].
fn early(lag: f64, shift: f64) -> f64 {
    if lag - shift < -0.25 { lag } else { shift }
}

/// Longer than waves and than the steps of a walk \[s\]. A result from a course must also hold over such intervals.
const SLOW: f64 = 15.0;
/// The text if it does not hold.
const WAVES: &str = "not decided: waves, or other fast motion, say something else";

/// Checks fast motion against slow motion. If fast motion contradicts the declaration and slow motion does not confirm
/// it, the result of slow motion replaces it. Returns true if anything was replaced.
///
/// Means over an interval between two velocities are right for any length. But an antenna on a mast moves relative to a
/// rolling boat, once or twice between two fixes.
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

/// The correlation at which fast motion alone is accepted, if slow motion is too short to decide. Waves and the slower
/// motion share an axis only in part; a mistake affects the whole axis.
const PLAIN: f64 = 0.8;
/// Standard errors from which slow motion confirms a certain result of fast motion.
const SLIGHT: f64 = 2.0;

/// The axes of a specific force that the data determine, and the factor by which it is too small.
type Force = ([Option<(usize, bool)>; 3], f64);

/// The rotation of gravity in the axes of a vehicle, which its roll and pitch rates cause. It is the change of the
/// specific force minus the accelerations along the course, from one interval to the next. An unknown axis of the force
/// gives no expected value.
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

/// The vector in the corrected axes.
pub(super) fn turned(v: &Vector3<f64>, axes: &Axes) -> Vector3<f64> {
    Vector3::from_fn(|row, _| if axes[row].1 { -v[axes[row].0] } else { v[axes[row].0] })
}
